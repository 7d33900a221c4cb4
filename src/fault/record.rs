//! Journal records about injected faults.

use super::{Target, TargetKind, is_declared};
use crate::journal::{
    Catalogue, EventCodec, EventKind, EventText, Fields, Keeping, Origin, Packer, Part, Reader, Ring, Source,
    Unpacker, Words,
};
use crate::plain_text::without_interpreted;

/// All kinds of these records.
pub static KINDS: &[&EventKind] = &[FaultNews::KIND];

/// Journal record about an injected fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultNews {
    /// Target of the fault.
    pub target: Target,
    /// Number of the fault in the plant.
    pub id: u16,
    /// Number of the fault's kind.
    pub kind: u8,
    /// Event of the fault.
    pub news: News,
}

/// Event of an injected fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum News {
    /// The fault was added. It begins at its own time.
    Added,
    /// The fault has hit.
    Hit(Hit),
    /// The fault has ended by its count or duration.
    Over,
    /// The fault was cleared.
    Cleared,
}

/// Details of a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hit {
    /// The record has no details except the kind and the target.
    Plain,
    /// The fault hit the frame with this identifier.
    Frame(u32),
    /// The fault moved a SYNC edge by the given number of microseconds.
    Edge(i32),
}

impl Part for News {
    fn put(self, packer: &mut Packer) {
        let (what, detail) = match self {
            News::Added => (0, 0),
            News::Over => (1, 0),
            News::Cleared => (2, 0),
            News::Hit(Hit::Plain) => (3, 0),
            News::Hit(Hit::Frame(id)) => (4, id),
            News::Hit(Hit::Edge(us)) => (5, us.cast_unsigned()),
        };
        packer.put(what);
        packer.put(detail);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        let (what, detail) = (unpacker.take(), unpacker.take());
        Some(match what {
            0 => News::Added,
            1 => News::Over,
            2 => News::Cleared,
            3 => News::Hit(Hit::Plain),
            4 => News::Hit(Hit::Frame(detail)),
            5 => News::Hit(Hit::Edge(detail.cast_signed())),
            _ => return None,
        })
    }
}

impl EventCodec for FaultNews {
    const KIND: &'static EventKind = &EventKind::new::<Self>(21, "fault", Ring::Missed);

    fn words(&self) -> Words {
        let (index, number) = self.target.numbers();
        let form = match self.target.place() {
            TargetKind::Bus => 0,
            TargetKind::Participant => 1,
            TargetKind::Port => 2,
            TargetKind::Device => 3,
        };
        let mut packer = Packer::new(Self::KIND, index, number);
        packer.put(form);
        self.id.put(&mut packer);
        self.kind.put(&mut packer);
        self.news.put(&mut packer);
        packer.words()
    }

    fn read(words: Words) -> Option<Self> {
        let mut unpacker = Unpacker::new(words);
        let (index, number) = (unpacker.index(), unpacker.number());
        let place = match unpacker.take() {
            0 => TargetKind::Bus,
            1 => TargetKind::Participant,
            2 => TargetKind::Port,
            3 => TargetKind::Device,
            _ => return None,
        };
        let target = Target::of_numbers(place, index, number);
        let (id, kind) = (u16::take(&mut unpacker)?, u8::take(&mut unpacker)?);
        Some(FaultNews { target, id, kind, news: News::take(&mut unpacker)? })
    }

    fn source(&self) -> Source {
        match self.target {
            Target::Bus(bus) | Target::Participant { bus, .. } => Source::Bus(bus),
            Target::Port { device: plc, port: node } => Source::Node(Origin { plc, node }),
            Target::Device(plc) => Source::Node(Origin::of_device(plc)),
        }
    }
}

impl FaultNews {
    /// Returns the name of the kind. A record of a kind that a folder declares contains the name. Journals may come from
    /// unknown authors, so interpreted characters are replaced.
    fn name(&self, reader: &Reader) -> String {
        match reader.octets() {
            Some(name) if is_declared(self.kind) => without_interpreted(&String::from_utf8_lossy(&name)),
            _ => reader.fault(self.kind).to_owned(),
        }
    }

    fn slave(&self) -> Option<u8> {
        match self.target {
            Target::Participant { number, .. } => Some(number),
            Target::Bus(_) | Target::Port { .. } | Target::Device(_) => None,
        }
    }
}

impl EventText for FaultNews {
    fn keeping(&self) -> Keeping {
        if matches!(self.news, News::Hit(_)) { Keeping::Counted } else { Keeping::Noted }
    }

    fn is_known(&self, catalogue: &Catalogue) -> bool {
        catalogue.fault(self.kind).is_some() || is_declared(self.kind)
    }

    fn text(&self, reader: &mut Reader) -> String {
        let name = self.name(reader);
        let slave = self.slave().map(|slave| format!(" of slave {slave}")).unwrap_or_default();
        let news = match self.news {
            News::Added => "added".to_owned(),
            News::Hit(Hit::Plain) => "hits".to_owned(),
            News::Hit(Hit::Edge(us)) => format!("hits, edge moved by {us:+} us"),
            News::Hit(Hit::Frame(id)) => format!("hits frame 16#{id:03X}"),
            News::Over => "over".to_owned(),
            News::Cleared => "cleared".to_owned(),
        };
        format!("fault {}, {name}{slave}: {news}", self.id)
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let news = match self.news {
            News::Added => "added",
            News::Hit(_) => "hit",
            News::Over => "over",
            News::Cleared => "cleared",
        };
        let fields = Fields::new()
            .with("fault", self.id)
            .with("what", self.name(reader))
            .with_any("slave", self.slave())
            .with("news", news);
        match self.news {
            News::Hit(Hit::Frame(id)) => fields.with("id", id),
            News::Hit(Hit::Edge(us)) => fields.with("shift_us", us),
            _ => fields,
        }
    }
}
