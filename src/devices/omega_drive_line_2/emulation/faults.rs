//! Kinds of faults of the drive at the BAPS.

use super::baps::Pace;
use crate::fault::{self, Fault, FaultKind, Faults, Field, Form, Hit, Owner, TargetKind};
use crate::identity::DeviceIndex;
use crate::journal::Journal;

/// Maximum delay of a drive at the BAPS, in emulated microseconds. It is longer than the monitoring times of
/// the function blocks.
pub(crate) const MAX_SLOWNESS_US: u32 = 60_000_000;

/// Fault of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    /// The drive has this fault, 1 to 65535.
    Trip(u16),
    /// The drive ignores its tasks at the BAPS.
    Silent,
    /// The drive takes commands the given number of microseconds later, 1 to [`MAX_SLOWNESS_US`].
    Slow(u32),
}

static DRIVE_FAULT: FaultKind = FaultKind::new(
    14,
    "baps_drive_fault",
    TargetKind::Device,
    "The drive at the BAPS brakes and waits for a fault reset",
    |fault: &Fault| fault::Effect::new(Effect::Trip(fault.value("error").unwrap_or(0) as u16)),
)
.with(
    const {
        &[Field::new(
            "error",
            Form::Hex { least: 1, most: 0xFFFF, digits: 4 },
            "Fault number, which parameter 308 shows",
        )
        .required("give the fault number, 1 to 16#FFFF")]
    },
)
.once()
.shown("error=17");

static SILENT: FaultKind =
    FaultKind::new(15, "baps_silent", TargetKind::Device, "The drive answers nothing at the BAPS", |_| {
        fault::Effect::new(Effect::Silent)
    })
    .shown("duration=4s");

static SLOW: FaultKind = FaultKind::new(
    16,
    "baps_slow",
    TargetKind::Device,
    "The drive answers late at the BAPS",
    |fault: &Fault| fault::Effect::new(Effect::Slow(fault.value("delay_us").unwrap_or(0))),
)
.with(
    const {
        &[Field::new(
            "delay_us",
            Form::Time { least: 1, most: MAX_SLOWNESS_US as u64 },
            "Delay of each action of the drive, in us",
        )
        .or("us")
        .required("give it in microseconds")]
    },
)
.shown("delay=3.5s count=1");

/// All kinds of faults of the device.
pub(crate) static KINDS: &[&FaultKind] = &[&DRIVE_FAULT, &SILENT, &SLOW];

/// Returns when the drive takes a command at its BAPS. A silent drive takes no command, so it cannot also be
/// slow.
#[inline]
pub(super) fn pace(
    faults: &mut Faults,
    now: u64,
    plc: DeviceIndex,
    has_waited: bool,
    journal: &mut Journal,
) -> Pace {
    if faults.is_empty() {
        return Pace::AtOnce;
    }
    let owner = Owner::Device(plc);
    let is_silent = faults.acting(owner).any(|(_, effect)| matches!(effect, Effect::Silent));
    let mut pace = Pace::AtOnce;
    faults.fire(now, owner, journal, |_, effect: &Effect, _| {
        match *effect {
            Effect::Silent => pace = Pace::Never,
            Effect::Slow(us) if !is_silent && !has_waited => {
                let longest = if let Pace::Late(other) = pace { us.max(other) } else { us };
                pace = Pace::Late(longest);
            }
            Effect::Slow(_) | Effect::Trip(_) => return None,
        }
        Some(Hit::Plain)
    });
    pace
}
