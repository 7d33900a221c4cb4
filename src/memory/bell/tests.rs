//! Bells on real futexes. A wait that must end by a ring has a watchdog timeout. The timeout is far longer than any
//! machine needs, so it never decides the result of a test.

use super::*;
use crate::memory::testing::SEGMENT_SIZE;
use crate::memory::{Header, Segment, View};
use std::{sync::mpsc, thread};

const WATCHDOG: Option<Duration> = Some(Duration::from_secs(60));

fn header() -> View<Header> {
    Segment::heap(SEGMENT_SIZE).header().unwrap()
}

/// Waits until a waiter is registered.
fn wait_for_waiter(bell: &Bell) {
    while !bell.has_waiters() {
        thread::yield_now();
    }
}

#[test]
fn a_ring_before_the_wait_is_not_missed() {
    let header = header();
    let seen = header.answer.rings();
    header.answer.ring();
    assert!(header.answer.wait(seen, WATCHDOG));
}

#[test]
fn a_wait_without_a_ring_ends() {
    let header = header();
    assert!(!header.answer.wait(0, Some(Duration::from_millis(1))));
    assert!(!header.answer.wait(0, Some(Duration::ZERO)));
    assert!(!header.answer.has_waiters());
}

#[test]
fn sleepers_are_woken_and_signed_off() {
    let header = header();
    let (woken, result) = mpsc::channel();
    thread::scope(|scope| {
        for _ in 0..2 {
            let (header, woken) = (&header, woken.clone());
            scope.spawn(move || woken.send(header.answer.wait(0, WATCHDOG)).unwrap());
        }
        while header.answer.waiters.load() != 2 {
            thread::yield_now();
        }
        header.answer.ring();
        assert!(result.recv().unwrap() && result.recv().unwrap());
    });
    assert!(!header.answer.has_waiters());
}

#[test]
fn any_of_several_bells_wakes() {
    let header = header();
    for rung in 0..3 {
        let bells = [&header.doorbell, &header.answer, &header.events[12].bell];
        let seen = bells.map(|bell| (bell, bell.rings()));
        thread::scope(|scope| {
            let waiter = scope.spawn(|| wait_any(&seen, WATCHDOG));
            wait_for_waiter(bells[2]);
            bells[rung].ring();
            assert_eq!(waiter.join().unwrap(), Some(rung));
        });
    }
    let seen = [(&header.doorbell, 1), (&header.answer, 1)];
    assert_eq!(wait_any(&seen, Some(Duration::from_millis(1))), None);
}

#[test]
fn more_bells_than_the_kernel_takes_still_wake() {
    let segments: Vec<_> = (0..=MAX_WAITV).map(|_| header()).collect();
    let seen: Vec<_> = segments.iter().map(|header| (&header.doorbell, 0)).collect();
    thread::scope(|scope| {
        let waiter = scope.spawn(|| wait_any(&seen, WATCHDOG));
        wait_for_waiter(&segments[MAX_WAITV].doorbell);
        segments[MAX_WAITV].doorbell.ring();
        assert_eq!(waiter.join().unwrap(), Some(MAX_WAITV));
    });
}

#[test]
fn no_bell_is_a_timer() {
    assert_eq!(wait_any(&[], Some(Duration::from_millis(1))), None);
}

#[test]
fn the_number_of_rings_wraps() {
    let header = header();
    header.answer.word.store(u32::MAX);
    header.answer.ring();
    assert_eq!(header.answer.rings(), 0);
    assert!(header.answer.wait(u32::MAX, WATCHDOG));
}

#[test]
fn two_sides_answer_each_other_ten_thousand_times() {
    let header = header();
    let seg = header.segment();
    thread::scope(|scope| {
        scope.spawn(|| {
            for round in 1..=10_000 {
                loop {
                    let seen = header.doorbell.rings();
                    if seg.load(200_000, crate::memory::Width::Dword).unwrap() == round {
                        break;
                    }
                    assert!(header.doorbell.wait(seen, WATCHDOG), "lost wake-up in round {round}");
                }
                seg.store(200_004, crate::memory::Width::Dword, round).unwrap();
                header.answer.ring();
            }
        });
        for round in 1..=10_000 {
            seg.store(200_000, crate::memory::Width::Dword, round).unwrap();
            header.doorbell.ring();
            loop {
                let seen = header.answer.rings();
                if seg.load(200_004, crate::memory::Width::Dword).unwrap() == round {
                    break;
                }
                assert!(header.answer.wait(seen, WATCHDOG), "lost wake-up in round {round}");
            }
        }
    });
}
