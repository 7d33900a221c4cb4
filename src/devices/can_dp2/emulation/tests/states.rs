//! Power-on, addresses, begin and end of data exchange.

use super::*;
use crate::devices::can_dp2::registers::values::{can_state, dp_state, led_d};

#[test]
fn switches_give_the_address() {
    for (switches, address) in
        [(0x11, 17), (0x02, 3), (0x00, 3), (0x7C, 124), (0x7D, 124), (0xFF, 124), (3, 3)]
    {
        let mut bench = Bench::new(switches);
        assert_eq!(bench.front(FRONT_ADDRESS), address);
        assert_eq!(bench.diag(), [0x02, 0x05, 0x00, 0xFF, 0x04, 0xA4]);
    }
}

#[test]
fn switches_are_read_at_power_on_only() {
    let mut bench = Bench::new(5);
    bench.registers.shown(FRONT_SWITCHES).store(7);
    bench.run(MS);
    assert_eq!(bench.front(FRONT_ADDRESS), 5);
    bench.power(Power::Off);
    assert_eq!((bench.front(FRONT_ADDRESS), bench.front(FRONT_LED_E), bench.front(FRONT_LED_C)), (0, 0, 0));
    bench.power(Power::On);
    assert_eq!(bench.front(FRONT_ADDRESS), 7);
}

/// LED E has a code for each state (p. 15).
#[test]
fn states_up_to_data_exchange_follow_the_manual() {
    let mut bench = Bench::new(5);
    let state = |bench: &Bench| (bench.registers.diag.dp_state.load(), bench.front(FRONT_LED_E));
    assert_eq!(state(&bench), (dp_state::BAUD_SEARCH, 1));
    // The slave uses the first telegram only to detect the bit rate. So the master sends the telegram again,
    // and the slave answers it.
    assert_eq!(bench.ask(254, &[]).0, mst_result::STATUS);
    assert_eq!(state(&bench), (dp_state::WAIT_PRM, 3));
    assert_eq!(bench.ask(255, &[0, 0]).0, mst_result::NOT_ACTIVATED);
    // A configuration before the parameters is ignored.
    assert_eq!(bench.ask(62, &CFG).0, mst_result::RECEIPT);
    assert_eq!(state(&bench), (dp_state::WAIT_PRM, 3));
    assert_eq!(bench.ask(61, &prm(0, 0)).0, mst_result::RECEIPT);
    assert_eq!(state(&bench), (dp_state::WAIT_CFG, 4));
    assert_eq!(bench.diag(), [0x02, 0x04, 0x00, 1, 0x04, 0xA4]);
    assert_eq!(bench.ask(62, &CFG).0, mst_result::RECEIPT);
    assert_eq!((state(&bench), bench.front(FRONT_LED_D)), ((dp_state::DATA_EXCHANGE, 0), led_d::ON));
    assert_eq!(bench.diag(), [0x00, 0x04, 0x00, 1, 0x04, 0xA4]);
    assert_eq!(bench.registers.can.can_state.load(), can_state::WORKING);
    let (_, cfg) = bench.ask(59, &[]);
    assert_eq!(cfg, CFG);
}

#[test]
fn a_telegram_for_another_station_gives_the_rate_only() {
    let mut bench = Bench::new(5);
    // Global_Control goes to all stations, and no station answers.
    assert_eq!(bench.ask(58, &[0, 0]).0, mst_result::SENT);
    assert_eq!(bench.front(FRONT_LED_E), 2);
    assert_eq!(bench.ask(58, &[0, 0]).0, mst_result::SENT);
    assert_eq!(bench.front(FRONT_LED_E), 2);
}

#[test]
fn unknown_services_are_refused() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    assert_eq!(bench.ask(55, &[1, 2, 3, 4]).0, mst_result::NOT_ACTIVATED, "Set_Slave_Add");
    let mut waiting = Bench::new(5);
    for dsap in [56, 57] {
        assert_eq!(waiting.ask(dsap, &[]).0, mst_result::NOT_ACTIVATED, "{dsap}");
    }
}

#[test]
fn an_invalid_request_is_answered_at_once() {
    let mut bench = Bench::new(5);
    for (dsap, address, length) in [(10, 1, 0), (60, 127, 0), (61, 1, 245)] {
        bench.mst.mst_address.store(address);
        bench.mst.mst_dsap.store(dsap);
        bench.mst.mst_request_len.store(length);
        bench.mst.mst_control.store(mst_control::SEND);
        bench.run(CYCLE);
        let found = (bench.mst.mst_control.load(), bench.mst.mst_result.load());
        assert_eq!(found, (mst_control::DONE, mst_result::BAD_REQUEST));
    }
}

#[test]
fn a_slave_without_power_does_not_answer() {
    let mut bench = Bench::new(5);
    let (bus, place) = bench.places[0];
    bench.buses[bus].power_off(place, bench.now, &mut bench.journal);
    assert_eq!(bench.ask(60, &[]), (mst_result::NO_ANSWER, Vec::new()));
}

/// Parameters with a watchdog of 100 ms.
fn watched() -> Vec<u8> {
    let mut watched = prm(0, 0);
    (watched[0], watched[1], watched[2]) = (0x88, 2, 5);
    watched
}

#[test]
fn the_watchdog_ends_data_exchange() {
    let mut bench = Bench::new(5);
    bench.ask(61, &watched());
    bench.ask(62, &CFG);
    assert_eq!(bench.diag()[..4], [0x00, 0x0C, 0x00, 1]);
    bench.exchange(&[1, 2]);
    bench.run(99 * MS);
    bench.exchange(&[1, 2]);
    bench.run(99 * MS);
    assert_eq!(bench.registers.diag.dp_state.load(), dp_state::DATA_EXCHANGE);
    bench.run(2 * MS);
    assert_eq!(bench.front(FRONT_LED_E), 1, "it searches");
    assert_eq!(bench.registers.outputs(2), [0, 0]);
    assert_eq!(bench.diag(), [0x02, 0x05, 0x00, 0xFF, 0x04, 0xA4]);
    // The gateway sends nothing on CAN until the next start. After this start it works as before.
    bench.heard();
    bench.run(100 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new());
    bench.commission(0, 0, &CFG);
    bench.exchange(&[3, 4]);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), ["203: 03 04"]);
}

/// Decision D-386.
#[test]
fn no_cyclic_output_outlives_data_exchange() {
    let mut bench = Bench::new(5);
    bench.ask(61, &watched());
    bench.ask(62, &[0x85, 0, 2, 3, 0, 0, 20]);
    bench.exchange(&[7]);
    bench.run(90 * MS);
    assert!(bench.heard().len() >= 4, "every 20 ms");
    assert_eq!(bench.registers.diag.dp_state.load(), dp_state::DATA_EXCHANGE);
    bench.run(15 * MS);
    assert_ne!(bench.registers.diag.dp_state.load(), dp_state::DATA_EXCHANGE);
    bench.heard();
    bench.run(200 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new());
}

#[test]
fn other_masters_wait_until_the_slave_is_unlocked() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    bench.mst.mst_address.store(2);
    assert_eq!(bench.ask(61, &prm(0, 0)).0, mst_result::RECEIPT);
    assert_eq!(bench.diag(), [0x80, 0x04, 0x00, 1, 0x04, 0xA4], "bit 7: locked by another master");
    assert_eq!(bench.ask(255, &[9, 9]).0, mst_result::NOT_ACTIVATED);
    assert_eq!(bench.ask(62, &[0]).0, mst_result::RECEIPT);
    assert_eq!(bench.diag()[..2], [0x80, 0x04], "ignored");
    bench.mst.mst_address.store(1);
    let mut unlock = prm(0, 0);
    unlock[0] = 0x40;
    bench.ask(61, &unlock);
    assert_eq!(bench.diag()[..4], [0x02, 0x05, 0x00, 0xFF]);
    bench.mst.mst_address.store(2);
    bench.commission(0, 0, &CFG);
    assert_eq!(bench.diag()[3], 2);
}

#[test]
fn parameters_in_data_exchange_restart_it() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    bench.exchange(&[1, 2]);
    bench.ask(61, &prm(0, 0));
    assert_eq!(
        (bench.registers.diag.dp_state.load(), bench.registers.outputs(2)),
        (dp_state::WAIT_CFG, vec![0, 0])
    );
    bench.ask(62, &CFG);
    bench.exchange(&[1, 2]);
    let mut wrong = prm(0, 0);
    wrong[8] = 14;
    bench.ask(61, &wrong);
    assert_eq!(bench.registers.diag.dp_state.load(), dp_state::WAIT_PRM);
}

#[test]
fn outputs_of_another_length_end_data_exchange() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    assert_eq!(bench.ask(255, &[1]).0, mst_result::NOT_ACTIVATED);
    assert_eq!(bench.diag()[..2], [0x02, 0x05]);
}
