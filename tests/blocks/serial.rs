//! `SERIAL_3964R` at two ports on a line with four wires: blocks in both directions, faults, and errors.

use crate::rig::plant_of;
use commram::devices::omega_drive_line_2::blocks::{Base, Ram, SERIAL_3964R, SERIAL_BMARRAY, SERIAL_OCTETS};
use commram::devices::omega_drive_line_2::registers::values::{
    serial_control, serial_parity, serial_transmitted,
};
use commram::devices::omega_drive_line_2::registers::{SERIAL, SERIAL_BMSTRUCT};
use commram::plant::Plant;

const PLANT: &str = "\
[[plc]]
name = 'a'
serial = 'rs485'
[[plc]]
name = 'b'
serial = 'rs485'
[[bus]]
name = 'rs485'
kind = 'serial'
wires = 4
baud_rate = 38400
terminators = 2
";

/// A PLC with the block.
struct Plc {
    base: Base<SERIAL_BMSTRUCT>,
    block: SERIAL_3964R,
    send: Box<SERIAL_BMARRAY>,
    received: Box<SERIAL_BMARRAY>,
}

impl Plc {
    fn of(plant: &Plant, device: usize) -> Self {
        let base = Ram::of(plant.devices()[device].segment()).unwrap().at::<SERIAL_BMSTRUCT>(SERIAL).unwrap();
        base.u_BAUD_RATE.store(38_400);
        base.us_DATA_BITS.store(8);
        base.b_PARITY.store(serial_parity::EVEN);
        base.us_STOP_BITS.store(1);
        base.us_WIRES.store(4);
        base.w_CONTROL.store(serial_control::ON);
        let block = SERIAL_3964R { x_EN: true, x_HIGH: device == 0, ..Default::default() };
        Plc { base, block, send: Box::new([0; SERIAL_OCTETS]), received: Box::new([0; SERIAL_OCTETS]) }
    }

    fn call(&mut self) {
        self.block.call(&self.base, &self.send, &mut self.received);
    }

    /// Requests the transmission of a block with the next call.
    fn start(&mut self, octets: &[u8]) {
        self.send[..octets.len()].copy_from_slice(octets);
        (self.block.u_SEND, self.block.x_SEND) = (octets.len() as u16, true);
    }

    /// Takes the received block.
    fn take(&mut self) -> Option<Vec<u8>> {
        self.block.x_TAKEN = self.block.x_RECEIVED;
        self.block.x_RECEIVED.then(|| self.received[..usize::from(self.block.u_RECEIVED)].to_vec())
    }
}

/// Two PLCs with ports that are switched on.
struct Bench {
    plant: Plant,
    plcs: [Plc; 2],
    now: u64,
}

impl Bench {
    fn new() -> Self {
        let plant = plant_of(PLANT);
        let plcs = [0, 1].map(|device| Plc::of(&plant, device));
        let mut bench = Bench { plant, plcs, now: 0 };
        bench.run(2);
        bench
    }

    /// Runs an event task of 1 ms at both PLCs.
    fn run(&mut self, calls: u64) {
        for _ in 0..calls {
            self.now += 1_000;
            self.plant.advance_to(self.now);
            self.plcs.iter_mut().for_each(Plc::call);
        }
    }

    /// Runs until the condition is true, at most a minute.
    fn run_until(&mut self, mut condition: impl FnMut(&mut [Plc; 2]) -> bool) {
        for _ in 0..60_000 {
            if condition(&mut self.plcs) {
                return;
            }
            self.run(1);
        }
        panic!("{:?} {:?}", self.plcs[0].block, self.plcs[1].block);
    }
}

/// All octets, also the control characters, in both directions at the same time: the low priority gives way.
#[test]
fn two_ports_exchange_blocks() {
    let mut bench = Bench::new();
    let octets: Vec<u8> = (0..=255).collect();
    let reversed: Vec<u8> = octets.iter().rev().copied().chain([0x10; 300]).collect();
    bench.plcs[0].start(&octets);
    bench.plcs[1].start(&reversed);
    let mut received = [Vec::new(), Vec::new()];
    bench.run_until(|plcs| {
        plcs.iter_mut().zip(&mut received).for_each(|(plc, list)| list.extend(plc.take()));
        plcs.iter().all(|plc| plc.block.x_SENT)
    });
    assert_eq!(received, [vec![reversed], vec![octets]]);
    for plc in &bench.plcs {
        assert_eq!((plc.block.b_ERR_SEND, plc.block.b_ERR_RECEIVE, plc.block.x_BUSY), (0, 0, false));
    }
    // 256 octets, one of them doubled, with all characters of the procedure take 75 ms; 556 octets take 250 ms.
    assert!((300_000..500_000).contains(&bench.now), "{}", bench.now);
}

/// A character from the partner during the block: the sender ends the block and repeats it.
#[test]
fn a_disturbed_block_is_repeated() {
    let mut bench = Bench::new();
    bench.plcs[0].start(&[0x41; 20]);
    bench.run(4);
    let head = bench.plcs[1].base.u_TX_HEAD.load();
    bench.plcs[1].base.a_TX[usize::from(head % 256)].store(0x55);
    bench.plcs[1].base.u_TX_HEAD.store(head.wrapping_add(1));
    bench.run_until(|plcs| plcs[0].block.x_SENT);
    assert_eq!(bench.plcs[1].take(), Some(vec![0x41; 20]));
    assert!(bench.now > 220_000, "the sender waits for a silent line");
}

/// The procedure 3964: the same blocks without a check sum, which takes one character less for each block.
#[test]
fn two_ports_exchange_blocks_without_check_sum() {
    let mut bench = Bench::new();
    bench.plcs.iter_mut().for_each(|plc| (plc.block.x_EN, plc.block.x_BCC) = (false, false));
    bench.run(1);
    bench.plcs.iter_mut().for_each(|plc| plc.block.x_EN = true);
    bench.run(1);
    // A change after the rising edge of `x_EN` has no effect.
    bench.plcs.iter_mut().for_each(|plc| plc.block.x_BCC = true);
    let octets: Vec<u8> = (0..=255).collect();
    bench.plcs[0].start(&octets);
    bench.run_until(|plcs| plcs[0].block.x_SENT);
    assert_eq!(bench.plcs[1].take(), Some(octets));
    bench.plcs[1].start(&[0x10, 0x03]);
    bench.run_until(|plcs| plcs[1].block.x_SENT);
    assert_eq!(bench.plcs[0].take(), Some(vec![0x10, 0x03]));
    // STX, the octets with a doubled 16#10, DLE, ETX; and two times DLE for the block of the partner.
    let sent = bench.plcs.each_ref().map(|plc| plc.base.u_TX_HEAD.load());
    assert_eq!(sent, [1 + 257 + 2 + 2, 1 + 3 + 2 + 2]);
    // Six acknowledgement delays of 550 ms.
    bench.plcs[1].block.x_EN = false;
    bench.plcs[0].block.x_SEND = false;
    bench.run(1);
    let begin = bench.now;
    bench.plcs[0].start(&[1]);
    bench.run(10);
    bench.run_until(|plcs| !plcs[0].block.x_BUSY);
    assert_eq!(bench.plcs[0].block.b_ERR_SEND, 1);
    assert!((3_300_000..3_400_000).contains(&(bench.now - begin)), "{}", bench.now - begin);
}

#[test]
fn errors_have_numbers() {
    let mut bench = Bench::new();
    for (length, error) in [(0, 8), (1025, 9)] {
        (bench.plcs[0].block.u_SEND, bench.plcs[0].block.x_SEND) = (length, true);
        bench.run(1);
        assert_eq!((bench.plcs[0].block.b_ERR_SEND, bench.plcs[0].block.x_BUSY), (error, false));
        bench.plcs[0].block.x_SEND = false;
        bench.run(1);
    }
    // The partner does not take part.
    bench.plcs[1].block.x_EN = false;
    bench.plcs[0].start(&[1]);
    bench.run(10);
    assert!(bench.plcs[0].block.x_BUSY);
    bench.run_until(|plcs| !plcs[0].block.x_BUSY);
    assert_eq!((bench.plcs[0].block.b_ERR_SEND, bench.plcs[0].block.x_SENT), (1, false));
    assert!((12_000_000..12_200_000).contains(&bench.now), "six acknowledgement delays: {}", bench.now);
    // A break ends a transmission.
    bench.plcs[1].block.x_EN = true;
    bench.plcs[0].block.x_SEND = false;
    bench.run(500);
    bench.plcs[0].start(&[1; 100]);
    bench.run(10);
    let head = bench.plcs[1].base.u_TX_HEAD.load();
    bench.plcs[1].base.a_TX[usize::from(head % 256)].store(serial_transmitted::BREAK);
    bench.plcs[1].base.u_TX_HEAD.store(head.wrapping_add(1));
    bench.run_until(|plcs| !plcs[0].block.x_BUSY);
    assert_eq!(bench.plcs[0].block.b_ERR_SEND, 3);
}

/// The partner gets a refusal while the program has not taken the last block.
#[test]
fn a_block_waits_until_the_last_one_was_taken() {
    let mut bench = Bench::new();
    bench.plcs[0].start(&[1]);
    bench.run_until(|plcs| plcs[0].block.x_SENT);
    bench.plcs[0].block.x_SEND = false;
    bench.run(1);
    bench.plcs[0].start(&[2]);
    bench.run(600);
    assert_eq!(bench.plcs[1].block.b_ERR_RECEIVE, 10);
    assert_eq!(bench.plcs[1].take(), Some(vec![1]));
    bench.run(1);
    bench.run_until(|plcs| plcs[0].block.x_SENT);
    assert_eq!(bench.plcs[1].take(), Some(vec![2]));
}
