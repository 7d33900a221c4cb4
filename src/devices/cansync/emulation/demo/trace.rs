//! Output of the soft-PLC: the values of registers in the RAM.

use crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use crate::devices::emulation::demo::{DemoError, Show};
use crate::layout::{Address, DeviceFit, DeviceLayout, NamedLocation, Port, RegisterPhase, Width};
use crate::memory::{Attached, Header, MemoryError, SharedRegs, View};
use crate::time;
use std::cell::RefCell;
use std::time::Duration;

/// Writer of a printed value.
#[derive(Clone, Copy)]
pub(crate) enum Writer {
    /// The soft-PLC of the demonstration.
    Plc,
    /// The firmware of the emulated node.
    Firmware,
}

/// An attached image of a master. Register values are noted at once but printed later, because printing takes
/// longer than the answer of the firmware.
pub(crate) struct Trace<'a> {
    show: Show<'a>,
    device: &'static DeviceLayout,
    fitted: DeviceFit,
    port: &'static Port,
    attached: Attached,
    header: View<Header>,
    /// The master in cyclic operation.
    pub node: View<CANsync_MA_CTRL_BMSTRUCT>,
    notes: RefCell<Vec<Note>>,
}

enum Note {
    /// A register held a value.
    Register { time_us: u64, writer: Writer, address: Address, live: RegisterPhase, value: u32 },
    /// A SYNC pulse was seen.
    Sync { time_us: u64, count: u32 },
}

impl<'a> Trace<'a> {
    /// Opens the master in `port` of an attached image.
    ///
    /// # Errors
    /// The image is attached read-only.
    pub(crate) fn new(
        attached: Attached,
        device: &'static DeviceLayout,
        port: &'static Port,
        show: Show<'a>,
    ) -> Result<Self, DemoError> {
        let node = attached.segment().view::<CANsync_MA_CTRL_BMSTRUCT>(port.area.first)?;
        let header = attached.header()?.clone();
        let fitted = header.fitted(device);
        Ok(Self { show, device, fitted, port, attached, header, node, notes: RefCell::default() })
    }

    /// Prints a text unchanged.
    ///
    /// # Errors
    /// The output is closed.
    pub(crate) fn print_text(&self, text: &str) -> Result<(), DemoError> {
        Ok((self.show)(text)?)
    }

    /// Makes the firmware poll the registers at once.
    ///
    /// # Errors
    /// The image is attached read-only.
    pub(crate) fn ring(&self) -> Result<(), DemoError> {
        Ok(self.attached.ring()?)
    }

    /// Prints the notes.
    ///
    /// # Errors
    /// Returns the errors of [`Trace::print_text`].
    pub(crate) fn print(&self) -> Result<(), DemoError> {
        let notes = self.notes.take();
        self.print_text(&notes.iter().map(|note| self.line(note)).collect::<Result<String, _>>()?)
    }

    /// Prints the notes, then a headline for the notes that follow.
    ///
    /// # Errors
    /// Returns the errors of [`Trace::print_text`].
    pub(crate) fn headline(&self, text: &str) -> Result<(), DemoError> {
        self.print()?;
        self.print_text(&format!("\n{text}\n"))
    }

    /// Notes the value of a register of the master. The register is found by its offset in the structure, so the
    /// printed name is always that of the accessed register.
    ///
    /// # Errors
    /// The register does not belong to the master.
    pub(crate) fn note<T: SharedRegs>(&self, writer: Writer, cell: &T) -> Result<(), DemoError> {
        let address = self.address(cell)?;
        let value = self.attached.segment().load(address.offset(), address.width())?;
        self.note_value(writer, address, value);
        Ok(())
    }

    fn note_value(&self, writer: Writer, address: Address, value: u32) {
        let live = self.port.area.phase(Some(self.node.w_OPTION_STATUS.load().into()));
        let time_us = self.header.virtual_time_us.load();
        self.notes.borrow_mut().push(Note::Register { time_us, writer, address, live, value });
    }

    /// Waits until a register of the master contains `wanted`, and notes the register. `what` describes the
    /// awaited event in error messages.
    ///
    /// # Errors
    /// The emulator has ended, or [`DemoError::Stuck`] after `patience` of real time.
    pub(crate) fn await_value<T: SharedRegs>(
        &self,
        cell: &T,
        wanted: u32,
        what: &str,
        patience: Duration,
    ) -> Result<(), DemoError> {
        let address = self.address(cell)?;
        let (offset, width) = (address.offset(), address.width());
        match self.attached.wait_register(offset, width, patience, |value| value == wanted) {
            Ok(value) => {
                self.note_value(Writer::Firmware, address, value);
                Ok(())
            }
            Err(MemoryError::RegisterTimeout { last, .. }) => {
                self.print()?;
                let live = self.port.area.phase(Some(self.node.w_OPTION_STATUS.load().into()));
                let place = NamedLocation::parse(&self.fitted, &address.to_string())?;
                Err(DemoError::Stuck {
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

    /// Waits until `changed` returns true. It is called after each change of registers by the firmware.
    ///
    /// # Errors
    /// The emulator has ended, or nothing changed for `patience` of real time.
    pub(crate) fn await_change(
        &self,
        what: &str,
        patience: Duration,
        changed: impl Fn() -> bool,
    ) -> Result<(), DemoError> {
        Ok(self.attached.wait_until(what, patience, |_| changed().then_some(()))?)
    }

    /// Returns the number of SYNC pulses of the master up to now.
    pub(crate) fn syncs(&self) -> u32 {
        let counter = self.header.sync_counter.get(self.port.number.index());
        counter.map_or(0, |counter| counter.load())
    }

    /// Returns the name of the port.
    pub(crate) fn port(&self) -> &'static str {
        self.port.name
    }

    /// Notes a SYNC pulse.
    pub(crate) fn note_sync(&self, count: u32) {
        let time_us = self.header.virtual_time_us.load();
        self.notes.borrow_mut().push(Note::Sync { time_us, count });
    }

    fn address<T: SharedRegs>(&self, cell: &T) -> Result<Address, DemoError> {
        let inside = core::ptr::from_ref(cell).addr().wrapping_sub(core::ptr::from_ref(&*self.node).addr());
        let offset = self.port.area.first.wrapping_add(inside as u32);
        let width = match size_of::<T>() {
            1 => Width::Byte,
            2 => Width::Word,
            _ => Width::Dword,
        };
        Ok(self.device.aligned(width, offset)?)
    }

    fn line(&self, note: &Note) -> Result<String, DemoError> {
        let line = match *note {
            Note::Sync { time_us, count } => format!("{:>11}  SYNC {count}", time::seconds(time_us)),
            Note::Register { time_us, writer, address, live, value } => {
                let time = time::seconds(time_us);
                let writer = match writer {
                    Writer::Plc => "PLC",
                    Writer::Firmware => "firmware",
                };
                let place = NamedLocation::parse(&self.fitted, &address.to_string())?;
                let name = place.name(live);
                let (value, meaning) = (place.format(live, value), place.meaning(live, value));
                format!("{time:>11}  {writer:8}  {name:40}  {address:11}  {value:11}  {meaning}")
            }
        };
        Ok(format!("{}\n", line.trim_end()))
    }
}
