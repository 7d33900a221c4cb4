//! The exercise for `commram soak`: from a DP master to a CANopen controller and back.

use crate::devices::{Exercise, Move};

pub(in crate::devices) static EXERCISES: [&Exercise; 1] = [&Exercise {
    name: "can-dp2",
    plant: include_str!("exercise.toml"),
    settings: &[
        &[("DP", "1500"), ("CAN", "125"), ("RATE", "6")],
        &[("DP", "12000"), ("CAN", "500"), ("RATE", "2")],
        &[("DP", "93.75"), ("CAN", "1000"), ("RATE", "0")],
    ],
    script: include_str!("exercise.rhai"),
    moves: &[
        Move::new("exchange", &[0..=0xFFFF, 0..=0xFFFF]).often(6),
        Move::new("diagnosis", &[]).often(2),
        Move::new("quiet", &[1..=2_000_000]).often(2),
        Move::new("restart", &[]),
    ],
    wrongs: &[],
    allowed: &[],
}];
