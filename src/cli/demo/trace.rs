//! What the soft-PLC prints: registers as the RAM holds them.

use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::place::{Place, live_by};
use crate::cli::time;
use crate::devices::omega_drive_line_2::registers::{CANsync_MA_CTRL_BMSTRUCT, DEVICE, NODE2};
use crate::layout::{Address, Fitted, Live, Width};
use crate::memory::{Attached, Header, MemoryError, SharedRegs, View};
use std::cell::RefCell;
use std::time::Duration;

/// Who has written what is printed.
#[derive(Clone, Copy)]
pub(crate) enum Who {
    /// The soft-PLC.
    Plc,
    /// The firmware behind the RAM.
    Firmware,
}

/// An attached image, seen as that of a master. Registers are noted at once and printed later, because printing
/// takes longer than the firmware needs for its answer.
pub(crate) struct Trace {
    attached: Attached,
    header: View<Header>,
    /// Node 2 in cyclic operation.
    pub node: View<CANsync_MA_CTRL_BMSTRUCT>,
    notes: RefCell<Vec<Note>>,
}

enum Note {
    /// A register held a value.
    Register { time_us: u64, who: Who, address: Address, live: Live, value: u32 },
    /// A SYNC pulse was seen.
    Sync { time_us: u64, count: u32 },
}

impl Trace {
    /// Looks at node 2 of an attached image.
    ///
    /// # Errors
    /// It is attached read-only.
    pub(crate) fn new(attached: Attached) -> Result<Self, CliError> {
        let node = attached.segment().view::<CANsync_MA_CTRL_BMSTRUCT>(NODE2)?;
        let header = attached.header()?.clone();
        Ok(Self { attached, header, node, notes: RefCell::default() })
    }

    /// Makes the firmware look at the registers at once.
    ///
    /// # Errors
    /// The image is attached read-only.
    pub(crate) fn ring(&self) -> Result<(), CliError> {
        Ok(self.attached.ring()?)
    }

    /// Prints what was noted.
    ///
    /// # Errors
    /// As [`output::print`].
    pub(crate) fn print(&self) -> Result<(), CliError> {
        let notes = self.notes.take();
        output::print(&notes.iter().map(line).collect::<Result<String, _>>()?)
    }

    /// Prints what was noted, and a headline for what comes.
    ///
    /// # Errors
    /// As [`output::print`].
    pub(crate) fn headline(&self, text: &str) -> Result<(), CliError> {
        self.print()?;
        output::print(&format!("\n{text}\n"))
    }

    /// Notes what a register of node 2 holds. The register is found by its place in the structure, so that the
    /// text cannot name another one than was accessed.
    ///
    /// # Errors
    /// The register is none of node 2.
    pub(crate) fn note<T: SharedRegs>(&self, who: Who, cell: &T) -> Result<(), CliError> {
        let address = self.address(cell)?;
        let value = self.attached.segment().load(address.offset(), address.width())?;
        self.note_value(who, address, value);
        Ok(())
    }

    fn note_value(&self, who: Who, address: Address, value: u32) {
        let live = live_by(self.node.w_OPTION_STATUS.load().into());
        let time_us = self.header.virtual_time_us.load();
        self.notes.borrow_mut().push(Note::Register { time_us, who, address, live, value });
    }

    /// Waits until a register of node 2 holds `wanted`, and notes it. `what` names what the wait is for.
    ///
    /// # Errors
    /// The emulator has gone, or [`CliError::Stuck`] after `patience` of real time.
    pub(crate) fn await_value<T: SharedRegs>(
        &self,
        cell: &T,
        wanted: u32,
        what: &str,
        patience: Duration,
    ) -> Result<(), CliError> {
        let address = self.address(cell)?;
        let (offset, width) = (address.offset(), address.width());
        match self.attached.wait_register(offset, width, patience, |value| value == wanted) {
            Ok(value) => {
                self.note_value(Who::Firmware, address, value);
                Ok(())
            }
            Err(MemoryError::RegisterTimeout { last, .. }) => {
                self.print()?;
                let live = live_by(self.node.w_OPTION_STATUS.load().into());
                let place = Place::parse(&Fitted::unknown(&DEVICE), &address.to_string())?;
                Err(CliError::Stuck {
                    what: what.to_owned(),
                    place: place.label(live),
                    wanted: place.format(live, wanted),
                    found: format!("{}, {}", place.format(live, last), place.meaning(live, last)),
                    seconds: patience.as_secs(),
                })
            }
            Err(other) => Err(other.into()),
        }
    }

    /// Waits until `changed` says so; it is asked whenever the firmware has changed registers.
    ///
    /// # Errors
    /// The emulator has gone, or nothing happened for `patience` of real time.
    pub(crate) fn await_change(
        &self,
        what: &str,
        patience: Duration,
        changed: impl Fn() -> bool,
    ) -> Result<(), CliError> {
        Ok(self.attached.wait_until(what, patience, |_| changed().then_some(()))?)
    }

    /// SYNC pulses of node 2 so far.
    pub(crate) fn syncs(&self) -> u32 {
        let [_, node2, ..] = &self.header.sync_counter;
        node2.load()
    }

    /// Notes a SYNC pulse.
    pub(crate) fn note_sync(&self, count: u32) {
        let time_us = self.header.virtual_time_us.load();
        self.notes.borrow_mut().push(Note::Sync { time_us, count });
    }

    fn address<T: SharedRegs>(&self, cell: &T) -> Result<Address, CliError> {
        let inside = core::ptr::from_ref(cell).addr().wrapping_sub(core::ptr::from_ref(&*self.node).addr());
        let offset = u32::try_from(NODE2.wrapping_add(inside)).unwrap_or(u32::MAX);
        let width = match size_of::<T>() {
            1 => Width::Byte,
            2 => Width::Word,
            _ => Width::Dword,
        };
        Ok(DEVICE.aligned(width, offset)?)
    }
}

fn line(note: &Note) -> Result<String, CliError> {
    let line = match *note {
        Note::Sync { time_us, count } => format!("{:>11}  SYNC {count}", time::seconds(time_us)),
        Note::Register { time_us, who, address, live, value } => {
            let time = time::seconds(time_us);
            let who = match who {
                Who::Plc => "PLC",
                Who::Firmware => "firmware",
            };
            let place = Place::parse(&Fitted::unknown(&DEVICE), &address.to_string())?;
            let name = place.name(live);
            let (value, meaning) = (place.format(live, value), place.meaning(live, value));
            format!("{time:>11}  {who:8}  {name:40}  {address:11}  {value:11}  {meaning}")
        }
    };
    Ok(format!("{}\n", line.trim_end()))
}
