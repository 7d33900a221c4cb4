//! Worked examples of manual 5.02066.01a at 1 Mbit/s, which only this device has: examples that only function blocks
//! and front show. Examples of registers and frames run on both devices: modules `vectors`, `slave_jobs` and `jobs` in
//! `tests/device`. docs/devices/bm4-plc/overview.md lists them all.

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

use crate::rig::bring_up::Stage;
use crate::rig::{Memory, RATES, Rate, Rig};
use commram::devices::bm4_o_can_06::blocks::*;
use commram::devices::bm4_o_can_06::registers::*;
use commram::devices::cansync::frames::Frame;
use commram::devices::fault_kinds;
use commram::fault::FaultSpec;
use commram::identity::DeviceIndex;
use commram::memory::Segment;
use std::time::Duration;

struct Vector {
    id: &'static str,
    source: &'static str,
    check: fn(),
}

const VECTORS: &[Vector] = &[
    Vector {
        id: "T5b, T7, T8",
        source: "p. 20, 152-153: mapping of the master's frames",
        check: t5_t7_and_t8,
    },
    Vector { id: "T6b", source: "p. 21: mapping of a slave's frames", check: t6 },
    Vector { id: "T10", source: "p. 65: control word (bytes inferred)", check: t10 },
    Vector { id: "T11, T29", source: "p. 64-65, 101-103: broadcast to all slaves", check: t11_and_t29 },
    Vector { id: "T20, T21", source: "p. 126-127: baud rates", check: t20_and_t21 },
    Vector { id: "T22", source: "p. 190-192: monitoring time of an up-/download", check: t22 },
    Vector { id: "T23", source: "p. 192: length 0", check: t23 },
    Vector { id: "T24", source: "p. 189-190: 2048 values (blocks inferred)", check: t24 },
    Vector { id: "T26", source: "p. 27: DIP switches 8 to 4", check: t26 },
    Vector { id: "T27", source: "p. 27: DIP switches 3 to 1, with 9 at OFF", check: t27 },
    Vector { id: "T28", source: "p. 36-38: read job (identifiers inferred)", check: t28 },
    Vector { id: "T30", source: "p. 50: bit 7 ends BUS-off", check: t30 },
    Vector { id: "T36", source: "p. 62-64: order of jobs", check: t36 },
    Vector { id: "T37", source: "p. 172: no actual value frame", check: t37 },
];

#[test]
fn every_vector_of_blocks_and_front_holds() {
    for Vector { id, source, check } in VECTORS {
        println!("{id} ({source})");
        check();
    }
}

/// Returns the rate of 1 Mbit/s of this device.
fn rate() -> Rate {
    *RATES.iter().find(|rate| rate.kbit_s == 1000).expect("the b maXX PLC has it")
}

/// Returns a test rig in active operation. Slave 0 is another PLC; a drive has number 5.
fn active() -> Rig {
    let drive = "[[bus.drive]]\nname = 'd'\nslave_number = 5\nlock_time_us = 20000\n";
    let mut rig = Rig::of(Memory::Heap, rate(), drive);
    rig.activate();
    rig.run_to_sync();
    rig
}

fn ram(rig: &Rig) -> Ram {
    Ram::of(rig.plant.devices()[rig.master_at.plc].segment()).unwrap()
}

fn master(rig: &Rig) -> Base<CANsync_PLC_MA_BMSTRUCT> {
    ram(rig).at(rig.master_at.base).unwrap()
}

/// Returns the frames of the command channel in `intervals` intervals; the last frame may end in the interval after
/// them.
fn commands(rig: &mut Rig, intervals: usize) -> Vec<Frame> {
    let before = rig.frames().len();
    (0..=intervals).for_each(|_| rig.run_to_sync());
    let new = rig.frames().split_off(before).into_iter().map(|(_, frame)| frame);
    new.filter(|frame| frame.id() == 0x010 || frame.id() & 0x780 == 0x500).collect()
}

fn t5_t7_and_t8() {
    let high = [false, true, false, false];
    for (a_WRC1, bytes) in
        [([0, 0, 2, 3], [0x01, 0x03, 0x09, 0x0D]), ([1, 1, 0, 2], [0x05, 0x07, 0x01, 0x09])]
    {
        let rig = active();
        CANsync_PD_CFG_MA { a_WRC1, a_HL_WRC1: high, a_WRC2: [4, -1, 6, 7], ..Default::default() }
            .call(&master(&rig));
        let cfg = &rig.master._CFG_WRC_WORD;
        let one =
            [&cfg.b_CFG_WRC1_WORD0, &cfg.b_CFG_WRC1_WORD1, &cfg.b_CFG_WRC1_WORD2, &cfg.b_CFG_WRC1_WORD3];
        let two =
            [&cfg.b_CFG_WRC2_WORD0, &cfg.b_CFG_WRC2_WORD1, &cfg.b_CFG_WRC2_WORD2, &cfg.b_CFG_WRC2_WORD3];
        assert_eq!(one.map(|cell| cell.load()), bytes);
        assert_eq!(two.map(|cell| cell.load()), [0x11, 0x00, 0x19, 0x1D], "-1: word 1 is not in use");
    }
}

fn t6() {
    let rig = active();
    CANsync_PD_CFG_READ_MA {
        si_SL_NR: 5,
        a_RDC1: [0, 0, 2, 2],
        a_HL_RDC1: [false, true, false, true],
        a_RDC2: [-1; 4],
        ..Default::default()
    }
    .call(&master(&rig));
    let cfg = &rig.master.a_CFG_RDC_WORD[5];
    let bytes = [&cfg.b_CFG_RDC1_WORD0, &cfg.b_CFG_RDC1_WORD1, &cfg.b_CFG_RDC1_WORD2, &cfg.b_CFG_RDC1_WORD3];
    assert_eq!(bytes.map(|cell| cell.load()), [0x01, 0x03, 0x09, 0x0B]);
}

fn t10() {
    let mut rig = active();
    rig.master.b_SL_NR_CONTROLWORD.store(3);
    rig.master.a_CONTROLWORD_SL[3].store(0xABCD);
    rig.master.a_STEUREG_CONTROLWORD[3].store(0x05);
    let sent = commands(&mut rig, 1);
    assert_eq!(sent, [Frame::new(0x010, &[0x08, 0, 0, 0, 0x01, 0, 0xCD, 0xAB]).unwrap()]);
    assert_eq!(rig.master.a_STEUREG_CONTROLWORD[3].load(), 0x04);
}

fn t11_and_t29() {
    let mut rig = active();
    let mut block = CANsync_BC_MA0 {
        us_BC_CMD_NR: 0x80,
        si_BC_BYTE: 0x11,
        i_BC_WORD: 0x2233,
        d_SL_MASK: u32::MAX,
        x_EN: true,
        ..Default::default()
    };
    block.call(&master(&rig));
    assert_eq!(rig.master.b_CTRL_REG_BC0.load(), 0x05);
    let sent = commands(&mut rig, 1);
    assert_eq!(sent, [Frame::new(0x010, &[0xFF, 0xFF, 0xFF, 0xFF, 0x80, 0x11, 0x33, 0x22]).unwrap()]);
    assert_eq!(rig.master.b_CTRL_REG_BC0.load(), 0x04);
    block.x_EN = false;
    block.call(&master(&rig));
    assert!(block.x_OK);
    assert_eq!((rig.slave.b_STATREG_AKT_CMD.load(), rig.slave.b_AKT_CMD.load()), (0x02, 0x80));
}

/// The firmware does not run in this test. So the registers show exactly what the block has written.
fn t20_and_t21() {
    for (us_BAUDRATE, us_SYNC_INTERVAL, timing, w_ERR) in
        [(6, 1, [0x40, 0x34], 0), (5, 2, [0x41, 0x34], 0), (4, 4, [0x43, 0x34], 0), (3, 8, [0x47, 0x34], 0)]
            .into_iter()
            .chain([(7, 8, [0x47, 0x34], 1 << 1), (2, 8, [0x47, 0x34], 1 << 1)])
    {
        let ram = Ram::of(&Segment::of(&DEVICE)).unwrap();
        let base = ram.at::<CANsync_PLC_INIT_BMSTRUCT>(SLOTG).unwrap();
        let mut block = CANsync_INIT { us_BAUDRATE, us_SYNC_INTERVAL, ..Default::default() };
        for status in [0x0001, 0x0002] {
            base.w_OPTION_STATUS.store(status);
            block.call(&base);
        }
        assert_eq!([base.b_BT_0.load(), base.b_BT_1.load()], timing, "us_BAUDRATE {us_BAUDRATE}");
        assert_eq!(base.b_TIME_PATTERN.load(), us_SYNC_INTERVAL);
        base.w_OPTION_STATUS.store(0x0003);
        block.call(&base);
        assert_eq!((block.w_ERR, block.x_OK), (w_ERR, w_ERR == 0), "us_BAUDRATE {us_BAUDRATE}");
    }
}

/// Calls a block once in each interval of a test rig until the block is no longer busy; returns the duration in us.
fn finish(rig: &mut Rig, block: &mut CANsync_UPDOWNLOAD_MA, mut between: impl FnMut(&Rig)) -> u64 {
    let (base, start) = (master(rig), rig.plant.now());
    let (down, mut up) = ([0; UPDOWN_VALUES], [0; UPDOWN_VALUES]);
    loop {
        block.call(&base, &down, &mut up);
        if !block.x_BUSY {
            return rig.plant.now() - start;
        }
        between(rig);
        rig.run_to_sync();
    }
}

fn t22() {
    let mut rig = active();
    rig.master.b_SL_NR_UPDOWN.store(2);
    let mut block = CANsync_UPDOWNLOAD_MA {
        si_SL_NR: 2,
        u_LENGTH: 10,
        us_MAX_NR_OF_COMM: 3,
        t_TIME: Duration::from_secs(2),
        x_EN: true,
        ..Default::default()
    };
    let us = finish(&mut rig, &mut block, |_| ());
    assert_eq!((block.x_ERR, block.b_ERR), (true, 1 << 2));
    // Each attempt ends in the first cycle after its time limit.
    assert!((6_000_000..6_010_000).contains(&us), "{us} us");
}

fn t23() {
    let mut rig = active();
    let mut block = CANsync_UPDOWNLOAD_MA { u_LENGTH: 0, x_EN: true, ..Default::default() };
    finish(&mut rig, &mut block, |_| ());
    assert_eq!((block.x_ERR, block.b_ERR), (true, 1 << 1));
}

fn t24() {
    let mut rig = active();
    rig.slave.b_EN_UPDOWNBLK1.store(1);
    rig.master.b_SL_NR_UPDOWN.store(0);
    let mut block =
        CANsync_UPDOWNLOAD_MA { u_LENGTH: 2048, x_UPDOWN: true, x_EN: true, ..Default::default() };
    let mut lengths = Vec::new();
    finish(&mut rig, &mut block, |rig| {
        // The application of slave 0 allows and takes every transfer.
        let control = rig.slave.b_STEUREG_UPDOWNBLK1.load();
        if control == 0x55 {
            lengths.push(rig.slave.w_LENGTH_UPDOWNBLK1.load());
        }
        if control & 0x01 != 0 {
            rig.slave.b_STATREG_UPDOWNBLK1.store(control & !0x01);
            rig.slave.b_STEUREG_UPDOWNBLK1.store(control & !0x01);
        }
    });
    assert_eq!((block.x_OK, block.b_ERR), (true, 0));
    let blocks = [vec![4 * 75; 27], vec![4 * 23]].concat();
    assert_eq!(lengths, blocks);
}

fn t26() {
    for (switches, number) in [(0b00110, 6), (0b00100, 4)] {
        let mut rig = Rig::new(Memory::Heap, rate());
        let header = rig.plant.devices()[rig.slave_at.plc].segment().header().unwrap();
        header.ports[rig.slave_at.port.index()].dip.store(switches);
        rig.plant.set_power(DeviceIndex::at(rig.slave_at.plc), commram::plant::Power::Off);
        rig.plant.set_power(DeviceIndex::at(rig.slave_at.plc), commram::plant::Power::On);
        assert_eq!(rig.slave.w_OMEGA_NR.load(), number, "w_SLAVE_NUMBER");
    }
}

fn t27() {
    for (switches, kbit_s) in [(0b011, 125), (0b100, 250), (0b101, 500), (0b110, 1000)] {
        for rate in RATES.iter().filter(|rate| !rate.kind.is_omega()) {
            let module = format!(
                "[[device.module]]\nslot = 'G'\nkind = 'can-05'\nbus = 'line'\ndip = 2\ndip9 = false\ndip_baud = {switches}\n\
                 lock_time_us = 20000\n"
            );
            let text = rate.plant("").replacen("[[bus]]", &(module + "[[bus]]"), 1);
            let mut rig = Rig::of_plant(Memory::Heap, *rate, &text);
            rig.bring_up(&[&rig.master_node()], ..=Stage::SetUp);
            rig.step(100 * rate.interval_us);
            let expected = if rate.kbit_s == kbit_s { 0x03 } else { 0 };
            assert_eq!(rig.master.a_STAT_SL[2].load(), expected, "{switches:03b} at {} kbit/s", rate.kbit_s);
            rig.tolerate_errors(&[&commram::devices::cansync::rules::DRIVE_BAUD_RATE]);
        }
    }
}

fn t28() {
    let mut rig = active();
    rig.step(60_000);
    rig.run_to_sync();
    rig.master.b_SL_NR_PARAMETER.store(5);
    rig.master.a_DATA_PARAMETER[5].w_PAR_NR.store(300);
    rig.master.a_CTRLREG_PAR_CMD_SL[5].b_STATREG_PAR_CMD.store(0x03);
    rig.master.a_CTRLREG_PAR_CMD_SL[5].b_STEUREG_PAR_CMD.store(0x03);
    rig.run_to_sync();
    rig.run_to_sync();
    let job = rig.last_frame(0x505..=0x505).expect("the job");
    assert_eq!((job.data().len(), job.data()[0] & 0x0F, job.data()[1]), (4, 0x01, 0x2C));
    let response = rig.last_frame(0x585..=0x585).expect("the drive's response");
    // The response has a doubleword.
    assert_eq!((response.data().len(), &response.data()[..2]), (8, &[0x01, 0x2C][..]));
}

fn t30() {
    let mut rig = active();
    let fault = "kind = 'bus_off'\nplc = 'a'\nnode = 'slotJ'";
    let spec: FaultSpec = toml::from_str(fault).unwrap();
    let fault = spec.resolve(fault_kinds(), &rig.plant.names()).unwrap();
    rig.plant.add_fault(fault).unwrap();
    rig.step(5_000);
    assert_eq!(rig.master.w_CANsync_STATUS.load() & 0x0080, 0x0080, "BUS-off");
    assert_eq!(commands(&mut rig, 5), []);
    CANsync_MODE_MA { x_RESET_CANsync_CONTROLLER: true, ..Default::default() }.call(&master(&rig));
    assert_eq!(rig.master.w_CPU_CONTROL.load() & 0x0080, 0x0080);
    // 128 x 11 bits must pass before a controller takes part again (D-121).
    rig.step(5_000);
    assert_eq!(rig.master.w_CPU_CONTROL.load() & 0x0080, 0, "the firmware has cleared the bit");
    assert_eq!(rig.master.w_CANsync_STATUS.load() & 0x0080, 0);
    rig.run_to_sync();
    rig.send_wrc1();
    assert!(rig.last_frame(0x100..=0x17F).is_some(), "it sends again");
}

fn t36() {
    let mut rig = active();
    rig.master.b_SL_NR_PARAMETER.store(5);
    rig.master.a_DATA_PARAMETER[5].w_PAR_NR.store(300);
    rig.master.a_CTRLREG_PAR_CMD_SL[5].b_STATREG_PAR_CMD.store(0x03);
    rig.master.a_CTRLREG_PAR_CMD_SL[5].b_STEUREG_PAR_CMD.store(0x03);
    rig.master.b_SL_NR_CONTROLWORD.store(5);
    rig.master.a_STEUREG_CONTROLWORD[5].store(0x05);
    rig.master.d_SL_MASK_BC1.store(u32::MAX);
    rig.master.b_CMD_BC1.store(0x90);
    rig.master.b_CTRL_REG_BC1.store(0x05);
    let sent: Vec<_> =
        commands(&mut rig, 3).iter().map(|frame| (frame.id(), frame.data().get(4).copied())).collect();
    assert_eq!(sent, [(0x010, Some(0x90)), (0x010, Some(0x01)), (0x505, None)]);
}

/// The expected value is -128 as in the text of the manual; the table of the manual has -1.
fn t37() {
    let mut rig = active();
    let mut block = CANsync_PD_COMM_MA { si_WRC1_SEND: 5, si_RD_SL_NR1_RECEIVE: 9, ..Default::default() };
    // The reception registers contain 0 after the start, which is also the number of slave 0. The first call prepares
    // them for a reception.
    block.call(&master(&rig), &mut [[0; 16]; 32]);
    for _ in 0..3 {
        rig.run_to_sync();
        block.call(&master(&rig), &mut [[0; 16]; 32]);
        assert_eq!((block.si_RD_SL_NR1_RECEIVED, block.si_RD_SL_NR2_RECEIVED), (-128, -128));
    }
}
