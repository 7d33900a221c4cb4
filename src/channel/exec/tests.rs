use super::*;
use crate::channel::Reply;
use crate::channel::error::Field;
use crate::channel::testing::{Fake, MAPPED};
use crate::channel::wire;
use crate::fault::{Effect, Fault, FaultStatus, Limit, Refusal, SlaveEffect};
use core::num::NonZeroU16;

const REG: u32 = 100_000;

fn peek(offset: u32, width: Width) -> Op {
    Op::Peek { plc: 0, offset, width }
}

fn poke(offset: u32, width: Width, value: u32) -> Op {
    Op::Poke { plc: 0, offset, width, value }
}

fn wait(mask: u32, value: u32, within_us: u64) -> Op {
    Op::Wait { plc: 0, offset: REG, width: Width::Word, mask, value, within_us }
}

fn replies(run: &Run) -> Vec<Reply> {
    let mut replies = Vec::new();
    wire::decode(run.replies.blocks(), &mut replies).unwrap();
    replies
}

fn wires(ops: &[Op]) -> Vec<WireOp> {
    ops.iter().map(WireOp::from).collect()
}

fn all(machine: &mut Fake, ops: &[Op]) -> Vec<Reply> {
    let mut run = Run::default();
    assert_eq!(run.go(machine, &wires(ops)), Progress::Done);
    replies(&run)
}

#[track_caller]
fn refused(machine: &mut Fake, op: Op) -> ChannelError {
    match all(machine, &[op]).as_slice() {
        [Reply::Error(error)] => *error,
        other => panic!("{op:?} should be refused, got {other:?}"),
    }
}

#[test]
fn poke_step_and_peek_in_one_request() {
    let mut fake = Fake::new(true);
    fake.script.push((2_000, REG, 0x44));
    let ops = [
        poke(REG, Width::Word, 5),
        peek(REG, Width::Word),
        Op::Advance { us: 2_000 },
        peek(REG, Width::Word),
    ];
    let expected = [Reply::Written, Reply::Value(5), Reply::Advanced { time_us: 2_000 }, Reply::Value(0x44)];
    assert_eq!(all(&mut fake, &ops), expected);
}

#[test]
fn faults_are_added_listed_and_cleared_by_number() {
    let mut fake = Fake::new(true);
    let effect = Effect::Slave { bus: 0, slave: 3, what: SlaveEffect::Busy };
    let fault = Fault { effect, at_us: 7, limit: Limit::Count(2) };
    let add = Op::FaultAdd { fault };
    let clear = |id| Op::FaultClear { id: NonZeroU16::new(id) };
    let status = |id| FaultStatus { id, fault, acting: true, hits: 0 };
    let ops = [add, add, Op::FaultList, clear(1), Op::FaultList, clear(0), clear(9)];
    let expected = [
        Reply::FaultAdded { id: 1 },
        Reply::FaultAdded { id: 2 },
        Reply::Faults(vec![status(1), status(2)]),
        Reply::FaultsCleared { count: 1 },
        Reply::Faults(vec![status(2)]),
        Reply::FaultsCleared { count: 1 },
        Reply::Error(ChannelError::Fault(Refusal::UnknownFault { id: 9 })),
    ];
    assert_eq!(all(&mut fake, &ops), expected);
}

#[test]
fn a_fault_that_no_version_knows_is_malformed() {
    let mut fake = Fake::new(true);
    let wire = WireOp { kind: wire::kind::FAULT_ADD, width: 99, ..WireOp::default() };
    let mut run = Run::default();
    run.go(&mut fake, &[wire]);
    let expected = ChannelError::Malformed { index: 0, field: Field::Fault, value: 99 };
    assert_eq!(replies(&run), [Reply::Error(expected)]);
}

#[test]
fn every_width_reads_back_what_was_written() {
    let mut fake = Fake::new(true);
    for width in [Width::Byte, Width::Word, Width::Dword] {
        let value = 0x8182_8384 & width.max_value();
        assert_eq!(
            all(&mut fake, &[poke(REG, width, value), peek(REG, width)]),
            [Reply::Written, Reply::Value(value)]
        );
    }
    let ops = [Op::ReadRange { plc: 0, offset: REG, len: 5 }];
    assert_eq!(all(&mut fake, &ops), [Reply::Bytes(vec![0x84, 0x83, 0x82, 0x81, 0])]);
}

#[test]
fn plcs_have_memories_of_their_own() {
    let mut fake = Fake::new(true);
    let other = Op::Peek { plc: 1, offset: REG, width: Width::Word };
    assert_eq!(all(&mut fake, &[poke(REG, Width::Word, 5), other]), [Reply::Written, Reply::Value(0)]);
}

#[test]
fn compare_exchange_tells_what_it_found() {
    let mut fake = Fake::new(true);
    let exchange =
        |current, new| Op::CompareExchange { plc: 0, offset: REG, width: Width::Byte, current, new };
    assert_eq!(
        all(&mut fake, &[exchange(0, 5), exchange(0, 6), peek(REG, Width::Byte)]),
        [Reply::Exchanged { ok: true, found: 0 }, Reply::Exchanged { ok: false, found: 5 }, Reply::Value(5)]
    );
}

#[test]
fn execution_stops_at_the_first_error() {
    let mut fake = Fake::new(true);
    let ops = [poke(REG, Width::Word, 1), poke(REG + 1, Width::Word, 2), poke(REG, Width::Word, 3)];
    let misaligned = ChannelError::Misaligned { address: Width::Word.at(REG + 1) };
    assert_eq!(all(&mut fake, &ops), [Reply::Written, Reply::Error(misaligned)]);
    assert_eq!(all(&mut fake, &[peek(REG, Width::Word)]), [Reply::Value(1)]);
}

#[test]
fn memory_errors_name_the_address() {
    use ChannelError as E;
    let mut fake = Fake::new(true);
    let word = Width::Word.at(REG);
    assert_eq!(refused(&mut fake, peek(998, Width::Word)), E::Unmapped { address: Width::Word.at(998) });
    assert_eq!(refused(&mut fake, poke(998, Width::Word, 1)), E::Unmapped { address: Width::Word.at(998) });
    assert_eq!(
        refused(&mut fake, peek(REG + 2, Width::Dword)),
        E::Misaligned { address: Width::Dword.at(REG + 2) }
    );
    assert_eq!(
        refused(&mut fake, poke(REG, Width::Word, 0x1_0000)),
        E::ValueTooWide { address: word, value: 0x1_0000 }
    );
    let plc = Op::Peek { plc: 2, offset: REG, width: Width::Word };
    assert_eq!(refused(&mut fake, plc), E::UnknownPlc { plc: 2, count: 2 });
    let exchange = Op::CompareExchange { plc: 0, offset: REG, width: Width::Byte, current: 256, new: 0 };
    assert_eq!(refused(&mut fake, exchange), E::ValueTooWide { address: Width::Byte.at(REG), value: 256 });
    let last = peek(u32::MAX, Width::Byte);
    assert_eq!(refused(&mut fake, last), E::Unmapped { address: Width::Byte.at(u32::MAX) });
}

#[test]
fn ranges_are_limited_and_name_the_hole() {
    let mut fake = Fake::new(true);
    let range = |offset, len| Op::ReadRange { plc: 0, offset, len };
    assert_eq!(
        refused(&mut fake, range(REG, MAX_RANGE + 1)),
        ChannelError::RangeTooLong { offset: REG, len: MAX_RANGE + 1 }
    );
    assert_eq!(
        refused(&mut fake, range(MAPPED.end - 4, 8)),
        ChannelError::RangeUnmapped { offset: MAPPED.end - 4, len: 8, hole: MAPPED.end }
    );
    assert_eq!(
        refused(&mut fake, range(u32::MAX, MAX_RANGE)),
        ChannelError::RangeUnmapped { offset: u32::MAX, len: MAX_RANGE, hole: u32::MAX }
    );
    let many = [range(REG, MAX_RANGE); 5];
    let got = all(&mut fake, &many);
    assert_eq!(got.last(), Some(&Reply::Error(ChannelError::ReplyTooLong)));
    assert_eq!(all(&mut fake, &[range(REG, 0)]), [Reply::Bytes(vec![])]);
}

#[test]
fn a_malformed_operation_is_named_and_ends_the_request() {
    let mut fake = Fake::new(true);
    let mut ops = wires(&[poke(REG, Width::Word, 1), peek(REG, Width::Word)]);
    ops[1].kind = 99;
    let mut run = Run::default();
    assert_eq!(run.go(&mut fake, &ops), Progress::Done);
    let error = ChannelError::Malformed { index: 1, field: Field::Kind, value: 99 };
    assert_eq!(replies(&run), [Reply::Written, Reply::Error(error)]);
}

#[test]
fn too_many_operations_execute_nothing() {
    let mut fake = Fake::new(true);
    let ops = vec![poke(REG, Width::Word, 1); MAX_OPS + 1];
    let count = MAX_OPS as u32 + 1;
    assert_eq!(all(&mut fake, &ops), [Reply::Error(ChannelError::TooManyOperations { count })]);
    assert_eq!(all(&mut fake, &[peek(REG, Width::Word)]), [Reply::Value(0)]);
    assert_eq!(all(&mut fake, &vec![poke(REG, Width::Word, 1); MAX_OPS]).len(), MAX_OPS);
    assert_eq!(all(&mut fake, &[]), []);
}

#[test]
fn a_stepped_wait_goes_from_event_to_event() {
    let mut fake = Fake::new(true);
    fake.script.push((2_500, REG, 0x8043));
    let got = all(&mut fake, &[wait(0x8000, 0x8000, 10_000), peek(REG, Width::Word)]);
    assert_eq!(got, [Reply::Waited { time_us: 2_500, value: 0x8043 }, Reply::Value(0x8043)]);
    assert_eq!(fake.steps, 3);
}

#[test]
fn a_stepped_wait_that_fails_ends_exactly_on_time_with_the_last_value() {
    let mut fake = Fake::new(true);
    fake.script.push((1_000, REG, 0x41));
    let error = refused(&mut fake, wait(0xFFFF, 0x44, 2_300));
    let expected = ChannelError::WaitTimedOut { address: Width::Word.at(REG), last: 0x41, time_us: 2_300 };
    assert_eq!(error, expected);
    assert_eq!(fake.now(), 2_300);
}

#[test]
fn a_wait_that_already_holds_takes_no_time() {
    let mut fake = Fake::new(true);
    assert_eq!(all(&mut fake, &[wait(0xFFFF, 0, 0)]), [Reply::Waited { time_us: 0, value: 0 }]);
    assert_eq!(fake.steps, 0);
}

#[test]
fn a_wait_that_can_never_match_is_refused() {
    let mut fake = Fake::new(true);
    let address = Width::Word.at(REG);
    let expected = ChannelError::NeverMatches { address, mask: 0x0F, value: 0x10 };
    assert_eq!(refused(&mut fake, wait(0x0F, 0x10, 1_000)), expected);
    let expected = ChannelError::AdvanceTooLong { us: MAX_ADVANCE_US + 1 };
    assert_eq!(refused(&mut fake, wait(1, 1, MAX_ADVANCE_US + 1)), expected);
}

#[test]
fn time_is_stepped_only_in_stepped_mode() {
    let mut fake = Fake::new(false);
    assert_eq!(refused(&mut fake, Op::Advance { us: 0 }), ChannelError::ClockIsRealTime);
    assert_eq!(refused(&mut fake, Op::AdvanceToSync { plc: 0, node: 1 }), ChannelError::ClockIsRealTime);
    assert_eq!(refused(&mut fake, Op::AdvanceToEvent { within_us: 1 }), ChannelError::ClockIsRealTime);
}

#[test]
fn advance_to_event_ends_at_the_event_or_when_the_time_is_over() {
    let mut fake = Fake::new(true);
    fake.script.push((1_300, REG, 0x44));
    let event = |within_us| Op::AdvanceToEvent { within_us };
    let got = all(
        &mut fake,
        &[event(5_000), event(100), event(5_000), peek(REG, Width::Word), event(MAX_ADVANCE_US)],
    );
    let times = [1_000, 1_100, 1_300].map(|time_us| Reply::Advanced { time_us });
    assert_eq!(got[..3], times);
    assert_eq!(got[3..], [Reply::Value(0x44), Reply::Advanced { time_us: 2_000 }]);
    let error = ChannelError::AdvanceTooLong { us: MAX_ADVANCE_US + 1 };
    assert_eq!(refused(&mut fake, event(MAX_ADVANCE_US + 1)), error);
}

/// What was asked of the boards comes before the request, once.
#[test]
fn a_request_begins_once() {
    let mut fake = Fake::new(false);
    let ops = wires(&[wait(0xFFFF, 0x44, 5_000), peek(REG, Width::Word)]);
    let mut run = Run::default();
    assert_eq!(run.go(&mut fake, &ops), Progress::Waiting);
    assert_eq!(run.go(&mut fake, &ops), Progress::Waiting);
    assert_eq!(fake.requests, 1);
}

#[test]
fn a_long_advance_listens_to_the_stop_flag() {
    let mut fake = Fake::new(true);
    fake.stop_at = 1_000_000;
    assert_eq!(refused(&mut fake, Op::Advance { us: 3_600_000_000 }), ChannelError::ShuttingDown);
    assert_eq!(fake.now(), 1_000_000);

    let mut fake = Fake::new(true);
    fake.stop_at = 1_000_000;
    assert_eq!(refused(&mut fake, wait(1, 1, 3_600_000_000)), ChannelError::ShuttingDown);

    let error = ChannelError::AdvanceTooLong { us: MAX_ADVANCE_US + 1 };
    assert_eq!(refused(&mut Fake::new(true), Op::Advance { us: MAX_ADVANCE_US + 1 }), error);
}

#[test]
fn advance_to_sync_ends_on_the_edge() {
    let mut fake = Fake::new(true);
    let sync = Op::AdvanceToSync { plc: 0, node: 1 };
    let got = all(&mut fake, &[Op::Advance { us: 500 }, sync, sync]);
    let times = [500, 2_000, 4_000].map(|time_us| Reply::Advanced { time_us });
    assert_eq!(got, times);
    let error = ChannelError::NoSync { plc: 0, node: 2 };
    assert_eq!(refused(&mut fake, Op::AdvanceToSync { plc: 0, node: 2 }), error);
}

#[test]
fn a_real_time_wait_is_resumed_where_it_stopped() {
    let mut fake = Fake::new(false);
    let ops = wires(&[poke(REG + 2, Width::Word, 7), wait(0xFFFF, 0x44, 5_000), peek(REG + 2, Width::Word)]);
    let mut run = Run::default();
    assert_eq!(run.go(&mut fake, &ops), Progress::Waiting);
    fake.run_to(3_000);
    fake.store(0, REG + 2, Width::Word, 8).unwrap();
    assert_eq!(run.go(&mut fake, &ops), Progress::Waiting);
    fake.store(0, REG, Width::Word, 0x44).unwrap();
    fake.run_to(5_000);
    assert_eq!(run.go(&mut fake, &ops), Progress::Done);
    // The poke was not made again.
    let expected = [Reply::Written, Reply::Waited { time_us: 5_000, value: 0x44 }, Reply::Value(8)];
    assert_eq!(replies(&run), expected);
}

#[test]
fn a_real_time_wait_counts_from_its_first_try() {
    let mut fake = Fake::new(false);
    fake.run_to(1_000);
    let ops = wires(&[wait(1, 1, 5_000), wait(1, 1, 5_000)]);
    let mut run = Run::default();
    assert_eq!(run.go(&mut fake, &ops), Progress::Waiting);
    fake.run_to(5_999);
    assert_eq!(run.go(&mut fake, &ops), Progress::Waiting);
    fake.run_to(6_000);
    assert_eq!(run.go(&mut fake, &ops), Progress::Done);
    let error = ChannelError::WaitTimedOut { address: Width::Word.at(REG), last: 0, time_us: 6_000 };
    assert_eq!(replies(&run), [Reply::Error(error)]);
}

#[test]
fn a_second_wait_has_a_deadline_of_its_own() {
    let mut fake = Fake::new(false);
    let ops = wires(&[wait(1, 1, 5_000), wait(2, 2, 5_000)]);
    let mut run = Run::default();
    assert_eq!(run.go(&mut fake, &ops), Progress::Waiting);
    fake.run_to(4_000);
    fake.store(0, REG, Width::Word, 1).unwrap();
    assert_eq!(run.go(&mut fake, &ops), Progress::Waiting);
    fake.run_to(8_000);
    assert_eq!(run.go(&mut fake, &ops), Progress::Waiting);
    fake.store(0, REG, Width::Word, 2).unwrap();
    assert_eq!(run.go(&mut fake, &ops), Progress::Done);
    assert_eq!(replies(&run)[1], Reply::Waited { time_us: 8_000, value: 2 });
}

#[test]
fn info_and_stop() {
    let mut fake = Fake::new(true);
    let got = all(&mut fake, &[Op::Info, Op::Stop, Op::Advance { us: 1_000 }]);
    let information = Fake::new(true).info();
    let expected =
        [Reply::Info(Box::new(information)), Reply::Stopping, Reply::Error(ChannelError::ShuttingDown)];
    assert_eq!(got, expected);
}

fn journal_records(reply: &Reply) -> (Vec<u64>, u64) {
    match reply {
        Reply::Journal { records, end } => (records.iter().map(|record| record.seq).collect(), *end),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_journal_is_read_in_parts() {
    use crate::journal::{Event, Origin, Record};
    let mut fake = Fake::new(true);
    let origin = Origin { plc: 0, node: 2 };
    for time in 0..3_000 {
        fake.journal.push(time, Event::State { origin, from: 1, to: 2 });
    }
    let read = |fake: &mut Fake, from, max| journal_records(&all(fake, &[Op::Journal { from, max }])[0]);
    assert_eq!(read(&mut fake, 5, 2), (vec![5, 6], 3_000));
    assert_eq!(read(&mut fake, 2_999, 2), (vec![2_999], 3_000));
    assert_eq!(read(&mut fake, 3_000, 2), (vec![], 3_000));
    assert_eq!(read(&mut fake, u64::MAX, u32::MAX), (vec![], 3_000));
    assert_eq!(read(&mut fake, 0, u32::MAX).0.len(), 1_024, "no more than the limit");

    for time in [4_000, 6_000, 8_000] {
        fake.journal.push(time, Event::SyncEdge { bus: 0 });
    }
    assert_eq!(read(&mut fake, 3_000, 1), (vec![3_000], 3_002));
    assert_eq!(read(&mut fake, 3_001, 9), (vec![3_001, Record::PENDING], 3_002));
}

#[test]
fn parts_of_the_journal_that_do_not_fit_together_are_refused() {
    use crate::journal::{Event, Origin};
    let mut fake = Fake::new(true);
    for time in 0..3_000 {
        fake.journal.push(time, Event::InitRefused { origin: Origin { plc: 0, node: 2 }, reason: 1 });
    }
    let got = all(&mut fake, &[Op::Journal { from: 0, max: 1_024 }; 8]);
    assert_eq!(got.last(), Some(&Reply::Error(ChannelError::ReplyTooLong)));
    assert!(got.len() > 4, "four of them do fit");
}

#[test]
fn findings_are_told_and_cleared() {
    use crate::check::{Finding, MAX_ENTRIES, Rule};
    use crate::journal::Event;
    use crate::layout::Live;
    let mut fake = Fake::new(true);
    for offset in 0..2 * MAX_ENTRIES as u32 {
        let finding = Finding { rule: Rule::Owner, plc: 0, offset, live: Live::Cyclic, value: 7, late_us: 0 };
        fake.journal.push(u64::from(offset), Event::Finding(finding));
    }
    let noted: Vec<_> = fake.journal.findings().iter().copied().collect();
    assert_eq!(noted.len(), MAX_ENTRIES + 1);
    let got = all(&mut fake, &[Op::Findings, Op::ClearFindings, Op::Findings]);
    assert_eq!(got, [Reply::Findings(noted), Reply::Cleared, Reply::Findings(Vec::new())]);
}
