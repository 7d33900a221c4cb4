use super::*;
use crate::can::{ExtendedId, Frame, Payload, StandardId};
use crate::journal::Format;
use crate::journal::candump::FrameText;
use crate::journal::recording::{Direction, Logged, Recording, read_text};
use proptest::prelude::*;

/// A block in the requested byte order.
fn block(kind: u32, body: &[u8], is_big: bool, out: &mut Vec<u8>) {
    let word = |value: u32| if is_big { value.to_be_bytes() } else { value.to_le_bytes() };
    let length = word(body.len() as u32 + 12);
    [word(kind), length].iter().for_each(|bytes| out.extend(bytes));
    out.extend(body);
    out.extend(length);
}

/// Codes and values.
type Options<'a> = &'a [(u16, &'a [u8])];

/// Returns a log with one interface of these options and one packet.
fn log(is_big: bool, link: u16, options: Options, ticks: u64, packet: &[u8]) -> Vec<u8> {
    log_with(is_big, link, options, ticks, packet, &[])
}

/// Returns a log as [`log`] does, and gives the packet block options.
fn log_with(
    is_big: bool,
    link: u16,
    options: Options,
    ticks: u64,
    packet: &[u8],
    packet_options: &[u8],
) -> Vec<u8> {
    let half = |value: u16| if is_big { value.to_be_bytes() } else { value.to_le_bytes() };
    let word = |value: u32| if is_big { value.to_be_bytes() } else { value.to_le_bytes() };
    let mut out = Vec::new();
    let section = [&word(BYTE_ORDER)[..], &half(1), &half(0), &[0xFF; 8]].concat();
    block(SECTION, &section, is_big, &mut out);
    let mut interface = [&half(link)[..], &[0; 6]].concat();
    for (code, value) in options {
        interface.extend([half(*code), half(value.len() as u16)].concat());
        interface.extend(*value);
        interface.resize(interface.len().next_multiple_of(4), 0);
    }
    block(INTERFACE, &interface, is_big, &mut out);
    // Statistics, which are passed over.
    block(5, &[0; 12], is_big, &mut out);
    let words = [0, (ticks >> 32) as u32, ticks as u32, packet.len() as u32, packet.len() as u32];
    let mut body = words.map(word).concat();
    body.extend(packet);
    body.resize(body.len().next_multiple_of(4), 0);
    body.extend(packet_options);
    block(PACKET, &body, is_big, &mut out);
    out
}

fn shown(logged: &Logged) -> String {
    format!("{} {} {}", logged.time_us, logged.interface, FrameText(&logged.frame))
}

const FRAME: [u8; 10] = [0, 0, 1, 0x23, 2, 0, 0, 0, 0xBE, 0xEF];

#[test]
fn times_of_all_resolutions_and_orders() {
    let cases: [(bool, Options, u64, &str); 5] = [
        (false, &[], 1_234_567, "1234567 can0 123#BEEF"),
        (true, &[(NAME, b"open"), (RESOLUTION, &[9])], 1_234_567_999, "1234567 open 123#BEEF"),
        (false, &[(NAME, b"x"), (RESOLUTION, &[0x80 | 10])], 1024 + 512, "1500000 x 123#BEEF"),
        (false, &[(OFFSET, &10_i64.to_le_bytes())], 5, "10000005 can0 123#BEEF"),
        (true, &[(OFFSET, &(-1_i64).to_be_bytes()), (0, &[])], 1_000_005, "5 can0 123#BEEF"),
    ];
    for (is_big, options, ticks, wanted) in cases {
        let recording = read(&log(is_big, SOCKETCAN, options, ticks, &FRAME)).unwrap();
        assert_eq!(recording.frames.iter().map(shown).collect::<Vec<_>>(), [wanted]);
    }
}

#[test]
fn foreign_packets_are_skipped_and_damaged_ones_refused() {
    let recorded = |link, options: Options, packet: &[u8]| read(&log(false, link, options, 0, packet));
    let refused =
        |link, options: Options, packet: &[u8]| recorded(link, options, packet).unwrap_err().to_string();
    for (link, packet, text) in [
        (SOCKETCAN, &[0, 0, 1, 0x23, 12, 4, 0, 0, 1][..], "CAN FD"),
        (SOCKETCAN, &[0x20, 0, 0, 1, 8, 0, 0, 0], "error message"),
        (1, &FRAME, "'eth0' with link type 1"),
    ] {
        let Recording { frames, skipped, .. } = recorded(link, &[(NAME, b"eth0")], packet).unwrap();
        assert!(frames.is_empty() && skipped.len() == 1 && skipped[0].at > 0, "{skipped:?}");
        assert!(skipped[0].reason.contains(text), "{skipped:?}");
    }
    for (packet, text) in [
        (&[0, 0, 8, 0, 0, 0, 0, 0][..], "7FF"),
        (&[0, 0, 1, 0x23, 2, 0, 0, 0, 1], "less data"),
        (&[0, 0, 1], "eight bytes"),
    ] {
        let error = refused(SOCKETCAN, &[], packet);
        assert!(error.starts_with("byte ") && error.contains(text), "{error}");
    }
    assert!(refused(SOCKETCAN, &[(RESOLUTION, &[127])], &FRAME).contains("no such time"));
    assert!(refused(SOCKETCAN, &[(OFFSET, &(-1_i64).to_le_bytes())], &FRAME).contains("no such time"));
    for (log, text) in [(&b"hello"[..], "no section"), (&[0x0A, 0x0D, 0x0D, 0x0A, 28, 0], "no section")] {
        assert!(read(log).unwrap_err().to_string().contains(text));
    }
    let mut old = log(false, SOCKETCAN, &[], 0, &FRAME);
    block(TIMELESS_PACKET, &[0; 4], false, &mut old);
    assert!(read(&old).unwrap_err().to_string().contains("old kind"));
}

#[test]
fn telegrams_are_read_unless_a_capture_has_cut_them_off() {
    let telegram = [0x10, 5, 2, 0x49, 0x50, 0x16];
    let recording = read(&log(false, PROFIBUS_DL, &[], 7, &telegram)).unwrap();
    let [Logged { time_us, frame, .. }] = &recording.telegrams[..] else { panic!("{recording:?}") };
    assert_eq!((*time_us, frame.as_slice()), (7, &telegram[..]));
    let mut short = log(false, PROFIBUS_DL, &[], 7, &telegram);
    // A packet has its captured length and then its original length. After the data follow the options and the length
    // of the block.
    let at = short.len() - 4 - 8;
    short[at - 4..at].copy_from_slice(&20_u32.to_le_bytes());
    let recording = read(&short).unwrap();
    assert!(recording.telegrams.is_empty() && recording.skipped[0].reason.contains("without all its octets"));
    let long = read(&log(false, PROFIBUS_DL, &[], 7, &[0; 256])).unwrap();
    assert_eq!((long.telegrams.len(), long.skipped.len()), (0, 1));
}

#[test]
fn packets_can_have_a_direction() {
    let direction = |options: &[u8]| {
        read(&log_with(false, SOCKETCAN, &[], 0, &FRAME, options)).unwrap().frames[0].direction
    };
    let comment = [1, 0, 3, 0, b'a', b'b', b'c', 0];
    let flags = |bits| [PACKET_FLAGS as u8, 0, 4, 0, bits, 0, 0, 0];
    assert_eq!(direction(&flags(1)), Some(Direction::Received));
    assert_eq!(direction(&[&comment[..], &flags(2)].concat()), Some(Direction::Transmitted));
    for none in [&flags(0)[..], &comment, &[0, 0, 0, 0], &[9, 0, 200, 0]] {
        assert_eq!(direction(none), None, "{none:?}");
    }
}

#[test]
fn each_bus_is_an_interface() {
    let buses =
        vec![("open".into(), Link::Can), ("a name of more than 15 characters".into(), Link::Profibus)];
    let mut out = Vec::new();
    Pcapng::new(buses).begin(&mut out);
    assert!(is_one(&out) && read(&out) == Ok(Recording::default()));
    let links = [28 + 8, 28 + 40 + 8].map(|at| u16::from_le_bytes([out[at], out[at + 1]]));
    assert_eq!(links, [SOCKETCAN, PROFIBUS_DL]);
    let blocks = [28, 12 + 8 + 8 + 8 + 4, 12 + 8 + 4 + 36 + 8 + 4];
    assert_eq!(out.len(), blocks.iter().sum::<usize>());
}

/// Returns a frame of any kind.
fn frames() -> impl Strategy<Value = Frame> {
    let (standard, extended) = (0..0x800_u16, 0..0x2000_0000_u32);
    (any::<bool>(), standard, extended, any::<[u8; 8]>(), 0..=8_usize, any::<bool>()).prop_map(
        |(is_long, standard, extended, data, length, is_remote)| {
            let id = if is_long {
                ExtendedId::new(extended).unwrap().into()
            } else {
                crate::can::Id::from(StandardId::new(standard).unwrap())
            };
            if is_remote {
                Frame::remote(id, length).unwrap()
            } else {
                Frame::new(id, Payload::from_padded(data, length))
            }
        },
    )
}

/// Logs in either format are read or refused. A frame that was read from a line does not change when it is written and
/// read again.
#[test]
fn fuzz_log() {
    crate::fuzz("log", |bytes| {
        let _ = read(bytes);
        let Ok(text) = str::from_utf8(bytes) else { return };
        for Logged { interface, frame, .. } in read_text(text).unwrap_or_default().frames {
            let line = format!("(1.000000) {interface} {}\n", FrameText(&frame));
            let again = read_text(&line).unwrap().frames.pop();
            assert_eq!(again, Some(Logged { at: 1, time_us: 1_000_000, interface, direction: None, frame }));
        }
    });
}

proptest! {
    #![proptest_config(crate::property_tests())]

    /// Frames that were written to a file can be read again.
    #[test]
    fn frames_come_back(frame in frames(), ticks in 0..u64::MAX / 1_000_000) {
        let read = read(&log(false, SOCKETCAN, &[(NAME, b"open")], ticks, &write::packet(&frame))).unwrap();
        let at = read.frames.first().map_or(0, |first| first.at);
        prop_assert!(at > 0, "the first block is not a packet block");
        let wanted = Logged { at, time_us: ticks, interface: "open".into(), direction: None, frame };
        prop_assert_eq!(read.frames, vec![wanted]);
    }

    /// Any damaged log is read or refused.
    #[test]
    fn damaged_logs_are_read_or_refused(at in 0..200_usize, byte: u8, cut in 0..200_usize) {
        let mut damaged = log(at % 2 == 0, SOCKETCAN, &[(NAME, b"open"), (RESOLUTION, &[9])], 5, &FRAME);
        if let Some(there) = damaged.get_mut(at) {
            *there = byte;
        }
        damaged.truncate(damaged.len().saturating_sub(cut));
        let _ = read(&damaged);
    }
}
