//! The journal as signals over time. All waveform formats and the plots show these signals.
//!
//! A scope for each bus has its SYNC edges as events and its frames; a scope for each PLC has a scope for each area
//! with its registers. If a register has a meaning, a second signal shows the meaning as text. Other events are text
//! under the name of their kind. A signal has no value until the journal contains one.

use super::reader::RegisterLocation;
use super::window::Window;
use super::{
    Catalogue, Changed, ChannelWrite, Force, Names, Reader, Record, Ring, Selection, Source, Unforce,
};
use crate::can::{Frame, Id};
use crate::identity::DeviceIndex;
use crate::layout::Width;
use crate::plain_text::is_interpreted;
use std::collections::{BTreeMap, HashMap, HashSet};

/// Number of bits of the longest data of a frame.
const DATA_BITS: u32 = 64;
/// Number of bits of the longest identifier.
const ID_BITS: u32 = 29;

/// The records of a journal as signals.
pub struct Waves {
    /// Index of the signals by their paths: scopes, and the name.
    pub(super) paths: BTreeMap<Vec<String>, usize>,
    pub(super) signals: Vec<Signal>,
    /// All changes of the signals, sorted by time.
    pub(super) changes: Vec<Change>,
    recorded: HashSet<(DeviceIndex, u32)>,
}

/// The values of a register according to the journal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Past {
    /// Times in microseconds, ascending, each with the value from then on.
    pub values: Vec<(u64, u32)>,
    /// True if the values are complete from the start of the journal on.
    pub is_recorded: bool,
}

/// A signal of the waveform file.
pub(super) struct Signal {
    pub shape: Shape,
    of: SignalSubject,
}

/// The subject of a signal.
#[derive(Clone, Copy, PartialEq, Eq)]
enum SignalSubject {
    /// The value of a register: index of the device, and offset.
    Register(DeviceIndex, u32),
    /// The SYNC signal of a bus, or a similar signal.
    Edge,
    /// The value is that of any other signal.
    Other,
}

/// The type of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// A number with this count of bits.
    Bits(u32),
    /// The values of the signal are texts.
    Text,
    /// A signal of events without a value.
    Event,
}

/// The value of a signal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// Width in bits, the values of the bits, and a mask of the known bits.
    Bits { width: u32, value: u64, known: u64 },
    /// A text, a single word.
    Text(String),
    /// An event without a value.
    Event,
}

impl Content {
    fn number(width: u32, value: u64) -> Self {
        Content::Bits { width, value, known: u64::MAX }
    }

    /// Returns the data of a frame as bits. Its first byte is in the highest bits. If the frame has fewer than eight
    /// bytes, the other bits are unknown.
    fn data(frame: &Frame) -> Self {
        let payload = frame.payload();
        let data = if frame.arbitration().is_remote() { &[][..] } else { payload.data() };
        let (mut value, mut known) = (0, 0);
        for (byte, shift) in data.iter().zip((0..DATA_BITS).step_by(8).rev()) {
            value |= u64::from(*byte) << shift;
            known |= 0xFF << shift;
        }
        Content::Bits { width: DATA_BITS, value, known }
    }

    fn shape(&self) -> Shape {
        match self {
            Content::Bits { width, .. } => Shape::Bits(*width),
            Content::Text(_) => Shape::Text,
            Content::Event => Shape::Event,
        }
    }
}

/// A step of the declaration of signals.
pub(super) enum Step<'a> {
    /// Enters the scope with this name.
    Into(&'a str),
    /// A signal with this number and name.
    Signal(usize, &'a str),
    /// Leaves the present scope.
    Out,
}

/// The value of a signal from a time on.
pub(super) struct Change {
    pub time_us: u64,
    pub signal: usize,
    pub content: Content,
}

impl Waves {
    /// Creates the signals of the wanted records. The other records only update the state.
    pub fn of(records: &[Record], wanted: &Selection, names: Names, catalogue: &'static Catalogue) -> Self {
        Self::within(Window::ALL, records, wanted, names, catalogue)
    }

    /// Does the same as [`Waves::of`], but takes only those events of counted records that are in this window.
    pub(crate) fn within(
        window: Window,
        records: &[Record],
        wanted: &Selection,
        names: Names,
        catalogue: &'static Catalogue,
    ) -> Self {
        let changed = records.iter().filter_map(|record| record.event.get::<Changed>());
        let mut taking = WaveCollector {
            window,
            reader: Reader::new(names, catalogue),
            waves: Waves {
                paths: BTreeMap::new(),
                signals: Vec::new(),
                changes: Vec::new(),
                recorded: changed.map(|change| (change.plc, change.offset)).collect(),
            },
            overlaid: HashMap::new(),
            forces: Vec::new(),
        };
        for record in records {
            taking.reader.observe(record);
            taking.observe_force(record);
            if wanted.takes(record) {
                taking.take(record);
            }
        }
        let mut waves = taking.waves;
        // A counted record is written when its count ends, so its events are older than those of preceding records.
        waves.changes.sort_by_key(|change| change.time_us);
        waves.drop_repetitions();
        waves
    }

    /// Returns the values of a register of this width according to the journal. The register may be a part of a
    /// recorded one.
    pub fn register(&self, plc: DeviceIndex, offset: u32, width: Width) -> Past {
        // First choice is a signal of this width at the same offset, second choice a recorded signal that contains the
        // register. A signal of another width at the same offset belongs to another structure, or to an access of a
        // program.
        let wider = [offset, offset & !1, offset & !3].into_iter().filter(|at| self.is_recorded(plc, *at));
        let wider = wider.flat_map(|at| [(at, Width::Word), (at, Width::Dword)]);
        let contains = |(at, container): &(u32, Width)| offset + width.bytes() <= at + container.bytes();
        let mut candidates = core::iter::once((offset, width)).chain(wider.filter(contains));
        let is_signal = |signal: &Signal, (at, container): (u32, Width)| {
            signal.of == SignalSubject::Register(plc, at)
                && signal.shape == Shape::Bits(8 * container.bytes())
        };
        let Some(found) = candidates.find(|it| self.signals.iter().any(|signal| is_signal(signal, *it)))
        else {
            return Past { values: Vec::new(), is_recorded: self.is_recorded(plc, offset) };
        };
        let number = |change: &Change| match change.content {
            Content::Bits { value, .. } => {
                // Registers have 32 bits at most.
                Some((change.time_us, value as u32 >> (8 * (offset - found.0)) & width.max_value()))
            }
            _ => None,
        };
        let mut values: Vec<_> =
            self.changes_of(|signal| is_signal(signal, found)).filter_map(number).collect();
        // A wider signal also changes when only its other bytes change, so equal values can follow each other.
        values.dedup_by_key(|(_, value)| *value);
        Past { values, is_recorded: self.is_recorded(plc, found.0) }
    }

    fn is_recorded(&self, plc: DeviceIndex, offset: u32) -> bool {
        self.recorded.contains(&(plc, offset))
    }

    /// Returns the times of the SYNC edges on all buses, in microseconds, in their order.
    pub fn edges(&self) -> Vec<u64> {
        let mut edges: Vec<_> =
            self.changes_of(|signal| signal.of == SignalSubject::Edge).map(|change| change.time_us).collect();
        edges.dedup();
        edges
    }

    /// Scopes and signals in the order in which a file declares them.
    pub(super) fn outline(&self) -> Vec<Step<'_>> {
        let mut steps = Vec::new();
        let mut open: &[String] = &[];
        for (path, signal) in &self.paths {
            let Some((name, scopes)) = path.split_last() else { continue };
            let common = open.iter().zip(scopes).take_while(|(one, other)| one == other).count();
            steps.extend(open[common..].iter().map(|_| Step::Out));
            steps.extend(scopes[common..].iter().map(|scope| Step::Into(scope)));
            steps.push(Step::Signal(*signal, name));
            open = scopes;
        }
        steps.extend(open.iter().map(|_| Step::Out));
        steps
    }

    fn changes_of(&self, is_it: impl Fn(&Signal) -> bool) -> impl Iterator<Item = &Change> {
        let of_it = move |change: &&Change| self.signals.get(change.signal).is_some_and(&is_it);
        self.changes.iter().filter(of_it)
    }

    /// Drops a value that equals the previous value. Events are never dropped.
    fn drop_repetitions(&mut self) {
        let mut shown: HashMap<usize, Content> = HashMap::new();
        self.changes.retain(|Change { signal, content, .. }| {
            *content == Content::Event || shown.insert(*signal, content.clone()).as_ref() != Some(content)
        });
    }
}

struct WaveCollector {
    window: Window,
    reader: Reader,
    waves: Waves,
    /// The registers at each address with a value. An address has several registers if structures overlay each other.
    overlaid: HashMap<(DeviceIndex, u32), Vec<OverlaidRegister>>,
    /// The registers that are forced.
    forces: Vec<Force>,
}

/// A register with a signal.
#[derive(PartialEq, Eq)]
struct OverlaidRegister {
    scopes: Vec<String>,
    name: String,
    width: Width,
    has_meaning: bool,
}

/// Text that the meaning of a register shows while the memory contains the value of another register, whose structure
/// is valid.
const NOT_LIVE: &str = "not_live";

impl WaveCollector {
    fn take(&mut self, record: &Record) {
        let event = record.event;
        let scopes = self.scopes(event.source());
        if let Some(Changed { plc, offset, how, to, .. }) = event.get() {
            let place = self.reader.followed(plc, offset, how.width, how.live);
            self.register(record, &scopes, (plc, offset), &place, how.width, to);
        } else if let Some(ChannelWrite { plc, offset, width, value }) = event.get() {
            if !self.waves.is_recorded(plc, offset) {
                self.written(record, &scopes, (plc, offset, width), value);
            }
        } else if let Some(Force { plc, offset, width, value }) = event.get() {
            if !self.waves.is_recorded(plc, offset) {
                self.written(record, &scopes, (plc, offset, width), value);
            }
            self.text(record, &scopes);
        } else if let Some(stored) = event.stored() {
            if !self.waves.is_recorded(stored.plc, stored.offset) {
                let place = self.reader.whole(stored.plc, stored.offset);
                let width = place.width();
                let value = self.kept((stored.plc, stored.offset, width), stored.now);
                self.register(record, &scopes[..1], (stored.plc, stored.offset), &place, width, value);
            }
        } else if let Some(carried) = event.frame() {
            let id = match carried.frame.arbitration().id() {
                Id::Standard(id) => id.as_raw().into(),
                Id::Extended(id) => id.as_raw(),
            };
            self.note(record, &scopes, "frame_end", SignalSubject::Other, Content::Event);
            self.note(record, &scopes, "id", SignalSubject::Other, Content::number(ID_BITS, id.into()));
            self.note(record, &scopes, "data", SignalSubject::Other, Content::data(&carried.frame));
            if let Some(slot) = event.slot() {
                self.note(record, &scopes, "slot", SignalSubject::Other, Content::Text(slot.to_owned()));
            }
            let text = event.text(&mut self.reader);
            self.note(record, &scopes, "frame", SignalSubject::Other, Content::Text(text));
        } else if event.kind().ring() == Ring::Registers {
            self.note(record, &scopes, event.kind().name(), SignalSubject::Edge, Content::Event);
        } else {
            self.text(record, &scopes);
        }
    }

    /// Adds the text of the record under the name of its kind.
    fn text(&mut self, record: &Record, scopes: &[String]) {
        let text = record.event.text(&mut self.reader);
        self.note(record, scopes, record.event.kind().name(), SignalSubject::Other, Content::Text(text));
    }

    /// Notes which registers are forced, also from records that are not selected.
    fn observe_force(&mut self, record: &Record) {
        if let Some(Unforce { plc, offset }) = record.event.get() {
            self.forces.retain(|force| (force.plc, force.offset) != (plc, offset));
        } else if let Some(force @ Force { plc, offset, .. }) = record.event.get() {
            self.forces.retain(|force| (force.plc, force.offset) != (plc, offset));
            self.forces.push(force);
        }
    }

    /// Returns the value that a register has after a store of `value`: each forced byte keeps its forced value.
    fn kept(&self, (plc, offset, width): (DeviceIndex, u32, Width), value: u32) -> u32 {
        let forced = |at: u32| {
            let is_inside =
                |it: &&Force| it.plc == plc && (it.offset..it.offset + u32::from(it.width)).contains(&at);
            self.forces.iter().find(is_inside).map(|it| it.value.to_le_bytes()[(at - it.offset) as usize])
        };
        let mut bytes = value.to_le_bytes();
        for (byte, at) in bytes.iter_mut().zip(offset..offset + width.bytes()) {
            *byte = forced(at).unwrap_or(*byte);
        }
        u32::from_le_bytes(bytes)
    }

    /// Adds the value of a register without recorded changes after a write of `width` bytes by a client.
    fn written(
        &mut self,
        record: &Record,
        scopes: &[String],
        (plc, offset, width): (DeviceIndex, u32, u8),
        value: u32,
    ) {
        let place = self.reader.accessed(plc, offset, width);
        let width = place.width();
        let value = self.kept((plc, offset, width), value);
        self.register(record, scopes, (plc, offset), &place, width, value);
    }

    /// Bus, or PLC and port.
    fn scopes(&self, source: Source) -> Vec<String> {
        self.reader.names.source(source).split(':').map(str::to_owned).collect()
    }

    fn register(
        &mut self,
        record: &Record,
        scopes: &[String],
        (plc, offset): (DeviceIndex, u32),
        place: &RegisterLocation,
        width: Width,
        value: u32,
    ) {
        let name = place.name().unwrap_or_else(|| place.address());
        let (areas, name) = match name.split_once('.') {
            Some((area, name)) if !name.is_empty() && !area.starts_with('%') => (vec![area.to_owned()], name),
            _ => (Vec::new(), name.as_str()),
        };
        let scopes = [scopes, &areas].concat();
        let subject = SignalSubject::Register(plc, offset);
        let content = Content::number(8 * width.bytes(), value.into());
        let text = |name: &str| format!("{name}_text");
        // The registers of other structures at this place have the same memory, so they change as well.
        let mut here = self.overlaid.remove(&(plc, offset)).unwrap_or_default();
        for other in here.iter().filter(|it| it.width == width && (it.name != name || it.scopes != scopes)) {
            self.note(record, &other.scopes, &other.name, subject, content.clone());
            if other.has_meaning {
                let not_live = Content::Text(NOT_LIVE.to_owned());
                self.note(record, &other.scopes, &text(&other.name), SignalSubject::Other, not_live);
            }
        }
        let meaning = place.meaning(value);
        let register = OverlaidRegister {
            scopes: scopes.clone(),
            name: name.to_owned(),
            width,
            has_meaning: meaning.is_some(),
        };
        if !here.contains(&register) {
            here.push(register);
        }
        self.overlaid.insert((plc, offset), here);
        self.note(record, &scopes, name, subject, content);
        if let Some(meaning) = meaning {
            self.note(record, &scopes, &text(name), SignalSubject::Other, Content::Text(meaning));
        }
    }

    fn note(&mut self, record: &Record, scopes: &[String], name: &str, of: SignalSubject, content: Content) {
        let content = match content {
            Content::Text(text) => Content::Text(word(&text)),
            other => other,
        };
        let path = scopes.iter().map(String::as_str).chain([name]).map(word).collect();
        let Waves { paths, signals, changes, .. } = &mut self.waves;
        let signal = *paths.entry(path).or_insert(signals.len());
        if signal == signals.len() {
            signals.push(Signal { shape: content.shape(), of });
        }
        for time_us in self.window.times(record.time_us, record.count.into(), record.period_us.into()) {
            changes.push(Change { time_us, signal, content: content.clone() });
        }
    }
}

/// Returns names and texts in the form for waveforms: without blanks, and without brackets, which would mean bits.
fn word(text: &str) -> String {
    let allowed = text.trim().replace("][", "_").replace(']', "").replace('[', "_");
    let allowed = allowed.replace(|c: char| is_interpreted(c) && !c.is_whitespace(), "_");
    allowed.split_whitespace().collect::<Vec<_>>().join("_")
}

#[cfg(test)]
mod tests;
