//! The emulated device in this process: nodes, buses, BAPS, board, faults and access checker, at the microsecond.

#[path = "../rig/mod.rs"]
mod rig;

mod any_image;
mod any_plc;
mod baps;
mod bm4;
mod board;
mod bus;
mod check;
mod clusters;
mod determinism;
mod faults;
#[cfg(feature = "script")]
mod folder_phases;
mod folder_ports;
mod folders;
mod forces;
mod history;
mod jobs;
mod journal;
mod profibus;
mod serial;
mod serial_drives;
mod slave_any;
mod slave_jobs;
mod slave_on_bus;
mod slave_updown;
mod slots;
mod snapshots;
mod states;
mod vectors;
