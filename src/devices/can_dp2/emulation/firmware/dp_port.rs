//! The port on PROFIBUS: the slave, LEDs D, E and P, address switches (p. 9, 12-15).

use super::gateway::Gateway;
use super::ram::Registers;
use super::slave::{News, Slave};
use super::{Shared, lock};
use crate::devices::Context;
use crate::devices::can_dp2::emulation::records::{DpState, Refused, WatchdogOut};
use crate::devices::can_dp2::emulation::rules;
use crate::devices::can_dp2::registers::values::{dp_state, led_d, led_e, led_p};
use crate::devices::can_dp2::registers::{
    DEVICE, FRONT_ADDRESS, FRONT_LED_D, FRONT_LED_E, FRONT_LED_P, FRONT_SWITCHES,
};
use crate::devices::profibus_bus::{Presence, ProfibusPort, Station};
use crate::journal::{Finding, Rule};
use crate::layout::RegisterPhase;
use crate::profibus::{FunctionCode, Telegram};
use crate::snapshot_fields;

/// Addresses that the switches can select (p. 9).
const FIRST_ADDRESS: u32 = 3;
const LAST_ADDRESS: u32 = 124;

/// Returns the address for a position of the switches (p. 9).
pub(in crate::devices::can_dp2::emulation) const fn address(switches: u32) -> u32 {
    if switches < FIRST_ADDRESS {
        FIRST_ADDRESS
    } else if switches > LAST_ADDRESS {
        LAST_ADDRESS
    } else {
        switches
    }
}

/// The firmware on PROFIBUS.
pub(in crate::devices::can_dp2::emulation) struct DpPort {
    registers: Registers,
    gateway: Shared,
    slave: Option<Slave>,
}

snapshot_fields!(DpPort { values: slave; built: registers, gateway });

impl DpPort {
    pub(in crate::devices::can_dp2::emulation) fn new(registers: Registers, gateway: Shared) -> Self {
        DpPort { registers, gateway, slave: None }
    }

    /// Runs the slave, then reports the results.
    fn run<T: Default>(
        &mut self,
        ctx: &mut Context,
        doing: impl FnOnce(&mut Slave, &mut Gateway, &Registers) -> T,
    ) -> T {
        let Some(slave) = &mut self.slave else { return T::default() };
        let gateway = &mut *lock(&self.gateway);
        let done = doing(slave, gateway, &self.registers);
        slave.look(gateway);
        slave.show(gateway, &self.registers);
        let plc = ctx.origin.plc;
        for news in slave.take_news() {
            match news {
                News::State(to) => ctx.report(DpState { plc, to }),
                News::Refused([cause, number, detail]) => ctx.report(Refused { plc, cause, number, detail }),
                News::Watchdog => ctx.report(WatchdogOut { plc }),
                News::Found(rule, at, value) => find(ctx, rule, at, value),
            }
        }
        let state = slave.state();
        let is_exchanging = state == dp_state::DATA_EXCHANGE;
        self.registers.shown(FRONT_LED_D).store(if is_exchanging { led_d::ON } else { led_d::DARK });
        // Codes 1 to 4 are the states of the LED in the order of p. 15.
        self.registers.shown(FRONT_LED_E).store(if is_exchanging { led_e::DARK } else { state.into() });
        done
    }
}

/// Reports that the position of the switches violates a rule.
fn find_switches(ctx: &mut Context, rule: &'static Rule, value: u32) {
    if let Some(front) = DEVICE.front_area {
        find(ctx, rule, front.first + 4 * FRONT_SWITCHES as u32, value);
    }
}

/// Reports that the register at byte `offset` of the image violates a rule.
fn find(ctx: &mut Context, rule: &'static Rule, offset: u32, value: u32) {
    let (plc, live) = (ctx.origin.plc, RegisterPhase::ALWAYS);
    ctx.journal.find(ctx.now, Finding { rule, plc, offset, live, value, late_us: 0 });
}

impl ProfibusPort for DpPort {
    fn power_on(&mut self, ctx: &mut Context, _: &mut Station) {
        let switches = self.registers.turned(FRONT_SWITCHES);
        let address = address(switches);
        if address != switches {
            find_switches(ctx, &rules::SWITCHES, switches);
        }
        self.registers.shown(FRONT_ADDRESS).store(address);
        self.registers.shown(FRONT_LED_P).store(led_p::ON);
        self.slave = Some(Slave::new(address as u8));
        self.run(ctx, |_, _, _| ());
    }

    fn presence(&self) -> Option<Presence> {
        let slave = self.slave.as_ref()?;
        Some(Presence { address: slave.address(), does: slave.does(), answers: true })
    }

    fn shares_address(&mut self, ctx: &mut Context) {
        if let Some(slave) = &self.slave {
            find_switches(ctx, &rules::ADDRESS, slave.address().into());
        }
    }

    fn power_off(&mut self) {
        self.slave = None;
        self.registers.diag.dp_state.store(dp_state::OFF);
        for word in [FRONT_ADDRESS, FRONT_LED_D, FRONT_LED_E, FRONT_LED_P] {
            self.registers.shown(word).store(0);
        }
    }

    /// Without a telegram, only events on CAN can change the slave.
    fn look(&mut self, ctx: &mut Context, _: &mut Station) {
        let has_news = lock(&self.gateway).has_news();
        if has_news {
            self.run(ctx, |_, _, _| ());
        }
    }

    fn heard(&mut self, ctx: &mut Context, station: &mut Station, telegram: &Telegram) {
        let now = ctx.now;
        // Another station has answered with this station's address, and the answers did not collide.
        if let (Telegram::Frame(frame), Some(slave)) = (telegram, &self.slave)
            && frame.sa == slave.address()
            && FunctionCode::is_answer(frame.fc)
        {
            self.shares_address(ctx);
        }
        let answer = self.run(ctx, |slave, gateway, registers| {
            let answer = slave.heard(telegram, now, gateway, registers)?;
            Some((slave.tsdr(), answer))
        });
        if let Some((after_bits, answer)) = answer {
            station.answer(after_bits, &answer);
        }
    }

    fn next_time(&self) -> u64 {
        self.slave.as_ref().map_or(u64::MAX, Slave::next_time)
    }

    fn due(&mut self, ctx: &mut Context, _: &mut Station) {
        let now = ctx.now;
        self.run(ctx, |slave, gateway, registers| slave.due(now, gateway, registers));
    }
}
