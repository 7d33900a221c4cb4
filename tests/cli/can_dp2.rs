//! Runs the plant and the demonstration of the CAN-DP/2 with the built program.

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
    let output = finish(&mut tshark);
    assert_eq!(output.code, Some(0), "{}", output.err);
    let lines: Vec<Vec<_>> = output.out.lines().map(|line| line.split('\t').collect()).collect();
    let on = |bus| lines.iter().filter(move |line| line[0] == bus);
    // The log has the request without data, and its answer of six octets.
    let telegrams: Vec<_> = on("dp").map(|line| (line[1], line[2], line[3])).collect();
    assert_eq!(telegrams.last(), Some(&("17", "17", "")), "{}", output.out);
    assert_eq!(telegrams[0], ("11", "11", ""), "{}", output.out);
    assert!(on("open").count() > 0 && on("open").all(|line| !line[3].is_empty()), "{}", output.out);
    assert_eq!(on("dp").count() + on("open").count(), lines.len());
    let compared = emulator.run("bus", &["compare", file.path().to_str().unwrap()]);
    assert!(compared.code == Some(0) && compared.out.contains("no difference"), "{}", compared.out);
    assert_eq!(compared.err, "", "both kinds of messages are compared");
}

/// Sends a request of the DP master in the registers.
fn ask(emulator: &Emulator, dsap: u8, octets: &[u8]) {
    let mut words: Vec<String> =
        octets.iter().enumerate().map(|(at, octet)| format!("gw:mst.mst_request[{at}]={octet}")).collect();
    words.push(format!("gw:mst.mst_request_len={}", octets.len()));
    words.push(format!("gw:mst.mst_dsap={dsap}"));
    words.push("gw:mst.mst_control=5".to_owned());
    emulator.poke(&words.iter().map(String::as_str).collect::<Vec<_>>());
    emulator.run("wait", &["gw:mst.mst_control==16#04"]).ok();
}

/// Commissions the gateway: parameters with an octet that the gateway refuses, a request for the diagnosis, correct
/// parameters, and a configuration.
fn commission(emulator: &Emulator) {
    let mut parameters = [0x80, 0, 0, 11, 0x04, 0xA4, 0, 0, 99, 0x06, 1, 0, 0, 0, 0, 0];
    ask(emulator, 60, &[]);
    ask(emulator, 60, &[]);
    ask(emulator, 61, &parameters);
    ask(emulator, 60, &[]);
    parameters[8] = 6;
    ask(emulator, 61, &parameters);
    ask(emulator, 62, &[0x83, 0x87, 0x02, 0x20, 0xAA, 0x43, 0x87, 0x01, 0xA0, 0xAA]);
}

#[test]
fn a_trace_shows_whole_telegrams_and_plays_again() {
    let recorded = Emulator::start(&[PLANT, "--clock", "stepped"]);
    commission(&recorded);
    let text = recorded.run("trace", &["--bus", "dp"]);
    for wanted in [
        "16 octets 80 00 00 0B 04 A4 00 00 63 06 01 00 00 00 00 00 from gw:mst, Set_Prm: Lock_Req, min_Tsdr 11, ident \
         16#04A4, groups 16#00, 9 octets of the user",
        ", Slave_Diag: Station_Not_Ready, Ext_Diag, Prm_Fault, Prm_Req, no master, ident 16#04A4, 5 octets of extended \
         diagnosis",
        "10 octets 83 87 02 20 AA 43 87 01 A0 AA from gw:mst, Chk_Cfg",
    ] {
        assert!(text.ok().contains(wanted), "{wanted}\n{}", text.out);
    }
    let csv = recorded.run("trace", &["--bus", "dp", "--format", "csv"]);
    assert!(csv.ok().contains("8000000B04A4000063060100"), "{}", csv.out);
    let folder = tempfile::tempdir().unwrap();
    for format in ["json", "pcapng"] {
        let file = folder.path().join(format);
        let mut trace = recorded.command("trace", &["--format", format]);
        assert!(trace.stdout(std::fs::File::create(&file).unwrap()).status().unwrap().success());
        let log = file.to_str().unwrap();
        for (clock, tolerance) in [("stepped", "10us"), ("realtime", "60s")] {
            let other = Emulator::start(&[PLANT, "--clock", clock]);
            // The DP master sends its first telegram only after the line has been idle for a time.
            if clock == "stepped" {
                other.step(&["1ms"]);
            }
            // In the second emulator, its own gateway answers, so only the requests of the master are played. The
            // gateway detects the bit rate by the first request.
            let played = other.run("bus", &["play", log, "--interface", "dp", "--without-station", "5"]);
            assert_eq!(played.code, Some(0), "{}", played.err);
            assert!(played.out.starts_with("7 frames in "), "{}", played.out);
            other.run("wait", &["gw:front.led_d==1", "--within", "60s"]).ok();
            for (choice, count) in [(&["--bus", "dp"][..], 13), (&["--station", "5"], 6)] {
                let args = [&["compare", log, "--tolerance", tolerance][..], choice].concat();
                let compared = other.run("bus", &args);
                assert_eq!(compared.out, format!("{count} frames, no difference\n"), "{format} {clock}");
            }
            let changed = other.run("bus", &["play", log, "--station", "2", "--without-station", "2"]);
            assert!(changed.fails(2).contains("it has no frame to play"), "{}", changed.err);
        }
    }
}

#[test]
fn a_disturbed_line_is_seen_by_the_master() {
    let emulator = Emulator::start(&[PLANT, "--clock", "stepped"]);
    commission(&emulator);
    emulator.run("fault", &["add", "garble_telegram", "bus=dp", "what=answer", "count=1"]).ok();
    ask(&emulator, 60, &[]);
    assert_eq!(emulator.peek(&["gw:mst.mst_result"]), "16#02");
    emulator.run("fault", &["add", "silent_station", "bus=dp", "station=5", "for=1s"]).ok();
    ask(&emulator, 60, &[]);
    assert_eq!(emulator.peek(&["gw:mst.mst_result"]), "16#11");
    let list = emulator.run("fault", &["list"]);
    assert!(list.ok().contains("silent_station bus=dp station=5"), "{}", list.out);
    emulator.step(&["1s"]);
    ask(&emulator, 60, &[]);
    assert_eq!(emulator.peek(&["gw:mst.mst_result"]), "16#02");
    emulator.run("fault", &["add", "noise", "bus=dp", "octets=20"]).ok();
    emulator.step(&["1ms"]);
    let text = emulator.run("trace", &[]);
    for wanted in ["garble_telegram: hits", "garbled octets 68 ", "silent_station: hits", "noise: hits"] {
        assert!(text.ok().contains(wanted), "{wanted}\n{}", text.out);
    }
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
