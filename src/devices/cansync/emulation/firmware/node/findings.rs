//! Findings of a node about wrong requests of a PLC program.

use super::Node;
use crate::devices::cansync::firmware::init::InitFault;
use crate::devices::cansync::records::{BaudRateMismatch, Command, CommandIgnored};
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::devices::cansync::registers::phases;
use crate::devices::cansync::registers::values::{clock_divider, cpu_control, output_control};
use crate::devices::cansync::rules;
use crate::devices::{Context, SyncSignal};
use crate::layout::Port;
use core::mem::offset_of;

/// Reports that another station of the bus already has the number at the DIP switches of the slave at `port`.
pub(crate) fn report_number_taken(ctx: &mut Context, port: Option<&Port>, number: u8) {
    let Some(port) = port else { return };
    let offset = port.area.first as usize + offset_of!(CANsync_INIT_BMSTRUCT, w_OMEGA_NR);
    ctx.find(&rules::NUMBER_TAKEN, phases::INIT, offset, number.into());
}

impl Node {
    /// Reports that from now on the firmware cannot distinguish a restart command in the RAM from the last
    /// value that the firmware itself wrote into the register.
    pub(super) fn report_left_behind(&self, ctx: &mut Context) {
        let (origin, value) = (ctx.origin, cpu_control::RESTART);
        ctx.report(CommandIgnored { origin, value, why: Command::LeftBehind });
        ctx.find(&rules::LEFT_BEHIND, self.live(), 0, cpu_control::RESET_CONTROLLER.into());
    }

    pub(super) fn report_refused(&self, ctx: &mut Context, fault: InitFault) {
        let regs = &self.regs;
        let (rule, offset, value) = match fault {
            InitFault::Mode => {
                (&rules::INIT_MODE, offset_of!(CANsync_INIT_BMSTRUCT, b_MA_SL_MODE), regs.b_MA_SL_MODE.load())
            }
            InitFault::BitTiming => {
                (&rules::INIT_BAUD_RATE, offset_of!(CANsync_INIT_BMSTRUCT, b_BT_0), regs.b_BT_0.load())
            }
            InitFault::TimePattern => (
                &rules::INIT_INTERVAL,
                offset_of!(CANsync_INIT_BMSTRUCT, b_TIME_PATTERN),
                regs.b_TIME_PATTERN.load(),
            ),
        };
        ctx.find(rule, phases::INIT, offset, value.into());
    }

    /// Checks the two values that the manual requires for the CAN controller (p. 149). Other values would
    /// harm the real device, but not a simulated bus.
    pub(super) fn check_controller(&self, ctx: &mut Context) {
        let output = (
            &self.regs.b_OUTPUT_CONTROL,
            offset_of!(CANsync_INIT_BMSTRUCT, b_OUTPUT_CONTROL),
            output_control::REQUIRED,
        );
        let clock = (
            &self.regs.b_CLOCK_DIVIDER,
            offset_of!(CANsync_INIT_BMSTRUCT, b_CLOCK_DIVIDER),
            clock_divider::REQUIRED,
        );
        for (register, offset, right) in [output, clock] {
            let value = register.load();
            if value != right {
                ctx.find(&rules::INIT_CONTROLLER, phases::INIT, offset, value.into());
            }
        }
    }

    /// Reports once that the node passes on a SYNC signal with another rate than the rate of its bus.
    #[inline]
    pub(in super::super) fn judge_sync(&mut self, ctx: &mut Context, signal: SyncSignal) {
        let Some(timing) = self.init.as_ref().map(|init| init.timing) else { return };
        let is_unlike = u32::from(timing.b_TIME_PATTERN) * 1000 != signal.interval_us;
        let is_news = is_unlike && !self.sync_is_unlike;
        self.is_settled &= self.sync_is_unlike == is_unlike;
        self.sync_is_unlike = is_unlike;
        if is_news {
            let (origin, node_kbit_s, bus_kbit_s) = (ctx.origin, timing.kbit_per_s, signal.kbit_s);
            ctx.report(BaudRateMismatch { origin, node_kbit_s, bus_kbit_s, passes_on: true });
            let offset = offset_of!(CANsync_INIT_BMSTRUCT, b_BT_0);
            ctx.find(&rules::CLUSTER_BAUD_RATE, phases::INIT, offset, timing.b_BT_0.into());
        }
    }

    pub(super) fn report_ignored(&self, ctx: &mut Context, value: u16) {
        let known = matches!(
            value,
            cpu_control::HANDSHAKE
                | cpu_control::TAKE_OVER_INIT_DATA
                | cpu_control::START_SYNCHRONOUS
                | cpu_control::ENABLE_ACTIVE
        );
        let why = if known { Command::NotNow } else { Command::Unknown };
        let origin = ctx.origin;
        ctx.report(CommandIgnored { origin, value, why });
        ctx.find(&rules::COMMAND, self.live(), 0, value.into());
    }
}
