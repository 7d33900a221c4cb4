//! Peers that use iceoryx2 but break the protocol.

use super::rig::{Emulator, InstanceFiles};
use crate::channel::domain::{Domain, Ipc};
use crate::channel::wire::{self, Block, DecodeError, WireOp};
use crate::channel::{Bells, ClientError};
use crate::identity::DeviceIndex;
use crate::memory::Width;
use crate::request::testing::RAM;
use crate::request::{Code, MAX_OPS, Op, Reply};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use zerocopy::FromBytes;

const REG: u32 = RAM.start;

/// Sends raw operations; returns no replies if `wait` is false.
fn send_raw(place: &InstanceFiles, requests: &[Vec<WireOp>], wait: bool) -> Vec<Vec<Reply>> {
    let node = place.domain().node::<Ipc>().unwrap();
    let service = Domain::service(&node).unwrap().open().unwrap();
    let port = service.client_builder().initial_max_slice_len(4 * MAX_OPS).create().unwrap();
    let bells = place.bells();
    let mut all = Vec::new();
    for ops in requests {
        let request = port.loan_slice_uninit(ops.len()).unwrap().write_from_slice(ops);
        let pending = request.send().unwrap();
        bells.ring_doorbell();
        if !wait {
            continue;
        }
        let mut replies = Vec::new();
        loop {
            let seen = bells.reply_count();
            let open = pending.is_connected();
            if let Some(response) = pending.receive().unwrap() {
                wire::decode(response.payload(), &mut replies).unwrap();
                break;
            }
            assert!(open, "the server closed the request without an answer");
            bells.wait_reply(seen, std::time::Duration::from_millis(100));
        }
        all.push(replies);
    }
    all
}

#[test]
fn malformed_requests_are_answered_by_errors() {
    let place = Arc::new(InstanceFiles::new());
    let _emulator = Emulator::start(&place, true);
    let client = place.client();
    let poke = WireOp::from(&Op::Poke { plc: DeviceIndex(0), offset: REG, width: Width::Word, value: 1 });
    let requests = [
        vec![WireOp { kind: 0, ..poke }],
        vec![poke, WireOp { width: 8, ..poke }],
        vec![],
        vec![poke; 1_000],
    ];
    let replies = send_raw(&place, &requests, true);
    let refusal = |reply: &Reply| match reply {
        Reply::Error(refused) => (refused.code, refused.text.clone()),
        other => panic!("{other:?}"),
    };
    let malformed = |index, field| {
        let text = format!(
            "operation {index} of the request is malformed ({field}); do client and emulator have the same version?"
        );
        (Code::MALFORMED, text)
    };
    assert_eq!((replies[0].len(), refusal(&replies[0][0])), (1, malformed(0, "the kind is 16#0")));
    assert_eq!(
        (&replies[1][0], refusal(&replies[1][1])),
        (&Reply::Written, malformed(1, "the width is 16#8"))
    );
    assert_eq!(replies[2], []);
    let too_many = "1000 operations in one request are too many, at most 256".to_owned();
    assert_eq!((replies[3].len(), refusal(&replies[3][0])), (1, (Code::TOO_MANY_OPERATIONS, too_many)));
    assert_eq!(client.peek(DeviceIndex(0), REG, Width::Word).unwrap(), 1);
}

#[test]
fn random_requests_do_not_stop_the_server() {
    let place = Arc::new(InstanceFiles::new());
    let _emulator = Emulator::start(&place, false);
    let client = place.client();
    // The same random numbers in every run.
    let mut noise = fastrand::Rng::with_seed(1);
    let requests: Vec<Vec<WireOp>> = (0..300)
        .map(|_| {
            let len = noise.usize(1..=8);
            (0..len)
                .map(|_| {
                    let bytes: [u8; 32] = std::array::from_fn(|_| noise.u8(..));
                    let mut op = WireOp::read_from_bytes(&bytes).unwrap();
                    // Half of the random messages have a valid beginning. No message may stop the emulator or make it
                    // wait for a long time.
                    if noise.bool() {
                        op.kind = noise.u16(..8);
                        op.plc %= 3;
                        op.width = [1, 2, 4][noise.usize(..3)];
                        op.time_us %= 10_000;
                        op.reserved = 0;
                    }
                    op
                })
                .collect()
        })
        .collect();
    let replies = send_raw(&place, &requests, true);
    assert!(replies.iter().all(|replies| !replies.is_empty()));
    client.poke(DeviceIndex(0), REG, Width::Word, 0x55).unwrap();
    assert_eq!(client.peek(DeviceIndex(0), REG, Width::Word).unwrap(), 0x55);
}

#[test]
fn abandoned_requests_do_no_harm() {
    let place = Arc::new(InstanceFiles::new());
    let emulator = Emulator::start(&place, true);
    let client = place.client();
    let poke = WireOp::from(&Op::Poke { plc: DeviceIndex(1), offset: REG, width: Width::Word, value: 1 });
    send_raw(&place, &vec![vec![poke]; 200], false);
    client.poke(DeviceIndex(0), REG, Width::Word, 0x55).unwrap();
    assert_eq!(client.peek(DeviceIndex(0), REG, Width::Word).unwrap(), 0x55);
    drop(client);
    emulator.end();
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

/// Runs a server that answers every request with these blocks, until the client returns.
fn with_answer(blocks: &[Block], ops: &[Op]) -> Result<Vec<Reply>, ClientError> {
    let place = InstanceFiles::new();
    let domain = place.domain();
    let bells = place.bells();
    let node = domain.node::<Ipc>().unwrap();
    let service = Domain::service(&node).unwrap().open_or_create().unwrap();
    let port = service.server_builder().initial_max_slice_len(64).create().unwrap();
    bells.set_pid(std::process::id());
    domain.announce().unwrap();
    let over = AtomicBool::new(false);
    let result = std::thread::scope(|scope| {
        let client = scope.spawn(|| {
            let result = place.client().request(ops);
            over.store(true, Ordering::Release);
            place.bells().ring_doorbell();
            result
        });
        while !over.load(Ordering::Acquire) {
            let seen = bells.doorbell_count();
            if let Some(request) = port.receive().unwrap() {
                let reply = request.loan_slice_uninit(blocks.len()).unwrap();
                reply.write_from_slice(blocks).send().unwrap();
                drop(request);
                bells.announce_reply();
                continue;
            }
            bells.wait_doorbell(seen, std::time::Duration::from_millis(20));
        }
        client.join().unwrap()
    });
    drop((port, service, node));
    result
}

#[test]
fn a_reply_that_makes_no_sense_is_an_error() {
    let value = |value| Block { kind: 1, code: 0, data_len: 0, value };
    let peek = Op::Peek { plc: DeviceIndex(0), offset: REG, width: Width::Word };
    let error = with_answer(&[value(1), Block { kind: 77, ..value(2) }], &[peek, peek]).unwrap_err();
    assert!(matches!(error, ClientError::Reply(DecodeError { index: 1, block: 1 })), "{error}");
    let error = with_answer(&[Block { data_len: u32::MAX, ..value(2) }], &[peek]).unwrap_err();
    assert!(matches!(error, ClientError::Reply(DecodeError { index: 0, block: 0 })), "{error}");
    // First the server sends too few values, and in the second case it sends too many.
    let error = with_answer(&[value(1)], &[peek, peek]).unwrap_err();
    assert!(matches!(error, ClientError::WrongReply { .. }), "{error}");
    let error = with_answer(&[value(1), value(2)], &[peek]).unwrap_err();
    assert!(matches!(error, ClientError::WrongReply { .. }), "{error}");
    assert_eq!(with_answer(&[value(1)], &[peek]).unwrap(), [Reply::Value(1)]);
}
