//! Outputs become frames, frames become inputs (p. 13, 29, 32-49).

use super::*;

const WINDOWS: [u8; 10] = [0x83, 0x8F, 0xFF, 0xEF, 0, 0x43, 0x8F, 0xFF, 0xEF, 0];

#[test]
fn outputs_are_sent_when_they_change() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    assert_eq!(bench.exchange(&[0, 0]), [0, 0]);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new(), "they were 0 before");
    bench.exchange(&[0x12, 0x34]);
    bench.exchange(&[0x12, 0x34]);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["203: 12 34"]);
    // A data exchange without outputs clears the outputs. Clear_Data clears them, too.
    bench.exchange(&[]);
    bench.run(10 * MS);
    bench.exchange(&[5, 6]);
    bench.ask(58, &[2, 0]);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["203: 00 00", "203: 05 06", "203: 00 00"]);
    assert_eq!(bench.ask(57, &[]).1, [0, 0]);
}

#[test]
fn freeze_and_sync_are_ignored() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    assert_eq!(bench.ask(58, &[0x28, 0]).0, mst_result::SENT);
    bench.exchange(&[1, 2]);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["203: 01 02"]);
    assert_eq!(bench.diag()[1], 0x04);
    // Other commands of Global_Control do not clear outputs, and Clear_Data for another group does not clear them.
    for octets in [[0x28, 0], [0x02, 0x10]] {
        assert_eq!(bench.ask(58, &octets).0, mst_result::SENT);
    }
    bench.run(10 * MS);
    assert_eq!(bench.ask(57, &[]).1, [1, 2]);
}

#[test]
fn frames_become_inputs() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    bench.run(MS);
    bench.send(data(0x289, &[0x55, 0x66]));
    bench.send(data(0x28A, &[1, 2]));
    bench.run(10 * MS);
    assert_eq!(bench.exchange(&[0, 0]), [0x55, 0x66]);
    // If a received frame is shorter than the input, the remaining bytes of the input do not change. Of a
    // longer frame, only the first bytes are used (D-388).
    bench.send(data(0x289, &[0x77]));
    bench.run(10 * MS);
    assert_eq!(bench.ask(56, &[]).1, [0x77, 0x66]);
    bench.send(data(0x289, &[1, 2, 3]));
    bench.run(10 * MS);
    assert_eq!(bench.exchange(&[0, 0]), [1, 2]);
}

#[test]
fn bytes_are_swapped_both_ways() {
    let mut bench = Bench::exchanging(0, 0, &[0x83, 0x85, 3, 9, 0xB8, 0x43, 0x85, 2, 0x89, 0xB8]);
    bench.exchange(&[1, 2, 3, 4, 5, 6]);
    bench.send(data(0x289, &[2, 1, 6, 5, 4, 3]));
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["309: 02 01 06 05 04 03"]);
    assert_eq!(bench.exchange(&[1, 2, 3, 4, 5, 6]), [1, 2, 3, 4, 5, 6]);
}

#[test]
fn identifiers_of_29_bits() {
    let cfg = [0x85, 0, 0x20, 0x12, 0x34, 0x56, 0, 0x45, 0, 0x20, 0, 2, 0x89, 0];
    let mut bench = Bench::exchanging(0, 0, &cfg);
    bench.exchange(&[7]);
    bench.run(MS);
    let id = crate::can::ExtendedId::new(0x289).unwrap();
    bench.send(data(0x289, &[1]));
    bench.send(Frame::new(id, Payload::new(&[2]).unwrap()));
    bench.run(10 * MS);
    assert_eq!((bench.heard(), bench.exchange(&[7])), (vec!["123456: 07".to_owned()], vec![2]));
}

#[test]
fn cyclic_outputs_are_repeated() {
    let mut bench = Bench::exchanging(0, 0, &[0x85, 0, 2, 3, 0, 0, 50]);
    bench.exchange(&[1]);
    bench.run(10 * MS);
    bench.heard();
    bench.run(300 * MS);
    let heard = bench.heard_at();
    let gaps: Vec<u64> = heard.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    assert_eq!((heard.len(), gaps), (6, vec![50 * MS; 5]));
    // A changed value is sent at once. The times of the cyclic transmissions do not change.
    bench.exchange(&[2]);
    bench.run(300 * MS);
    assert_eq!(bench.heard(), ["203: 02"; 7]);
}

#[test]
fn counters() {
    let mut bench = Bench::exchanging(0, 6, &[0x83, 8, 2, 3, 0, 0x43, 8, 2, 0x89, 0]);
    bench.run(MS);
    for _ in 0..3 {
        bench.send(data(0x289, &[1, 2, 3, 4, 5, 6, 7, 8]));
    }
    bench.run(10 * MS);
    assert_eq!(bench.exchange(&[0; 9]), [1, 2, 3, 4, 5, 6, 7, 8, 3]);
    // The outputs differ only in the Tx-Counter, which makes the gateway send the unchanged data once more. The counter
    // itself is not sent on CAN.
    bench.exchange(&[0, 0, 0, 0, 0, 0, 0, 0, 1]);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["203: 00 00 00 00 00 00 00 00"]);
}

#[test]
fn the_later_of_two_inputs_with_one_identifier_is_updated() {
    let mut bench = Bench::exchanging(0, 0, &[0x83, 0, 7, 0xF8, 0, 0x43, 0, 1, 0, 0, 0x43, 0, 1, 0, 0]);
    bench.run(MS);
    bench.send(data(0x100, &[9]));
    bench.run(10 * MS);
    assert_eq!(bench.exchange(&[1]), [0, 9]);
    assert_eq!(bench.heard(), Vec::<String>::new(), "an output without CAN");
}

#[test]
fn without_an_output_can_is_not_used() {
    let mut bench = Bench::exchanging(0, 0, &[0x43, 0, 1, 0, 0]);
    bench.run(MS);
    bench.send(data(0x100, &[9]));
    bench.run(10 * MS);
    assert_eq!(bench.exchange(&[]), [0]);
    assert_eq!(bench.registers.can.can_state.load(), 0);
}

#[test]
fn frames_at_another_bit_rate_are_not_received() {
    let mut bench = Bench::new(5);
    let mut fast = prm(0, 0);
    fast[8] = 0;
    bench.ask(61, &fast);
    bench.ask(62, &CFG);
    bench.exchange(&[1, 2]);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new());
}

/// The examples of p. 46-49.
#[test]
fn a_communication_window_follows_the_examples() {
    let mut bench = Bench::exchanging(0x80, 0, &WINDOWS);
    let window = |id: [u8; 2], data: [u8; 8], length: u8, counter: u8, command: u8| {
        let mut window = [0; 16];
        window[..2].copy_from_slice(&id);
        window[4..12].copy_from_slice(&data);
        (window[12], window[13], window[15]) = (length, counter, command);
        window
    };
    let echo = bench.exchange(&window([0, 0x12], [0, 1, 2, 3, 4, 5, 6, 7], 8, 0xCC, 1));
    assert_eq!(echo[13], 0xCC);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["12: 00 01 02 03 04 05 06 07"]);
    bench.exchange(&window([1, 0x23], [0; 8], 0, 0xCD, 4));
    let empty = bench.exchange(&window([1, 0x23], [0; 8], 0, 0xCE, 3));
    assert_eq!((empty[..2].to_vec(), empty[13]), (vec![0xEE, 0xEE], 0xCE));
    bench.send(data(0x123, &[0xAA, 0xBB, 0xCC, 0xDD, 0xEE, 0xFF, 0, 0x11]));
    bench.run(10 * MS);
    let found = bench.exchange(&window([1, 0x23], [0; 8], 0, 0xCE, 3));
    assert_eq!(found, [1, 0x23, 0, 0, 0xAA, 0xBB, 0xCC, 0xDD, 0xEE, 0xFF, 0, 0x11, 8, 0xCE, 0, 0]);
    bench.exchange(&window([1, 0x23], [0; 8], 0, 0xCF, 5));
    bench.run(MS);
    bench.send(data(0x123, &[1]));
    bench.run(10 * MS);
    assert_eq!(bench.registers.can.fifo_count.load(), 0);
    bench.exchange(&window([0, 0], [1, 0, 0, 0, 0, 0, 0, 0], 2, 0xD0, 1));
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["0: 01 00"]);
}

/// If no station acknowledges the frames, the number of waiting frames is limited, and lost frames are
/// counted (D-390).
#[test]
fn the_number_of_waiting_frames_is_limited() {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    let &(bus, station) = bench.places.last().unwrap();
    bench.buses[bus].power_off(station, bench.now, &mut bench.journal);
    // 64 frames wait in the controller, and 256 more wait in the gateway.
    for number in 1..=400_u16 {
        bench.exchange(&number.to_be_bytes());
    }
    assert_eq!(bench.registers.can.irq_lost.load(), 80);
}
