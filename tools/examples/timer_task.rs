//! Configuration example D of the manual (5.00005.03a p. 71-73): an event task at a fixed time of 1 ms, as a serial
//! protocol needs it, beside the cyclic task.
//!
//!     commram with -- cargo run --example timer_task
//!
//! By default the program uses CPU timer 2, level 13. Number 0 is CPU timer 1; numbers 5 and 6 are board timer A with
//! triggers:
//!
//!     commram with -- cargo run --example timer_task -- line 5

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

mod common;

use common::{Arguments, check};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::memory::header::Start;

/// Events of CPU timer 1 and 2, and of board timer A at levels 14 and 13.
const CPU_TIMERS: [usize; 2] = [0, 2];
const BOARD_TIMERS: [usize; 2] = [5, 6];
/// Factor of the CPU timer for a period of 1 ms: 20 x 50 us.
const FACTOR: i16 = 20;
/// Divider of board timer A for a period of 1 ms: (2499 + 1) x 2 / 5 MHz.
const DIVIDER: u16 = 2499;
/// Number of events after which the program ends.
const EVENTS: u32 = 1000;

/// The PLC program of the example.
pub(crate) struct Timer {
    ram: Ram,
    number: usize,
    triggers: OPT_INIT,
    event: INTR_SET,
    start: TIME_MEASURE_START,
    end: TIME_MEASURE_END,
    led: LED,
    /// Number of events, and number of events that occurred before the task had handled the previous event.
    events: u32,
    missed: u32,
    /// Run time of the task in us.
    longest: u32,
}

impl Timer {
    /// Makes the program on the RAM of a PLC, with the task on event `number`.
    pub(crate) fn new(ram: Ram, number: usize) -> Self {
        Timer {
            triggers: OPT_INIT {
                us_MODE_TRIGGER_1: 4,
                us_MODE_TRIGGER_2: 4,
                us_MODE_TRIGGER_CONTROLLER: 2,
                u_DIVIDER_TIMER_A: DIVIDER,
                x_EN_TIMER_A: true,
                ..Default::default()
            },
            event: INTR_SET { i_EVENT: number as i8, i_PAR1: FACTOR, x_EN: true, ..Default::default() },
            start: TIME_MEASURE_START::default(),
            end: TIME_MEASURE_END::default(),
            led: LED::default(),
            events: 0,
            missed: 0,
            longest: 0,
            ram,
            number,
        }
    }

    /// Does the work of the task. A real program calls the block of the serial protocol here.
    fn telegram(&mut self) {
        self.led.b_LEDS = (self.events / 100 % 2) as u8;
        self.led.call(&self.ram);
    }
}

impl Program for Timer {
    type Error = String;

    fn initialize(&mut self, _: Start) {
        *self = Timer::new(self.ram.clone(), self.number);
    }

    /// Starts the event. A CPU timer triggers nothing and needs only `INTR_SET`; board timer A also needs `OPT_INIT`
    /// (p. 71).
    fn cold_start(&mut self) -> Result<Progress, String> {
        if BOARD_TIMERS.contains(&self.number) && !self.triggers.x_OK {
            self.triggers.call(&self.ram);
            return check(self.triggers.x_ERR, "OPT_INIT", 0).map(|()| Progress::Again);
        }
        self.event.call(&self.ram);
        check(self.event.x_ERR, "INTR_SET", 0)?;
        Ok(Progress::done_if(self.event.is_answered()))
    }

    fn event(&mut self, _number: usize, missed: u32) -> Result<(), String> {
        self.start.call(&self.ram);
        (self.events, self.missed) = (self.events + 1 + missed, self.missed + missed);
        self.telegram();
        self.end.ud_TIME = self.start.ud_TIME;
        self.end.call(&self.ram);
        self.longest = self.longest.max(self.end.ud_TIME_DIFF);
        Ok(())
    }

    fn cyclic(&mut self) -> Result<Progress, String> {
        if self.events < EVENTS {
            return Ok(Progress::Again);
        }
        // Every started event must be disabled again (p. 48).
        if self.event.x_EN {
            println!("event {}: {} ms", self.number, self.events);
            println!("missed {}, longest run {} us", self.missed, self.longest);
            self.event.x_EN = false;
        }
        self.event.call(&self.ram);
        Ok(Progress::done_if(self.event.is_answered()))
    }
}

/// Returns the event number from the command line.
fn event_of(arguments: &Arguments) -> Result<usize, String> {
    let number = arguments.numbers.first().map_or(CPU_TIMERS[1], |number| usize::from(*number));
    let known = CPU_TIMERS.contains(&number) || BOARD_TIMERS.contains(&number);
    if known { Ok(number) } else { Err(format!("event {number} is no timer: 0, 2, 5 or 6")) }
}

fn main() -> std::process::ExitCode {
    let parsed = Arguments::parse("line").and_then(|arguments| Ok((event_of(&arguments)?, arguments)));
    let event = parsed.as_ref().map_or(CPU_TIMERS[1], |(event, _)| *event);
    let arguments = parsed.map(|(_, arguments)| arguments);
    common::run(arguments, event, |ram, _| Ok(Timer::new(ram, event)))
}
