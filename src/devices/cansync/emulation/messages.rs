//! Descriptions of all frames of a CANsync bus, for bus databases.
//!
//! The descriptions contain the words of process data as words only, because programs set their mapping to
//! values at run time. Parameter jobs and up-/downloads have one identifier for each slave; bit 7 of the
//! first byte distinguishes them.

use super::frames::{Channel, FrameKind, LAST_SLAVE};
use crate::can::{BitOrder, Message, Presence, Signal};
use embedded_can::StandardId;

/// Sender of reference values, jobs and action commands.
const MASTER: &str = "master";
/// Values of the selector in jobs.
const PARAMETER: Presence = Presence::If(0);
const UP_DOWNLOAD: Presence = Presence::If(1);

/// Returns the frames of all 32 slave numbers, even if the bus has no such slave: a master may send requests
/// to any number.
pub(super) fn all() -> Vec<Message> {
    let action = vec![
        low("slave_group", 0, 32, "Bit n: the command is for slave n"),
        low("command", 32, 8, "16#01 control word, 16#02 SYNC mode"),
        low("data_byte", 40, 8, "With command 16#02: 1 on, otherwise off"),
        low("data_word", 48, 16, "With command 16#01: the control word"),
    ];
    let every = (0..=LAST_SLAVE).map(slave).collect();
    let action = message(FrameKind::Action, "ACTION", MASTER.into(), every, action, "Action command".into());
    (0..=LAST_SLAVE).flat_map(of_slave).chain(action).collect()
}

fn of_slave(number: u8) -> impl Iterator<Item = Message> {
    let process = Channel::ALL.into_iter().flat_map(move |channel| {
        let n = channel.number();
        [
            message(
                FrameKind::ReferenceValue(channel, number),
                &format!("WRC{n}_{number}"),
                MASTER.into(),
                vec![slave(number)],
                words(0),
                format!("Reference values for all slaves; slave {number} answers"),
            ),
            message(
                FrameKind::ActualValue(channel, number),
                &format!("RDC{n}_{number}"),
                slave(number),
                vec![MASTER.into()],
                words(0),
                format!("Actual values of slave {number}"),
            ),
        ]
    });
    let services = [
        message(
            FrameKind::Job(number),
            &format!("JOB_{number}"),
            MASTER.into(),
            vec![slave(number)],
            job(),
            "Parameter job, 4 bytes to read, 6 or 8 to write; or up-/download job, 2 or 8 bytes".into(),
        ),
        message(
            FrameKind::Response(number),
            &format!("RESPONSE_{number}"),
            slave(number),
            vec![MASTER.into()],
            response(),
            "Answer to a job, 2 to 8 bytes".into(),
        ),
    ];
    process.chain(services).flatten()
}

fn job() -> Vec<Signal> {
    let mut signals = vec![
        Signal {
            presence: Presence::Selector,
            ..low("up_download", 7, 1, "0 parameter job, 1 up-/download")
        },
        number(),
        Signal { presence: PARAMETER, ..low("element", 4, 3, "7: value of the parameter") },
        Signal { presence: UP_DOWNLOAD, ..low("download", 6, 1, "1 download, 0 upload") },
        Signal { presence: UP_DOWNLOAD, ..low("mode", 4, 2, "1 begin, 2 block, 3 last block") },
    ];
    signals.extend(words(16));
    signals
}

fn response() -> Vec<Signal> {
    let mut signals = vec![
        low("up_download", 7, 1, "0 answer to a parameter job, 1 to an up-/download job"),
        low("busy", 6, 1, "The slave has not finished the job"),
        low("error", 5, 1, "word_1 is the error number"),
        number(),
    ];
    signals.extend(words(16));
    signals
}

/// Signal for the parameter number, or for the length or offset of an up-/download. It consists of bits 3 to
/// 0 of the first byte, followed by the second byte.
fn number() -> Signal {
    Signal {
        order: BitOrder::HighFirst,
        ..low("number", 3, 12, "Number of the parameter; length or offset of a block")
    }
}

/// Returns the words from bit `first_bit` to the end of the longest frame. A shorter frame ends before the
/// last words.
fn words(first_bit: u8) -> Vec<Signal> {
    (1..)
        .zip((first_bit..64).step_by(16))
        .map(|(word, bit)| low(&format!("word_{word}"), bit, 16, ""))
        .collect()
}

fn low(name: &str, first_bit: u8, bits: u8, about: &str) -> Signal {
    let (order, presence) = (BitOrder::LowFirst, Presence::Always);
    Signal { name: name.to_owned(), first_bit, bits, order, presence, about: about.to_owned() }
}

fn slave(number: u8) -> String {
    format!("slave_{number}")
}

fn message(
    kind: FrameKind,
    name: &str,
    sender: String,
    receivers: Vec<String>,
    signals: Vec<Signal>,
    about: String,
) -> Option<Message> {
    let id = StandardId::new(kind.id())?.into();
    Some(Message { name: name.to_owned(), id, length: 8, senders: vec![sender], receivers, signals, about })
}
