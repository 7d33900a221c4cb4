use super::rig::{Emulator, InstanceFiles, LONG};
use crate::channel::client::Patience;
use crate::channel::{Bells, ClientError};
use crate::identity::DeviceIndex;
use crate::layout::{Compare, Test};
use crate::memory::Width;
use crate::request::testing::{RAM, TestHost};
use crate::request::{Code, MAX_ADVANCE_US, Op, Reply, Waited};
#[cfg(feature = "cli")]
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

const REG: u32 = RAM.start;

fn wait(offset: u32, value: u32, within_us: u64) -> Op {
    Op::Wait { plc: DeviceIndex(0), offset, width: Width::Word, mask: 0xFFFF, value, within_us }
}

#[test]
fn waits_of_several_clients_end_when_their_register_matches() {
    let place = Arc::new(InstanceFiles::new());
    let _emulator = Emulator::start(&place, false);
    let done = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for number in 0..5 {
            let (place, done) = (&place, &done);
            scope.spawn(move || {
                let client = place.client();
                let ready =
                    Op::Poke { plc: DeviceIndex(0), offset: REG + 100, width: Width::Word, value: number };
                let ops = [ready, wait(REG + 2 * number, 0x44, MAX_ADVANCE_US), Op::Info];
                let replies = client.request(&ops).unwrap();
                assert!(matches!(replies[1], Reply::Waited(Waited { value: 0x44, .. })), "{replies:?}");
                assert!(matches!(replies[2], Reply::Info(_)), "{replies:?}");
                done.fetch_add(1, Ordering::Relaxed);
            });
        }
        let client = place.client();
        // The order differs from the order of the requests.
        for number in [3, 0, 4, 2, 1] {
            client.poke(DeviceIndex(0), REG + 2 * number, Width::Word, 0x44).unwrap();
        }
    });
    assert_eq!(done.into_inner(), 5);
}

#[test]
fn a_wait_in_real_time_fails_after_its_emulated_time() {
    let place = Arc::new(InstanceFiles::new());
    let _emulator = Emulator::start(&place, false);
    let client = place.client();
    client.poke(DeviceIndex(0), REG, Width::Word, 0x41).unwrap();
    match client.request(&[wait(REG, 0x44, 7_000), Op::Info]).unwrap().as_slice() {
        [Reply::Error(refused), Reply::NotExecuted] => {
            assert_eq!(refused.code, Code::NOT_IN_TIME);
            assert!(matches!(refused.waited, Some(Waited { value: 0x41, time_us }) if time_us >= 7_000));
        }
        other => panic!("{other:?}"),
    }
}

/// Runs a server with a stopped real-time clock, polled while `client` runs.
fn with_frozen_server(client: impl FnOnce(&InstanceFiles) + Send) -> (usize, usize) {
    let place = InstanceFiles::new();
    let mut host = TestHost::new(false);
    host.is_frozen = true;
    let mut server = place.server().unwrap();
    let bells = place.bells();
    let over = AtomicBool::new(false);
    let mut most_waiting = 0;
    std::thread::scope(|scope| {
        scope.spawn(|| {
            client(&place);
            over.store(true, Ordering::Release);
            place.bells().ring_doorbell();
        });
        while !over.load(Ordering::Acquire) {
            let seen = bells.doorbell_count();
            if server.poll(&mut host) == 0 {
                bells.wait_doorbell(seen, Duration::from_millis(20));
            }
            most_waiting = most_waiting.max(server.waiting());
        }
    });
    server.poll(&mut host);
    let left = server.waiting();
    server.close(&mut host);
    assert!(place.remains().is_empty(), "{:?}", place.remains());
    (most_waiting, left)
}

#[test]
fn a_client_that_gives_up_is_forgotten_and_may_ask_again() {
    let (most, left) = with_frozen_server(|place| {
        let patience = Patience { connect: LONG, reply: Duration::from_millis(50), ..Patience::default() };
        let client = place.connect(patience).unwrap();
        for _ in 0..3 {
            let late = client.request(&[wait(REG, 1, 1_000)]).unwrap_err();
            assert!(matches!(late, ClientError::Timeout { .. }), "{late}");
        }
        let client = place.client();
        client.poke(DeviceIndex(0), REG, Width::Word, 1).unwrap();
        assert_eq!(client.peek(DeviceIndex(0), REG, Width::Word).unwrap(), 1);
    });
    assert_eq!((most, left), (1, 0));
}

/// The time limit counts again as long as the emulator works on the request.
#[cfg(feature = "cli")]
#[test]
fn a_client_waits_as_long_as_the_emulator_works() {
    let (_, left) = with_frozen_server(|place| {
        let patience = Patience { connect: LONG, reply: Duration::from_millis(20), ..Patience::default() };
        let client = place.connect(patience).unwrap();
        let asked = Cell::new(0);
        let is_working = || {
            asked.set(asked.get() + 1);
            if asked.get() == 3 {
                place.client().poke(DeviceIndex(0), REG, Width::Word, 1).unwrap();
            }
            asked.get() <= 3
        };
        let replies = client.request_while(&[wait(REG, 1, 1_000)], &is_working).unwrap();
        assert!(matches!(replies[..], [Reply::Waited(_)]) && asked.get() >= 3, "{replies:?}");
        let late = client.request_while(&[wait(REG, 2, 1_000)], &|| false).unwrap_err();
        assert!(matches!(late, ClientError::Timeout { .. }), "{late}");
    });
    assert_eq!(left, 0);
}

#[test]
fn closing_answers_waiting_requests() {
    let place = Arc::new(InstanceFiles::new());
    let mut host = TestHost::new(false);
    host.is_frozen = true;
    let emulator = Emulator::start_with(&place, host);
    std::thread::scope(|scope| {
        let waiter = scope.spawn(|| {
            let here = Op::Poke { plc: DeviceIndex(0), offset: REG + 2, width: Width::Word, value: 1 };
            place.client().request(&[here, wait(REG, 1, MAX_ADVANCE_US)])
        });
        let other = place.client();
        while other.peek(DeviceIndex(0), REG + 2, Width::Word).unwrap() == 0 {}
        emulator.end();
        let replies = waiter.join().unwrap().unwrap();
        let [Reply::Written, Reply::Error(refused)] = &replies[..] else { panic!("{replies:?}") };
        assert_eq!(refused.code, Code::SHUTTING_DOWN);
    });
}

/// Returns a host with operations that pause wherever possible.
fn pausing() -> TestHost {
    let mut host = TestHost::new(true);
    host.pauses = true;
    host
}

/// The duration is more emulated time than a test can wait for.
const DAY: Op = Op::Advance { us: MAX_ADVANCE_US };

#[test]
fn other_clients_read_and_stop_while_the_clock_advances() {
    let place = Arc::new(InstanceFiles::new());
    let _emulator = Emulator::start_with(&place, pausing());
    std::thread::scope(|scope| {
        let stepper = scope.spawn(|| place.client().request(&[DAY]));
        let client = place.client();
        let now = || client.info().unwrap().time_us;
        while now() == 0 {}
        let before = now();
        while now() == before {}
        assert_eq!(client.peek(DeviceIndex(0), REG, Width::Word).unwrap(), 0);
        client.stop().unwrap();
        let replies = stepper.join().unwrap().unwrap();
        let [Reply::Error(refused)] = &replies[..] else { panic!("{replies:?}") };
        assert_eq!(refused.code, Code::SHUTTING_DOWN);
    });
}

/// A wait for several conditions pauses like an advance, and reading buses and drives is possible in the meantime.
#[test]
fn other_clients_read_while_one_waits_for_conditions() {
    let place = Arc::new(InstanceFiles::new());
    let _emulator = Emulator::start_with(&place, pausing());
    let test = Test { mask: 0xFFFF, compare: Compare::Equal, is_signed: false, value: 7 };
    let condition = Op::Condition { plc: DeviceIndex(0), offset: REG, width: Width::Word, test };
    let never = Op::WaitFor { any: false, within_us: MAX_ADVANCE_US };
    std::thread::scope(|scope| {
        let waiter = scope.spawn(|| place.client().request(&[condition, never]));
        let client = place.client();
        let now = || client.info().unwrap().time_us;
        while now() == 0 {}
        let before = now();
        assert!(client.request(&[Op::Buses]).unwrap().remove(0).buses().is_ok());
        assert!(client.request(&[Op::Drives]).unwrap().remove(0).drives().is_ok());
        while now() == before {}
        client.stop().unwrap();
        let replies = waiter.join().unwrap().unwrap();
        let [Reply::Written, Reply::Error(refused)] = &replies[..] else { panic!("{replies:?}") };
        assert_eq!(refused.code, Code::SHUTTING_DOWN);
    });
}

/// A request that changes the plant waits for its turn. Otherwise the moment of the change would be arbitrary.
#[test]
fn a_request_that_changes_the_plant_waits_for_the_one_under_way() {
    let place = Arc::new(InstanceFiles::new());
    let _emulator = Emulator::start_with(&place, pausing());
    let step = Op::Advance { us: 3_000_000 };
    let peek = Op::Peek { plc: DeviceIndex(0), offset: REG, width: Width::Word };
    std::thread::scope(|scope| {
        let stepper = scope.spawn(|| place.client().request(&[step, peek]).unwrap());
        let client = place.client();
        while client.info().unwrap().time_us == 0 {}
        client.poke(DeviceIndex(0), REG, Width::Word, 7).unwrap();
        assert_eq!(client.info().unwrap().time_us, 3_000_000);
        assert_eq!(stepper.join().unwrap(), [Reply::Time(3_000_000), Reply::Value(0)]);
    });
}

#[test]
fn the_operation_of_a_client_that_gives_up_ends() {
    let place = Arc::new(InstanceFiles::new());
    let _emulator = Emulator::start_with(&place, pausing());
    let impatient = Patience { connect: LONG, reply: Duration::from_millis(50), ..Patience::default() };
    let late = place.connect(impatient).unwrap().request(&[DAY]).unwrap_err();
    assert!(matches!(late, ClientError::Timeout { .. }), "{late}");
    let client = place.client();
    client.poke(DeviceIndex(0), REG, Width::Word, 7).unwrap();
    let ended = client.info().unwrap().time_us;
    assert!(ended < MAX_ADVANCE_US);
    assert_eq!(client.advance(1).unwrap(), ended + 1);
}

/// During a return, the server polls no other request.
#[test]
fn the_return_of_a_client_that_gives_up_ends_at_the_present_moment() {
    let place = Arc::new(InstanceFiles::new());
    let mut host = TestHost::new(true);
    let poke = |value| Op::Poke { plc: DeviceIndex(0), offset: REG, width: Width::Word, value };
    host.request(&[
        Op::Advance { us: 2_000 },
        poke(1),
        Op::Advance { us: 3_000 },
        poke(2),
        Op::Advance { us: 4_000 },
    ]);
    let holds = Arc::clone(&host.holds_returns);
    holds.store(true, Ordering::Relaxed);
    let _emulator = Emulator::start_with(&place, host);
    let test = Test { mask: 0xFFFF, compare: Compare::Equal, is_signed: false, value: 1 };
    let condition = Op::Condition { plc: DeviceIndex(0), offset: REG, width: Width::Word, test };
    let until = [condition, Op::BackUntil { any: false, detached: false }];
    let impatient = Patience { connect: LONG, reply: Duration::from_millis(50), ..Patience::default() };
    let late = place.connect(impatient).unwrap().request(&until).unwrap_err();
    assert!(matches!(late, ClientError::Timeout { .. }), "{late}");
    holds.store(false, Ordering::Relaxed);
    let client = place.client();
    assert_eq!(client.info().unwrap().time_us, 9_000);
    assert_eq!(client.peek(DeviceIndex(0), REG, Width::Word).unwrap(), 2);
    // The same return succeeds for a client that waits.
    let waited = Reply::Waited(Waited { time_us: 2_000, value: 1 });
    assert_eq!(client.request(&until).unwrap().last(), Some(&waited));
}
