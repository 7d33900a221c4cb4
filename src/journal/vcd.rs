//! Value change dumps (IEEE 1364), which GTKWave, Surfer and other viewers of waveforms read. Times are emulated
//! microseconds since power-on.
//!
//! A scope for each bus has its SYNC edges as events and its frames; a scope for each PLC has a scope for each area with its
//! registers. A register that has a meaning has it as text beside its value. What else happens is text under the name of
//! its kind. A register is unknown (`x`) until the journal tells what it holds.

use super::reader::Place;
use super::{Catalogue, Changed, ChannelWrite, Names, Reader, Record, Ring, Selection, Source};
use crate::can::Id;
use crate::layout::Width;
use std::collections::{BTreeMap, HashSet};
use std::io;
use vcd::{IdCode, SimulationCommand, TimescaleUnit, Value, VarType, Writer};

/// Writes those records that are wanted as a value change dump; what the others tell about the state counts for them.
///
/// # Errors
/// Of `out`.
pub fn write(
    records: &[Record],
    wanted: &Selection,
    names: Names,
    catalogue: &'static Catalogue,
    out: impl io::Write,
) -> io::Result<()> {
    let mut dump = Dump {
        reader: Reader::new(names, catalogue),
        signals: Signals::default(),
        changes: Vec::new(),
        recorded: recorded(records),
    };
    for record in records {
        dump.reader.observe(record);
        if wanted.takes(record) {
            dump.take(record);
        }
    }
    // A counted record comes when its count ends.
    dump.changes.sort_by_key(|change| change.time_us);
    dump.write(out)
}

/// Registers whose every change is told: of these, nothing else needs to be looked at.
fn recorded(records: &[Record]) -> HashSet<(u16, u32)> {
    let changed = records.iter().filter_map(|record| record.event.get::<Changed>());
    changed.map(|change| (change.plc, change.offset)).collect()
}

/// What a signal shows.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Content {
    /// A number of so many bits.
    Bits(u32, u64),
    /// A text.
    Text(String),
    /// It just happens.
    Event,
}

impl Content {
    fn var(&self) -> (VarType, u32) {
        match self {
            Content::Bits(width, _) => (VarType::Reg, *width),
            Content::Text(_) => (VarType::String, 1),
            Content::Event => (VarType::Event, 1),
        }
    }
}

/// A signal's number; its path tells where it stands.
type Signal = usize;

/// All signals by their paths: scopes, and the name.
#[derive(Default)]
struct Signals {
    numbers: BTreeMap<Vec<String>, Signal>,
    vars: Vec<(VarType, u32)>,
}

impl Signals {
    fn number(&mut self, path: Vec<String>, content: &Content) -> Signal {
        let next = self.vars.len();
        let number = *self.numbers.entry(path).or_insert(next);
        if number == next {
            self.vars.push(content.var());
        }
        number
    }
}

struct Change {
    time_us: u64,
    signal: Signal,
    content: Content,
}

struct Dump {
    reader: Reader,
    signals: Signals,
    changes: Vec<Change>,
    recorded: HashSet<(u16, u32)>,
}

impl Dump {
    fn take(&mut self, record: &Record) {
        let event = record.event;
        let scopes = self.scopes(event.source());
        if let Some(Changed { plc, offset, how, to, .. }) = event.get() {
            let place = self.reader.followed(plc, offset, how.width, how.live);
            self.register(record, &scopes, &place, how.width, to);
        } else if let Some(ChannelWrite { plc, offset, width, value }) = event.get() {
            if !self.recorded.contains(&(plc, offset)) {
                let place = self.reader.accessed(plc, offset, width);
                let width = place.width();
                self.register(record, &scopes, &place, width, value);
            }
        } else if let Some(stored) = event.stored() {
            if !self.recorded.contains(&(stored.plc, stored.offset)) {
                let place = self.reader.whole(stored.plc, stored.offset);
                let width = place.width();
                self.register(record, &scopes[..1], &place, width, stored.now);
            }
        } else if let Some(carried) = event.frame() {
            let id = match carried.frame.arbitration().id() {
                Id::Standard(id) => id.as_raw().into(),
                Id::Extended(id) => id.as_raw(),
            };
            let data = carried.frame.payload().data().iter().map(|byte| format!("{byte:02X}")).collect();
            self.note(record, &scopes, "id", Content::Bits(29, id.into()));
            self.note(record, &scopes, "data", Content::Text(data));
            let text = event.text(&mut self.reader);
            self.note(record, &scopes, "frame", Content::Text(text));
        } else if event.kind().ring() == Ring::Registers {
            self.note(record, &scopes, event.kind().name(), Content::Event);
        } else {
            let text = event.text(&mut self.reader);
            self.note(record, &scopes, event.kind().name(), Content::Text(text));
        }
    }

    /// Bus, or PLC and port.
    fn scopes(&self, source: Source) -> Vec<String> {
        self.reader.names.source(source).split(':').map(str::to_owned).collect()
    }

    fn register(&mut self, record: &Record, scopes: &[String], place: &Place, width: Width, value: u32) {
        let name = place.name().unwrap_or_else(|| place.address());
        let (areas, name) = match name.split_once('.') {
            Some((area, name)) if !name.is_empty() && !area.starts_with('%') => (vec![area.to_owned()], name),
            _ => (Vec::new(), name.as_str()),
        };
        let scopes = [scopes, &areas].concat();
        self.note(record, &scopes, name, Content::Bits(8 * width.bytes(), value.into()));
        if let Some(meaning) = place.meaning(value) {
            self.note(record, &scopes, &format!("{name}_text"), Content::Text(meaning));
        }
    }

    fn note(&mut self, record: &Record, scopes: &[String], name: &str, content: Content) {
        let names = scopes.iter().map(String::as_str).chain([name]);
        let signal = self.signals.number(names.map(word).collect(), &content);
        for time_us in record.times() {
            self.changes.push(Change { time_us, signal, content: content.clone() });
        }
    }

    fn write(&self, out: impl io::Write) -> io::Result<()> {
        let mut writer = Writer::new(out);
        writer.version(concat!("commram ", env!("CARGO_PKG_VERSION")))?;
        writer.timescale(1, TimescaleUnit::US)?;
        let codes = self.define(&mut writer)?;
        writer.enddefinitions()?;
        writer.timestamp(self.changes.first().map_or(0, |first| first.time_us))?;
        writer.begin(SimulationCommand::Dumpvars)?;
        for (code, (kind, width)) in codes.iter().zip(&self.signals.vars) {
            match kind {
                VarType::Reg => {
                    writer.change_vector(*code, std::iter::repeat_n(Value::X, *width as usize))?
                }
                VarType::String => writer.change_string(*code, "")?,
                _ => {}
            }
        }
        writer.end()?;
        let mut now = None;
        for Change { time_us, signal, content } in &self.changes {
            let Some(code) = codes.get(*signal) else { continue };
            if now != Some(*time_us) {
                writer.timestamp(*time_us)?;
                now = Some(*time_us);
            }
            match content {
                Content::Bits(width, value) => writer.change_vector(*code, bits(*width, *value))?,
                Content::Text(text) => writer.change_string(*code, &word(text))?,
                Content::Event => writer.change_scalar(*code, Value::V1)?,
            }
        }
        writer.flush()
    }

    /// Declares the signals, scope by scope; the codes are in the order of their numbers.
    fn define(&self, writer: &mut Writer<impl io::Write>) -> io::Result<Vec<IdCode>> {
        let mut codes = vec![IdCode::FIRST; self.signals.vars.len()];
        let mut open: &[String] = &[];
        for (path, number) in &self.signals.numbers {
            let Some((name, scopes)) = path.split_last() else { continue };
            let common = open.iter().zip(scopes).take_while(|(one, other)| one == other).count();
            for _ in common..open.len() {
                writer.upscope()?;
            }
            for scope in &scopes[common..] {
                writer.add_module(scope)?;
            }
            open = scopes;
            if let (Some(code), Some((kind, width))) =
                (codes.get_mut(*number), self.signals.vars.get(*number))
            {
                *code = writer.add_var(*kind, *width, name, None)?;
            }
        }
        for _ in open {
            writer.upscope()?;
        }
        Ok(codes)
    }
}

/// The highest bit first.
fn bits(width: u32, value: u64) -> impl Iterator<Item = Value> {
    (0..width).rev().map(move |bit| (value >> bit & 1 == 1).into())
}

/// As names and texts stand in a dump: without blanks, and without brackets, which would mean bits.
fn word(text: &str) -> String {
    let allowed = text.trim().replace("][", "_").replace(']', "").replace('[', "_");
    allowed.split_whitespace().collect::<Vec<_>>().join("_")
}
