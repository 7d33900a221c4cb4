//! Context of verbs. The verbs (built-in functions) of a device's script act on these objects while a
//! function of the script runs.

use super::engine::LARGEST_ARRAY;
use super::functions::Functions;
use super::timers::Timers;
use crate::can::Frame;
use crate::devices::Context;
use crate::devices::folder::card::{Card, Place};
use crate::devices::folder::own_records::OwnRecord;
use crate::devices::folder::port::Unsendable;
use crate::devices::folder::records::{DeviceRecord, Note, Unsent};
use crate::devices::folder::rules;
use crate::journal::{Finding, Handshake, Origin, Register, State};
use crate::layout::{DeviceLayout, RegisterRef};
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

/// Maximum number of registers that a thread caches for a script. Names beyond this number are searched at
/// each use.
const MOST_REMEMBERED: usize = 16 << 10;
/// Maximum number of blocks that a thread caches for a script.
const MOST_BLOCKS: usize = 256;
/// Maximum number of bytes that `copy` copies in one call.
const LARGEST_BLOCK: u32 = 16 << 10;

/// A register with its place in the image.
#[derive(Clone, Copy)]
pub(super) struct Found {
    pub(super) register: RegisterRef,
    pub(super) place: Place,
}

/// Consecutive registers.
#[derive(Clone)]
pub(super) struct Block {
    pub(super) offset: u32,
    pub(super) bytes: u32,
    /// The first register of each owner.
    pub(super) first: Vec<Found>,
}

/// The device during a call.
pub(super) struct Acting {
    /// Emulated time in microseconds.
    pub(super) now: u64,
    pub(super) origin: Origin,
    pub(super) card: Card,
    pub(super) timers: Timers,
    /// Entries for the journal, in the order of time.
    pub(super) reports: Vec<Report>,
}

/// An entry for the journal.
pub(super) enum Report {
    Note(String),
    Changed(Register),
    Answered(Handshake),
    /// The device has entered a phase.
    Entered(State),
    /// A record of the device, as a line.
    Recorded(String),
    /// A finding with its text.
    Violated(Finding, String),
    /// A frame that was not sent.
    Unsent(Frame, Unsendable),
}

impl Report {
    /// Writes it into the journal.
    pub(super) fn write(self, ctx: &mut Context) {
        match self {
            Report::Note(text) => Note::write(ctx.journal, ctx.now, ctx.origin.plc, &text),
            Report::Recorded(line) => DeviceRecord::write(ctx.journal, ctx.now, ctx.origin.plc, &line),
            Report::Changed(event) => ctx.report(event),
            Report::Answered(event) => ctx.report(event),
            Report::Entered(event) => ctx.report(event),
            Report::Unsent(frame, reason) => {
                Unsent::write(ctx.journal, ctx.now, ctx.origin.plc, &frame, reason);
            }
            Report::Violated(finding, text) => ctx.journal.find_with(ctx.now, finding, &text),
        }
    }
}

impl Acting {
    /// Writes a register of the device.
    pub(super) fn write(&mut self, found: Found, is_recorded: bool, f: impl Fn(u32) -> u32) {
        let (from, to) = self.card.update(found.place, f);
        if is_recorded && from != to {
            let (origin, offset) = self.card.located(found.place, self.origin);
            self.reports.push(Report::Changed(Register { origin, offset, from, to }));
        }
        self.report_phase();
    }

    /// Adds an entry if the phase has changed, before the entries of later writes.
    fn report_phase(&mut self) {
        let entered = self.card.entered(self.origin.plc);
        self.reports.extend(entered.map(Report::Entered));
    }

    /// Replaces `request` by `answer`; returns false if the register has another value.
    pub(super) fn exchange(&mut self, found: Found, request: u32, answer: u32) -> bool {
        if !self.card.exchange(found.place, request, answer) {
            return false;
        }
        let (origin, offset) = self.card.located(found.place, self.origin);
        self.reports.push(match (u16::try_from(request), u16::try_from(answer)) {
            (Ok(request), Ok(answer)) => {
                Report::Answered(Handshake { origin, offset, request, answer, more_answers_follow: false })
            }
            _ => Report::Changed(Register { origin, offset, from: request, to: answer }),
        });
        self.report_phase();
        true
    }

    /// Puts a frame into the transmit queue of the port. Returns false if the frame is lost. The journal
    /// records the loss.
    pub(super) fn send(&mut self, frame: Frame) -> bool {
        let sent = self.card.send(frame);
        self.reports.extend(sent.err().map(|reason| Report::Unsent(frame, reason)));
        sent.is_ok()
    }

    /// Reports that a program has broken a rule of the device.
    pub(super) fn violation(&mut self, found: Found, text: String) {
        let (Origin { plc, .. }, offset) = self.card.located(found.place, self.origin);
        let live = found.register.placed.live;
        let value = self.card.load(found.place);
        let rule = &rules::OWN_RULE;
        let finding = Finding { rule, plc, offset, live, value, late_us: 0 };
        self.reports.push(Report::Violated(finding, text));
    }
}

/// Access of the verbs to the device. It exists only while a function runs.
pub(super) struct VerbContext {
    pub(super) layout: &'static DeviceLayout,
    /// Kinds of journal records of the device.
    pub(super) records: Arc<[OwnRecord]>,
    names: HashMap<String, Rc<[Found]>>,
    blocks: HashMap<String, Block>,
    /// Total number of registers in `names`.
    remembered: usize,
    /// Functions of the main file.
    pub(super) functions: Functions,
    pub(super) acting: Option<Acting>,
}

impl VerbContext {
    pub(super) fn new(layout: &'static DeviceLayout, records: &Arc<[OwnRecord]>) -> Self {
        let records = Arc::clone(records);
        let (names, blocks) = (HashMap::new(), HashMap::new());
        let functions = Functions::default();
        VerbContext { layout, records, names, blocks, remembered: 0, functions, acting: None }
    }

    /// Returns the device.
    ///
    /// # Errors
    /// No hook is running.
    pub(super) fn device(&mut self) -> Result<&mut Acting, String> {
        let refused =
            "a verb works in a function only; outside of functions a script has constants and imports";
        self.acting.as_mut().ok_or_else(|| refused.to_owned())
    }

    /// Returns the register of this name.
    ///
    /// # Errors
    /// There is no such register, or the name covers several registers.
    pub(super) fn register(&mut self, name: &str) -> Result<Found, String> {
        match *self.registers(name)? {
            [found] => Ok(found),
            ref several => Err(format!(
                "`{name}` is {} registers; name one of them, or use read_all or output_all",
                several.len()
            )),
        }
    }

    /// Returns all registers of this name: one register, an array, or a pattern.
    ///
    /// # Errors
    /// There is no such register, or the name covers too many registers.
    pub(super) fn registers(&mut self, name: &str) -> Result<Rc<[Found]>, String> {
        if let Some(known) = self.names.get(name) {
            return Ok(Rc::clone(known));
        }
        let registers = self.layout.registers(name).map_err(|error| error.to_string())?;
        if registers.len() > LARGEST_ARRAY {
            return Err(format!(
                "`{name}` is {} registers; a verb takes at most {LARGEST_ARRAY}",
                registers.len()
            ));
        }
        let found = |register: RegisterRef| Found { place: Place::of(&register), register };
        let found: Rc<[Found]> = registers.into_iter().map(found).collect();
        if self.remembered + found.len() <= MOST_REMEMBERED {
            self.remembered += found.len();
            self.names.insert(name.to_owned(), Rc::clone(&found));
        }
        Ok(found)
    }

    /// Returns the consecutive registers of this name.
    ///
    /// # Errors
    /// There are no such registers, there are too many, or there is a gap between them.
    pub(super) fn block(&mut self, name: &str) -> Result<Block, String> {
        if let Some(known) = self.blocks.get(name) {
            return Ok(known.clone());
        }
        let registers = self.layout.registers(name).map_err(|error| error.to_string())?;
        let mut block: Option<Block> = None;
        for register in registers {
            let found = Found { place: Place::of(&register), register };
            let Block { offset, bytes, first } =
                block.get_or_insert(Block { offset: found.place.offset, bytes: 0, first: Vec::new() });
            if found.place.is_front() || *offset + *bytes != found.place.offset {
                return Err(format!("`{name}` has a gap; copy needs an array, or consecutive registers"));
            }
            *bytes += register.width();
            if first.iter().all(|it| it.register.register.owner != register.register.owner) {
                first.push(found);
            }
        }
        let block = block.ok_or_else(|| format!("`{name}` is no register"))?;
        if block.bytes > LARGEST_BLOCK {
            return Err(format!("`{name}` has {} bytes; copy takes at most {LARGEST_BLOCK}", block.bytes));
        }
        if self.blocks.len() < MOST_BLOCKS {
            self.blocks.insert(name.to_owned(), block.clone());
        }
        Ok(block)
    }
}
