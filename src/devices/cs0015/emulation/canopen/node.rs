//! The CANopen slave. It gets frames and times, and returns frames to be sent (p. 38-44).

mod as_master;

use super::communication::{Communication, Factory, Identifiers, PDOS, Pdo, PdoConfig, PdoDirection};
use super::diagnosis::Diagnosis;
use super::dictionary::Entries;
use super::direct::{Direct, ReceivedMessage};
use crate::can::{Filter, Frame, Payload};
use crate::devices::canopen::emergency::{Cause, Errors};
use crate::devices::canopen::guard::NodeGuarding;
use crate::devices::canopen::nmt::State;
use crate::devices::canopen::pdo::{Receive, Transmit};
use crate::devices::canopen::sdo::Server;
use crate::devices::canopen::supervision::Supervision;
use crate::devices::cs0015::emulation::ram::Registers;
use crate::devices::cs0015::registers::values::bool;
use crate::snapshot_fields;
use embedded_can::{Frame as _, Id, StandardId};

/// Errors that the node reports, and their bits of the error register (p. 44).
const GENERAL: Cause = Cause { code: 0x1000, register: 1 << 0 };
const NO_GUARDING: Cause = Cause { code: 0x8100, register: 1 << 4 };
const NO_SYNC: Cause = Cause { code: 0x8200, register: 1 << 4 };
/// Bits of byte 3 of the SYNC error. They name its causes (p. 44).
const CAN_BIT: u8 = 1 << 0;
const SYNC_BIT: u8 = 1 << 1;

/// Boot-up message of the node (D-418).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BootUp {
    /// The node sends no message.
    #[default]
    None,
    /// An emergency object without data.
    EmptyEmergency,
    /// A frame with a single data byte 0 and the identifier 700h + Node-ID.
    Guarding,
}

/// Settings that a program gives to `NMS_GUARDING_CONFIG` (p. 46). 0 switches a supervision off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GuardingConfig {
    /// Guard time in ms (GUARDTIME).
    pub guard_ms: u16,
    /// LIFETIME: number of consecutive requests that may be missing.
    pub life: u8,
    /// CYCLEPERIOD: time between two SYNC objects in ms.
    pub cycle_ms: u16,
}

/// The device as a CANopen slave.
pub(crate) struct Node {
    pub registers: Registers,
    /// The program's direct use of CAN.
    direct: Direct,
    communication: Communication,
    boot_up: BootUp,
    identifiers: Identifiers,
    state: State,
    guarded: NodeGuarding,
    sync: Supervision,
    server: Server,
    errors: Errors,
    receive: [Receive; PDOS],
    transmit: [Transmit; PDOS],
    /// True if a SYNC object has come since the last cycle of the program.
    pub has_sync: bool,
    /// True if the filters for received frames must be set again, because an identifier has changed.
    has_moved: bool,
    /// True if the device has errors of CAN.
    has_can_error: bool,
    /// True if the node receives all frames.
    is_open: bool,
    /// Frames to be sent.
    out: Vec<Frame>,
}

snapshot_fields!(Node {
    values: direct, identifiers, state, guarded, sync, server, errors, receive, transmit, has_sync, has_moved,
        has_can_error, is_open, out;
    parts: communication;
    built: registers, boot_up
});

impl Node {
    pub(crate) fn new(registers: Registers, factory: Factory, boot_up: BootUp) -> Self {
        Node {
            registers,
            direct: Direct::default(),
            communication: Communication::new(factory),
            boot_up,
            identifiers: Identifiers::default(),
            state: State::Initialising,
            guarded: NodeGuarding::default(),
            sync: Supervision::default(),
            server: Server::default(),
            errors: Errors::default(),
            receive: Default::default(),
            transmit: Default::default(),
            has_sync: false,
            has_moved: false,
            has_can_error: false,
            is_open: false,
            out: Vec::new(),
        }
    }

    /// Handles power-on: the device is not a CANopen node yet.
    pub(crate) fn power_on(&mut self) {
        self.communication.power_on(&self.registers);
        self.forget_identifiers();
        self.fall_silent();
    }

    /// Ends the CANopen node until the next start.
    pub(crate) fn fall_silent(&mut self) {
        self.state = State::Initialising;
        self.errors.clear();
        self.guarded.reset();
        self.sync.stop();
        self.has_sync = false;
        self.out.clear();
    }

    pub(crate) fn state(&self) -> State {
        self.state
    }

    /// Returns the Node-ID in force.
    pub(crate) fn number(&self) -> u8 {
        self.communication.node()
    }

    /// Registers an identifier for the program. The program fetches the messages with this identifier (p.
    /// 33).
    pub(crate) fn register_identifier(&mut self, id: StandardId) {
        self.has_moved |= self.direct.configure(id);
    }

    /// Removes and returns a message with this identifier. With `is_to_clear`, discards all messages with it.
    /// Returns `None` if the identifier is not registered.
    pub(crate) fn fetch(&mut self, id: StandardId, is_to_clear: bool) -> Option<ReceivedMessage> {
        self.direct.take(id, is_to_clear)
    }

    /// Removes the identifiers that the program has registered (section 11.1).
    pub(crate) fn forget_identifiers(&mut self) {
        self.direct.clear();
        self.has_moved = true;
    }

    /// Keeps a received frame if the program has registered its identifier. Returns `false` if the queue is full and
    /// the frame is lost.
    pub(crate) fn keep(&mut self, frame: &Frame) -> bool {
        self.direct.received(frame)
    }

    /// Records the program's request for a PDO, counted from 0. The caller must then call [`Node::restart`].
    pub(crate) fn ask_pdo(&mut self, way: PdoDirection, pdo: usize, config: PdoConfig) {
        self.communication.ask(way, pdo, config);
    }

    /// True if an identifier is the default of a PDO, counted from 0.
    pub(crate) fn is_predefined(&self, way: PdoDirection, pdo: usize, id: u16) -> bool {
        self.communication.is_predefined(way, pdo, id)
    }

    /// Sets the Node-ID for the program, 1 to 127. It takes effect at once and is stored (p. 45).
    pub(crate) fn set_number(&mut self, number: u8, now: u64) {
        for entry in 0..2 {
            self.communication.enter(&self.registers, entry, number);
        }
        self.refresh(now);
    }

    /// Sets the bit rate for the program, in kbit/s. It is stored (p. 31).
    pub(crate) fn set_rate(&mut self, kbit_s: u16) {
        self.communication.set_rate(&self.registers, kbit_s);
    }

    /// Sends a transmit PDO, counted from 0, once more (p. 51).
    pub(crate) fn refresh_pdo(&mut self, pdo: usize) {
        if self.state.has_pdo() {
            self.send_pdo(pdo, self.registers.transmit(pdo));
        }
    }

    /// Configures for the program how the node supervises its master. The settings are stored (p. 155).
    pub(crate) fn set_guarding(&mut self, config: &GuardingConfig, now: u64) {
        let parameters = &self.registers.parameters;
        parameters.w_GUARD_TIME.store(config.guard_ms);
        parameters.b_LIFE_TIME_FACTOR.store(config.life);
        parameters.d_COMMUNICATION_CYCLE.store(u32::from(config.cycle_ms) * 1000);
        self.refresh(now);
    }

    /// Starts or restarts the node: values that are not stored are reset, guarding restarts, and the node enters
    /// `state`.
    pub(crate) fn restart(&mut self, state: State, now: u64) {
        self.state = State::Initialising;
        self.communication.reset();
        self.server.reset();
        self.guarded.reset();
        self.sync.stop();
        self.errors.set(NO_GUARDING, None);
        self.set_sync_error();
        self.refresh(now);
        let boot_up = match self.boot_up {
            BootUp::None => None,
            BootUp::EmptyEmergency => self.identifiers.emergency.map(|id| (id, &[][..])),
            BootUp::Guarding => self.identifiers.guarding.map(|id| (id, &[0][..])),
        };
        if let Some((id, data)) = boot_up {
            self.send(id, data);
        }
        self.set_state(state, now);
    }

    /// Changes the state, for the master or the controller.
    pub(crate) fn set_state(&mut self, state: State, now: u64) {
        let before = core::mem::replace(&mut self.state, state);
        if state.has_pdo() && !before.has_pdo() {
            self.communication.take_over_kinds();
            self.receive.iter_mut().for_each(Receive::start);
            for (pdo, transmit) in self.transmit.iter_mut().enumerate() {
                transmit.start(self.registers.transmit(pdo));
            }
            self.sync.start(now);
        }
        if !state.has_pdo() && before.has_pdo() {
            self.sync.stop();
            self.set_sync_error();
        }
        self.send_emergencies();
    }

    /// Updates all values that depend on entries which an SDO may have changed.
    fn refresh(&mut self, now: u64) {
        let identifiers = self.communication.identifiers(&self.registers);
        if self.identifiers != identifiers {
            self.identifiers = identifiers;
            self.has_moved = true;
        }
        let parameters = &self.registers.parameters;
        let guard_us = u64::from(parameters.w_GUARD_TIME.load()) * 1000;
        let life_us = guard_us * u64::from(parameters.b_LIFE_TIME_FACTOR.load());
        self.guarded.life.set_period(life_us, now);
        // The effective resolution is 1 ms (p. 156).
        let cycle_us = u64::from(parameters.d_COMMUNICATION_CYCLE.load()).next_multiple_of(1000);
        self.sync.set_period(cycle_us, now);
        self.errors.set(NO_GUARDING, self.guarded.life.is_missing().then_some([0; 5]));
        self.set_sync_error();
    }

    /// Handles a received frame other than network management.
    pub(crate) fn received(&mut self, now: u64, frame: &Frame) {
        let Id::Standard(id) = frame.id() else { return };
        if self.state == State::Initialising {
            return;
        }
        let is = |own: Option<StandardId>| own == Some(id);
        if frame.is_remote_frame() {
            self.asked(now, id);
        } else if is(self.identifiers.sync) {
            self.sync_has_come(now);
        } else if is(self.identifiers.sdo_request) && self.state.has_sdo() {
            self.sdo(now, frame.data());
        } else if self.state.has_pdo()
            && let Some(pdo) = self.identifiers.receive.iter().position(|own| is(*own))
        {
            let mut value = self.registers.received(pdo);
            value.iter_mut().zip(frame.data()).for_each(|(to, from)| *to = *from);
            let kind = self.communication.pdo(PdoDirection::Receive, pdo).kind;
            if let Some(value) = self.receive[pdo].received(kind, value) {
                self.registers.receive(pdo, value);
            }
        }
        self.send_emergencies();
    }

    /// Answers a remote frame. It requests the state of the node (sent by the master), or a PDO (sent by any
    /// station).
    fn asked(&mut self, now: u64, id: StandardId) {
        if self.identifiers.guarding == Some(id) {
            let answer = self.guarded.asked(self.state, now);
            self.errors.set(NO_GUARDING, None);
            self.send(id, &[answer]);
        }
        let of = |own: &Option<StandardId>| *own == Some(id);
        if self.state.has_pdo()
            && let Some(pdo) = self.identifiers.transmit.iter().position(of)
            && self.identifiers.on_request[pdo]
        {
            self.send(id, &self.registers.transmit(pdo));
        }
    }

    fn sync_has_come(&mut self, now: u64) {
        self.has_sync = true;
        if !self.state.has_pdo() {
            return;
        }
        self.sync.start(now);
        self.set_sync_error();
        for pdo in 0..PDOS {
            let kind = self.communication.pdo(PdoDirection::Receive, pdo).kind;
            if let Some(value) = self.receive[pdo].sync(kind) {
                self.registers.receive(pdo, value);
            }
            let (kind, value) =
                (self.communication.pdo(PdoDirection::Transmit, pdo).kind, self.registers.transmit(pdo));
            if self.transmit[pdo].sync(kind, value) {
                self.send_pdo(pdo, value);
            }
        }
    }

    fn sdo(&mut self, now: u64, data: &[u8]) {
        // A frame with a length other than eight bytes is not an SDO.
        let Ok(request) = data.try_into() else { return };
        let answer_id = self.identifiers.sdo_answer;
        let entries = &mut Entries {
            error_register: self.errors.register(),
            communication: &mut self.communication,
            registers: &self.registers,
        };
        let answer = self.server.request(request, entries);
        // If a client changes the Node-ID, it expects the answer with the identifier before the change
        // (D-417).
        if let (Some(answer), Some(id)) = (answer, answer_id) {
            self.send(id, &answer);
        }
        self.refresh(now);
    }

    /// Handles the end of a program cycle: checks the PDOs for new data.
    pub(crate) fn cycle(&mut self, now: u64) {
        if !self.state.has_pdo() {
            return;
        }
        for pdo in 0..PDOS {
            let value = self.registers.transmit(pdo);
            let &Pdo { kind, inhibit_us, .. } = self.communication.pdo(PdoDirection::Transmit, pdo);
            if self.transmit[pdo].look(kind, value, inhibit_us, now) {
                self.send_pdo(pdo, value);
            }
        }
    }

    /// Sets the error for missing SYNC and for errors of CAN, which have one code (p. 44).
    fn set_sync_error(&mut self) {
        let can = if self.has_can_error { CAN_BIT } else { 0 };
        let bits = can | if self.sync.is_missing() { SYNC_BIT } else { 0 };
        self.errors.set(NO_SYNC, (bits != 0).then_some([bits, 0, 0, 0, 0]));
    }

    /// Sets the errors of the hardware, with bytes 3 to 7 of each emergency. Also sets whether `CAN_ERROR`
    /// and `ERROR` are TRUE.
    pub(crate) fn set_errors(&mut self, hardware: &Diagnosis, has_can_error: bool, is_general: bool) {
        self.has_can_error = has_can_error;
        self.set_sync_error();
        for (cause, data) in hardware.errors() {
            self.errors.set(cause, data);
        }
        // Causes are reported before their consequences.
        self.send_emergencies();
        self.errors.set(GENERAL, is_general.then_some([0; 5]));
        self.send_emergencies();
    }

    /// Returns the time of the next event of the node itself; `u64::MAX` if there is none.
    pub(crate) fn next_time(&self) -> u64 {
        let of_pdos = self.transmit.iter().map(Transmit::next_time).fold(u64::MAX, u64::min);
        let of_pdos = if self.state.has_pdo() { of_pdos } else { u64::MAX };
        of_pdos.min(self.guarded.life.next_time()).min(self.sync.next_time())
    }

    /// Handles the due events.
    pub(crate) fn due(&mut self, now: u64) {
        if self.guarded.life.look(now) {
            self.registers.flags.COP_GUARDFAIL_ERROR.store(bool::TRUE);
            self.errors.set(NO_GUARDING, Some([0; 5]));
        }
        if self.sync.look(now) {
            self.registers.flags.COP_SYNCFAIL_ERROR.store(bool::TRUE);
            self.set_sync_error();
        }
        if self.state.has_pdo() && self.transmit.iter().any(|pdo| pdo.next_time() <= now) {
            self.cycle(now);
        }
        self.send_emergencies();
    }

    /// Sends the waiting emergencies, if the state permits it.
    fn send_emergencies(&mut self) {
        while self.state.has_sdo()
            && let Some(message) = self.errors.message()
        {
            if let Some(id) = self.identifiers.emergency {
                self.send(id, &message);
            }
        }
    }

    fn send_pdo(&mut self, pdo: usize, value: [u8; 8]) {
        if let Some(id) = self.identifiers.transmit[pdo] {
            self.send(id, &value);
        }
    }

    /// Returns the number of frames that were not given to the controller yet.
    pub(crate) fn to_send(&self) -> usize {
        self.out.len()
    }

    /// Sends a frame with up to 8 bytes of data.
    pub(crate) fn send(&mut self, id: StandardId, data: &[u8]) {
        self.out.extend(Payload::new(data).map(|payload| Frame::new(id, payload)));
    }

    /// Takes the frames to send.
    pub(crate) fn take_frames(&mut self) -> Vec<Frame> {
        core::mem::take(&mut self.out)
    }

    /// Returns the filters for received frames, if they have changed.
    pub(crate) fn take_filters(&mut self) -> Option<Vec<Filter>> {
        if !core::mem::take(&mut self.has_moved) {
            return None;
        }
        if self.is_open {
            return Some(Vec::new());
        }
        let Identifiers { sync, guarding, sdo_request, receive, transmit, .. } = self.identifiers;
        let own = [Some(StandardId::ZERO), sync, guarding, sdo_request];
        let own = own.into_iter().chain(receive).chain(transmit).flatten().chain(self.direct.ids());
        Some(own.map(Filter::exactly).collect())
    }
}
