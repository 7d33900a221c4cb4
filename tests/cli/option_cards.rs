//! Option cards: their registers in the memory of a PLC, in every command.

use crate::common::{Emulator, finish, run};
use crate::folders::Place;
use std::fs;
use std::path::Path;
use std::process::Command;

/// A PLC with the encoder in slot 1.
pub(crate) fn place_with_encoder() -> Place {
    let place = Place::new();
    let encoder = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/encoder");
    place.write(
        "plant.toml",
        &format!("[[plc]]\nname = 'line'\n[[plc.option]]\nslot = 1\ncard = '{encoder}'\n"),
    );
    place
}

#[test]
fn every_command_knows_the_registers_of_an_option_card() {
    let place = place_with_encoder();
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    emulator.poke(&["line:encoder1.w_COMMAND=7"]);
    emulator.step(&["5ms"]);
    assert_eq!(emulator.peek(&["line:encoder1.w_COMMAND", "line:%MW3.1000000"]), "16#0006 16#0006");
    assert_eq!(emulator.peek(&["line:node2.w_OPTION_STATUS"]), "16#0001");
    assert!(emulator.run("dump", &["line:encoder1", "--full"]).ok().contains("%MD3.1000020"));
    assert!(emulator.run("find", &["di_SYNC_LATCH"]).ok().contains("encoder1.di_SYNC_LATCH"));
    // The pages of a card are those of its own manual.
    let described = emulator.run("map", &["line:encoder1.w_COMMAND"]);
    assert!(
        described.ok().contains("p. 1 of encoder-1.0")
            && described.out.contains("inferred D-815")
            && !described.out.contains("5.00005"),
        "{}",
        described.out
    );
    assert!(emulator.run("trace", &[]).ok().contains("line:option1 "));
    let list = run(&["list"]);
    assert!(list.ok().contains("line line-option1"), "{}", list.out);
    let snapshot = place.path("past.cmrm");
    emulator.run("snapshot", &[&snapshot]).ok();
    emulator.poke(&["line:encoder1.w_COMMAND=7"]);
    emulator.run("restore", &[&snapshot]).ok();
    assert_eq!(emulator.peek(&["line:encoder1.w_COMMAND"]), "16#0006");
}

/// The folders are only found by the paths that the instance publishes.
#[test]
fn the_map_and_the_exports_have_the_cards_of_a_plant() {
    let place = place_with_encoder();
    let line = format!("{}:line", place.path("plant.toml"));
    let map = run(&["map", "encoder1.di_POSITION", "--device", &line]);
    assert!(map.ok().contains("%MD3.1000020"), "{}", map.out);
    for format in ["c", "python", "csv", "json", "md", "st", "svd", "systemrdl", "matiec"] {
        let export = run(&["export", format, "--device", &line]);
        assert!(export.ok().contains("di_POSITION") || format == "matiec", "{format}: {}", export.out);
    }
    // Pages and decisions of a card are not those of the PLC.
    let card = place.path("card");
    let encoder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/devices/encoder");
    finish(Command::new("cp").arg("-r").arg(encoder).arg(&card)).ok();
    let structure = fs::read_to_string(place.path("card/ENCODER.toml")).unwrap();
    place.write(
        "card/ENCODER.toml",
        &structure.replace("offsets = \"manual\"", "offsets = \"inferred D-02\""),
    );
    let plant = format!("[[plc]]\nname = 'line'\n[[plc.option]]\nslot = 1\ncard = '{card}'\n");
    place.write("inferred.toml", &plant);
    let inferred = format!("{}:line", place.path("inferred.toml"));
    for (format, mark) in [
        ("c", "(p. 1 of encoder-1.0; inferred: offset D-02 of encoder)"),
        ("csv", "1 of encoder-1.0,\"area D-815, offset D-02 of encoder, variable D-815\""),
        ("json", "\"inferred D-02 of encoder\""),
    ] {
        let export = run(&["export", format, "--device", &inferred]);
        assert!(export.ok().contains(mark), "{format}: {}", export.out);
    }
    // One export has one meaning of each name.
    place.write(
        "card/ENCODER.toml",
        &structure.replace("doc = \"Bit 0 ready", "meaning = \"stat_sl\", doc = \"Bit 0 ready"),
    );
    place.write(
        "card/meanings.toml",
        "[[meaning]]\nname = 'stat_sl'\npage = '1'\nvalue = [{ is = 1, text = 'ready' }]\n",
    );
    let device = fs::read_to_string(place.path("card/device.toml")).unwrap();
    place.write("card/device.toml", &format!("parts = ['meanings.toml']\n{device}"));
    for format in ["c", "python", "json", "md"] {
        let export = run(&["export", format, "--device", &inferred]);
        assert!(export.fails(2).contains("of two meanings `stat_sl`"), "{format}: {}", export.err);
        run(&["export", format, "--device", &inferred, "--block", "encoder1"]).ok();
    }
    let unknown = run(&["map", "--device", &line.replace(":line", ":other")]);
    assert!(
        unknown.fails(2).contains("has no device 'other'; its devices: line, line-option1"),
        "{}",
        unknown.err
    );
}

const CARD_CLIENT: &str = r#"
#include "commram.h"
int main(int argc, char **argv)
{
    commram ram;
    commram_result result = argc == 2 ? commram_attach(&ram, argv[1], 1) : COMMRAM_NO_IMAGE;
    if (result != COMMRAM_DONE) {
        printf("%s\n", commram_text(result));
        return 1;
    }
#ifdef CARD
    COMMRAM_STORE(commram_encoder1(&ram)->w_COMMAND, 7);
    commram_ring(&ram);
    commram_await(&ram, &commram_encoder1(&ram)->w_COMMAND, 2, 0xFFFF, 6, 1000);
    printf("%04X\n", (unsigned)COMMRAM_LOAD(commram_encoder1(&ram)->w_COMMAND));
#else
    printf("attached\n");
#endif
    commram_detach(&ram);
    return 0;
}
"#;

/// A program with the map of PLC and card exchanges data with the card; a program with the map of the PLC alone attaches; a
/// program with the card does not attach to a PLC without it.
#[test]
fn c_programs_attach_to_a_plc_with_cards() {
    let place = place_with_encoder();
    place.write("client.c", CARD_CLIENT);
    let line = format!("{}:line", place.path("plant.toml"));
    let build = |device: &str, flag: &str| {
        run(&["export", "c", "--device", device, "--output", &place.path("commram.h")]).ok();
        let program = place.path(flag);
        let client = place.path("client.c");
        finish(Command::new("cc").args(["-std=c11", &format!("-D{flag}"), "-o", &program, &client])).ok();
        program
    };
    let with_card = build(&line, "CARD");
    let alone = build("omega-drive-line-2", "ALONE");
    let emulator = Emulator::start(&[&place.path("plant.toml")]);
    let image = format!("/dev/shm/commram.{}.line", emulator.name);
    assert_eq!(finish(Command::new(&with_card).arg(&image)).ok(), "0006\n");
    assert_eq!(finish(Command::new(&alone).arg(&image)).ok(), "attached\n");
    let other = Emulator::start(&[]);
    let image = format!("/dev/shm/commram.{}.line", other.name);
    let refused = finish(Command::new(&with_card).arg(&image));
    assert!(refused.code == Some(1) && refused.out.contains("register map"), "{}", refused.out);
    assert_eq!(finish(Command::new(&alone).arg(&image)).ok(), "attached\n");
}

/// A running instance with a card that declares a fault: changes, faults, going back and comparisons.
#[test]
fn a_card_is_watched_disturbed_and_taken_back() {
    let place = place_with_encoder();
    let card = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/devices/encoder");
    for file in ["device.toml", "ENCODER.toml", "firmware.rhai"] {
        place.write(file, &fs::read_to_string(card.join(file)).unwrap());
    }
    let handshakes = fs::read_to_string(card.join("handshakes.toml")).unwrap();
    let handshakes = handshakes.replace("after = \"1ms\"", "after = \"1ms\"\nunless_fault = \"deaf\"");
    let fault = "[[fault]]\nname = 'deaf'\ntext = 'The card does not answer command 7'\npage = '1'\n";
    place.write("handshakes.toml", &format!("{handshakes}{fault}"));
    place.write("plant.toml", "[[plc]]\nname = 'line'\n[[plc.option]]\nslot = 2\ncard = './.'\n");
    let emulator = Emulator::start(&[&place.path("plant.toml"), "--clock", "stepped"]);
    emulator.step(&["1ms"]);
    // The fault acts on the card, which has a name of the PLC and the slot.
    emulator.run("fault", &["add", "deaf", "duration=5ms"]).ok();
    let list = emulator.run("fault", &["list"]);
    assert!(list.ok().contains("deaf plc=line-option2"), "{}", list.out);
    emulator.poke(&["line:encoder2.w_COMMAND=7", "line:encoder2.di_SPEED=1000"]);
    emulator.step(&["4ms"]);
    assert_eq!(emulator.peek(&["line:encoder2.w_COMMAND"]), "16#0007");
    let before = place.path("before");
    fs::write(&before, emulator.run("dump", &["line:encoder2", "--format", "json"]).ok()).unwrap();
    emulator.step(&["4ms"]);
    assert_eq!(emulator.peek(&["line:encoder2.w_COMMAND"]), "16#0006");
    let diff = emulator.run("diff", &[&before]);
    assert!(
        diff.out.contains("encoder2.w_COMMAND") && diff.out.contains("di_POSITION"),
        "{}{}",
        diff.out,
        diff.err
    );
    emulator.step(&["--back", "4ms"]);
    assert_eq!(emulator.peek(&["line:encoder2.w_COMMAND"]), "16#0007");
    emulator.step(&["4ms"]);
    assert_eq!(emulator.peek(&["line:encoder2.w_COMMAND"]), "16#0006");
    // A forced register keeps its value when the card writes it.
    emulator.run("force", &["line:encoder2.di_POSITION=5"]).ok();
    emulator.step(&["4ms"]);
    assert_eq!(emulator.peek(&["line:encoder2.di_POSITION"]), "16#00000005");
    let plot = place.path("plot.svg");
    let plotted = emulator.run("plot", &["line:encoder2.w_COMMAND", "--output", &plot]);
    assert_eq!(plotted.code, Some(0), "{}", plotted.err);
    assert!(fs::read_to_string(&plot).unwrap().contains("encoder2.w_COMMAND"));
    let status = emulator.run("status", &[]);
    assert!(status.ok().contains("line-option2"), "{}", status.out);
}
