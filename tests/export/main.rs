//! Declarations for other languages and tools, and the programs that read them.

#[path = "../common/mod.rs"]
mod common;

mod c;
mod dbc;
mod foreign_3964r;
mod formats;
mod layout_moves;
mod matiec;
mod openplc;
mod played;
mod serial_partner;
mod st_blocks;
mod starts;
mod strucpp;
mod tools;
mod wireshark;
