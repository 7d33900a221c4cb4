//! The built program on the command line, against emulators as processes of their own.

#[path = "../common/mod.rs"]
mod common;

mod baps;
mod bm4;
mod board;
mod busy;
mod can_dp2;
mod changes;
mod check;
mod completion;
mod cs0015;
mod damaged;
mod demo;
mod doors;
mod drives;
mod ending;
mod exit_codes;
mod faults;
mod federates;
mod footprint;
mod force;
mod hostile_files;
mod hostile_scenarios;
mod instances;
mod killed;
mod layout;
mod limits;
mod names;
mod novram;
mod offline;
mod one_answer;
mod other_users;
mod pictures;
mod plants;
mod profibus_door;
mod registers;
mod scenarios;
mod schemas;
mod shm;
mod simulators;
mod soak;
mod starting;
mod trace;
mod travel;
mod viewers;
