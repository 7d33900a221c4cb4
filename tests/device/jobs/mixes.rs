//! Random mixes of jobs against a model of the manual's rules: the right area gets every frame, no job is
//! lost, none is sent or finished twice, counters keep their bounds.

use super::bench::Bench;
use crate::rig::{BOTH, FASTEST};
use commram::devices::cansync::frames::Frame;
use commram::devices::cansync::frames::codec::{
    ActionCommand, Direction, ParameterJob, ParameterResult, UpDownJob, UpDownResult, UpDownStep,
};
use proptest::prelude::*;

const SLAVES: u8 = 4;
const ADDRESS: u32 = 0x4000;

/// Actions of the PLC at the start of an interval. The PLC enters a job only into free registers.
#[derive(Clone, Copy, Debug)]
enum Act {
    Nothing,
    Broadcast(usize),
    ControlWord(usize),
    Parameter(usize, u8),
    WithdrawParameter(usize),
    UpDown { download: bool, slave: u8, length: u16 },
    Cancel,
}

/// Reaction of the slave that was polled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reply {
    Good,
    Busy,
    Error,
    Silent,
    Unfit,
}

fn act() -> impl Strategy<Value = Act> {
    let slave = 0..usize::from(SLAVES);
    prop_oneof![
        4 => Just(Act::Nothing),
        2 => (0usize..3).prop_map(Act::Broadcast),
        3 => slave.clone().prop_map(Act::ControlWord),
        5 => (slave.clone(), prop::sample::select(vec![0x03, 0x13, 0x05, 0x15]))
            .prop_map(|(slave, kind)| Act::Parameter(slave, kind)),
        1 => slave.prop_map(Act::WithdrawParameter),
        3 => (any::<bool>(), 0..SLAVES, 1u16..=40)
            .prop_map(|(download, slave, length)| Act::UpDown { download, slave, length }),
        1 => Just(Act::Cancel),
    ]
}

fn reply() -> impl Strategy<Value = Reply> {
    prop_oneof![
        6 => Just(Reply::Good),
        2 => Just(Reply::Busy),
        1 => Just(Reply::Error),
        2 => Just(Reply::Silent),
        1 => Just(Reply::Unfit),
    ]
}

/// Returns a configuration register of the command channel.
fn polled() -> impl Strategy<Value = u8> {
    prop_oneof![3 => Just(0x80), 1 => 0..SLAVES]
}

#[derive(Clone, Copy, Debug, Default)]
struct Parameter {
    control: u8,
    number: u16,
    value: u32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Block {
    control: u8,
    slave: u8,
    length: u16,
    /// Offset of the next block; `None` until the init frame is sent.
    next: Option<u16>,
    counter: u16,
    error: u16,
}

/// Expected values of the registers, and the frame that must come next.
#[derive(Default)]
struct Model {
    /// Automatic slave numbers: control word, parameter, up-/download.
    automatic: [Option<u8>; 3],
    polled: [u8; 3],
    max: u8,
    /// Number of the command that waits in each broadcast area and for each slave.
    broadcasts: [Option<u16>; 3],
    control_words: [Option<u16>; SLAVES as usize],
    parameters: [Parameter; SLAVES as usize],
    block: Block,
    /// Makes every job different from all others.
    count: u16,
}

/// The one job that may go out in an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    Broadcast(usize, u16),
    ControlWord(usize, u16),
    Parameter(usize),
    Block,
    Nothing,
}

impl Model {
    fn configure(&mut self, bench: &Bench, polled: [u8; 3], max: u8) {
        (self.polled, self.max) = (polled, max);
        bench.regs.b_SL_NR_CONTROLWORD.store(polled[0]);
        bench.regs.b_SL_NR_PARAMETER.store(polled[1]);
        bench.regs.b_SL_NR_UPDOWN.store(polled[2]);
        bench.regs.b_MAX_SL_NR.store(max);
    }

    /// Executes an action of the PLC, in the registers and in the model.
    fn act(&mut self, bench: &Bench, act: Act) {
        self.count += 1;
        let number = self.count;
        let regs = &bench.regs;
        match act {
            Act::Nothing => {}
            Act::Broadcast(n) if self.broadcasts[n].is_none() => {
                self.broadcasts[n] = Some(number);
                let (control, command, word) = match n {
                    0 => (&regs.b_CTRL_REG_BC0, &regs.b_CMD_BC0, &regs.w_DATA_WORD_BC0),
                    1 => (&regs.b_CTRL_REG_BC1, &regs.b_CMD_BC1, &regs.w_DATA_WORD_BC1),
                    _ => (&regs.b_CTRL_REG_BC2, &regs.b_CMD_BC2, &regs.w_DATA_WORD_BC2),
                };
                command.store(0x80 + n as u8);
                word.store(number);
                control.store(0x05);
            }
            Act::ControlWord(n) if self.control_words[n].is_none() => {
                self.control_words[n] = Some(number);
                regs.a_CONTROLWORD_SL[n].store(number);
                regs.a_STEUREG_CONTROLWORD[n].store(0x05);
            }
            Act::Parameter(n, control) if self.parameters[n].control & 1 == 0 => {
                let value = u32::from(number) << 12;
                self.parameters[n] = Parameter { control, number, value };
                bench.enter_parameter(n, control, number, value);
            }
            Act::WithdrawParameter(n) => {
                self.parameters[n].control = 0;
                bench.put(n, 0, 0);
            }
            Act::UpDown { download, slave, length } if self.block.control & 1 == 0 => {
                let control = if download { 0x15 } else { 0x05 };
                self.block = Block { control, slave, length, next: None, ..self.block };
                bench.enter_block(control, slave, ADDRESS, length);
            }
            Act::Cancel => {
                self.block.control |= 0x80;
                regs.b_STATREG_UPDOWNBLK1.store(self.block.control);
                regs.b_STEUREG_UPDOWNBLK1.store(self.block.control);
            }
            _ => {}
        }
    }

    fn turn(&self, area: usize) -> usize {
        usize::from(match self.polled[area] {
            0x80 => self.automatic[area].unwrap(),
            explicit => explicit,
        })
    }

    fn next(&mut self) -> Next {
        for counter in &mut self.automatic {
            *counter = Some(counter.filter(|n| *n < self.max).map_or(0, |n| n + 1));
        }
        for (n, area) in self.broadcasts.iter_mut().enumerate() {
            if let Some(number) = area.take() {
                return Next::Broadcast(n, number);
            }
        }
        let turn = self.turn(0);
        if let Some(number) = self.control_words[turn].take() {
            return Next::ControlWord(turn, number);
        }
        let turn = self.turn(1);
        if self.parameters[turn].control & 1 != 0 {
            self.parameters[turn].control |= 0x08;
            return Next::Parameter(turn);
        }
        if self.block.control & 0x81 != 0 && usize::from(self.block.slave) == self.turn(2) {
            return Next::Block;
        }
        if self.block.control & 0x83 == 0x81 {
            // The job is cancelled before a slave has received any of its frames (D-601).
            self.block.control = 0;
        }
        Next::Nothing
    }

    /// Runs one interval and checks the frames in it, the answers, and the values of the registers at its end.
    fn interval(&mut self, bench: &mut Bench, reply: Reply) {
        let next = self.next();
        let frame = bench.interval();
        match next {
            Next::Nothing => assert_eq!(frame, None),
            Next::Broadcast(n, number) => {
                let command = action(frame.unwrap());
                assert_eq!((command.command, command.data_word), (0x80 + n as u8, number));
            }
            Next::ControlWord(n, number) => {
                assert_eq!(action(frame.unwrap()), ActionCommand::control_word(1 << n, number));
            }
            Next::Parameter(n) => self.parameter(bench, n, frame.unwrap(), reply),
            Next::Block => self.block(bench, frame.unwrap(), reply),
        }
        self.compare(bench);
    }

    fn parameter(&mut self, bench: &mut Bench, n: usize, frame: Frame, reply: Reply) {
        assert_eq!(usize::from(frame.id()), 0x500 + n);
        let job = ParameterJob::decode(frame.payload()).unwrap();
        let model = &mut self.parameters[n];
        assert_eq!(job.number(), model.number);
        let read = model.control & 0x02 != 0;
        let end = model.control & 0x16;
        let result = match reply {
            Reply::Silent => return bench.no_answer(),
            Reply::Unfit => {
                return bench.respond(UpDownJob::cancel().answer(UpDownResult::Done).frame(n as u8));
            }
            Reply::Busy => {
                model.control |= 0x40;
                ParameterResult::Busy
            }
            Reply::Error => {
                (model.control, model.value) = (end | 0x20, 0xFFFB);
                ParameterResult::Error(0xFFFB)
            }
            Reply::Good if read => {
                (model.control, model.value) = (0x12, u32::from(job.number()) * 7);
                ParameterResult::Doubleword(model.value)
            }
            Reply::Good => {
                model.control = end;
                ParameterResult::Done
            }
        };
        bench.answer(n as u8, &job, result);
    }

    fn block(&mut self, bench: &mut Bench, frame: Frame, reply: Reply) {
        let model = &mut self.block;
        assert_eq!(frame.id(), 0x500 + u16::from(model.slave));
        let job = UpDownJob::decode(frame.payload()).unwrap();
        if model.control & 0x80 != 0 {
            assert_eq!(job, UpDownJob::cancel());
            model.control = 0;
            return bench.answer_block(model.slave, &job, UpDownResult::Done);
        }
        let download = model.control & 0x10 != 0;
        let mode = match (model.next, job.step()) {
            (None, UpDownStep::Init { direction, address, .. }) => {
                (model.counter, model.error) = (0, 0);
                assert_eq!((job.offset(), address), (model.length, ADDRESS));
                assert_eq!(direction == Direction::Download, download);
                0x04
            }
            (Some(offset), UpDownStep::Upload { last } | UpDownStep::Download { last, .. }) => {
                assert_eq!((job.offset(), last), (offset, offset + 6 >= model.length));
                assert_eq!(job.direction() == Direction::Download, download);
                if last { 0x0C } else { 0x08 }
            }
            wrong => panic!("{wrong:?}"),
        };
        let busy = model.control & 0x40;
        let shown = model.control & 0x10 | mode | 0x03;
        let end = shown & 0x1C;
        model.control = shown | busy;
        let result = match reply {
            Reply::Silent => return bench.no_answer(),
            Reply::Unfit => {
                let other =
                    ParameterJob::new(1, commram::devices::cansync::frames::codec::Access::Read).unwrap();
                return bench.answer(model.slave, &other, ParameterResult::Word(1));
            }
            Reply::Busy => {
                model.control = shown | 0x40;
                UpDownResult::Busy
            }
            Reply::Error => {
                (model.control, model.error) = (end | 0x20, 0x0103);
                UpDownResult::Error(0x0103)
            }
            Reply::Good => {
                model.control = shown;
                match model.next {
                    None => model.next = Some(0),
                    Some(offset) => {
                        model.counter = model.length.min(offset + 6);
                        model.next = Some(offset + 6);
                        if model.counter == model.length {
                            model.control = end;
                        }
                    }
                }
                match job.step() {
                    UpDownStep::Upload { .. } => UpDownResult::Data([1; 6]),
                    _ => UpDownResult::Done,
                }
            }
        };
        bench.answer_block(model.slave, &job, result);
    }

    fn compare(&self, bench: &Bench) {
        let regs = &bench.regs;
        let controls = [&regs.b_CTRL_REG_BC0, &regs.b_CTRL_REG_BC1, &regs.b_CTRL_REG_BC2];
        for (waiting, control) in self.broadcasts.iter().zip(controls) {
            assert_eq!(control.load() == 0x05, waiting.is_some());
        }
        for (waiting, control) in self.control_words.iter().zip(&regs.a_STEUREG_CONTROLWORD) {
            assert_eq!(control.load() == 0x05, waiting.is_some());
        }
        for (n, model) in self.parameters.iter().enumerate() {
            assert_eq!((bench.parameter(n), bench.value(n)), (model.control, model.value));
        }
        assert_eq!(
            (bench.block(), bench.counter(), bench.error()),
            (self.block.control, self.block.counter, self.block.error)
        );
        assert!(self.block.control & 0x03 != 0x03 || bench.counter() <= self.block.length);
        assert!(bench.counter() <= 300);
    }

    fn is_idle(&self) -> bool {
        self.broadcasts.iter().chain(&self.control_words).all(Option::is_none)
            && self.parameters.iter().all(|job| job.control & 1 == 0)
            && self.block.control & 0x81 == 0
    }
}

fn action(frame: Frame) -> ActionCommand {
    assert_eq!(frame.id(), 0x010);
    ActionCommand::decode(frame.payload()).unwrap()
}

proptest! {
    #[test]
    fn every_job_is_served_once_and_in_its_turn(
        rate in prop::sample::select(&FASTEST[..]),
        polled in [polled(), polled(), polled()],
        max in 0..SLAVES,
        steps in prop::collection::vec((act(), reply()), 1..150),
    ) {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            let mut model = Model::default();
            model.configure(&bench, polled, max);
            for (act, reply) in &steps {
                model.act(&bench, *act);
                model.interval(&mut bench, *reply);
            }
            // When the master polls every slave and all answers are good, all remaining jobs end.
            model.configure(&bench, [0x80; 3], SLAVES - 1);
            for _ in 0..150 {
                model.interval(&mut bench, Reply::Good);
            }
            prop_assert!(model.is_idle());
            prop_assert_eq!(bench.interval(), None);
        }
    }
}
