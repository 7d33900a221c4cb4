//! Process data: configuration, re-initialization, cyclic exchange (manual 5.00005.03a p. 86-92, 99-116).

use super::config::Numbers;
use super::cycle::{Cycle, FOUR_ACTUAL_VALUES, Method};
use super::findings::{cycle_of, find, find_wrong_pwm, is_too_early};
use crate::devices::Context;
use crate::devices::cansync::drive::BuiltInDrive;
use crate::devices::cansync::frames::codec::parameter::VALUE_ELEMENT;
use crate::devices::emulation::recorded_register::RecordedRegister;
use crate::devices::omega_drive_line_2::emulation::rules;
use crate::devices::omega_drive_line_2::registers::BAPS_CTRL_BMSTRUCT;
use crate::devices::omega_drive_line_2::registers::values::{baps_command, baps_quit};
use crate::memory::{FirmwareHeader, MemoryError, Segment};
use crate::snapshot_fields;
use core::mem::offset_of;
use serde::{Deserialize, Serialize};

/// Number of communications during which a re-initialization is active: one for each parameter number
/// (decision D-157).
const RE_INITIALIZATION: u8 = 6;

/// A configuration in force.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Configured {
    cycle: Cycle,
    numbers: Numbers,
    /// Number of communications since power-on.
    count: u64,
    /// Time of the next communication, in microseconds.
    next: u64,
    /// True if a communication is pending.
    is_due: bool,
    /// True if the PLC has given a command for the last communication.
    is_used: bool,
    /// The SYNC slot (P167), in us, that was last reported to the PLC as wrong.
    wrong_slot: Option<u32>,
    re_init: ReInit,
}

/// State of a re-initialization.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum ReInit {
    /// There is no command, or the PLC has read the result.
    Idle,
    /// The re-initialization still needs `left` communications.
    Active { numbers: Numbers, left: u8 },
    /// The command has ended with this acknowledgement. The acknowledgement stays until another command
    /// comes.
    Over(u8),
}

/// The process data of a BAPS.
pub(super) struct Process {
    face: FirmwareHeader,
    configured: Option<Configured>,
    /// Number of communications; each is an event "BAPS process data".
    events: u64,
}

snapshot_fields!(Process { values: configured, events; built: face });

impl Process {
    /// Creates the process data of a BAPS without a configuration.
    ///
    /// # Errors
    /// The memory segment is read-only.
    pub(crate) fn new(segment: &Segment) -> Result<Self, MemoryError> {
        Ok(Process { face: segment.firmware_header()?, configured: None, events: 0 })
    }

    /// Called when the board restarts. As after power-on, there is no configuration (manual p. 90).
    pub(crate) fn reset(&mut self) {
        self.configured = None;
    }

    pub(crate) fn is_configured(&self) -> bool {
        self.configured.is_some()
    }

    /// Returns the number of communications since power-on.
    pub(crate) fn events(&self) -> u64 {
        self.events
    }

    /// If there is such a slot, aligns the communications to this slot of the trigger signal.
    pub(crate) fn align(&mut self, slot: Option<u64>) {
        if let (Some(configured), Some(slot)) = (&mut self.configured, slot) {
            configured.next = slot;
        }
    }

    /// Marks the next communication as pending if it is due at `now`.
    pub(crate) fn pass(&mut self, now: u64) {
        if let Some(configured) = &mut self.configured
            && configured.next <= now
        {
            // If the drive has just aligned its slices to the trigger signal, it skips the slots that it has
            // missed.
            configured.next = now + configured.cycle.communication_us();
            configured.count += 1;
            configured.is_due = true;
        }
    }

    /// True if a communication is pending or a command needs an answer.
    pub(crate) fn has_work(&self, regs: &BAPS_CTRL_BMSTRUCT) -> bool {
        let is_due = self.configured.is_some_and(|configured| configured.is_due);
        match regs.b_COMMAND.load() {
            baps_command::NONE => is_due,
            baps_command::EXCHANGE | baps_command::RE_INITIALIZE => is_due || !self.is_configured(),
            _ => true,
        }
    }

    /// Skips the pending communication.
    pub(crate) fn leave_out(&mut self) {
        if let Some(configured) = &mut self.configured {
            configured.is_due = false;
        }
    }

    /// Carries out the pending communication and answers a command.
    pub(crate) fn slice(&mut self, ctx: &mut Context, regs: &BAPS_CTRL_BMSTRUCT, drive: &mut BuiltInDrive) {
        let word = regs.b_COMMAND.load();
        match word {
            baps_command::NONE => {}
            baps_command::CONFIGURE => {
                drive.configured();
                let answer = self.configure(ctx, regs, drive);
                acknowledge(ctx, regs, word, answer);
                find_wrong_pwm(ctx, drive);
                return;
            }
            baps_command::EXCHANGE | baps_command::RE_INITIALIZE if self.is_configured() => {}
            baps_command::EXCHANGE | baps_command::RE_INITIALIZE => {
                acknowledge(ctx, regs, word, baps_quit::NOT_CONFIGURED)
            }
            _ => acknowledge(ctx, regs, word, baps_quit::NOT_UNDERSTOOD),
        }
        if let Some(configured) = &mut self.configured
            && configured.is_due
        {
            configured.communicate(ctx, regs, drive);
            self.events += 1;
        }
    }

    fn configure(&mut self, ctx: &mut Context, regs: &BAPS_CTRL_BMSTRUCT, drive: &BuiltInDrive) -> u8 {
        let former = self.configured.take();
        if former.is_some_and(|former| former.is_used) {
            find(
                ctx,
                &rules::BAPS_RUNNING,
                offset_of!(BAPS_CTRL_BMSTRUCT, b_COMMAND),
                baps_command::CONFIGURE.into(),
            );
        }
        if is_too_early(self.face.requested()) {
            find(
                ctx,
                &rules::BAPS_EARLY,
                offset_of!(BAPS_CTRL_BMSTRUCT, b_COMMAND),
                baps_command::CONFIGURE.into(),
            );
        }
        let Some(cycle) = cycle_of(ctx, regs) else { return baps_quit::NOT_UNDERSTOOD };
        let numbers = Numbers::of(regs);
        if let Err(answer) = numbers.check(drive) {
            return answer;
        }
        self.configured = Some(Configured::new(ctx.now, cycle, numbers, drive));
        baps_quit::CONFIGURED
    }
}

impl Configured {
    fn new(now: u64, cycle: Cycle, numbers: Numbers, drive: &BuiltInDrive) -> Self {
        let next = drive.next_slot(now + 1).unwrap_or(now + cycle.first_us());
        let (is_due, is_used, wrong_slot) = (false, false, None);
        Configured { cycle, numbers, count: 0, next, is_due, is_used, wrong_slot, re_init: ReInit::Idle }
    }

    /// Copies actual values and status word to the PLC. If the PLC has given the command, then copies
    /// reference values and control word from the PLC.
    fn communicate(&mut self, ctx: &mut Context, regs: &BAPS_CTRL_BMSTRUCT, drive: &mut BuiltInDrive) {
        self.is_due = false;
        let software = drive.regler().software();
        let (writes, reads) = self.cycle.values(self.count, software);
        let mut answer = baps_quit::EXCHANGED;
        for x in reads {
            if !self.read(x, regs, drive) {
                answer = baps_quit::UNREADABLE;
            }
        }
        regs.w_STATUSWORD.show(ctx, offset_of!(BAPS_CTRL_BMSTRUCT, w_STATUSWORD), drive.status_word());

        let word = regs.b_COMMAND.load();
        self.is_used = matches!(word, baps_command::EXCHANGE | baps_command::RE_INITIALIZE);
        if !self.is_used {
            return;
        }
        let Some(cycle) = cycle_of(ctx, regs) else {
            return acknowledge(ctx, regs, word, baps_quit::NOT_UNDERSTOOD);
        };
        self.judge(ctx, cycle, regs, drive);
        if word == baps_command::RE_INITIALIZE
            && (software < FOUR_ACTUAL_VALUES || self.cycle.method() != Method::SameCycle)
        {
            return acknowledge(ctx, regs, word, baps_quit::NOT_UNDERSTOOD);
        }
        drive.exchanged(ctx.now);
        drive.regler_mut().command(regs.w_CONTROLWORD.load());
        for x in writes {
            if !self.write(x, regs, drive) {
                answer = baps_quit::UNWRITABLE;
            }
        }
        let answer = self.re_initialize(word, regs, drive).unwrap_or(answer);
        if cycle != self.cycle {
            let Configured { is_used, re_init, .. } = *self;
            *self = Configured { is_used, re_init, ..Self::new(ctx.now, cycle, self.numbers, drive) };
        }
        acknowledge(ctx, regs, word, answer);
    }

    /// Reports errors in the cycle times of this exchange.
    fn judge(&mut self, ctx: &mut Context, cycle: Cycle, regs: &BAPS_CTRL_BMSTRUCT, drive: &BuiltInDrive) {
        let offset = offset_of!(BAPS_CTRL_BMSTRUCT, w_COMMAND_REG);
        if cycle != self.cycle {
            find(ctx, &rules::BAPS_CYCLE, offset, regs.w_COMMAND_REG.load().into());
        }
        let is_wrong = |slot: &u32| u64::from(*slot) != cycle.communication_us();
        let wrong_slot = drive.required_slot_us(ctx.now).filter(is_wrong);
        if wrong_slot.is_some() && wrong_slot != self.wrong_slot {
            find(ctx, &rules::BAPS_SYNC_SLOT, offset, regs.w_COMMAND_REG.load().into());
        }
        self.wrong_slot = wrong_slot;
    }

    /// Passes actual value `x` to the PLC. Returns false if the value cannot be read now.
    fn read(&self, x: usize, regs: &BAPS_CTRL_BMSTRUCT, drive: &BuiltInDrive) -> bool {
        let number = self.numbers.reads[x];
        if number == 0 || self.is_undefined(|numbers| numbers.reads[x] != number) {
            return true;
        }
        match drive.regler().read_element(number, VALUE_ELEMENT) {
            Ok((_, value)) => {
                regs.a_RD_VALUE[x].store(value);
                true
            }
            Err(_) => false,
        }
    }

    /// Passes reference value `x` to the drive. Returns false if the value cannot be written now. A parameter
    /// of one word gets the low half of the value.
    fn write(&self, x: usize, regs: &BAPS_CTRL_BMSTRUCT, drive: &mut BuiltInDrive) -> bool {
        let number = self.numbers.writes[x];
        if number == 0 || self.is_undefined(|numbers| numbers.writes[x] != number) {
            return true;
        }
        let regler = drive.regler_mut();
        let Some(format) = regler.format_of(number) else { return false };
        let value = regs.a_WR_VALUE[x].load() & format.mask();
        regler.write_element(number, VALUE_ELEMENT, format, value).is_ok()
    }

    /// True if values must not be exchanged because their re-initialization is in progress. Their values are
    /// not defined during this time (manual p. 109).
    fn is_undefined(&self, changes: impl FnOnce(&Numbers) -> bool) -> bool {
        matches!(&self.re_init, ReInit::Active { numbers, .. } if changes(numbers))
    }

    /// Starts or continues a re-initialization. If it has ended, returns its acknowledgement.
    fn re_initialize(&mut self, word: u8, regs: &BAPS_CTRL_BMSTRUCT, drive: &BuiltInDrive) -> Option<u8> {
        let wanted = word == baps_command::RE_INITIALIZE;
        match self.re_init {
            ReInit::Idle if wanted => {
                let numbers = self.numbers.re_initialized(&Numbers::of(regs));
                self.re_init = ReInit::Active { numbers, left: RE_INITIALIZATION - 1 };
            }
            ReInit::Idle => return None,
            ReInit::Active { numbers, left: 0 } => {
                let answer = match numbers.check(drive) {
                    Ok(()) => {
                        self.numbers = numbers;
                        baps_quit::EXCHANGED
                    }
                    Err(baps_quit::UNWRITABLE) => baps_quit::RE_INIT_UNWRITABLE,
                    Err(_) => baps_quit::RE_INIT_UNREADABLE,
                };
                self.re_init = ReInit::Over(answer);
                return Some(answer);
            }
            ReInit::Active { numbers, left } => {
                self.re_init = ReInit::Active { numbers, left: left - 1 };
            }
            ReInit::Over(answer) if wanted => return Some(answer),
            ReInit::Over(_) => {
                self.re_init = ReInit::Idle;
                return None;
            }
        }
        Some(baps_quit::RE_INITIALIZING)
    }
}

/// Answers a command: first writes the acknowledgement, then the command register, because the PLC polls the
/// command register. If the PLC has written a newer command, the command register keeps it.
fn acknowledge(ctx: &mut Context, regs: &BAPS_CTRL_BMSTRUCT, word: u8, answer: u8) {
    regs.b_SL_QUIT.show(ctx, offset_of!(BAPS_CTRL_BMSTRUCT, b_SL_QUIT), answer);
    if regs.b_COMMAND.compare_exchange(word, baps_command::NONE).is_ok() {
        ctx.answered(offset_of!(BAPS_CTRL_BMSTRUCT, b_COMMAND), word.into(), baps_command::NONE.into());
    }
}
