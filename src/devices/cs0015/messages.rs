//! What a CS0015 sends and receives as CANopen node, before anybody has told it otherwise: for databases of a bus.

use super::communication::{Communication, Factory, PDOS, Way};
use super::config::Cs0015Config;
use super::port::Program;
use super::registers::DEVICE;
use crate::can::{Message, Signal};
use crate::layout::Width;
use embedded_can::{Id, StandardId};

/// The upper bits of a COB-ID: there is none, or only on request.
const INVALID: u32 = 1 << 31;
const ID: u32 = 0x7FF;

/// Those of a device with these settings, which holds its factory values.
pub(super) fn of(config: &Cs0015Config) -> Vec<Message> {
    if config.program == Program::None {
        return Vec::new();
    }
    let mut communication = Communication::new(Factory { node: config.node_id, kbit_s: config.kbit_s });
    if let Program::BuiltIn { pdos, .. } = &config.program {
        pdos.iter().for_each(|(way, pdo, asked)| communication.ask(*way, *pdo, *asked));
        communication.reset();
    }
    let me = || vec![config.name.clone()];
    let message = |name: &str, cob_id: u32, is_sender: bool, signals: &[(&str, u8)], about: &str| {
        let id = Some(cob_id).filter(|cob_id| cob_id & INVALID == 0);
        let id: Id = StandardId::new((id? & ID) as u16)?.into();
        let signals = behind_one_another(signals);
        let length = signals.iter().map(|signal| signal.bits).sum::<u8>().div_ceil(8);
        let (senders, receivers) = if is_sender { (me(), Vec::new()) } else { (Vec::new(), me()) };
        let about = about.to_owned();
        Some(Message {
            name: format!("{}_{name}", config.name),
            id,
            length,
            senders,
            receivers,
            signals,
            about,
        })
    };
    let default = |index| DEVICE.object(index, 0).map_or(0, |object| object.default.at_node(config.node_id));
    let emergency = [("error_code", 16), ("error_register", 8), ("own", 40)];
    let state = [("state", 7), ("toggle", 1)];
    let request = [("command", 8), ("index", 16), ("sub_index", 8), ("data", 32)];
    let sdo = |sub| communication.sdo_cob_id(sub);
    let mut all = vec![
        message("EMCY", default(0x1014) & ID, true, &emergency, "Emergency (1014h)"),
        message("STATE", default(0x100E), true, &state, "Node guarding, boot-up (100Eh)"),
        message("SDO_REQUEST", sdo(1), false, &request, "Request to the object dictionary"),
        message("SDO_ANSWER", sdo(2), true, &request, "Answer of the object dictionary"),
    ];
    for (way, name, area) in [(Way::Receive, "RX_PDO", "rx_pdo"), (Way::Transmit, "TX_PDO", "tx_pdo")] {
        let first = DEVICE.area(area).map_or(0, |area| area.first);
        for pdo in 0..PDOS {
            let (cob_id, words) =
                (communication.pdo_cob_id(way, pdo), [1, 2, 3, 4].map(|word| format!("word_{word}")));
            let words = [0, 1, 2, 3].map(|word| (words[word].as_str(), 16));
            let made = message(&format!("{name}{}", pdo + 1), cob_id, way == Way::Transmit, &words, "");
            all.push(made.map(|mut made| {
                for (word, signal) in (0..).zip(&mut made.signals) {
                    signal.about = DEVICE.at(Width::Word, first + 8 * pdo as u32 + 2 * word).to_string();
                }
                made
            }));
        }
    }
    all.into_iter().flatten().collect()
}

/// Signals of so many bits each, one behind the other.
fn behind_one_another(signals: &[(&str, u8)]) -> Vec<Signal> {
    let mut first_bit = 0;
    let one = |(name, bits): &(&str, u8)| {
        let signal = Signal { name: (*name).to_owned(), first_bit, bits: *bits, about: String::new() };
        first_bit += bits;
        signal
    };
    signals.iter().map(one).collect()
}
