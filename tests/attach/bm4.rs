//! Soft-PLCs of b maXX PLCs, each in a separate process: function blocks of this device, event 11, deadlines at 1
//! Mbit/s, a SYNC signal between slots, and programs that are killed and restarted.
#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

use crate::common::Emulator;
use commram::devices::bm4_o_can_06::blocks::*;
use commram::devices::bm4_o_can_06::registers::{
    CANsync_PLC_INIT_BMSTRUCT, CANsync_PLC_MA_BMSTRUCT, CANsync_PLC_SL_BMSTRUCT, LAYOUT_HASH, SLOTG, SLOTH,
    SLOTM,
};
use commram::memory::{AttachMode, Attached, Image, LockstepTask, MemoryError};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::num::NonZeroU32;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

const LONG: Duration = Duration::from_secs(60);
/// "SYNC signal 1 option module" (p. 25).
const SYNC: usize = 11;
/// Environment variable of a PLC process: `<PLC>:<instance>:<us>:<us>`. The numbers are the run times in microseconds
/// after which the program releases its first and its second frame. 0 and 0 mean real time without delay.
const ROLE: &str = "COMMRAM_TEST_BM4";
/// Text that a program prints when its task takes part.
const READY: &str = "ready";

/// `maxx` is slave 6 of `top` in slot H and master of a drive in slot G, with the SYNC signal of slot H.
const PLANT: &str = "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\nsync_source = 'H'\n\
    [[device.module]]\nslot = 'H'\nkind = 'can-05'\nbus = 'upper'\ndip = 6\nlock_time_us = 20000\n\
    [[device.module]]\nslot = 'G'\nkind = 'can-06'\nbus = 'fast'\nsync_in_from = 'H'\n\
    [[device]]\nkind = 'bm4-plc'\nname = 'top'\n\
    [[device.module]]\nslot = 'M'\nkind = 'can-06'\nbus = 'upper'\n\
    [[bus]]\nname = 'fast'\nkbit_s = 1000\n\
    [[bus.drive]]\nname = 'winder'\nslave_number = 3\nlock_time_us = 20000\ncard_function = 0\n\
    [[bus]]\nname = 'upper'\nkbit_s = 1000\n";

/// Mapping: value 0 as a doubleword in words 0 and 1 of frame 1.
const VALUES: [i8; 4] = [0, 0, -1, -1];
const HIGH: [bool; 4] = [false, true, false, false];
/// Mapping: value 4 as a doubleword in words 0 and 1 of frame 2.
const VALUES_2: [i8; 4] = [4, 4, -1, -1];

/// The modules of a program with their blocks.
struct Modules<'a> {
    image: &'a Attached,
    ram: Ram,
    master: Base<CANsync_PLC_MA_BMSTRUCT>,
    master_init: Base<CANsync_PLC_INIT_BMSTRUCT>,
    slave: Option<(Base<CANsync_PLC_SL_BMSTRUCT>, Base<CANsync_PLC_INIT_BMSTRUCT>)>,
    /// Number of the master's slave.
    below: u8,
}

impl<'a> Modules<'a> {
    fn of(plc: &str, image: &'a Attached) -> Self {
        let ram = Ram::of(image.segment()).unwrap();
        let (master, slave, below) = match plc {
            "top" => (SLOTM, None, 6),
            _ => (SLOTG, Some(SLOTH), 3),
        };
        Modules {
            image,
            master: ram.at(master).unwrap(),
            master_init: ram.at(master).unwrap(),
            slave: slave.map(|slot| (ram.at(slot).unwrap(), ram.at(slot).unwrap())),
            below,
            ram,
        }
    }

    /// Runs a cycle of the program after each advance of the emulated time, until `done`.
    fn until(&self, mut done: impl FnMut() -> bool) {
        while !done() {
            let seen = self.ram.now_us();
            let passed = || (self.ram.now_us() != seen).then_some(());
            self.image.wait_until("time to pass", LONG, |_| passed()).unwrap();
        }
    }

    fn init(&self, base: &Base<CANsync_PLC_INIT_BMSTRUCT>, mut init: CANsync_INIT) {
        (init.us_BAUDRATE, init.us_SYNC_INTERVAL) = (6, 1);
        self.until(|| {
            init.call(base);
            assert!(!init.x_ERR, "w_ERR 16#{:04X}", init.w_ERR);
            init.x_OK
        });
    }

    /// The blocks in the order of p. 25.
    fn bring_up(&self) {
        if let Some((regs, base)) = &self.slave {
            self.init(base, CANsync_INIT { x_SL: true, ..Default::default() });
            CANsync_PD_CFG_SL {
                a_WRC1: VALUES,
                a_HL_WRC1: HIGH,
                a_RDC1: VALUES,
                a_HL_RDC1: HIGH,
                a_RDC2: VALUES_2,
                a_HL_RDC2: HIGH,
                ..Default::default()
            }
            .call(regs);
        }
        let mut a_SL_TYP = [0; 32];
        a_SL_TYP[usize::from(self.below)] = 1;
        let x_SYNC_IN = self.slave.is_some();
        self.init(&self.master_init, CANsync_INIT { x_SYNC_IN, a_SL_TYP, ..Default::default() });
        CANsync_COMM_CONTROL_MA { x_EN_CTRL: true, x_EN_PAR: true, x_EN_UDL: true, ..Default::default() }
            .call(&self.master);
        CANsync_PD_CFG_MA { a_WRC1: VALUES, a_HL_WRC1: HIGH, ..Default::default() }.call(&self.master);
        CANsync_PD_CFG_READ_MA {
            si_SL_NR: self.below as i8,
            a_RDC1: VALUES,
            a_HL_RDC1: HIGH,
            a_RDC2: VALUES_2,
            a_HL_RDC2: HIGH,
        }
        .call(&self.master);
        let mut event = INTR_SET { i_EVENT: SYNC as i8, x_EN: true, ..Default::default() };
        let mut mode_ma = CANsync_MODE_MA { x_SYNC_MODE: true, ..Default::default() };
        let mut mode_sl = CANsync_MODE_SL { x_SYNC_MODE: true, ..Default::default() };
        self.until(|| {
            event.call(&self.ram);
            assert!(!event.x_ERR);
            if let Some((regs, _)) = &self.slave {
                // From the set-up of the mode on, the input must stay TRUE. Otherwise the slave would leave active
                // operation.
                mode_sl.x_CANsync_RUN |= mode_sl.x_PREPARE_ACTIV;
                mode_sl.call(regs);
            }
            mode_ma.call(&self.master);
            mode_ma.x_CANsync_RUN = self.master.a_STAT_SL[usize::from(self.below)].load() == 0x03;
            let slave_takes_part = self.slave.is_none() || mode_sl.x_CANsync_ACTIV;
            event.is_answered() && mode_ma.x_CANsync_ACTIV && slave_takes_part
        });
    }

    /// Runs the event task in lockstep until the emulator ends.
    fn run(&self, task: &mut LockstepTask, [first, second]: [u32; 2]) -> Result<(), MemoryError> {
        let mut exchange = Exchange::of(self);
        let us = |us: u32| NonZeroU32::new(us).unwrap();
        loop {
            task.next_event(LONG)?;
            // A release that was too late for the last interval would be valid in this one, so the program withdraws
            // it.
            self.master.b_CTRLREG_WRC1.store(0);
            if let Some((regs, _)) = &self.slave {
                regs.b_CTRLREG_RD_RDC1.store(0);
                regs.b_CTRLREG_RD_RDC2.store(0);
            }
            task.run_for(us(first), LONG)?;
            exchange.first();
            if self.slave.is_some() {
                task.run_for(us(second - first), LONG)?;
                exchange.second();
            }
        }
    }

    /// Runs the event task in real time, once per event, until the emulator ends.
    fn follow(&self) -> Result<(), MemoryError> {
        let mut exchange = Exchange::of(self);
        let mut seen = self.ram.header().events[SYNC].bell.rings();
        loop {
            seen = self.image.wait_event(SYNC, seen, LONG)?;
            exchange.first();
            exchange.second();
        }
    }
}

/// Work of the program in an interval: a counter value travels from `top` through `maxx` to the slave and back.
struct Exchange<'a> {
    modules: &'a Modules<'a>,
    master: CANsync_PD_COMM_MA,
    slave: CANsync_PD_COMM_SL,
    a_RD_ARRAY: [[i32; 16]; 32],
}

impl<'a> Exchange<'a> {
    fn of(modules: &'a Modules<'a>) -> Self {
        let below = modules.below as i8;
        let master = CANsync_PD_COMM_MA {
            si_WRC1_SEND: 5,
            si_WRC2_SEND: 5,
            si_RD_SL_NR1_RECEIVE: below,
            si_RD_SL_NR2_RECEIVE: below,
            ..Default::default()
        };
        Exchange { modules, master, slave: CANsync_PD_COMM_SL::default(), a_RD_ARRAY: [[0; 16]; 32] }
    }

    /// Releases the master's frames, and the slave's first frame.
    fn first(&mut self) {
        let Exchange { modules, master, slave, a_RD_ARRAY } = self;
        match &modules.slave {
            None => master.a_WR_VALUES_SEND[0] += 1,
            Some((regs, _)) => {
                (slave.si_RDC1_SEND, slave.si_RDC2_SEND) = (5, 0);
                slave.call(regs, a_RD_ARRAY);
                slave.a_RD_VALUES_SEND[0] = slave.a_WR_VALUES_RECEIVED[0];
                master.a_WR_VALUES_SEND[0] = slave.a_WR_VALUES_RECEIVED[0];
            }
        }
        master.call(&modules.master, a_RD_ARRAY);
    }

    /// Releases the slave's second frame.
    fn second(&mut self) {
        let Exchange { modules, slave, a_RD_ARRAY, .. } = self;
        if let Some((regs, _)) = &modules.slave {
            (slave.si_RDC1_SEND, slave.si_RDC2_SEND) = (0, 5);
            slave.call(regs, a_RD_ARRAY);
        }
    }
}

/// The program of a PLC in a separate process, and not a test.
#[test]
fn child() {
    let Ok(role) = std::env::var(ROLE) else { return };
    let [plc, instance, first, second] = role.split(':').collect::<Vec<_>>().try_into().unwrap();
    let image = Image::attach(instance, plc, AttachMode::ReadWrite, Some(LAYOUT_HASH)).unwrap();
    let modules = Modules::of(plc, &image);
    modules.bring_up();
    let us = [first, second].map(|us| us.parse().unwrap());
    if us == [0, 0] {
        println!("\n{READY}");
        println!("\n{}", modules.follow().unwrap_err());
        return;
    }
    let mut task = image.join_lockstep(SYNC, Duration::ZERO, LONG).unwrap();
    println!("\n{READY}");
    let end = modules.run(&mut task, us);
    println!("\n{}", end.unwrap_err());
}

/// The process of a PLC.
struct Plc {
    child: Child,
    lines: mpsc::Receiver<String>,
}

impl Plc {
    fn start(emulator: &Emulator, plc: &str, [first, second]: [u32; 2]) -> Self {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "bm4::child", "--nocapture"])
            .env(ROLE, format!("{plc}:{}:{first}:{second}", emulator.name))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let out = BufReader::new(child.stdout.take().unwrap());
        let (send, lines) = mpsc::channel();
        std::thread::spawn(move || out.lines().map_while(Result::ok).try_for_each(|line| send.send(line)));
        Plc { child, lines }
    }

    /// Returns whether the task takes part. The program reports it once.
    fn is_ready(&self) -> bool {
        self.lines.try_iter().any(|line| line == READY)
    }

    fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

impl Drop for Plc {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Advances the clock until all programs are ready.
fn bring_up(emulator: &Emulator, mut plcs: Vec<&Plc>) {
    assert!(crate::common::eventually(|| {
        emulator.step(&["5ms"]);
        plcs.retain(|plc| !plc.is_ready());
        plcs.is_empty()
    }));
    emulator.step(&["20ms"]);
}

/// Returns the frames that were missed in 10 intervals of 1 ms, with their port and number.
fn missed_in_ten(emulator: &Emulator) -> BTreeMap<(String, String), usize> {
    let start = attach(emulator, "top").header_snapshot().virtual_time_us.load();
    emulator.step(&["10ms"]);
    let trace = emulator.run("trace", &["--kind", "missed", "--format", "jsonl"]);
    let mut missed = BTreeMap::new();
    for line in trace.ok().lines() {
        let record: serde_json::Value = serde_json::from_str(line).unwrap();
        let text = |key: &str| record[key].as_str().unwrap().to_owned();
        let [last, count, period] =
            ["time_us", "count", "period_us"].map(|key| record[key].as_u64().unwrap_or(1));
        let new = (0..count).filter(|n| last - n * period > start).count();
        if new > 0 {
            *missed.entry((format!("{}:{}", text("plc"), record["node"]), text("frame"))).or_default() += new;
        }
    }
    missed
}

fn attach(emulator: &Emulator, plc: &str) -> Attached {
    Image::attach(&emulator.name, plc, AttachMode::ReadWrite, Some(LAYOUT_HASH)).unwrap()
}

/// Returns the value that comes back to `top`.
fn returned(emulator: &Emulator) -> u32 {
    let master = Ram::of(attach(emulator, "top").segment()).unwrap();
    master.at::<CANsync_PLC_MA_BMSTRUCT>(SLOTM).unwrap().a_RD_BMARRAY[6][0].load()
}

/// Returns the edges of the SYNC signal at slots G and H of `maxx`.
fn edges(emulator: &Emulator) -> [u32; 2] {
    let header = attach(emulator, "maxx").header_snapshot();
    [0, 1].map(|slot| header.sync_counter[slot].load())
}

fn start(args: &[&str]) -> (Emulator, tempfile::TempDir) {
    let directory = tempfile::tempdir().unwrap();
    let plant = directory.path().join("plant.toml");
    std::fs::write(&plant, PLANT).unwrap();
    (Emulator::start(&[&[plant.to_str().unwrap()], args].concat()), directory)
}

/// Manual p. 54, 86-87: reference values and a slave's first actual values must be released within 200 us after the
/// start of the event task, a slave's second actual values within 450 us. The test checks these limits to the
/// microsecond.
#[test]
fn programs_in_lockstep_meet_or_miss_the_deadlines_of_this_device() {
    // Port 1 is slot G, port 2 slot H. A frame that has never been in time causes no finding.
    let late = [("maxx:1", "WRC1", 10), ("maxx:2", "RDC1", 10), ("maxx:2", "RDC2", 10)];
    for (us, is_late) in [([199, 449], false), ([200, 450], true)] {
        let (emulator, _plant) = start(&["--clock", "stepped"]);
        let plcs = [Plc::start(&emulator, "top", [199, 449]), Plc::start(&emulator, "maxx", us)];
        bring_up(&emulator, plcs.iter().collect());
        let before = returned(&emulator);
        let missed = missed_in_ten(&emulator);
        let found: Vec<_> =
            missed.iter().map(|((port, frame), count)| (&port[..], &frame[..], *count)).collect();
        assert_eq!(found, if is_late { late.to_vec() } else { Vec::new() });
        if !is_late {
            assert_eq!(returned(&emulator), before + 10, "each interval brings the next number");
        }
    }
}

#[test]
fn a_killed_program_restarts_with_both_its_modules() {
    let (emulator, _plant) = start(&["--clock", "stepped"]);
    let top = Plc::start(&emulator, "top", [100, 100]);
    let maxx = Plc::start(&emulator, "maxx", [100, 400]);
    bring_up(&emulator, vec![&top, &maxx]);
    maxx.kill();
    emulator.step(&["20ms"]);
    let trace = emulator.run("trace", &["--kind", "board"]);
    assert!(trace.ok().contains("the task of event 11"), "{}", trace.out);
    let lost = returned(&emulator);
    emulator.step(&["10ms"]);
    assert_eq!(returned(&emulator), lost, "nobody answers");
    let maxx = Plc::start(&emulator, "maxx", [100, 400]);
    bring_up(&emulator, vec![&maxx]);
    let back = returned(&emulator);
    assert!(back > lost + 20, "{lost} {back}");
    emulator.step(&["10ms"]);
    assert_eq!(returned(&emulator), back + 10);
    let before = edges(&emulator);
    emulator.step(&["10ms"]);
    assert_eq!(edges(&emulator), before.map(|edges| edges + 10), "from slot H on to slot G");
}

/// In real time the bus does not wait for a program: a frame released too late for an interval goes out in the next
/// one. The values still travel in order in both directions, and the programs notice the end.
#[test]
fn programs_in_real_time_exchange_values_through_both_modules() {
    let (mut emulator, _plant) = start(&[]);
    let plcs = ["top", "maxx"].map(|plc| Plc::start(&emulator, plc, [0, 0]));
    let mut last = 0;
    assert!(crate::common::eventually(|| {
        let now = returned(&emulator);
        assert!(now >= last, "{now} after {last}");
        last = now;
        now >= 50
    }));
    let [slot_g, slot_h] = edges(&emulator);
    assert!(slot_h >= 50 && slot_g > 0, "{slot_g} {slot_h}");
    emulator.run("stop", &[]).ok();
    emulator.wait();
    for plc in plcs {
        let last = plc.lines.iter().filter(|line| !line.is_empty()).find(|line| line.contains("emulator"));
        assert!(last.is_some(), "the program learns of the end");
    }
}
