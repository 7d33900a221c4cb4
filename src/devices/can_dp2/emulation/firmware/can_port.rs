//! The port on CAN: frames that the gateway sends and receives, and LED C (p. 15).

use super::ram::Registers;
use super::{Shared, lock};
use crate::can::{ErrorState, Frame};
use crate::devices::Context;
use crate::devices::can_bus::{CanPort, Controller};
use crate::devices::can_dp2::emulation::records::CanState;
use crate::devices::can_dp2::registers::FRONT_LED_C;
use crate::devices::can_dp2::registers::values::{bus_state, can_state, led_c};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

/// A bit rate that no bus has. The controller has this rate until data exchange starts, because the device
/// does not take part in CAN until then (p. 12).
const NO_RATE: u32 = 0;

/// The firmware on CAN.
pub(in crate::devices::can_dp2::emulation) struct CanSide {
    registers: Registers,
    gateway: Shared,
    /// State that the journal has last recorded.
    recorded_state: u8,
}

impl CanSide {
    pub(in crate::devices::can_dp2::emulation) fn new(registers: Registers, gateway: Shared) -> Self {
        CanSide { registers, gateway, recorded_state: can_state::OFF }
    }

    /// Updates filters, frames, LED and journal after any change.
    fn show(&mut self, ctx: &mut Context, controller: &mut Controller) {
        let gateway = &mut *lock(&self.gateway);
        gateway.plan_sync(ctx.now);
        if gateway.take_emptied() {
            controller.discard();
        }
        if let Some((bit_s, filters)) = gateway.take_setup() {
            controller.set_bit_rate(bit_s);
            controller.set_filters(filters);
        }
        while controller.to_send() < Controller::ROOM {
            let Some(frame) = gateway.take_frame() else { break };
            if controller.send(frame).is_err() {
                gateway.lost_frame();
            }
        }
        self.registers.shown(FRONT_LED_C).store(match gateway.bus() {
            bus_state::WARN => led_c::WARNING,
            bus_state::ERROR_PASSIVE => led_c::ERROR,
            bus_state::BUS_OFF => led_c::OFF,
            _ => led_c::ON,
        });
        let state = gateway.state();
        if core::mem::replace(&mut self.recorded_state, state) != state {
            ctx.report(CanState { plc: ctx.origin.plc, to: state });
        }
    }
}

/// Both ports share the gateway. The snapshot of this port includes the gateway; the snapshot of the other
/// port does not.
impl SnapshotFields for CanSide {
    fn save(&self, to: &mut Saving) {
        let Self { registers: _, gateway, recorded_state } = self;
        lock(gateway).save(to);
        to.value(recorded_state);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        lock(&self.gateway).restore(from)?;
        self.recorded_state = from.value()?;
        Ok(())
    }
}

impl CanPort for CanSide {
    fn power_on(&mut self, ctx: &mut Context, controller: &mut Controller, _: u8) {
        controller.set_bit_rate(NO_RATE);
        lock(&self.gateway).power_on(ctx.now);
        self.recorded_state = can_state::OFF;
        self.show(ctx, controller);
    }

    fn power_off(&mut self) {
        lock(&self.gateway).power_off();
        self.registers.shown(FRONT_LED_C).store(0);
    }

    fn look(&mut self, ctx: &mut Context, controller: &mut Controller) {
        self.show(ctx, controller);
    }

    fn received(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame) {
        lock(&self.gateway).received(frame, ctx.now);
        self.show(ctx, controller);
    }

    fn overrun(&mut self, ctx: &mut Context, controller: &mut Controller, _: &Frame) {
        lock(&self.gateway).lost_frame();
        self.show(ctx, controller);
    }

    fn sent(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame) {
        lock(&self.gateway).sent(frame);
        self.show(ctx, controller);
    }

    /// Converts the error state of the controller to the states of p. 20. The controller returns from BUS-off
    /// by itself (D-395).
    fn error_state(&mut self, ctx: &mut Context, controller: &mut Controller, state: ErrorState) {
        lock(&self.gateway).set_bus(match state {
            ErrorState::Active => bus_state::OK,
            ErrorState::Warning => bus_state::WARN,
            ErrorState::Passive => bus_state::ERROR_PASSIVE,
            ErrorState::BusOff => bus_state::BUS_OFF,
        });
        if state == ErrorState::BusOff {
            controller.restart();
        }
        self.show(ctx, controller);
    }

    fn next_time(&self) -> u64 {
        lock(&self.gateway).next_time()
    }

    fn due(&mut self, ctx: &mut Context, controller: &mut Controller) {
        lock(&self.gateway).due(ctx.now);
        self.show(ctx, controller);
    }
}
