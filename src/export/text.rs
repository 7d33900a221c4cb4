//! Small pieces of text that several formats need.

use super::scope::Scope;
use crate::layout::{Dim, Register};

/// What the comment at the head of every exported file says.
pub fn banner(scope: &Scope, format: &str) -> [String; 3] {
    let device = scope.device;
    let block = match scope.areas.as_slice() {
        [area] => format!(" --block {}", area.name),
        _ => String::new(),
    };
    [
        format!("Registers of the {} (manual {}), segment 3.", device.title, device.manual),
        format!("Made by commram {} with `commram export {format}{block}`; do not edit.", version()),
        format!("Layout hash 16#{:016X}.", device.layout_hash),
    ]
}

/// The version of commram.
pub const fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// Array bounds in brackets: `[32][16]`.
pub fn bounds(dims: &[Dim]) -> String {
    dims.iter().map(|dim| format!("[{}]", dim.count)).collect()
}

/// Bounds of the part in use, if only a part is: `[0..31][0..7]`.
pub fn used(register: &Register) -> Option<String> {
    if register.dims.iter().all(|dim| dim.used == dim.count) {
        return None;
    }
    Some(register.dims.iter().map(|dim| format!("[0..{}]", dim.used.saturating_sub(1))).collect())
}

/// A register's description on one line: owner, purpose, what is reserved.
pub fn remark(register: &Register) -> String {
    let owner = register.owner.to_string();
    if register.reserved {
        return format!("{owner}: {}", register.doc);
    }
    match used(register) {
        Some(used) => format!("{owner}: {}; {used} in use", register.doc),
        None => format!("{owner}: {}", register.doc),
    }
}

/// `event_slot` for `EventSlot`.
pub fn snake(name: &str) -> String {
    let mut snake = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !snake.is_empty() {
            snake.push('_');
        }
        snake.push(c.to_ascii_lowercase());
    }
    snake
}
