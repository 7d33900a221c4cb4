//! The firmware of a module: a CANopen node with connectors.

use super::channels::{CHANNELS, Channels, Role};
use super::dictionary::{Entries, Guarding, PdoValues};
use crate::can::{Filter, Frame, Payload};
use crate::devices::Context;
use crate::devices::can_bus::{CanPort, Controller};
use crate::devices::canopen::emergency::{Cause, Errors};
use crate::devices::canopen::guard::NodeGuarding;
use crate::devices::canopen::nmt::{Command, State};
use crate::devices::canopen::records::NodeState;
use crate::devices::canopen::sdo::Server;
use crate::devices::cr201x::registers::{
    CHANNELS as AREA, CR201X_CHANNELS, FRONT_ANALOG_2, FRONT_ANALOG_4, FRONT_ANALOG_6, FRONT_ANALOG_8,
    FRONT_INPUTS, FRONT_OPEN, FRONT_OUTPUTS, FRONT_STATE,
};
use crate::memory::{FirmwareHeader, MemoryError, Segment, View};
use crate::snapshot_fields;
use embedded_can::{Frame as _, Id, StandardId};

/// Errors that the module reports: an open line, with the code that p. 44 defines for a CS0015, and missing
/// guarding.
const OPEN_LINE: Cause = Cause { code: 0x2100, register: 1 << 1 };
const NO_GUARDING: Cause = Cause { code: 0x8100, register: 1 << 4 };

/// Identifiers of the predefined connection set, to which the Node-ID is added (p. 38).
const EMERGENCY: u16 = 0x080;
const DIGITAL_INPUTS: u16 = 0x180;
const DIGITAL_OUTPUTS: u16 = 0x200;
const ANALOG_INPUTS: u16 = 0x280;
const ANALOG_OUTPUTS: u16 = 0x300;
const SDO_ANSWER: u16 = 0x580;
const SDO_REQUEST: u16 = 0x600;
const GUARDING: u16 = 0x700;
/// Identifiers for all nodes.
const NMT: u16 = 0x000;
const SYNC: u16 = 0x080;

pub(super) struct Module {
    node: u8,
    registers: View<CR201X_CHANNELS>,
    face: FirmwareHeader,
    /// Configuration that was last written. It is kept without supply.
    written: Channels,
    /// Configuration of the channels in force.
    channels: Channels,
    is_on: bool,
    state: State,
    /// State that the journal has last recorded.
    reported_state: State,
    guarding: Guarding,
    guarded: NodeGuarding,
    server: Server,
    errors: Errors,
    /// Digital inputs that were last sent; `None` if none were sent since the module became Operational.
    reported_inputs: Option<u8>,
    /// Outputs that wait for SYNC. `outputs` has the outputs in force.
    waiting: PdoValues,
    outputs: PdoValues,
    out: Vec<Frame>,
}

snapshot_fields!(Module {
    values: written, channels, is_on, state, reported_state, guarding, guarded, server, errors, reported_inputs, waiting, outputs, out;
    built: node, registers, face
});

impl Module {
    /// Creates a module with this configuration at delivery.
    pub(super) fn new(segment: &Segment, node: u8, channels: Channels) -> Result<Self, MemoryError> {
        Ok(Module {
            node,
            registers: segment.view(AREA)?,
            face: segment.firmware_header()?,
            written: channels,
            channels,
            is_on: false,
            state: State::Initialising,
            reported_state: State::Initialising,
            guarding: Guarding::default(),
            guarded: NodeGuarding::default(),
            server: Server::default(),
            errors: Errors::default(),
            reported_inputs: None,
            waiting: PdoValues::default(),
            outputs: PdoValues::default(),
            out: Vec::new(),
        })
    }

    fn send(&mut self, first: u16, data: &[u8]) {
        let id = StandardId::new(first + u16::from(self.node));
        let frame = id.zip(Payload::new(data)).map(|(id, payload)| Frame::new(id, payload));
        self.out.extend(frame);
    }

    /// Starts or restarts the module (D-451).
    fn start(&mut self, now: u64) {
        self.guarding = Guarding::default();
        self.server.reset();
        self.guarded.reset();
        self.errors.clear();
        self.set_life(now);
        self.send(GUARDING, &[State::Initialising.code()]);
        self.set_state(State::PreOperational);
    }

    fn set_state(&mut self, state: State) {
        let before = core::mem::replace(&mut self.state, state);
        // A master may have written a configuration in another state. It takes effect when the module enters
        // or leaves Pre-Operational (p. 79).
        if before == State::PreOperational || state == State::PreOperational {
            self.channels = self.written;
        }
        if before != state {
            (self.reported_inputs, self.waiting, self.outputs) =
                (None, PdoValues::default(), PdoValues::default());
        }
    }

    fn set_life(&mut self, now: u64) {
        let Guarding { guard_ms, life } = self.guarding;
        self.guarded.life.set_period(u64::from(guard_ms) * 1000 * u64::from(life), now);
    }

    fn command(&mut self, command: Command, now: u64) {
        match command {
            Command::Start => self.set_state(State::Operational),
            Command::Stop => self.set_state(State::Stopped),
            Command::EnterPreOperational => self.set_state(State::PreOperational),
            Command::ResetNode | Command::ResetCommunication => self.start(now),
        }
    }

    fn sdo(&mut self, data: &[u8], now: u64) {
        // A frame with a length other than eight bytes is not an SDO.
        let Ok(request) = data.try_into() else { return };
        let inputs = PdoValues { bits: self.digital_inputs(), words: self.words() };
        let entries = &mut Entries {
            inputs,
            outputs: self.outputs,
            node: self.node,
            error_register: self.errors.register(),
            guarding: &mut self.guarding,
            channels: &mut self.written,
        };
        if let Some(answer) = self.server.request(request, entries) {
            self.send(SDO_ANSWER, &answer);
        }
        if self.state == State::PreOperational {
            self.channels = self.written;
        }
        self.set_life(now);
    }

    fn word(&self, front: usize) -> u32 {
        self.face.requested().front[front].load()
    }

    /// Returns the connectors for which `is` is true, bit n for connector n + 1.
    fn connectors_where(&self, is: impl Fn(usize) -> bool) -> u8 {
        (0..CHANNELS).filter(|it| is(*it)).fold(0, |bits, it| bits | 1 << it)
    }

    fn digital_inputs(&self) -> u8 {
        self.word(FRONT_INPUTS) as u8
            & self.connectors_where(|it| self.channels.role(it) == Role::DigitalInput)
    }

    /// True if the line of an output is open.
    fn is_open(&self, connector: usize) -> bool {
        self.word(FRONT_OPEN) >> connector & 1 != 0
    }

    /// Returns the value that drives a connector.
    fn driven(&self, connector: usize) -> u16 {
        if self.state == State::Operational {
            self.channels.driven(connector, self.outputs.bits, self.outputs.words)
        } else {
            0
        }
    }

    /// Returns the measured values: the values of analog inputs, or the current of a pair. The current equals
    /// the set value unless the line is open.
    fn words(&self) -> [u16; 4] {
        let analog = [FRONT_ANALOG_2, FRONT_ANALOG_4, FRONT_ANALOG_6, FRONT_ANALOG_8];
        core::array::from_fn(|pair| {
            let [one, other] = [2 * pair, 2 * pair + 1];
            if self.channels.reports_current(pair) {
                let current = |it| if self.is_open(it) { 0 } else { self.driven(it) };
                current(one) + current(other)
            } else if self.channels.role(other) == Role::AnalogInput(pair) {
                self.word(analog[pair]) as u16
            } else {
                0
            }
        })
    }

    fn sync(&mut self) {
        if self.state != State::Operational {
            return;
        }
        self.outputs = self.waiting;
        if self.channels.has_words() {
            let words = self.words();
            self.send(ANALOG_INPUTS, &words.map(u16::to_le_bytes).concat());
        }
    }

    /// Stores the outputs of a PDO, which take effect with SYNC (p. 38). Outputs that the PDO does not
    /// contain keep their values.
    fn take_over(&mut self, id: u16, data: &[u8]) {
        if id == DIGITAL_OUTPUTS {
            self.waiting.bits = data.first().copied().unwrap_or(self.waiting.bits);
        } else {
            let words = data.as_chunks::<2>().0;
            self.waiting.words.iter_mut().zip(words).for_each(|(to, two)| *to = u16::from_le_bytes(*two));
        }
    }

    /// Updates registers, front panel, emergencies, journal and frames after any change.
    fn show(&mut self, ctx: &mut Context, controller: &mut Controller) {
        if !self.is_on {
            return;
        }
        if core::mem::replace(&mut self.reported_state, self.state) != self.state {
            ctx.report(NodeState { plc: ctx.origin.plc, to: self.state.code(), node: self.node });
        }
        if self.state == State::Operational && self.reported_inputs != Some(self.digital_inputs()) {
            let bits = self.digital_inputs();
            self.reported_inputs = Some(bits);
            self.send(DIGITAL_INPUTS, &[bits]);
        }
        let open = self.connectors_where(|it| self.is_open(it) && self.driven(it) != 0);
        self.errors.set(OPEN_LINE, (open != 0).then_some([open, 0, 0, 0, 0]));
        while self.state.has_sdo()
            && let Some(message) = self.errors.message()
        {
            self.send(EMERGENCY, &message);
        }
        self.show_registers();
        for frame in self.out.drain(..) {
            // If the controller's queue is full, the frame is lost.
            let _ = controller.send(frame);
        }
    }

    fn show_registers(&self) {
        let registers = &self.registers;
        registers.a_CHANNEL.iter().zip(self.channels.kinds).for_each(|(cell, kind)| cell.store(kind));
        registers.b_PWM_FRQ.store(self.channels.pwm_hz);
        let (bits, words) = (self.digital_inputs(), self.words());
        for connector in 0..CHANNELS {
            let pair = connector / 2;
            registers.a_INPUT[connector].store(match self.channels.role(connector) {
                Role::DigitalInput => u16::from(bits >> connector & 1),
                Role::AnalogInput(_) => words[pair],
                // The master reads the current of the pair at this input (p. 85).
                _ if self.channels.reports_current(pair) && !connector.is_multiple_of(2) => words[pair],
                _ => 0,
            });
            registers.a_OUTPUT[connector].store(self.driven(connector));
        }
        self.face.front[FRONT_OUTPUTS].store(self.connectors_where(|it| self.driven(it) != 0).into());
        self.face.front[FRONT_STATE].store(self.state.code().into());
    }
}

impl CanPort for Module {
    fn power_on(&mut self, ctx: &mut Context, controller: &mut Controller, _: u8) {
        let own = [DIGITAL_OUTPUTS, ANALOG_OUTPUTS, SDO_REQUEST, GUARDING]
            .map(|first| first + u16::from(self.node));
        let heard = own.into_iter().chain([NMT, SYNC]).filter_map(StandardId::new);
        controller.set_filters(heard.map(Filter::exactly));
        self.is_on = true;
        self.start(ctx.now);
        self.show(ctx, controller);
    }

    fn power_off(&mut self) {
        (self.is_on, self.state, self.reported_state) = (false, State::Initialising, State::Initialising);
        self.out.clear();
        [FRONT_STATE, FRONT_OUTPUTS].into_iter().for_each(|word| self.face.front[word].store(0));
    }

    fn look(&mut self, ctx: &mut Context, controller: &mut Controller) {
        self.show(ctx, controller);
    }

    fn received(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame) {
        let Id::Standard(id) = frame.id() else { return };
        let id = id.as_raw();
        match (id, id.saturating_sub(self.node.into()), frame.is_remote_frame()) {
            (NMT, ..) => {
                if let Some(command) = Command::parse(frame.data(), self.node) {
                    self.command(command, ctx.now);
                }
            }
            (SYNC, ..) => self.sync(),
            (_, GUARDING, true) => {
                let answer = self.guarded.asked(self.state, ctx.now);
                self.errors.set(NO_GUARDING, None);
                self.send(GUARDING, &[answer]);
            }
            (_, SDO_REQUEST, false) if self.state.has_sdo() => self.sdo(frame.data(), ctx.now),
            (_, first @ (DIGITAL_OUTPUTS | ANALOG_OUTPUTS), false) if self.state.has_pdo() => {
                self.take_over(first, frame.data());
            }
            _ => {}
        }
        self.show(ctx, controller);
    }

    fn next_time(&self) -> u64 {
        self.guarded.life.next_time()
    }

    fn due(&mut self, ctx: &mut Context, controller: &mut Controller) {
        if self.guarded.life.look(ctx.now) {
            self.errors.set(NO_GUARDING, Some([0; 5]));
        }
        self.show(ctx, controller);
    }
}
