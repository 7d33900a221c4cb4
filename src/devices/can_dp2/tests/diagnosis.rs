//! Each diagnosis that the slave sets (p. 16-21).

use super::*;

/// Bits 6 and 3, 3D with the number of the octet and the right value; the slave goes on waiting for parameters.
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
    // Bit 4 besides: a function that it does not have (p. 10, 17).
    let mut freeze = prm(0, 0);
    freeze[0] |= 0x10;
    bench.ask(61, &freeze);
    assert_eq!(bench.diag(), [0x5A, 0x05, 0x00, 0xFF, 0x04, 0xA4, 5, 4, 0x3D, 0, 0x80]);
    bench.ask(61, &[0x80, 0, 0, 11, 0x04, 0xA4, 0]);
    assert_eq!(bench.diag()[8..], [0x3D, 7, 0], "too short");
    bench.ask(61, &prm(0, 0));
    assert_eq!(bench.diag(), [0x02, 0x04, 0x00, 1, 0x04, 0xA4], "nothing of it is left");
}

/// Bits 2 and 3, 3E with the number of the module and a code; LED E says that it waits for a configuration (D-381).
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
    // The same one again changes nothing.
    bench.exchange(&[1, 2]);
    bench.ask(62, &CFG);
    assert_eq!(bench.registers.outputs(2), [1, 2]);
}

/// With CAN-Diagnosis the state of the bus comes behind, and an answer of high priority when it or a counter changes (p. 20, 29).
#[test]
fn frames_that_are_lost_are_told() {
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

/// Nobody acknowledges what it sends: its error counter goes up to passive, and further it does not go (p. 15, 20).
#[test]
fn states_of_the_can_bus() {
    let mut bench = Bench::exchanging(0, 1, &CFG);
    bench.exchange(&[0, 0]);
    let &(bus, station) = bench.places.last().unwrap();
    bench.buses[bus].power_off(station, bench.now, &mut bench.journal);
    bench.exchange(&[1, 2]);
    bench.run(50 * MS);
    assert_eq!((bench.registers.can.bus_state.load(), bench.front(FRONT_LED_C)), (0x80, 3));
    assert_eq!(bench.ask(255, &[1, 2]).0, mst_result::DATA_AND_DIAGNOSIS);
    assert_eq!(bench.diag(), [0x08, 0x04, 0x00, 1, 0x04, 0xA4, 5, 4, 0x80, 0, 0]);
    // Somebody is there again: the frame arrives, and counts the errors down.
    bench.buses[bus].power_on(station, 0, bench.now, &mut bench.journal);
    bench.run(10 * MS);
    for number in 0..=128 {
        bench.exchange(&[1, number]);
        bench.run(2 * MS);
    }
    assert_eq!((bench.front(FRONT_LED_C), bench.diag()[0]), (1, 0x00));
}

/// A receipt cannot announce a diagnosis; a slave without inputs answers with a telegram without data then.
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
