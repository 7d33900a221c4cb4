//! Process data and the ZK parameters.

use super::*;
use crate::devices::cansync::drive::number::STATUS_WORD;
use crate::devices::cansync::frames::codec::WordConfig;
use proptest::prelude::*;

#[test]
fn reference_value_of_interval_k_is_the_actual_value_of_interval_k_plus_2() {
    let mut bench = Bench::synchronized(&demo());
    bench.send(Channel::One, &[0x3344, 0x1122]);
    assert_eq!(bench.p(300), 0);
    bench.edge();
    assert_eq!((bench.p(300), bench.p(301)), (0x1122_3344, 0x1122_3344));
    assert_eq!(bench.drive.actual_value_frame(Channel::One), Some(words_of(&[0, 0, 0x8037])));
    bench.edge();
    assert_eq!(bench.drive.actual_value_frame(Channel::One), Some(words_of(&[0x3344, 0x1122, 0x8037])));
    bench.edge();
    assert_eq!(bench.p(301), 0x1122_3344, "without a new value the last one stays");
}

#[test]
fn second_channel_carries_the_additional_reference_value() {
    let mut bench = Bench::synchronized(&demo());
    bench.send(Channel::Two, &[0x5566, 0x7788, 1, 2]).edge().edge();
    assert_eq!(bench.p(302), 0x7788_5566);
    assert_eq!(bench.drive.actual_value_frame(Channel::Two), Some(words_of(&[0x5566, 0x7788])));
    assert_eq!(bench.p(301), 0);
}

#[test]
fn zk_24_delays_by_whole_intervals() {
    for delay in 0..=3 {
        let mut bench = Bench::synchronized(&with_zk(|zk| zk.zk_24 = delay));
        for k in 1..=9u16 {
            bench.send(Channel::One, &[k, 0]).edge();
            assert_eq!(bench.p(300), u32::from(k.saturating_sub(delay)), "ZK 24 = {delay}, interval {k}");
        }
        bench.edge().edge().edge();
        assert_eq!(bench.p(300), 9);
    }
}

/// Manual 5.01010.01 p. 10: a card with function 0 needs the other slave's frame in every interval.
#[test]
fn card_function_0_needs_another_slaves_value_in_every_interval() {
    let taken = |card_function| {
        let source = Source::Slave(31);
        let mapping =
            ReferenceMapping { word: 0, channel: Channel::One, format: ParamFormat::Doubleword, source };
        let mut bench =
            Bench::synchronized(&DriveConfig { card_function, ..with_zk(|zk| zk.zk_4 = mapping.to_zk()) });
        [true, true, true, false, true, false, true, true].map(|comes| {
            if comes {
                let value = (bench.now / u64::from(INTERVAL)) as u16;
                bench.drive.overheard_frame(31, Channel::One, &words_of(&[value, 0]));
            }
            bench.edge().p(300)
        })
    };
    assert_eq!(taken(CardFunction::Current), [1, 2, 3, 3, 5, 5, 7, 8]);
    assert_eq!(taken(CardFunction::Old), [0, 2, 3, 3, 3, 3, 3, 8]);
}

/// Manual 5.01010.01 p. 17: ZK 26 has an effect only with card function 1.
#[test]
fn card_function_0_has_no_zk_26() {
    for (card_function, stops) in [(CardFunction::Old, false), (CardFunction::Current, true)] {
        let cfg = DriveConfig { card_function, ..with_zk(|zk| zk.zk_26 = 1) };
        let mut bench = Bench::synchronized(&cfg);
        bench.send(Channel::One, &[7, 0]).edge().edge().edge();
        assert_eq!(bench.drive.is_exchange_stopped(), stops, "{card_function:?}");
    }
}

#[test]
fn reference_values_at_every_place_of_the_frame() {
    let frame = words_of(&[0x1110, 0x2221, 0x3332, 0x4443]);
    for word in 0..4u8 {
        for channel in Channel::ALL {
            for format in [ParamFormat::Word, ParamFormat::Doubleword] {
                if word == 3 && format == ParamFormat::Doubleword {
                    continue;
                }
                let mapping = ReferenceMapping { word, channel, format, source: Source::Master };
                let mut cfg = DriveConfig {
                    zk: Some(ZkParameters { zk_0: 400, zk_4: mapping.to_zk(), ..Default::default() }),
                    ..demo()
                };
                cfg.parameters = vec![ParameterSpec::new(400, format)];
                let mut bench = Bench::synchronized(&cfg);
                assert_eq!(
                    Channel::ALL.map(|c| bench.drive.wants_reference(c)),
                    Channel::ALL.map(|c| c == channel)
                );
                for c in Channel::ALL {
                    let payload = if c == channel { frame } else { words_of(&[0xFFFF; 4]) };
                    bench.drive.reference_frame(c, &payload);
                }
                bench.edge();
                let whole = u64::from_le_bytes(frame.padded()) >> (16 * word);
                assert_eq!(bench.p(400), whole as u32 & format.mask(), "{mapping:?}");
            }
        }
    }
}

#[test]
fn a_frame_too_short_for_the_value_changes_nothing() {
    let mut bench = Bench::synchronized(&demo());
    for len in 0..4 {
        bench.drive.reference_frame(Channel::One, &Payload::from_padded([0xFF; 8], len));
        bench.edge();
        assert_eq!(bench.p(300), 0, "{len} bytes");
    }
    bench.drive.reference_frame(Channel::One, &Payload::from_padded([1; 8], 4));
    bench.edge();
    assert_eq!(bench.p(300), 0x0101_0101);
}

#[test]
fn zk_4_bit_7_takes_the_value_from_another_slave() {
    let mapping = ReferenceMapping {
        word: 1,
        channel: Channel::Two,
        format: ParamFormat::Doubleword,
        source: Source::Slave(31),
    };
    let mut bench = Bench::synchronized(&with_zk(|zk| zk.zk_4 = mapping.to_zk()));
    assert_eq!(bench.drive.wants_overheard(), 1 << 31);
    assert!(!bench.drive.wants_reference(Channel::One));
    let frame = words_of(&[0, 0x3344, 0x1122]);
    bench.drive.overheard_frame(30, Channel::Two, &frame);
    bench.drive.overheard_frame(31, Channel::One, &frame);
    bench.send(Channel::One, &[1, 1, 1]).edge();
    assert_eq!(bench.p(300), 0);
    bench.drive.overheard_frame(31, Channel::Two, &frame);
    bench.edge();
    assert_eq!(bench.p(300), 0x1122_3344);
}

#[test]
fn nothing_mapped_means_no_answer() {
    let mut bench = Bench::synchronized(&DriveConfig { zk: Some(ZkParameters::default()), ..demo() });
    bench.edge();
    assert_eq!(Channel::ALL.map(|c| bench.drive.actual_value_frame(c)), [None; 2]);
    assert_eq!(Channel::ALL.map(|c| bench.drive.wants_reference(c)), [false; 2]);
    assert_eq!(bench.drive.wants_overheard(), 0);
}

#[test]
fn actual_value_frame_reaches_to_the_last_mapped_word() {
    let mut bench = Bench::synchronized(&with_zk(|zk| {
        zk.zk_20 = 0;
        zk.zk_21 = 0x0043; // doubleword in RDC1 from word 1
        zk.zk_25 = 0x000F; // RDC2, word 3
    }));
    bench.send(Channel::Two, &[0x3344, 0x1122]).edge().edge();
    assert_eq!(bench.drive.actual_value_frame(Channel::One), Some(words_of(&[0, 0x3344, 0x1122])));
    assert_eq!(bench.drive.actual_value_frame(Channel::Two), Some(words_of(&[0, 0, 0, 0x8037])));
}

#[test]
fn losses_are_counted_from_the_first_frame_on() {
    let mut bench = Bench::synchronized(&demo());
    bench.edge().edge();
    assert_eq!(bench.drive.reference_losses(), 0);
    bench.send(Channel::One, &[1, 0]).edge();
    bench.edge().edge();
    assert_eq!(bench.drive.reference_losses(), 2);
    bench.send(Channel::One, &[1, 0]).send(Channel::Two, &[1, 0]).edge();
    bench.edge();
    assert_eq!(bench.drive.reference_losses(), 4, "both frames lost");
    assert!(!bench.drive.is_exchange_stopped());
}

#[test]
fn zk_26_stops_the_exchange_after_more_losses_in_succession() {
    let mut bench = Bench::synchronized(&with_zk(|zk| zk.zk_26 = 2));
    bench.send(Channel::One, &[1, 0]).edge();
    bench.edge().edge();
    assert!(!bench.drive.is_exchange_stopped(), "two are allowed");
    bench.send(Channel::One, &[2, 0]).edge();
    bench.edge().edge().edge();
    assert!(bench.drive.is_exchange_stopped());
    let frozen = bench.drive.actual_value_frame(Channel::One);
    bench.send(Channel::One, &[3, 0]).edge().edge();
    assert_eq!((bench.p(300), bench.drive.actual_value_frame(Channel::One)), (2, frozen));
    bench.sync_mode(true).send(Channel::One, &[3, 0]).edge();
    assert_eq!((bench.p(300), bench.drive.is_exchange_stopped()), (3, false));
}

/// 5.01010.01 p. 30: bit 15 belongs to the card and does not depend on the drive's status word. This is still
/// true when ZK 26 has stopped the exchange.
#[test]
fn bit_15_goes_with_the_lock_also_after_the_exchange_was_stopped() {
    let mut bench = Bench::synchronized(&with_zk(|zk| zk.zk_26 = 1));
    bench.send(Channel::One, &[7, 0]).edge().edge().edge().edge();
    assert!(bench.drive.is_exchange_stopped());
    let frame = |bench: &Bench| bench.drive.actual_value_frame(Channel::One);
    assert_eq!(frame(&bench), Some(words_of(&[7, 0, 0x8037])));
    bench.sync_mode(false).control(0x0007).edge();
    assert_eq!(frame(&bench), Some(words_of(&[7, 0, 0x0037])), "nothing else comes from the drive");
    bench.edge();
    assert_eq!(frame(&bench), Some(words_of(&[7, 0, 0x0037])));
    bench.sync_mode(true).edge();
    assert_eq!(frame(&bench), Some(words_of(&[7, 0, 0x80B7])), "as it is: enabled, error reported");
    bench.edge();
    assert_eq!(frame(&bench), Some(words_of(&[0, 0, 0x8033])), "the drive has the control word");
}

#[test]
fn master_and_drive_agree_on_the_words() {
    // The card extracts the words that the configuration registers of a master put into a frame, and the master
    // extracts the words of the card.
    use crate::devices::cansync::frames::codec::FrameConfig;
    let words = [WordConfig::new(2, false).0, WordConfig::new(2, true).0, 0, 0];
    let built = FrameConfig::master_reference(words).build(|_| 0x1122_3344);
    let mut bench = Bench::synchronized(&demo());
    bench.drive.reference_frame(Channel::One, &built.payload);
    bench.edge().edge();
    let mut value = 0;
    let answer = bench.drive.actual_value_frame(Channel::One).unwrap();
    FrameConfig::new(words)
        .scatter(&answer, |_, high, word| value |= u32::from(word) << (16 * u32::from(high)));
    assert_eq!(value, 0x1122_3344);
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn any_sequence_of_reference_values(delay in 0usize..=3, sent in prop::collection::vec(any::<Option<u32>>(), 0..24)) {
        let mut bench = Bench::synchronized(&with_zk(|zk| zk.zk_24 = delay as u16));
        let mut shown = 0;
        for k in 0..sent.len() {
            if let Some(value) = sent[k] {
                bench.send(Channel::One, &[value as u16, (value >> 16) as u16]);
            }
            bench.edge();
            let due = sent[..(k + 1).saturating_sub(delay)].iter().rev().find_map(|value| *value).unwrap_or(0);
            prop_assert_eq!(bench.p(301), due, "after interval {}", k);
            let frame = bench.drive.actual_value_frame(Channel::One).unwrap();
            let sampled = u32::from(frame.word(0).unwrap()) | u32::from(frame.word(1).unwrap()) << 16;
            prop_assert_eq!(sampled, shown, "sampled at edge {}", k);
            shown = due;
        }
    }

    #[test]
    fn arbitrary_frames_never_cause_a_panic(
        frames in prop::collection::vec((any::<u8>(), any::<[u8; 8]>(), 0usize..=8), 0..40),
        zk_26 in 0u16..4,
    ) {
        let mut bench = Bench::synchronized(&with_zk(|zk| zk.zk_26 = zk_26));
        for (kind, bytes, len) in frames {
            let payload = Payload::from_padded(bytes, len);
            match kind % 5 {
                0 => bench.drive.reference_frame(Channel::One, &payload),
                1 => bench.drive.overheard_frame(kind, Channel::Two, &payload),
                2 => drop(ActionCommand::decode(&payload).map(|command| bench.drive.action_command(&command))),
                3 => drop(ParameterJob::decode(&payload).map(|job| {
                    let response = bench.drive.parameter_job(&job);
                    assert_eq!(ParameterResponse::decode(&job, response.frame(3).payload()), Ok(response));
                })),
                _ => drop(bench.edge()),
            }
        }
        prop_assert_eq!(bench.drive.parameter(STATUS_WORD), Some(u32::from(bench.drive.status_word())));
    }
}
