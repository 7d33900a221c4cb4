//! The two CANsync nodes of the board: node 1 as slave, node 2 as master.
//!
//! The modules:
//! - `node`: common part of both nodes: the general registers and the state machine between `w_CPU_CONTROL` and
//!   `w_OPTION_STATUS`
//! - `orders`: reads `w_CPU_CONTROL`
//! - `controller`: the CAN controller and its failures
//! - `init`: checks initialization data
//! - `master`, `slave`: process data
//! - `polling`: set-up mode of the master
//! - `deadlines`: missed deadlines, for the access checker
//! - `command`: the master's command channel in active operation, for `broadcast`, `parameter_job` and `updown_job`
//! - `slave` also has the slave's side of jobs

mod actual;
pub(crate) mod auto;
mod block;
mod broadcast;
mod command;
mod controller;
mod deadlines;
mod init;
mod job_registers;
mod master;
mod node;
mod orders;
mod parameter_job;
mod polling;
mod slave;
mod updown_job;
mod word_config;

pub use init::{InitData, InitFault};
pub use master::{Built, Master};
pub(crate) use node::report_number_taken;
pub use node::{Change, NodeLocation, NodeState};
pub(crate) use orders::note_restarts;
pub use slave::Slave;
