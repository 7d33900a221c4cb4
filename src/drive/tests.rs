//! The drive as the bus sees it.

use super::*;
use crate::bus::codec::WordConfig;
use std::num::NonZeroU32;

const INTERVAL: u32 = 2000;

/// A drive on a bus of its own; `now` is the time of the next SYNC edge.
struct Bench {
    drive: Drive,
    now: u64,
}

impl Bench {
    fn new(cfg: &DriveConfig) -> Self {
        Bench { drive: Drive::new(cfg).unwrap(), now: 0 }
    }

    /// SYNC mode is on and the lock time is over.
    fn synchronized(cfg: &DriveConfig) -> Self {
        let mut bench = Bench::new(&DriveConfig { lock_time_us: 0, ..cfg.clone() });
        bench.drive.action_command(&ActionCommand::sync_mode(ActionCommand::ALL_SLAVES, true));
        bench.edge();
        bench
    }

    fn edge(&mut self) -> &mut Self {
        self.drive.sync_edge(self.now, INTERVAL);
        self.now += u64::from(INTERVAL);
        self
    }

    fn send(&mut self, channel: Channel, words: &[u16]) -> &mut Self {
        self.drive.reference_frame(channel, &words_of(words));
        self
    }

    fn control(&mut self, word: u16) -> &mut Self {
        self.drive.action_command(&ActionCommand::control_word(1 << self.drive.slave_number(), word));
        self
    }

    fn p(&self, number: u16) -> u32 {
        self.drive.parameter(number).unwrap()
    }
}

fn words_of(words: &[u16]) -> Payload {
    let mut all = [0; 4];
    all[..words.len()].copy_from_slice(words);
    Payload::from_words(all, words.len())
}

fn demo() -> DriveConfig {
    DriveConfig::demo("drive", 3)
}

/// The demo drive with another card configuration.
fn with_zk(change: impl FnOnce(&mut ZkParameters)) -> DriveConfig {
    let mut zk = demo().standard_mapping();
    change(&mut zk);
    DriveConfig { zk: Some(zk), ..demo() }
}

fn zk_fault(cfg: &DriveConfig) -> (u8, ZkError) {
    match Drive::new(cfg) {
        Err(DriveError::Zk { drive, zk, reason, .. }) if drive == cfg.name => (zk, reason),
        other => panic!("no ZK error: {other:?}"),
    }
}

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
fn faulty_card_parameters_are_named() {
    let wide = ParamFormat::Doubleword;
    let cases: [(DriveConfig, (u8, ZkError)); 12] = [
        (with_zk(|zk| zk.zk_0 = 120), (0, ZkError::ControlOrStatusWord(120))),
        (with_zk(|zk| zk.zk_1 = 121), (1, ZkError::ControlOrStatusWord(121))),
        (with_zk(|zk| zk.zk_16 = 121), (16, ZkError::ControlOrStatusWord(121))),
        (with_zk(|zk| zk.zk_17 = 120), (17, ZkError::ControlOrStatusWord(120))),
        (with_zk(|zk| zk.zk_0 = 999), (0, ZkError::NoParameter(999))),
        (with_zk(|zk| zk.zk_1 = 301), (1, ZkError::ReadOnly(301))),
        (with_zk(|zk| zk.zk_4 = 0x0001), (4, ZkError::Format(300))),
        (with_zk(|zk| zk.zk_5 = 0x0011), (5, ZkError::Mapping(MappingError::Frame(2)))),
        (with_zk(|zk| zk.zk_21 = 0x0047), (21, ZkError::Mapping(MappingError::BeyondFrame))),
        (with_zk(|zk| zk.zk_25 = 0x0003), (25, ZkError::Overlap(20))),
        (with_zk(|zk| zk.zk_24 = 4), (24, ZkError::Delay)),
        (
            with_zk(|zk| {
                let source = Source::Slave(3);
                zk.zk_4 = ReferenceMapping { word: 0, channel: Channel::One, format: wide, source }.to_zk();
            }),
            (4, ZkError::OwnFrame),
        ),
    ];
    for (cfg, fault) in cases {
        assert_eq!(zk_fault(&cfg), fault);
    }
}

#[test]
fn numbers_of_unmapped_values_do_not_matter() {
    let cfg = with_zk(|zk| (zk.zk_0, zk.zk_4, zk.zk_17, zk.zk_21) = (120, 0, 9999, 0));
    assert!(Drive::new(&cfg).is_ok());
}

#[test]
fn faulty_drives_are_refused() {
    assert!(matches!(
        Drive::new(&DriveConfig::demo("a", 32)),
        Err(DriveError::SlaveNumber { number: 32, .. })
    ));
    for number in [120, 121, 300, 301, 302] {
        let parameters = vec![ParameterSpec::new(number, ParamFormat::Word)];
        let err = Drive::new(&DriveConfig { parameters, ..demo() }).unwrap_err();
        assert_eq!(
            err,
            DriveError::Parameter { drive: "drive".into(), number, reason: ParameterError::Twice }
        );
    }
}

#[test]
fn built_in_numbers_can_be_changed_and_the_standard_mapping_follows() {
    let numbers = ParameterNumbers { speed_reference: 18, speed_actual: 19, additional_reference: 20 };
    let mut bench = Bench::synchronized(&DriveConfig { numbers, ..demo() });
    bench.send(Channel::One, &[5, 0]).edge();
    assert_eq!((bench.p(18), bench.p(19), bench.drive.parameter(300)), (5, 5, None));
}

#[test]
fn bit_15_comes_after_the_lock_time() {
    let mut bench = Bench::new(&DriveConfig { lock_time_us: 10_000, ..demo() });
    bench.edge().edge();
    bench.drive.action_command(&ActionCommand::sync_mode(1 << 3, true));
    let states: Vec<u16> = (0..6).map(|_| bench.edge().drive.status_word()).collect();
    assert_eq!(states, [0x0037, 0x0037, 0x0037, 0x0037, 0x0037, 0x8037]);
    assert_eq!(bench.drive.actual_value_frame(Channel::One).and_then(|p| p.word(2)), Some(0x8037));
    bench.now += u64::from(INTERVAL);
    bench.edge();
    assert!(!bench.drive.is_synchronized());
}

#[test]
fn sync_mode_off_or_no_sync_ends_the_synchronized_state() {
    let mut bench = Bench::synchronized(&demo());
    bench.drive.sync_stopped();
    assert_eq!(bench.drive.status_word(), 0x0037);
    let mut bench = Bench::synchronized(&demo());
    bench.drive.action_command(&ActionCommand::sync_mode(1 << 3, false));
    assert_eq!(bench.drive.status_word(), 0x0037);
}

#[test]
fn reference_values_do_not_reach_a_drive_out_of_step() {
    let mut bench = Bench::new(&DriveConfig { lock_time_us: 6_000, ..demo() });
    bench.drive.action_command(&ActionCommand::sync_mode(1 << 3, true));
    for _ in 0..4 {
        bench.send(Channel::One, &[7, 0]).edge();
    }
    assert!(bench.drive.is_synchronized());
    bench.edge();
    assert_eq!(bench.p(300), 0, "what came before the lock is forgotten");
    bench.send(Channel::One, &[8, 0]).edge();
    assert_eq!(bench.p(300), 8);
}

#[test]
fn commands_for_others_are_ignored() {
    let mut bench = Bench::synchronized(&demo());
    bench.drive.action_command(&ActionCommand::control_word(!(1 << 3), 0));
    bench.drive.action_command(&ActionCommand::sync_mode(!(1 << 3), false));
    assert_eq!(bench.drive.status_word(), 0x8037);
}

#[test]
fn unknown_commands_mean_nothing() {
    let mut bench = Bench::synchronized(&demo());
    let command = ActionCommand { slave_group: u32::MAX, command: 0x80, data_byte: 0, data_word: 0 };
    bench.drive.action_command(&command);
    assert_eq!(bench.drive.status_word(), 0x8037);
}

#[test]
fn moves_only_in_operation_enabled() {
    let mut bench = Bench::synchronized(&DriveConfig { enable: Enable::ByControlWord, ..demo() });
    bench.send(Channel::One, &[100, 0]).edge();
    assert_eq!((bench.p(300), bench.p(301), bench.drive.status_word()), (100, 0, 0x8050));
    bench.control(0x0006).control(0x0007).control(0x000F).edge();
    assert_eq!((bench.p(301), bench.p(120), bench.p(121)), (100, 0x000F, 0x8037));
    bench.control(0x0007).edge();
    assert_eq!((bench.p(301), bench.drive.state()), (0, State::SwitchedOn));
}

#[test]
fn ramp_brakes_down_to_the_end_of_a_quick_stop() {
    let ramp_per_second = NonZeroU32::new(25_000); // 50 per interval
    let mut bench = Bench::synchronized(&DriveConfig { ramp_per_second, ..demo() });
    bench.send(Channel::One, &[120, 0]).edge();
    assert_eq!(bench.p(301), 50);
    bench.edge().edge();
    assert_eq!(bench.p(301), 120);
    bench.control(0x000B).edge();
    assert_eq!((bench.p(301), bench.drive.state()), (70, State::QuickStopActive));
    bench.edge().edge();
    assert_eq!((bench.p(301), bench.drive.state()), (0, State::SwitchOnDisabled));
}

#[test]
fn fault_stops_the_drive_until_it_is_reset() {
    let mut bench = Bench::synchronized(&demo());
    bench.send(Channel::One, &[120, 0]).edge();
    bench.drive.trip();
    assert_eq!(bench.drive.state(), State::FaultReactionActive);
    bench.edge();
    assert_eq!((bench.p(301), bench.drive.status_word()), (0, 0x8018));
    bench.control(0x0080).control(0x0006).control(0x000F).edge();
    assert_eq!(bench.p(301), 120);
    bench.drive.set_warning(true);
    assert_eq!(bench.drive.status_word(), 0x80B7);
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
    bench.send(Channel::One, &[3, 0]).control(0x0007).edge().edge();
    assert_eq!((bench.p(300), bench.drive.actual_value_frame(Channel::One)), (2, frozen));
    bench.drive.action_command(&ActionCommand::sync_mode(1 << 3, true));
    bench.send(Channel::One, &[3, 0]).edge();
    assert_eq!((bench.p(300), bench.drive.is_exchange_stopped()), (3, false));
}

#[test]
fn parameter_jobs() {
    use Access::{Read, WriteDoubleword, WriteWord};
    use ParameterResult::{Done, Doubleword, Error, Word};
    let parameters = vec![
        ParameterSpec {
            min: Some(1),
            max: Some(100),
            initial: 7,
            ..ParameterSpec::new(400, ParamFormat::Word)
        },
        ParameterSpec { initial: 9, ..ParameterSpec::new(0, ParamFormat::Doubleword) },
    ];
    let mut bench = Bench::new(&DriveConfig { parameters, ..demo() });
    for (number, access, result) in [
        (400, Read, Word(7)),
        (400, WriteWord(8), Done),
        (400, Read, Word(8)),
        (400, WriteWord(0), Error(0xFFFE)),
        (400, WriteWord(101), Error(0xFFFD)),
        (400, WriteDoubleword(8), Error(0xFFF9)),
        (0, Read, Doubleword(9)),
        (0, WriteWord(1), Error(0xFFF9)),
        (0, WriteDoubleword(1), Done),
        (1, Read, Error(0xFFFB)),
        (4095, WriteWord(1), Error(0xFFFB)),
        (301, WriteDoubleword(1), Error(0xFFFC)),
        (121, Read, Word(0x0037)),
        (121, WriteWord(1), Error(0xFFFC)),
        (120, Read, Word(0x000F)),
        (120, WriteWord(0x0007), Done),
        (121, Read, Word(0x0033)),
        (120, Read, Word(0x0007)),
        (300, WriteDoubleword(5), Done),
        (300, Read, Doubleword(5)),
    ] {
        let job = ParameterJob::new(number, access).unwrap();
        assert_eq!(bench.drive.parameter_job(&job), job.answer(result), "{number} {access:?}");
    }
}

#[test]
fn elements_and_sub_slaves() {
    let mut bench = Bench::new(&demo());
    for element in 0..8 {
        let read = ParameterJob::new(302, Access::Read).unwrap().with_element(element).unwrap();
        assert_eq!(bench.drive.parameter_job(&read).result(), ParameterResult::Doubleword(0));
        let write =
            ParameterJob::new(302, Access::WriteDoubleword(0)).unwrap().with_element(element).unwrap();
        let result = if element == 7 { ParameterResult::Done } else { ParameterResult::Error(0xFFFC) };
        assert_eq!(bench.drive.parameter_job(&write).result(), result, "element {element}");
    }
    let job = ParameterJob::new(302, Access::Read).unwrap().with_sub_slave(1);
    assert_eq!(bench.drive.parameter_job(&job), job.answer(ParameterResult::Error(0xFFFB)));
}

#[test]
fn master_and_drive_agree_on_the_words() {
    // What a master's configuration registers build is what the card takes out, and back again.
    use crate::bus::codec::FrameConfig;
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
