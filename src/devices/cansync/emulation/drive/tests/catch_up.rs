//! A drive that catches up has the same state as a drive that processed every event at once.

use super::*;
use crate::devices::cansync::drive::{BusEvent, EventLog};
use crate::snapshot_fields::{Saving, SnapshotFields};
use proptest::prelude::*;

fn passed() -> impl Strategy<Value = BusEvent> {
    let reference =
        (prop_oneof![9 => Just(500), 1 => Just(250)], any::<bool>(), any::<[u16; 4]>(), 0..5usize);
    prop_oneof![
        // Most intervals have the regular length, so that the drive becomes synchronized and stays
        // synchronized.
        3 => prop_oneof![9 => Just(2000_u64), 1 => 0..9000_u64]
            .prop_map(|now_us| BusEvent::Edge { now_us, interval_us: INTERVAL }),
        3 => reference.prop_map(|(kbit_s, first, words, count)| BusEvent::Reference {
            kbit_s,
            channel: if first { Channel::One } else { Channel::Two },
            payload: Payload::from_words(words, count),
        }),
    ]
}

/// Arbitrary events, or uniform intervals with frames of eight bytes on `channels`.
fn stretches() -> impl Strategy<Value = Vec<BusEvent>> {
    let small = || (0..9_u16, 0..9_u16).prop_map(|(one, two)| [one, 0, two, 0]);
    let words = || prop_oneof![any::<[u16; 4]>(), small()];
    let alike = prop::collection::vec((words(), words()), 1..9);
    let alike = (alike, prop_oneof![9 => Just(500), 1 => Just(250)], 0..4_u8).prop_map(
        |(intervals, kbit_s, channels)| {
            let frame = |channel: Channel, words| BusEvent::Reference {
                kbit_s,
                channel,
                payload: Payload::from_words(words, 4),
            };
            let interval = |(one, two)| {
                let frames = [frame(Channel::One, one), frame(Channel::Two, two)].into_iter().enumerate();
                let frames = frames.filter(|(bit, _)| channels >> bit & 1 != 0).map(|(_, frame)| frame);
                let edge = BusEvent::Edge { now_us: INTERVAL.into(), interval_us: INTERVAL };
                core::iter::once(edge).chain(frames).collect::<Vec<_>>()
            };
            intervals.into_iter().flat_map(interval).collect()
        },
    );
    prop_oneof![1 => passed().prop_map(|one| vec![one]), 2 => alike]
}

/// Drives with different configurations of the card.
fn drives() -> Vec<Drive> {
    let quick = |cfg: DriveConfig| DriveConfig { lock_time_us: 4000, ..cfg };
    let mode = ParameterSpec { initial: 1, ..ParameterSpec::new(number::OPERATING_MODE, ParamFormat::Word) };
    let limited = ParameterSpec { max: Some(5), ..ParameterSpec::new(400, ParamFormat::Word) };
    let ramped = DriveConfig { ramp_per_second: core::num::NonZeroU32::new(70_000), ..demo() };
    let configs = [
        demo(),
        ramped,
        with_zk(|zk| zk.zk_26 = 1),
        with_zk(|zk| zk.zk_24 = 2),
        with_zk(|zk| (zk.zk_0, zk.zk_25) = (number::ANGLE_REFERENCE, 0x000D)),
        with_zk(|zk| (zk.zk_1, zk.zk_5) = (number::PWM_FREQUENCY, 0x0009)),
        DriveConfig { parameters: vec![limited], ..with_zk(|zk| (zk.zk_1, zk.zk_5) = (400, 0x0009)) },
        DriveConfig { parameters: vec![mode], ..with_zk(|zk| zk.zk_0 = number::ANGLE_REFERENCE) },
        DriveConfig { card_function: CardFunction::Old, ..with_zk(|zk| zk.zk_5 |= 0x0980) },
    ];
    configs.map(|cfg| Drive::new(&quick(cfg), 500)).into_iter().collect::<Result<_, _>>().unwrap()
}

fn takes(drive: &mut Drive, passed: &BusEvent) {
    match *passed {
        BusEvent::Edge { now_us, interval_us } => drive.sync_edge(now_us, interval_us),
        BusEvent::Reference { kbit_s, channel, ref payload } if kbit_s == drive.kbit_s() => {
            drive.reference_frame(channel, payload);
        }
        BusEvent::Reference { .. } => {}
    }
}

fn state(drive: &Drive) -> Vec<u8> {
    let mut to = Saving::reusing(Vec::new());
    drive.save(&mut to);
    to.into_bytes()
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn the_time_of_catching_up_does_not_matter(
        all in prop::collection::vec(stretches(), 1..30),
        stretch in 1..40usize,
        control_word: Option<u16>,
    ) {
        let (mut all, mut now) = (all.concat(), 0);
        for it in &mut all {
            if let BusEvent::Edge { now_us, .. } = it {
                now += *now_us;
                *now_us = now;
            }
        }
        for mut at_once in drives() {
            at_once.action_command(&ActionCommand::sync_mode(ActionCommand::ALL_SLAVES, true));
            if let Some(word) = control_word {
                at_once.action_command(&ActionCommand::control_word(ActionCommand::ALL_SLAVES, word));
            }
            let mut later = at_once.clone();
            let mut log = EventLog::default();
            for stretch in all.chunks(stretch) {
                let taken = log.len();
                stretch.iter().for_each(|it| takes(&mut at_once, it));
                stretch.iter().for_each(|it| log.push(*it));
                later.catch_up(&log.since(taken));
                prop_assert_eq!(state(&at_once), state(&later));
                for channel in [Channel::One, Channel::Two] {
                    prop_assert_eq!(at_once.actual_value_frame(channel), later.actual_value_frame(channel));
                }
            }
        }
    }
}

#[test]
fn uniform_intervals_are_found_from_every_start() {
    let mut log = EventLog::default();
    let mut now_us = 0;
    for interval in 0..6 {
        now_us += if interval == 2 { 2600 } else { u64::from(INTERVAL) };
        log.push(BusEvent::Edge { now_us, interval_us: INTERVAL });
        for channel in [Channel::One, Channel::Two] {
            log.push(BusEvent::Reference { kbit_s: 500, channel, payload: Payload::from_words([7; 4], 4) });
        }
    }
    // The third edge is late. So the uniform intervals begin at this edge.
    for (taken, one_by_one, alike, rest) in
        [(0, 6, 3, 3), (6, 0, 3, 3), (7, 2, 2, 3), (9, 0, 2, 3), (15, 0, 0, 3), (16, 0, 0, 2), (18, 0, 0, 0)]
    {
        let since = log.since(taken);
        let parts = (since.one_by_one.len(), since.alike.count(), since.rest.len());
        assert_eq!(parts, (one_by_one, alike, rest), "{taken}");
    }
}
