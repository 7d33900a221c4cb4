//! The master's command channel: broadcast and control word commands, parameter jobs, up- and downloads.
//!
//! Worked examples carry the numbers T10 to T36 of one list for all tests; "5.02066.01a" is the sister manual
//! (BM4-O-CAN-06), whose registers and jobs are the same.

mod bench;
mod broadcast;
mod mixes;
mod pairs;
mod parameter;
mod updown;
