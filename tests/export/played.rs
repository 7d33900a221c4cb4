//! Exercises of the devices on running emulators, for exports that describe the traffic of buses.

use crate::common::{Emulator, run};
use std::path::{Path, PathBuf};

/// An exercise of a device: its plant, the names of its script, the script, and calls of all moves.
pub(crate) struct Played {
    pub plant: &'static str,
    names: &'static [(&'static str, &'static str)],
    script: &'static str,
    moves: &'static str,
    pub bus: &'static str,
    /// Messages that the frames must contain; none of a bus that is no CAN bus.
    pub contains: &'static [&'static str],
}

const CANSYNC: &str = include_str!("../../src/devices/cansync/emulation/exercise.rhai");
const CANSYNC_MOVES: &str = "exchange(true, 0, -5000, 3); exchange(true, 2, 70000, 3); parameter(true, 1, 500); \
     no_parameter(true, 2); control_words(true, 1); quiet(true, 20000); restart(true);";
const CANSYNC_MESSAGES: &[&str] =
    &["WRC1_0", "WRC1_2", "RDC1_0", "RDC1_2", "JOB_1", "RESPONSE_1", "JOB_2", "RESPONSE_2", "ACTION"];

pub(crate) const PLAYED: [Played; 5] = [
    Played {
        plant: include_str!("../../src/devices/omega_drive_line_2/emulation/exercise_cansync.toml"),
        names: &[
            ("KBIT_S", "500"),
            ("RATE", "[0x00, 0x1C, 2]"),
            ("MASTER", "\"a:node2\""),
            ("SLAVE", "\"b:node1\""),
            ("BUS", "\"drives\""),
            ("PLCS", "[\"a\", \"b\"]"),
        ],
        script: CANSYNC,
        moves: CANSYNC_MOVES,
        bus: "drives",
        contains: CANSYNC_MESSAGES,
    },
    Played {
        plant: include_str!("../../src/devices/bm4_o_can_06/emulation/exercise.toml"),
        names: &[
            ("KBIT_S", "500"),
            ("CARD", "1"),
            ("RATE", "[0x41, 0x34, 2]"),
            ("MASTER", "\"top:slotM\""),
            ("SLAVE", "\"maxx:slotH\""),
            ("BUS", "\"drives\""),
            ("PLCS", "[\"top\", \"maxx\"]"),
        ],
        script: CANSYNC,
        moves: CANSYNC_MOVES,
        bus: "drives",
        contains: CANSYNC_MESSAGES,
    },
    Played {
        plant: include_str!("../../src/devices/cs0015/emulation/exercise_slave.toml"),
        names: &[("KBIT_S", "125")],
        script: include_str!("../../src/devices/cs0015/emulation/exercise_slave.rhai"),
        moves: "entry(true, 0); no_entry(true, 0x5000); pdos(true, 1, 0xFFFF); guarding(true, 3); \
                pre_operational(true); quiet(true, 1000); power(true);",
        bus: "open",
        contains: &["NMT", "panel_SDO_REQUEST", "panel_SDO_ANSWER", "panel_STATE"],
    },
    Played {
        plant: include_str!("../../src/devices/cs0015/emulation/exercise_master.toml"),
        names: &[("KBIT_S", "125")],
        script: include_str!("../../src/devices/cs0015/emulation/exercise_master.rhai"),
        moves: "quiet(true, 1000); module_without_supply(true, 500000);",
        bus: "open",
        contains: &["NMT", "inputs_STATE"],
    },
    Played {
        plant: include_str!("../../src/devices/can_dp2/emulation/exercise.toml"),
        names: &[("CAN", "1000"), ("DP", "1500"), ("RATE", "0")],
        script: include_str!("../../src/devices/can_dp2/emulation/exercise.rhai"),
        moves: "exchange(true, 5, 7); diagnosis(true); restart(true); quiet(true, 1000);",
        bus: "dp",
        contains: &[],
    },
];

impl Played {
    /// Plays the exercise on a new emulator with a stepped clock; returns the plant file and the emulator.
    pub(crate) fn play(&self, directory: &Path) -> (PathBuf, Emulator) {
        let (plant, script) = (directory.join("plant.toml"), directory.join("all.rhai"));
        let mut text = self.plant.to_owned();
        self.names.iter().for_each(|(name, value)| text = text.replace(&format!("${{{name}}}"), value));
        std::fs::write(&plant, text).unwrap();
        let names = self.names.iter().map(|(name, value)| format!("const {name} = {value};\n"));
        let names = names.collect::<String>();
        let text = format!("{names}fn pass(us) {{ step(us); }}\n{}\nstart();\n{}\n", self.script, self.moves);
        std::fs::write(&script, text).unwrap();
        let emulator = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
        let played = run(&["test", script.to_str().unwrap(), "--attach", &emulator.name]);
        assert_eq!(played.code, Some(0), "{}{}", played.out, played.err);
        (plant, emulator)
    }
}
