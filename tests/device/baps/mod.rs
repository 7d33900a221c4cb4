//! The BAPS of a PLC in a plant, with registers on one side and the drive on the other.

mod bench;
mod configuration;
mod exchange;
mod faults;
mod journal;
mod mixes;
mod monitoring;
mod restart;
mod service;
mod sync;
