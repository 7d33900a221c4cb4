//! A CAN database (DBC) of messages, for analysis tools and `cantools`.

use super::names::UsedNames;
use crate::can::{BitOrder, Id, Message, Presence, Signal};
use std::collections::{HashMap, HashSet};
use std::fmt::Write;

/// Placeholder for a node outside the database.
const UNKNOWN_NODE: &str = "Vector__XXX";
/// Words of the format, which cannot be names, and the placeholder for a node that is not in the database.
const KEYWORDS: &str = "BA_ BA_DEF_ BA_DEF_DEF_ BA_DEF_DEF_REL_ BA_DEF_REL_ BA_DEF_SGTYPE_ BA_REL_ BA_SGTYPE_ BO_ BO_TX_BU_ BS_ BU_ \
    BU_BO_REL_ BU_EV_REL_ BU_SG_REL_ CAT_ CAT_DEF_ CM_ DUMMY_NODE_VECTOR0 DUMMY_NODE_VECTOR1 DUMMY_NODE_VECTOR2 \
    DUMMY_NODE_VECTOR3 DUMMY_NODE_VECTOR8000 DUMMY_NODE_VECTOR8001 DUMMY_NODE_VECTOR8002 DUMMY_NODE_VECTOR8003 ENUM \
    ENVVAR_DATA_ EV_ EV_DATA_ FILTER FLOAT HEX INT NS_ NS_DESC_ SGTYPE_ SGTYPE_VAL_ SG_ SG_MUL_VAL_ SIGTYPE_VALTYPE_ \
    SIG_GROUP_ SIG_TYPE_REF_ SIG_VALTYPE_ STRING VAL_ VAL_TABLE_ VERSION Vector__XXX";
/// Bit 31 of a number marks an identifier with 29 bits.
const EXTENDED: u32 = 1 << 31;

/// Generates a database of these messages. `about` describes the database.
#[must_use]
pub fn dbc(messages: &[Message], about: &str) -> String {
    let nodes = Nodes::of(messages);
    let mut text = format!("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: {}\n", nodes.names.join(" "));
    let names = unique(messages.iter().map(|message| message.name.as_str()));
    for (message, name) in messages.iter().zip(&names) {
        let sender = nodes.list(message.senders.get(..1).unwrap_or_default(), ",");
        // Writing into a text cannot fail.
        let _ = writeln!(text, "\nBO_ {} {name}: {} {sender}", number(message.id), message.length);
        let receivers = nodes.list(&message.receivers, ",");
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
        let _ = writeln!(text, "BO_TX_BU_ {} : {};", number(message.id), nodes.list(&message.senders, ","));
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

/// The nodes that send or receive a message.
struct Nodes<'a> {
    /// Names in the database, in the order of the messages.
    names: Vec<String>,
    /// Place in `names` of each name in the plant.
    places: HashMap<&'a str, usize>,
}

impl<'a> Nodes<'a> {
    fn of(messages: &'a [Message]) -> Self {
        let (mut known, mut in_order) = (HashSet::new(), Vec::new());
        for name in messages.iter().flat_map(|message| message.senders.iter().chain(&message.receivers)) {
            if known.insert(name.as_str()) {
                in_order.push(name.as_str());
            }
        }
        let names = unique(in_order.iter().copied());
        Nodes { places: in_order.into_iter().zip(0..).collect(), names }
    }

    /// Returns a list of the names in the database.
    fn list(&self, names: &[String], between: &str) -> String {
        let of = |name: &String| self.places.get(name.as_str()).and_then(|place| self.names.get(*place));
        let names: Vec<&str> = names.iter().filter_map(of).map(String::as_str).collect();
        if names.is_empty() { UNKNOWN_NODE.to_owned() } else { names.join(between) }
    }
}

/// Returns the name as an identifier of C, as the format requires, with `_` appended if it is a word of the format.
fn identifier(name: &str) -> String {
    let mut text: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect();
    if text.starts_with(|c: char| c.is_ascii_digit()) || text.is_empty() {
        text.insert(0, '_');
    }
    if KEYWORDS.split_whitespace().any(|word| word == text) {
        text.push('_');
    }
    text
}

/// Converts names to identifiers, each once.
fn unique<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut used = UsedNames::default();
    names.map(|name| used.add(identifier(name))).collect()
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "/").replace('"', "'"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{ExtendedId, StandardId};

    /// The database has other names for words of the format, and for names that differ only in characters that the
    /// format does not have. Two programs would read such names in different ways.
    #[test]
    fn words_of_the_format_are_no_names() {
        assert_eq!(
            ["SG_", "Vector__XXX", "VAL-", "sg_", "INT"].map(identifier),
            ["SG__", "Vector__XXX_", "VAL__", "sg_", "INT_"]
        );
        let message = |name: &str, id, sender: &str, receiver: &str| Message {
            name: name.to_owned(),
            id: StandardId::new(id).unwrap().into(),
            length: 1,
            senders: vec![sender.to_owned()],
            receivers: vec![receiver.to_owned()],
            signals: Vec::new(),
            about: String::new(),
        };
        let messages = [message("BO_", 1, "a-b", "BU_"), message("CM_", 2, "a_b", "a-b")];
        let text = dbc(&messages, "a bus");
        for line in ["BU_: a_b BU__ a_b_2", "BO_ 1 BO__: 1 a_b", "BO_ 2 CM__: 1 a_b_2"] {
            assert!(text.lines().any(|it| it == line), "{line}\n{text}");
        }
    }

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
