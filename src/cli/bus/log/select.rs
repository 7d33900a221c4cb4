//! Selection of the frames of a log.

use crate::can::{Frame, Id};
use crate::devices::node_sends;
use crate::journal::recording::Direction;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// Selection of frames and telegrams of a log.
#[derive(clap::Args)]
#[command(next_help_heading = "Frames of the log")]
pub(super) struct Select {
    /// Take only frames of this interface; can be given several times
    #[arg(long, value_name = "NAME", value_parser = crate::cli::given::text("write an interface of the log, for example can0"))]
    interface: Vec<String>,
    /// Take only these identifiers: `184`, `180:780` (identifier and mask), `!184` (all but this one); hexadecimal, with
    /// eight digits for 29 bits; can be given several times
    #[arg(long, value_name = "ID[:MASK]", value_parser = IdFilter::parse)]
    id: Vec<IdFilter>,
    /// Take only frames that the logger's station received or sent; frames without a direction are not taken
    #[arg(long, value_name = "DIRECTION", value_parser = directions())]
    direction: Option<Direction>,
    /// Leave out what this node sent, by the identifiers that CiA 301 gives a node-ID: for a log of a device that the
    /// instance has; can be given several times
    #[arg(long, value_name = "NODE-ID", value_parser = crate::cli::number::within::<u8>(1..=127))]
    without_node: Vec<u8>,
    /// Take only telegrams of PROFIBUS from the station with this address; can be given several times
    #[arg(long, value_name = "ADDRESS", value_parser = crate::cli::number::within::<u8>(0..=126))]
    station: Vec<u8>,
    /// Leave out the telegrams of PROFIBUS from the station with this address: for a log of a device that the instance has;
    /// can be given several times
    #[arg(long, value_name = "ADDRESS", value_parser = crate::cli::number::within::<u8>(0..=126))]
    without_station: Vec<u8>,
}

/// Parser of directions, with the words that loggers use.
fn directions() -> impl TypedValueParser<Value = Direction> {
    let words = [("rx", "Received frames"), ("tx", "Sent frames")];
    PossibleValuesParser::new(words.map(|(word, help)| PossibleValue::new(word).help(help)))
        .map(|word| if word == "rx" { Direction::Received } else { Direction::Transmitted })
}

/// Identifiers as the user wrote them.
#[derive(Clone, Debug, PartialEq, Eq)]
struct IdFilter {
    id: u32,
    mask: u32,
    is_extended: bool,
    /// True: all identifiers except these are selected.
    is_inverted: bool,
}

impl IdFilter {
    fn parse(text: &str) -> Result<Self, String> {
        let (rest, is_inverted) = match text.strip_prefix('!') {
            Some(rest) => (rest, true),
            None => (text, false),
        };
        let (id, mask) = rest.split_once(':').unwrap_or((rest, ""));
        let number = |text: &str| u32::from_str_radix(text, 16).ok();
        let is_extended = id.len() == 8;
        let most = if is_extended { 0x1FFF_FFFF } else { 0x7FF };
        let mask = if mask.is_empty() { Some(most) } else { number(mask) };
        let is_hex = rest.bytes().all(|byte| byte.is_ascii_hexdigit() || byte == b':');
        match (number(id).filter(|id| is_hex && *id <= most), mask.filter(|mask| *mask <= most)) {
            (Some(id), Some(mask)) => Ok(IdFilter { id, mask, is_extended, is_inverted }),
            _ => Err("write an identifier up to 7FF, or eight digits up to 1FFFFFFF, and a mask of the same range: \
                      184, 180:780, !184, 18FF1234"
                .to_owned()),
        }
    }

    /// True if the identifier is one of these, without the inversion.
    fn matches(&self, id: Id) -> bool {
        let (raw, is_extended) = match id {
            Id::Standard(id) => (u32::from(id.as_raw()), false),
            Id::Extended(id) => (id.as_raw(), true),
        };
        is_extended == self.is_extended && (raw ^ self.id) & self.mask == 0
    }
}

impl Select {
    /// True if a frame of the log is selected.
    pub(super) fn takes(&self, interface: &str, direction: Option<Direction>, frame: &Frame) -> bool {
        self.takes_from(interface, direction) && self.takes_id(frame)
    }

    /// True if a telegram of the log, with the address of its sender, is selected.
    pub(super) fn takes_telegram(
        &self,
        interface: &str,
        direction: Option<Direction>,
        sender: Option<u8>,
    ) -> bool {
        self.takes_from(interface, direction) && self.takes_sender(sender)
    }

    fn takes_from(&self, interface: &str, direction: Option<Direction>) -> bool {
        self.direction.is_none_or(|wanted| direction == Some(wanted))
            && (self.interface.is_empty() || self.interface.iter().any(|name| name == interface))
    }

    /// True if a telegram is selected, by its sender only.
    pub(super) fn takes_sender(&self, sender: Option<u8>) -> bool {
        let is_in = |list: &[u8]| sender.is_some_and(|sender| list.contains(&sender));
        // A telegram has no identifier. So a filter that requires an identifier excludes it, and a filter that excludes
        // identifiers accepts it.
        self.id.iter().all(|filter| filter.is_inverted)
            && (self.station.is_empty() || is_in(&self.station))
            && !is_in(&self.without_station)
    }

    /// True if a frame is selected, by its identifier only.
    pub(super) fn takes_id(&self, frame: &Frame) -> bool {
        let field = frame.arbitration();
        let filters = |is_inverted| self.id.iter().filter(move |filter| filter.is_inverted == is_inverted);
        let is_one_of = |is_inverted| filters(is_inverted).any(|filter| filter.matches(field.id()));
        // A frame of CAN has no PROFIBUS station as its sender. So if stations are selected, it is excluded.
        self.station.is_empty()
            && (filters(false).next().is_none() || is_one_of(false))
            && !is_one_of(true)
            // The guarding request of a master is a remote frame with the identifier of the node's answer. So a remote
            // frame does not count as a frame of the node.
            && (field.is_remote() || !self.without_node.iter().any(|node| node_sends(*node, field.id())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{ExtendedId, Payload, StandardId};
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        select: Select,
    }

    fn takes(arguments: &[&str], interface: &str, direction: Option<Direction>, frame: &Frame) -> bool {
        let line = Line::parse_from(std::iter::once(&"x").chain(arguments));
        line.select.takes(interface, direction, frame)
    }

    #[test]
    fn frames_are_selected_by_each_property() {
        let frame = Frame::standard(0x1A0, Payload::EMPTY);
        let long = Frame::new(ExtendedId::new(0x1A0).unwrap(), Payload::EMPTY);
        let (received, sent) = (Some(Direction::Received), Some(Direction::Transmitted));
        for (arguments, wanted) in [
            (&[][..], true),
            (&["--interface", "can0"], true),
            (&["--interface", "can1"], false),
            (&["--interface", "can1", "--interface", "can0"], true),
            (&["--id", "1A0"], true),
            (&["--id", "180:780"], true),
            (&["--id", "1A1"], false),
            (&["--id", "1A1", "--id", "180:780"], true),
            (&["--id", "!1A0"], false),
            (&["--id", "!1A1"], true),
            (&["--id", "180:780", "--id", "!1A0"], false),
            (&["--id", "000001A0"], false),
            (&["--direction", "rx"], true),
            (&["--direction", "tx"], false),
            (&["--without-node", "32"], false),
            (&["--without-node", "33"], true),
        ] {
            assert_eq!(takes(arguments, "can0", received, &frame), wanted, "{arguments:?}");
        }
        assert!(takes(&["--id", "000001A0"], "a", None, &long) && !takes(&["--id", "1A0"], "a", None, &long));
        assert!(
            takes(&["--direction", "tx"], "a", sent, &frame)
                && !takes(&["--direction", "tx"], "a", None, &frame)
        );
    }

    #[test]
    fn telegrams_are_selected_by_their_sender() {
        for (arguments, wanted) in [
            (&[][..], [true, true, true]),
            (&["--station", "5"], [true, false, false]),
            (&["--station", "5", "--station", "2"], [true, true, false]),
            (&["--without-station", "5"], [false, true, true]),
            (&["--interface", "other"], [false; 3]),
            (&["--id", "1A0"], [false; 3]),
            (&["--id", "!1A0"], [true; 3]),
        ] {
            let line = Line::parse_from(std::iter::once(&"x").chain(arguments));
            let takes = |sender| line.select.takes_telegram("dp", None, sender);
            assert_eq!([Some(5), Some(2), None].map(takes), wanted, "{arguments:?}");
        }
        assert!(!takes(&["--station", "5"], "a", None, &Frame::standard(1, Payload::EMPTY)));
    }

    /// The guarding request of a master has the same identifier as the answer of the node.
    #[test]
    fn requests_of_the_master_are_not_of_the_node() {
        let guarding = Frame::remote(StandardId::new(0x720).unwrap(), 1).unwrap();
        let answer = Frame::standard(0x720, Payload::EMPTY);
        assert!(takes(&["--without-node", "32"], "a", None, &guarding));
        assert!(!takes(&["--without-node", "32"], "a", None, &answer));
    }

    #[test]
    fn wrong_identifiers_are_refused() {
        for wrong in ["", "800", "20000000", "12G", "180:800", "+12", "1:+1", "!", "180:780:1"] {
            assert!(IdFilter::parse(wrong).is_err(), "{wrong}");
        }
    }
}
