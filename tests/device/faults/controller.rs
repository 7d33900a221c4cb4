//! BUS-off, overrun, and every bit of `w_CANsync_STATUS` (manual 5.00005.03a p. 147-148, 173).

use super::*;
use crate::rig::{BOTH, FASTEST, Memory, NodePlace};
use commram::devices::cansync::bus::drives;

const OVERRUN: u16 = 1 << 1;
const BUS_OFF: u16 = 0x00C0;
const IDLE: u16 = 0x000C;

/// Adds a fault at a node; the fault names the node's port.
fn add_at(rig: &mut Rig, at: NodePlace, text: &str) -> u16 {
    let (plc, port) = [("a", "MASTER"), ("b", "SLAVE")][at.plc];
    add(rig, &format!("{text}\nplc = '{plc}'\nnode = '{port}'"))
}

/// Manual p. 149: bit 7 of `w_CPU_CONTROL` resets the controller and is cleared.
#[test]
fn a_master_in_bus_off_sends_nothing_until_it_is_reset() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = running(memory, rate);
            add_at(&mut rig, rate.kind.master, "kind = 'bus_off'");
            let frames = rig.frames().len();
            enter_parameter(&rig, DRIVE, 0x03, 1000, 0);
            for _ in 0..3 {
                rig.send_wrc1();
                assert_eq!(rig.master.w_CANsync_STATUS.load(), BUS_OFF);
                assert_eq!(rig.master.b_CTRLREG_WRC1.load(), 0x05, "nothing is acknowledged");
            }
            assert_eq!(parameter(&rig, DRIVE).0, 0x03);
            assert_eq!(rig.frames().len(), frames);
            assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x0080, "the state stays");
            assert!(drives(rig.plant.buses()).next().unwrap().is_synchronized(), "SYNC goes on");
            assert_eq!(rig.plant.faults().count(), 0, "it happens once unless more is asked for");

            rig.master.w_CPU_CONTROL.store(0x00C0);
            let off_us = 128 * 11 * 1000 / u64::from(rate.kbit_s);
            rig.step(off_us - 316);
            assert_eq!(rig.master.w_CPU_CONTROL.load(), 0x0040, "the firmware clears the bit");
            assert_eq!(rig.master.w_CANsync_STATUS.load(), BUS_OFF, "for 128 times 11 bits");
            rig.step(1_000);
            assert_eq!(rig.master.w_CANsync_STATUS.load() & BUS_OFF, 0);
            rig.run_to_sync();
            intervals(&mut rig, 2);
            assert_eq!(parameter(&rig, DRIVE), (0x02, 100));
            assert_eq!(rig.master.b_CTRLREG_WRC1.load(), 0x04);
            let noted = rig.records().filter_map(|record| record.event.get());
            let noted =
                noted.filter_map(|it: Register| (it.offset == rig.master_at.base + 4).then_some(it.to));
            assert!(noted.skip_while(|to| *to != u32::from(BUS_OFF)).count() >= 2, "off and on again");
        }
    }
}

#[test]
fn a_slave_in_bus_off_is_not_there_until_it_is_reset() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = Rig::of(memory, rate, DRIVES);
            rig.set_up();
            rig.step(60_000);
            add_at(&mut rig, rate.kind.slave, "kind = 'bus_off'");
            rig.step(12_000);
            assert_eq!(rig.master.a_STAT_SL[0].load(), 0x00);
            assert_eq!(rig.slave.w_CANsync_STATUS.load(), BUS_OFF);
            assert_eq!(rig.slave.w_OPTION_STATUS.load(), 0x0013);
            rig.slave.w_CPU_CONTROL.store(0x00A0);
            rig.step(16_000);
            assert_eq!(rig.slave.w_CPU_CONTROL.load(), 0x0020);
            assert_eq!(rig.master.a_STAT_SL[0].load(), 0x03, "it has seen SYNC all the time");
        }
    }
}

/// D-29 and D-121: 16#0080 alone leaves 16#0000 in the register, which is no restart.
#[test]
fn the_reset_command_alone_does_not_restart_the_node() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        add_at(&mut rig, rate.kind.slave, "kind = 'bus_off'");
        rig.slave.w_CPU_CONTROL.store(0x0080);
        rig.step(5_000);
        assert_eq!((rig.slave.w_CPU_CONTROL.load(), rig.slave.w_OPTION_STATUS.load()), (0x0000, 0x0020));
        assert_eq!(rig.slave.w_CANsync_STATUS.load() & BUS_OFF, 0);
    }
}

#[test]
fn a_restart_ends_bus_off_too() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        add_at(&mut rig, rate.kind.master, "kind = 'bus_off'");
        rig.step(500);
        assert_eq!(rig.master.w_CANsync_STATUS.load(), BUS_OFF);
        rig.initialize_master();
        assert_eq!(rig.master.w_CANsync_STATUS.load(), IDLE);
    }
}

#[test]
fn a_cause_that_stays_switches_the_controller_off_again() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        let id = add_at(&mut rig, rate.kind.master, "kind = 'bus_off'\nduration_us = 10000");
        rig.master.w_CPU_CONTROL.store(0x00C0);
        rig.step(5_000);
        assert_eq!(rig.master.w_CANsync_STATUS.load(), BUS_OFF);
        rig.step(6_000);
        assert_eq!(news(&rig).last().map(|n| (n.1, n.2)), Some((id, News::Over)));
        rig.master.w_CPU_CONTROL.store(0x00C0);
        rig.step(5_000);
        assert_eq!(rig.master.w_CANsync_STATUS.load() & BUS_OFF, 0);
    }
}

/// A frame on the wire is destroyed when its sender goes BUS-off.
#[test]
fn a_frame_under_way_is_lost() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        let at = rig.plant.now() + u64::from(rate.timing.t_WRC1) + 70;
        add_at(&mut rig, rate.kind.master, &format!("kind = 'bus_off'\nat_us = {at}"));
        rig.slave.b_CTRLREG_WRC1.store(0);
        rig.send_wrc1();
        assert_eq!(rig.master.b_CTRLREG_WRC1.load(), 0x04, "it had gone out");
        assert_eq!(rig.slave.b_CTRLREG_WRC1.load(), 0);
    }
}

/// A node that is not yet on the bus cannot go BUS-off. The fault waits until the node takes part.
#[test]
fn bus_off_waits_for_a_working_controller() {
    for rate in FASTEST {
        let mut rig = Rig::of(Memory::Heap, rate, DRIVES);
        let id = add_at(&mut rig, rate.kind.master, "kind = 'bus_off'");
        rig.step(5_000);
        assert_eq!(rig.plant.faults().map(|f| (f.id, f.acting, f.hits)).collect::<Vec<_>>(), [(id, true, 0)]);
        rig.initialize_master();
        rig.master.w_CPU_CONTROL.store(0x0020);
        rig.step(1_000);
        assert_eq!(rig.master.w_CANsync_STATUS.load(), BUS_OFF);
        assert_eq!(rig.plant.faults().count(), 0);
    }
}

#[test]
fn an_overrun_of_the_master_loses_the_answer_and_stays_shown() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = running(memory, rate);
            add_at(&mut rig, rate.kind.master, "kind = 'overrun'");
            rig.master.a_STATREG_RDC[DRIVE].b_STATREG_RDC1.store(0xFF);
            rig.send_wrc1();
            assert_eq!(rig.master.a_STATREG_RDC[DRIVE].b_STATREG_RDC1.load(), 0xFF);
            assert!(rig.last_frame(0x301..=0x301).is_some(), "the frame was on the bus");
            assert_eq!(hits(&rig), [0x301]);
            rig.send_wrc1();
            assert_eq!(rig.master.a_STATREG_RDC[DRIVE].b_STATREG_RDC1.load(), 0x02);
            rig.step(100);
            assert_eq!(rig.master.w_CANsync_STATUS.load() & OVERRUN, OVERRUN);
            rig.master.w_CPU_CONTROL.store(0x00C0);
            rig.step(1_000);
            assert_eq!(rig.master.w_CANsync_STATUS.load() & OVERRUN, 0);
        }
    }
}

#[test]
fn an_overrun_of_a_slave_concerns_it_alone() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        add_at(&mut rig, rate.kind.slave, "kind = 'overrun'\ncount = 2");
        rig.slave.b_CTRLREG_WRC1.store(0);
        rig.master.a_STATREG_RDC[DRIVE].b_STATREG_RDC1.store(0xFF);
        rig.send_wrc1();
        assert_eq!(rig.slave.b_CTRLREG_WRC1.load(), 0);
        assert_eq!(
            rig.master.a_STATREG_RDC[DRIVE].b_STATREG_RDC1.load(),
            0x02,
            "the drive and the master heard it"
        );
        assert_eq!(
            hits(&rig),
            [0x101, 0x301],
            "reference values, and the drive's answer it would have overheard"
        );
        assert_eq!(rig.slave.w_CANsync_STATUS.load() & OVERRUN, OVERRUN);
        rig.send_wrc1();
        assert_eq!(rig.slave.b_CTRLREG_WRC1.load(), 0x02);
    }
}

/// Every bit that the manual describes is set on both nodes by some fault; reserved bits are never set.
#[test]
fn all_bits_of_the_status_register_can_be_seen_on_both_nodes() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = Rig::of(memory, rate, DRIVES);
            let mut seen = [0u16; 2];
            let look = |rig: &mut Rig, seen: &mut [u16; 2], steps: usize| {
                for _ in 0..steps {
                    rig.step(500);
                    seen[0] |= rig.slave.w_CANsync_STATUS.load();
                    seen[1] |= rig.master.w_CANsync_STATUS.load();
                }
            };
            rig.step(500);
            assert_eq!([rig.slave.w_CANsync_STATUS.load(), rig.master.w_CANsync_STATUS.load()], [0, 0]);
            rig.initialize_slave();
            rig.initialize_master();
            look(&mut rig, &mut seen, 1);
            assert_eq!(seen, [IDLE, IDLE], "buffer free, last job done");
            rig.activate();
            // The processor cycle moves through the interval, so that it meets frames on the wire.
            rig.step(230);
            rig.plant.processor_cycle();
            rig.configure_wrc1([0x01, 0x03, 0x05, 0x07]);
            rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x01);
            for step in 0..400 {
                rig.master.b_CTRLREG_WRC1.store(0x05);
                rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
                rig.step(55 + step % 7);
                rig.plant.processor_cycle();
                seen[0] |= rig.slave.w_CANsync_STATUS.load();
                seen[1] |= rig.master.w_CANsync_STATUS.load();
            }
            assert_eq!(seen, [0x003C; 2], "receiving and sending");
            add_at(&mut rig, rate.kind.master, "kind = 'overrun'");
            add_at(&mut rig, rate.kind.slave, "kind = 'overrun'");
            rig.master.b_CTRLREG_RD_ORDER_RDC1.store(DRIVE as u8);
            for _ in 0..8 {
                rig.master.b_CTRLREG_WRC1.store(0x05);
                look(&mut rig, &mut seen, 1);
            }
            assert_eq!(seen, [0x003E; 2], "overrun");
            add_at(&mut rig, rate.kind.master, "kind = 'bus_off'");
            add_at(&mut rig, rate.kind.slave, "kind = 'bus_off'");
            look(&mut rig, &mut seen, 4);
            assert_eq!(seen, [0x00FE; 2], "error and BUS-off");
        }
    }
}
