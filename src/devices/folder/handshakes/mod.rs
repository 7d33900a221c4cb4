//! `handshakes.toml`: handshakes of a device in a folder that need no script.
//!
//! Each table of the file becomes a [`Row`]. The firmware polls the rows in the order of these kinds: ready
//! flags, answers, toggle bits, counters, watchdogs, mirrors.

mod file;
mod firmware;
mod rule;

#[cfg(feature = "cli")]
pub(super) use file::keys;
pub(super) use firmware::Handshakes;
use rule::{Change, Rule};

use super::card::Place;
use super::dp_master::ProcessImage;
use super::own_faults::{OwnFault, OwnField};
use super::own_records::{MOST_KINDS, OwnRecord};
use super::{FolderError, own_faults, state_word, tables};
use crate::devices::profibus_bus;
use crate::layout::{DeviceLayout, Owner, Provenance, RegisterRef, Width, did_you_mean};
use crate::time::short;
use commram_layoutc::model;
use core::mem;
use core::ops::Range;
use file::File;
use std::path::Path;
use toml::Spanned;

/// Name of the file in the folder.
pub(super) const FILE: &str = "handshakes.toml";
/// Maximum number of tables in a file. There is a limit because the firmware polls each table in every
/// processor cycle.
pub const MOST_ROWS: usize = 256;
/// Maximum number of registers that the mirrors of a file copy.
pub const MOST_MIRRORED: usize = 4096;
/// Shortest time between two counts of a counter in microseconds. There is a limit because each count is an
/// event of the plant.
const SHORTEST_COUNT_US: u64 = 100;

/// A table of the file: a behaviour, and the source of the fact.
#[derive(Debug)]
pub struct Row {
    /// Kind of the table: `answer`, `watchdog` ...
    pub kind: &'static str,
    /// Name of the register that the program writes, or that the device changes.
    pub register: String,
    /// Description of the behaviour.
    pub behaviour: String,
    /// Pages of the manual.
    pub page: String,
    /// Source of the behaviour.
    pub source: Provenance,
    rule: Rule,
    /// Index of the `[[fault]]` that disturbs this behaviour as long as it acts.
    unless_fault: Option<usize>,
}

impl Row {
    /// Returns the index of the `[[fault]]` that disturbs this behaviour.
    pub(super) fn unless_fault(&self) -> Option<usize> {
        self.unless_fault
    }
}

/// The content of a file `handshakes.toml`.
#[derive(Debug, Default)]
pub(super) struct Tables {
    /// The behaviour of the device.
    pub(super) rows: Vec<Row>,
    /// Kinds of journal records that the device defines.
    pub(super) records: Vec<OwnRecord>,
    /// Kinds of faults that the device defines.
    pub(super) faults: Vec<OwnFault>,
    /// The process image at the PROFIBUS port.
    pub(super) image: Option<ProcessImage>,
}

/// Reads the text of the file for a device with this layout.
///
/// # Errors
/// [`FolderError::Table`] with the line.
pub(super) fn read(path: &Path, text: &str, layout: &'static DeviceLayout) -> Result<Tables, FolderError> {
    let mut reader = Reader { path, text, layout, faults: Vec::new() };
    let mut file: File = toml::from_str(text).map_err(|error| {
        let what = error.message().lines().collect::<Vec<_>>().join(", ");
        reader.wrong(error.span().unwrap_or(0..0), what)
    })?;
    let records = reader.records(mem::take(&mut file.record))?;
    reader.faults = reader.read_faults(mem::take(&mut file.fault))?;
    let image = file.process_image.take().map(|it| reader.image(it)).transpose()?;
    let (image, row) = image.unzip();
    let mut rows = reader.rows(file)?;
    rows.extend(row);
    Ok(Tables { rows, records, faults: reader.faults, image })
}

/// Returns the faults that the text declares. The other tables are not checked, because a client of a running
/// device does not need them.
///
/// # Errors
/// [`FolderError::Table`] with the line.
pub(super) fn read_faults(
    path: &Path,
    text: &str,
    layout: &'static DeviceLayout,
) -> Result<Vec<OwnFault>, FolderError> {
    let reader = Reader { path, text, layout, faults: Vec::new() };
    let file: File = toml::from_str(text)
        .map_err(|error| reader.wrong(error.span().unwrap_or(0..0), error.message().to_owned()))?;
    reader.read_faults(file.fault)
}

/// For an answer, returns the offset of the register and the request.
fn answer_of(row: &Row) -> Option<(u32, u16)> {
    match &row.rule {
        Rule::Answer { at, request, .. } => Some((at.offset, *request)),
        _ => None,
    }
}

/// The text of the file, and the layout that defines the names in it.
struct Reader<'a> {
    path: &'a Path,
    text: &'a str,
    layout: &'static DeviceLayout,
    /// The faults that tables may name.
    faults: Vec<OwnFault>,
}

impl Reader<'_> {
    fn wrong(&self, place: Range<usize>, what: String) -> FolderError {
        FolderError::Table { path: self.path.to_owned(), line: self.line(place.start), what }
    }

    fn line(&self, byte: usize) -> usize {
        1 + self.text.as_bytes().iter().take(byte).filter(|byte| **byte == b'\n').count()
    }

    fn rows(&self, file: File) -> Result<Vec<Row>, FolderError> {
        let File { ready, answer, toggle, counter, watchdog, mirror, process_image: _, record: _, fault: _ } =
            file;
        let mut rows = Vec::new();
        ready.into_iter().try_for_each(|it| self.ready(it).map(|row| rows.push(row)))?;
        for it in answer {
            let place = it.request.span();
            let row = self.answer(it)?;
            if rows.iter().any(|known| answer_of(known).is_some_and(|it| Some(it) == answer_of(&row))) {
                let what = format!("another table answers this request in {}", row.register);
                return Err(self.wrong(place, what));
            }
            rows.push(row);
        }
        toggle.into_iter().try_for_each(|it| self.toggle(it).map(|row| rows.push(row)))?;
        counter.into_iter().try_for_each(|it| self.counter(it).map(|row| rows.push(row)))?;
        watchdog.into_iter().try_for_each(|it| self.watchdog(it).map(|row| rows.push(row)))?;
        let mut mirrored = 0;
        for it in mirror {
            rows.push(self.mirror(it, &mut mirrored)?);
        }
        if rows.len() > MOST_ROWS {
            return Err(self.wrong(0..0, format!("{} tables; a device has at most {MOST_ROWS}", rows.len())));
        }
        Ok(rows)
    }

    fn records(&self, tables: Vec<Spanned<file::Record>>) -> Result<Vec<OwnRecord>, FolderError> {
        let mut records: Vec<OwnRecord> = Vec::new();
        for table in tables {
            let place = table.span();
            let file::Record { name, text, fields, page } = table.into_inner();
            let record = OwnRecord { name, text, fields, page };
            record.check().map_err(|what| self.wrong(place.clone(), what))?;
            if records.iter().any(|known| known.name == record.name) {
                return Err(self.wrong(place, format!("another [[record]] has the name `{}`", record.name)));
            }
            records.push(record);
            if records.len() > MOST_KINDS {
                return Err(self.wrong(place, format!("a device has at most {MOST_KINDS} kinds of records")));
            }
        }
        Ok(records)
    }

    fn read_faults(&self, tables: Vec<Spanned<file::Fault>>) -> Result<Vec<OwnFault>, FolderError> {
        let mut faults: Vec<OwnFault> = Vec::new();
        for table in tables {
            let place = table.span();
            let file::Fault { name, text, fields, page } = table.into_inner();
            let field = |file::FaultField { name, text, from, to, default }| OwnField {
                name,
                text,
                from,
                to,
                default,
            };
            let fields = fields.into_iter().map(field).collect();
            let fault = OwnFault { name, text, fields, page, line: self.line(place.start) };
            fault.check().map_err(|what| self.wrong(place.clone(), what))?;
            if faults.iter().any(|known| known.name == fault.name) {
                return Err(self.wrong(place, format!("another [[fault]] has the name `{}`", fault.name)));
            }
            faults.push(fault);
            if faults.len() > own_faults::MOST_KINDS {
                let most = own_faults::MOST_KINDS;
                return Err(self.wrong(place, format!("a device has at most {most} kinds of faults")));
            }
        }
        Ok(faults)
    }

    /// Returns the index of the fault that disturbs a behaviour. Adds the fault to the description of the
    /// behaviour.
    fn unless(
        &self,
        name: Option<&Spanned<String>>,
        behaviour: &mut String,
    ) -> Result<Option<usize>, FolderError> {
        let Some(name) = name else { return Ok(None) };
        let wanted = name.get_ref();
        let index = self.faults.iter().position(|fault| fault.name == *wanted);
        if index.is_none() {
            let near = did_you_mean(wanted, self.faults.iter().map(|fault| fault.name.as_str()));
            let what = format!("the file has no [[fault]] with the name `{wanted}`{near}");
            return Err(self.wrong(name.span(), what));
        }
        *behaviour += &format!("; not while a fault {wanted} acts");
        Ok(index)
    }

    fn ready(&self, it: file::Ready) -> Result<Row, FolderError> {
        let (state, state_text) = self.changes(&it.state)?;
        let behaviour = format!("after power-on and {}: {state_text}", short(it.after.0));
        let register = it.state.first().map(|change| change.get_ref().register.clone());
        let rule = Rule::Ready { state, after_us: it.after.0 };
        Ok(row("ready", register.unwrap_or_default(), behaviour, (it.page, &it.source), rule, None))
    }

    fn answer(&self, it: file::Answer) -> Result<Row, FolderError> {
        let at = self.written_by_both(&it.register)?;
        let [request, answer] = [&it.request, &it.answer];
        for value in [Some(request), Some(answer), it.then.as_ref()].into_iter().flatten() {
            self.fits(at, value.span(), *value.get_ref())?;
            if *value.get_ref() > u32::from(u16::MAX) {
                let what = "requests and answers are at most 16#FFFF, as in the journal".to_owned();
                return Err(self.wrong(value.span(), what));
            }
        }
        if request.get_ref() == answer.get_ref() {
            return Err(
                self.wrong(answer.span(), "the answer is the request; a program cannot see it".to_owned())
            );
        }
        let (state, state_text) = self.changes(&it.state)?;
        let mut behaviour = format!(
            "16#{:04X} is answered by 16#{:04X} after {}",
            request.get_ref(),
            answer.get_ref(),
            short(it.after.0)
        );
        if let Some(then) = it.then.as_ref().filter(|then| then.get_ref() == request.get_ref()) {
            let what = "the value after the answer is the request; the device would answer itself".to_owned();
            return Err(self.wrong(then.span(), what));
        }
        if let Some(after) = it.then_after.as_ref().filter(|_| it.then.is_none()) {
            let what = "`then_after` needs `then`, the value that follows the answer".to_owned();
            return Err(self.wrong(after.span(), what));
        }
        let then_after_us = it.then_after.as_ref().map_or(0, |after| after.get_ref().0);
        let then = it.then.map(|then| (*then.get_ref() as u16, then_after_us));
        if let Some((then, after_us)) = then {
            behaviour += &format!(", then 16#{then:04X} after {}", short(after_us));
        }
        if !state_text.is_empty() {
            behaviour += &format!("; with the answer {state_text}");
        }
        let unless = self.unless(it.unless_fault.as_ref(), &mut behaviour)?;
        let (request, answer) = (*request.get_ref() as u16, *answer.get_ref() as u16);
        let rule = Rule::Answer { at, request, answer, after_us: it.after.0, then, state };
        Ok(row("answer", it.register.into_inner(), behaviour, (it.page, &it.source), rule, unless))
    }

    fn toggle(&self, it: file::Toggle) -> Result<Row, FolderError> {
        let (from, to) = (self.place(&it.register)?, self.written_by_firmware(&it.acknowledge)?);
        let bits = *it.bits.get_ref();
        self.fits(from, it.bits.span(), bits)?;
        self.fits(to, it.bits.span(), bits)?;
        if bits == 0 {
            return Err(self.wrong(it.bits.span(), "`bits` is a mask of at least one bit".to_owned()));
        }
        let acknowledge = it.acknowledge.into_inner();
        let mut behaviour = format!("bits 16#{bits:X} appear in {acknowledge} after {}", short(it.after.0));
        let unless = self.unless(it.unless_fault.as_ref(), &mut behaviour)?;
        let rule = Rule::Toggle { from, to, bits, after_us: it.after.0 };
        Ok(row("toggle", it.register.into_inner(), behaviour, (it.page, &it.source), rule, unless))
    }

    fn counter(&self, it: file::Counter) -> Result<Row, FolderError> {
        let at = self.written_by_firmware(&it.register)?;
        let every_us = it.every.get_ref().0;
        if every_us < SHORTEST_COUNT_US {
            let what = format!("`every` is {}; it is at least {SHORTEST_COUNT_US} us", short(every_us));
            return Err(self.wrong(it.every.span(), what));
        }
        let mut behaviour = format!("counts every {}", short(every_us));
        let unless = self.unless(it.unless_fault.as_ref(), &mut behaviour)?;
        let rule = Rule::Counter { at, every_us };
        Ok(row("counter", it.register.into_inner(), behaviour, (it.page, &it.source), rule, unless))
    }

    fn watchdog(&self, it: file::Watchdog) -> Result<Row, FolderError> {
        let register = self.register(it.register.get_ref(), it.register.span())?;
        if register.register.owner == Owner::Firmware {
            let what =
                format!("only the device writes {register}; a watchdog expects changes of the program");
            return Err(self.wrong(it.register.span(), what));
        }
        let at = Place::of(&register);
        let within_us = it.within.get_ref().0;
        if within_us == 0 {
            return Err(self.wrong(it.within.span(), "`within` is more than 0".to_owned()));
        }
        let (state, state_text) = self.changes(&it.state)?;
        let (recovered, back) = self.changes(&it.recovered)?;
        let mut behaviour = format!("without a change for {}: {state_text}", short(within_us));
        if !back.is_empty() {
            behaviour += &format!("; with the next change {back}");
        }
        let rule = Rule::Watchdog { at, within_us, state, recovered };
        Ok(row("watchdog", it.register.into_inner(), behaviour, (it.page, &it.source), rule, None))
    }

    fn mirror(&self, it: file::Mirror, mirrored: &mut usize) -> Result<Row, FolderError> {
        let of = |name: &Spanned<String>| {
            self.layout.registers(name.get_ref()).map_err(|error| self.wrong(name.span(), error.to_string()))
        };
        let (from, to) = (of(&it.from)?, of(&it.to)?);
        *mirrored += to.len();
        let widths = |registers: &[RegisterRef]| -> Vec<_> {
            registers.iter().map(|register| register.address().width()).collect()
        };
        let refused = if widths(&from) != widths(&to) {
            Some(format!("{} and {} have other registers", it.from.get_ref(), it.to.get_ref()))
        } else if to.iter().any(|register| register.register.owner == Owner::Plc) {
            Some(format!("the program writes {}; a device mirrors into its own registers", it.to.get_ref()))
        } else if let Some(what) = to.iter().find_map(|register| state_word::may_change(register).err()) {
            Some(what)
        } else if *mirrored > MOST_MIRRORED {
            Some(format!(
                "the mirrors have {mirrored} registers up to here; they have at most {MOST_MIRRORED}"
            ))
        } else {
            None
        };
        if let Some(what) = refused {
            return Err(self.wrong(it.to.span(), what));
        }
        let mut behaviour = format!("appears in {}", it.to.get_ref());
        let unless = self.unless(it.unless_fault.as_ref(), &mut behaviour)?;
        let pairs = from.iter().zip(&to).map(|(from, to)| (Place::of(from), Place::of(to))).collect();
        let rule = Rule::Mirror { pairs };
        Ok(row("mirror", it.from.into_inner(), behaviour, (it.page, &it.source), rule, unless))
    }

    /// Returns the process image, and the row that describes it.
    fn image(&self, it: file::Image) -> Result<(ProcessImage, Row), FolderError> {
        if !self.layout.ports.iter().any(|port| port.medium == profibus_bus::FAMILY) {
            let what = "a process image needs a port; declare it in device.toml: \
                port = [{ name = \"dp\", number = 2, medium = \"profibus\", roles = [\"master\"] }]";
            return Err(self.wrong(it.outputs.span(), what.to_owned()));
        }
        let outputs = self.bytes(&it.outputs, false)?;
        let inputs = self.bytes(&it.inputs, true)?;
        let behaviour = format!(
            "outputs on PROFIBUS while {} is not 0; inputs are {}",
            it.run.get_ref(),
            it.inputs.get_ref()
        );
        let (run, slaves, active) = (
            self.place(&it.run)?,
            self.written_by_firmware(&it.slaves)?,
            self.written_by_firmware(&it.active)?,
        );
        let row = row(
            "process_image",
            it.outputs.into_inner(),
            behaviour,
            (it.page, &it.source),
            Rule::Image,
            None,
        );
        Ok((ProcessImage { outputs, inputs, run, slaves, active }, row))
    }

    /// Returns the range of consecutive bytes in the image of the device.
    fn bytes(&self, name: &Spanned<String>, is_input: bool) -> Result<Range<u32>, FolderError> {
        let wrong = |what| self.wrong(name.span(), what);
        let found = self.layout.registers(name.get_ref()).map_err(|error| wrong(error.to_string()))?;
        if is_input {
            found.iter().try_for_each(|register| self.may_write(register, name.span()))?;
        }
        let first = found.first().map_or(0, RegisterRef::offset);
        let is_next = |(at, register): (u32, &RegisterRef)| {
            register.offset() == first + at && register.address().width() == Width::Byte
        };
        if !(0..).zip(&found).all(is_next) {
            return Err(wrong(format!("{} is not an array of bytes", name.get_ref())));
        }
        Ok(first..first + found.len() as u32)
    }

    fn register(&self, name: &str, place: Range<usize>) -> Result<RegisterRef, FolderError> {
        self.layout.register(name).map_err(|error| self.wrong(place, error.to_string()))
    }

    fn place(&self, name: &Spanned<String>) -> Result<Place, FolderError> {
        Ok(Place::of(&self.register(name.get_ref(), name.span())?))
    }

    fn written_by_both(&self, name: &Spanned<String>) -> Result<Place, FolderError> {
        let register = self.register(name.get_ref(), name.span())?;
        match register.register.owner {
            Owner::Both => Ok(Place::of(&register)),
            _ => {
                let what =
                    format!("{register} has one writer; a register with an answer has the owner \"both\"");
                Err(self.wrong(name.span(), what))
            }
        }
    }

    fn written_by_firmware(&self, name: &Spanned<String>) -> Result<Place, FolderError> {
        let register = self.register(name.get_ref(), name.span())?;
        self.may_write(&register, name.span())?;
        Ok(Place::of(&register))
    }

    fn may_write(&self, register: &RegisterRef, place: Range<usize>) -> Result<(), FolderError> {
        state_word::may_change(register).map_err(|what| self.wrong(place, what))
    }

    fn fits(&self, at: Place, place: Range<usize>, value: u32) -> Result<(), FolderError> {
        if value & !at.mask() == 0 {
            return Ok(());
        }
        Err(self.wrong(
            place,
            format!("16#{value:X} does not fit the register of {} bits", at.mask().count_ones()),
        ))
    }

    /// Returns the changes, and their description.
    fn changes(&self, changes: &[Spanned<file::Change>]) -> Result<(Vec<Change>, String), FolderError> {
        let mut texts = Vec::new();
        let mut checked = Vec::new();
        for spanned in changes {
            let file::Change { register, value, set, clear } = spanned.get_ref();
            let found = self.register(register, spanned.span())?;
            self.may_write(&found, spanned.span())?;
            let at = Place::of(&found);
            for bits in [value.unwrap_or(0), *set, *clear] {
                self.fits(at, spanned.span(), bits)?;
            }
            let (clear, set) = match value {
                Some(value) if *set == 0 && *clear == 0 => (at.mask(), *value),
                None if set & clear == 0 && set | clear != 0 => (*clear, *set),
                _ => {
                    let what =
                        "a change has either a `value`, or different bits to `set` and to `clear`".to_owned();
                    return Err(self.wrong(spanned.span(), what));
                }
            };
            texts.push(match value {
                Some(value) => format!("{register} = 16#{value:X}"),
                None => format!("{register} sets 16#{set:X} and clears 16#{clear:X}"),
            });
            checked.push(Change { at, clear, set });
        }
        Ok((checked, texts.join(", ")))
    }
}

fn row(
    kind: &'static str,
    register: String,
    behaviour: String,
    (page, source): (String, &model::Provenance),
    rule: Rule,
    unless_fault: Option<usize>,
) -> Row {
    // A row is never freed, as the tables of a layout are never freed. So its texts can be leaked.
    let source = tables::provenance(source, |text| Box::leak(text.to_owned().into_boxed_str()));
    Row { kind, register, behaviour, page, source, rule, unless_fault }
}
