//! The function blocks with the gateway: a program calls the blocks in each cycle of 1 ms (p. 61-70, 76-86).

use super::*;
use crate::devices::can_dp2::blocks::*;
use crate::plc::{Base, Ram};
use embedded_can::Frame as _;

/// A PLC with the data of its program, and a CANopen device that accepts every SDO.
struct Plc {
    bench: Bench,
    mst: Base<CAN_DP2_MST>,
    master: DP_MASTER,
    blocks: DataBlocks,
    peripherals: Peripherals,
    /// The device refuses SDOs for this index.
    refuses: u16,
}

impl Plc {
    /// Returns a PLC that has not called the master yet.
    fn begun(flags_1: u8, cfg: &[u8], output_len: u8) -> Self {
        let bench = Bench::new(5);
        let mst = Ram::of(&bench.segment).unwrap().at(MST).unwrap();
        let mut master = DP_MASTER {
            ENABLE: true,
            CFG_LEN: cfg.len() as u8,
            OUTPUT_LEN: output_len,
            ..Default::default()
        };
        master.PRM.copy_from_slice(&prm(flags_1, 0));
        master.CFG[..cfg.len()].copy_from_slice(cfg);
        let (blocks, peripherals) = (DataBlocks::default(), Peripherals::default());
        Plc { bench, mst, master, blocks, peripherals, refuses: 0 }
    }

    /// Returns a PLC that exchanges data.
    fn new(flags_1: u8, cfg: &[u8], output_len: u8) -> Self {
        let mut plc = Plc::begun(flags_1, cfg, output_len);
        for _ in 0..200 {
            plc.cycle(|_, _| ());
            if plc.master.READY {
                return plc;
            }
        }
        panic!("no data exchange: {:02X?}", plc.master.DIAG);
    }

    /// Runs one cycle: first the program, then the data exchange.
    fn cycle(&mut self, program: impl FnOnce(&mut DataBlocks, &mut Peripherals)) {
        program(&mut self.blocks, &mut self.peripherals);
        self.master.call(&self.mst, &mut self.peripherals);
        self.bench.run(MS);
        let requests: Vec<Frame> =
            self.bench.wires.lock().unwrap().heard.iter().map(|(_, frame)| *frame).collect();
        for frame in requests {
            let id = frame.arbitration().number() as u16;
            let &[command, low, high, sub, ..] = frame.data() else { continue };
            if !(0x601..=0x67F).contains(&id) {
                continue;
            }
            self.bench.wires.lock().unwrap().heard.retain(|(_, heard)| *heard != frame);
            let answer = match command {
                _ if u16::from_le_bytes([low, high]) == self.refuses => [0x80, low, high, sub, 0, 0, 2, 6],
                0x40 => [0x4B, low, high, sub, 0x92, 0x01, 0, 0],
                _ => [0x60, low, high, sub, 0, 0, 0, 0],
            };
            self.bench.send(data(id - 0x80, &answer));
        }
    }

    /// Runs a block for the given number of cycles.
    fn run(&mut self, cycles: usize, mut block: impl FnMut(&mut DataBlocks, &mut Peripherals)) {
        (0..cycles).for_each(|_| self.cycle(&mut block));
    }
}

const WINDOWS: [u8; 10] = [0x83, 0x8F, 0xFF, 0xEF, 0, 0x43, 0x8F, 0xFF, 0xEF, 0];

/// Runs one transfer of the block.
fn transfer(plc: &mut Plc, block: &mut FB4) {
    block.FREIGABE = false;
    block.call(&mut plc.peripherals);
    (block.FREIGABE, block.WRITE_ENABLE) = (true, true);
    for _ in 0..100 {
        plc.cycle(|_, peripherals| block.call(peripherals));
        if block.TRANSFER_READY {
            return;
        }
    }
    panic!("no end of the transfer");
}

/// A fault of telegrams at any step of the start delays the exchange, but never prevents it.
#[test]
fn the_master_exchanges_data_after_every_transient_fault() {
    const FAULTS: [(&str, &[(&str, u64)]); 9] = [
        ("lose_telegram", &[]),
        ("lose_telegram", &[("what", 0)]),
        ("lose_telegram", &[("what", 1)]),
        ("delay_telegram", &[("delay_us", 20_000)]),
        ("repeat_telegram", &[("delay_us", 700)]),
        ("garble_telegram", &[]),
        ("wrong_frame_count", &[]),
        ("silent_station", &[("station", 1)]),
        ("silent_station", &[("station", 5)]),
    ];
    let begun = (0..10).flat_map(|cycles| (1..=8).map(move |count| (cycles, count)));
    for (fault, values) in FAULTS {
        for (cycles, count) in begun.clone() {
            let mut plc = Plc::begun(0, &CFG, 2);
            plc.run(cycles, |_, _| ());
            plc.bench.disturb(fault, values, Some(count));
            let case = format!("{fault} {values:?} count={count} after {cycles} cycles");
            let mut left = 2500;
            while !(plc.bench.faults.is_empty() && plc.master.READY) {
                assert!(left > 0, "no exchange after {case}: {:02X?}", plc.master.DIAG);
                left -= 1;
                plc.cycle(|_, _| ());
            }
            let before = plc.master.COUNT;
            plc.run(20, |_, _| ());
            assert!(plc.master.READY && plc.master.COUNT - before > 5, "{case}");
        }
    }
}

/// The block sends the orders of p. 77-79: it enables the start frame, enables an identifier, and receives a frame. With
/// READ_ENABLE it also reads with every order. FREIGABE without an order only reads.
#[test]
fn fb4_sends_orders_over_the_window() {
    for command in [4, 3, 0] {
        let mut plc = Plc::new(0x80, &WINDOWS, 16);
        let mut block =
            FB4 { READ_ENABLE: true, WRITE_DATA0: 1, WRITE_LEN: 2, WRITE_COMMAND: 1, ..Default::default() };
        transfer(&mut plc, &mut block);
        assert_eq!((block.READ_RET_VAL, block.WRITE_RET_VAL, block.READ_CAN_ID), (0, 0, 0xEEEE));
        plc.run(10, |_, _| ());
        assert_eq!(plc.bench.heard(), ["0: 01 00"]);
        (block.WRITE_CAN_ID, block.WRITE_COMMAND) = (0x181, 4);
        transfer(&mut plc, &mut block);
        plc.run(6, |_, _| ());
        plc.bench.send(data(0x181, &[1, 2, 3]));
        plc.run(10, |_, _| ());
        block.WRITE_COMMAND = command;
        transfer(&mut plc, &mut block);
        let read = (block.READ_CAN_ID, block.READ_LEN, block.READ_DATA2, block.READ_COMMAND);
        assert_eq!(read, (0x181, 3, 3, 0));
        transfer(&mut plc, &mut block);
        assert_eq!(block.READ_CAN_ID, 0xEEEE, "it came once");
    }
}

#[test]
fn one_pulse_of_fb4_is_one_transfer() {
    let mut plc = Plc::new(0x80, &WINDOWS, 16);
    // One pulse of FREIGABE starts one transfer. The next transfer needs another pulse.
    let mut again =
        FB4 { FREIGABE: true, WRITE_ENABLE: true, WRITE_LEN: 1, WRITE_COMMAND: 1, ..Default::default() };
    plc.run(60, |_, peripherals| again.call(peripherals));
    assert_eq!(plc.bench.heard(), ["0: 00"]);
    let mut nowhere = FB4 { FREIGABE: true, READ_ADDRESS: 240, ..Default::default() };
    plc.run(1, |_, peripherals| nowhere.call(peripherals));
    assert_eq!((nowhere.TRANSFER_READY, nowhere.READ_RET_VAL), (true, 1));
}

/// A frame that arrives between two pulses is not lost, whenever it arrives.
#[test]
fn fb4_loses_no_frame_while_it_reads() {
    let mut plc = Plc::new(0x80, &WINDOWS, 16);
    let mut read = FB4 { WRITE_CAN_ID: 0x181, WRITE_COMMAND: 4, ..Default::default() };
    transfer(&mut plc, &mut read);
    read.READ_ENABLE = true;
    for (command, gap) in [(3, 7_u16), (0, 13), (6, 17)] {
        let mut found = Vec::new();
        for cycle in 0..30 * gap + 100 {
            if cycle % gap == 0 && cycle < 30 * gap {
                plc.bench.send(data(0x181, &cycle.to_be_bytes()));
            }
            (read.FREIGABE, read.WRITE_COMMAND) = (!read.TRANSFER_READY, command);
            plc.cycle(|_, peripherals| read.call(peripherals));
            if read.TRANSFER_READY && read.READ_CAN_ID == 0x181 {
                found.push(u16::from_be_bytes([read.READ_DATA0, read.READ_DATA1]));
            }
        }
        let sent: Vec<u16> = (0..30).map(|number| number * gap).collect();
        assert_eq!(found, sent, "with command {command}");
    }
}

/// The program of p. 77-80 with its flags: FB4 and the networks around it.
struct Example {
    /// Flag bytes MB0 to MB17.
    mb: [u8; 18],
    /// M95.0 to M96.0: how many of the first orders are finished.
    orders: usize,
    /// M99.6: the pulse of FREIGABE.
    pulse: bool,
    block: FB4,
    /// DB92: 16 bytes for each identifier from 16#181 on.
    db92: Vec<u8>,
}

impl Example {
    fn new() -> Self {
        Example { mb: [0; 18], orders: 0, pulse: false, block: FB4::default(), db92: vec![0; 16 * 128] }
    }

    fn mw(&self, at: usize) -> u16 {
        u16::from_be_bytes([self.mb[at], self.mb[at + 1]])
    }

    /// Network 5: sends the first orders one after the other (identifier, first two data bytes, length,
    /// command). When all have been sent, it sends no more.
    fn order(&mut self) {
        let enables = |id: u16| (id, 0_u16, 0, 4);
        let orders = [
            (0, 0, 0, 0),
            (0, 0x100, 2, 1),
            (0, 0x200, 0, 20),
            enables(0x181),
            enables(0x18A),
            enables(0x183),
            enables(0x184),
            enables(0x187),
            enables(0x188),
        ];
        let Some(&(id, first, length, command)) = orders.get(self.orders) else { return };
        self.mb[..2].copy_from_slice(&id.to_be_bytes());
        self.mb[4..6].copy_from_slice(&first.to_be_bytes());
        (self.mb[12], self.mb[14], self.mb[15]) = (length, 0, command);
    }

    /// Runs networks 5 and 6 in one PLC cycle.
    fn call(&mut self, peripherals: &mut Peripherals) {
        self.order();
        let block = &mut self.block;
        (block.FREIGABE, block.WRITE_ENABLE, block.READ_ENABLE) = (self.pulse, true, true);
        let mb = &mut self.mb;
        block.WRITE_CAN_ID = u16::from_be_bytes([mb[0], mb[1]]);
        let [.., d0, d1, d2, d3, d4, d5, d6, d7, _, _, _, _, _, _] = *mb;
        (block.WRITE_DATA0, block.WRITE_DATA1, block.WRITE_DATA2, block.WRITE_DATA3) = (d0, d1, d2, d3);
        (block.WRITE_DATA4, block.WRITE_DATA5, block.WRITE_DATA6, block.WRITE_DATA7) = (d4, d5, d6, d7);
        (block.WRITE_LEN, block.WRITE_SUBCOMMAND, block.WRITE_COMMAND) = (mb[12], mb[14], mb[15]);
        block.call(peripherals);
        mb[..2].copy_from_slice(&block.READ_CAN_ID.to_be_bytes());
        mb[4..12].copy_from_slice(&[
            block.READ_DATA0,
            block.READ_DATA1,
            block.READ_DATA2,
            block.READ_DATA3,
            block.READ_DATA4,
            block.READ_DATA5,
            block.READ_DATA6,
            block.READ_DATA7,
        ]);
        (mb[12], mb[14], mb[15]) = (block.READ_LEN, block.READ_FIFO_COUNT, block.READ_COMMAND);
        // In the example, READ_RET_VAL has the addresses MB14 and MB15, so it overwrites READ_FIFO_COUNT and
        // READ_COMMAND.
        mb[14..16].copy_from_slice(&block.READ_RET_VAL.to_be_bytes());
        let id = self.mw(0);
        if (0x181..=0x1FF).contains(&id) {
            let at = 16 * usize::from(id - 0x181);
            self.db92[at..at + 2].copy_from_slice(&self.mb[..2]);
            self.db92[at + 4..at + 16].copy_from_slice(&self.mb[4..16]);
        }
        if self.block.TRANSFER_READY {
            self.orders += 1;
        }
        self.pulse = !self.block.TRANSFER_READY;
    }
}

/// Manual p. 77-80: the example starts the network, sets a SYNC time of 512 ms and enables identifiers. It
/// then continues with a command that is not an order, and stores received frames in DB92. So READ_ENABLE
/// must read frames without an order.
#[test]
fn the_printed_example_of_fb4_receives() {
    let mut plc = Plc::new(0x84, &WINDOWS, 16);
    let mut example = Example::new();
    plc.run(200, |_, peripherals| example.call(peripherals));
    assert!(plc.bench.heard().contains(&"0: 01 00".to_owned()));
    assert_eq!(plc.bench.registers.stored.stored_sync_time.load(), 512);
    for (number, id) in (0_u8..).zip([0x181, 0x18A, 0x183, 0x184, 0x187, 0x188, 0x182, 0x181]) {
        plc.bench.send(data(id, &[number, 0x55]));
    }
    plc.run(200, |_, peripherals| example.call(peripherals));
    let entry = |id: usize| &example.db92[16 * (id - 0x181)..][..13];
    for (number, id) in [(7, 0x181), (1, 0x18A), (2, 0x183), (3, 0x184), (4, 0x187), (5, 0x188)] {
        let [_, low] = u16::to_be_bytes(id);
        let expected = [1, low, 0, 0, number, 0x55, 0, 0, 0, 0, 0, 0, 2];
        assert_eq!(entry(id.into()), expected, "16#{id:X}");
    }
    assert_eq!(entry(0x182), [0; 13], "it is not enabled");
}

/// Returns an entry of a list (p. 84-85).
fn entry(index: u16, sub: u8, ccs: u8, length: u8, data: [u8; 4]) -> Vec<u8> {
    [&index.to_be_bytes()[..], &[sub, ccs, length], &data, &[0]].concat()
}

/// Returns lists as in DB99. One entry reads, the others write words and a byte, high byte first.
fn list() -> Vec<u8> {
    let mut list = [
        entry(0x1000, 0, 2, 0, [0; 4]),
        entry(0x6040, 0, 1, 2, [0, 6, 0, 0]),
        entry(0x6060, 0, 1, 1, [6, 0, 0, 0]),
        entry(0x200B, 0, 1, 4, [1, 2, 3, 4]),
    ]
    .concat();
    list.extend([0xEE, 0xEE]);
    list
}

#[test]
fn fb1_initialises_a_device_by_a_list() {
    let mut plc = Plc::new(0x80, &WINDOWS, 16);
    plc.blocks.set(99, &[vec![0; 130], list()].concat());
    let mut block =
        FB1 { transfer: true, tx_id: 0x605, rx_id: 0x585, init_db: 99, offset: 130, ..Default::default() };
    for _ in 0..600 {
        plc.cycle(|blocks, peripherals| block.call(blocks, peripherals));
        if block.ret_value != initialisation::RUNS {
            break;
        }
    }
    assert_eq!(block.ret_value, initialisation::DONE);
    // The list contains the value that was read, high byte first.
    assert_eq!(plc.blocks.get(99).unwrap()[130..140], [0x10, 0, 0, 2, 2, 0x01, 0x92, 0, 0, 0]);
    plc.run(10, |blocks, peripherals| block.call(blocks, peripherals));
    assert_eq!(block.ret_value, initialisation::DONE);
    block.transfer = false;
    plc.run(1, |blocks, peripherals| block.call(blocks, peripherals));
    assert_eq!(block.ret_value, initialisation::OFF);
}

#[test]
fn fb1_reports_the_refused_entry() {
    let mut plc = Plc::new(0x80, &WINDOWS, 16);
    plc.refuses = 0x6060;
    plc.blocks.set(99, &list());
    for (init_db, expected) in [(99, initialisation::REFUSED | 2), (98, initialisation::NO_LIST)] {
        let mut block = FB1 { transfer: true, tx_id: 0x605, rx_id: 0x585, init_db, ..Default::default() };
        plc.run(400, |blocks, peripherals| block.call(blocks, peripherals));
        assert_eq!(block.ret_value, expected);
    }
}

/// Format of an SDO on CAN: number and length first, then the data, low byte first (CiA 301).
#[test]
fn fb1_sends_sdos() {
    let mut plc = Plc::new(0x80, &WINDOWS, 16);
    plc.blocks.set(99, &entry(0x6040, 1, 1, 2, [0x12, 0x34, 0, 0]));
    let mut block = FB1 { transfer: true, tx_id: 0x680, rx_id: 0x585, init_db: 99, ..Default::default() };
    plc.run(100, |blocks, peripherals| block.call(blocks, peripherals));
    assert_eq!(plc.bench.heard(), ["680: 2B 40 60 01 34 12 00 00"]);
}

/// The example of p. 82: five motors. A page of 16 octets has no room for all of them, so FB2 uses several
/// pages.
fn data_blocks_of_the_manual(blocks: &mut DataBlocks) {
    let config = |ids: [u16; 5]| {
        let records = ids.into_iter().flat_map(|id| [0, 0, (id >> 8) as u8, id as u8, 0xB8, 6]);
        records.chain([0xEE; 4]).collect::<Vec<u8>>()
    };
    blocks.set(94, &config([0x301, 0x303, 0x304, 0x307, 0x308]));
    blocks.set(95, &config([0x281, 0x283, 0x284, 0x287, 0x288]));
    let data = |forces: [u8; 5]| {
        let cells = forces.into_iter().flat_map(|force| [7, force, 0, 0, 0, 0, 0, 0]);
        cells.chain([0xEE]).collect::<Vec<u8>>()
    };
    blocks.set(96, &data([2, 1, 4, 0, 3]));
    blocks.set(97, &data([0; 5]));
}

#[test]
fn fb2_configures_and_exchanges_pages() {
    let mut plc = Plc::new(0x01, &[0x80, 0x9F, 0x40, 0x9F], 32);
    data_blocks_of_the_manual(&mut plc.blocks);
    let mut block =
        FB2 { WRITE_CONFIG_DB: 94, WRITE_DB: 96, READ_CONFIG_DB: 95, READ_DB: 97, ..Default::default() };
    plc.run(60, |blocks, peripherals| block.call(blocks, peripherals));
    assert_eq!((block.RET_VALUE, block.ERROR, plc.bench.registers.can.page_state.load()), (0, 0, 2));
    block.FREIGABE = true;
    let mut results = Vec::new();
    plc.run(150, |blocks, peripherals| {
        block.call(blocks, peripherals);
        if results.last() != Some(&block.RET_VALUE) {
            results.push(block.RET_VALUE);
        }
    });
    assert_eq!((results, block.ERROR), (vec![2, 3, 4], 0));
    // Force 1 is sent with each page. Force 3 and 4 are sent once. Force 0 and unchanged data are never sent.
    let heard = plc.bench.heard();
    let count = |id: &str| heard.iter().filter(|frame| frame.starts_with(id)).count();
    assert_eq!((count("301:"), count("304:"), count("307:"), count("308:")), (0, 1, 0, 1));
    assert!(count("303:") > 1);
    // Outputs of a motor: a word and a double word, which CAN carries low byte first.
    let mut outputs = plc.blocks.get(96).unwrap().to_vec();
    outputs[2..8].copy_from_slice(&[0x12, 0x34, 0xAA, 0xBB, 0xCC, 0xDD]);
    plc.blocks.set(96, &outputs);
    plc.bench.send(data(0x284, &[2, 1, 6, 5, 4, 3]));
    plc.run(150, |blocks, peripherals| block.call(blocks, peripherals));
    assert!(plc.bench.heard().contains(&"301: 34 12 DD CC BB AA".to_owned()));
    assert_eq!(plc.blocks.get(97).unwrap()[16..24], [7, 1, 1, 2, 3, 4, 5, 6]);
}

/// Configurations and data continue in the next data block (p. 63-69). The lengths are those of the examples
/// on these pages.
#[test]
fn fb2_continues_in_the_next_data_block() {
    let mut plc = Plc::new(0x01, &[0x80, 0x9F, 0x40, 0x9F], 32);
    let records = |first: u8, count: u8, mark: u8| {
        let records = (first..first + count).flat_map(|id| [0, 0, 1, id, 0, 1]);
        records.chain([mark; 4]).collect::<Vec<u8>>()
    };
    let lengths: Vec<usize> = [(0, 10, 0xDD), (10, 6, 0xEE)].map(|(a, b, c)| records(a, b, c).len()).into();
    assert_eq!((lengths, records(0, 127, 0xEE).len()), (vec![64, 40], 0x2FE));
    plc.blocks.set(11, &records(0, 10, 0xDD));
    plc.blocks.set(12, &records(10, 6, 0xEE));
    plc.blocks.set(26, &records(0x80, 10, 0xDD));
    plc.blocks.set(27, &records(0x8A, 9, 0xEE));
    assert_eq!(plc.blocks.get(27).map(<[u8]>::len), Some(58));
    let cells = |count: usize, force: u8, mark: u8| [[2, force, 0x77].repeat(count), vec![mark]].concat();
    plc.blocks.set(30, &cells(10, 0, 0xDD));
    plc.blocks.set(31, &cells(6, 3, 0xEE));
    plc.blocks.set(40, &cells(10, 0, 0xDD));
    plc.blocks.set(41, &cells(9, 0, 0xEE));
    let mut block =
        FB2 { WRITE_CONFIG_DB: 11, WRITE_DB: 30, READ_CONFIG_DB: 26, READ_DB: 40, ..Default::default() };
    plc.run(60, |blocks, peripherals| block.call(blocks, peripherals));
    block.FREIGABE = true;
    plc.run(400, |blocks, peripherals| block.call(blocks, peripherals));
    assert_eq!((block.RET_VALUE, block.ERROR), (4, 0));
    let heard = plc.bench.heard();
    assert_eq!(heard, (0x10A..0x110).map(|id| format!("{id:X}: 77")).collect::<Vec<_>>());
    plc.bench.send(data(0x192, &[9]));
    plc.run(150, |blocks, peripherals| block.call(blocks, peripherals));
    assert_eq!(plc.blocks.get(41).unwrap()[24..28], [2, 1, 9, 0xEE]);
}

#[test]
fn fb2_reports_the_reason_of_a_stop() {
    let mut plc = Plc::new(0x01, &[0x80, 0x9F, 0x40, 0x9F], 32);
    data_blocks_of_the_manual(&mut plc.blocks);
    let block = |config| FB2 {
        WRITE_CONFIG_DB: config,
        WRITE_DB: 96,
        READ_CONFIG_DB: 95,
        READ_DB: 97,
        ..Default::default()
    };
    // Four wrong inputs: a missing data block; an identifier that is sent and received; an invalid length;
    // the page of another program.
    plc.blocks.set(50, &[0, 0, 2, 0x81, 0, 1, 0xEE, 0xEE, 0xEE, 0xEE]);
    plc.blocks.set(51, &[0, 0, 2, 0x81, 0, 9, 0xEE, 0xEE, 0xEE, 0xEE]);
    for (config, error) in [(49, 16), (50, 2), (51, 3)] {
        let mut it = block(config);
        plc.run(60, |blocks, peripherals| it.call(blocks, peripherals));
        it.FREIGABE = true;
        plc.run(100, |blocks, peripherals| it.call(blocks, peripherals));
        assert_eq!((it.RET_VALUE, it.ERROR), (0, error), "configuration {config}");
    }
    let mut nowhere = FB2 { READ_ADDRESS: 240, ..block(94) };
    plc.run(1, |blocks, peripherals| nowhere.call(blocks, peripherals));
    assert_eq!(nowhere.ERROR, 17);
}

/// The example of p. 81-86: motors 1, 3, 4, 7 and 8 exist, and motors 1, 4 and 8 have lists.
#[test]
fn fb3_runs_motors() {
    let cfg = [0x80, 0x9F, 0x40, 0x9F, 0x83, 0x8F, 0xFF, 0xEF, 0, 0x43, 0x8F, 0xFF, 0xEF, 0];
    let mut plc = Plc::new(0x81, &cfg, 48);
    data_blocks_of_the_manual(&mut plc.blocks);
    let words = |words: &[u16]| words.iter().flat_map(|word| word.to_be_bytes()).collect::<Vec<u8>>();
    plc.blocks.set(93, &words(&[94, 0x2FE, 0, 95, 0x2FE, 0, 96, 0x3F9, 0, 97, 0x3F9, 0, 0, 0, 32, 32, 98]));
    let mut motors = [0; 4 * 127];
    for (motor, list) in [(1, 99), (3, 0xFFFF), (4, 99), (7, 0xFFFF), (8, 99)] {
        motors[4 * (motor - 1)] = list;
    }
    plc.blocks.set(98, &words(&motors));
    plc.blocks.set(99, &list());
    plc.blocks.set(100, &[0; 16 * 127]);
    let mut block = FB3 { FREIGABE: true, KONFIG_DB: 93, DATEN_DB: 100, ..Default::default() };
    let mut results = Vec::new();
    plc.run(1500, |blocks, peripherals| {
        block.call(blocks, peripherals);
        if results.last() != Some(&block.RET_VALUE) {
            results.push(block.RET_VALUE);
        }
    });
    assert_eq!((results, block.ERROR), (vec![1, 2, 3, 4], 0));
    // The lists of motors 1, 4 and 8 are finished.
    let status = |motor: usize| plc.blocks.get(98).unwrap()[8 * (motor - 1) + 4..][..2].to_vec();
    assert_eq!([1, 3, 4, 8].map(status), [[0, 1], [0, 0], [0, 1], [0, 1]]);
    plc.bench.heard();
    // Motor 3 is always sent, with control word and target position. Motor 8 has sent a state and a position.
    let mut data_block = plc.blocks.get(100).unwrap().to_vec();
    data_block[32..40].copy_from_slice(&[3, 0, 0x00, 0x0F, 0x12, 0x34, 0x56, 0x78]);
    plc.blocks.set(100, &data_block);
    plc.bench.send(data(0x288, &[0x27, 0, 4, 3, 2, 1]));
    plc.run(150, |blocks, peripherals| block.call(blocks, peripherals));
    assert_eq!(plc.bench.heard(), ["303: 0F 00 78 56 34 12"]);
    assert_eq!(plc.blocks.get(100).unwrap()[7 * 16 + 8..8 * 16], [1, 0, 0, 0x27, 1, 2, 3, 4]);
}
