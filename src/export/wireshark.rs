//! A dissector for Wireshark in Lua: decoders of the buses, and the messages of each bus of a plant.

use crate::can::{Arbitration, BitOrder, Message, Presence, Signal};
use crate::plain_text::without_interpreted;
use std::fmt::Write;

/// A bus of the plant.
#[derive(Debug)]
pub struct DissectedBus<'a> {
    /// Name of the bus, and of its interface in a capture.
    pub name: &'a str,
    /// Name of the decoder.
    pub kind: &'a str,
    /// True if packets are frames of CAN; otherwise they are telegrams of PROFIBUS.
    pub is_can: bool,
    /// The messages of the bus that its devices define.
    pub messages: Vec<Message>,
}

/// Generates a dissector of these buses. `decoders` is the Lua code that fills the table `decoders` with a decoder for
/// each kind of buses. `about` describes the file.
#[must_use]
pub fn wireshark<'a>(
    buses: impl IntoIterator<Item = DissectedBus<'a>>,
    decoders: &str,
    about: &str,
) -> String {
    // The name of a file may contain a line end, which ends a comment of Lua.
    let about = without_interpreted(about);
    let mut text =
        format!("-- {about}.\n\n{}{decoders}\nlocal buses = {{\n", include_str!("wireshark/begin.lua"));
    for (bus, number) in buses.into_iter().zip(1..) {
        let DissectedBus { name, kind, is_can, messages } = bus;
        // Writing into a text cannot fail. Keys of preferences consist of lower-case letters and digits only.
        let _ = writeln!(
            text,
            "    {{\n        name = {}, key = \"bus{number}\", kind = {}, is_can = {is_can},\n        messages = {{",
            quoted(name),
            quoted(kind)
        );
        messages.iter().for_each(|message| text += &row(message));
        text += "        },\n    },\n";
    }
    text + "}\n\n" + include_str!("wireshark/end.lua")
}

/// Returns the row of a message, with its signals.
fn row(message: &Message) -> String {
    let field = Arbitration::new(message.id, false);
    let extended = if field.is_extended() { "x" } else { "" };
    let mut text = format!(
        "            [\"{extended}{}\"] = {{ name = {}, about = {}, signals = {{",
        field.number(),
        quoted(&message.name),
        quoted(&message.about)
    );
    message.signals.iter().for_each(|it| text += &signal(it));
    text + "} },\n"
}

fn signal(signal: &Signal) -> String {
    let order = match signal.order {
        BitOrder::LowFirst => "",
        BitOrder::HighFirst => ", high = true",
    };
    let presence = match signal.presence {
        Presence::Always => String::new(),
        Presence::Selector => ", selects = true".to_owned(),
        Presence::If(value) => format!(", only = {value}"),
    };
    let Signal { name, first_bit, bits, about, .. } = signal;
    format!(
        "{{ name = {}, first = {first_bit}, bits = {bits}{order}{presence}, about = {} }}, ",
        quoted(name),
        quoted(about)
    )
}

/// Converts a text to a string of Lua. All characters except printable ASCII are written as the numbers of their bytes.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for byte in text.bytes() {
        match byte {
            b'"' | b'\\' => quoted.extend(['\\', char::from(byte)]),
            b' '..=b'~' => quoted.push(char::from(byte)),
            other => {
                let _ = write!(quoted, "\\{other:03}");
            }
        }
    }
    quoted + "\""
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_head_is_one_comment() {
        let text = wireshark([], "", "a\nos.exit()\rb\u{202e}c");
        assert!(text.starts_with("-- a os.exit() b c.\n"), "{text}");
    }

    #[test]
    fn texts_are_texts_of_lua() {
        assert_eq!(quoted("a \"b\"\\\n\u{e4}"), "\"a \\\"b\\\"\\\\\\010\\195\\164\"");
    }
}
