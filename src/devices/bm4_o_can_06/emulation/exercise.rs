//! The exercise for `commram soak`: a master and a slave of CANsync in two PLCs, with drives.

use crate::devices::Exercise;
use crate::devices::cansync::exercise;

/// The only exercise of the device.
pub(in crate::devices) static EXERCISES: [&Exercise; 1] = [&Exercise {
    name: "bm4-cansync",
    plant: include_str!("exercise.toml"),
    settings: &[
        &[
            ("KBIT_S", "1000"),
            ("CARD", "0"),
            ("RATE", "[0x40, 0x34, 1]"),
            NAMES[0],
            NAMES[1],
            NAMES[2],
            NAMES[3],
        ],
        &[
            ("KBIT_S", "500"),
            ("CARD", "1"),
            ("RATE", "[0x41, 0x34, 2]"),
            NAMES[0],
            NAMES[1],
            NAMES[2],
            NAMES[3],
        ],
        &[
            ("KBIT_S", "250"),
            ("CARD", "1"),
            ("RATE", "[0x43, 0x34, 4]"),
            NAMES[0],
            NAMES[1],
            NAMES[2],
            NAMES[3],
        ],
        &[
            ("KBIT_S", "125"),
            ("CARD", "1"),
            ("RATE", "[0x47, 0x34, 8]"),
            NAMES[0],
            NAMES[1],
            NAMES[2],
            NAMES[3],
        ],
    ],
    script: exercise::SCRIPT,
    moves: &exercise::MOVES,
    wrongs: &exercise::WRONGS,
    allowed: &[],
}];

const NAMES: [(&str, &str); 4] = [
    ("MASTER", "\"top:slotM\""),
    ("SLAVE", "\"maxx:slotH\""),
    ("BUS", "\"drives\""),
    ("PLCS", "[\"top\", \"maxx\"]"),
];
