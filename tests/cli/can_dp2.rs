//! The CAN-DP/2 through the built program: its plant and its demonstration.

use crate::common::{Emulator, finish, is_there, run};

const PLANT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/plants/can-dp2.toml");

#[test]
fn a_shell_plays_the_dp_master() {
    let emulator = Emulator::start(&[PLANT, "--clock", "stepped"]);
    emulator.poke(&["gw:mst.mst_dsap=60", "gw:mst.mst_control=16#05"]);
    emulator.run("wait", &["gw:mst.mst_control==16#04"]).ok();
    let octets = emulator.peek(&["gw:mst.mst_reply[0]", "gw:mst.mst_reply[1]", "gw:mst.mst_reply[3]"]);
    assert_eq!(octets, "16#02 16#05 16#FF");
    emulator.run("board", &["set", "gw:switches=16#07"]).ok();
    assert_eq!(emulator.peek(&["gw:front.address"]), "16#00000005");
    emulator.run("board", &["power-cycle", "gw"]).ok();
    emulator.step(&["1ms"]);
    assert_eq!(emulator.peek(&["gw:front.address"]), "16#00000007");
}

#[test]
fn wireshark_shows_an_interface_with_its_frames_for_each_bus() {
    if !is_there("tshark") {
        return;
    }
    let emulator = Emulator::start(&[PLANT, "--clock", "stepped"]);
    emulator.poke(&["gw:mst.mst_dsap=60", "gw:mst.mst_control=16#05"]);
    emulator.run("wait", &["gw:mst.mst_control==16#04"]).ok();
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(&file, "(0.000000) open 123#AA\n").unwrap();
    emulator.run("bus", &["play", file.path().to_str().unwrap()]).ok();
    emulator.step(&["10ms"]);
    let mut trace = emulator.command("trace", &["--format", "pcapng"]);
    assert!(trace.stdout(std::fs::File::create(&file).unwrap()).status().unwrap().success());
    let mut tshark = std::process::Command::new("tshark");
    tshark.arg("-r").arg(file.path()).args(["-T", "fields"]);
    for field in ["frame.interface_name", "frame.len", "frame.cap_len", "can.id"] {
        tshark.args(["-e", field]);
    }
    let told = finish(&mut tshark);
    assert_eq!(told.code, Some(0), "{}", told.err);
    let lines: Vec<Vec<_>> = told.out.lines().map(|line| line.split('\t').collect()).collect();
    let on = |bus| lines.iter().filter(move |line| line[0] == bus);
    // The request without data, and its answer of six octets. The journal has four of them.
    let telegrams: Vec<_> = on("dp").map(|line| (line[1], line[2], line[3])).collect();
    assert_eq!(telegrams.last(), Some(&("17", "13", "")), "{}", told.out);
    assert_eq!(telegrams[0], ("11", "11", ""), "{}", told.out);
    assert!(on("open").count() > 0 && on("open").all(|line| !line[3].is_empty()), "{}", told.out);
    assert_eq!(on("dp").count() + on("open").count(), lines.len());
    // Telegrams that are no CAN frames do not prevent reading the frames.
    let compared = emulator.run("bus", &["compare", file.path().to_str().unwrap()]);
    assert!(compared.code == Some(0) && compared.out.contains("no difference"), "{}", compared.out);
    assert!(compared.err.contains("skipped: a telegram of PROFIBUS, of interface 'dp'"), "{}", compared.err);
}

#[test]
fn the_demonstration_commissions_the_gateway_and_exchanges_data() {
    let demo = run(&["demo", "--device", "can-dp2"]);
    for line in [
        "gw     is answered 02 05 00 FF 04 A4",
        "gw     is answered 4A 05 00 FF 04 A4 05 04 3D 08 06",
        "gw     finds front.led_d (%FD8) = 16#00000001",
        "panel  finds rx_pdo.a_RX_PDO[0][0] (%MW2000) = 16#1234",
        "gw     is answered AB CD 00 00 00 00 00 00",
        "gw     is answered 00 04 00 01 04 A4",
    ] {
        assert!(demo.ok().contains(line), "{line}\n{}", demo.out);
    }
}
