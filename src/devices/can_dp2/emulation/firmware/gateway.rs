//! The gateway on CAN: converts outputs to frames and frames to inputs, and starts the CAN side (p. 13, 28-49).
//!
//! Both ports share the gateway. The DP slave reports each data exchange to the gateway. The CAN port reports
//! each frame and the time, and takes the frames to send from it.

use super::modules::{Configuration, Module, ModuleFunction, WINDOW};
use super::pages::Pages;
use super::parameters::{Parameters, Role};
use super::ram::Registers;
use super::window::{Order, Window};
use crate::can::{ExtendedId, Filter, Frame, Id, Payload, StandardId};
use crate::devices::can_dp2::registers::values::{bus_state, can_state, page_state};
use crate::devices::canopen::nmt::Command;
use crate::snapshot_fields;
use embedded_can::Frame as _;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Identifier of SYNC objects (p. 87). A slave adds its own number to this identifier for its boot-up message (p. 29).
const SYNC: u16 = 0x80;

/// Maximum number of frames that wait for room in the controller (D-390).
const WAITING: usize = 256;

mod paging;
mod start;

/// Settings taken over when data exchange began.
#[derive(Serialize, Deserialize)]
struct Setup {
    parameters: Parameters,
    configuration: Configuration,
    /// Outputs at the last transmission. While the gateway sends nothing, the outputs at the last moment at
    /// which it would have sent them.
    outputs: Vec<u8>,
    /// Time of the next transmission of each module, in us.
    cycles: Vec<Option<u64>>,
}

/// The CAN side of the gateway.
pub(in crate::devices::can_dp2::emulation) struct Gateway {
    registers: Registers,
    /// Time of power-on in us, from which the wake-up time counts (p. 29).
    on_since: u64,
    setup: Option<Setup>,
    /// State of the gateway, as in register `can_state`.
    state: u8,
    /// True if a data exchange has brought outputs since the configuration. Before the first outputs (p. 30; D-675) and
    /// after the end of data exchange (D-386) the gateway has no data to send.
    has_outputs: bool,
    /// True if the configuration is good, and data exchange has not ended since.
    is_configured: bool,
    wake_at: Option<u64>,
    /// Time of the next SYNC object, in us.
    sync_at: Option<u64>,
    /// True if a SYNC object waits until all frames before it have been sent (p. 44).
    sync_waits: bool,
    window: Window,
    pages: Option<Pages>,
    frames: VecDeque<Frame>,
    /// True if the CAN controller must discard the frames that it has not sent yet.
    is_emptied: bool,
    /// True if the settings of the controller have changed.
    is_new: bool,
    /// State of the CAN bus, as in the diagnosis.
    bus: u8,
    irq_lost: u8,
    msg_lost: u8,
    /// True if the diagnosis has changed since the DP slave last read it.
    has_news: bool,
}

snapshot_fields!(Gateway {
    values: on_since, setup, state, has_outputs, is_configured, wake_at, sync_at, sync_waits, window, pages, frames, is_emptied,
        is_new, bus, irq_lost, msg_lost, has_news;
    built: registers
});

impl Gateway {
    pub(in crate::devices::can_dp2::emulation) fn new(registers: Registers) -> Self {
        Gateway {
            registers,
            on_since: 0,
            setup: None,
            state: can_state::OFF,
            has_outputs: false,
            is_configured: false,
            wake_at: None,
            sync_at: None,
            sync_waits: false,
            window: Window::default(),
            pages: None,
            frames: VecDeque::new(),
            is_emptied: false,
            is_new: false,
            bus: bus_state::OK,
            irq_lost: 0,
            msg_lost: 0,
            has_news: false,
        }
    }

    pub(in crate::devices::can_dp2::emulation) fn power_on(&mut self, now: u64) {
        self.power_off();
        self.on_since = now;
    }

    pub(in crate::devices::can_dp2::emulation) fn power_off(&mut self) {
        self.end();
        (self.setup, self.state) = (None, can_state::OFF);
        (self.window, self.pages) = (Window::default(), None);
        (self.is_new, self.bus, self.irq_lost, self.msg_lost, self.has_news) =
            (false, bus_state::OK, 0, 0, false);
        self.show();
    }

    /// Returns the three octets of the diagnosis about CAN: state, IRQ_LOST, MSG_LOST (p. 20-21).
    pub(in crate::devices::can_dp2::emulation) fn diagnosis(&self) -> [u8; 3] {
        [self.bus, self.irq_lost, self.msg_lost]
    }

    /// True if [`diagnosis`](Self::diagnosis) has changed since [`take_news`](Self::take_news).
    pub(in crate::devices::can_dp2::emulation) fn has_news(&self) -> bool {
        self.has_news
    }

    /// True if [`diagnosis`](Self::diagnosis) has changed since the last call.
    pub(in crate::devices::can_dp2::emulation) fn take_news(&mut self) -> bool {
        core::mem::take(&mut self.has_news)
    }

    /// Returns the state, as in register `can_state`.
    pub(in crate::devices::can_dp2::emulation) fn state(&self) -> u8 {
        self.state
    }

    /// Returns the state of the CAN bus.
    pub(in crate::devices::can_dp2::emulation) fn bus(&self) -> u8 {
        self.bus
    }

    /// Sets the state of the CAN bus.
    pub(in crate::devices::can_dp2::emulation) fn set_bus(&mut self, bus: u8) {
        self.has_news |= core::mem::replace(&mut self.bus, bus) != bus;
        self.show();
    }

    /// The controller has lost a frame (p. 20).
    pub(in crate::devices::can_dp2::emulation) fn lost_frame(&mut self) {
        self.irq_lost = self.irq_lost.saturating_add(1);
        self.has_news = true;
        self.show();
    }

    fn has_room(&self) -> bool {
        self.frames.len() < WAITING
    }

    /// Queues a frame to send. If the queue is full, the frame is lost.
    fn push(&mut self, frame: Frame) {
        if self.has_room() {
            self.frames.push_back(frame);
        } else {
            self.lost_frame();
        }
    }

    /// Begins data exchange with these parameters and modules. The gateway sends no frames of outputs before
    /// the first outputs have arrived.
    pub(in crate::devices::can_dp2::emulation) fn begin(
        &mut self,
        parameters: &Parameters,
        configuration: &Configuration,
        now: u64,
    ) {
        self.end();
        (self.window, self.pages) = (Window::default(), configuration.pages());
        (self.is_new, self.is_configured) = (true, true);
        let setup = Setup {
            parameters: parameters.clone(),
            configuration: configuration.clone(),
            outputs: vec![0; configuration.outputs],
            cycles: vec![None; configuration.modules.len()],
        };
        let (has_output, role) = (configuration.has_output(), parameters.role());
        self.setup = Some(setup);
        self.state = match role {
            // Manual p. 32: without outputs in the configuration, the DP controller does not notify the
            // firmware, so CAN stays off.
            _ if !has_output => can_state::OFF,
            Role::Layer2 => can_state::WORKING,
            Role::Master | Role::Slave(_) => {
                let time = u64::from(self.registers.stored.stored_wakeup_time.load()) * 1_000_000;
                self.wake_at = Some((self.on_since + time).max(now));
                can_state::WAKE_UP
            }
        };
        self.show_window();
        self.show();
    }

    /// Ends data exchange: the gateway sends no more frames by itself, but continues to receive (D-386).
    pub(in crate::devices::can_dp2::emulation) fn end(&mut self) {
        (self.has_outputs, self.is_configured, self.is_emptied) = (false, false, true);
        (self.wake_at, self.sync_at, self.sync_waits) = (None, None, false);
        self.frames.clear();
        if let Some(setup) = &mut self.setup {
            setup.cycles.fill(None);
        }
    }

    fn start_cycles(&mut self, now: u64) {
        let Some(Setup { configuration, cycles, .. }) = &mut self.setup else { return };
        for (module, cycle) in configuration.modules.iter().zip(cycles) {
            *cycle = match module.kind {
                ModuleFunction::Output { cycle_ms, .. } if cycle_ms != 0 => {
                    Some(now + u64::from(cycle_ms) * 1000)
                }
                _ => None,
            };
        }
    }

    /// Clears the outputs (D-387). Cleared outputs do not count as outputs of a data exchange: a start that
    /// waits for the first outputs still waits.
    pub(in crate::devices::can_dp2::emulation) fn cleared(&mut self, now: u64) {
        if self.has_outputs
            && let Some(setup) = &self.setup
        {
            self.exchanged(&vec![0; setup.outputs.len()], now);
        }
    }

    /// Handles the first outputs. A CANopen start that has waited for the outputs sends them (D-675).
    fn begin_outputs(&mut self, outputs: &[u8], now: u64) {
        let Some(setup) = &mut self.setup else { return };
        self.has_outputs = true;
        match setup.parameters.role() {
            Role::Layer2 => self.start_cycles(now),
            Role::Master | Role::Slave(_) if self.state == can_state::WORKING => {
                setup.outputs.iter_mut().zip(outputs).for_each(|(to, from)| *to = *from);
                self.send_outputs(now);
            }
            Role::Master | Role::Slave(_) => {}
        }
    }

    /// Handles the outputs of a data exchange.
    pub(in crate::devices::can_dp2::emulation) fn exchanged(&mut self, outputs: &[u8], now: u64) {
        let is_off = self.state == can_state::OFF;
        if !self.has_outputs && !is_off {
            self.begin_outputs(outputs, now);
        }
        for number in 0.. {
            let Some(setup) = self.setup.as_ref().filter(|_| !is_off) else { break };
            let Some(&module) = setup.configuration.modules.get(number) else { break };
            let Some(new) = outputs.get(module.range()) else { continue };
            match module.kind {
                ModuleFunction::WindowOutput => self.order(new),
                ModuleFunction::Output { id, .. }
                    if self.state == can_state::WORKING && setup.outputs.get(module.range()) != Some(new) =>
                {
                    let frame = frame(id, &module, new, setup.parameters.has_tx_counter());
                    frame.into_iter().for_each(|frame| self.push(frame));
                }
                _ => {}
            }
        }
        if !is_off {
            self.page(outputs);
        }
        if let Some(setup) = &mut self.setup {
            setup.outputs.iter_mut().zip(outputs).for_each(|(to, from)| *to = *from);
        }
    }

    /// Handles the window that the DP master has written.
    fn order(&mut self, window: &[u8]) {
        let Ok(window) = <&[u8; WINDOW]>::try_from(window) else { return };
        let enabled = self.window.enabled().len();
        match self.window.written(window) {
            Order::Nothing => {}
            Order::Send(frame) => self.push(frame),
            Order::SyncTime(time) => self.set_sync_time(time),
        }
        self.is_new |= self.window.enabled().len() != enabled;
        self.show_window();
        self.show();
    }

    /// Updates the window that the DP master reads.
    fn show_window(&self) {
        let modules = self.setup.iter().flat_map(|setup| &setup.configuration.modules);
        for module in modules.filter(|module| module.kind == ModuleFunction::WindowInput) {
            self.registers.set_inputs(module.first, self.window.shown());
        }
    }

    /// Handles a frame from CAN.
    pub(in crate::devices::can_dp2::emulation) fn received(&mut self, frame: &Frame, now: u64) {
        let Some(setup) = self.setup.as_ref().filter(|_| self.state != can_state::OFF) else { return };
        // Remote frames are not inputs (D-388).
        if frame.is_remote_frame() {
            return;
        }
        let role = setup.parameters.role();
        let is_awake = matches!(self.state, can_state::PRE_OPERATIONAL | can_state::WORKING);
        if let (Id::Standard(StandardId::ZERO), Role::Slave(number), true) = (frame.id(), role, is_awake)
            && let Some(command) = Command::parse(frame.data(), number)
        {
            return self.command(command, now);
        }
        // Frames with an identifier that is enabled for the window go to the window (D-392).
        if self.window.enabled().contains(&frame.id()) {
            if !self.window.received(*frame) {
                self.msg_lost = self.msg_lost.saturating_add(1);
                self.has_news = true;
            }
            self.show_window();
            return self.show();
        }
        if let Some(pages) = &mut self.pages {
            return pages.received(frame);
        }
        let counts = setup.parameters.has_rx_counter();
        let is_its = |module: &&Module| matches!(module.kind, ModuleFunction::Input { id, is_frozen: false } if id == frame.id());
        let Some(module) = setup.configuration.modules.iter().find(is_its) else { return };
        let room = module.length - usize::from(counts);
        let mut data = frame.data().to_vec();
        data.truncate(room);
        super::form::swap(module.form, &mut data);
        self.registers.set_inputs(module.first, &data);
        if counts {
            let counter = module.first + room;
            self.registers.set_inputs(counter, &[self.registers.input(counter).wrapping_add(1)]);
        }
    }

    /// Returns the time of the next due event, in us.
    pub(in crate::devices::can_dp2::emulation) fn next_time(&self) -> u64 {
        let cycles = self.setup.iter().flat_map(|setup| setup.cycles.iter().flatten());
        let times = cycles.chain(&self.wake_at).chain(&self.sync_at);
        times.copied().min().unwrap_or(u64::MAX)
    }

    /// Handles the due events.
    pub(in crate::devices::can_dp2::emulation) fn due(&mut self, now: u64) {
        if self.wake_at.is_some_and(|at| at <= now) {
            self.wake_at = None;
            self.wake_up(now);
        }
        let mut due = Vec::new();
        if let Some(Setup { parameters, configuration, outputs, cycles }) = &mut self.setup {
            for (module, cycle) in configuration.modules.iter().zip(cycles) {
                let (ModuleFunction::Output { id, cycle_ms }, Some(at)) = (module.kind, *cycle) else {
                    continue;
                };
                if at <= now {
                    *cycle = Some(at + u64::from(cycle_ms) * 1000);
                    if let Some(data) =
                        outputs.get(module.range()).filter(|_| self.state == can_state::WORKING)
                    {
                        due.extend(frame(id, module, data, parameters.has_tx_counter()));
                    }
                }
            }
        }
        due.into_iter().for_each(|frame| self.push(frame));
        self.sync(now);
        self.plan_sync(now);
    }

    /// Returns the bit rate and filters for the controller, if they have changed.
    pub(in crate::devices::can_dp2::emulation) fn take_setup(&mut self) -> Option<(u32, Vec<Filter>)> {
        if !core::mem::take(&mut self.is_new) {
            return None;
        }
        let Setup { parameters, configuration, .. } = self.setup.as_ref()?;
        let of_modules = configuration.modules.iter().filter_map(|module| match module.kind {
            ModuleFunction::Input { id, .. } => Some(id),
            _ => None,
        });
        let of_pages = self.pages.iter().flat_map(Pages::received_ids).map(|(id, _)| id);
        let ids = of_modules.chain(of_pages).chain(self.window.enabled().iter().copied());
        let nmt = matches!(parameters.role(), Role::Slave(_)).then_some(Id::Standard(StandardId::ZERO));
        let mut filters: Vec<Filter> = ids.chain(nmt).map(|id| Filter::exactly(id).data_only()).collect();
        if filters.is_empty() {
            // A controller without filters would receive all frames, so there is always this filter. No frame
            // on the bus passes it.
            filters.push(Filter::exactly(ExtendedId::MAX).data_only());
        }
        Some((parameters.can_bit_s(), filters))
    }

    /// Returns true if the CAN controller must discard the frames that it has not sent yet (D-386). The
    /// result is true once for each end of data exchange.
    pub(in crate::devices::can_dp2::emulation) fn take_emptied(&mut self) -> bool {
        core::mem::take(&mut self.is_emptied)
    }

    /// Takes the next frame to send.
    pub(in crate::devices::can_dp2::emulation) fn take_frame(&mut self) -> Option<Frame> {
        self.frames.pop_front()
    }

    fn show(&self) {
        let can = &self.registers.can;
        can.can_state.store(self.state);
        can.bus_state.store(self.bus);
        can.irq_lost.store(self.irq_lost);
        can.msg_lost.store(self.msg_lost);
        can.fifo_count.store(self.window.waiting() as u8);
        can.page_state.store(self.pages.as_ref().map_or(page_state::NONE, |pages| pages.phase() as u8));
    }
}

/// Returns the frame of an output module with this data.
fn frame(id: Id, module: &Module, data: &[u8], has_counter: bool) -> Option<Frame> {
    let mut data = data.to_vec();
    data.truncate(module.length - usize::from(has_counter));
    super::form::swap(module.form, &mut data);
    Some(Frame::new(id, Payload::new(&data)?))
}
