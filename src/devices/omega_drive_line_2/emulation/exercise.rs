//! Exercises for `commram soak`: a master and a slave of CANsync with drives, the drive at the BAPS, and two RS485 ports.

use crate::devices::cansync::exercise;
use crate::devices::{Exercise, Move, Wrong};

/// All exercises of the device.
pub(in crate::devices) static EXERCISES: [&Exercise; 3] = [&CANSYNC, &BAPS, &SERIAL];

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

static SERIAL: Exercise = Exercise {
    name: "omega-serial",
    plant: include_str!("exercise_serial.toml"),
    settings: &[
        &[("SPEED", "9600"), ("WIRES", "4"), ("PARITY", "\"even\""), ("CODE", "2")],
        &[("SPEED", "38400"), ("WIRES", "2"), ("PARITY", "\"none\""), ("CODE", "0")],
        &[("SPEED", "1200"), ("WIRES", "2"), ("PARITY", "\"odd\""), ("CODE", "1")],
    ],
    script: include_str!("exercise_serial.rhai"),
    moves: &[
        Move::new("there", &[0..=255, 1..=200]).often(4),
        Move::new("back", &[0..=255, 1..=200]).often(4),
        Move::new("restart", &[]),
        Move::new("quiet", &[1..=1_000_000]),
    ],
    wrongs: &[
        Wrong { script: r#"poke("a:serial.u_RX_HEAD", 7);"#, rule: "owner" },
        Wrong {
            script: r#"poke("a:serial.u_TX_HEAD", (peek("a:serial.u_TX_HEAD") + 300) & 0xFFFF);"#,
            rule: "serial-ring",
        },
    ],
    allowed: &[],
};
