//! The function blocks for CANsync against the live firmware, on each device, in the roles that the manuals give them.
//! Each device has a module `device` with its differences. Pages are those of manual 5.00005.03a.

pub(crate) mod bench;
mod command_channel;
mod disturbed;
mod parameter;
mod played;
mod process_data;
mod start;
mod updownload;

use super::device;
