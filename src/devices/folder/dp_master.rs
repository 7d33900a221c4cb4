//! The PROFIBUS port of a device in a folder: a DP master, which exchanges the process image of the device with its slaves.
//!
//! The master sends one request to each slave in a cycle. A slave gets diagnosis, parameters and configuration first, then data.

use super::card::Place;
use crate::devices::Context;
use crate::devices::profibus_bus::{Presence, ProfibusPort, Station};
use crate::journal::Register;
use crate::layout::Width;
use crate::memory::Segment;
use crate::profibus::{Answer, Frame, FunctionCode, MAX_OCTETS, Request, Telegram};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::ops::Range;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Address of the master.
pub(super) const ADDRESS: u8 = 1;
/// Service access points: of the master, and of a slave for diagnosis, parameters and configuration.
const MASTER_SAP: u8 = 62;
const DIAGNOSIS_SAP: u8 = 60;
const PARAMETERS_SAP: u8 = 61;
const CONFIGURATION_SAP: u8 = 62;
/// Maximum number of transmissions of a request.
const TRIES: u8 = 2;
/// Shortest time between the begins of two cycles, in microseconds.
const CYCLE_US: u64 = 1000;
/// Longest time in microseconds for which a slave may say that it is not ready, although it has acknowledged its
/// configuration (D-819).
const NOT_READY_US: u64 = 3_000_000;
/// Bits of the first octet of a diagnosis: the slave is not ready; its configuration or its parameters are wrong.
const NOT_READY: u8 = 0x02;
const WRONG: u8 = 0x44;
/// Bit of the second octet of a diagnosis: the slave needs parameters.
const NEEDS_PARAMETERS: u8 = 0x01;

/// The registers of a process image, as a table of the device describes them. Offsets are in the image of the device.
#[derive(Debug)]
pub(super) struct ProcessImage {
    pub(super) outputs: Range<u32>,
    pub(super) inputs: Range<u32>,
    /// The master exchanges data while this register is not 0.
    pub(super) run: Place,
    /// Number of slaves in the plant.
    pub(super) slaves: Place,
    /// Number of slaves that exchange data.
    pub(super) active: Place,
}

/// A slave of the master, as the plant file describes it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a slave: a table with its settings")]
pub(super) struct DpSlave {
    pub(super) address: u8,
    /// Data of the telegram Set_Prm.
    pub(super) parameters: Vec<u8>,
    /// Data of the telegram Chk_Cfg.
    pub(super) configuration: Vec<u8>,
    /// Number of output bytes.
    #[serde(default)]
    pub(super) outputs: u8,
    /// Number of input bytes.
    #[serde(default)]
    pub(super) inputs: u8,
}

/// The next request to a slave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Step {
    /// Is the slave present?
    #[default]
    Find,
    Parameters,
    Configuration,
    /// Has the slave accepted its parameters and its configuration?
    Accepted,
    Data,
    /// The slave has announced a diagnosis.
    Diagnosis,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct SlaveState {
    step: Step,
    /// Frame count bit of the last request; `None` if the next request counts as the first one.
    fcb: Option<bool>,
    is_active: bool,
    /// Time in microseconds of the first diagnosis after the configuration, if the slave was not ready then.
    not_ready_since: Option<u64>,
}

/// A request that the slave has not answered.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Pending {
    frame: Frame,
    tries: u8,
    is_sent: bool,
}

/// The answer to a request.
enum Reply<'a> {
    Receipt,
    Data { octets: &'a [u8], has_diagnosis: bool },
    Other,
    None,
}

pub(super) struct DpMaster {
    segment: Segment,
    image: &'static ProcessImage,
    slaves: Arc<[DpSlave]>,
    states: Vec<SlaveState>,
    /// Index of the slave that the master asks.
    turn: usize,
    pending: Option<Pending>,
    /// Begin of the present cycle in microseconds.
    begun: u64,
    /// Begin of the next cycle in microseconds; `u64::MAX` during a cycle and while the master is off.
    next: u64,
    is_running: bool,
}

impl SnapshotFields for DpMaster {
    fn save(&self, to: &mut Saving) {
        let Self { segment: _, image: _, slaves: _, states, turn, pending, begun, next, is_running } = self;
        to.value(&(states, *turn as u64, pending, begun, next, is_running));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let turn: u64;
        (self.states, turn, self.pending, self.begun, self.next, self.is_running) = from.value()?;
        from.check(self.states.len() == self.slaves.len(), "number of DP slaves")?;
        self.turn = usize::try_from(turn).unwrap_or(usize::MAX);
        from.check(self.pending.is_none() || self.turn < self.slaves.len(), "number of the DP slave")
    }
}

impl DpMaster {
    pub(super) fn new(segment: Segment, image: &'static ProcessImage, slaves: Arc<[DpSlave]>) -> Self {
        let states = vec![SlaveState::default(); slaves.len()];
        DpMaster {
            segment,
            image,
            slaves,
            states,
            turn: 0,
            pending: None,
            begun: 0,
            next: u64::MAX,
            is_running: false,
        }
    }

    fn load(&self, place: Place) -> u32 {
        self.segment.load(place.offset, place.width).unwrap_or(0)
    }

    /// Shows a number in a register of the device, and records a change.
    fn show(&self, ctx: &mut Context, place: Place, number: usize) {
        let to = (number as u32).min(place.mask());
        let from = self.load(place);
        if from != to && self.segment.store(place.offset, place.width, to).is_ok() {
            ctx.report(Register { origin: ctx.origin, offset: place.offset, from, to });
        }
    }

    /// Returns the bytes of slave `index` in an image that begins with the bytes of the first slave.
    fn part(&self, image: &Range<u32>, index: usize, length: impl Fn(&DpSlave) -> u8) -> Range<u32> {
        let before: u32 = self.slaves.iter().take(index).map(|slave| u32::from(length(slave))).sum();
        let own = self.slaves.get(index).map_or(0, |slave| u32::from(length(slave)));
        image.start + before..image.start + before + own
    }

    /// Sends the request to the slave whose turn it is. Ends the cycle after the last slave.
    fn ask(&mut self, now: u64, station: &mut Station) {
        let (Some(slave), Some(state)) = (self.slaves.get(self.turn), self.states.get(self.turn)) else {
            self.next = (self.begun + CYCLE_US).max(now + 1);
            return;
        };
        let (sap, data) = match state.step {
            Step::Find | Step::Accepted | Step::Diagnosis => (Some(DIAGNOSIS_SAP), Vec::new()),
            Step::Parameters => (Some(PARAMETERS_SAP), slave.parameters.clone()),
            Step::Configuration => (Some(CONFIGURATION_SAP), slave.configuration.clone()),
            Step::Data => {
                let outputs = self.part(&self.image.outputs, self.turn, |slave| slave.outputs);
                let byte = |at| self.segment.load(at, Width::Byte).unwrap_or(0) as u8;
                (None, outputs.map(byte).collect())
            }
        };
        // The first request to a slave has a frame count bit that does not count.
        let (fcb, fcv) = (state.fcb.is_none_or(|last| !last), state.fcb.is_some());
        let fc = FunctionCode::Request { request: Request::Srd, fcb, fcv, is_high: true }.octet();
        let ssap = sap.map(|_| MASTER_SAP);
        let frame = Frame { da: slave.address, sa: ADDRESS, fc, dsap: sap, ssap, data };
        station.request(&Telegram::Frame(frame.clone()));
        self.pending = Some(Pending { frame, tries: 1, is_sent: false });
    }

    /// Handles the answer of the slave, and asks the next slave.
    fn finish(&mut self, ctx: &mut Context, station: &mut Station, reply: &Reply<'_>) {
        station.set_alarm(None);
        station.withdraw();
        let Some(Pending { frame, .. }) = self.pending.take() else { return };
        if let Some(mut state) = self.states.get(self.turn).copied() {
            let FunctionCode::Request { fcb, .. } = FunctionCode::parse(frame.fc) else { return };
            state.fcb = (!matches!(reply, Reply::None)).then_some(fcb);
            self.advance(ctx.now, &mut state, reply);
            self.states[self.turn] = state;
            self.show(ctx, self.image.active, self.states.iter().filter(|state| state.is_active).count());
        }
        self.turn += 1;
        self.ask(ctx.now, station);
    }

    /// Finds the next request to the slave.
    fn advance(&self, now: u64, state: &mut SlaveState, reply: &Reply<'_>) {
        let since = state.not_ready_since.take().unwrap_or(now);
        let inputs = self.part(&self.image.inputs, self.turn, |slave| slave.inputs);
        let before = state.step;
        state.step = match (before, reply) {
            (Step::Find, Reply::Data { .. }) => Step::Parameters,
            (Step::Parameters, Reply::Receipt) => Step::Configuration,
            (Step::Configuration, Reply::Receipt) => Step::Accepted,
            (Step::Accepted | Step::Diagnosis, Reply::Data { octets, .. }) => match **octets {
                [first, second, ..] if first & WRONG == 0 && second & NEEDS_PARAMETERS == 0 => {
                    match (first & NOT_READY == 0, before) {
                        (true, _) => Step::Data,
                        // A slave that has not received the configuration, but has repeated an earlier receipt, is
                        // never ready.
                        (false, Step::Accepted) if now.saturating_sub(since) < NOT_READY_US => {
                            state.not_ready_since = Some(since);
                            Step::Accepted
                        }
                        (false, _) => Step::Find,
                    }
                }
                _ => Step::Find,
            },
            (Step::Data, Reply::Receipt) if inputs.is_empty() => Step::Data,
            (Step::Data, Reply::Data { octets, has_diagnosis }) if octets.len() == inputs.len() => {
                for (at, octet) in inputs.zip(octets.iter()) {
                    let _ = self.segment.store(at, Width::Byte, u32::from(*octet));
                }
                if *has_diagnosis { Step::Diagnosis } else { Step::Data }
            }
            (_, Reply::None | Reply::Other | Reply::Receipt | Reply::Data { .. }) => Step::Find,
        };
        state.is_active = match state.step {
            // The slave is active after the first exchange of data.
            Step::Data => before == Step::Data || state.is_active,
            Step::Diagnosis => true,
            Step::Find | Step::Parameters | Step::Configuration | Step::Accepted => false,
        };
    }

    fn begin(&mut self, now: u64, station: &mut Station) {
        (self.begun, self.next, self.turn) = (now, u64::MAX, 0);
        self.ask(now, station);
    }

    fn stop(&mut self) {
        self.states.fill(SlaveState::default());
        (self.pending, self.next, self.is_running) = (None, u64::MAX, false);
    }
}

impl ProfibusPort for DpMaster {
    fn power_on(&mut self, ctx: &mut Context, station: &mut Station) {
        self.stop();
        station.set_alarm(None);
        self.show(ctx, self.image.slaves, self.slaves.len());
    }

    fn power_off(&mut self) {
        self.stop();
    }

    /// The master answers no requests.
    fn presence(&self) -> Option<Presence> {
        let does = if self.is_running { "exchange" } else { "stopped" };
        (!self.slaves.is_empty()).then_some(Presence { address: ADDRESS, does, answers: false })
    }

    fn look(&mut self, ctx: &mut Context, station: &mut Station) {
        let is_on = self.load(self.image.run) != 0 && !self.slaves.is_empty();
        if is_on == self.is_running {
            return;
        }
        self.stop();
        station.set_alarm(None);
        station.withdraw();
        self.show(ctx, self.image.active, 0);
        if is_on {
            self.is_running = true;
            self.begin(ctx.now, station);
        }
    }

    fn sent(&mut self, _: &mut Context, station: &mut Station) {
        let Some(pending) = &mut self.pending else { return };
        pending.is_sent = true;
        station.set_alarm(Some(station.now() + station.slot_bits() + Telegram::bits(MAX_OCTETS + 11)));
    }

    fn heard(&mut self, ctx: &mut Context, station: &mut Station, telegram: &Telegram) {
        let Some(pending) = self.pending.as_ref().filter(|pending| pending.is_sent) else { return };
        let octets;
        let reply = match telegram {
            Telegram::ShortAck => Reply::Receipt,
            Telegram::Frame(frame) if frame.da == ADDRESS && frame.sa == pending.frame.da => {
                octets = &frame.data;
                match FunctionCode::parse(frame.fc) {
                    FunctionCode::Answer(Answer::Low) => Reply::Data { octets, has_diagnosis: false },
                    FunctionCode::Answer(Answer::High) => Reply::Data { octets, has_diagnosis: true },
                    _ => Reply::Other,
                }
            }
            _ => return,
        };
        self.finish(ctx, station, &reply);
    }

    /// The time for the answer is over.
    fn alarm(&mut self, ctx: &mut Context, station: &mut Station) {
        match &mut self.pending {
            Some(pending) if pending.tries < TRIES => {
                (pending.tries, pending.is_sent) = (pending.tries + 1, false);
                station.request(&Telegram::Frame(pending.frame.clone()));
            }
            Some(_) => self.finish(ctx, station, &Reply::None),
            None => {}
        }
    }

    fn next_time(&self) -> u64 {
        self.next
    }

    fn due(&mut self, ctx: &mut Context, station: &mut Station) {
        if ctx.now >= self.next {
            self.begin(ctx.now, station);
        }
    }
}
