//! Exercises for `commram soak`. In one, a master reads and writes the entries of a CANopen slave. In the
//! other, a master has an I/O module.

use crate::devices::{Exercise, Move, Wrong};

pub(in crate::devices) static EXERCISES: [&Exercise; 2] = [&SLAVE, &MASTER];

static SLAVE: Exercise = Exercise {
    name: "cs0015-slave",
    plant: include_str!("exercise_slave.toml"),
    settings: &[&[("KBIT_S", "125")], &[("KBIT_S", "500")], &[("KBIT_S", "1000")]],
    script: include_str!("exercise_slave.rhai"),
    moves: &[
        Move::new("entry", &[0..=255]).often(3),
        Move::new("no_entry", &[0x5000..=0x57FF]),
        Move::new("pdos", &[0..=0xFFFF, 0..=0xFFFF]).often(4),
        Move::new("guarding", &[1..=5]).often(2),
        Move::new("pre_operational", &[]),
        Move::new("quiet", &[1..=2_000_000]).often(3),
        Move::new("power", &[]),
    ],
    wrongs: &[Wrong { script: r#"poke("panel:flags.NODEID", 5);"#, rule: "owner" }],
    allowed: &[],
};

static MASTER: Exercise = Exercise {
    name: "cs0015-master",
    plant: include_str!("exercise_master.toml"),
    settings: &[&[("KBIT_S", "125")], &[("KBIT_S", "500")]],
    script: include_str!("exercise_master.rhai"),
    moves: &[
        Move::new("quiet", &[1..=2_000_000]).often(4),
        Move::new("module_without_supply", &[1..=2_000_000]),
    ],
    wrongs: &[],
    allowed: &[],
};
