//! Exercises for `commram soak`. In one, a master and a slave of CANsync have drives. Another one uses the
//! drive at the BAPS.

use crate::devices::cansync::exercise;
use crate::devices::exercise::{Exercise, Move, Wrong};

/// All exercises of the device.
pub(in crate::devices) static EXERCISES: [&Exercise; 2] = [&CANSYNC, &BAPS];

static CANSYNC: Exercise = Exercise {
    name: "omega-cansync",
    plant: include_str!("exercise_cansync.toml"),
    settings: &[
        &[("KBIT_S", "500"), ("RATE", "[0x00, 0x1C, 2]"), NAMES[0], NAMES[1], NAMES[2], NAMES[3]],
        &[("KBIT_S", "250"), ("RATE", "[0x01, 0x1C, 4]"), NAMES[0], NAMES[1], NAMES[2], NAMES[3]],
        &[("KBIT_S", "125"), ("RATE", "[0x03, 0x1C, 8]"), NAMES[0], NAMES[1], NAMES[2], NAMES[3]],
    ],
    script: exercise::SCRIPT,
    moves: &exercise::MOVES,
    wrongs: &exercise::WRONGS,
    allowed: &[],
};

const NAMES: [(&str, &str); 4] =
    [("MASTER", "\"a:node2\""), ("SLAVE", "\"b:node1\""), ("BUS", "\"drives\""), ("PLCS", "[\"a\", \"b\"]")];

static BAPS: Exercise = Exercise {
    name: "omega-baps",
    plant: include_str!("exercise_baps.toml"),
    settings: &[&[]],
    script: include_str!("exercise_baps.rhai"),
    moves: &[
        Move::new("follow", &[0..=1_000_000, 3..=200]).often(6),
        Move::new("no_parameter", &[900..=999]),
        Move::new("quiet", &[1..=2_000_000]).often(2),
    ],
    wrongs: &[Wrong { script: r#"poke("baps.b_SL_QUIT", 0x55);"#, rule: "owner" }],
    allowed: &[],
};
