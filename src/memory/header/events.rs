//! Events and their sources: the slots that count them, and the configuration that the function blocks `INTR_SET` and
//! `OPT_INIT` write (manual 5.00005.03a p. 47-60).

use crate::memory::struct_tables::publish;
use crate::memory::{Bell, Cell32, Cell64, SharedRegs};
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// An interrupt event, a trigger or a timer: its bell counts the pulses.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct EventSlot {
    /// Rung by the firmware once per event.
    pub bell: Bell,
    /// Emulated time of the last event in microseconds; written before the bell rings.
    pub time_us: Cell64,
}

/// Function block `INTR_SET` for one event number: its inputs in one word, and the firmware's answer.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct Interrupt {
    /// Bit 0: `x_EN`. Bits 1 to 15: number of the request, different from the one in `answer`. Bits 16 to 31: `i_PAR1`,
    /// the period of a CPU timer in units of 50 us.
    pub request: Cell32,
    /// Number of the request to which `result` belongs.
    pub answer: Cell32,
    /// An [`InterruptResult`], stored before `answer`. Output `x_ERR` of the function block is TRUE if it is not 0.
    pub result: Cell32,
    /// Reserved; always zero.
    pub reserved: Cell32,
}

/// Function block `OPT_INIT`: its inputs, and the firmware's answer.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct OptInit {
    /// Modes of trigger 1, trigger 2 and trigger controller (manual p. 58), in the order of [`Trigger`].
    pub triggers: [Cell32; super::TRIGGERS],
    /// Board timers A and B.
    pub timers: [TimerSetup; 2],
    /// Number of the request, different from `answer`.
    pub request: Cell32,
    /// Number of the request to which `result` belongs.
    pub answer: Cell32,
    /// An [`OptInitResult`], stored before `answer`.
    pub result: Cell32,
    /// Reserved; always zero.
    pub reserved: [Cell32; 4],
}

/// Inputs of `OPT_INIT` for one board timer.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct TimerSetup {
    /// `u_DIVIDER_TIMER_...`, 0 to 65535: the period is (divider + 1) x 2 / 5 MHz.
    pub divider: Cell32,
    /// `x_EN_TIMER_...`: 1 starts the timer.
    pub enable: Cell32,
    /// `ud_CFG_MODE_TIMER_...`: 0 is the base clock of 5 MHz.
    pub cfg_mode: Cell32,
}

/// Target of a trigger, by its index in [`OptInit::triggers`] and [`super::Header::triggers`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// Trigger 1: option card IEI-02 latches its encoders.
    One = 0,
    /// Trigger 2: option card MFM-01 starts its conversion.
    Two = 1,
    /// Trigger controller: the drive's control task.
    Controller = 2,
}

codes! {
    /// Result of a call of `INTR_SET`.
    InterruptResult {
        /// The event was enabled or disabled as requested.
        Done = 0,
        /// The event number is reserved or does not exist, or the device enables no event by `INTR_SET`.
        NoSuchEvent = 1,
        /// Another event is enabled that excludes this event: 11 and 12 exclude each other, and 4 and 8 exclude each
        /// other (manual p. 48).
        Excluded = 2,
        /// `i_PAR1` of a CPU timer must be 1 to 32767.
        BadFactor = 3,
    }
}
codes! {
    /// Result of a call of `OPT_INIT`.
    OptInitResult {
        /// Triggers are routed, timers run.
        Done = 0,
        /// `OPT_INIT` has already run since the last power-on, reset, cold or warm start; it may run only once (manual
        /// p. 59).
        AlreadyRun = 1,
        /// A trigger mode is reserved or does not exist.
        BadTrigger = 2,
        /// A divider, enable or configuration mode of a timer has an invalid value.
        BadTimer = 3,
        /// The device has no triggers and no board timers.
        NoTriggers = 4,
    }
}

// SAFETY: every field is a cell, an array of cells or such a struct; IntoBytes proves that there is no padding
// and FromBytes that any bit pattern is valid.
unsafe impl SharedRegs for EventSlot {}
// SAFETY: as above.
unsafe impl SharedRegs for Interrupt {}
// SAFETY: as above.
unsafe impl SharedRegs for OptInit {}

publish! { EventSlot: 0 => bell, 8 => time_us }
publish! { Interrupt: 0 => request, 4 => answer, 8 => result, 12 => reserved }
publish! { TimerSetup: 0 => divider, 4 => enable, 8 => cfg_mode }
publish! { OptInit: 0 => triggers, 12 => timers, 36 => request, 40 => answer, 44 => result, 48 => reserved }
const _: () = assert!(size_of::<EventSlot>() == 16 && size_of::<Interrupt>() == 16);
const _: () = assert!(size_of::<TimerSetup>() == 12 && size_of::<OptInit>() == 64);

impl EventSlot {
    /// Announces one event at the given emulated time, in microseconds.
    #[inline]
    pub fn fire(&self, time_us: u64) {
        self.time_us.store(time_us);
        self.bell.ring();
    }
}

impl Interrupt {
    /// Removes request and answer.
    pub fn clear(&self) {
        [&self.request, &self.answer, &self.result].iter().for_each(|cell| cell.store(0));
    }

    /// Stores a request with a new number, and returns the number. The caller submits the request with
    /// [`super::Header::submit_request`] and waits until [`Interrupt::outcome`] returns the result. For each event,
    /// only one task at a time may have a request.
    pub fn ask(&self, factor: i16, enable: bool) -> u32 {
        let number = (self.answer.load() >> 1).wrapping_add(1) & 0x7FFF;
        let request = u32::from(factor as u16) << 16 | number << 1 | u32::from(enable);
        self.request.store(request);
        request
    }

    /// Returns the result of `request`; `None` while the firmware has not answered.
    pub fn outcome(&self, request: u32) -> Option<u32> {
        (self.answer.load() == request).then(|| self.result.load())
    }
}

impl OptInit {
    /// Stores the result of `request`.
    #[cfg(feature = "emulator")]
    pub(crate) fn answer(&self, request: u32, result: OptInitResult) {
        self.result.store(result.code());
        self.answer.store(request);
    }

    /// Removes request and answer, and sets all inputs to 0.
    pub fn clear(&self) {
        let timers = self.timers.iter().flat_map(|timer| [&timer.divider, &timer.enable, &timer.cfg_mode]);
        let handshake = [&self.request, &self.answer, &self.result];
        self.triggers.iter().chain(timers).chain(handshake).for_each(|cell| cell.store(0));
    }

    /// Stores a request for the inputs in the other fields, and returns its number; see [`Interrupt::ask`].
    pub fn ask(&self) -> u32 {
        let request = self.answer.load().wrapping_add(1);
        self.request.store(request);
        request
    }

    /// Returns the result of `request`; `None` while the firmware has not answered.
    pub fn outcome(&self, request: u32) -> Option<u32> {
        (self.answer.load() == request).then(|| self.result.load())
    }
}
