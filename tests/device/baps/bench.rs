//! A plant of one PLC that uses only its BAPS.

use crate::rig::bring_up::{Mode, Node, Stage, bring_up_in};
use crate::rig::{BOTH, Memory, Rate, add_fault, segment};
use commram::devices::cansync::drive::BuiltInDrive;
use commram::devices::omega_drive_line_2::Plc;
use commram::devices::omega_drive_line_2::registers::{BAPS, BAPS_CTRL_BMSTRUCT};
use commram::memory::header::{InterruptResult, OptInitResult, Trigger};
use commram::memory::{Header, Image, View};
use commram::plant::{Plant, PlantConfig};

/// Commands in `b_COMMAND`.
pub(crate) const EXCHANGE: u8 = 0x01;
pub(crate) const CONFIGURE: u8 = 0x02;
pub(crate) const RE_INITIALIZE: u8 = 0x03;

/// Two reference and four actual values every 0.5 ms.
pub(crate) const SAME_CYCLE: u16 = 0x0014;
/// Eight values in time slices, 0.5 ms.
pub(crate) const TIME_SLICES: u16 = 0x0010;

pub(crate) const SPEED_REFERENCE: u16 = 300;
pub(crate) const SPEED_ACTUAL: u16 = 301;
pub(crate) const ADDITIONAL: u16 = 302;

pub(crate) struct Bench {
    pub plant: Plant,
    pub regs: View<BAPS_CTRL_BMSTRUCT>,
    _images: Vec<Image>,
}

impl Bench {
    /// `drive` is TOML text for the section `[plc.drive]`.
    pub(crate) fn new(memory: Memory, drive: &str) -> Bench {
        let text = format!("[[plc]]\nname = 'line'\n[plc.drive]\n{drive}");
        Self::of_plant(memory, &text)
    }

    pub(crate) fn of_plant(memory: Memory, text: &str) -> Bench {
        let config = PlantConfig::parse("baps", text).unwrap();
        let mut images = Vec::new();
        let plant = Plant::new(&config, |plc, device| segment(memory, plc, device, &mut images)).unwrap();
        let regs = plant.devices()[0].segment().view(BAPS).unwrap();
        Bench { plant, regs, _images: images }
    }

    /// Runs a test on heap memory and on mapped memory.
    pub(crate) fn on_both(drive: &str, test: impl Fn(Bench)) {
        for memory in BOTH {
            test(Bench::new(memory, drive));
        }
    }

    pub(crate) fn step(&mut self, us: u64) {
        self.plant.advance_to(self.plant.now() + us);
    }

    pub(crate) fn drive(&self) -> &BuiltInDrive {
        self.plant.devices()[0].as_a::<Plc>().unwrap().baps().drive()
    }

    pub(crate) fn p(&self, number: u16) -> u32 {
        self.drive().parameter(number).unwrap()
    }

    pub(crate) fn events(&self) -> u64 {
        self.plant.devices()[0].as_a::<Plc>().unwrap().baps().process_data_events()
    }

    /// Starts SYNC by node 2.
    pub(crate) fn start_sync(&mut self, rate: Rate) {
        let at = rate.kind.master;
        let node = Node::at(self.plant.devices()[at.plc].segment(), at.base, rate.timing, Mode::Master);
        bring_up_in(&mut self.plant, &[&node], ..=Stage::SetUp);
    }

    fn header(&self) -> View<Header> {
        self.plant.devices()[0].segment().header().unwrap()
    }

    /// Does what `OPT_INIT` does. `controller` is the source of the trigger controller (1 SYNC net, 2 timer A),
    /// `timer_a_us` the period of timer A (0: not started).
    pub(crate) fn opt_init(&mut self, controller: u32, timer_a_us: u32) {
        let header = self.header();
        header.opt_init.triggers[Trigger::Controller as usize].store(controller);
        header.opt_init.timers[0].divider.store((timer_a_us * 5 / 2).saturating_sub(1));
        header.opt_init.timers[0].enable.store(u32::from(timer_a_us != 0));
        let request = header.opt_init.ask();
        header.submit_request();
        self.plant.look_at_boards();
        assert_eq!(header.opt_init.outcome(request), Some(OptInitResult::Done.code()));
    }

    /// Enables an event as `INTR_SET` does.
    pub(crate) fn intr_set(&mut self, event: usize) {
        let header = self.header();
        let request = header.interrupts[event].ask(1, true);
        header.submit_request();
        self.plant.look_at_boards();
        assert_eq!(header.interrupts[event].outcome(request), Some(InterruptResult::Done.code()));
    }

    /// Returns the number of occurrences of an event.
    pub(crate) fn occurred(&self, event: usize) -> u32 {
        self.header().events[event].bell.rings()
    }

    /// Causes a fault of the drive.
    pub(crate) fn trip(&mut self, number: u16) {
        self.fault("baps_drive_fault", &[&format!("error={number}")]);
    }

    /// Adds a fault that begins at once; returns its number.
    pub(crate) fn fault(&mut self, kind: &str, fields: &[&str]) -> u16 {
        add_fault(&mut self.plant, kind, fields)
    }

    pub(crate) fn numbers(&self, writes: &[u16], reads: &[u16]) {
        let all = |numbers: &[u16], x: usize| numbers.get(x).copied().unwrap_or(0);
        for x in 0..8 {
            self.regs.a_WR_PAR_NR[x].store(all(writes, x));
            self.regs.a_RD_PAR_NR[x].store(all(reads, x));
        }
    }

    /// Gives a command, advances the clock by `us` and returns the acknowledgement.
    #[track_caller]
    pub(crate) fn command(&mut self, command: u8, us: u64) -> u8 {
        self.regs.b_SL_QUIT.store(0xFF);
        self.regs.b_COMMAND.store(command);
        self.step(us);
        assert_eq!(self.regs.b_COMMAND.load(), 0, "the command is not answered");
        self.regs.b_SL_QUIT.load()
    }

    /// Performs the register accesses of `BAPS_INIT`.
    #[track_caller]
    pub(crate) fn configure(&mut self, command_reg: u16, writes: &[u16], reads: &[u16]) -> u8 {
        self.regs.w_COMMAND_REG.store(command_reg);
        self.numbers(writes, reads);
        self.command(CONFIGURE, 500)
    }

    /// Calls `BAPS_PD_COMM` once in each of `count` slices.
    #[track_caller]
    pub(crate) fn exchange(&mut self, count: usize) {
        for _ in 0..count {
            self.regs.w_TIMEOUT.update(|count| count.wrapping_add(1));
            assert_eq!(self.command(EXCHANGE, 500), 0x01);
        }
    }

    /// Brings the drive into operation.
    pub(crate) fn enable(&mut self) {
        for word in [0x0006, 0x0007, 0x000F] {
            self.regs.w_CONTROLWORD.store(word);
            self.exchange(1);
        }
    }

    /// Runs a job like `BAPS_SD_CONTROL`; returns the result.
    #[track_caller]
    pub(crate) fn job(&mut self, code: u8, number: u16, element: u8, value: (u8, u32)) -> i16 {
        let regs = &self.regs;
        assert_eq!((regs.b_MA_SEMAPHORE.load(), regs.b_SL_SEMAPHORE.load()), (0, 0));
        regs.b_JOB.store(code);
        regs.u_PAR_NR.store(number);
        regs.us_PAR_ELEMENT.store(element);
        regs.us_NUMBER.store(1);
        regs.b_PAR_FORMAT.store(value.0);
        regs.ud_PAR_VALUE.store(value.1);
        self.run_job()
    }

    /// Returns the job that the registers hold.
    #[track_caller]
    pub(crate) fn run_job(&mut self) -> i16 {
        self.regs.b_MA_SEMAPHORE.store(1);
        self.step(3000);
        assert_eq!(self.regs.b_SL_SEMAPHORE.load(), 1, "the job is not answered");
        let result = self.regs.i_ERR_DETAIL.load() as i16;
        self.regs.b_MA_SEMAPHORE.store(0);
        self.step(1000);
        assert_eq!(self.regs.b_SL_SEMAPHORE.load(), 0);
        result
    }

    pub(crate) fn read(&mut self, number: u16) -> (i16, u8, u32) {
        let result = self.job(1, number, 7, (0, 0));
        (result, self.regs.b_PAR_FORMAT.load(), self.regs.ud_PAR_VALUE.load())
    }

    pub(crate) fn write_word(&mut self, number: u16, value: u16) -> i16 {
        self.job(2, number, 7, (0, value.into()))
    }

    pub(crate) fn write_doubleword(&mut self, number: u16, value: u32) -> i16 {
        self.job(2, number, 7, (1, value))
    }
}
