//! The `commram` command.

fn main() {}
