//! The function blocks for CANsync against the live firmware, in the roles the manuals give them, on each device.
//! Module `device` of each device holds its differences. Pages are those of manual 5.00005.03a.

pub(crate) mod bench;
mod command_channel;
mod disturbed;
mod parameter;
mod played;
mod process_data;
mod start;
mod updownload;

use super::device;
