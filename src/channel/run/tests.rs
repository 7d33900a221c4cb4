use super::*;
use crate::channel::wire;
use crate::identity::DeviceIndex;
use crate::memory::Width;
use crate::request::testing::{RAM, TestHost};
use crate::request::{MAX_RANGE, Reply, Waited};

const REG: u32 = RAM.start;

fn peek(offset: u32) -> Op {
    Op::Peek { plc: DeviceIndex(0), offset, width: Width::Word }
}

fn poke(offset: u32, value: u32) -> Op {
    Op::Poke { plc: DeviceIndex(0), offset, width: Width::Word, value }
}

fn wait(mask: u32, value: u32, within_us: u64) -> Op {
    Op::Wait { plc: DeviceIndex(0), offset: REG, width: Width::Word, mask, value, within_us }
}

fn wires(ops: &[Op]) -> Vec<WireOp> {
    ops.iter().map(WireOp::from).collect()
}

fn replies(run: &Run) -> Vec<Reply> {
    let mut replies = Vec::new();
    wire::decode(run.replies.blocks(), &mut replies).unwrap();
    replies
}

fn all(host: &mut TestHost, ops: &[WireOp]) -> Vec<Reply> {
    let mut run = Run::default();
    assert_eq!(run.go(host, ops, &mut || true), Progress::Done);
    replies(&run)
}

/// Returns the code and the text of the last reply.
fn refusal(replies: &[Reply]) -> (Code, &str) {
    match replies.last() {
        Some(Reply::Error(refused)) => (refused.code, &refused.text),
        other => panic!("no refusal: {other:?}"),
    }
}

#[test]
fn execution_stops_at_the_first_error() {
    let mut host = TestHost::new(true);
    let got = all(&mut host, &wires(&[poke(REG, 1), poke(REG + 1, 2), poke(REG, 3)]));
    assert_eq!(got[0], Reply::Written);
    assert_eq!(refusal(&got), (Code::MISALIGNED, "%MW3.1000001: a WORD needs an even address"));
    assert_eq!(all(&mut host, &wires(&[peek(REG)])), [Reply::Value(1)]);
}

#[test]
fn a_malformed_operation_is_named_and_ends_the_request() {
    let mut host = TestHost::new(true);
    let mut ops = wires(&[poke(REG, 1), peek(REG)]);
    ops[1].kind = 99;
    let got = all(&mut host, &ops);
    assert_eq!(got[0], Reply::Written);
    let expected = "operation 1 of the request is malformed (the kind is 16#63); do client and emulator have the \
                    same version?";
    assert_eq!(refusal(&got), (Code::MALFORMED, expected));
    let fault = WireOp { kind: 20, plc: 99, ..WireOp::default() };
    let got = all(&mut host, &[fault]);
    assert!(refusal(&got).1.contains("(the fault is 16#63)"), "{got:?}");
}

#[test]
fn too_many_operations_execute_nothing() {
    let mut host = TestHost::new(true);
    let ops = wires(&vec![poke(REG, 1); MAX_OPS + 1]);
    let got = all(&mut host, &ops);
    let expected = "257 operations in one request are too many, at most 256";
    assert_eq!((got.len(), refusal(&got)), (1, (Code::TOO_MANY_OPERATIONS, expected)));
    assert_eq!(all(&mut host, &wires(&[peek(REG)])), [Reply::Value(0)]);
    assert_eq!(all(&mut host, &ops[1..]).len(), MAX_OPS);
    assert_eq!(all(&mut host, &[]), []);
}

#[test]
fn replies_that_are_too_long_together_are_refused() {
    let mut host = TestHost::new(true);
    let ranges = [Op::ReadRange { plc: DeviceIndex(0), offset: REG, len: MAX_RANGE }; 5];
    let got = all(&mut host, &wires(&ranges));
    assert_eq!((got.len(), refusal(&got).0), (5, Code::REPLY_TOO_LONG));
    for value in 0..2_000 {
        all(&mut host, &wires(&[poke(REG, value)]));
    }
    let got = all(&mut host, &wires(&[Op::Journal { from: 0, max: 1_024 }; 64]));
    assert_eq!(refusal(&got).0, Code::REPLY_TOO_LONG);
    assert!(got.len() > 4, "four of them do fit");
}

/// If there are earlier requests to the boards, the run handles them once, before the first operation of its
/// own request.
#[test]
fn a_request_begins_once() {
    let mut host = TestHost::new(false);
    let ops = wires(&[wait(0xFFFF, 0x44, 5_000), peek(REG)]);
    let mut run = Run::default();
    assert_eq!(run.go(&mut host, &ops, &mut || true), Progress::Waiting);
    assert_eq!(run.go(&mut host, &ops, &mut || true), Progress::Waiting);
    assert_eq!(host.requests, 1);
}

#[test]
fn a_real_time_wait_is_resumed_where_it_stopped() {
    let mut host = TestHost::new(false);
    let ops = wires(&[poke(REG + 2, 7), wait(0xFFFF, 0x44, 5_000), peek(REG + 2)]);
    let mut run = Run::default();
    assert_eq!(run.go(&mut host, &ops, &mut || true), Progress::Waiting);
    host.run_to(3_000);
    host.store(REG + 2, 8);
    assert_eq!(run.go(&mut host, &ops, &mut || true), Progress::Waiting);
    host.store(REG, 0x44);
    host.run_to(5_000);
    assert_eq!(run.go(&mut host, &ops, &mut || true), Progress::Done);
    // The poke was not repeated.
    let waited = Reply::Waited(Waited { time_us: 5_000, value: 0x44 });
    assert_eq!(replies(&run), [Reply::Written, waited, Reply::Value(8)]);
}

#[test]
fn a_second_wait_has_a_separate_deadline() {
    let mut host = TestHost::new(false);
    let ops = wires(&[wait(1, 1, 5_000), wait(2, 2, 5_000)]);
    let mut run = Run::default();
    assert_eq!(run.go(&mut host, &ops, &mut || true), Progress::Waiting);
    host.run_to(4_000);
    host.store(REG, 1);
    assert_eq!(run.go(&mut host, &ops, &mut || true), Progress::Waiting);
    host.run_to(8_000);
    assert_eq!(run.go(&mut host, &ops, &mut || true), Progress::Waiting);
    host.store(REG, 2);
    assert_eq!(run.go(&mut host, &ops, &mut || true), Progress::Done);
    assert_eq!(replies(&run)[1], Reply::Waited(Waited { time_us: 8_000, value: 2 }));
}
