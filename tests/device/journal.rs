//! Journal records of the handshakes of both nodes: every request, every answer, results, latencies.

use crate::rig::{FASTEST, Memory, Rate, Rig};
use commram::devices::cansync;
use commram::devices::cansync::registers::phases;
use commram::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, CTRLREG_PAR_CMD_SL};
use commram::identity::DeviceIndex;
use commram::journal::{Handshake, Record, Register, State};
use commram::layout::Address;
use core::mem::offset_of;

/// Returns a test rig with both nodes active; the master polls slave 0 in every interval, and block 1 of the slave is
/// enabled.
fn connected(rate: Rate) -> Rig {
    let mut rig = Rig::new(Memory::Heap, rate);
    // The control register decides; the journal is tested without the status register.
    rig.tolerate_errors(&[&cansync::rules::ORDER]);
    rig.activate();
    rig.slave.b_EN_UPDOWNBLK1.store(1);
    rig.run_to_sync();
    rig
}

/// Returns `register from -> to` for every journal record about registers of both nodes from record `from` on, with
/// `master` and `slave` as the names of their ports.
fn register_changes(rig: &Rig, from: u64) -> Vec<String> {
    let journal = rig.plant.journal();
    journal.read(from).filter_map(|record| description_of(rig, &record)).collect()
}

fn description_of(rig: &Rig, record: &Record) -> Option<String> {
    let answered = |it: Handshake| (it.origin.plc, it.offset, it.request.into(), it.answer.into());
    let shown = |it: Register| (it.origin.plc, it.offset, it.from, it.to);
    let (plc, offset, before, after) =
        record.event.get().map(answered).or_else(|| record.event.get().map(shown))?;
    let found = rig.fitted(plc).registers_at(Address::byte(offset), Some(phases::CYCLIC)).unwrap();
    let register = found.into_iter().find(|register| register.offset() == offset).unwrap();
    let name = rig.rate.kind.unnamed(&register.name());
    Some(format!("{name} {before:02X} -> {after:02X}"))
}

/// Writes a register of the master as the channel does.
fn write(rig: &mut Rig, offset: usize, write: impl FnOnce(&Rig)) {
    write(rig);
    let offset = rig.master_at.base + offset as u32;
    let value = rig.plant.devices()[0].segment().load(offset, commram::memory::Width::Byte).unwrap();
    rig.plant.note_channel_write(DeviceIndex(0), offset, 1, value);
}

/// Control register of the parameter job for slave 0.
const JOB: usize = offset_of!(CANsync_MA_CTRL_BMSTRUCT, a_CTRLREG_PAR_CMD_SL)
    + offset_of!(CTRLREG_PAR_CMD_SL, b_STEUREG_PAR_CMD);

#[test]
fn a_parameter_job_with_its_answers_at_both_ends() {
    for rate in FASTEST {
        let mut rig = connected(rate);
        let from = rig.plant.journal().end();
        rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(300);
        let entered = rig.plant.now();
        write(&mut rig, JOB, |rig| rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.store(0x03));
        for _ in 0..3 {
            rig.run_to_sync();
        }
        rig.slave.d_DATA_PAR_CMD.store(0x1234);
        rig.slave.b_STEUREG_PAR_CMD.store(0x42);
        for _ in 0..2 {
            rig.run_to_sync();
        }
        assert_eq!(
            register_changes(&rig, from),
            [
                "MASTER.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD 03 -> 0B",
                "SLAVE.w_PAR_NR 00 -> 12C",
                "SLAVE.b_STEUREG_PAR_CMD 00 -> 43",
                "MASTER.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD 0B -> 4B",
                "SLAVE.b_STEUREG_PAR_CMD 42 -> 02",
                "MASTER.a_DATA_PARAMETER[0].d_PAR_VALUE 00 -> 1234",
                "MASTER.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD 4B -> 02",
            ]
        );
        let job = rig.master_at.base + JOB as u32;
        let answers = rig
            .plant
            .journal()
            .read(from)
            .filter(|record| record.event.get().is_some_and(|it: Handshake| it.offset == job));
        let mut count = 0;
        for record in answers {
            assert_eq!(
                record.latency_us.map(u64::from),
                Some(record.time_us - entered),
                "from the PLC's request on"
            );
            count += 1;
        }
        assert_eq!(count, 3);
    }
}

#[test]
fn an_error_number_is_recorded() {
    for rate in FASTEST {
        let mut rig = connected(rate);
        let from = rig.plant.journal().end();
        rig.master.w_LENGTH_UPDOWNBLK1.store(301);
        rig.master.d_BASE_ADR_UPDOWNBLK1.store(0x1000);
        rig.master.b_STEUREG_UPDOWNBLK1.store(0x15);
        rig.run_to_sync();
        rig.master.w_LENGTH_UPDOWNBLK1.store(300);
        rig.master.b_STEUREG_UPDOWNBLK1.store(0x15);
        rig.run_to_sync();
        assert_eq!(
            register_changes(&rig, from),
            [
                "MASTER.w_ERR_NR_UPDOWNBLK1 00 -> 02",
                "MASTER.b_STEUREG_UPDOWNBLK1 15 -> 34",
                "MASTER.w_ERR_NR_UPDOWNBLK1 02 -> 00",
                "MASTER.b_STEUREG_UPDOWNBLK1 15 -> 17",
            ]
        );
    }
}

/// Every step of an upload and a download is recorded at both ends, in block 1 and frame by frame.
#[test]
fn a_transfer_is_recorded_from_init_to_end_at_both_ends() {
    for rate in FASTEST {
        // The b maXX PLC has no single-frame area (D-296).
        let areas = [(1, "UPDOWNBLK1"), (0, "UPDOWN_SINGLE")].into_iter();
        for (block_1, area) in areas.filter(|(block_1, _)| *block_1 == 1 || rate.kind.is_omega()) {
            for direction in [0x00, 0x10] {
                let mut rig = connected(rate);
                rig.slave.b_EN_UPDOWNBLK1.store(block_1);
                let from = rig.plant.journal().end();
                rig.master.w_LENGTH_UPDOWNBLK1.store(8);
                rig.master.d_BASE_ADR_UPDOWNBLK1.store(0x1000);
                rig.master.b_STEUREG_UPDOWNBLK1.store(direction | 0x05);
                for _ in 0..40 {
                    // The application takes every transfer.
                    let control = match block_1 {
                        1 => &rig.slave.b_STEUREG_UPDOWNBLK1,
                        _ => &rig.slave.b_STEUREG_UPDOWN_SINGLE,
                    };
                    control.update(|value| value & !0x01);
                    rig.run_to_sync();
                }
                let changes = register_changes(&rig, from);
                let of = |register: &str| {
                    let own = changes.iter().filter(|line| line.starts_with(register));
                    own.map(|line| line.rsplit(' ').next().unwrap().to_owned()).collect::<Vec<_>>()
                };
                let hex = |values: &[u8]| {
                    values.iter().map(|v| format!("{:02X}", v | direction)).collect::<Vec<_>>()
                };
                assert_eq!(of("MASTER.b_STEUREG_UPDOWNBLK1").last(), Some(&hex(&[0x0C])[0]));
                assert_eq!(of(&format!("SLAVE.b_STEUREG_{area}")).first(), Some(&hex(&[0x45])[0]));
                assert_eq!(of(&format!("SLAVE.b_STEUREG_{area}")).last(), Some(&hex(&[0x0C])[0]));
            }
        }
    }
}

#[test]
fn action_commands_show_at_the_slave_when_they_change_something() {
    for rate in FASTEST {
        let mut rig = connected(rate);
        let from = rig.plant.journal().end();
        rig.master.a_CONTROLWORD_SL[0].store(0x000F);
        for _ in 0..2 {
            rig.master.a_STEUREG_CONTROLWORD[0].store(0x05);
            rig.run_to_sync();
            rig.run_to_sync();
        }
        // Begins another interval, so that the journal does not count the third command together with the first two.
        rig.run_to_sync();
        rig.slave.b_STATREG_CONTROLWORD.store(0);
        rig.master.a_STEUREG_CONTROLWORD[0].store(0x05);
        rig.run_to_sync();
        rig.run_to_sync();
        assert_eq!(
            register_changes(&rig, from),
            [
                "MASTER.a_STEUREG_CONTROLWORD[0] 05 -> 04",
                "SLAVE.w_CONTROLWORD 00 -> 0F",
                "SLAVE.b_STATREG_CONTROLWORD 00 -> 02",
                "MASTER.a_STEUREG_CONTROLWORD[0] 05 -> 04",
                "MASTER.a_STEUREG_CONTROLWORD[0] 05 -> 04",
                "SLAVE.b_STATREG_CONTROLWORD 00 -> 02",
            ]
        );
    }
}

#[test]
fn process_data_record_only_their_handshakes() {
    for rate in FASTEST {
        let mut rig = connected(rate);
        rig.configure_wrc1([0x01, 0x02, 0, 0]);
        let from = rig.plant.journal().end();
        for _ in 0..5 {
            rig.send_wrc1();
        }
        let changes = register_changes(&rig, from);
        assert!(changes.iter().all(|line| line == "MASTER.b_CTRLREG_WRC1 05 -> 04"), "{changes:?}");
    }
}

#[test]
fn the_status_register_is_recorded_except_for_bus_traffic() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.expect_errors(&[&cansync::rules::INIT_BAUD_RATE]);
        rig.activate();
        (0..50).for_each(|_| rig.run_to_sync());
        let status = |rig: &Rig| {
            register_changes(rig, 0)
                .into_iter()
                .filter(|line| line.contains("w_CANsync_STATUS"))
                .collect::<Vec<_>>()
        };
        assert_eq!(status(&rig), [""; 0]);
        // Invalid initialization data lead to a warning. After the next restart there is no further warning.
        for command in [0x0000, 0x0001] {
            rig.master_init.w_CPU_CONTROL.store(command);
            rig.step(500);
        }
        rig.master_init.b_BT_1.store(0xFF);
        rig.master_init.w_CPU_CONTROL.store(0x0002);
        rig.step(500);
        rig.master_init.w_CPU_CONTROL.store(0x0000);
        rig.step(500);
        assert_eq!(status(&rig), ["MASTER.w_CANsync_STATUS 00 -> 40", "MASTER.w_CANsync_STATUS 40 -> 00"]);
    }
}

#[test]
fn states_know_how_long_their_command_waited() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.step(200);
        write(&mut rig, 0, |rig| rig.master_init.w_CPU_CONTROL.store(0x0001));
        rig.step(2_000);
        rig.master_init.w_CPU_CONTROL.store(0x0000);
        rig.step(500);
        let states = rig.records().filter(|record| record.event.is::<State>());
        let latencies: Vec<_> = states.map(|record| record.latency_us).collect();
        assert_eq!(latencies, [Some(300), None], "through the channel, by a mapped client");
    }
}
