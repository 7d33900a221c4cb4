//! The demo of `commram demo --device cs0015`: a master and a slave on one bus. It shows the start of the
//! network, PDOs in both directions, and a missing slave (Systemhandbuch Platinensteuerung CS0015).

use crate::devices::cs0015::registers::DEVICE;
use crate::devices::emulation::demo::{Actor, Demo, DemoError, Show};
use crate::memory::Attached;
use crate::memory::header::Power;

pub(crate) static DEMO: Demo = Demo {
    plant: Some(include_str!("demo.toml")),
    area: "master:rx_pdo",
    title: "The words that the master has received",
    program: run,
};

fn run(attached: Attached, show: Show<'_>) -> Result<(), DemoError> {
    let master = Actor::new("master", &DEVICE, attached, show);
    let panel = master.other("panel")?;
    let headline = |text: &str| show(&format!("\n{text}\n"));

    headline("Start: the programs run and set CAN_OPEN, both are Pre-Operational (p. 13-14, 28, 40)")?;
    for (it, node) in [(&master, 1), (&panel, 5)] {
        it.wait("flags.CAN_OPEN", 1, "the start of the program")?;
        it.wait("flags.NODEID", node, "the Node-ID")?;
    }
    headline("The master has guarded its node and starts the network (p. 55-61)")?;
    for it in [&panel, &master] {
        it.wait("flags.COP_PREOPERATIONAL", 0, "the start of the network")?;
    }
    headline("PDOs in both directions: changed words are sent (p. 42, 154)")?;
    master.write("tx_pdo.a_TX_PDO[2][0]", 0x1234)?;
    panel.wait("rx_pdo.a_RX_PDO[2][0]", 0x1234, "the master's PDO")?;
    panel.write("tx_pdo.a_TX_PDO[2][3]", 0x5678)?;
    master.wait("rx_pdo.a_RX_PDO[2][3]", 0x5678, "the panel's PDO")?;
    headline("A guarding failure: node 5 does not answer any more (p. 43, 59, 152)")?;
    panel.switch(Power::Off)?;
    master.wait("flags.COP_GUARDFAIL_NODEID", 5, "the missing node")?;
    headline("Node 5 is back; the master starts it again (p. 28, 59)")?;
    panel.switch(Power::On)?;
    master.wait("flags.COP_GUARDFAIL_NODEID", 0, "the node")?;
    panel.wait("flags.COP_PREOPERATIONAL", 0, "the start of the node")
}
