//! Logs as other programs write them. Each form is that of the program's own writer.

use super::*;
use crate::journal::candump::FrameText;

fn shown(it: &Logged) -> String {
    let direction = match it.direction {
        None => "",
        Some(Direction::Received) => " received",
        Some(Direction::Transmitted) => " transmitted",
    };
    format!("{} {} {} {}{direction}", it.at, it.time_us, it.interface, FrameText(&it.frame))
}

fn read(text: &str) -> (Vec<String>, Vec<(usize, String)>) {
    let Recording { frames, skipped, .. } = read_text(text).unwrap_or_else(|error| panic!("{error}"));
    (frames.iter().map(shown).collect(), skipped.into_iter().map(|it| (it.at, it.reason)).collect())
}

#[test]
fn a_log_of_can_utils() {
    let log = "# recorded on the machine\r\n(0000000002.001234) drives 583#7900210000000000\r\n\r\n\
               (1436509052.249713) can0 00000123#R4 T\r\n(1436509052.25) can0 7FF#\r\n\
               (1436509053.000000) can0 20000004#0004000000000000\r\n(1436509053.1) can0 123##1AABB\r\n\
               (1436509053.2) can1 123#1122334455667788_E R\r\n";
    let (frames, skipped) = read(log);
    assert_eq!(
        frames,
        [
            "2 2001234 drives 583#7900210000000000",
            "4 1436509052249713 can0 00000123#R4 transmitted",
            "5 1436509052250000 can0 7FF#",
            "8 1436509053200000 can1 123#1122334455667788 received",
        ]
    );
    let reasons: Vec<_> = skipped.iter().map(|(at, reason)| (*at, &reason[..11])).collect();
    assert_eq!(reasons, [(6, "an error me"), (7, "a frame of ")]);
}

#[test]
fn lines_that_candump_shows_on_a_terminal() {
    let log = " (1436509052.249713)  can0  123   [2]  11 22\n (1436509052.3)  can0  TX - -  0000123A   [0] \n \
               (1436509052.4)  can0  124   [4]  remote request\n (1436509052.5)  can0  125  [2]  AA BB   '..'\n \
               (1436509052.6)  can0  20000080   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n \
               (1436509052.7)  can0  126  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B\n";
    let (frames, skipped) = read(log);
    assert_eq!(
        frames,
        [
            "1 1436509052249713 can0 123#1122",
            "2 1436509052300000 can0 0000123A# transmitted",
            "3 1436509052400000 can0 124#R4",
            "4 1436509052500000 can0 125#AABB",
        ]
    );
    assert_eq!(skipped.iter().map(|(at, _)| *at).collect::<Vec<_>>(), [5, 6]);
    // A remote frame of any length, and binary digits.
    let (frames, _) = read(" (1436509052.1)  can0  701   [0]  remote request\n");
    assert_eq!(frames, ["1 1436509052100000 can0 701#R"]);
    for binary in ["[1]  01000001", "[2]  01000001 01000010"] {
        let error = read_text(&format!(" (1436509052.1)  can0  123   {binary}\n")).unwrap_err();
        assert!(error.line == 1 && error.right.contains("two hexadecimal digits"), "{error}");
    }
    let error = read_text("  can0  123   [2]  11 22\n").unwrap_err();
    assert!(error.line == 1 && error.right.contains("candump -ta"), "{error}");
}

/// The clock of a public recording becomes negative when the program sets it.
#[test]
fn negative_times_of_savvycan_begin_at_0() {
    let head = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n";
    let row = |time: &str| format!("{time},00000121,false,Rx,0,1,8F,\n");
    let (frames, _) =
        read(&(head.to_owned() + &row("22358552") + &row("-364210") + &row("-359735") + &row("5")));
    let times: Vec<_> = frames.iter().map(|it| it.split(' ').nth(1).unwrap()).collect();
    assert_eq!(times, ["22722762", "0", "4475", "364215"]);
    for (first, second) in
        [("-18446744073709551615", "1"), ("-18446744073709551616", "1"), ("--1", "1"), ("-", "1")]
    {
        assert!(read_text(&(head.to_owned() + &row(first) + &row(second))).is_err(), "{first}");
    }
}

#[test]
fn files_of_gvret_and_savvycan() {
    let new = "\u{FEFF}Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\r\n\
               166064000,0000021A,false,Rx,0,8,FE,36,12,FE,69,05,07,AD,\r\n\
               166065000,18FEF100,true,Tx,1,2,01,02,\r\n166066000,00000100,false,Rx,0,12,01,\r\n";
    let (frames, skipped) = read(new);
    assert_eq!(
        frames,
        ["2 166064000 can0 21A#FE3612FE690507AD received", "3 166065000 can1 18FEF100#0102 transmitted"]
    );
    assert_eq!(skipped.len(), 1);
    let old = "Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n1000,123,false,0,1,AA,,,,,,,\n";
    assert_eq!(read(old).0, ["2 1000 can0 123#AA"]);
    for (row, right) in [("1000,800,false,0,0,", "up to 7FF"), ("1000,1,maybe,0,0,", "a row"), ("x", "a row")]
    {
        let error = read_text(&format!("{}{row}\n", &old[..old.find('\n').unwrap() + 1])).unwrap_err();
        assert!(error.line == 2 && error.right.contains(right), "{row}: {error}");
    }
}

#[test]
fn an_empty_log_and_a_log_that_was_cut_off() {
    for empty in ["", "\n\n", "# nothing\n", "\u{FEFF}"] {
        assert_eq!(read_text(empty), Ok(Recording::default()));
    }
    let (frames, skipped) = read("(1.000000) can0 123#AA\n(2.000000) can0 12");
    assert_eq!((frames.len(), skipped.len(), skipped[0].0), (1, 1, 2));
    assert!(read_text("(2.000000) can0 12").is_err(), "it is the only line");
}

#[test]
fn an_invalid_log_is_refused_with_its_line() {
    for (line, text) in [
        ("hello", "candump log"),
        ("(1.) can0 123#", "candump log"),
        ("(1.000000) can0 123", "candump log"),
        ("(1.000000) can0 123# X", "candump log"),
        ("(99999999999999999999.000000) can0 123#", "candump log"),
        ("(1.000000) can0 12#", "three digits"),
        ("(1.000000) can0 800#", "three digits"),
        ("(1.000000) can0 40000000#", "three digits"),
        ("(1.000000) can0 123#1", "two hexadecimal digits"),
        ("(1.000000) can0 123#+1", "two hexadecimal digits"),
        ("(1.000000) can0 123#1122334455667788_8", "two hexadecimal digits"),
        ("(1.000000) can0 123#000000000000000000", "up to eight"),
        ("(1.000000) can0 123#R9", "0 to 8"),
        ("(1.000000) can0 123 [2] 11", "fewer bytes"),
    ] {
        let error = read_text(&format!("(0000000000.000000) a 000#\n{line}\n")).unwrap_err();
        assert!(error.line == 2 && error.to_string().contains(text), "{line}: {error}");
    }
}

#[test]
fn records_of_a_trace_are_frames_and_telegrams() {
    let text = r#"{"v":1,"seq":0,"time_us":5,"kind":"state","plc":"gw","node":1}
{"v":1,"seq":1,"time_us":10,"kind":"dp_telegram","bus":"dp","da":5,"sa":2,"fc":73,"octets":0,"first":"","data":"","sum":1,"from":"gw:dp"}
{"v":1,"seq":2,"time_us":20,"kind":"dp_short","bus":"dp","is_token":false,"from":"gw:dp"}
{"v":1,"seq":3,"time_us":30,"kind":"dp_short","bus":"dp","is_token":true,"da":3,"sa":2,"from":"gw:dp"}
{"v":1,"seq":4,"time_us":40,"kind":"dp_telegram","bus":"dp","da":5,"sa":2,"fc":125,"octets":5,"first":"01020304","sum":1}
{"v":1,"seq":5,"time_us":50,"kind":"can_frame","bus":"open","id":291,"extended":false,"remote":false,"length":1,"data":"AB"}
{"v":1,"kind":"gap","lost":7}
"#;
    let recording = read_text(text).unwrap();
    let telegrams: Vec<_> =
        recording.telegrams.iter().map(|it| (it.at, it.time_us, it.frame.clone())).collect();
    let request = vec![0x10, 5, 2, 0x49, 0x50, 0x16];
    assert_eq!(telegrams, [(2, 10, request), (3, 20, vec![0xE5]), (4, 30, vec![0xDC, 3, 2])]);
    let frames: Vec<_> = recording.frames.iter().map(|it| FrameText(&it.frame).to_string()).collect();
    assert_eq!((frames, recording.skipped.len()), (vec!["123#AB".to_owned()], 1));
    assert_eq!(recording.skipped[0].at, 5);
    for wrong in ["{\"kind\":\"dp_telegram\",\"bus\":\"dp\",\"data\":\"\"}", "{\"kind\":3}", "{\"v\":1"] {
        assert_eq!(read_text(&format!("{wrong}\n")).unwrap_err().line, 1, "{wrong}");
    }
}

proptest::proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn any_frame_is_read_as_it_was_written(
        frame in crate::can::reference::frame(), time_us in proptest::num::u64::ANY,
    ) {
        let (seconds, us) = (time_us / 1_000_000, time_us % 1_000_000);
        let line = format!("({seconds:010}.{us:06}) can0 {}", FrameText(&frame));
        let read = read_text(&line).map(|recording| recording.frames);
        let wanted = Logged { at: 1, time_us, interface: "can0".to_owned(), direction: None, frame };
        proptest::prop_assert_eq!(read, Ok(vec![wanted]), "{}", line);
    }
}
