//! BAPS: the interface between the Omega Drive-Line II and the drive that contains it (manual 5.00005.03a chapter 6).
//!
//! `docs/devices/omega-drive-line-2/baps.md` describes the registers; the manual shows them only through its
//! function blocks. The drive serves them in time slices of 500 us. While no program uses the BAPS, there are
//! no slices: the firmware only polls two registers in each processor cycle.

mod config;
mod cycle;
mod findings;
mod hold;
mod process;
mod service;

pub(crate) use cycle::SLICE_US;
pub(crate) use hold::Pace;

use crate::devices::cansync::drive::{BuiltInDrive, BuiltInDriveConfig};
use crate::devices::emulation::recorded_register::RecordedRegister;
use crate::devices::omega_drive_line_2::registers::values::{baps_command, baps_semaphore, baps_status_reg};
use crate::devices::omega_drive_line_2::registers::{BAPS, BAPS_CTRL_BMSTRUCT};
use crate::devices::{Context, ParameterRefusal};
use crate::journal::Journal;
use crate::memory::{MemoryError, Segment, View};
use crate::snapshot_fields;
use core::mem::offset_of;
use hold::Hold;
use process::Process;
use service::Service;

/// The BAPS of one PLC with its drive.
pub struct Baps {
    regs: View<BAPS_CTRL_BMSTRUCT>,
    drive: BuiltInDrive,
    /// State of the drive after power-on.
    powered_on: BuiltInDrive,
    process: Process,
    service: Service,
    /// Late process data or commands.
    process_hold: Hold,
    /// Delay of the service data, if a fault causes one.
    service_hold: Hold,
    /// True if the Omega Drive-Line II is running. The drive can run without it.
    is_up: bool,
    /// Time of the next time slice, in microseconds; [`Baps::NEVER`] while no program uses the BAPS.
    next: u64,
    last: Option<u64>,
    /// Phase of the slices: their time modulo 500 us.
    phase: u64,
}

snapshot_fields!(Baps {
    values: process_hold, service_hold, is_up, next, last, phase;
    parts: drive, process, service;
    built: regs, powered_on
});

impl Baps {
    /// Time of an event that never occurs.
    pub const NEVER: u64 = u64::MAX;

    /// Creates the BAPS in `segment` with `drive`.
    ///
    /// # Errors
    /// The memory segment is too small.
    pub fn new(
        segment: &Segment,
        drive: BuiltInDrive,
        config: &BuiltInDriveConfig,
    ) -> Result<Self, MemoryError> {
        Ok(Baps {
            regs: segment.view::<BAPS_CTRL_BMSTRUCT>(BAPS)?,
            powered_on: drive.clone(),
            drive,
            process: Process::new(segment)?,
            service: Service::new(config.service_time_us),
            process_hold: Hold::default(),
            service_hold: Hold::default(),
            is_up: false,
            next: Self::NEVER,
            last: None,
            phase: 0,
        })
    }

    /// Called at power-on, or when RESET was released. At this time the registers contain their reset values.
    pub fn power_on(&mut self) {
        self.regs.reset_from(0);
        self.is_up = true;
    }

    /// Called at a RESET of the board. The interface restarts. The drive keeps its parameters and continues
    /// with its last command (decision D-166).
    pub fn reset(&mut self) {
        self.is_up = false;
        self.process.reset();
        self.service.reset();
        self.process_hold.forget();
        self.service_hold.forget();
    }

    /// Called at power-off of the PLC. The drive has the same supply as the PLC, so the drive stops, too.
    pub fn power_off(&mut self) {
        self.reset();
        self.drive = self.powered_on.clone();
        (self.next, self.last, self.phase) = (Self::NEVER, None, 0);
    }

    /// Returns the drive that contains the PLC.
    pub fn drive(&self) -> &BuiltInDrive {
        &self.drive
    }

    /// Returns the number of exchanges of process data since power-on. Each exchange is an event "BAPS
    /// process data" (events 4 and 8, manual 5.00005.03a p. 83).
    pub fn process_data_events(&self) -> u64 {
        self.process.events()
    }

    /// Returns the time of the next time slice.
    #[inline]
    pub fn next_time(&self) -> u64 {
        self.next
    }

    /// True if the PLC makes a request to the BAPS while there are no time slices.
    #[inline]
    pub fn is_called(&self) -> bool {
        self.next == Self::NEVER
            && self.is_up
            && (self.regs.b_COMMAND.load() != baps_command::NONE
                || self.regs.b_MA_SEMAPHORE.load() != baps_semaphore::IDLE)
    }

    /// Runs one processor cycle. If the PLC makes a request, the time slices begin.
    #[inline]
    pub fn processor_cycle(&mut self, now: u64) {
        if self.is_called() {
            self.wake(now);
        }
    }

    fn wake(&mut self, now: u64) {
        self.next = self.slice_from(now);
        // The registers did not change while there were no slices. So the last slice counts as if it had been
        // directly before the next one.
        self.last = Some(self.next.saturating_sub(SLICE_US));
    }

    /// Returns the time of the first slice at `earliest` or later.
    fn slice_from(&self, earliest: u64) -> u64 {
        let earliest = self.last.map_or(earliest, |last| earliest.max(last + 1));
        earliest + (self.phase + SLICE_US - earliest % SLICE_US) % SLICE_US
    }

    /// Runs the present time slice. `pace` returns when the drive takes a command in the registers. Its
    /// argument is true if the command has already waited.
    pub fn slice(&mut self, ctx: &mut Context, pace: impl FnMut(&mut Journal, bool) -> Pace) {
        let now = ctx.now;
        let us = self.last.map_or(SLICE_US, |last| (now - last).min(SLICE_US));
        self.last = Some(now);
        self.drive.step(now, us as u32);
        if self.is_up {
            self.exchange(ctx, pace);
        }
        self.next = if self.is_in_use() { self.slice_from(now + 1) } else { Self::NEVER };
    }

    /// Polls the registers, as the drive does: first process data, commands and status, then service data.
    fn exchange(&mut self, ctx: &mut Context, mut pace: impl FnMut(&mut Journal, bool) -> Pace) {
        self.process.pass(ctx.now);
        let synchronized = if self.drive.is_synchronized() { baps_status_reg::SYNCHRONIZED } else { 0 };
        if self.process.has_work(&self.regs) || self.regs.w_STATUS_REG.load() != synchronized {
            match self.process_hold.turn(ctx.now, |has_waited| pace(ctx.journal, has_waited)) {
                Pace::AtOnce => {
                    self.process.slice(ctx, &self.regs, &mut self.drive);
                    let offset = offset_of!(BAPS_CTRL_BMSTRUCT, w_STATUS_REG);
                    self.regs.w_STATUS_REG.show(ctx, offset, synchronized);
                }
                Pace::Late(_) => {}
                Pace::Never => self.process.leave_out(),
            }
        } else {
            self.process_hold.forget();
        }
        if !self.service.has_work(ctx.now, &self.regs) {
            self.service_hold.forget();
        } else if self.service_hold.turn(ctx.now, |has_waited| pace(ctx.journal, has_waited)) == Pace::AtOnce
        {
            self.service.slice(ctx, &self.regs, &mut self.drive);
        }
    }

    fn is_in_use(&self) -> bool {
        self.process.is_configured()
            || !self.service.is_idle()
            || self.process_hold.is_running()
            || self.service_hold.is_running()
            || !self.drive.is_quiescent()
            || self.drive.is_synchronized()
    }

    /// Called at a pulse of the trigger controller. The drive's slices begin at the SYNC offset (P168) after
    /// the pulse. If the drive is synchronized, the communications begin with such a slice (decision D-155).
    pub fn trigger_edge(&mut self, now: u64) {
        let was_synchronized = self.drive.is_synchronized();
        if !self.drive.trigger_edge(now) {
            return;
        }
        self.phase = (now + u64::from(self.drive.sync_offset_us())) % SLICE_US;
        if !was_synchronized {
            // The slice at the time of the edge may have run already.
            let earliest = self.last.map_or(now, |last| now.max(last + 1));
            self.process.align(self.drive.next_slot(earliest));
        }
        if self.is_in_use() {
            if self.next == Self::NEVER {
                self.wake(now);
            }
            self.next = self.slice_from(now);
        }
    }

    /// Sets a parameter of the drive, as a user does at the drive itself.
    ///
    /// # Errors
    /// [`ParameterRefusal`].
    pub(crate) fn set_parameter(
        &mut self,
        now: u64,
        number: u16,
        value: i64,
    ) -> Result<(), ParameterRefusal> {
        self.drive.set_parameter(number, value)?;
        if self.next == Self::NEVER {
            self.wake(now);
        }
        Ok(())
    }

    /// Sets the speed of the drive's motor. With `None` the motor follows the drive.
    pub(crate) fn turn_shaft(&mut self, now: u64, speed: Option<i32>) {
        self.drive.turn_shaft(speed);
        if self.next == Self::NEVER {
            self.wake(now);
        }
    }

    /// Trips the drive with fault number `fault`, as
    /// [`Drive::trip`](crate::devices::cansync::drive::Drive::trip) does.
    pub fn trip(&mut self, now: u64, fault: u16) -> bool {
        let trips = self.drive.trip(fault);
        if trips && self.next == Self::NEVER {
            self.wake(now);
        }
        trips
    }
}
