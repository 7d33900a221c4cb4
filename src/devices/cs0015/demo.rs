//! What `commram demo --device cs0015` shows: a master and a slave at one bus, the start of the network, PDOs both ways, a slave that
//! is missing (Systemhandbuch Platinensteuerung CS0015).

use super::registers::DEVICE;
use crate::devices::attach;
use crate::devices::demo::{Demo, DemoError, Show};
use crate::layout::{Fitted, Live, Place};
use crate::memory::header::{self, Power};
use crate::memory::{AttachMode, Attached, MemoryError};
use std::time::Duration;

pub(crate) static DEMO: Demo = Demo {
    plant: Some(include_str!("demo.toml")),
    area: "master:rx_pdo",
    title: "The words that the master has received",
    program: run,
};

/// How long something may take, in real time. It takes at most some seconds.
const PATIENCE: Duration = Duration::from_secs(30);

/// Who is looked at.
struct Panel<'a> {
    name: &'static str,
    attached: Attached,
    show: Show<'a>,
}

impl Panel<'_> {
    /// Tells what stands somewhere.
    fn say(&self, doing: &str, place: &Place, value: u32) -> Result<(), DemoError> {
        let (label, value) = (place.label(Live::Always), place.format(Live::Always, value));
        Ok((self.show)(&format!("  {:6} {doing} {label} = {value}\n", self.name))?)
    }

    fn place(name: &str) -> Result<Place, DemoError> {
        Ok(Place::parse(&Fitted::unknown(&DEVICE), name)?)
    }

    /// Writes a register, as a program does.
    fn write(&self, name: &str, value: u32) -> Result<(), DemoError> {
        let place = Self::place(name)?;
        self.attached.segment().store(place.offset(), place.width(), value)?;
        self.attached.ring()?;
        self.say("writes", &place, value)
    }

    /// Waits until a register holds this.
    fn wait(&self, name: &str, wanted: u32, what: &str) -> Result<(), DemoError> {
        let place = Self::place(name)?;
        let wait =
            self.attached.wait_register(place.offset(), place.width(), PATIENCE, |value| value == wanted);
        match wait {
            Ok(value) => self.say("finds", &place, value),
            Err(MemoryError::RegisterTimeout { last, .. }) => Err(DemoError::Stuck {
                what: what.to_owned(),
                place: place.label(Live::Always),
                wanted: place.format(Live::Always, wanted),
                found: place.format(Live::Always, last),
                seconds: PATIENCE.as_secs(),
            }),
            Err(other) => Err(other.into()),
        }
    }

    /// Switches its supply.
    fn switch(&self, power: Power) -> Result<(), DemoError> {
        self.attached.header()?.program.power.store(power.code());
        self.attached.ring()?;
        let on = if power == Power::On { "on" } else { "off" };
        Ok((self.show)(&format!("  {:6} supply {on}\n", self.name))?)
    }
}

fn run(attached: Attached, show: Show<'_>) -> Result<(), DemoError> {
    let instance = header::name(&attached.header_snapshot().instance);
    let (other, _) = attach(&instance, "panel", AttachMode::ReadWrite)?;
    let master = Panel { name: "master", attached, show };
    let panel = Panel { name: "panel", attached: other, show };
    let headline = |text: &str| show(&format!("\n{text}\n"));

    headline("Start: the programs run and set CAN_OPEN, both are Pre-Operational (p. 13-14, 28, 40)")?;
    for it in [&master, &panel] {
        it.wait("flags.CAN_OPEN", 1, "the start of the program")?;
        it.wait("flags.NODEID", if it.name == "master" { 1 } else { 5 }, "the Node-ID")?;
    }
    headline("The master has guarded its node and starts the network (p. 55-61)")?;
    for it in [&panel, &master] {
        it.wait("flags.COP_PREOPERATIONAL", 0, "the start of the network")?;
    }
    headline("PDOs both ways: words that change are sent (p. 42, 154)")?;
    master.write("tx_pdo.a_TX_PDO[2][0]", 0x1234)?;
    panel.wait("rx_pdo.a_RX_PDO[2][0]", 0x1234, "the master's PDO")?;
    panel.write("tx_pdo.a_TX_PDO[2][3]", 0x5678)?;
    master.wait("rx_pdo.a_RX_PDO[2][3]", 0x5678, "the panel's PDO")?;
    headline("A guarding failure: node 5 does not answer any more (p. 43, 59, 152)")?;
    panel.switch(Power::Off)?;
    master.wait("flags.COP_GUARDFAIL_NODEID", 5, "the missing node")?;
    headline("It is back; the master starts it again (p. 28, 59)")?;
    panel.switch(Power::On)?;
    master.wait("flags.COP_GUARDFAIL_NODEID", 0, "the node")?;
    panel.wait("flags.COP_PREOPERATIONAL", 0, "the start of the node")
}
