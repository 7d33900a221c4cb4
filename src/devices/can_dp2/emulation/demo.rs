//! The demo of `commram demo --device can-dp2`: a DP master commissions the gateway, by the registers of the master
//! without a stack, and a value goes from PROFIBUS to CANopen and back (Software-Handbuch CAN-DP/2).

use super::firmware::ram::fill;
use crate::devices::can_dp2::registers::values::mst_dsap::{CHK_CFG, DATA_EXCHANGE, SET_PRM, SLAVE_DIAG};
use crate::devices::can_dp2::registers::values::{mst_control, mst_result};
use crate::devices::can_dp2::registers::{CAN_DP2_MST, DEVICE, MST};
use crate::devices::emulation::demo::{Actor, Demo, DemoError, Show};
use crate::journal::hex;
use crate::memory::{Attached, Cell8, View};

pub(crate) static DEMO: Demo = Demo {
    plant: Some(include_str!("demo.toml")),
    area: "gw:diag",
    title: "The diagnosis of the slave",
    program: run,
};

/// Octets of Set_Prm: no watchdog, 125 kbit/s, CANopen master with start frame, no times (p. 22-30).
const PRM: [u8; 16] = [0x80, 0, 0, 11, 0x04, 0xA4, 0, 0, 6, 0x06, 1, 0, 0, 0, 0, 0];

/// Octets of Chk_Cfg: the module for 8 bytes to the identifier 220h, and the module for 8 bytes from 1A0h. The bytes of
/// each word are swapped (p. 33-36).
const CFG: [u8; 10] = [0x83, 0x87, 0x02, 0x20, 0xAA, 0x43, 0x87, 0x01, 0xA0, 0xAA];

/// The DP master of the demonstration.
struct Master<'a>(Actor<'a>);

impl Master<'_> {
    /// Sends a request to the slave; returns the octets of its answer.
    fn ask(&self, called: &str, dsap: u8, octets: &[u8]) -> Result<Vec<u8>, DemoError> {
        self.0.print_line(&format!("asks {called}{}", hex(octets, " ")))?;
        let mst: View<CAN_DP2_MST> = self.0.attached.segment().view(MST)?;
        mst.mst_dsap.store(dsap);
        mst.mst_request_len.store(octets.len() as u8);
        fill(&mst.mst_request, octets);
        self.0.write("mst.mst_control", mst_control::SEND.into())?;
        self.0.wait("mst.mst_control", mst_control::DONE.into(), called)?;
        let length = usize::from(mst.mst_reply_len.load());
        let reply: Vec<u8> = mst.mst_reply.iter().take(length).map(Cell8::load).collect();
        match mst.mst_result.load() {
            mst_result::RECEIPT => self.0.print_line("gets a receipt")?,
            _ => self.0.print_line(&format!("is answered{}", hex(&reply, " ")))?,
        }
        Ok(reply)
    }
}

fn run(attached: Attached, show: Show<'_>) -> Result<(), DemoError> {
    let gateway = Actor::new("gw", &DEVICE, attached, show);
    let panel = gateway.other("panel")?;
    let master = Master(gateway);
    let headline = |text: &str| show(&format!("\n{text}\n"));

    headline("The slave finds the bit rate and waits for parameters (p. 15, 17-18)")?;
    master.ask("Slave_Diag", SLAVE_DIAG, &[])?;
    master.0.wait("front.led_e", 3, "LED E")?;
    headline("Parameters with an invalid bit rate: octet 8 is wrong, 6 would be right (p. 20-21, 28)")?;
    let mut wrong = PRM;
    wrong[8] = 99;
    master.ask("Set_Prm", SET_PRM, &wrong)?;
    master.ask("Slave_Diag", SLAVE_DIAG, &[])?;
    headline(
        "Valid parameters: 125 kbit/s, CANopen master (p. 28-29); then the slave waits for a configuration",
    )?;
    master.ask("Set_Prm", SET_PRM, &PRM)?;
    master.0.wait("front.led_e", 4, "LED E")?;
    panel.wait("flags.CAN_OPEN", 1, "the start of the program")?;
    headline("8 bytes in each direction; the gateway starts the CANopen network (p. 29, 33-36)")?;
    master.ask("Chk_Cfg", CHK_CFG, &CFG)?;
    master.0.wait("front.led_d", 1, "LED D")?;
    panel.wait("flags.COP_PREOPERATIONAL", 0, "the start of the network")?;
    headline("A value goes from PROFIBUS to the controller (p. 13)")?;
    let outputs = [0x12, 0x34, 0, 0, 0, 0, 0, 0];
    master.ask("data exchange", DATA_EXCHANGE, &outputs)?;
    panel.wait("rx_pdo.a_RX_PDO[0][0]", 0x1234, "the outputs")?;
    headline("A value goes from the controller to PROFIBUS")?;
    panel.write("tx_pdo.a_TX_PDO[0][0]", 0xABCD)?;
    master.0.wait("inputs.inputs[0]", 0xAB, "the panel's PDO")?;
    master.ask("data exchange", DATA_EXCHANGE, &outputs)?;
    master.ask("Slave_Diag", SLAVE_DIAG, &[])?;
    Ok(())
}
