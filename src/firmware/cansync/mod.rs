//! The two CANsync nodes of the board: node 1 as slave, node 2 as master.
//!
//! `node` holds what both share: the general registers and the state machine between
//! `w_CPU_CONTROL` and `w_OPTION_STATUS`; `init` checks initialization data; `master` and `slave`
//! add the process data; `polling` is the master's set-up mode; below `slave` lies its side of jobs.

mod actual;
mod init;
mod master;
mod node;
mod polling;
mod registers;
mod slave;

pub use init::{InitData, InitFault};
pub use master::{Built, Master};
pub use node::{Change, NodeState};
pub use registers::{Code, auto};
pub use slave::Slave;
