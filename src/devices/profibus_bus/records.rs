//! Journal events of PROFIBUS: its telegrams. An event has five numbers, so the octets of a longer telegram are in its
//! record (`Reader::octets`).

use super::services;
use crate::event_kinds;
use crate::identity::BusIndex;
use crate::journal::{EventCodec, EventKind, EventText, Fields, Octets, OctetsKind, Origin, Reader, hex};
use crate::plural::plural;
use crate::profibus::{Frame, Telegram};

/// All event kinds of this module.
pub(crate) static KINDS: &[&EventKind] = &[DpTelegram::KIND, DpShort::KIND, DpGarbled::KIND];

event_kinds! {
    /// A request or an answer was on the line. The time is its end, in whole microseconds rounded up.
    DpTelegram = 70, "dp_telegram", Traffic, at bus {
        /// Sender of the telegram.
        sender: Origin,
        /// Destination, source and function code, and flags that show the service access points: bit 0 for the
        /// destination, bit 1 for the source.
        head: u32,
        /// Service access points of destination and source, and the number of octets of data above them.
        unit: u32,
        /// The first four octets of data, the first one lowest.
        first: u32,
        /// FNV-1a of all octets of data.
        sum: u32,
    }
    /// A receipt or a token was on the line.
    DpShort = 71, "dp_short", Traffic, at bus {
        /// Sender of the telegram.
        sender: Origin,
        /// New and previous holder of a token; 16#FFFF for a receipt.
        token: u32,
    }
    /// Octets were on the line that are not a telegram: a collision, or a wrong format.
    DpGarbled = 72, "dp_garbled", Missed, at bus {
        /// Sender of the octets.
        sender: Origin,
        /// Number of octets of the telegram.
        octets: u32,
    }
}

/// The value of `token` for a receipt.
const RECEIPT: u32 = 0xFFFF;

/// Returns the FNV-1a hash of the octets.
fn fnv(octets: &[u8]) -> u32 {
    octets.iter().fold(0x811C_9DC5, |sum, octet| (sum ^ u32::from(*octet)).wrapping_mul(0x0100_0193))
}

impl DpTelegram {
    pub(super) fn new(bus: BusIndex, sender: Origin, frame: &Frame) -> Self {
        let flags = u8::from(frame.dsap.is_some()) | u8::from(frame.ssap.is_some()) << 1;
        let saps = u32::from(frame.dsap.unwrap_or(0)) | u32::from(frame.ssap.unwrap_or(0)) << 8;
        let mut first = [0; 4];
        first.iter_mut().zip(&frame.data).for_each(|(to, from)| *to = *from);
        DpTelegram {
            bus,
            sender,
            head: u32::from_le_bytes([frame.da, frame.sa, frame.fc, flags]),
            unit: saps | (frame.data.len() as u32) << 16,
            first: u32::from_le_bytes(first),
            sum: fnv(&frame.data),
        }
    }

    fn octets(&self) -> usize {
        (self.unit >> 16) as usize
    }

    /// True if the telegram has octets that the event does not contain, or if its form differs from that of
    /// [`Telegram::octets`].
    pub(super) fn lacks(&self, octets: &[u8]) -> bool {
        self.octets() > self.first.to_le_bytes().len() || self.octets_on_line() != octets.len()
    }

    /// Returns the telegram. Its data are the octets of its record, or otherwise the octets that the event
    /// contains.
    fn frame(&self, octets: Option<&[u8]>) -> Frame {
        if let Some(Ok(Telegram::Frame(frame))) = octets.map(Telegram::parse) {
            return frame;
        }
        let ([da, sa, fc, _], [dsap, ssap]) = (self.head.to_le_bytes(), self.saps());
        let data = self.first.to_le_bytes().into_iter().take(self.octets()).collect();
        Frame { da, sa, fc, dsap, ssap, data }
    }

    /// Returns the number of octets on the line, including header and trailer. Header and trailer are shorter
    /// in a telegram without data.
    pub(super) fn octets_on_line(&self) -> usize {
        match self.octets() + self.saps().into_iter().flatten().count() {
            0 => 6,
            octets => octets + 9,
        }
    }

    /// Returns the service access points of destination and source.
    fn saps(&self) -> [Option<u8>; 2] {
        let [.., flags] = self.head.to_le_bytes();
        let [there, here, ..] = self.unit.to_le_bytes();
        [(flags & 1 != 0).then_some(there), (flags & 2 != 0).then_some(here)]
    }
}

/// Returns the event of a token or receipt; `None` for a frame, which is a [`DpTelegram`].
pub(super) fn short(bus: BusIndex, sender: Origin, telegram: &Telegram) -> Option<DpShort> {
    let token = match telegram {
        Telegram::Frame(_) => return None,
        Telegram::Token { da, sa } => u32::from(*da) | u32::from(*sa) << 8,
        Telegram::ShortAck => RECEIPT,
    };
    Some(DpShort { bus, sender, token })
}

impl EventText for DpTelegram {
    fn text(&self, reader: &mut Reader) -> String {
        let frame = self.frame(reader.octets().as_deref());
        let [there, here] = self.saps().map(|sap| sap.map_or_else(String::new, |sap| format!("/{sap}")));
        let (octets, more) = (
            plural(self.octets() as u64, "octet"),
            if frame.data.len() < self.octets() { " .." } else { "" },
        );
        let (from, &Frame { da, sa, fc, ref data, .. }) = (reader.port(self.sender), &frame);
        let service = services::name(&frame).map_or_else(String::new, |name| format!(", {name}"));
        let meaning = services::text(&frame).map_or_else(String::new, |text| format!(": {text}"));
        let data = hex(data, " ");
        format!("{sa}{here} to {da}{there}, 16#{fc:02X}, {octets}{data}{more} from {from}{service}{meaning}")
    }

    fn guest(&self) -> Option<u8> {
        self.sender.guest()
    }

    fn telegram(&self) -> Option<Octets> {
        let [da, sa, fc, _] = self.head.to_le_bytes();
        let [dsap, ssap] = self.saps();
        let mut data: Vec<_> = self.first.to_le_bytes().into_iter().take(self.octets()).collect();
        let unknown = self.octets() - data.len();
        data.resize(self.octets(), 0);
        let mut known = Telegram::Frame(Frame { da, sa, fc, dsap, ssap, data }).octets().ok()?;
        let length = known.len();
        if unknown > 0 {
            // Checksum and end delimiter follow the data.
            known.truncate(length - unknown - 2);
        }
        Some(Octets { kind: OctetsKind::of_sender(self.sender), known, length })
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let [da, sa, fc, _] = self.head.to_le_bytes();
        let [dsap, ssap] = self.saps();
        let fields = Fields::new().with("da", da).with("sa", sa).with("fc", fc);
        let fields = dsap.into_iter().fold(fields, |fields, sap| fields.with("dsap", sap));
        let fields = ssap.into_iter().fold(fields, |fields, sap| fields.with("ssap", sap));
        let frame = self.frame(reader.octets().as_deref());
        let first = hex(&frame.data[..frame.data.len().min(4)], "");
        let fields = fields.with("octets", self.octets() as u32).with("first", first);
        // If the event does not contain all data, the field for the data is left out.
        let whole = (frame.data.len() == self.octets()).then(|| hex(&frame.data, ""));
        let fields = fields.with_any("data", whole);
        let fields = fields.with("sum", self.sum);
        fields.with_any("service", services::name(&frame)).with("from", reader.port(self.sender))
    }
}

impl DpShort {
    /// Returns the number of octets on the line: three for a token, one for a receipt.
    pub(super) fn octets_on_line(&self) -> usize {
        if self.token == RECEIPT { 1 } else { 3 }
    }

    fn stations(&self) -> Option<(u8, u8)> {
        let [da, sa, ..] = self.token.to_le_bytes();
        (self.token != RECEIPT).then_some((da, sa))
    }
}

impl EventText for DpShort {
    fn text(&self, reader: &mut Reader) -> String {
        let from = reader.port(self.sender);
        match self.stations() {
            Some((da, sa)) => format!("token from {sa} to {da}, from {from}"),
            None => format!("receipt from {from}"),
        }
    }

    fn guest(&self) -> Option<u8> {
        self.sender.guest()
    }

    fn telegram(&self) -> Option<Octets> {
        let telegram = self.stations().map_or(Telegram::ShortAck, |(da, sa)| Telegram::Token { da, sa });
        let known = telegram.octets().ok()?;
        Some(Octets { kind: OctetsKind::of_sender(self.sender), length: known.len(), known })
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let fields = Fields::new().with("is_token", self.stations().is_some());
        let fields =
            self.stations().into_iter().fold(fields, |fields, (da, sa)| fields.with("da", da).with("sa", sa));
        fields.with("from", reader.port(self.sender))
    }
}

impl EventText for DpGarbled {
    fn text(&self, reader: &mut Reader) -> String {
        let octets = reader.octets().map(|octets| hex(&octets, " ")).unwrap_or_default();
        format!("{} garbled octets{octets} from {}", self.octets, reader.port(self.sender))
    }

    fn guest(&self) -> Option<u8> {
        self.sender.guest()
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let fields = Fields::new().with("octets", self.octets);
        let octets = reader.octets().map(|octets| hex(&octets, ""));
        fields.with_any("data", octets).with("from", reader.port(self.sender))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::DeviceIndex;
    use crate::identity::PortNumber;

    #[test]
    fn an_event_contains_the_telegram_that_was_sent() {
        let frame = Frame { da: 5, sa: 2, fc: 0x6D, dsap: Some(61), ssap: None, data: vec![1, 2, 3, 4, 5] };
        let event = DpTelegram::new(BusIndex(0), Origin { plc: DeviceIndex(0), node: PortNumber(1) }, &frame);
        assert_eq!(
            (event.saps(), event.octets(), hex(&event.frame(None).data, " ").as_str()),
            ([Some(61), None], 5, " 01 02 03 04")
        );
        let line = Telegram::Frame(frame.clone()).octets().unwrap();
        assert_eq!((event.frame(Some(&line)), event.lacks(&line)), (frame.clone(), true));
        assert_eq!(DpTelegram::read(event.words()), Some(event));
        let Octets { known, length, .. } = event.telegram().unwrap();
        let octets = Telegram::Frame(frame.clone()).octets().unwrap();
        assert_eq!((known.as_slice(), length), (&octets[..12], octets.len()), "the fifth octet is not there");
        let short = Frame { data: vec![1, 2, 3, 4], ..frame.clone() };
        let whole = DpTelegram::new(BusIndex(0), Origin { plc: DeviceIndex(0), node: PortNumber(1) }, &short)
            .telegram()
            .unwrap();
        let octets = Telegram::Frame(short.clone()).octets().unwrap();
        assert_eq!(whole, Octets { kind: OctetsKind::Sent, length: octets.len(), known: octets });
        let fixed = Frame { fc: 0x5D, dsap: None, ..short.clone() };
        let event = DpTelegram::new(BusIndex(0), Origin { plc: DeviceIndex(0), node: PortNumber(1) }, &fixed);
        assert!(
            !event.lacks(&Telegram::Frame(fixed).octets().unwrap()) && event.lacks(&[0; 14]),
            "another form"
        );
        let other = Frame { data: vec![1, 2, 3, 4, 6], ..frame };
        assert_ne!(
            DpTelegram::new(BusIndex(0), Origin { plc: DeviceIndex(0), node: PortNumber(1) }, &other),
            event
        );
    }
}
