//! What documentation and examples promise, word by word.

#[path = "../common/mod.rs"]
mod common;

mod architecture;
mod ci;
mod commands;
mod features;
mod heads;
mod pages;
mod programs;
mod promises;
mod public_api;
mod shell;
