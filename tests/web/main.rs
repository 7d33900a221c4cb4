//! `commram web` as a process, driven through real sockets.

#[path = "../common/mod.rs"]
mod common;

mod access;
mod attack;
mod browser;
mod ending;
mod events;
mod operations;
mod pages;
mod scenario;
mod server;
