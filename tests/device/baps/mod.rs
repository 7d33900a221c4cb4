//! The BAPS of a PLC in a plant: the tests write and read its registers, and watch the drive.

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
