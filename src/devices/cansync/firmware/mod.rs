//! The two CANsync nodes of the board: node 1 as slave, node 2 as master.
//!
//! `node` holds what both share: the general registers and the state machine between
//! `w_CPU_CONTROL` and `w_OPTION_STATUS`, `orders` reads the former; `controller` is its CAN controller, which can fail; `init` checks
//! initialization data; `master` and `slave` add the process data; `polling` is the master's set-up mode; `punctual`
//! remembers missed deadlines for the access checker; `command` shares its command channel out
//! in active operation, to `broadcast`, `parameter_job` and `updown_job`; below `slave` lies its side of
//! jobs.

mod actual;
pub mod auto;
mod block;
mod broadcast;
mod command;
mod controller;
mod init;
mod job_registers;
mod master;
mod node;
mod orders;
mod parameter_job;
mod polling;
mod punctual;
mod slave;
mod updown_job;
mod word_config;

pub use init::{InitData, InitFault};
pub use master::{Built, Master};
pub(crate) use node::find_number_taken;
pub use node::{Change, NodeState, Seat};
pub(crate) use orders::note_restarts;
pub use slave::Slave;
