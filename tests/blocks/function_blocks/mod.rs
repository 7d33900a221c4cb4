//! The vendor's function blocks against the live firmware, in the roles the manual gives them.

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

mod baps;
mod baps_faults;
mod baps_inputs;
mod bench;
mod board;
mod command_channel;
mod disturbed;
mod documented;
mod parameter;
mod process_data;
mod service_data;
mod start;
mod tasks;
mod updownload;
