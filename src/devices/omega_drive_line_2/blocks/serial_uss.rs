//! `SERIAL_USS`: a master of drives by the protocol USS at the RS485 port (decision D-870).

use super::serial_ring::{drop_received, put, take};
use crate::devices::omega_drive_line_2::registers::SERIAL_BMSTRUCT;
use crate::devices::omega_drive_line_2::registers::values::serial_status;
use crate::plc::{Base, function_block};
use crate::serial::uss::{
    Layout, Master, MasterEvent, Pkw, PkwWidth, Request, Station, StationFault, Timing,
};
use std::collections::VecDeque;

/// Number of words of process data of a slave.
const SLAVE_WORDS: usize = 16;

/// The process data of all slaves, 16 words for each address, or the values of a parameter.
pub type USS_BMARRAY = [u16; 32 * SLAVE_WORDS];

/// Time in microseconds until the port takes characters of the block.
const PORT_US: u64 = 1_000;

function_block! {
    /// Exchanges process data and parameters with drives by the protocol USS (manual p. 9, 47; pins: decision D-870).
    ///
    /// The program switches the port on before the first call. Call the block in an event task of a timer.
    pub struct SERIAL_USS(_BASE: Base<SERIAL_BMSTRUCT>) {
        in {
            /// TRUE: the block exchanges telegrams. FALSE ends the exchange and clears the outputs.
            x_EN: bool;
            /// Slaves: bit n for address n.
            d_SLAVES: u32;
            /// Words of the parameter channel of all slaves: 0, 3, 4, or 127 for a variable number.
            us_PKW: u8 = 4;
            /// Words of process data of all slaves, 0 to 16.
            us_PZD: u8 = 2;
            /// Longest response delay of a slave in ms.
            us_DELAY: u8 = 20;
            /// A rising edge sends a parameter request to slave `us_ADDRESS`.
            x_REQUEST: bool;
            /// A rising edge sends one telegram to all slaves.
            x_BROADCAST: bool;
            /// A rising edge sends a mirror telegram to slave `us_ADDRESS`.
            x_MIRROR: bool;
            /// Address of a slave, 0 to 31.
            us_ADDRESS: u8;
            /// Code of the parameter request, 1 to 15; for a broadcast also 0.
            b_TASK: u8;
            /// Number of the parameter, 0 to 31999.
            u_NUMBER: u16;
            /// Element of an array or of a description.
            us_INDEX: u8;
            /// Number of words in `a_VALUES` for the request.
            u_VALUES: u16;
        }
        out {
            /// Slaves that answer: bit n for address n.
            d_PRESENT: u32;
            /// A request, broadcast or mirror telegram is in progress.
            x_BUSY: bool;
            /// The last request, broadcast or mirror telegram has ended without an error of the block.
            x_DONE: bool;
            /// Error of the last request, broadcast or mirror telegram, or 0.
            b_ERR: u8;
            /// Code of the answer to the last request.
            b_REPLY: u8;
            /// Number of words in `a_REPLY`.
            u_REPLY: u16;
            /// The last two words of the answer.
            d_REPLY: u32;
            /// Fault of the last failed exchange.
            b_FAULT: u8;
            /// Address of the last failed exchange.
            us_FAULT: u8;
            /// Number of failed exchanges, modulo 65536.
            u_FAULTS: u16;
            /// Number of changes that slaves have reported without a request, modulo 65536.
            u_REPORTS: u16;
            /// Code of the last report.
            b_REPORT: u8;
            /// Address of the slave with the last report.
            us_REPORT: u8;
            /// Number of the parameter in the last report.
            u_REPORT: u16;
            /// Element in the last report.
            us_REPORT_INDEX: u8;
            /// The last two words of the last report.
            d_REPORT: u32;
        }
        in_out {
            a_SETPOINTS: USS_BMARRAY;
            a_ACTUAL: USS_BMARRAY;
            a_VALUES: USS_BMARRAY;
            a_REPLY: USS_BMARRAY;
        }
        internal: Exchange;
    }
}

/// Errors of a command of the program, by their numbers.
mod error {
    /// The slave does not belong to the slaves of `d_SLAVES`.
    pub(super) const ADDRESS: u8 = 1;
    /// There is no parameter channel.
    pub(super) const NO_CHANNEL: u8 = 2;
    /// The code or the number of the parameter is wrong.
    pub(super) const REQUEST: u8 = 3;
    /// The values do not fit into the parameter channel.
    pub(super) const VALUES: u8 = 4;
    /// The slave has not answered the request.
    pub(super) const NO_ANSWER: u8 = 5;
    /// `us_PKW` or `us_PZD` is wrong.
    pub(super) const SETTINGS: u8 = 6;
}

/// A command of the program that is in progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Command {
    Request(u8),
    Broadcast,
    Mirror(u8),
}

/// Inputs for which the master was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Setup {
    slaves: u32,
    layout: Layout,
}

/// State of the block between two calls.
#[derive(Clone, Debug, Default)]
pub struct Exchange {
    master: Option<(Setup, Master)>,
    /// Characters for which the ring of the port has no room yet.
    waiting: VecDeque<u8>,
    command: Option<Command>,
    /// Inputs of the last call: request, broadcast, mirror telegram.
    edges: [bool; 3],
    /// Time of the last call.
    called: Option<u64>,
}

/// Number of a fault at an output of the block.
const fn number(fault: StationFault) -> u8 {
    match fault {
        StationFault::Silent => 1,
        StationFault::Damaged(_) => 2,
        StationFault::Address(_) => 3,
        StationFault::Length(_) => 4,
        StationFault::Mirror => 5,
    }
}

/// Words of slave `address` in an array of process data.
fn row(address: u8, words: usize) -> core::ops::Range<usize> {
    let begin = usize::from(address & 31) * SLAVE_WORDS;
    begin..begin + words
}

/// The addresses in a mask.
fn addresses(slaves: u32) -> impl Iterator<Item = u8> {
    (0..32).filter(move |address| slaves >> address & 1 != 0)
}

impl SERIAL_USS {
    /// Runs one PLC cycle.
    pub fn call(
        &mut self,
        _BASE: &Base<SERIAL_BMSTRUCT>,
        a_SETPOINTS: &USS_BMARRAY,
        a_ACTUAL: &mut USS_BMARRAY,
        a_VALUES: &USS_BMARRAY,
        a_REPLY: &mut USS_BMARRAY,
    ) {
        let is_ready = _BASE.w_STATUS.load() & serial_status::READY != 0;
        let Some(layout) = self.layout().filter(|_| self.x_EN && is_ready) else {
            let is_wrong = self.x_EN && self.layout().is_none();
            return self.reset(_BASE, if is_wrong { error::SETTINGS } else { 0 });
        };
        let setup = Setup { slaves: self.d_SLAVES, layout };
        let master = self.internal.master.take().filter(|(old, _)| *old == setup);
        let master = master.map(|(_, master)| master).or_else(|| self.start(_BASE, setup));
        let Some(mut master) = master else { return self.reset(_BASE, error::SETTINGS) };
        let now = _BASE.ram().exact_us();
        let interval = now.saturating_sub(self.internal.called.replace(now).unwrap_or(now));
        master.set_response_delay(u64::from(self.us_DELAY) * 1_000);
        master.set_tolerance(interval + PORT_US);
        for address in addresses(self.d_SLAVES) {
            // The slave and the number of words are those of the setup.
            let _ = master.set_setpoints(address, &a_SETPOINTS[row(address, layout.pzd())]);
        }
        self.command(&mut master, layout, a_SETPOINTS, a_VALUES);
        while let Some(character) = take(_BASE) {
            master.received(now, character);
        }
        let is_waiting = !self.internal.waiting.is_empty();
        let telegram = if is_waiting { Vec::new() } else { master.poll(now) };
        self.internal.waiting.extend(telegram);
        put(_BASE, &mut self.internal.waiting);
        while let Some(event) = master.next_event() {
            self.show(event, a_REPLY);
        }
        if self.internal.command == Some(Command::Broadcast) && !master.has_waiting() {
            self.end(0);
        }
        self.d_PRESENT = 0;
        for address in addresses(self.d_SLAVES) {
            let Ok(actual) = master.actual(address) else { continue };
            a_ACTUAL[row(address, actual.len())].copy_from_slice(actual);
            self.d_PRESENT |= u32::from(master.has_answered(address) == Ok(true)) << address;
        }
        self.internal.master = Some((setup, master));
    }

    /// Returns the layout of the inputs; `None` if they are wrong.
    fn layout(&self) -> Option<Layout> {
        let pkw = match self.us_PKW {
            0 => PkwWidth::None,
            3 => PkwWidth::Three,
            4 => PkwWidth::Four,
            127 => PkwWidth::Variable,
            _ => return None,
        };
        Layout::new(pkw, self.us_PZD).ok()
    }

    /// Returns a master for new inputs. A command in progress ends.
    fn start(&mut self, _BASE: &Base<SERIAL_BMSTRUCT>, setup: Setup) -> Option<Master> {
        if self.x_BUSY {
            self.end(error::NO_ANSWER);
        }
        self.internal.waiting.clear();
        let stations = addresses(setup.slaves).map(|address| Station { address, layout: setup.layout });
        Master::new(Timing::new(_BASE.u_BAUD_RATE.load().into()), stations).ok()
    }

    /// Ends the exchange, clears the outputs, and drops received characters.
    fn reset(&mut self, _BASE: &Base<SERIAL_BMSTRUCT>, error: u8) {
        let edges = [self.x_REQUEST, self.x_BROADCAST, self.x_MIRROR];
        self.internal = Exchange { edges, ..Exchange::default() };
        (self.d_PRESENT, self.x_BUSY, self.x_DONE, self.b_ERR) = (0, false, false, error);
        (self.b_REPLY, self.u_REPLY, self.d_REPLY) = (0, 0, 0);
        (self.b_FAULT, self.us_FAULT, self.u_FAULTS) = (0, 0, 0);
        (self.u_REPORTS, self.b_REPORT, self.us_REPORT) = (0, 0, 0);
        (self.u_REPORT, self.us_REPORT_INDEX, self.d_REPORT) = (0, 0, 0);
        drop_received(_BASE);
    }

    /// Begins a command at a rising edge, unless another one is in progress.
    fn command(
        &mut self,
        master: &mut Master,
        layout: Layout,
        a_SETPOINTS: &USS_BMARRAY,
        a_VALUES: &USS_BMARRAY,
    ) {
        let inputs = [self.x_REQUEST, self.x_BROADCAST, self.x_MIRROR];
        let before = core::mem::replace(&mut self.internal.edges, inputs);
        let has_risen = |index: usize| inputs[index] && !before[index];
        let address = self.us_ADDRESS;
        let command = match [0, 1, 2].map(has_risen) {
            [true, _, _] => Command::Request(address),
            [_, true, _] => Command::Broadcast,
            [_, _, true] => Command::Mirror(address),
            _ => return,
        };
        if self.x_BUSY {
            return;
        }
        (self.x_BUSY, self.x_DONE, self.b_ERR) = (true, false, 0);
        (self.b_REPLY, self.u_REPLY, self.d_REPLY) = (0, 0, 0);
        self.internal.command = Some(command);
        let setpoints = &a_SETPOINTS[row(address, layout.pzd())];
        let is_slave = address < 32 && self.d_SLAVES >> address & 1 != 0;
        let error = match command {
            Command::Request(_) | Command::Mirror(_) if !is_slave => error::ADDRESS,
            Command::Request(_) => match self.request(layout, a_VALUES) {
                Ok(_) if self.b_TASK == 0 => error::REQUEST,
                // The request was checked, and no earlier one is in progress.
                Ok(request) => master.request(address, request).map_or(error::VALUES, |()| 0),
                Err(error) => error,
            },
            Command::Broadcast => match self.request(layout, a_VALUES) {
                Ok(request) => master.broadcast(layout, &request, setpoints).map_or(error::VALUES, |()| 0),
                Err(error) => error,
            },
            Command::Mirror(_) => {
                let data = layout.data(&Pkw::NONE, setpoints).unwrap_or_default();
                master.mirror(address, &data).map_or(error::VALUES, |()| 0)
            }
        };
        if error != 0 {
            self.end(error);
        }
    }

    /// Returns the parameter request of the inputs.
    fn request(&self, layout: Layout, a_VALUES: &USS_BMARRAY) -> Result<Request, u8> {
        if self.b_TASK == 0 {
            return Ok(Pkw::NONE);
        }
        if layout.pkw() == PkwWidth::None {
            return Err(error::NO_CHANNEL);
        }
        if self.b_TASK > 15 || self.u_NUMBER >= 32_000 {
            return Err(error::REQUEST);
        }
        let values = a_VALUES.get(..usize::from(self.u_VALUES)).ok_or(error::VALUES)?.to_vec();
        let (code, number, index) = (self.b_TASK, self.u_NUMBER, self.us_INDEX);
        Ok(Pkw { code, number, index, is_report: false, values })
    }

    /// Ends the command in progress.
    fn end(&mut self, error: u8) {
        self.internal.command = None;
        (self.x_BUSY, self.x_DONE, self.b_ERR) = (false, error == 0, error);
    }

    fn show(&mut self, event: MasterEvent, a_REPLY: &mut USS_BMARRAY) {
        match event {
            MasterEvent::Answered { reply, .. } => {
                let count = reply.values.len().min(a_REPLY.len());
                a_REPLY[..count].copy_from_slice(&reply.values[..count]);
                (self.b_REPLY, self.u_REPLY, self.d_REPLY) = (reply.code, count as u16, reply.double());
                self.end(0);
            }
            MasterEvent::Unanswered { .. } => self.end(error::NO_ANSWER),
            MasterEvent::Reported { address, report } => {
                self.u_REPORTS = self.u_REPORTS.wrapping_add(1);
                (self.b_REPORT, self.us_REPORT, self.u_REPORT) = (report.code, address, report.number);
                (self.us_REPORT_INDEX, self.d_REPORT) = (report.index, report.double());
            }
            MasterEvent::Failed { address, fault } => {
                self.u_FAULTS = self.u_FAULTS.wrapping_add(1);
                (self.b_FAULT, self.us_FAULT) = (number(fault), address);
            }
            MasterEvent::NotMirrored(_) => self.end(error::NO_ANSWER),
            MasterEvent::Mirrored(_) => self.end(0),
            MasterEvent::Lost(_) | MasterEvent::Returned(_) => {}
        }
    }
}
