//! The emulation of CANsync: frames and their times, the bus, the firmware of the nodes, drives with a CANsync card.

pub mod bus;
pub(crate) mod demo;
pub mod drive;
pub(crate) mod exercise;
pub(crate) mod faults;
pub mod firmware;
pub mod frames;
mod messages;
pub mod records;
pub mod rules;
mod watch;
