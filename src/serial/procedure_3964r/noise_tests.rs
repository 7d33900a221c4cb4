//! Two partners on a disturbed line: a block arrives unchanged, or the sender reports its loss. The last tests show the
//! faults that the check sum cannot detect.

use super::*;
use crate::serial::noise::{Direction, Fault, any_fault, faults, hidden, marked};
use proptest::prelude::*;

const CHARACTER: u64 = 286;

/// What the two partners reported.
struct Outcome {
    events: [Vec<Event>; 2],
    /// The characters that each partner got.
    characters: [Vec<Character>; 2],
}

/// Sends the blocks of both partners one after the other. `lines[i]` disturbs the characters for partner `i`.
fn exchange(blocks: [&[Vec<u8>]; 2], lines: [Vec<(usize, Fault)>; 2]) -> Outcome {
    let mut partners =
        [Priority::High, Priority::Low].map(|priority| Procedure::new(Settings::new(priority, CHARACTER)));
    let mut lines = lines.map(|faults| Direction::new(CHARACTER, faults));
    let mut left = blocks.map(<[Vec<u8>]>::iter);
    let mut events = [Vec::new(), Vec::new()];
    let mut now = 0;
    for _ in 0..200_000 {
        for index in 0..2 {
            while let Some((at, character)) = lines[index].take(now) {
                partners[index].received(at, character);
            }
            events[index].extend(core::iter::from_fn(|| partners[index].next_event()));
            if !partners[index].is_sending()
                && let Some(block) = left[index].next()
            {
                partners[index].send(block).unwrap();
            }
            let sent = partners[index].poll(now);
            lines[1 - index].send(now, &sent);
            events[index].extend(core::iter::from_fn(|| partners[index].next_event()));
        }
        let times = [partners[0].due(), partners[1].due(), lines[0].next(), lines[1].next()];
        match times.into_iter().flatten().min() {
            Some(time) => now = time.max(now),
            None => return Outcome { events, characters: lines.map(|line| line.received) },
        }
    }
    panic!("the partners do not come to rest");
}

fn received(events: &[Event]) -> Vec<&Vec<u8>> {
    events
        .iter()
        .filter_map(|event| if let Event::Received(block) = event { Some(block) } else { None })
        .collect()
}

/// Results of the blocks that were sent, in order: true for `Sent`.
fn results(events: &[Event]) -> Vec<bool> {
    let result = |event: &Event| match event {
        Event::Sent => Some(true),
        Event::SendFailed(_) => Some(false),
        _ => None,
    };
    events.iter().filter_map(result).collect()
}

/// Checks that the blocks arrived in order and unchanged, each at least once if it was reported as sent. If the
/// acknowledgement of a block was lost, the block arrives several times.
fn arrived_unchanged(
    blocks: &[Vec<u8>],
    results: &[bool],
    mut received: &[&Vec<u8>],
) -> Result<(), TestCaseError> {
    prop_assert_eq!(results.len(), blocks.len());
    for (block, is_sent) in blocks.iter().zip(results) {
        let copies = received.iter().take_while(|it| **it == block).count();
        prop_assert!(!is_sent || copies > 0, "{:02X?} is reported as sent and did not arrive", block);
        received = &received[copies..];
    }
    prop_assert!(received.is_empty(), "{:02X?} was not sent", received);
    Ok(())
}

/// Blocks that differ from their neighbours.
fn blocks(octet: impl Strategy<Value = u8> + Clone, most: usize) -> impl Strategy<Value = Vec<Vec<u8>>> {
    prop::collection::vec(prop::collection::vec(octet, 1..30), 1..=most).prop_map(|mut blocks| {
        blocks.dedup();
        blocks
    })
}

/// Octets that occur often in faults: control characters and 0.
fn octet() -> impl Strategy<Value = u8> + Clone {
    prop_oneof![3 => any::<u8>(), 2 => prop::sample::select(vec![0, STX, ETX, DLE, NAK])]
}

/// True if the characters contain `STX`, the block with doubled `DLE`, `DLE ETX` and the right check sum: then no
/// receiver can know that the block was changed.
fn is_on_the_line(characters: &[Character], block: &[u8]) -> bool {
    let frame = frame(block, true);
    let octets: Vec<Option<u8>> = characters.iter().map(|character| character.byte()).collect();
    octets.windows(frame.len() + 1).any(|window| {
        window[0] == Some(STX)
            && window[1..].iter().zip(&frame).all(|(found, expected)| *found == Some(*expected))
    })
}

proptest! {
    #![proptest_config(crate::property_tests())]

    /// The receivers notice each fault. There may be any number of them, in both directions.
    #[test]
    fn noticed_faults_never_change_a_block(
        blocks in blocks(octet(), 4), there in faults(marked(), 12), back in faults(marked(), 12)
    ) {
        let outcome = exchange([&blocks, &[]], [back, there]);
        arrived_unchanged(&blocks, &results(&outcome.events[0]), &received(&outcome.events[1]))?;
    }

    /// Both partners send, on a good line.
    #[test]
    fn two_senders_exchange_all_blocks(first in blocks(octet(), 4), second in blocks(octet(), 4)) {
        let outcome = exchange([&first, &second], [vec![], vec![]]);
        for (blocks, sender) in [(&first, 0), (&second, 1)] {
            prop_assert!(results(&outcome.events[sender]).iter().all(|is_sent| *is_sent));
            prop_assert_eq!(received(&outcome.events[1 - sender]), blocks.iter().collect::<Vec<_>>());
        }
    }

    /// One fault that the receiver does not notice, in blocks without control characters and 0.
    #[test]
    fn one_hidden_fault_does_not_change_a_block(
        blocks in blocks(0x20u8.., 3), there in faults(hidden(), 1), back in faults(hidden(), 1), is_there: bool
    ) {
        let lines = if is_there { [vec![], there] } else { [back, vec![]] };
        let outcome = exchange([&blocks, &[]], lines);
        arrived_unchanged(&blocks, &results(&outcome.events[0]), &received(&outcome.events[1]))?;
    }

    /// Any faults, any blocks, two senders: the partners come to rest, each block has one result, and a changed block
    /// was on the line with a correct check sum.
    #[test]
    fn any_faults_end_in_results(
        first in blocks(octet(), 3), second in blocks(octet(), 3),
        there in faults(any_fault(), 20), back in faults(any_fault(), 20)
    ) {
        let outcome = exchange([&first, &second], [back, there]);
        for (blocks, sender) in [(&first, 0), (&second, 1)] {
            prop_assert_eq!(results(&outcome.events[sender]).len(), blocks.len());
            for block in received(&outcome.events[1 - sender]) {
                let is_possible = blocks.contains(block) || is_on_the_line(&outcome.characters[1 - sender], block);
                prop_assert!(is_possible, "{:02X?}", block);
            }
        }
    }
}

/// Passes a text to a receiver that has granted the connection, and returns what it received.
fn accepted(text: &[u8]) -> Option<Event> {
    let mut partner = Procedure::new(Settings::new(Priority::Low, CHARACTER));
    partner.received(0, Character::Byte(STX));
    partner.poll(0);
    for (index, octet) in text.iter().enumerate() {
        partner.received(1_000 + index as u64 * CHARACTER, Character::Byte(*octet));
    }
    partner.next_event()
}

#[test]
fn the_check_sum_does_not_detect_these_faults() {
    let text = frame(&[0x41, 0x00, 0x42, ETX, 0x52], true);
    assert_eq!(text, [0x41, 0x00, 0x42, ETX, 0x52, DLE, ETX, 0x41]);
    let cases: [(&str, &[u8], &[u8]); 4] = [
        (
            "the same bit of two octets changes",
            &[0x40, 0x01, 0x42, 0x03, 0x52],
            &[0x40, 0x01, 0x42, ETX, 0x52, DLE, ETX, 0x41],
        ),
        ("16#00 is lost", &[0x41, 0x42, 0x03, 0x52], &[0x41, 0x42, ETX, 0x52, DLE, ETX, 0x41]),
        (
            "two octets are exchanged",
            &[0x00, 0x41, 0x42, 0x03, 0x52],
            &[0x00, 0x41, 0x42, ETX, 0x52, DLE, ETX, 0x41],
        ),
        (
            "16#42 changes into DLE, so that the block ends early",
            &[0x41, 0x00],
            &[0x41, 0x00, DLE, ETX, 0x52],
        ),
    ];
    for (fault, block, characters) in cases {
        assert_eq!(accepted(characters), Some(Event::Received(block.to_vec())), "{fault}");
    }
    assert_eq!(accepted(&text), Some(Event::Received(vec![0x41, 0x00, 0x42, ETX, 0x52])));
}

/// A break before a check sum that equals `STX`: the receiver takes the check sum as a request, and the sender takes the
/// answer to the request as the acknowledgement.
#[test]
fn a_break_before_the_check_sum_can_lose_a_block_without_a_report() {
    let block = vec![DLE ^ ETX ^ STX];
    assert_eq!(frame(&block, true).last(), Some(&STX));
    let etx = 3;
    let fault = Fault::Marked(crate::serial::CharacterError::Break);
    let outcome = exchange([core::slice::from_ref(&block), &[]], [vec![], vec![(etx, fault)]]);
    assert_eq!(results(&outcome.events[0]), [true]);
    assert_eq!(received(&outcome.events[1]), Vec::<&Vec<u8>>::new());
}
