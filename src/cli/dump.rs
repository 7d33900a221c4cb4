//! `commram dump`: registers with their meaning.

use super::Instance;
use super::complete;
use super::device::{NameChecks, on_any_device};
use super::error::CliError;
use super::given;
use super::peek::{RegisterReading, number};
use super::place::{is_live, meaning_in, status_of, without_twins};
use super::session::{Read, Session, Snapshot, number_of_plc};
use super::table::{self, Format, FormatArg};
use super::time;
use crate::identity::DeviceIndex;
use crate::journal::Names;
use crate::layout::{
    Address, Area, AreaOrRegisters, DeviceFit, DeviceLayout, Fit, LayoutError, NamedLocation, RegisterPhase,
    RegisterRef, Width, format_value, split_plc,
};
use core::ops::Range;

/// Maximum length of one block read, in bytes.
const MAX_BLOCK: u32 = 65_536;

/// Width of the values in a dump of an area of plain RAM.
const PLAIN_WIDTH: Width = Width::Dword;

/// Show the registers that differ from their reset value, with their meaning.
///
/// A dump is a snapshot: all registers at one moment of emulated time. Reading changes nothing. Where structures
/// overlay each other (initialization and cyclic structures of a node), the dump shows the live one, which follows
/// from w_OPTION_STATUS.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram dump
  commram dump node2
  commram dump 'node2.a_RD_BMARRAY[3]' --full
  commram dump 'node*.*STATUS*'
  commram dump retain
  commram dump line2:node1 --format csv")]
pub(crate) struct Args {
    /// Blocks, arrays, registers, patterns ('node2.*STATUS*', 'node2.a_STAT_SL[0..3]') or addresses, `retain` for the
    /// retain flags; a PLC with a colon alone means all blocks of that PLC [default: everything]
    #[arg(add = complete::blocks(), value_name = "BLOCK", value_parser = given::text(given::BLOCK))]
    blocks: Vec<String>,
    /// Also registers that hold their reset value
    #[arg(long = "full", alias = "all")]
    all: bool,
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

/// The part of an area in a dump.
struct Selection {
    area: &'static Area,
    /// Selected registers; `None` selects all registers of the area.
    registers: Option<Vec<RegisterRef>>,
    /// Selected address in plain RAM; `None` selects all addresses.
    place: Option<Address>,
}

impl Selection {
    fn whole(area: &'static Area) -> Self {
        Selection { area, registers: None, place: None }
    }
}

/// Prints the dump.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    print(&args.instance, &args.blocks, args.all, args.format.format)
}

/// Prints the registers of the blocks that differ from their reset value.
///
/// # Errors
/// The emulator cannot be reached, or no PLC, block or register has such a name.
pub(crate) fn show(instance: &Instance, blocks: &[String]) -> Result<(), CliError> {
    print(instance, blocks, false, Format::Text)
}

fn print(instance: &Instance, blocks: &[String], all: bool, format: Format) -> Result<(), CliError> {
    let checks = NameChecks::new(instance);
    blocks.iter().try_for_each(|name| check(&checks, name))?;
    drop(checks);
    let session = Session::open_for_reading(instance)?;
    let blocks = Blocks::find(&session, blocks)?;
    let snapshot = session.read(&blocks.reads())?;
    let views = views(&session, &blocks.0, &snapshot, &snapshot.data);
    let rows = views.iter().flat_map(View::rows);
    let wanted = rows.filter(|row| all || row.differs || row.holding.forced).map(|row| row.holding);
    // A byte of registers takes up to 200 bytes of JSON, and a device may have some MiB of registers.
    table::print_each(format, wanted, |rows| {
        let head = format!("instance '{}' at {}\n", instance.name(), time::seconds(snapshot.time_us));
        head + &text(rows, views.iter().any(View::has_live_registers), phase_register(&views))
    })
}

/// Blocks, arrays and registers of PLCs.
pub(crate) struct Blocks(Vec<Part>);

/// All registers of some blocks at one moment.
pub(crate) struct Dump {
    /// Emulated time, in microseconds.
    pub time_us: u64,
    /// The displayed registers with their values.
    pub rows: Vec<DumpRow>,
    /// The register that shows which registers are live, if structures overlay each other.
    pub phase_register: Option<&'static str>,
}

pub(crate) struct DumpRow {
    /// Value of the register.
    pub holding: RegisterReading,
    /// True if the value is not the reset value.
    pub differs: bool,
}

/// Checks the name of a block on the devices of the program. If none of them has the block, checks it on the devices of
/// the instance, if it runs.
///
/// # Errors
/// No device has such a block or register.
pub(crate) fn check(checks: &NameChecks, name: &str) -> Result<(), CliError> {
    let look_up = |fitted: &DeviceFit| select(fitted, split_plc(name).1).map(drop);
    on_any_device(look_up).or_else(|refusal| {
        let find = |session: &Session| Blocks::find(session, &[name.to_owned()]).map(drop);
        checks.answer(refusal, find, look_up)
    })
}

impl Blocks {
    /// Finds the blocks of an instance. Without names, returns all areas with registers of all PLCs.
    ///
    /// # Errors
    /// No PLC, block or register has this name.
    pub(crate) fn find(session: &Session, names: &[String]) -> Result<Self, CliError> {
        let mut parts = Vec::new();
        let mut add = |plc: DeviceIndex, name: &str| {
            let fitted = session.fitted(plc);
            for selection in select(&fitted, name)? {
                let area = selection.area;
                if selection.registers.is_none() && fitted.area(area) == Fit::Empty {
                    fitted.registers_at(fitted.device().at(Width::Byte, area.first), None)?;
                }
                let bytes = selection.bytes(fitted.device(), || session.retain_bytes(plc))?;
                parts.push(Part { plc, bytes, selection });
            }
            Ok::<_, CliError>(())
        };
        for name in names {
            let (plc, name) = split_plc(name);
            add(session.plc(plc, name)?, name)?;
        }
        if names.is_empty() {
            let mut plcs = DeviceIndex::first(session.plcs().len());
            plcs.try_for_each(|plc| add(plc, ""))?;
        }
        // Sorts by PLC. The sort is stable, so the parts of a PLC stay in the order of the addresses or of the
        // arguments.
        parts.sort_by_key(|part| part.plc);
        Ok(Blocks(parts))
    }

    /// Requests the emulator to record changes from now on. Returns the number of the first change and the number of
    /// the history that contains it.
    ///
    /// # Errors
    /// The emulator has ended, or too many registers are followed.
    pub(crate) fn follow(&self, session: &Session) -> Result<(u64, u16), CliError> {
        use crate::request::Op;

        Self::follow_stretches(session, &self.stretches())?;
        let (_, end, turn) = session.ask(Op::Changes { from: 0, max: 0 })?.turned_changes()?;
        Ok((end, turn.number))
    }

    /// Requests the emulator to record changes of these bytes from now on. Each range consists of the index of the PLC,
    /// the first byte in the image, and the number of bytes.
    ///
    /// # Errors
    /// Returns the errors of [`Blocks::follow`].
    pub(crate) fn follow_stretches(
        session: &Session,
        stretches: &[(DeviceIndex, u32, u32)],
    ) -> Result<(), CliError> {
        use crate::journal::Keep;
        use crate::request::Op;

        let follow = |&(plc, offset, len): &(DeviceIndex, u32, u32)| Op::Follow {
            plc,
            offset,
            len,
            keep: Keep::ForOnlookers,
        };
        let ops: Vec<_> = stretches.iter().map(follow).collect();
        session.request_in_parts(&ops)?.into_iter().try_for_each(|reply| Ok(reply.written()?))
    }

    /// Returns the selected bytes. Each range consists of the index of the PLC, the first byte in the image, and the
    /// number of bytes.
    pub(crate) fn stretches(&self) -> Vec<(DeviceIndex, u32, u32)> {
        let of_plc = |part: &Part| {
            let plc = part.plc;
            part.stretches().into_iter().map(move |(offset, len)| (plc, offset, len)).collect::<Vec<_>>()
        };
        self.0.iter().flat_map(of_plc).collect()
    }

    /// Reads all blocks at one moment of emulated time.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(crate) fn read(&self, session: &Session) -> Result<Dump, CliError> {
        let reads = self.reads();
        let snapshot = session.read(&reads)?;
        let views = views(session, &self.0, &snapshot, &snapshot.data);
        Ok(Dump {
            time_us: snapshot.time_us,
            rows: views.iter().flat_map(View::rows).collect(),
            phase_register: phase_register(&views),
        })
    }

    /// Returns the read operations for these blocks.
    pub(crate) fn reads(&self) -> Vec<Read> {
        self.0.iter().flat_map(Part::reads).collect()
    }

    /// Returns the values of the registers, live or not. `data` contains the bytes of the registers in `snapshot`.
    pub(crate) fn holdings(
        &self,
        session: &Session,
        snapshot: &Snapshot,
        data: &[Vec<u8>],
    ) -> Vec<RegisterReading> {
        let views = views(session, &self.0, snapshot, data);
        views.iter().flat_map(View::rows).map(|row| row.holding).collect()
    }
}

/// Finds the area and registers of a device by name; an empty name selects all areas with registers.
fn select(fitted: &DeviceFit, name: &str) -> Result<Vec<Selection>, LayoutError> {
    let device = fitted.device();
    if name.is_empty() {
        let described = device.named_areas().filter(|area| fitted.placed(area).next().is_some());
        return Ok(described.map(Selection::whole).collect());
    }
    match NamedLocation::parse(fitted, name) {
        Ok(place) => place.whole_only()?,
        Err(refusal @ LayoutError::BadBit { .. }) => return Err(refusal),
        // The text may name a block, an array or a pattern.
        Err(_) => {}
    }
    let selection = if name.starts_with('%') {
        let address = device.address(name)?;
        let area = device.area_at(address)?;
        if area.structures.is_empty() {
            Selection { area, registers: None, place: Some(address) }
        } else {
            let registers = Some(without_twins(fitted.registers_at(address, None)?));
            Selection { area, registers, place: None }
        }
    } else if let Some(retain) = device.retain.filter(|retain| retain.area.name == name) {
        Selection::whole(&retain.area)
    } else {
        match fitted.area_or_registers(name)? {
            AreaOrRegisters::Area(area) => Selection::whole(area),
            AreaOrRegisters::Registers(registers) => {
                let same_area = |one: &RegisterRef, other: &RegisterRef| core::ptr::eq(one.area, other.area);
                let areas = registers.chunk_by(same_area).filter_map(|registers| {
                    let area = registers.first()?.area;
                    Some(Selection { area, registers: Some(registers.to_vec()), place: None })
                });
                return Ok(areas.collect());
            }
        }
    };
    Ok(vec![selection])
}

/// Returns the bytes that a name selects in a plant that does not run yet. Each range consists of the index of the PLC,
/// the first byte in the image, and the number of bytes. `retain_bytes` are the sizes of the retain flags of the PLCs.
///
/// # Errors
/// No PLC, block or register has this name.
pub(crate) fn stretches(
    instance: &str,
    names: &Names,
    retain_bytes: &[u32],
    text: &str,
) -> Result<Vec<(DeviceIndex, u32, u32)>, CliError> {
    let (plc, name) = split_plc(text);
    let plc = number_of_plc(instance, &names.plcs, plc, name)?;
    let mut found = Vec::new();
    let retain_bytes = || Ok::<_, CliError>(retain_bytes.get(plc.index()).copied().unwrap_or_default());
    for selection in select(&names.fitted(plc), name)? {
        let bytes = selection.bytes(names.device(plc), retain_bytes)?;
        found.extend(selection.stretches(bytes).into_iter().map(|(first, len)| (plc, first, len)));
    }
    Ok(found)
}

struct Part {
    plc: DeviceIndex,
    selection: Selection,
    /// The bytes to read, in the image.
    bytes: Range<u32>,
}

impl Selection {
    /// Returns the range to read: the whole area of plain RAM, otherwise the part of the area that has registers.
    fn bytes(
        &self,
        device: &DeviceLayout,
        retain_bytes: impl FnOnce() -> Result<u32, CliError>,
    ) -> Result<Range<u32>, CliError> {
        let area = self.area;
        if let Some(place) = self.place {
            return Ok(place.offset()..place.offset() + place.width().bytes());
        }
        let described = area.structures.iter().map(|placed| placed.structure.bytes).max();
        let len = match described {
            Some(bytes) => bytes,
            None if device.is_retain(area.first) => retain_bytes()?,
            None => area.bytes,
        };
        Ok(area.first..area.first + len)
    }

    /// Returns the selected bytes as offsets and lengths: one pair for each register, or pairs for the whole range
    /// `bytes`.
    fn stretches(&self, bytes: Range<u32>) -> Vec<(u32, u32)> {
        match &self.registers {
            Some(registers) => registers.iter().map(|it| (it.offset(), it.width())).collect(),
            None => {
                let Range { start, end } = bytes;
                let stretch = |first: u32| (first, MAX_BLOCK.min(end - first));
                (start..end).step_by(MAX_BLOCK as usize).map(stretch).collect()
            }
        }
    }
}

impl Part {
    fn stretches(&self) -> Vec<(u32, u32)> {
        self.selection.stretches(self.bytes.clone())
    }

    fn reads(&self) -> Vec<Read> {
        let Range { start, end } = self.bytes;
        let block = |offset: u32| Read::Block { plc: self.plc, offset, len: MAX_BLOCK.min(end - offset) };
        (start..end).step_by(MAX_BLOCK as usize).map(block).collect()
    }
}

fn views<'a>(
    session: &Session,
    parts: &'a [Part],
    snapshot: &'a Snapshot,
    data: &[Vec<u8>],
) -> Vec<View<'a>> {
    let mut blocks = data.iter();
    let view = |part: &'a Part| View {
        selection: &part.selection,
        first: part.bytes.start,
        bytes: blocks.by_ref().take(part.reads().len()).flatten().copied().collect(),
        prefix: session.prefix(part.plc),
        plc: session.plcs().get(part.plc.index()).cloned().unwrap_or_default(),
        number: part.plc,
        fitted: session.fitted(part.plc),
        snapshot,
    };
    parts.iter().map(view).collect()
}

/// Returns the register that shows which registers are live, if structures overlay each other.
fn phase_register(views: &[View<'_>]) -> Option<&'static str> {
    views.iter().find_map(|view| view.area().phases).map(|phases| phases.register)
}

/// A selection with the bytes of its area.
struct View<'a> {
    selection: &'a Selection,
    /// Offset of the first byte in the image.
    first: u32,
    bytes: Vec<u8>,
    plc: String,
    prefix: String,
    number: DeviceIndex,
    fitted: DeviceFit,
    snapshot: &'a Snapshot,
}

impl View<'_> {
    fn forced(&self, offset: u32, len: u32) -> bool {
        self.snapshot.is_forced(self.number, offset, len)
    }

    fn area(&self) -> &'static Area {
        self.selection.area
    }

    /// Returns the value of the register, or of the memory, of `len` bytes at `offset` of the image.
    fn value(&self, offset: u32, len: u32) -> u32 {
        let start = (offset - self.first) as usize;
        number(self.bytes.get(start..start + len as usize).unwrap_or_default())
    }

    fn live(&self) -> RegisterPhase {
        let status = status_of(self.area()).map(|status| self.value(status.offset(), status.width()));
        self.area().phase(status)
    }

    /// Returns the selected registers that are live.
    fn live_registers(&self) -> Vec<RegisterRef> {
        let live = self.live();
        match &self.selection.registers {
            Some(registers) => registers.iter().filter(|register| is_live(register, live)).copied().collect(),
            None => self.fitted.registers_in(self.area(), live).collect(),
        }
    }

    /// Returns the selected registers that are live. If none of the named registers is live, returns all of them.
    fn registers(&self) -> Vec<RegisterRef> {
        let live = self.live_registers();
        match &self.selection.registers {
            Some(named) if live.is_empty() => named.clone(),
            _ => live,
        }
    }

    fn has_live_registers(&self) -> bool {
        self.area().structures.is_empty() || !self.live_registers().is_empty()
    }

    fn rows(&self) -> Box<dyn Iterator<Item = DumpRow> + '_> {
        if self.area().structures.is_empty() {
            return Box::new(self.plain());
        }
        Box::new(self.registers().into_iter().map(|register| self.row(&register)))
    }

    fn row(&self, register: &RegisterRef) -> DumpRow {
        let value = self.value(register.offset(), register.width());
        DumpRow { holding: self.holding(register, value), differs: value != register.reset() }
    }

    fn holding(&self, register: &RegisterRef, value: u32) -> RegisterReading {
        RegisterReading {
            time_us: self.snapshot.time_us,
            plc: self.plc.clone(),
            register: format!("{}{register}", self.prefix),
            address: register.address().to_string(),
            ty: register.ty().name(),
            value: register.ty().number(value),
            hex: register.format_value(value),
            meaning: meaning_in(register, self.live(), value),
            forced: self.forced(register.offset(), register.width()),
            stretch: (self.number, register.offset(), register.width()),
        }
    }

    /// Rows of plain RAM: one row for each doubleword, or a single row for an address.
    fn plain(&self) -> impl Iterator<Item = DumpRow> + '_ {
        let width = self.selection.place.map_or(PLAIN_WIDTH, Address::width);
        let ty = width.bits();
        let offsets = (self.first..).step_by(width.bytes() as usize);
        let row = move |offset| {
            let value = self.value(offset, width.bytes());
            let address = self.fitted.device().at(width, offset).to_string();
            let holding = RegisterReading {
                time_us: self.snapshot.time_us,
                plc: self.plc.clone(),
                register: format!("{}{address}", self.prefix),
                address,
                ty: ty.name(),
                value: ty.number(value),
                hex: format_value(ty, value),
                meaning: format!("plain RAM of {}", self.area().name),
                forced: self.forced(offset, width.bytes()),
                stretch: (self.number, offset, width.bytes()),
            };
            // An address that the user named is shown even if its value is 0.
            DumpRow { holding, differs: value != 0 || self.selection.place.is_some() }
        };
        offsets.take(self.bytes.len() / width.bytes() as usize).map(row)
    }
}

/// True if the dump of an area of plain RAM has a row with this address.
pub(crate) fn is_row_of_plain_ram(area: &Area, address: Address) -> bool {
    address.width() == PLAIN_WIDTH && (address.offset() - area.first).is_multiple_of(PLAIN_WIDTH.bytes())
}

/// Returns the end of a message about registers that are not live: the name of the register that shows which structure
/// is valid.
pub(crate) fn see(phase_register: Option<&str>) -> String {
    phase_register.map_or_else(String::new, |register| format!(", see {register}"))
}

fn text(rows: &[RegisterReading], any_live: bool, phase_register: Option<&str>) -> String {
    match (rows, any_live) {
        ([], true) => "all registers have their reset values\n".to_owned(),
        ([], false) => format!("these registers are not live{}\n", see(phase_register)),
        (rows, _) => {
            let cells = |row: &RegisterReading| {
                vec![row.register.clone(), row.address.clone(), row.hex.clone(), row.marked_meaning()]
            };
            table::columns(&rows.iter().map(cells).collect::<Vec<_>>())
        }
    }
}
