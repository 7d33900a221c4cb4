//! Journal events of serial lines.

use crate::event_kinds;
use crate::identity::BusIndex;
use crate::journal::{
    EventCodec, EventKind, EventText, Fields, Octets, OctetsKind, Origin, Packer, Part, Reader, Unpacker, hex,
};
use crate::plural::plural;

/// All event kinds of this module.
pub(crate) static KINDS: &[&EventKind] =
    &[SerialOctets::KIND, SerialError::KIND, SerialSetup::KIND, SerialOverrun::KIND];

event_kinds! {
    /// A participant has sent octets without a pause. The time is the end of the last octet, or of a character with an
    /// error that follows it without a pause, in whole microseconds rounded up.
    SerialOctets = 82, "serial", Traffic, at bus {
        /// Sender of the octets.
        sender: Origin,
        /// Number of octets, 1 to 255.
        octets: u32,
        /// The first four octets, the first one lowest.
        first: u32,
        /// FNV-1a of all octets.
        sum: u32,
    }
    /// A character on the line cannot be received without an error.
    SerialError = 83, "serial_error", Missed, at bus {
        /// Sender of the character.
        sender: Origin,
        /// Reason.
        reason: Disturbance,
    }
    /// A serial port was switched on or off, or refuses its settings.
    SerialSetup = 84, "serial_port", Rare, at origin {
        /// New state of the port.
        state: SetupNews,
        /// Baud rate in bit/s.
        baud_rate: u32,
        /// Data bits, code of the parity, stop bits, and number of wires, the first one lowest.
        format: u32,
        /// Resistors that are connected to the line.
        resistors: u8,
    }
    /// A serial port has lost a received character, because the program has not taken the characters before it.
    SerialOverrun = 85, "serial_overrun", Missed, at origin {}
}

/// Reason for which a character cannot be received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Disturbance {
    /// The sender has made a break.
    Break,
    /// Another participant was sending at the same time, or the sender has lost its supply.
    Collision,
    /// A fault has inverted a bit.
    Garbled,
}

impl Disturbance {
    const ALL: [Self; 3] = [Disturbance::Break, Disturbance::Collision, Disturbance::Garbled];

    fn name(self) -> &'static str {
        match self {
            Disturbance::Break => "break",
            Disturbance::Collision => "collision",
            Disturbance::Garbled => "garbled",
        }
    }

    fn text(self) -> &'static str {
        match self {
            Disturbance::Break => "break",
            Disturbance::Collision => "character destroyed by a collision",
            Disturbance::Garbled => "garbled character",
        }
    }
}

impl Part for Disturbance {
    fn put(self, packer: &mut Packer) {
        packer.put(self as u32);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        Self::ALL.get(unpacker.take() as usize).copied()
    }
}

/// New state of a serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SetupNews {
    /// The port is off.
    Off,
    /// The port is ready with these settings.
    Ready,
    /// The port refuses these settings and stays off.
    Refused,
}

impl SetupNews {
    const ALL: [Self; 3] = [SetupNews::Off, SetupNews::Ready, SetupNews::Refused];

    fn name(self) -> &'static str {
        match self {
            SetupNews::Off => "off",
            SetupNews::Ready => "ready",
            SetupNews::Refused => "refused",
        }
    }
}

impl Part for SetupNews {
    fn put(self, packer: &mut Packer) {
        packer.put(self as u32);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        Self::ALL.get(unpacker.take() as usize).copied()
    }
}

/// Number of octets that the event of a burst contains itself.
const CONTAINED: usize = 4;

/// Returns the FNV-1a hash of the octets.
fn fnv(octets: &[u8]) -> u32 {
    octets.iter().fold(0x811C_9DC5, |sum, octet| (sum ^ u32::from(*octet)).wrapping_mul(0x0100_0193))
}

impl SerialOctets {
    pub(super) fn new(bus: BusIndex, sender: Origin, octets: &[u8]) -> Self {
        let mut first = [0; CONTAINED];
        first.iter_mut().zip(octets).for_each(|(to, from)| *to = *from);
        let (first, sum) = (u32::from_le_bytes(first), fnv(octets));
        SerialOctets { bus, sender, octets: octets.len() as u32, first, sum }
    }

    /// True if there are octets that the event does not contain.
    pub(super) fn lacks_some(&self) -> bool {
        self.octets as usize > CONTAINED
    }

    /// Returns the octets that the event contains.
    fn contained(&self) -> Vec<u8> {
        self.first.to_le_bytes().into_iter().take(self.octets as usize).collect()
    }
}

impl EventText for SerialOctets {
    fn text(&self, reader: &mut Reader) -> String {
        let known = reader.octets().map_or_else(|| self.contained(), |octets| octets.to_vec());
        let more = if known.len() < self.octets as usize { " .." } else { "" };
        let octets = plural(u64::from(self.octets), "octet");
        format!("{octets}{}{more} from {}", hex(&known, " "), reader.port(self.sender))
    }

    fn guest(&self) -> Option<u8> {
        self.sender.guest()
    }

    fn telegram(&self) -> Option<Octets> {
        let kind = OctetsKind::of_sender(self.sender);
        Some(Octets { kind, known: self.contained(), length: self.octets as usize })
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let known = reader.octets().map_or_else(|| self.contained(), |octets| octets.to_vec());
        let fields = Fields::new().with("octets", self.octets).with("first", hex(&self.contained(), ""));
        // If the record does not contain all data, the field for the data is omitted.
        let whole = (known.len() == self.octets as usize).then(|| hex(&known, ""));
        fields.with_any("data", whole).with("sum", self.sum).with("from", reader.port(self.sender))
    }
}

impl EventText for SerialError {
    fn text(&self, reader: &mut Reader) -> String {
        format!("{} from {}", self.reason.text(), reader.port(self.sender))
    }

    fn guest(&self) -> Option<u8> {
        self.sender.guest()
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        Fields::new().with("reason", self.reason.name()).with("from", reader.port(self.sender))
    }
}

impl SerialSetup {
    /// Returns data bits, code of the parity, stop bits, and number of wires.
    fn parts(&self) -> [u8; 4] {
        self.format.to_le_bytes()
    }
}

/// Name of the parity with this code.
fn parity(code: u8) -> &'static str {
    match code {
        0 => "none",
        1 => "odd",
        2 => "even",
        _ => "unknown",
    }
}

impl EventText for SerialSetup {
    fn text(&self, _: &mut Reader) -> String {
        let [data, code, stop, wires] = self.parts();
        let settings = format!(
            "{} baud, {data} data bits, parity {}, {}, {wires} wires, resistors 16#{:02X}",
            self.baud_rate,
            parity(code),
            plural(u64::from(stop), "stop bit"),
            self.resistors
        );
        match self.state {
            SetupNews::Off => "off".to_owned(),
            SetupNews::Ready => format!("ready: {settings}"),
            SetupNews::Refused => format!("refuses the settings: {settings}"),
        }
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        let [data, code, stop, wires] = self.parts();
        Fields::new()
            .with("state", self.state.name())
            .with("baud_rate", self.baud_rate)
            .with("data_bits", data)
            .with("parity", parity(code))
            .with("stop_bits", stop)
            .with("wires", wires)
            .with("resistors", self.resistors)
    }
}

impl EventText for SerialOverrun {
    fn text(&self, _: &mut Reader) -> String {
        "a received character is lost, because a_RX is full".to_owned()
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new()
    }
}
