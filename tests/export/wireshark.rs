//! The exported dissector in tshark shows the texts of `commram trace`.

use crate::common::{Emulator, finish, is_there, run};
use crate::played::PLAYED;
use std::path::Path;
use std::process::Command;

/// Frames of a guest on CANsync with right and wrong contents, most of which no program sends.
const FOREIGN: &str = r#"
for data in ["80 00", "F0 00 01 02 03 04 05 06", "01", "90 05 00 00 00 00 01 00", "90 00 00 00 00 00 00 00", "A0 06",
             "70 79 01 00", "10 79 01 00 02 00", "70 79 01 02 03 04 05 06", "B0 0C", "90 01 02", "A0 06 01"] {
    send_frame("drives", 0x501, data);
}
for data in ["A0 00 01 00", "20 79 01 00 00 00", "20 79 34 12 01 00", "40 06", "80 06 01 02 03 04 05 06", "C0 06",
             "80 00", "00 79 01 00", "00 79 01 00 00", "00 79 01 02 03 04 05 06", "20 79", "A0 06", "40"] {
    send_frame("drives", 0x581, data);
}
for data in ["05 00 00 00 80 02 03 04", "01 02", "00 00 00 00 01 00 0F 00", "FF FF FF FF 02 00"] {
    send_frame("drives", 0x010, data);
}
send_frame("drives", 0x123, "01 02 03");
send_frame("drives", 0x380, "");
send_frame("drives", 0x200, "01");
step(20000);
"#;

/// Returns the texts of a trace, without the names of senders, which a capture does not contain.
fn traced(emulator: &Emulator) -> Vec<String> {
    let kinds = "frame,foreign_frame,can_frame,dp_telegram,dp_short";
    let lines = emulator.run("trace", &["--kind", kinds]);
    let text = |line: &str| {
        let text = line.trim_start().splitn(4, ' ').nth(3).unwrap_or_default();
        let text = text.trim_start().split_once(' ').map_or("", |(_, text)| text).trim_start();
        let text = text.strip_suffix(", outside of the slots").unwrap_or(text);
        // The sender of a telegram is followed by its service and its meaning.
        let is_telegram = text.starts_with(|c: char| c.is_ascii_digit()) && !text.starts_with("16#");
        let sender = if is_telegram { text.split_once(" from ") } else { text.rsplit_once(" from ") };
        let Some((text, _)) = sender else { return text.to_owned() };
        text.trim_end_matches(',').to_owned()
    };
    lines.ok().lines().map(text).collect()
}

/// Returns the values of a field of the dissector, a line for each packet.
fn dissected(dissector: &Path, capture: &Path, field: &str) -> Vec<String> {
    let mut command = Command::new("tshark");
    command.arg("-r").arg(capture).arg("-X").arg(format!("lua_script:{}", dissector.display()));
    let outcome = finish(command.args(["-T", "fields", "-E", "occurrence=a", "-e", field]));
    assert_eq!(outcome.code, Some(0), "{}", outcome.err);
    assert!(!outcome.err.contains("Lua"), "{}", outcome.err);
    outcome.out.lines().map(str::to_owned).collect()
}

fn capture(emulator: &Emulator, path: &Path) {
    let mut trace = emulator.command("trace", &["--format", "pcapng"]);
    let status = trace.stdout(std::fs::File::create(path).unwrap()).status().unwrap();
    assert!(status.success());
}

#[test]
fn tshark_shows_the_texts_of_trace() {
    if !is_there("tshark") {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let (dissector, file) = (directory.path().join("plant.lua"), directory.path().join("bus.pcapng"));
    for it in &PLAYED {
        let (plant, emulator) = it.play(directory.path());
        if it.plant.contains("drive") {
            let script = directory.path().join("foreign.rhai");
            std::fs::write(&script, FOREIGN).unwrap();
            let args = ["test", script.to_str().unwrap(), "--attach", &emulator.name, "--allow-empty"];
            assert_eq!(run(&args).code, Some(0));
        }
        let plant = plant.to_str().unwrap();
        run(&["export", "wireshark", "--plant", plant, "--output", dissector.to_str().unwrap()]).ok();
        capture(&emulator, &file);
        let (shown, expected) = (dissected(&dissector, &file, "commram.text"), traced(&emulator));
        assert!(expected.len() > 15, "{expected:?}");
        assert_eq!(shown, expected, "{}", it.bus);
        let messages = dissected(&dissector, &file, "commram.message");
        for message in it.contains {
            assert!(messages.iter().any(|it| it == message), "{message}: {messages:?}");
        }
        let signals = dissected(&dissector, &file, "commram.signal").join("\n");
        let signal = match it.bus {
            "drives" => "number = 121 (Number of the parameter; length or offset of a block)",
            "open" => "command = 1",
            _ => "service = Set_Prm",
        };
        assert!(signals.contains(signal), "{signal}\n{signals}");
    }
}

#[test]
fn wrong_use_is_explained() {
    let directory = tempfile::tempdir().unwrap();
    let plant = directory.path().join("plant.toml");
    std::fs::write(&plant, "[[plc]]\nname = 'line'\n[[bus]]\nname = 'one'\nkind = 'can'\nkbit_s = 125\n")
        .unwrap();
    let plant = plant.to_str().unwrap();
    for (args, why) in [
        (&[][..], "give the plant that contains the buses, --plant plant.toml; `commram new DIR`"),
        (&["--plant", plant, "--bus", "two"], "its buses are: "),
        (&["--plant", plant, "--block", "node1"], "a dissector has no registers"),
    ] {
        assert!(run(&[&["export", "wireshark"], args].concat()).fails(2).contains(why), "{args:?}");
    }
}
