//! Demonstration of a device for `commram demo`: a plant, and a soft-PLC that runs on it.

use crate::devices::attach;
use crate::layout::{DeviceFit, DeviceLayout, LayoutError, NamedLocation, RegisterPhase};
use crate::memory::header::{self, Power};
use crate::memory::{AttachMode, Attached, MemoryError};
use std::io;
use std::time::Duration;

/// A demonstration of a device.
#[derive(Debug)]
pub struct Demo {
    /// Plant file of the demonstration; `None` for the built-in plant.
    pub plant: Option<&'static str>,
    /// Name of the registers that are shown at the end.
    pub area: &'static str,
    /// Name of the demonstration for a headline.
    pub title: &'static str,
    /// The soft-PLC, a separate process that accesses only the image of its PLC.
    pub program: DemoProgram,
}

/// A soft-PLC that prints its actions.
pub(crate) type DemoProgram = fn(Attached, Show<'_>) -> Result<(), DemoError>;

/// Shows a text at once.
pub(crate) type Show<'a> = &'a dyn Fn(&str) -> io::Result<()>;

/// The reason why a demonstration failed.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// The emulator has ended, or its memory is not accessible.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The name or address is not a register.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The output cannot be written.
    #[error("cannot write: {0}")]
    Output(#[from] io::Error),
    /// A register did not get the expected value in time.
    #[error("{what}: {place} did not become {wanted} within {seconds} s, it holds {found}")]
    Stuck {
        /// Description of the awaited step of the demonstration.
        what: String,
        /// Name and address of the register.
        place: String,
        /// Value that the register should have reached.
        wanted: String,
        /// Value of the register, with its meaning.
        found: String,
        /// Duration of the wait, in real time.
        seconds: u64,
    },
    /// A drive has not reached a reference value.
    #[error("{0}")]
    NotFollowed(String),
}

/// Maximum duration of a step, in real time. Normally a step takes a few seconds at most.
const PATIENCE: Duration = Duration::from_secs(30);

/// A device with registers that a demonstration writes, reads and prints.
pub(crate) struct Actor<'a> {
    name: &'static str,
    layout: &'static DeviceLayout,
    pub(crate) attached: Attached,
    show: Show<'a>,
}

impl<'a> Actor<'a> {
    /// Creates the actor of the device called `name` with this image.
    pub(crate) fn new(
        name: &'static str,
        layout: &'static DeviceLayout,
        attached: Attached,
        show: Show<'a>,
    ) -> Self {
        Actor { name, layout, attached, show }
    }

    /// Returns another device of the same instance.
    pub(crate) fn other(&self, name: &'static str) -> Result<Actor<'a>, DemoError> {
        let instance = header::name(&self.attached.header_snapshot().instance);
        let (attached, layout) = attach(&instance, name, AttachMode::ReadWrite)?;
        Ok(Actor::new(name, layout, attached, self.show))
    }

    /// Prints a text about the device.
    pub(crate) fn print_line(&self, text: &str) -> Result<(), DemoError> {
        Ok((self.show)(&format!("  {:6} {text}\n", self.name))?)
    }

    /// Prints the value of a register.
    fn print_value(&self, doing: &str, place: &NamedLocation, value: u32) -> Result<(), DemoError> {
        let (label, value) = (place.label(RegisterPhase::ALWAYS), place.format(RegisterPhase::ALWAYS, value));
        self.print_line(&format!("{doing} {label} = {value}"))
    }

    fn place(&self, name: &str) -> Result<NamedLocation, DemoError> {
        Ok(NamedLocation::parse(&DeviceFit::unknown(self.layout), name)?)
    }

    /// Writes a register as a program does.
    pub(crate) fn write(&self, name: &str, value: u32) -> Result<(), DemoError> {
        let place = self.place(name)?;
        self.attached.segment().store(place.offset(), place.width(), value)?;
        self.attached.ring()?;
        self.print_value("writes", &place, value)
    }

    /// Waits until a register holds `wanted`.
    pub(crate) fn wait(&self, name: &str, wanted: u32, what: &str) -> Result<(), DemoError> {
        let place = self.place(name)?;
        let wait =
            self.attached.wait_register(place.offset(), place.width(), PATIENCE, |value| value == wanted);
        match wait {
            Ok(value) => self.print_value("finds", &place, value),
            Err(MemoryError::RegisterTimeout { last, .. }) => Err(DemoError::Stuck {
                what: what.to_owned(),
                place: place.label(RegisterPhase::ALWAYS),
                wanted: place.format(RegisterPhase::ALWAYS, wanted),
                found: place.format(RegisterPhase::ALWAYS, last),
                seconds: PATIENCE.as_secs(),
            }),
            Err(other) => Err(other.into()),
        }
    }

    /// Switches the supply of the device.
    pub(crate) fn switch(&self, power: Power) -> Result<(), DemoError> {
        self.attached.header()?.program.power.store(power.code());
        self.attached.ring()?;
        self.print_line(if power == Power::On { "supply on" } else { "supply off" })
    }
}
