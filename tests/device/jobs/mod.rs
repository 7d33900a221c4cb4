//! The master's command channel: broadcast and control word commands, parameter jobs, up- and downloads.
//!
//! Worked examples carry the numbers T10 to T36 of one list for all tests; "5.02066.01a" is the manual of
//! BM4-O-CAN-06, a module of the same family with the same names of registers and jobs.

mod bench;
mod broadcast;
mod mixes;
mod pairs;
mod parameter;
mod updown;
