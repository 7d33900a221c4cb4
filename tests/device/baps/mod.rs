//! The BAPS of a PLC on plant level: registers on the one side, the drive on the other.

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
