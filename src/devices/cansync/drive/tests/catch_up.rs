//! A drive that catches up is as one that has taken everything when it came.

use super::*;
use crate::devices::cansync::drive::Passed;
use crate::state::{Saving, State};
use proptest::prelude::*;

fn passed() -> impl Strategy<Value = Passed> {
    let reference =
        (prop_oneof![9 => Just(500), 1 => Just(250)], any::<bool>(), any::<[u16; 4]>(), 0..5usize);
    prop_oneof![
        // Mostly in time, so that the drive gets and stays synchronized.
        3 => prop_oneof![9 => Just(2000_u64), 1 => 0..9000_u64]
            .prop_map(|now_us| Passed::Edge { now_us, interval_us: INTERVAL }),
        3 => reference.prop_map(|(kbit_s, first, words, count)| Passed::Reference {
            kbit_s,
            channel: if first { Channel::One } else { Channel::Two },
            payload: Payload::from_words(words, count),
        }),
    ]
}

/// Drives whose cards do different things with what comes.
fn drives() -> Vec<Drive> {
    let quick = |cfg: DriveConfig| DriveConfig { lock_time_us: 4000, ..cfg };
    let mode = ParameterSpec { initial: 1, ..ParameterSpec::new(number::OPERATING_MODE, ParamFormat::Word) };
    let ramped = DriveConfig { ramp_per_second: core::num::NonZeroU32::new(70_000), ..demo() };
    let configs = [
        demo(),
        ramped,
        with_zk(|zk| zk.zk_26 = 1),
        with_zk(|zk| zk.zk_24 = 2),
        with_zk(|zk| (zk.zk_0, zk.zk_25) = (number::ANGLE_REFERENCE, 0x000D)),
        DriveConfig { parameters: vec![mode], ..with_zk(|zk| zk.zk_0 = number::ANGLE_REFERENCE) },
        DriveConfig { card_function: CardFunction::Old, ..with_zk(|zk| zk.zk_5 |= 0x0980) },
    ];
    configs.map(|cfg| Drive::new(&quick(cfg), 500)).into_iter().collect::<Result<_, _>>().unwrap()
}

fn takes(drive: &mut Drive, passed: &Passed) {
    match *passed {
        Passed::Edge { now_us, interval_us } => drive.sync_edge(now_us, interval_us),
        Passed::Reference { kbit_s, channel, ref payload } if kbit_s == drive.kbit_s() => {
            drive.reference_frame(channel, payload);
        }
        Passed::Reference { .. } => {}
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
    fn it_does_not_matter_when(mut all in prop::collection::vec(passed(), 1..60), stretch in 1..20usize) {
        let mut now = 0;
        for it in &mut all {
            if let Passed::Edge { now_us, .. } = it {
                now += *now_us;
                *now_us = now;
            }
        }
        for mut at_once in drives() {
            at_once.action_command(&ActionCommand::sync_mode(ActionCommand::ALL_SLAVES, true));
            let mut later = at_once.clone();
            for stretch in all.chunks(stretch) {
                stretch.iter().for_each(|it| takes(&mut at_once, it));
                later.catch_up(stretch);
                prop_assert_eq!(state(&at_once), state(&later));
                for channel in [Channel::One, Channel::Two] {
                    prop_assert_eq!(at_once.actual_value_frame(channel), later.actual_value_frame(channel));
                }
            }
        }
    }
}
