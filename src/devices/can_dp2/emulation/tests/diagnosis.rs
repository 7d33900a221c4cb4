//! Checks each diagnosis of the slave (p. 16-21).

use super::*;
use crate::devices::emulation::can_faults::OF_CAN;
use crate::fault::{Draft, Owner, Target};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};

impl Bench {
    /// Activates a fault of the CAN bus, or of the gateway's controller on this bus, `count` times.
    fn fault(&mut self, name: &str, count: u64) {
        let kind = OF_CAN.iter().find(|kind| kind.name() == name).unwrap();
        let target = if name == "overrun" {
            Target::Port { device: DeviceIndex(0), port: PortNumber(2) }
        } else {
            Target::Bus(BusIndex(1))
        };
        let fault = Draft { count: Some(count), ..Draft::new(kind, target) }.check().unwrap();
        self.faults.add(self.now, fault, Owner::Bus(BusIndex(1)), &mut self.journal).unwrap();
        self.faults.advance(self.now, &mut self.journal);
    }
}

/// After wrong parameters, bits 6 and 3 are set in the first octet of the diagnosis. 3D follows in a later
/// octet, with the number of the wrong octet and the right value. The slave continues to wait for parameters.
#[test]
fn wrong_parameters() {
    let mut bench = Bench::new(5);
    for (number, octet, right) in
        [(4, 5, 4), (5, 0, 0xA4), (7, 1, 0), (8, 14, 6), (9, 0x0C, 8), (10, 200, 1), (11, 8, 0), (12, 1, 0)]
    {
        let mut octets = prm(0, 0);
        octets[number] = octet;
        assert_eq!(bench.ask(61, &octets).0, mst_result::RECEIPT);
        let expected = [0x4A, 0x05, 0x00, 0xFF, 0x04, 0xA4, 5, 4, 0x3D, number as u8, right];
        assert_eq!(bench.diag(), expected, "octet {number}");
        assert_eq!(bench.front(FRONT_LED_E), 3);
    }
    // Bit 4 is also set, because the telegram requests an unsupported function (p. 10, 17).
    let mut freeze = prm(0, 0);
    freeze[0] |= 0x10;
    bench.ask(61, &freeze);
    assert_eq!(bench.diag(), [0x5A, 0x05, 0x00, 0xFF, 0x04, 0xA4, 5, 4, 0x3D, 0, 0x80]);
    // If the watchdog is on, it must have a time: both factors are at least 1 (D-373).
    let mut watched = prm(0, 0);
    watched[0] |= 0x08;
    for number in [1, 2] {
        bench.ask(61, &watched);
        assert_eq!(bench.diag()[..], [0x4A, 0x05, 0x00, 0xFF, 0x04, 0xA4, 5, 4, 0x3D, number, 1]);
        watched[usize::from(number)] = 1;
    }
    bench.ask(61, &[0x80, 0, 0, 11, 0x04, 0xA4, 0]);
    assert_eq!(bench.diag()[8..], [0x3D, 7, 0], "too short");
    // Parameters from the device description file of another device. The diagnosis reports the wrong ident
    // number, and also Freeze (p. 17, 20-21).
    let mut others = vec![0x88, 1, 10, 11, 0x80, 0x1D, 0, 0xC0, 0x60, 0x00];
    bench.ask(61, &others);
    assert_eq!(bench.diag(), [0x4A, 0x05, 0x00, 0xFF, 0x04, 0xA4, 5, 4, 0x3D, 4, 4]);
    others[0] |= 0x10;
    bench.ask(61, &others);
    assert_eq!(bench.diag(), [0x5A, 0x05, 0x00, 0xFF, 0x04, 0xA4, 5, 4, 0x3D, 4, 4]);
    bench.ask(61, &prm(0, 0));
    assert_eq!(bench.diag(), [0x02, 0x04, 0x00, 1, 0x04, 0xA4], "the fault is gone");
}

/// After a wrong configuration, bits 2 and 3 are set in the first octet of the diagnosis. 3E follows in a
/// later octet, with the number of the module and a code. LED E shows that the slave waits for a
/// configuration (D-381).
#[test]
fn wrong_configurations() {
    let mut bench = Bench::new(5);
    bench.ask(61, &prm(0, 0));
    for (cfg, code) in [
        (&[0xC3, 5, 2, 3, 0][..], 1),
        (&[0x83, 0x45, 2, 3, 0], 2),
        (&[0x83, 9, 2, 3, 0], 3),
        (&[0x81, 5, 2], 4),
        (&[0x82, 5, 2, 4], 5),
        (&[0x83, 5, 8, 0, 0], 6),
    ] {
        bench.ask(62, &[&CFG[..], cfg].concat());
        assert_eq!(bench.diag(), [0x0E, 0x04, 0x00, 1, 0x04, 0xA4, 5, 4, 0x3E, 2, code]);
        assert_eq!(bench.front(FRONT_LED_E), 4);
    }
    assert_eq!(bench.ask(255, &[0, 0]).0, mst_result::NOT_ACTIVATED);
    bench.ask(62, &CFG);
    assert_eq!(bench.diag(), [0x00, 0x04, 0x00, 1, 0x04, 0xA4]);
    assert_eq!(bench.mst.mst_diag_len.load(), 6);
}

#[test]
fn a_wrong_configuration_ends_data_exchange() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    bench.exchange(&[1, 2]);
    bench.ask(62, &[0xC3, 5, 2, 3, 0]);
    assert_eq!((bench.diag()[0], bench.registers.outputs(2)), (0x0E, vec![0, 0]));
    bench.ask(62, &CFG);
    assert_eq!(bench.diag()[0], 0);
    // The master repeats the configuration that is in force. This has no effect.
    bench.exchange(&[1, 2]);
    bench.ask(62, &CFG);
    assert_eq!(bench.registers.outputs(2), [1, 2]);
}

/// With CAN-Diagnosis the diagnosis also contains the state of the bus. After a change of the state or of a
/// counter, the next answer has high priority (p. 20, 29).
#[test]
fn lost_frames_are_reported() {
    let window = [0x43, 0x8F, 0xFF, 0xEF, 0, 0x83, 0x8F, 0xFF, 0xEF, 0];
    let mut bench = Bench::exchanging(0x80, 1, &window);
    assert_eq!(bench.diag(), [0x00, 0x04, 0x00, 1, 0x04, 0xA4, 5, 4, 0x00, 0, 0]);
    let mut enable = [0; 16];
    (enable[0], enable[1], enable[13], enable[15]) = (1, 0x23, 1, 4);
    assert_eq!(bench.ask(255, &enable).0, mst_result::DATA);
    bench.run(MS);
    (0..255).for_each(|_| bench.send(data(0x123, &[1])));
    bench.run(400 * MS);
    assert_eq!((bench.registers.can.fifo_count.load(), bench.ask(255, &enable).0), (255, mst_result::DATA));
    (0..45).for_each(|_| bench.send(data(0x123, &[2])));
    bench.run(100 * MS);
    assert_eq!(bench.registers.can.msg_lost.load(), 45);
    assert_eq!(bench.ask(255, &enable).0, mst_result::DATA_AND_DIAGNOSIS);
    assert_eq!(bench.diag()[8..], [0x00, 0, 45]);
    assert_eq!(bench.ask(255, &enable).0, mst_result::DATA);
}

/// No station acknowledges the frames. The error counter rises until the station is error-passive, and then
/// stays constant (p. 15, 20).
#[test]
fn states_of_the_can_bus() {
    let mut bench = Bench::exchanging(0, 1, &CFG);
    bench.exchange(&[0, 0]);
    let &(bus, station) = bench.places.last().unwrap();
    bench.buses[bus].power_off(station, bench.now, &mut bench.journal);
    bench.exchange(&[1, 2]);
    bench.run(50 * MS);
    assert_eq!((bench.registers.can.bus_state.load(), bench.front(FRONT_LED_C)), (0x80, 3));
    assert_eq!(bench.registers.diag.ext_cause.load(), 0x80, "no request in between");
    assert_eq!(bench.ask(255, &[1, 2]).0, mst_result::DATA_AND_DIAGNOSIS);
    assert_eq!(bench.diag(), [0x08, 0x04, 0x00, 1, 0x04, 0xA4, 5, 4, 0x80, 0, 0]);
    // Another station is switched on. It acknowledges the frame, so the error counter falls.
    bench.buses[bus].power_on(station, 0, bench.now, &mut bench.journal);
    bench.run(10 * MS);
    for number in 0..=128 {
        bench.exchange(&[1, number]);
        bench.run(2 * MS);
    }
    assert_eq!((bench.front(FRONT_LED_C), bench.diag()[0]), (1, 0x00));
}

/// A receipt cannot announce a diagnosis. So a slave without inputs then answers with a telegram without
/// data.
#[test]
fn a_slave_without_inputs_announces_a_diagnosis_too() {
    let mut bench = Bench::exchanging(0, 1, &[0x83, 0, 2, 3, 0]);
    assert_eq!(bench.ask(255, &[0]), (mst_result::RECEIPT, vec![]));
    let &(bus, station) = bench.places.last().unwrap();
    bench.buses[bus].power_off(station, bench.now, &mut bench.journal);
    bench.exchange(&[1]);
    bench.run(50 * MS);
    assert_eq!(bench.ask(255, &[1]), (mst_result::DATA_AND_DIAGNOSIS, vec![]));
    assert_eq!(bench.diag()[8], 0x80);
    assert_eq!(bench.ask(255, &[1]), (mst_result::RECEIPT, vec![]));
}

/// The four states of the bus. Octets 9 and 10 contain both counters, an answer of high priority announces
/// each state, and LED C has a code for each state (p. 15, 20-21). Each error frame adds 8 to the error
/// counter: 12 error frames give a warning, 16 error-passive, 32 BUS-off.
#[test]
fn the_four_states_of_the_bus() {
    for (errors, state, led) in [(0, 0x00, 1), (14, 0x40, 2), (20, 0x80, 3), (32, 0xC0, 4)] {
        let mut bench = Bench::exchanging(0, 1, &CFG);
        bench.run(MS);
        bench.fault("overrun", 2);
        (0..3).for_each(|_| bench.send(data(0x289, &[1, 2])));
        bench.run(10 * MS);
        assert_eq!(
            bench.ask(255, &[0, 0]),
            (mst_result::DATA_AND_DIAGNOSIS, vec![1, 2]),
            "the third one came"
        );
        assert_eq!(bench.diag()[8..], [0x00, 2, 0], "two were lost by the controller");
        if errors > 0 {
            bench.fault("error_frame", errors);
            bench.exchange(&[1, 1]);
            for _ in 0..1000 {
                if bench.registers.can.bus_state.load() == state {
                    break;
                }
                bench.run(CYCLE);
            }
            assert_eq!(bench.ask(255, &[1, 1]).0, mst_result::DATA_AND_DIAGNOSIS);
        }
        let ext_diag = if state == 0 { 0 } else { 0x08 };
        let expected = [ext_diag, 0x04, 0x00, 1, 0x04, 0xA4, 5, 4, state, 2, 0];
        assert_eq!(
            (bench.diag(), bench.front(FRONT_LED_C)),
            (expected.to_vec(), led),
            "{errors} error frames"
        );
    }
}

/// Without CAN-Diagnosis only LED C shows the state (p. 29).
#[test]
fn without_can_diagnosis_only_the_led_shows_the_state() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    bench.run(MS);
    bench.fault("error_frame", 14);
    bench.exchange(&[1, 1]);
    bench.run(50 * MS);
    assert_eq!(bench.front(FRONT_LED_C), 2);
    assert_eq!((bench.ask(255, &[1, 1]).0, bench.diag().len()), (mst_result::DATA, 6));
}

/// The configuration that COM PROFIBUS makes for the S5 (8.1, p. 74-75; D-468): two octets, for example 67
/// and 135, then the three octets of the comment. The last of the three is the format byte (`form`). The
/// table of the manual prints 64 instead of 67. 64 announces no comment, so the module has no identifier
/// (code 4).
#[test]
fn the_s5_variant() {
    let mut bench = Bench::exchanging(0, 0, &[67, 135, 0x02, 0x89, 0xB8, 131, 135, 0x03, 0x09, 0xB8]);
    let module = &bench.registers.cfg.module[0];
    assert_eq!((module.id.load(), module.length.load(), module.form.load()), (0x289, 8, 0xB8));
    bench.exchange(&[1, 2, 3, 4, 5, 6, 7, 8]);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["309: 02 01 06 05 04 03 07 08"]);
    bench.ask(62, &[64, 135]);
    assert_eq!(bench.diag()[8..], [0x3E, 0, 4]);
}
