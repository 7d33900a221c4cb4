use super::*;
use crate::devices;
use crate::devices::samples::tables::NODES as DEVICE;
use crate::fault::{Fault, FaultSpec, FaultStatus};
use crate::identity::{DeviceIndex, PortNumber};
use crate::layout::{Compare, DeviceFit, NamedLocation};
use crate::memory::Width;
use crate::plant::Forced;
use crate::request::testing::{RAM, TestHost};
use crate::request::{Code, MAX_ADVANCE_US, MAX_CONDITIONS, MAX_RANGE, MAX_SPEED, Waited};
use core::num::NonZeroU16;

const REG: u32 = RAM.start + 100;

fn peek(offset: u32, width: Width) -> Op {
    Op::Peek { plc: DeviceIndex(0), offset, width }
}

fn poke(offset: u32, width: Width, value: u32) -> Op {
    Op::Poke { plc: DeviceIndex(0), offset, width, value }
}

fn wait(mask: u32, value: u32, within_us: u64) -> Op {
    Op::Wait { plc: DeviceIndex(0), offset: REG, width: Width::Word, mask, value, within_us }
}

fn condition(offset: u32, compare: Compare, value: u32) -> Op {
    let test = Test { mask: 0xFFFF, compare, is_signed: false, value };
    Op::Condition { plc: DeviceIndex(0), offset, width: Width::Word, test }
}

#[test]
fn a_wait_for_conditions_ends_when_all_hold_at_once() {
    let conditions = [condition(REG, Compare::Equal, 1), condition(REG + 2, Compare::Greater, 4)];
    let outcome = |any| {
        let mut host = TestHost::new(true);
        // First only the first condition holds, then only the second one, then both.
        host.script.extend([(1_000, REG, 1), (2_000, REG, 0), (2_000, REG + 2, 5), (3_000, REG, 1)]);
        let wait = Op::WaitFor { any, within_us: 10_000 };
        host.request(&[conditions[0], conditions[1], wait]).pop()
    };
    assert_eq!(outcome(false), Some(Reply::Waited(Waited { time_us: 3_000, value: 0b11 })));
    assert_eq!(outcome(true), Some(Reply::Waited(Waited { time_us: 1_000, value: 0b01 })));
}

#[test]
fn a_timeout_returns_the_conditions_that_hold() {
    let mut host = TestHost::new(true);
    let ops = [
        poke(REG, Width::Word, 7),
        condition(REG, Compare::LessOrEqual, 7),
        condition(REG, Compare::NotEqual, 7),
        Op::WaitFor { any: false, within_us: 2_000 },
    ];
    let replies = host.request(&ops);
    let Some(Reply::Error(refused)) = replies.last() else { panic!("{replies:?}") };
    assert_eq!(
        (refused.code, refused.waited),
        (Code::NOT_IN_TIME, Some(Waited { time_us: 2_000, value: 0b01 }))
    );
    assert!(refused.text.ends_with("at 2000 us 1 of 2 hold"), "{refused}");
}

#[test]
fn a_wait_has_1_to_32_conditions_and_each_can_hold() {
    let mut host = TestHost::new(true);
    let wait = Op::WaitFor { any: true, within_us: 0 };
    assert_eq!(host.refusal(wait).0, Code::CONDITIONS);
    let mut ops = vec![condition(REG, Compare::Equal, 0); MAX_CONDITIONS];
    let last = |host: &mut TestHost, ops: &[Op]| host.request(ops).pop().unwrap();
    let mut all = ops.clone();
    all.push(Op::WaitFor { any: false, within_us: 0 });
    assert_eq!(last(&mut host, &all), Reply::Waited(Waited { time_us: 0, value: u32::MAX }));
    ops.push(condition(REG, Compare::Equal, 0));
    assert!(matches!(last(&mut host, &ops), Reply::Error(refused) if refused.code == Code::CONDITIONS));
    let never = Test { mask: 1, compare: Compare::Equal, is_signed: false, value: 2 };
    let never = Op::Condition { plc: DeviceIndex(0), offset: REG, width: Width::Word, test: never };
    assert_eq!(host.refusal(never).0, Code::NEVER_MATCHES);
    assert_eq!(host.refusal(condition(0, Compare::Equal, 0)).0, Code::UNMAPPED);
}

/// Writes a register of PLC 0 by its name.
fn set(name: &str, value: u32) -> Op {
    let place = NamedLocation::parse(&DeviceFit::unknown(&DEVICE), name).unwrap();
    poke(place.offset(), place.width(), value)
}

/// Returns a host with a master that sends SYNC.
fn with_sync() -> TestHost {
    let mut host = TestHost::new(true);
    let status = |value| {
        let place = NamedLocation::parse(&DeviceFit::unknown(&DEVICE), "node2.w_OPTION_STATUS").unwrap();
        let (offset, width) = (place.offset(), place.width());
        Op::Wait { plc: DeviceIndex(0), offset, width, mask: 0xFFFF, value, within_us: 10_000 }
    };
    let bring_up = [
        set("node2.w_CPU_CONTROL", 1),
        status(2),
        set("node2.b_BT_1", 0x1C),
        set("node2.b_TIME_PATTERN", 2),
        set("node2.b_AC", 0xFF),
        set("node2.b_AM", 0xFF),
        set("node2.a_SL_TYP[1]", 1),
        set("node2.w_CPU_CONTROL", 2),
        status(3),
        set("node2.w_CPU_CONTROL", 0x20),
        status(0x43),
    ];
    let replies = host.request(&bring_up);
    assert!(matches!(replies.last(), Some(Reply::Waited(_))), "{replies:?}");
    host
}

#[test]
fn poke_step_and_peek_in_one_request() {
    let mut host = TestHost::new(true);
    host.script.push((2_000, REG, 0x44));
    let ops = [
        poke(REG, Width::Word, 5),
        peek(REG, Width::Word),
        Op::Advance { us: 2_000 },
        Op::Time,
        peek(REG, Width::Word),
    ];
    let time = Reply::Time(2_000);
    let expected = [Reply::Written, Reply::Value(5), time.clone(), time, Reply::Value(0x44)];
    assert_eq!(host.request(&ops), expected);
}

fn slave_busy(host: &TestHost, slave: u8) -> Fault {
    let (kinds, fields) = (devices::fault_kinds(), [format!("slave={slave}"), "count=2".to_owned()]);
    let spec = FaultSpec::from_words(kinds, "slave_busy", &fields).unwrap();
    spec.resolve(kinds, &host.plant.names()).unwrap()
}

#[test]
fn faults_are_added_listed_and_cleared_by_number() {
    let mut host = TestHost::new(true);
    let fault = slave_busy(&host, 1);
    let add = Op::FaultAdd { fault };
    let clear = |id| Op::FaultClear { id: NonZeroU16::new(id) };
    let status = |id| FaultStatus { id, fault, acting: true, hits: 0 };
    let ops = [add, add, Op::FaultList, clear(1), Op::FaultList, clear(0), clear(9)];
    let replies = host.request(&ops);
    let expected = [
        Reply::FaultAdded { id: 1 },
        Reply::FaultAdded { id: 2 },
        Reply::Faults(vec![status(1), status(2)]),
        Reply::FaultsCleared { count: 1 },
        Reply::Faults(vec![status(2)]),
        Reply::FaultsCleared { count: 1 },
    ];
    assert_eq!(replies[..6], expected);
    let (code, text) = host.refusal(clear(9));
    assert_eq!((code, text.as_str()), (Code::UNKNOWN_FAULT, "there is no fault 9; it may have ended"));
}

#[test]
fn a_refused_fault_names_its_target() {
    let mut host = TestHost::new(true);
    let fault = slave_busy(&host, 7);
    let (code, text) = host.refusal(Op::FaultAdd { fault });
    let expected = "slave_busy: bus \"drives\" has no slave 7; its slaves are: 1";
    assert_eq!((code, text.as_str()), (Code::FAULT, expected));
}

#[test]
fn every_width_reads_back_what_was_written() {
    let mut host = TestHost::new(true);
    for width in [Width::Byte, Width::Word, Width::Dword] {
        let value = 0x8182_8384 & width.max_value();
        let replies = host.request(&[poke(REG, width, value), peek(REG, width)]);
        assert_eq!(replies, [Reply::Written, Reply::Value(value)]);
    }
    let ops = [Op::ReadRange { plc: DeviceIndex(0), offset: REG, len: 5 }];
    assert_eq!(host.request(&ops), [Reply::Bytes(vec![0x84, 0x83, 0x82, 0x81, 0])]);
}

#[test]
fn plcs_have_separate_memories() {
    let other = Op::Peek { plc: DeviceIndex(1), offset: REG, width: Width::Word };
    let replies = TestHost::new(true).request(&[poke(REG, Width::Word, 5), other]);
    assert_eq!(replies, [Reply::Written, Reply::Value(0)]);
}

#[test]
fn compare_exchange_returns_the_previous_value() {
    let exchange = |current, new| Op::CompareExchange {
        plc: DeviceIndex(0),
        offset: REG,
        width: Width::Byte,
        current,
        new,
    };
    assert_eq!(
        TestHost::new(true).request(&[exchange(0, 5), exchange(0, 6), peek(REG, Width::Byte)]),
        [Reply::Exchanged { ok: true, found: 0 }, Reply::Exchanged { ok: false, found: 5 }, Reply::Value(5)]
    );
}

/// A forced register keeps its value, so an exchange for another value has not written it.
#[test]
fn an_exchange_does_not_claim_to_have_written_a_forced_register() {
    let (plc, width) = (DeviceIndex(0), Width::Word);
    let exchange = |offset, width, current, new| Op::CompareExchange { plc, offset, width, current, new };
    let replies = TestHost::new(true).request(&[
        Op::Force { plc, offset: REG, width, value: 0x0207 },
        exchange(REG, width, 0x0207, 5),
        exchange(REG, width, 0x0207, 0x0207),
        exchange(REG + 1, Width::Byte, 2, 3),
        exchange(REG, Width::Dword, 0x0207, 0x0001_0208),
        exchange(REG, Width::Dword, 0x0207, 0x0001_0207),
        peek(REG, Width::Dword),
        Op::Unforce { plc, offset: REG, width },
        exchange(REG, width, 0x0207, 5),
    ]);
    assert_eq!(
        replies,
        [
            Reply::Written,
            Reply::Exchanged { ok: false, found: 0x0207 },
            Reply::Exchanged { ok: true, found: 0x0207 },
            Reply::Exchanged { ok: false, found: 2 },
            Reply::Exchanged { ok: false, found: 0x0207 },
            Reply::Exchanged { ok: true, found: 0x0207 },
            Reply::Value(0x0001_0207),
            Reply::Written,
            Reply::Exchanged { ok: true, found: 0x0207 },
        ]
    );
}

#[test]
fn memory_errors_name_the_address_and_a_correct_one() {
    let mut host = TestHost::new(true);
    let mut refused = |op, code, text: &str| assert_eq!(host.refusal(op), (code, text.to_owned()));
    let nothing = "WORD at byte 998 of the image: no register area of the device covers this WORD";
    refused(peek(998, Width::Word), Code::UNMAPPED, nothing);
    refused(poke(998, Width::Word, 1), Code::UNMAPPED, nothing);
    let misaligned = "%MD3.1000102: a DWORD needs an address divisible by 4";
    refused(peek(REG + 2, Width::Dword), Code::MISALIGNED, misaligned);
    let wide = "press:%MW3.1000100: 16#10000 does not fit, a WORD holds at most 16#FFFF";
    refused(poke(REG, Width::Word, 0x1_0000), Code::VALUE_TOO_WIDE, wide);
    let plc = Op::Peek { plc: DeviceIndex(2), offset: REG, width: Width::Word };
    refused(plc, Code::UNKNOWN_PLC, "PLC 2 does not exist; the instance has 2, numbered from 0");
    let exchange =
        Op::CompareExchange { plc: DeviceIndex(0), offset: REG, width: Width::Byte, current: 256, new: 0 };
    let wide = "press:%MB3.1000100: 16#100 does not fit, a BYTE holds at most 16#FF";
    refused(exchange, Code::VALUE_TOO_WIDE, wide);
    let last = "byte 4294967295 of the image: no register area of the device covers this BYTE";
    refused(peek(u32::MAX, Width::Byte), Code::UNMAPPED, last);
}

#[test]
fn ranges_are_limited_and_name_the_hole() {
    let mut host = TestHost::new(true);
    let range = |offset, len| Op::ReadRange { plc: DeviceIndex(0), offset, len };
    let (code, text) = host.refusal(range(REG, MAX_RANGE + 1));
    assert_eq!(code, Code::RANGE_TOO_LONG);
    assert_eq!(text, "`len` of `read_range` is 65537; it may be 0 to 65536");
    let (code, text) = host.refusal(range(RAM.end - 4, 8));
    assert_eq!(code, Code::RANGE_UNMAPPED);
    assert!(text.contains("no register area covers %MB3.1262144"), "{text}");
    assert_eq!(host.refusal(range(u32::MAX, MAX_RANGE)).0, Code::RANGE_UNMAPPED);
    assert_eq!(host.request(&[range(REG, 0)]), [Reply::Bytes(vec![])]);
}

#[test]
fn forces_are_set_listed_and_ended() {
    let mut host = TestHost::new(true);
    let (plc, offset, width) = (0, REG, Width::Word);
    let unforce = Op::Unforce { plc: DeviceIndex(plc), offset, width };
    let ops = [Op::Force { plc: DeviceIndex(plc), offset, width, value: 7 }, Op::Forces, unforce, Op::Forces];
    let forced = Forced { plc: DeviceIndex(plc), offset, width, value: 7 };
    let expected = [Reply::Written, Reply::Forces(vec![forced]), Reply::Written, Reply::Forces(Vec::new())];
    assert_eq!(host.request(&ops), expected);
    assert_eq!(host.refusal(unforce), (Code::NOT_FORCED, "press:%MW3.1000100 is not forced".to_owned()));
    let half = Op::Force { plc: DeviceIndex(plc), offset: 200_000, width: Width::Byte, value: 7 };
    assert_eq!(host.refusal(half).0, Code::NOT_WHOLE);
    let wide = Op::Force { plc: DeviceIndex(plc), offset, width, value: 0x1_0000 };
    assert_eq!(host.refusal(wide).0, Code::VALUE_TOO_WIDE);
}

#[test]
fn a_stepped_wait_goes_from_event_to_event() {
    let mut host = TestHost::new(true);
    host.script.push((2_500, REG, 0x8043));
    let got = host.request(&[wait(0x8000, 0x8000, 10_000), peek(REG, Width::Word)]);
    assert_eq!(got, [Reply::Waited(Waited { time_us: 2_500, value: 0x8043 }), Reply::Value(0x8043)]);
    assert_eq!(host.steps, 2, "a look that leaves nothing to do, and what the script does");
}

#[test]
fn a_stepped_wait_that_fails_ends_exactly_on_time_with_the_last_value() {
    let mut host = TestHost::new(true);
    host.script.push((1_000, REG, 0x41));
    let refused = host.refused(wait(0xFFFF, 0x44, 2_300));
    assert_eq!(refused.code, Code::NOT_IN_TIME);
    assert_eq!(refused.waited, Some(Waited { time_us: 2_300, value: 0x41 }));
    let expected = "press:%MW3.1000100 did not become the awaited value in time; at 2300 us it is 16#0041";
    assert_eq!(refused.text, expected);
    assert_eq!(host.plant.now(), 2_300);
}

#[test]
fn a_wait_that_already_holds_takes_no_time() {
    let mut host = TestHost::new(true);
    assert_eq!(host.request(&[wait(0xFFFF, 0, 0)]), [Reply::Waited(Waited { time_us: 0, value: 0 })]);
    assert_eq!(host.steps, 0);
}

#[test]
fn a_wait_that_can_never_match_is_refused() {
    let mut host = TestHost::new(true);
    assert_eq!(host.refusal(wait(0x0F, 0x10, 1_000)).0, Code::NEVER_MATCHES);
    assert_eq!(host.refusal(wait(1, 1, MAX_ADVANCE_US + 1)).0, Code::ADVANCE_TOO_LONG);
}

#[test]
fn time_is_stepped_only_in_stepped_mode() {
    let mut host = TestHost::new(false);
    let steps = [
        Op::Advance { us: 0 },
        Op::AdvanceToSync { plc: DeviceIndex(0), node: PortNumber(1) },
        Op::AdvanceToEvent { within_us: 1 },
    ];
    for op in steps {
        assert_eq!(host.refusal(op).0, Code::CLOCK_IS_REAL_TIME);
    }
    assert_eq!(host.request(&[Op::Time]), [Reply::Time(0)]);
}

#[test]
fn only_a_real_time_clock_has_a_speed() {
    let speed = |permille| Op::SetSpeed { permille };
    assert_eq!(TestHost::new(true).refusal(speed(1_000)).0, Code::CLOCK_IS_STEPPED);
    let mut host = TestHost::new(false);
    assert_eq!(host.request(&[speed(0), speed(MAX_SPEED)]), [0, 0].map(Reply::Time));
    assert_eq!(host.refusal(speed(MAX_SPEED + 1)).0, Code::SPEED_TOO_HIGH);
}

#[test]
fn advance_to_event_ends_at_the_event_or_when_the_time_is_over() {
    let mut host = TestHost::new(true);
    host.script.push((1_300, REG, 0x44));
    let event = |within_us| Op::AdvanceToEvent { within_us };
    let got = host.request(&[
        event(5_000),
        event(100),
        event(5_000),
        peek(REG, Width::Word),
        event(MAX_ADVANCE_US),
    ]);
    assert_eq!(got[..3], [1_000, 1_100, 1_300].map(Reply::Time));
    assert_eq!(got[3..], [Reply::Value(0x44), Reply::Time(2_000)]);
    assert_eq!(host.refusal(event(MAX_ADVANCE_US + 1)).0, Code::ADVANCE_TOO_LONG);
}

#[test]
fn a_long_advance_listens_to_the_stop_flag() {
    let mut host = TestHost::new(true);
    host.stop_at = 1_000_000;
    assert_eq!(host.refusal(Op::Advance { us: 3_600_000_000 }).0, Code::SHUTTING_DOWN);
    // The operation checks the flag at the end of the present part. A part may be long here, because nothing happens in
    // this plant.
    assert!((1_000_000..100_000_000).contains(&host.plant.now()), "{}", host.plant.now());

    let mut host = TestHost::new(true);
    host.stop_at = 1_000_000;
    assert_eq!(host.refusal(wait(1, 1, 3_600_000_000)).0, Code::SHUTTING_DOWN);

    let too_long = TestHost::new(true).refusal(Op::Advance { us: MAX_ADVANCE_US + 1 });
    assert_eq!(too_long.0, Code::ADVANCE_TOO_LONG);
}

#[test]
fn advance_to_sync_ends_on_the_edge() {
    let mut host = with_sync();
    let sync = Op::AdvanceToSync { plc: DeviceIndex(0), node: PortNumber(2) };
    let edges = host.request(&[sync; 3]);
    let times: Vec<_> = edges.into_iter().map(|edge| edge.time().unwrap()).collect();
    assert_eq!((times[1] - times[0], times[2] - times[1]), (2_000, 2_000));
    let (code, text) = host.refusal(Op::AdvanceToSync { plc: DeviceIndex(1), node: PortNumber(2) });
    assert_eq!(code, Code::NO_SYNC);
    assert_eq!(
        text,
        "PLC 'saw': there is no SYNC signal at node2; saw:node2 has not started: w_OPTION_STATUS is 16#0001; initialize it first"
    );
}

#[test]
fn a_real_time_wait_counts_from_its_first_try() {
    let mut host = TestHost::new(false);
    host.run_to(1_000);
    let mut execution = Execution::default();
    let op = wait(1, 1, 5_000);
    assert_eq!(execution.run(&mut host, &op), Ok(None));
    host.run_to(5_999);
    assert_eq!(execution.run(&mut host, &op), Ok(None));
    host.run_to(6_000);
    let refused = execution.run(&mut host, &op).unwrap_err();
    assert_eq!(refused.waited, Some(Waited { time_us: 6_000, value: 0 }));
}

#[test]
fn info_and_stop() {
    let mut host = TestHost::new(true);
    let info = host.info();
    assert_eq!(host.request(&[Op::Info, Op::Stop]), [Reply::Info(Box::new(info)), Reply::Stopping]);
    assert_eq!(host.refusal(Op::Advance { us: 1_000 }).0, Code::SHUTTING_DOWN);
}

#[test]
fn the_journal_is_read_in_parts() {
    let mut host = TestHost::new(true);
    let before = host.plant.journal().end();
    for value in 0..3_000 {
        host.request(&[poke(REG, Width::Word, value)]);
    }
    let end = before + 3_000;
    let mut read = |from, max| {
        let (records, found_end) = host.request(&[Op::Journal { from, max }]).remove(0).journal().unwrap();
        assert_eq!(found_end, end);
        records.iter().map(|record| record.seq).collect::<Vec<_>>()
    };
    assert_eq!(read(5, 2), [5, 6]);
    assert_eq!(read(end - 1, 2), [end - 1]);
    assert!(read(end, 2).is_empty());
    assert!(read(u64::MAX, u32::MAX).is_empty());
    assert_eq!(read(0, u32::MAX).len(), 1_024, "no more than the limit");
}

#[test]
fn pending_records_follow_the_end_of_the_journal() {
    let mut host = with_sync();
    host.request(&[Op::Advance { us: 20_000 }]);
    let pending: Vec<_> =
        host.plant.journal().pending().into_iter().map(|record| record.judged_at(20_000)).collect();
    assert!(pending.iter().any(crate::journal::Record::may_continue));
    let end = host.plant.journal().end();
    let mut read = |from, max| host.request(&[Op::Journal { from, max }]).remove(0).journal().unwrap().0;
    let part = read(end - 2, 1);
    assert!(matches!(&part[..], [record] if record.seq == end - 2), "{part:?}");
    assert_eq!(read(end - 1, 9)[1..], pending);
}

#[test]
fn findings_are_returned_and_cleared() {
    let mut host = TestHost::new(true);
    host.request(&[set("node2.w_OPTION_STATUS", 3), set("node1.w_OPTION_STATUS", 3)]);
    let noted: Vec<_> = host.plant.journal().findings().iter().cloned().collect();
    assert!(!noted.is_empty());
    let got = host.request(&[Op::Findings, Op::ClearFindings, Op::Findings]);
    assert_eq!(got, [Reply::Findings(noted), Reply::Cleared, Reply::Findings(Vec::new())]);
}

#[test]
fn a_start_without_a_program_is_refused_by_name() {
    use crate::memory::header::{BoardSetting, Start};
    let setting = BoardSetting::Start(Start::Cold);
    let mut host = TestHost::new(true);
    let (code, text) = host.refusal(Op::SetBoard { plc: DeviceIndex(1), setting });
    assert_eq!(code, Code::START_REFUSED);
    assert!(text.starts_with("PLC 'saw': a start or stop needs a loaded program"), "{text}");
}

#[test]
fn a_missing_switch_is_refused_by_name() {
    use crate::memory::header::BoardSetting;
    let mut host = TestHost::new(true);
    let setting = BoardSetting::ModuleDip { port: PortNumber(2), dip: 7 };
    let (code, text) = host.refusal(Op::SetBoard { plc: DeviceIndex(1), setting });
    assert_eq!(code, Code::NO_SUCH_SWITCH);
    assert_eq!(text, "PLC 'saw': there is no module with DIP switches in node2");
}

/// If an operation pauses, its answer, the records of the journal, and the moments up to which the plant advances in
/// one part stay the same.
#[test]
fn an_operation_that_pauses_does_the_same() {
    let ops = [
        Op::Advance { us: 250_000 },
        wait(0xFFFF, 0x44, 1_000_000),
        wait(0xFFFF, 0x45, 130_000),
        Op::AdvanceToSync { plc: DeviceIndex(0), node: PortNumber(2) },
        Op::AdvanceToEvent { within_us: 5_000 },
        Op::Advance { us: 99_999 },
        Op::Time,
    ];
    let outcome = |pauses: bool, turn_left: usize| {
        let mut host = with_sync();
        host.script.push((400_000, REG, 0x44));
        (host.pauses, host.turn_left) = (pauses, turn_left);
        let (parts, mut pauses) = (host.steps, 0);
        let mut run = |op: &Op| {
            let mut execution = Execution::default();
            loop {
                match execution.run(&mut host, op) {
                    Ok(None) => assert!(execution.is_under_way(), "{op:?}"),
                    Ok(Some(reply)) => return Ok(reply),
                    Err(refused) => return Err(refused),
                }
                pauses += 1;
            }
        };
        let replies: Vec<_> = ops.iter().map(&mut run).collect();
        let records: Vec<_> = host.plant.journal().records().collect();
        ((replies, records, host.steps - parts), pauses)
    };
    let (whole, pauses) = outcome(false, 0);
    assert_eq!(pauses, 0);
    assert!(matches!(whole.0[..], [Ok(_), Ok(_), Err(_), Ok(_), Ok(_), Ok(_), Ok(_)]), "{:?}", whole.0);
    assert!(whole.1.len() > 100, "{}", whole.1.len());
    for (pause, turn_left) in [(true, 0), (false, 7), (true, 7)] {
        let (sliced, pauses) = outcome(pause, turn_left);
        assert!(pauses > 5, "{pauses}");
        assert!(sliced == whole, "in slices it is different: {:?}", sliced.0);
    }
}

/// A journal that continues from a snapshot has no records of the states before the snapshot, but its readers know the
/// phases.
#[test]
fn a_snapshot_keeps_the_names_of_overlaid_registers() {
    let mut whole = with_sync();
    let snapshot = whole.plant.snapshot();
    let begin = whole.plant.journal().end();
    let mut restored = TestHost::new(true);
    restored.plant.restore(&snapshot).unwrap();
    let lines = |host: &mut TestHost, from| {
        // Node 1 is not initialized, node 2 is.
        let ops = [set("node2.a_SL_TYP[1]", 4), set("node1.a_SL_TYP[1]", 5), Op::Advance { us: 5_000 }];
        host.request(&ops);
        let names = host.info().names;
        let reply = host.request(&[Op::Journal { from, max: u32::MAX }]).remove(0);
        let json = serde_json::to_value(reply.json(&names)).unwrap();
        let records = json["journal"]["records"].as_array().unwrap().clone();
        let is_later = |line: &serde_json::Value| line["seq"].as_u64().is_none_or(|seq| seq >= begin);
        records.into_iter().filter(is_later).collect::<Vec<_>>()
    };
    let (expected, found) = (lines(&mut whole, 0), lines(&mut restored, begin));
    assert_eq!(found, expected);
    assert!(expected.iter().any(|line| line["register"] == "node1.a_SL_TYP[1]"), "{expected:?}");
    // A reader may begin with a part in the middle of the journal, also after a return.
    let part = |host: &mut TestHost| {
        let json = host.request(&[Op::Journal { from: begin, max: u32::MAX }]).remove(0);
        serde_json::to_value(json.json(&host.info().names)).unwrap()["journal"]["records"].clone()
    };
    assert_eq!(part(&mut whole), part(&mut restored));
    for host in [&mut whole, &mut restored] {
        host.plant.restore(&snapshot).unwrap();
    }
    assert_eq!(lines(&mut whole, begin), expected);
    assert_eq!(lines(&mut restored, begin), expected);
}
