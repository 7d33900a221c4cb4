//! A CAN database (DBC) of messages, for analysis tools and `cantools`.

use crate::can::{BitOrder, Id, Message, Presence, Signal};
use std::collections::HashSet;
use std::fmt::Write;

/// Placeholder for a node outside the database.
const UNKNOWN_NODE: &str = "Vector__XXX";
/// Bit 31 of a number marks an identifier with 29 bits.
const EXTENDED: u32 = 1 << 31;

/// Generates a database of these messages. `about` describes the database.
#[must_use]
pub fn dbc(messages: &[Message], about: &str) -> String {
    let mut nodes: Vec<String> = Vec::new();
    for name in messages.iter().flat_map(|message| message.senders.iter().chain(&message.receivers)) {
        let name = identifier(name);
        if !nodes.contains(&name) {
            nodes.push(name);
        }
    }
    let mut text = format!("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: {}\n", nodes.join(" "));
    let names = unique(messages.iter().map(|message| message.name.as_str()));
    for (message, name) in messages.iter().zip(&names) {
        let sender = message.senders.first().map_or(UNKNOWN_NODE.to_owned(), |name| identifier(name));
        // Writing into a text cannot fail.
        let _ = writeln!(text, "\nBO_ {} {name}: {} {sender}", number(message.id), message.length);
        let receivers = list(&message.receivers, ",");
        for (signal, name) in message.signals.iter().zip(signal_names(message)) {
            let most = (1_u128 << signal.bits) - 1;
            let Signal { first_bit, bits, .. } = signal;
            let order = match signal.order {
                BitOrder::LowFirst => 1,
                BitOrder::HighFirst => 0,
            };
            let presence = match signal.presence {
                Presence::Always => String::new(),
                Presence::Selector => " M".to_owned(),
                Presence::If(value) => format!(" m{value}"),
            };
            let _ = writeln!(
                text,
                " SG_ {name}{presence} : {first_bit}|{bits}@{order}+ (1,0) [0|{most}] \"\" {receivers}"
            );
        }
    }
    text.push('\n');
    for message in messages.iter().filter(|message| message.senders.len() > 1) {
        let _ = writeln!(text, "BO_TX_BU_ {} : {};", number(message.id), list(&message.senders, ","));
    }
    let _ = writeln!(text, "\nCM_ {};", quoted(about));
    for message in messages {
        let id = number(message.id);
        if !message.about.is_empty() {
            let _ = writeln!(text, "CM_ BO_ {id} {};", quoted(&message.about));
        }
        for (signal, name) in message.signals.iter().zip(signal_names(message)) {
            if !signal.about.is_empty() {
                let _ = writeln!(text, "CM_ SG_ {id} {name} {};", quoted(&signal.about));
            }
        }
    }
    text
}

fn number(id: Id) -> u32 {
    match id {
        Id::Standard(id) => id.as_raw().into(),
        Id::Extended(id) => id.as_raw() | EXTENDED,
    }
}

fn signal_names(message: &Message) -> Vec<String> {
    unique(message.signals.iter().map(|signal| signal.name.as_str()))
}

/// A list of the names of nodes.
fn list(names: &[String], between: &str) -> String {
    let names: Vec<_> = names.iter().map(|name| identifier(name)).collect();
    if names.is_empty() { UNKNOWN_NODE.to_owned() } else { names.join(between) }
}

/// The name as an identifier of C, as the format requires.
fn identifier(name: &str) -> String {
    let mut text: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect();
    if text.starts_with(|c: char| c.is_ascii_digit()) || text.is_empty() {
        text.insert(0, '_');
    }
    text
}

/// Converts names to identifiers, each once.
fn unique<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut taken = HashSet::new();
    let one = |name: &str| {
        let base = identifier(name);
        let mut name = base.clone();
        let mut next = 2;
        while !taken.insert(name.clone()) {
            name = format!("{base}_{next}");
            next += 1;
        }
        name
    };
    names.map(one).collect()
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "/").replace('"', "'"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{ExtendedId, StandardId};

    #[test]
    fn names_are_identifiers_and_each_is_there_once() {
        let signal = |name: &str, first_bit| Signal {
            name: name.to_owned(),
            first_bit,
            bits: 16,
            order: BitOrder::LowFirst,
            presence: Presence::Always,
            about: "a \"word\"".to_owned(),
        };
        let message = |id: Id, senders: &[&str]| Message {
            name: "state-1".to_owned(),
            id,
            length: 8,
            senders: senders.iter().map(|name| (*name).to_owned()).collect(),
            receivers: vec!["7 up".to_owned()],
            signals: vec![signal("a b", 0), signal("a-b", 16)],
            about: String::new(),
        };
        let messages = [
            message(StandardId::new(0x181).unwrap().into(), &["one", "two"]),
            message(ExtendedId::new(0x181).unwrap().into(), &[]),
        ];
        let text = dbc(&messages, "a bus");
        for line in [
            "BU_: one two _7_up",
            "BO_ 385 state_1: 8 one",
            "BO_ 2147484033 state_1_2: 8 Vector__XXX",
            " SG_ a_b : 0|16@1+ (1,0) [0|65535] \"\" _7_up",
            " SG_ a_b_2 : 16|16@1+ (1,0) [0|65535] \"\" _7_up",
            "BO_TX_BU_ 385 : one,two;",
            "CM_ SG_ 385 a_b_2 \"a 'word'\";",
        ] {
            assert!(text.lines().any(|it| it == line), "{line}\n{text}");
        }
    }
}
