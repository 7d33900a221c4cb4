//! The CAN-DP/2 by the built program: its plant, its demonstration.

use crate::common::{Emulator, run};

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
fn its_demonstration_commissions_it_and_exchanges_data() {
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
