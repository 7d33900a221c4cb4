//! One partner against the expected characters and times.

use super::*;
use crate::serial::CharacterError;

const CHARACTER: u64 = 286;

fn procedure(priority: Priority) -> Procedure {
    Procedure::new(Settings::new(priority, CHARACTER))
}

/// Polls until `until`, and returns the characters with their times.
fn run(procedure: &mut Procedure, until: u64) -> Vec<(u64, u8)> {
    let mut sent = Vec::new();
    while let Some(time) = procedure.due().filter(|time| *time <= until) {
        sent.extend(procedure.poll(time).into_iter().map(|octet| (time, octet)));
    }
    sent
}

fn octets(sent: &[(u64, u8)]) -> Vec<u8> {
    sent.iter().map(|(_, octet)| *octet).collect()
}

fn pass(procedure: &mut Procedure, at: u64, octets: &[u8]) {
    for (index, octet) in octets.iter().enumerate() {
        procedure.received(at + index as u64 * CHARACTER, Character::Byte(*octet));
    }
}

#[test]
fn a_block_is_sent_after_the_connection_and_acknowledged() {
    let mut plc = procedure(Priority::High);
    plc.send(&[0x41, DLE, 0x42]).unwrap();
    assert_eq!(plc.send(&[1]), Err(SendError::Busy));
    assert_eq!(run(&mut plc, 1_000), [(0, STX)]);
    plc.received(1_000, Character::Byte(DLE));
    let sent = run(&mut plc, 100_000);
    assert_eq!(octets(&sent), [0x41, DLE, DLE, 0x42, DLE, ETX, 0x41 ^ 0x42 ^ DLE ^ ETX]);
    assert_eq!(sent[1].0 - sent[0].0, CHARACTER);
    assert!(plc.is_sending());
    plc.received(100_000, Character::Byte(DLE));
    assert_eq!((plc.next_event(), plc.is_sending(), plc.due()), (Some(Event::Sent), false, None));
}

#[test]
fn a_block_is_received_with_single_dle() {
    let mut plc = procedure(Priority::Low);
    plc.received(1_000, Character::Byte(STX));
    assert_eq!(run(&mut plc, 1_000), [(1_000, DLE)]);
    pass(&mut plc, 2_000, &frame(&[0x00, DLE, DLE, ETX], true));
    assert_eq!(octets(&run(&mut plc, 10_000)), [DLE]);
    assert_eq!(plc.next_event(), Some(Event::Received(vec![0x00, DLE, DLE, ETX])));
    assert_eq!(plc.due(), None);
}

#[test]
fn the_procedure_without_check_sum_ends_with_etx() {
    let mut plc = Procedure::new(Settings::without_check_sum(Priority::Low, CHARACTER));
    plc.received(1_000, Character::Byte(STX));
    run(&mut plc, 1_000);
    pass(&mut plc, 2_000, &[0x41, DLE, ETX]);
    assert_eq!(octets(&run(&mut plc, 10_000)), [DLE]);
    assert_eq!(plc.next_event(), Some(Event::Received(vec![0x41])));
    plc.send(&[0x42]).unwrap();
    let sent = run(&mut plc, 30_000_000);
    let distance = 550_000 + CHARACTER;
    assert_eq!(sent[1].0 - sent[0].0, distance, "acknowledgement delay of 3964");
}

#[test]
fn six_requests_without_answer_end_with_nak() {
    let mut plc = procedure(Priority::High);
    plc.send(&[1]).unwrap();
    let sent = run(&mut plc, 60_000_000);
    assert_eq!(octets(&sent), [STX, STX, STX, STX, STX, STX, NAK]);
    assert_eq!(sent[6].0, 6 * (2_000_000 + CHARACTER));
    assert_eq!(plc.next_event(), Some(Event::SendFailed(ProcedureError::NoConnection)));
}

#[test]
fn six_refused_transmissions_are_given_up() {
    let mut plc = procedure(Priority::High);
    plc.send(&[1]).unwrap();
    let mut now = 0;
    for _ in 0..6 {
        now += 100_000;
        assert_eq!(octets(&run(&mut plc, now)).last(), Some(&STX));
        plc.received(now, Character::Byte(DLE));
        now += 100_000;
        assert_eq!(octets(&run(&mut plc, now)), frame(&[1], true));
        plc.received(now, Character::Byte(NAK));
    }
    assert_eq!(octets(&run(&mut plc, now + 100_000)), [NAK]);
    assert_eq!(plc.next_event(), Some(Event::SendFailed(ProcedureError::NotAcknowledged)));
}

#[test]
fn without_an_acknowledgement_the_block_is_refused_and_repeated() {
    let mut plc = procedure(Priority::High);
    plc.send(&[1]).unwrap();
    run(&mut plc, 0);
    plc.received(1_000, Character::Byte(DLE));
    let sent = run(&mut plc, 2_100_000);
    let end = sent[3].0 + CHARACTER;
    assert_eq!(sent[4..], [(end + 2_000_000, NAK), (end + 2_000_000 + CHARACTER, STX)]);
}

#[test]
fn an_answer_during_the_block_interrupts_it() {
    for (answer, after) in [(NAK, 0), (0x55, 220_000)] {
        let mut plc = procedure(Priority::High);
        plc.send(&[1; 100]).unwrap();
        run(&mut plc, 0);
        plc.received(1_000, Character::Byte(DLE));
        assert_eq!(run(&mut plc, 2_000).len(), 4);
        plc.received(2_000, Character::Byte(answer));
        let sent = run(&mut plc, 1_000_000);
        assert_eq!(octets(&sent), if answer == NAK { vec![STX] } else { vec![NAK, STX] });
        assert_eq!(sent[0].0.saturating_sub(2_000) / 10_000 * 10_000, after, "{answer}");
    }
}

#[test]
fn in_a_conflict_the_low_priority_gives_way() {
    let (mut high, mut low) = (procedure(Priority::High), procedure(Priority::Low));
    for plc in [&mut high, &mut low] {
        plc.send(&[7]).unwrap();
        assert_eq!(octets(&run(plc, 0)), [STX]);
        plc.received(CHARACTER, Character::Byte(STX));
    }
    assert_eq!(octets(&run(&mut high, 1_000)), [0_u8; 0]);
    assert_eq!(octets(&run(&mut low, 1_000)), [DLE]);
    pass(&mut low, 2_000, &frame(&[9], true));
    // The block of the low priority follows after the acknowledgement.
    assert_eq!(octets(&run(&mut low, 10_000)), [DLE, STX]);
    assert_eq!(low.next_event(), Some(Event::Received(vec![9])));
    assert!(low.is_sending());
}

#[test]
fn a_damaged_block_is_refused_at_its_end() {
    let good = frame(&[0x41, 0x42], true);
    let cases: [(&[u8], Option<usize>, ProcedureError); 4] = [
        (&good, Some(0), ProcedureError::DamagedCharacter),
        (&[0x41, 0x43, DLE, ETX, 0x10], None, ProcedureError::CheckSum { found: 0x10, expected: 0x11 }),
        (&[0x41, DLE, 0x42, DLE, ETX, 0x00], None, ProcedureError::WrongEscape(0x42)),
        (&[DLE, ETX, DLE ^ ETX], None, ProcedureError::Empty),
    ];
    for (text, damaged, error) in cases {
        let mut plc = procedure(Priority::Low);
        plc.received(1_000, Character::Byte(STX));
        run(&mut plc, 1_000);
        for (index, octet) in text.iter().enumerate() {
            let at = 2_000 + index as u64 * CHARACTER;
            let is_damaged = damaged == Some(index);
            let parity = Character::Error(CharacterError::Parity);
            plc.received(at, if is_damaged { parity } else { Character::Byte(*octet) });
        }
        assert_eq!(octets(&run(&mut plc, 10_000)), [NAK]);
        assert_eq!(plc.next_event(), Some(Event::ReceiveFailed(error)));
        // The repetition is accepted.
        plc.received(20_000, Character::Byte(STX));
        run(&mut plc, 20_000);
        pass(&mut plc, 21_000, &good);
        assert_eq!(plc.next_event(), Some(Event::Received(vec![0x41, 0x42])));
    }
}

#[test]
fn times_of_the_receiver_end_in_errors() {
    let mut plc = procedure(Priority::Low);
    plc.received(1_000, Character::Byte(STX));
    run(&mut plc, 1_000);
    plc.received(10_000, Character::Byte(0x41));
    // The character delay, then the block waiting time.
    assert_eq!(run(&mut plc, 4_000_000), [(230_000, NAK)]);
    assert_eq!(plc.next_event(), Some(Event::ReceiveFailed(ProcedureError::CharacterDelay)));
    assert_eq!(run(&mut plc, 5_000_000), []);
    assert_eq!(plc.next_event(), Some(Event::ReceiveFailed(ProcedureError::NotRepeated)));
    // Characters outside a block.
    plc.received(6_000_000, Character::Byte(0x41));
    plc.received(6_100_000, Character::Byte(STX));
    assert_eq!(run(&mut plc, 7_000_000), [(6_320_000, NAK)]);
    assert_eq!(plc.next_event(), Some(Event::ReceiveFailed(ProcedureError::Unexpected)));
    // NAK outside a block has no effect.
    plc.received(8_000_000, Character::Byte(NAK));
    assert_eq!((plc.due(), plc.next_event()), (None, None));
}

#[test]
fn a_request_waits_for_a_free_buffer() {
    let mut plc = procedure(Priority::Low);
    let receive = |plc: &mut Procedure, at: u64| {
        plc.received(at, Character::Byte(STX));
        let sent = run(plc, at + 1_000);
        if octets(&sent) == [DLE] {
            pass(plc, at + 2_000, &frame(&[5], true));
            run(plc, at + 10_000);
        }
        sent.len()
    };
    assert_eq!(receive(&mut plc, 0), 1);
    assert_eq!(receive(&mut plc, 100_000), 0);
    assert_eq!(plc.due(), Some(500_000));
    // The user takes the block in time.
    assert_eq!(plc.next_event(), Some(Event::Received(vec![5])));
    assert_eq!(octets(&plc.poll(300_000).into_iter().map(|octet| (0, octet)).collect::<Vec<_>>()), [DLE]);
    pass(&mut plc, 301_000, &frame(&[6], true));
    run(&mut plc, 310_000);
    // The user does not take the block.
    assert_eq!(receive(&mut plc, 400_000), 0);
    assert_eq!(run(&mut plc, 1_000_000), [(800_000, NAK)]);
    assert_eq!(plc.due(), None, "the receiver expects no repetition of a refused connection");
    assert_eq!(plc.next_event(), Some(Event::Received(vec![6])));
    assert_eq!(plc.next_event(), Some(Event::ReceiveFailed(ProcedureError::NoBuffer)));
}

#[test]
fn a_pause_lets_requests_wait() {
    let mut plc = procedure(Priority::Low);
    plc.pause_reception(true);
    plc.received(0, Character::Byte(STX));
    assert_eq!(run(&mut plc, 100_000), []);
    plc.pause_reception(false);
    assert_eq!(plc.poll(200_000), [DLE]);
}

#[test]
fn a_break_ends_a_transmission() {
    let mut plc = procedure(Priority::Low);
    plc.send(&[1; 50]).unwrap();
    run(&mut plc, 0);
    plc.received(1_000, Character::Byte(DLE));
    run(&mut plc, 2_000);
    plc.received(2_000, Character::Error(CharacterError::Break));
    assert_eq!(
        (run(&mut plc, 10_000_000), plc.next_event()),
        (vec![], Some(Event::SendFailed(ProcedureError::Break)))
    );
    plc.received(11_000_000, Character::Byte(STX));
    run(&mut plc, 11_000_000);
    plc.received(11_001_000, Character::Error(CharacterError::Break));
    assert_eq!(plc.next_event(), Some(Event::ReceiveFailed(ProcedureError::Break)));
    assert_eq!(plc.due(), None);
}

#[test]
fn blocks_have_one_octet_to_the_longest_length() {
    let mut plc = procedure(Priority::High);
    assert_eq!(plc.send(&[]), Err(SendError::Empty));
    assert_eq!(plc.send(&[0; 1025]), Err(SendError::TooLong { found: 1025, longest: 1024 }));
    plc.send(&[0; 1024]).unwrap();
    let mut partner = procedure(Priority::Low);
    partner.received(0, Character::Byte(STX));
    run(&mut partner, 0);
    pass(&mut partner, 1_000, &frame(&[0; 1025], true));
    assert_eq!(partner.next_event(), Some(Event::ReceiveFailed(ProcedureError::TooLong(1024))));
}

#[test]
fn a_program_that_takes_no_events_does_not_fill_the_memory() {
    let mut plc = procedure(Priority::Low);
    for time in (0..1_000).map(|index| index * 1_000_000) {
        plc.received(time, Character::Byte(0xFF));
        run(&mut plc, time + 999_999);
    }
    assert!(core::iter::from_fn(|| plc.next_event()).count() <= 65);
}
