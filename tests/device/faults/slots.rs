//! Faults at the modules of a modular PLC: a fault names a port by its name.

use crate::rig::bring_up::{Mode, Node, Stage, bring_up_in};
use crate::rig::plant_of;
use commram::devices::bm4_o_can_06::registers::{BAUD_RATES, SLOTG};
use commram::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use commram::devices::fault_kinds;
use commram::fault::{FaultError, FaultSpec};
use commram::memory::View;
use commram::plant::Plant;

const PLANT: &str = "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n\
                     [[device.module]]\nslot = 'G'\nkind = 'can-06'\nbus = 'fast'\n\
                     [[device.module]]\nslot = 'K'\nkind = 'can-05'\ndip = 7\n\
                     [[bus]]\nname = 'fast'\nkbit_s = 1000\n\
                     [[bus.drive]]\nname = 'd'\nslave_number = 3\nlock_time_us = 20000\ncard_function = 0\n";
const OVERRUN: u16 = 1 << 1;
const BUS_OFF: u16 = 0x00C0;

struct Maxx {
    plant: Plant,
    master: View<CANsync_MA_CTRL_BMSTRUCT>,
}

impl Maxx {
    /// Brings the master in slot G into set-up mode at 1 Mbit/s.
    fn set_up() -> Self {
        let plant = plant_of(PLANT);
        let segment = plant.devices()[0].segment().clone();
        let rate = BAUD_RATES.iter().find(|rate| rate.kbit_per_s == 1000).unwrap();
        let node = Node::at(&segment, SLOTG, rate, Mode::Master);
        let mut maxx = Maxx { plant, master: segment.view(SLOTG).unwrap() };
        bring_up_in(&mut maxx.plant, &[&node], ..=Stage::SetUp);
        maxx.step(100_000);
        maxx
    }

    fn command(&mut self, value: u16) {
        self.master.w_CPU_CONTROL.store(value);
        self.step(500);
    }

    fn step(&mut self, us: u64) {
        self.plant.advance_to(self.plant.now() + us);
    }

    fn add(&mut self, kind: &str, fields: &[&str]) -> Result<u16, FaultError> {
        let names = self.plant.names();
        let fault =
            FaultSpec::from_words(fault_kinds(), kind, fields).unwrap().resolve(fault_kinds(), &names)?;
        self.plant.add_fault(fault).map_err(|refusal| FaultError::refused(fault.kind(), refusal, &names))
    }

    fn status(&self) -> u16 {
        self.master.w_CANsync_STATUS.load()
    }
}

#[test]
fn a_module_in_bus_off_comes_back_when_it_is_reset() {
    let mut maxx = Maxx::set_up();
    assert_eq!(maxx.status() & (BUS_OFF | OVERRUN), 0);
    maxx.add("bus_off", &["plc=maxx", "node=slotG"]).unwrap();
    maxx.step(1_000);
    assert_eq!(maxx.status(), BUS_OFF);
    assert_eq!(maxx.plant.faults().count(), 0, "it happens once");
    maxx.master.w_CPU_CONTROL.store(0x00A0);
    maxx.step(1_000);
    assert_eq!((maxx.master.w_CPU_CONTROL.load(), maxx.status()), (0x0020, BUS_OFF), "128 times 11 bits");
    maxx.step(2_000);
    assert_eq!(maxx.status() & BUS_OFF, 0);
}

#[test]
fn a_module_with_an_overrun_loses_the_next_frame_that_it_should_have_received() {
    let mut maxx = Maxx::set_up();
    let id = maxx.add("overrun", &["node=slotG", "count=2"]).unwrap();
    maxx.step(20_000);
    assert_eq!(maxx.status() & OVERRUN, OVERRUN);
    assert!(maxx.plant.faults().all(|fault| fault.id != id), "the drive has answered twice");
    maxx.command(0x00A0);
    maxx.step(3_000);
    assert_eq!(maxx.status() & OVERRUN, 0);
}

#[test]
fn refusals_list_the_ports_and_faults_that_the_plc_has() {
    let mut maxx = Maxx::set_up();
    for (kind, fields, expected) in [
        (
            "bus_off",
            &["node=slotH"][..],
            "bus_off: slotH of PLC \"maxx\" is not on a bus; ports on a bus: slotG",
        ),
        ("overrun", &["node=slotK"], "overrun: slotK of PLC \"maxx\" is not on a bus; ports on a bus: slotG"),
        (
            "bus_off",
            &["node=node2"],
            "bus_off: PLC \"maxx\" has no port \"node2\"; its ports are: slotG, slotH, slotJ, slotK, slotL, slotM",
        ),
        ("baps_silent", &[], "baps_silent: PLC \"maxx\" cannot have it; its faults are: none"),
        (
            "baps_drive_fault",
            &["error=3"],
            "baps_drive_fault: PLC \"maxx\" cannot have it; its faults are: none",
        ),
    ] {
        assert_eq!(maxx.add(kind, fields).unwrap_err().to_string(), expected);
    }
}
