//! The function blocks of two CS0015 at a CAN bus: the test is the program of the first CS0015.

use commram::devices::cs0015::blocks::*;
use commram::devices::cs0015::registers::{CS0015_FLAGS, CS0015_TX_PDO, FLAGS, TX_PDO};
use commram::identity::DeviceIndex;
use commram::memory::{MemoryError, Segment};
use commram::plant::{Plant, PlantConfig, Power};
use commram::plc::Direction;
use std::error::Error;
use std::time::Duration;

const PLANT: &str = "
[[device]]
kind = 'cs0015'
name = 'master'
bus = 'open'
node_id = 1
program = 'attached'
cycle_us = 5000

[[device]]
kind = 'cs0015'
name = 'slave'
bus = 'open'
node_id = 5

[[bus]]
name = 'open'
kind = 'can'
kbit_s = 125
";

const MS: u64 = 1000;

struct Bench {
    plant: Plant,
    /// The job blocks of the master and of the slave.
    jobs: [Jobs; 2],
}

impl Bench {
    /// Returns a bench on which both devices have run their first cycles, with `CAN_OPEN` set.
    fn new() -> Result<Self, Box<dyn Error>> {
        let config = PlantConfig::parse("two.toml", PLANT)?;
        let mut plant = Plant::new(&config, |_, device| Ok::<_, Box<dyn Error>>(Segment::of(device)))?;
        let jobs = |device: usize| Jobs::of(&Ram::of(plant.devices()[device].segment())?);
        let jobs = [jobs(0)?, jobs(1)?];
        plant.advance_to(250 * MS);
        let bench = Bench { plant, jobs };
        bench.flags(0)?.CAN_OPEN.store(1);
        Ok(bench)
    }

    /// Returns a bench on which the master guards the slave as a node.
    fn master() -> Result<Self, Box<dyn Error>> {
        let mut bench = Bench::new()?;
        once(&mut bench, 0, NMM_SET_NMT_MASTER::default());
        let node = NMM_ADD_NODE { NODE: 5, GUARDTIME: ms(100), LIFETIME: 2, ..Default::default() };
        assert_eq!(once(&mut bench, 0, node).RESULT, 0);
        assert_eq!(once(&mut bench, 0, NMM_START_GUARDING { NODE: 5, ..Default::default() }).RESULT, 0);
        Ok(bench)
    }

    fn flags(&self, device: usize) -> Result<commram::memory::View<CS0015_FLAGS>, MemoryError> {
        self.plant.devices()[device].segment().view(FLAGS)
    }

    /// Runs one cycle of the programs.
    fn step(&mut self) {
        self.plant.advance_to(self.plant.now() + 5 * MS);
    }

    /// Guards the nodes for `cycles` cycles; returns the result of the last call.
    fn guard(&mut self, cycles: u32) -> u8 {
        let mut guarding = NMM_NODE_GUARDING { ENABLE: true, AUTO_RESTART: true, ..Default::default() };
        for _ in 0..cycles {
            guarding.call(&self.jobs[0]);
            self.step();
        }
        guarding.ENABLE = false;
        guarding.call(&self.jobs[0]);
        assert!(guarding.ANSWERED);
        guarding.RESULT
    }

    fn state(&mut self) -> u8 {
        once(self, 0, NMM_GET_NODE_STATE { NODE: 5, ..Default::default() }).STATE
    }

    /// Calls an SDO block until it is no longer active.
    fn sdo(&mut self, mut call: impl FnMut(&Jobs) -> u8) -> u8 {
        assert_eq!(call(&self.jobs[0]), 2, "it has begun");
        for _ in 0..200 {
            self.step();
            let result = call(&self.jobs[0]);
            if result != 2 {
                return result;
            }
        }
        panic!("it does not end");
    }
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// A block that gives orders.
trait Ordering {
    fn enable(&mut self, enable: bool);
    fn cycle(&mut self, jobs: &Jobs) -> bool;
}

macro_rules! ordering {
    ($($block:ident)*) => {$(
        impl Ordering for $block {
            fn enable(&mut self, enable: bool) {
                self.ENABLE = enable;
            }

            fn cycle(&mut self, jobs: &Jobs) -> bool {
                self.call(jobs);
                self.ANSWERED
            }
        }
    )*};
}

ordering! {
    CAN_BAUDRATE CAN_TRANSMIT NMS_SET_NODEID NMS_GUARDING_CONFIG PDO_TX_CONFIG PDO_RX_CONFIG PDO_TX_REFRESH NMM_SET_NMT_MASTER
    NMM_ADD_NODE NMM_START_GUARDING NMM_STOP_GUARDING NMM_SET_PREOPERATIONAL NMM_SET_OPERATIONAL NMM_SET_PREPARED
    NMM_GET_NODE_STATE NMM_RESET_NODE NMM_RESET_COMM PDO_INI_SEND_SYNC_OBJ PDO_SEND_SYNC_OBJ EMC_GET_EMERGENCY
}

/// Gives one order at a device, and fetches the answer in the next cycle.
#[track_caller]
fn once<B: Ordering>(bench: &mut Bench, device: usize, mut block: B) -> B {
    block.enable(true);
    assert!(!block.cycle(&bench.jobs[device]));
    block.enable(false);
    bench.step();
    assert!(block.cycle(&bench.jobs[device]), "it is answered");
    block
}

/// Manual p. 52-65.
#[test]
fn a_master_starts_its_slave_and_has_it_back_after_a_failure() -> Result<(), Box<dyn Error>> {
    let mut bench = Bench::master()?;
    assert_eq!((bench.guard(3), bench.state()), (0, 127));
    assert_eq!(once(&mut bench, 0, NMM_SET_OPERATIONAL::default()).RESULT, 0);
    assert_eq!((bench.guard(25), bench.state()), (0, 5));
    assert_eq!(once(&mut bench, 0, NMM_SET_PREPARED { NODE: 5, ..Default::default() }).RESULT, 0);
    assert_eq!((bench.guard(25), bench.state()), (0, 4));
    assert_eq!(once(&mut bench, 0, NMM_SET_PREOPERATIONAL { NODE: 5, ..Default::default() }).RESULT, 0);
    assert_eq!((bench.guard(25), bench.state()), (0, 127));
    let flags = bench.flags(1)?;
    assert_eq!(once(&mut bench, 0, NMM_RESET_COMM { NODE: 5, ..Default::default() }).RESULT, 0);
    assert_eq!(once(&mut bench, 0, NMM_RESET_NODE { NODE: 5, ..Default::default() }).RESULT, 0);
    bench.step();
    assert_eq!([&flags.COP_EVENT_RESETCOM, &flags.COP_EVENT_RESETNODE].map(|flag| flag.load()), [1, 1]);
    assert_eq!(bench.guard(25), 0);
    bench.plant.set_power(DeviceIndex(1), Power::Off);
    assert_eq!(bench.guard(100), 5, "missing");
    assert_eq!(bench.flags(0)?.COP_GUARDFAIL_NODEID.load(), 5);
    bench.plant.set_power(DeviceIndex(1), Power::On);
    assert_eq!((bench.guard(100), bench.state()), (0, 5), "AUTO_RESTART");
    assert_eq!(once(&mut bench, 0, NMM_STOP_GUARDING { NODE: 5, ..Default::default() }).RESULT, 0);
    assert_eq!(once(&mut bench, 0, NMM_STOP_GUARDING { NODE: 6, ..Default::default() }).RESULT, 2);
    Ok(())
}

/// Manual p. 66-70.
#[test]
fn a_master_reads_and_writes_entries_synchronizes_and_hears_of_errors() -> Result<(), Box<dyn Error>> {
    let mut bench = Bench::master()?;
    let mut read = SDO_READ { ENABLE: true, NODE: 5, IDX: 0x1000, LENGTH: 4, ..Default::default() };
    let call = |read: &mut SDO_READ, jobs: &Jobs| {
        read.call(jobs);
        read.RESULT
    };
    assert_eq!(bench.sdo(|jobs| call(&mut read, jobs)), 1);
    assert_eq!(read.DATA[..5], [0x95, 1, 0, 0, 0]);
    bench.step();
    assert_eq!(call(&mut read, &bench.jobs[0]), 1, "until ENABLE is taken away");
    read.ENABLE = false;
    assert_eq!(call(&mut read, &bench.jobs[0]), 0);
    let mut absent = SDO_READ { ENABLE: true, NODE: 5, IDX: 0x1002, LENGTH: 4, ..Default::default() };
    assert_eq!(bench.sdo(|jobs| call(&mut absent, jobs)), 0);
    assert_eq!(absent.ABORT, 0x0602_0000);
    let mut write = SDO_WRITE { ENABLE: true, NODE: 5, IDX: 0x2000, LENGTH: 256, ..Default::default() };
    write.DATA.iter_mut().enumerate().for_each(|(index, byte)| *byte = index as u8);
    assert_eq!(
        bench.sdo(|jobs| {
            write.call(jobs);
            write.RESULT
        }),
        1
    );
    let mut block = SDO_READ { ENABLE: true, NODE: 5, IDX: 0x2000, LENGTH: 256, ..Default::default() };
    assert_eq!(bench.sdo(|jobs| call(&mut block, jobs)), 1);
    assert_eq!((block.DATA, block.ABORT), (write.DATA, 0));
    let mut with_sync =
        SDO_WRITE { ENABLE: true, NODE: 5, IDX: 0x1801, SUBIDX: 2, LENGTH: 1, ..Default::default() };
    with_sync.DATA[0] = 1;
    assert_eq!(
        bench.sdo(|jobs| {
            with_sync.call(jobs);
            with_sync.RESULT
        }),
        1
    );

    let mut receive = CAN_RECEIVE { CONFIG: true, ID: 0x285, ..Default::default() };
    receive.call(&bench.jobs[0]);
    receive.CONFIG = false;
    once(&mut bench, 0, NMM_SET_OPERATIONAL::default());
    once(&mut bench, 0, PDO_INI_SEND_SYNC_OBJ::default());
    assert!(once(&mut bench, 0, PDO_SEND_SYNC_OBJ::default()).RESULT);
    bench.step();
    receive.call(&bench.jobs[0]);
    assert_eq!((receive.ANSWERED, receive.AVAILABLE), (true, 0), "when it was made known");
    bench.step();
    receive.call(&bench.jobs[0]);
    assert_eq!((receive.AVAILABLE, receive.DLC, receive.OVERFLOW), (1, 8, false));

    assert!(!once(&mut bench, 0, EMC_GET_EMERGENCY::default()).RECEIVED);
    bench.flags(1)?.ERROR.store(1);
    bench.step();
    let emergency = once(&mut bench, 0, EMC_GET_EMERGENCY::default());
    assert!(emergency.RECEIVED);
    assert_eq!((emergency.NODE, emergency.VALUE, emergency.REGISTER, emergency.DATA), (5, 0x1000, 1, [0; 5]));
    Ok(())
}

/// Manual p. 31-51.
#[test]
fn a_slave_says_how_it_communicates() -> Result<(), Box<dyn Error>> {
    let mut bench = Bench::new()?;
    let flags = bench.flags(1)?;
    let tx = bench.plant.devices()[1].segment().view::<CS0015_TX_PDO>(TX_PDO)?;
    let mut receive = CAN_RECEIVE { CONFIG: true, ID: 0x390, ..Default::default() };
    receive.call(&bench.jobs[0]);
    receive.CONFIG = false;
    once(&mut bench, 1, NMS_SET_NODEID { NODEID: 6, ..Default::default() });
    assert_eq!(flags.NODEID.load(), 6);
    once(&mut bench, 1, NMS_GUARDING_CONFIG { CYCLEPERIOD: ms(20), ..Default::default() });
    once(&mut bench, 1, PDO_TX_CONFIG { PDO: 3, ID: 0x390, TRANS_TYPE: 255, ..Default::default() });
    once(&mut bench, 1, PDO_RX_CONFIG { PDO: 3, ID: 0x3A0, TRANS_TYPE: 255, ..Default::default() });
    once(&mut bench, 0, NMM_SET_NMT_MASTER::default());
    once(&mut bench, 0, NMM_SET_OPERATIONAL::default());
    tx.a_TX_PDO[2][0].store(0x1234);
    bench.plant.advance_to(bench.plant.now() + 30 * MS);
    assert_eq!(flags.COP_SYNCFAIL_ERROR.load(), 1, "no station sends SYNC");
    once(&mut bench, 1, PDO_TX_REFRESH { PDO: 3, ..Default::default() });
    let mut found = Vec::new();
    for _ in 0..4 {
        receive.call(&bench.jobs[0]);
        if receive.AVAILABLE > 0 {
            found.push((receive.AVAILABLE, receive.DATA));
        }
        bench.step();
    }
    let data = [0x34, 0x12, 0, 0, 0, 0, 0, 0];
    assert_eq!(found, [(2, data), (1, data)], "once when it changed, once more because it was asked for");
    let message = CAN_TRANSMIT { ID: 0x3A0, DLC: 2, DATA: [7, 8, 0, 0, 0, 0, 0, 0], ..Default::default() };
    assert!(once(&mut bench, 0, message).RESULT);
    let word = commram::layout::Width::Word;
    assert_eq!(bench.plant.devices()[1].segment().load(8192 + 2 * 2008, word)?, 0x0807);
    once(&mut bench, 1, CAN_BAUDRATE { BAUDRATE: 250, ..Default::default() });
    assert_eq!(flags.CANBAUDRATE.load(), 250);
    Ok(())
}

/// An answer that the program does not fetch does not block later orders. A program can withdraw an order in progress.
#[test]
fn places_of_the_job_block_are_used_again() -> Result<(), Box<dyn Error>> {
    let mut bench = Bench::master()?;
    for NODEID in 1..=20 {
        NMS_SET_NODEID { ENABLE: true, NODEID, ..Default::default() }.call(&bench.jobs[1]);
        bench.step();
        assert_eq!(bench.flags(1)?.NODEID.load(), NODEID);
    }
    // No node has the number 5 now.
    let mut read = SDO_READ { ENABLE: true, NODE: 5, IDX: 0x1000, LENGTH: 4, ..Default::default() };
    for _ in 0..3 {
        read.call(&bench.jobs[0]);
        bench.step();
        assert_eq!(read.RESULT, 2);
    }
    read.ENABLE = false;
    read.call(&bench.jobs[0]);
    assert_eq!(read.RESULT, 0);
    bench.step();
    let mut other = Order::default();
    assert_eq!(other.look(&bench.jobs[0]), Progress::Nothing);
    assert!(other.give(&bench.jobs[0], 0xFFFF, &[], &[]));
    assert_eq!(other.look(&bench.jobs[0]), Progress::UnderWay);
    bench.step();
    assert!(matches!(other.look(&bench.jobs[0]), Progress::Answered(Answer { is_refused: true, .. })));
    assert_eq!(other.look(&bench.jobs[0]), Progress::Nothing);
    Ok(())
}

/// The layout lists for each function the pins of its block: inputs without ENABLE, outputs without the emulator's additions.
#[test]
fn the_table_of_functions_and_the_blocks_agree() {
    let device = commram::devices::find("cs0015").unwrap();
    let function = device.layout.register("jobs.a_FUNCTION[0]").unwrap().register.meaning.unwrap();
    // Numbers of the functions in chapter 5. The high byte is the part of the manual.
    let documented = |name: &str| {
        let of_chapter = function.values.iter().filter(|value| (1..=3).contains(&(value.first >> 8)));
        of_chapter.map(|value| value.text).find(|text| text.split(" (").next() == Some(name))
    };
    let mut count = 0;
    for block in BLOCKS {
        let Some(pins) = documented(block.name) else { continue };
        let names = |direction: Direction| {
            let pins = block.pins.iter().filter(move |pin| pin.direction == direction).map(|pin| pin.name);
            pins.filter(|pin| !["ENABLE", "ANSWERED"].contains(pin)).collect::<Vec<_>>().join(", ")
        };
        let (inputs, mut outputs) = (names(Direction::In), names(Direction::Out));
        if block.name == "SDO_READ" {
            outputs = "RESULT, ABORT, DATA".to_owned();
        }
        let outputs = if outputs.is_empty() { String::new() } else { format!(": {outputs}") };
        let text = format!("{} ({inputs}){outputs}, p. ", block.name);
        assert!(pins.starts_with(&text), "{text}{pins}");
        count += 1;
    }
    assert_eq!(count, 26);
}
