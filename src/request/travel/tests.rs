//! Going back by operations.

use super::kept::{KeptSnapshots, MAX_KEPT};
use super::*;
use crate::identity::DeviceIndex;
use crate::layout::{Compare, Test, Width};
use crate::request::testing::{RAM, TestHost};
use crate::request::{Execution, FilePart, MAX_RANGE, Op, Reply, Waited};

const WORD: Width = Width::Word;

fn poke(value: u32) -> Op {
    Op::Poke { plc: DeviceIndex(0), offset: RAM.start, width: WORD, value }
}

fn held(host: &mut TestHost) -> Reply {
    host.request(&[Op::Peek { plc: DeviceIndex(0), offset: RAM.start, width: WORD }]).remove(0)
}

/// The register is 1 from 2 ms on and 2 from 5 ms on; the time is 9 ms.
fn host() -> TestHost {
    let mut host = TestHost::new(true);
    host.request(&[
        Op::Advance { us: 2_000 },
        poke(1),
        Op::Advance { us: 3_000 },
        poke(2),
        Op::Advance { us: 4_000 },
    ]);
    host
}

fn back(us: u64) -> Op {
    Op::Back { us, detached: false }
}

fn until(value: u32) -> [Op; 2] {
    let test = Test { mask: 0xFFFF, compare: Compare::Equal, is_signed: false, value };
    [
        Op::Condition { plc: DeviceIndex(0), offset: RAM.start, width: WORD, test },
        Op::BackUntil { any: false, detached: false },
    ]
}

#[test]
fn going_back_by_a_time_restores_the_state_and_continues_from_it() {
    let mut host = host();
    let (hash, end) = (host.plant.journal().hash(), host.plant.journal().end());
    let records: Vec<_> = host.plant.journal().records().collect();
    assert_eq!(host.request(&[back(5_500)]), [Reply::Time(3_500)]);
    assert_eq!(held(&mut host), Reply::Value(1));
    let kept: Vec<_> = host.plant.journal().records().collect();
    assert!(kept.len() < records.len() && records.starts_with(&kept), "{kept:?}");
    // The program repeats its stores, so the journal is unchanged after going back.
    host.request(&[Op::Advance { us: 1_500 }, poke(2), Op::Advance { us: 4_000 }]);
    assert_eq!((host.plant.journal().hash(), host.plant.journal().end()), (hash, end));
    // A reader of the journal can detect that the history is another one.
    let turn = host.plant.journal().history_id();
    assert!(turn.number > 0 && turn.begin == kept.last().map_or(0, |last| last.seq + 1), "{turn:?}");
}

/// At the present moment, the plant is in the state after the last action already. Only some of the actions at this
/// moment are stores, which the history knows before the clock advances.
#[test]
fn going_back_by_no_time_keeps_all_actions_at_the_present_moment() {
    let mut host = host();
    host.request(&[poke(3), Op::ClearFindings, poke(4)]);
    let before = host.plant.snapshot();
    assert_eq!(host.request(&[back(0)]), [Reply::Time(9_000)]);
    assert!(host.plant.snapshot() == before);
    assert_eq!(held(&mut host), Reply::Value(4));
    host.request(&[Op::Advance { us: 1_000 }, back(1_000), Op::ClearFindings, poke(6)]);
    // Only earlier moments can be found, although a stretch of the history begins here.
    let before = host.plant.snapshot();
    let Some(Reply::Error(Refused { code, text, .. })) = host.request(&until(4)).pop() else { panic!() };
    assert_eq!(
        (code, text.as_str()),
        (
            Code::NOT_SO_FAR,
            "the conditions did not become true since 0.000000 s, the earliest moment of the history"
        )
    );
    assert!(host.plant.snapshot() == before);
    // At the time 0 there is no earlier moment.
    let mut host = TestHost::new(true);
    host.request(&[Op::Advance { us: 1_000 }, back(1_000), Op::ClearFindings, poke(1)]);
    assert_eq!(host.request(&until(1)).last(), Some(&Reply::Waited(Waited { time_us: 0, value: 1 })));
    assert_eq!(held(&mut host), Reply::Value(1));
}

/// A return to the time 0 keeps the stores that clients made at this time. A return to the start does not keep them.
#[test]
fn the_start_is_before_the_first_action() {
    let mut host = TestHost::new(true);
    let hash = host.plant.journal().hash();
    let start = Op::BackToStart { detached: false };
    assert_eq!(host.request(&[start]), [Reply::Time(0)]);
    for _ in 0..2 {
        host.request(&[poke(1), Op::Advance { us: 2_000 }, poke(2)]);
        assert_eq!(host.request(&[back(2_000)]), [Reply::Time(0)]);
        assert_eq!(held(&mut host), Reply::Value(1));
        host.request(&[Op::Advance { us: 3_000 }]);
        assert_eq!(host.request(&[start]), [Reply::Time(0)]);
        assert_eq!(held(&mut host), Reply::Value(0));
        assert_eq!(host.plant.journal().hash(), hash);
    }
    *host.plant_and_travel().1 = Travel::new(0);
    assert_eq!(host.refusal(start).0, Code::NOT_SO_FAR);
}

#[test]
fn going_back_until_a_condition_became_true() {
    let mut host = host();
    let replies = host.request(&until(2));
    assert_eq!(replies.last(), Some(&Reply::Waited(Waited { time_us: 5_000, value: 1 })));
    assert_eq!(held(&mut host), Reply::Value(2));
    let replies = host.request(&until(1));
    assert_eq!(replies.last(), Some(&Reply::Waited(Waited { time_us: 2_000, value: 1 })));
    // The condition was true at power-on.
    let replies = host.request(&until(0));
    assert_eq!(replies.last(), Some(&Reply::Waited(Waited { time_us: 0, value: 1 })));
}

#[test]
fn a_condition_that_was_never_true_leaves_the_plant_unchanged() {
    let mut host = host();
    let (before, records) = (host.plant.snapshot(), host.plant.journal().records().count());
    let replies = host.request(&until(7));
    let Some(Reply::Error(Refused { code: Code::NOT_SO_FAR, text, .. })) = replies.last() else {
        panic!("{replies:?}")
    };
    assert_eq!(
        text,
        "the conditions did not become true since 0.000000 s, the earliest moment of the history"
    );
    assert!(host.plant.snapshot() == before);
    assert_eq!(host.plant.journal().records().count(), records);
}

/// Without its client, a search would keep the plant from all others. It may end at each of its steps.
#[test]
fn a_return_ends_without_its_client_and_leaves_the_plant_unchanged() {
    for ops in [&until(1)[..], &until(7), &[back(4_000)]] {
        let mut waits = 0;
        loop {
            let mut host = host();
            let (before, hash) = (host.plant.snapshot(), host.plant.journal().hash());
            let (mut calls, mut execution, mut refused) = (0, Execution::default(), None);
            for op in ops {
                let mut is_awaited = || {
                    calls += 1;
                    calls <= waits
                };
                refused = execution.run_while(&mut host, op, &mut is_awaited).err();
            }
            if calls <= waits {
                break;
            }
            assert_eq!(refused.map(|refused| refused.code), Some(Code::NOT_SO_FAR));
            assert!(
                host.plant.snapshot() == before && host.plant.journal().hash() == hash,
                "{ops:?} {waits}"
            );
            // The history is complete.
            let mut other = self::host();
            for op in [&until(1)[..], &[back(1_500)], &[back(500)]] {
                assert_eq!(host.request(op), other.request(op), "{ops:?} {waits}");
                assert!(host.plant.snapshot() == other.plant.snapshot(), "{ops:?} {waits}");
            }
            waits += 1;
        }
        assert!(waits > 0, "{ops:?}");
    }
}

#[test]
fn going_back_needs_a_kept_moment_and_a_stepped_clock_without_outsiders() {
    let mut host = host();
    let (code, text) = host.refusal(back(9_001));
    assert_eq!(code, Code::NOT_SO_FAR);
    assert_eq!(text, "9001 us are too far: the earliest moment is 0.000000 s, it is 0.009000 s now");
    host.outsiders = Some("soft_plc (process 7), which has mapped the registers,".to_owned());
    let (code, text) = host.refusal(back(1_000));
    assert_eq!(code, Code::NOT_ALONE);
    assert_eq!(
        text,
        "soft_plc (process 7), which has mapped the registers, cannot go back with the plant; let it end, or give --ignore-programs"
    );
    assert_eq!(host.request(&[Op::Back { us: 1_000, detached: true }]), [Reply::Time(8_000)]);
    let mut host = TestHost::new(false);
    let (code, text) = host.refusal(Op::Save);
    assert_eq!(code, Code::CLOCK_IS_REAL_TIME);
    assert!(text.contains("snapshots and going back need a stepped one"), "{text}");
    assert_eq!(host.refusal(back(1)).0, Code::CLOCK_IS_REAL_TIME);
}

/// Stores do not need snapshots: the whole history follows the first snapshot, and the plant can go back to each of its
/// moments.
#[test]
fn stores_of_operations_are_repeated() {
    let mut host = host();
    let travel = host.plant_and_travel().1;
    assert_eq!(travel.history.len(), 1);
    let stored: Vec<_> = travel.history[0].stores.iter().map(|store| (store.time_us, store.value)).collect();
    assert_eq!(stored, [(2_000, 1), (5_000, 2)]);
    let states = |us: u64| {
        let mut host = self::host();
        host.request(&[back(9_000 - us)]);
        (held(&mut host), host.plant.journal().hash(), host.plant_and_travel().1.history[0].stores.len())
    };
    let value = |us| states(us).0;
    assert_eq!([0, 1_999, 2_000, 4_999, 5_000, 8_999].map(value), [0, 0, 1, 1, 2, 2].map(Reply::Value));
    // After a return, the history has no stretches after this moment.
    assert_eq!([1_999, 2_000, 4_999, 5_000].map(|us| states(us).2), [0, 1, 1, 2]);
    // A compare-exchange that has failed has stored nothing, so the return must not store its value.
    let exchange = |current, new| Op::CompareExchange {
        plc: DeviceIndex(0),
        offset: RAM.start,
        width: WORD,
        current,
        new,
    };
    host.request(&[exchange(7, 8), Op::Advance { us: 1_000 }, exchange(2, 3), Op::Advance { us: 1_000 }]);
    assert_eq!(host.plant_and_travel().1.history[0].stores.len(), 3);
    host.request(&[back(1_000)]);
    assert_eq!(held(&mut host), Reply::Value(3));
    host.request(&[back(1)]);
    assert_eq!(held(&mut host), Reply::Value(2));
}

/// A snapshot in the middle of a moment contains only the stores before it.
#[test]
fn a_snapshot_does_not_contain_later_stores_of_the_same_moment() {
    let mut host = host();
    host.request(&[poke(3)]);
    let number = host.request(&[Op::Save]).remove(0).value().unwrap();
    host.request(&[poke(4), Op::Advance { us: 1_000 }]);
    assert_eq!(host.request(&[Op::BackTo { number, detached: false }]), [Reply::Time(9_000)]);
    assert_eq!(held(&mut host), Reply::Value(3));
    let hash = host.plant.journal().hash();
    host.request(&[Op::Advance { us: 1_000 }, back(1_000)]);
    assert_eq!((held(&mut host), host.plant.journal().hash()), (Reply::Value(3), hash));
    host.request(&[Op::Advance { us: 1_000 }, back(1_001)]);
    assert_eq!(held(&mut host), Reply::Value(2));
}

/// Limits the time for going back and the size of the history.
#[test]
fn many_stores_cause_a_snapshot() {
    let mut host = TestHost::new(true);
    host.request(&[Op::Advance { us: 1 }]);
    for value in 0..300 {
        host.request(&[poke(value), Op::Advance { us: 1 }]);
    }
    let travel = host.plant_and_travel().1;
    assert_eq!(travel.history.iter().map(|stretch| stretch.stores.len()).collect::<Vec<_>>(), [256, 43]);
    let start = travel.start.as_ref().unwrap().size();
    let sum: usize = travel.history.iter().map(Stretch::size).sum();
    assert_eq!(travel.size, start + sum);
    host.request(&[back(299)]);
    let travel = host.plant_and_travel().1;
    assert_eq!(travel.size, start + travel.history[0].size());
    host.request(&[Op::Advance { us: 200_000 }, Op::Advance { us: 1 }]);
    assert_eq!(host.plant_and_travel().1.history.len(), 2, "this much time causes a snapshot, too");
}

#[test]
fn unrepeatable_stores_through_the_map_are_reported() {
    let mut host = TestHost::new(true);
    // The script stores a command to the master, like a program that has mapped the image. The return does not repeat
    // this store, so the journal differs.
    host.script = vec![(4_500, 200_000, 1)];
    // Without the register as condition, the operation advances event by event, so the store is in the middle of the
    // stretch.
    let within_us = 9_000;
    host.request(&[Op::Wait {
        plc: DeviceIndex(0),
        offset: RAM.start,
        width: WORD,
        mask: 1,
        value: 1,
        within_us,
    }]);
    host.request(&[Op::Advance { us: 1_000 }]);
    let in_between = host.plant.journal().written();
    assert!(in_between > 0, "the store shows in the journal");
    let before = host.plant.snapshot();
    // The program's store is not repeated, so its condition is not found, and the refusal gives the reason.
    let Some(Reply::Error(Refused { text, .. })) = host.request(&until(7)).pop() else { panic!() };
    assert!(
        text.contains("but between 0.000000 s and 0.010000 s a program with mapped registers,"),
        "{text}"
    );
    assert!(host.plant.snapshot() == before);
    let (code, text) = host.refusal(back(5_000));
    assert_eq!(code, Code::NOT_ALONE);
    assert_eq!(
        text,
        "between 0.000000 s and 0.010000 s a program with mapped registers, or a guest at a door, has acted on the \
         plant, which cannot be repeated; go back to 0.000000 s, or give --ignore-programs to go without its actions"
    );
    assert!(host.plant.snapshot() == before);
    // An emulator that ends repeats a stretch incompletely, so the difference says nothing about programs.
    host.stop.store(true, core::sync::atomic::Ordering::Relaxed);
    assert_eq!(host.refusal(back(5_000)).0, Code::SHUTTING_DOWN);
    host.stop.store(false, core::sync::atomic::Ordering::Relaxed);
    assert!(host.plant.snapshot() == before);
    assert_eq!(host.request(&[Op::Back { us: 5_000, detached: true }]), [Reply::Time(5_000)]);
}

#[test]
fn the_reason_for_an_empty_history_is_reported() {
    let mut host = TestHost::new(true);
    assert!(host.refusal(back(1)).1.ends_with("no time has passed since the start"));
    let mut host = self::host();
    let saved = host.request(&[Op::Save]).remove(0).value().unwrap();
    host.request(&[Op::Back { us: 5_000, detached: false }, Op::Advance { us: 1_000 }]);
    // The snapshot is no longer part of the plant's history.
    host.request(&[Op::BackTo { number: saved, detached: false }]);
    let text = host.refusal(back(1)).1;
    assert!(text.contains("since another state was restored"), "{text}");
}

#[test]
fn snapshots_have_numbers_and_come_and_go_in_parts() {
    let mut host = host();
    let Reply::Value(number) = host.request(&[Op::Save]).remove(0) else { panic!("a number") };
    let saved = host.plant.snapshot();
    let mut bytes = Vec::new();
    loop {
        let read = Op::ReadSaved { number, from: bytes.len() as u32 };
        let Reply::Bytes(part) = host.request(&[read]).remove(0) else { panic!("bytes") };
        bytes.extend_from_slice(&part);
        if part.len() < MAX_RANGE as usize {
            break;
        }
    }
    host.request(&[poke(3), Op::Advance { us: 700 }]);
    assert_eq!(host.request(&[Op::BackTo { number, detached: false }]), [Reply::Time(9_000)]);
    assert!(host.plant.snapshot() == saved);
    // Another instance with the same plant.
    let mut other = TestHost::new(true);
    for bring in Op::bring(&bytes) {
        assert_eq!(other.request(&[bring]), [Reply::Written]);
    }
    assert_eq!(other.request(&[Op::Restore { detached: false }]), [Reply::Time(9_000)]);
    assert!(other.plant.snapshot() == saved);
    assert_eq!(other.refusal(back(1)).0, Code::NOT_SO_FAR, "its way begins here");
    let no_start =
        "the start is not kept, because another state was restored or a changed script was read since then";
    let start = Op::BackToStart { detached: false };
    assert_eq!(other.refusal(start), (Code::NOT_SO_FAR, no_start.to_owned()));
    // The register has been 2 since 5 ms.
    let replies = other.request(&[&[Op::Advance { us: 700 }][..], &until(2)].concat());
    let Some(Reply::Error(Refused { code: Code::NOT_SO_FAR, text, .. })) = replies.last() else {
        panic!("{replies:?}")
    };
    assert_eq!(
        text,
        "the conditions have been true since before 0.009000 s, the earliest moment of the history"
    );
    assert_eq!(other.refusal(start).1, format!("{no_start}; the earliest moment is 0.009000 s"));
    assert_eq!(other.request(&[back(700)]), [Reply::Time(9_000)]);
    assert_eq!(other.refusal(Op::Restore { detached: false }).0, Code::SNAPSHOT, "nothing was brought");
    assert_eq!(other.refusal(Op::BringSaved { at: 16, part: FilePart::default() }).0, Code::SNAPSHOT);
    host.request(&[Op::Forget { number }]);
    assert_eq!(host.refusal(Op::BackTo { number, detached: false }).0, Code::SNAPSHOT);
}

#[test]
fn a_snapshot_of_an_abandoned_history_can_be_restored() {
    let mut host = host();
    let Reply::Value(number) = host.request(&[Op::Save]).remove(0) else { panic!("a number") };
    let saved = host.plant.snapshot();
    host.request(&[back(8_000), poke(9), Op::Advance { us: 20_000 }]);
    assert_eq!(host.request(&[Op::BackTo { number, detached: false }]), [Reply::Time(9_000)]);
    assert!(host.plant.snapshot() == saved);
    assert_eq!(host.plant.journal().records().count(), 0, "those of another history are gone");
}

#[test]
fn the_history_is_bounded() {
    let mut host = TestHost::new(true);
    let size = host.plant.snapshot().size();
    *host.plant_and_travel().1 = Travel::new(10 * size);
    for _ in 0..30 {
        host.request(&[Op::ClearFindings, Op::Advance { us: 1_000 }]);
    }
    let earliest = host.plant_and_travel().1.earliest().unwrap();
    assert!((18_000..29_000).contains(&earliest), "{earliest}");
    for _ in 0..MAX_KEPT {
        assert!(matches!(host.request(&[Op::Save])[..], [Reply::Value(_)]));
    }
    let (code, text) = host.refusal(Op::Save);
    assert_eq!(code, Code::SNAPSHOT);
    assert!(
        text.starts_with("64 snapshots are kept, which is the maximum: forget one (`forget`, in a scenario"),
        "{text}"
    );
}

#[test]
fn the_memory_of_kept_snapshots_is_bounded() {
    let mut host = TestHost::new(true);
    let size = host.plant.snapshot().size();
    host.plant_and_travel().1.saved.most_bytes = 3 * size + size / 2;
    let numbers = [(); 3].map(|()| {
        let Reply::Value(number) = host.request(&[Op::Save]).remove(0) else { panic!("a number") };
        number
    });
    let (code, text) = host.refusal(Op::Save);
    assert_eq!(code, Code::SNAPSHOT);
    assert!(text.starts_with("the 3 kept snapshots and this one need "), "{text}");
    assert_eq!(host.request(&[Op::Forget { number: numbers[1] }]), [Reply::Written]);
    assert!(matches!(host.request(&[Op::Save])[..], [Reply::Value(_)]));
    // A snapshot alone may be larger.
    let kept = &mut host.plant_and_travel().1.saved;
    *kept = KeptSnapshots::default();
    kept.most_bytes = 1;
    assert!(matches!(host.request(&[Op::Save])[..], [Reply::Value(_)]));
}
