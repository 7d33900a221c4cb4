//! Process data, re-initialization, faults and service data jobs at once, in any order: the registers of the PLC and
//! the parameters of the drive agree with a model that only has the rules.

use super::bench::*;
use crate::rig::{BOTH, Memory};
use proptest::prelude::*;

/// A parameter that both kinds of data write.
const SHARED: u16 = 400;
const LIMIT: u32 = 1000;
const DRIVE: &str = "service_time_us = 1200
parameters = [{ number = 400, format = 'doubleword', max = 1000 }, { number = 401, format = 'word' }]";

#[derive(Clone, Copy, Debug)]
enum Op {
    /// The PLC gives a command, if the last one is answered, with this reference value for `SHARED`.
    Command { re_initialize: bool, value: u32 },
    /// The PLC enters a job, if both semaphores are 0.
    Job { write: bool, element: u8, doubleword: bool, value: u32 },
    /// The PLC clears its semaphore, whether or not the job is answered.
    Clear,
    /// A fault of the drive.
    Fault,
    /// The clock advances by time slices.
    Slices(u8),
}

fn op() -> impl Strategy<Value = Op> {
    let value = prop_oneof![9 => 0..=LIMIT, 1 => LIMIT + 1..=LIMIT + 9];
    prop_oneof![
        3 => (any::<bool>(), value.clone()).prop_map(|(re_initialize, value)| Op::Command { re_initialize, value }),
        3 => (any::<bool>(), prop_oneof![9 => Just(7u8), 1 => 5..7u8], prop_oneof![9 => Just(true), 1 => Just(false)], value)
            .prop_map(|(write, element, doubleword, value)| Op::Job { write, element, doubleword, value }),
        2 => Just(Op::Clear),
        1 => Just(Op::Fault),
        6 => (1..6u8).prop_map(Op::Slices),
    ]
}

/// A job that the PLC has entered and that has no answer yet.
#[derive(Clone, Copy, Debug)]
struct Open {
    write: bool,
    element: u8,
    doubleword: bool,
    value: u32,
}

struct Model {
    bench: Bench,
    shared: u32,
    command: Option<u32>,
    job: Option<Open>,
    semaphores: (u8, u8),
    answered: u32,
    entered: u32,
    given_up: u32,
}

impl Model {
    fn new(memory: Memory) -> Self {
        let mut bench = Bench::new(memory, DRIVE);
        assert_eq!(bench.configure(SAME_CYCLE, &[SHARED, 401], &[SHARED, 303, 121, 401]), 0x02);
        bench.regs.us_NUMBER.store(1);
        bench.regs.u_PAR_NR.store(SHARED);
        Model {
            bench,
            shared: 0,
            command: None,
            job: None,
            semaphores: (0, 0),
            answered: 0,
            entered: 0,
            given_up: 0,
        }
    }

    fn apply(&mut self, op: Op) -> Result<(), TestCaseError> {
        let regs = &self.bench.regs;
        match op {
            Op::Command { re_initialize, value } => {
                if regs.b_COMMAND.load() == 0 {
                    regs.a_WR_VALUE[0].store(value);
                    regs.b_COMMAND.store(if re_initialize { RE_INITIALIZE } else { EXCHANGE });
                    self.command = Some(value);
                }
            }
            Op::Job { write, element, doubleword, value } => {
                if (regs.b_MA_SEMAPHORE.load(), regs.b_SL_SEMAPHORE.load()) == (0, 0) && self.job.is_none() {
                    regs.b_JOB.store(if write { 2 } else { 1 });
                    regs.us_PAR_ELEMENT.store(element);
                    regs.b_PAR_FORMAT.store(doubleword.into());
                    regs.ud_PAR_VALUE.store(value);
                    regs.b_MA_SEMAPHORE.store(1);
                    self.job = Some(Open { write, element, doubleword, value });
                    self.entered += 1;
                }
            }
            Op::Clear => {
                regs.b_MA_SEMAPHORE.store(0);
                // The drive must never execute a job that the PLC has given up before the answer. The test counts these
                // jobs to check this.
                self.given_up += u32::from(self.job.take().is_some());
                // The drive cannot see that the semaphore was 0 for less than a slice.
                self.slice()?;
            }
            Op::Fault => {
                // While the drive has a fault, a second one would only wait. Waiting faults must not accumulate.
                self.bench.plant.clear_faults();
                self.bench.trip(3);
            }
            Op::Slices(count) => {
                for _ in 0..count {
                    self.slice()?;
                }
            }
        }
        Ok(())
    }

    fn slice(&mut self) -> Result<(), TestCaseError> {
        self.semaphores.0 = self.bench.regs.b_MA_SEMAPHORE.load();
        self.bench.step(500);
        let regs = &self.bench.regs;
        // In a slice the drive exchanges the actual values before it takes the reference values, so an actual value is
        // older.
        prop_assert_eq!(regs.a_RD_VALUE[0].load(), self.shared);
        if let Some(value) = self.command.take() {
            prop_assert_eq!(regs.b_COMMAND.load(), 0, "answered in every slice");
            let quit = regs.b_SL_QUIT.load();
            prop_assert!(matches!(quit, 0x01 | 0x03 | 0x83), "16#{:02X}", quit);
            if value <= LIMIT {
                prop_assert_ne!(quit, 0x83);
                self.shared = value;
            }
        }
        let slave = regs.b_SL_SEMAPHORE.load();
        match (self.semaphores, slave) {
            ((1, 0), 1) => self.answer()?,
            ((0, 1), 0) | ((_, 0), 0) | ((1, 1), 1) => {}
            (before, after) => prop_assert!(false, "semaphores {before:?}, slave to {after}"),
        }
        self.semaphores.1 = slave;
        prop_assert_eq!(self.bench.p(SHARED), self.shared);
        Ok(())
    }

    fn answer(&mut self) -> Result<(), TestCaseError> {
        let job = self.job.take();
        prop_assert!(job.is_some(), "an answer without a job");
        let Some(job) = job else { return Ok(()) };
        self.answered += 1;
        let regs = &self.bench.regs;
        let result = regs.i_ERR_DETAIL.load() as i16;
        let expected = match job {
            Open { write: true, element: 5 | 6, .. } => -4,
            Open { write: true, doubleword: false, .. } => -7,
            Open { write: true, value, .. } if value > LIMIT => -3,
            _ => 0,
        };
        prop_assert_eq!(result, expected, "{:?}", job);
        if job.write && result == 0 {
            self.shared = job.value;
        }
        if !job.write {
            let value = match job.element {
                5 => 0,
                6 => LIMIT,
                _ => self.shared,
            };
            prop_assert_eq!((regs.ud_PAR_VALUE.load(), regs.b_PAR_FORMAT.load()), (value, 1));
        }
        Ok(())
    }

    /// Checks that every job was answered once or given up.
    fn finish(&mut self) -> Result<(), TestCaseError> {
        for _ in 0..4 {
            self.slice()?;
        }
        prop_assert!(self.job.is_none(), "a lost job");
        prop_assert_eq!(self.answered + self.given_up, self.entered);
        self.apply(Op::Clear)?;
        prop_assert_eq!(self.bench.regs.b_SL_SEMAPHORE.load(), 0);
        Ok(())
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    #[test]
    fn no_job_is_lost_or_carried_out_twice(ops in prop::collection::vec(op(), 1..120), mapped: bool) {
        let mut model = Model::new(BOTH[usize::from(mapped)]);
        for op in ops {
            model.apply(op)?;
        }
        model.finish()?;
    }
}
