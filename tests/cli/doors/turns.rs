//! Guests that request emulated time: the emulated time waits for them.

use super::{Guest, OPEN, buses, port, start};
use crate::common::{Emulator, eventually, promised};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::Stdio;
use std::time::Duration;

/// Parses a grant from a line, and returns the moment at which the guest may continue.
fn granted(line: &str) -> Option<u64> {
    line.strip_prefix('K').map(|digits| u64::from_str_radix(digits.trim_end(), 16).unwrap())
}

/// Returns the frames that a guest receives before its turn, and the time of the turn.
fn turn(guest: &mut Guest<TcpStream>, us: u64) -> (Vec<String>, u64) {
    guest.send(&format!("K{us:X}\r"));
    let mut heard = Vec::new();
    loop {
        let line = guest.hear();
        match granted(&line) {
            Some(time_us) => return (heard, time_us),
            None => heard.push(line),
        }
    }
}

/// Waits until the instance reports `count` guests that have requested time.
fn seated(emulator: &Emulator, count: usize) {
    let has_seat = |guest: &&Value| guest["seat"] == true;
    assert!(eventually(|| {
        buses(emulator)[0]["guests"].as_array().unwrap().iter().filter(has_seat).count() == count
    }));
}

/// Runs two guests: one sends a question every 1500 us, and the other answers 300 us after it received the question.
/// Returns the journal.
fn questions_and_answers(steps: &[&str]) -> String {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let port = port(&emulator);
    let (mut asks, mut answers) = (Guest::open(port), Guest::open(port));
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let mut now = 0;
            for number in 0..20 {
                let next = 1_500 * (number + 1);
                while now < next {
                    now = turn(&mut asks, next - now).1;
                }
                assert_eq!(asks.ask(&format!("t1{number:02X}0")), "z\r");
            }
            assert_eq!(turn(&mut asks, u64::MAX).0, ["t2130\r"]);
            assert_eq!(asks.ask("C"), "\r");
        });
        scope.spawn(move || {
            for _ in 0..20 {
                let (heard, now) = turn(&mut answers, u64::MAX);
                assert_eq!(heard.len(), 1, "{heard:?}");
                assert_eq!(turn(&mut answers, 300), (vec![], now + 300));
                assert_eq!(answers.ask(&heard[0].trim_end().replacen('1', "2", 1)), "z\r");
            }
            turn(&mut answers, 9_000);
        });
        seated(&emulator, 2);
        steps.iter().for_each(|step| drop(emulator.step(&[step])));
    });
    emulator.run("trace", &["--format", "jsonl", "--bus", "open"]).ok().to_owned()
}

/// A client waits 10 s and the time of its step for a reply. A guest that is slow, but acts, needs more.
#[test]
fn a_step_waits_while_a_slow_guest_lets_the_clock_advance() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let mut guest = Guest::open(port(&emulator));
    std::thread::scope(|scope| {
        scope.spawn(move || {
            for _ in 0..10 {
                assert_eq!(turn(&mut guest, 10_000).0, Vec::<String>::new());
                std::thread::sleep(Duration::from_millis(1200));
            }
            assert_eq!(guest.ask("C"), "\r");
        });
        seated(&emulator, 1);
        assert_eq!(emulator.step(&["100ms"]), "0.100000 s");
    });
}

#[test]
fn emulated_time_waits_for_guests_and_the_journal_is_reproducible() {
    let journal = questions_and_answers(&["40ms"]);
    assert_eq!(journal, questions_and_answers(&["40ms"]));
    assert_eq!(journal, questions_and_answers(&["999us", "1us", "1ms", "7ms", "300us", "30700us"]));
    let records: Vec<Value> = journal.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let frames = |guest| {
        let its = records.iter().filter(move |it| it["kind"] == "can_frame" && it["from"] == guest);
        its.map(|it| it["time_us"].as_u64().unwrap()).collect::<Vec<_>>()
    };
    let (questions, answers) = (frames("guest1"), frames("guest2"));
    assert_eq!((questions.len(), answers.len()), (20, 20));
    // 44 bits of 8 us, and at most 8 stuff bits.
    let wire = 44 * 8..=52 * 8;
    for (number, (question, answer)) in questions.into_iter().zip(answers).enumerate() {
        assert!(wire.contains(&(question - 1_500 * (number as u64 + 1))), "{number}: {question}");
        assert!(wire.contains(&(answer - question - 300)), "{number}: {question} {answer}");
    }
    let news = |news| records.iter().filter(|it| it["news"] == news).count();
    assert_eq!((news("seated"), news("seat_back"), news("left"), news("seat_lost")), (2, 2, 2, 0));
}

#[test]
fn a_guest_that_waits_for_its_turn_cannot_send() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let mut guest = Guest::come(port(&emulator));
    assert_eq!(guest.ask("K64"), "\x07", "it does not listen");
    assert_eq!(
        (guest.ask("O"), guest.ask("K0"), guest.ask("t1230")),
        ("\r".into(), "\x07".into(), "z\r".into())
    );
    guest.send("K64\r");
    assert_eq!((guest.ask("t1240"), guest.ask("K64")), ("\x07".into(), "\x07".into()));
    assert_eq!(guest.ask("C"), "\r");
    emulator.step(&["1ms"]);
    let log = emulator.run("trace", &["--bus", "open"]);
    assert!(!log.ok().contains("seat"), "it gave it back before time passed: {}", log.out);
}

#[test]
fn a_guest_that_hangs_or_dies_in_its_turn_loses_its_seat() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let port = port(&emulator);
    let (mut hangs, mut dies) = (Guest::open(port), Guest::open(port));
    hangs.send("K1\r");
    dies.send("K1\r");
    seated(&emulator, 2);
    std::thread::scope(|scope| {
        scope.spawn(move || assert_eq!(dies.hear(), "K1\r"));
        assert_eq!(emulator.step(&["1ms"]), "0.001000 s");
    });
    let log = emulator.run("trace", &["--bus", "open"]);
    for expected in ["guest1 has lost its seat", "guest2 has given its seat back"] {
        assert_eq!(log.ok().matches(expected).count(), 1, "{expected}: {}", log.out);
    }
    assert_eq!((hangs.hear(), hangs.ask("t1230")), ("K1\r".into(), "z\r".into()));
    hangs.send("K1\r");
    seated(&emulator, 1);
    let mut step = emulator.command("step", &["1ms"]);
    let mut step = step.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    assert_eq!(hangs.hear(), "K3E9\r", "it has a seat again");
    assert_eq!(promised(Duration::from_secs(2), || emulator.run("stop", &[])).code, Some(0));
    assert!(!step.wait().unwrap().success());
}

/// The emulator counts only the time in which it runs: after a suspension it must first read what guests have sent.
#[test]
fn a_guest_keeps_its_seat_while_the_emulator_is_suspended() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let mut guest = Guest::open(port(&emulator));
    guest.send("K64\r");
    seated(&emulator, 1);
    std::thread::scope(|scope| {
        let step = scope.spawn(|| emulator.step(&["1ms"]));
        assert_eq!(guest.hear(), "K64\r");
        emulator.signal("-STOP");
        std::thread::sleep(Duration::from_millis(5_500));
        emulator.signal("-CONT");
        guest.send("KFFFFFFFF\r");
        assert_eq!(step.join().unwrap(), "0.001000 s");
    });
    let log = emulator.run("trace", &["--bus", "open"]);
    assert!(!log.ok().contains("lost its seat"), "{}", log.out);
}

/// The guest requests one turn after the other at the same emulated time, so the step never ends by itself.
#[test]
fn other_clients_are_served_during_turns_of_guests() {
    let mut emulator = start(OPEN, &["--clock", "stepped"]);
    let mut guest = Guest::open(port(&emulator));
    guest.send("K1\r");
    seated(&emulator, 1);
    let mut step = emulator.command("step", &["24h"]);
    let mut step = step.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let turns = std::thread::spawn(move || {
        let mut received = [0; 64];
        while guest.0.read(&mut received).is_ok_and(|bytes| bytes > 0) && guest.0.write_all(b"K1\r").is_ok() {
        }
    });
    for _ in 0..3 {
        assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0001");
        assert_eq!(buses(&emulator)[0]["guests"].as_array().unwrap().len(), 1);
    }
    assert!(step.try_wait().unwrap().is_none(), "it is under way");
    // The emulator may log which guest the time waited for.
    assert_eq!(promised(Duration::from_secs(2), || emulator.run("stop", &[])).code, Some(0));
    assert_eq!(emulator.wait().code(), Some(0));
    turns.join().unwrap();
    assert!(!step.wait().unwrap().success());
}

#[test]
fn in_real_time_a_request_is_answered_at_its_time() {
    let emulator = start(OPEN, &[]);
    let port = port(&emulator);
    let (mut one, mut other) = (Guest::open(port), Guest::open(port));
    let (_, first) = turn(&mut one, 1);
    let (_, second) = turn(&mut one, 20_000);
    assert!(second >= first + 20_000, "{first} {second}");
    one.send("KFFFFFFFFFFFFFFFF\r");
    seated(&emulator, 1);
    assert_eq!(other.ask("t1230"), "z\r");
    assert_eq!(one.hear(), "t1230\r");
    assert!(granted(&one.hear()).unwrap() >= second);
}
