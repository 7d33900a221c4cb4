//! A drive at the BAPS in the mode "synchronous reference position". Configurations B and C use it.

use super::check;
use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::omega_drive_line_2::registers::{BAPS, BAPS_CTRL_BMSTRUCT};
use commram::memory::MemoryError;

/// Parameters of the drive: SYNC slot and offset, angle reference value, angle actual value, operating mode.
const SYNC_SLOT: u16 = 167;
const SYNC_OFFSET: u16 = 168;
const ANGLE_REFERENCE: u16 = 258;
const ANGLE_ACTUAL: u16 = 303;
const OPERATING_MODE: u16 = 304;
const SYNCHRONOUS_POSITION: u16 = 1;
/// The movement of the drive: the number of reference values, and the distance between two of them in 2^-32
/// revolutions.
const REFERENCES: u32 = 400;
const STEP: u32 = 100_003;
/// Smallest difference that the position loop of the drive detects.
const NEAR: u32 = 32;
/// Number of cycles of the cyclic task after which `BAPS_INIT` is enabled (manual p. 63).
pub(crate) const CYCLES_BEFORE_INIT: u32 = 5;

/// Returns the control word that brings a drive with this status word nearer to operation.
pub(crate) fn control_word(status: u16) -> u16 {
    match status & 0x006F {
        0x0021 => 0x0007,
        0x0023 | 0x0027 => 0x000F,
        _ => 0x0006,
    }
}

/// Writes parameters of the drive one after the other, as an engineer does on the device with the service tool.
struct Commissioning {
    _BAPS_SD_DATA: BAPS_BMSTRUCT,
    write: BAPS_PAR_WRITE,
    service: BAPS_SD_CONTROL,
    /// Words that still have to be written; the last element is the next word.
    left: Vec<(u16, u16)>,
}

impl Commissioning {
    fn cycle(&mut self, _BAPS: &Base<BAPS_CTRL_BMSTRUCT>) -> Result<Progress, String> {
        let Some((number, value)) = self.left.last() else { return Ok(Progress::Done) };
        (self.write.u_PAR_NR, self.write.ud_PAR_VALUE) = (*number, u32::from(*value));
        self.write.x_EN = true;
        self.write.call(&mut self._BAPS_SD_DATA);
        self.service.call(_BAPS, &mut self._BAPS_SD_DATA);
        check(self.write.x_ERR, "BAPS_PAR_WRITE", self.write.i_ERR_DETAIL as u16)?;
        if self.write.x_OK {
            self.write = BAPS_PAR_WRITE::default();
            self.left.pop();
        }
        Ok(Progress::Again)
    }
}

/// A drive that follows an angle which the event task generates.
pub(crate) struct SynchronousDrive {
    _BAPS: Base<BAPS_CTRL_BMSTRUCT>,
    setup: Commissioning,
    init: BAPS_INIT,
    comm: BAPS_PD_COMM2,
    watch: BAPS_PD_CONTROL,
    /// Mask of the bits of the angle reference value that have an effect.
    mask: u32,
    angle: u32,
    /// Number of remaining reference values of the movement.
    left: u32,
    cycles: u32,
}

impl SynchronousDrive {
    /// Makes a drive with a SYNC slot of `slot_us`, with this `w_COMMAND_REG` and this mask over P258 (manual p. 74).
    pub(crate) fn new(ram: &Ram, slot_us: u16, w_COMMAND_REG: u16, mask: u32) -> Result<Self, MemoryError> {
        let left = vec![(OPERATING_MODE, SYNCHRONOUS_POSITION), (SYNC_OFFSET, 0), (SYNC_SLOT, slot_us)];
        Ok(SynchronousDrive {
            _BAPS: ram.at(BAPS)?,
            setup: Commissioning {
                _BAPS_SD_DATA: BAPS_BMSTRUCT::default(),
                write: BAPS_PAR_WRITE::default(),
                service: BAPS_SD_CONTROL::default(),
                left,
            },
            // `BAPS_INIT` enables no event, because another event starts the exchange of process data.
            init: BAPS_INIT {
                w_COMMAND_REG,
                u_WR_PAR_NR0: ANGLE_REFERENCE,
                u_RD_PAR_NR0: ANGLE_ACTUAL,
                u_RD_PAR_NR1: ANGLE_REFERENCE,
                ..Default::default()
            },
            comm: BAPS_PD_COMM2 { w_COMMAND_REG, ..Default::default() },
            watch: BAPS_PD_CONTROL::default(),
            mask,
            angle: 0,
            left: REFERENCES,
            cycles: 0,
        })
    }

    /// Exchanges process data, then calculates the next reference value. The event task calls it (manual p. 65).
    pub(crate) fn exchange(&mut self) -> Result<(), String> {
        if !self.init.x_OK {
            return Ok(());
        }
        self.comm.w_CONTROLWORD = control_word(self.comm.w_STATUSWORD);
        self.comm.ud_WR_VALUE0 = self.angle & self.mask;
        self.comm.call(&self._BAPS);
        check(self.comm.x_ERR, "BAPS_PD_COMM2", self.comm.b_SL_QUIT.into())?;
        let enabled = self.comm.w_STATUSWORD & 0x006F == 0x0027;
        if !enabled || self.comm.w_STATUS_REG & 1 == 0 {
            // The movement begins at the position of the drive.
            self.angle = self.comm.ud_RD_VALUE0;
        } else if self.left > 0 {
            self.left -= 1;
            self.angle = self.angle.wrapping_add(STEP);
        }
        Ok(())
    }

    /// Sets the drive up, until it is enabled, synchronized and at the end of its movement. The cyclic task calls it.
    pub(crate) fn cyclic(&mut self) -> Result<Progress, String> {
        self.cycles += 1;
        if self.cycles <= CYCLES_BEFORE_INIT || self.setup.cycle(&self._BAPS)? == Progress::Again {
            return Ok(Progress::Again);
        }
        if !self.init.x_OK {
            self.init.call(&self._BAPS);
            return check(self.init.x_ERR, "BAPS_INIT", self.init.b_ERR.into()).map(|()| Progress::Again);
        }
        self.watch.call(&self._BAPS);
        check(self.watch.x_ERR, "BAPS_PD_CONTROL", 0)?;
        let end = self.angle & self.mask;
        let distance = (self.comm.ud_RD_VALUE0.wrapping_sub(end) as i32).unsigned_abs();
        let arrived = self.left == 0 && self.comm.ud_RD_VALUE1 == end && distance <= NEAR;
        Ok(Progress::done_if(arrived))
    }

    /// Returns the end of the movement in the form in which the drive shows it in P258.
    pub(crate) fn end(&self) -> u32 {
        self.comm.ud_RD_VALUE1
    }
}
