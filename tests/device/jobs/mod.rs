//! The master's command channel: broadcast and control word commands, parameter jobs, up- and downloads.
//!
//! T10 to T36 are the numbers of worked examples, the same in all tests; "5.02066.01a" is the manual of
//! BM4-O-CAN-06, a module of the same family with the same names of registers and jobs.

mod bench;
mod broadcast;
mod mixes;
mod pairs;
mod parameter;
mod updown;
