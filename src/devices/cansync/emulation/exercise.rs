//! Exercises for every device with two CANsync nodes: correct programs, and wrong operations that a rule must report.

use crate::devices::{Move, Wrong};

/// The script with the functions named in [`MOVES`].
pub(in crate::devices) const SCRIPT: &str = include_str!("exercise.rhai");

/// Operations of a correct program at a master.
pub(in crate::devices) static MOVES: [Move; 6] = [
    Move::new("exchange", &[0..=2, -1_000_000..=1_000_000, 1..=40]).often(6),
    Move::new("parameter", &[1..=2, 0..=1_000_000]).often(3),
    Move::new("no_parameter", &[1..=2]),
    Move::new("control_words", &[1..=2]).often(2),
    Move::new("quiet", &[1..=2_000_000]).often(3),
    Move::new("restart", &[]),
];

/// Wrong operations in active operation, each with the rule that reports it.
pub(in crate::devices) static WRONGS: [Wrong; 5] = [
    Wrong { script: r#"poke(global::MASTER + ".w_OPTION_STATUS", 0x0001);"#, rule: "owner" },
    Wrong {
        script: r#"poke(global::MASTER + "._CFG_WRC_WORD.b_CFG_WRC1_WORD0", 0x71);"#,
        rule: "value-number",
    },
    Wrong { script: r#"poke(global::MASTER + ".b_SL_NR_CONTROLWORD", 40);"#, rule: "slave-number" },
    Wrong { script: r#"poke(global::SLAVE + ".w_CPU_CONTROL", 0x1234);"#, rule: "command" },
    Wrong {
        script: r#"poke(global::MASTER + ".a_CTRLREG_PAR_CMD_SL[1].b_STEUREG_PAR_CMD", 0x03);"#,
        rule: "order",
    },
];
