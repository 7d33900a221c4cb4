//! The register that an operation names, and the reasons to refuse it.

use super::{Code, Host, Refused, Waited};
use crate::identity::DeviceIndex;
use crate::layout::{Address, DeviceLayout, NamedLocation, Owner, Test, Width, plc_prefix};
use crate::plant::ForceError;

/// A register of an operation. Its PLC exists, and its address suits its width; both were checked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Register {
    pub plc: DeviceIndex,
    device: &'static DeviceLayout,
    pub address: Address,
}

impl Register {
    pub(crate) fn check(
        host: &dyn Host,
        plc: DeviceIndex,
        offset: u32,
        width: Width,
    ) -> Result<Self, Refused> {
        let plc = known_plc(host, plc)?;
        let device = device_of(host, plc);
        let address = device.at(width, offset);
        if !offset.is_multiple_of(width.bytes()) {
            let text = format_args!("{address}: {}", width.alignment_rule());
            return Err(Refused::new(Code::MISALIGNED, text));
        }
        Ok(Self { plc, device, address })
    }

    /// Returns the name and address for messages, with the PLC if there are several: `saw:node2.w_CPU_CONTROL
    /// (%MW3.200000)`.
    pub(crate) fn label(self, host: &dyn Host) -> String {
        let names = host.plant().names();
        let plc = self.plc;
        let prefix = plc_prefix(&names.plcs, plc);
        let Ok(place) = NamedLocation::parse(&names.fitted(plc), &self.address.to_string()) else {
            return format!("{prefix}{}", self.address);
        };
        let status =
            place.status().and_then(|it| host.plant().load(self.plc, it.offset(), Width::of(it.ty())).ok());
        format!("{prefix}{}", place.label(place.phase(status)))
    }

    pub(crate) fn fits(self, host: &dyn Host, value: u32) -> Result<(), Refused> {
        let width = self.address.width();
        if value <= width.max_value() {
            return Ok(());
        }
        let most = width.max_value();
        let text = format_args!(
            "{}: 16#{value:X} does not fit, a {width} holds at most 16#{most:X}",
            self.label(host)
        );
        Err(Refused::new(Code::VALUE_TOO_WIDE, text))
    }

    /// Checks that the condition of the register can become true, and is not true for every value.
    pub(crate) fn can_match(self, host: &dyn Host, test: Test) -> Result<(), Refused> {
        let Test { mask, value, .. } = test;
        self.fits(host, mask)?;
        self.fits(host, value)?;
        if !test.is_decided() {
            return Ok(());
        }
        let text = format_args!(
            "{}: 16#{value:X} can never match under the mask 16#{mask:X}; clear the bits outside the mask",
            self.label(host)
        );
        Err(Refused::new(Code::NEVER_MATCHES, text))
    }

    /// Refuses words of the front panel that only the firmware writes, for example the display.
    pub(crate) fn writable(self) -> Result<(), Refused> {
        let address = self.address;
        if !self.device.is_front(address.offset()) {
            return Ok(());
        }
        let words = self.device.registers_at(address, None).unwrap_or_default();
        let Some(word) = words.first() else { return Err(self.unmapped()) };
        if word.address() != address {
            let text =
                format_args!("{address}: only the whole word can be written, {} of {word}", word.address());
            return Err(Refused::new(Code::NOT_WHOLE, text));
        }
        if word.owner() == Owner::Firmware {
            let text = format_args!("{word} ({address}) is set by the firmware; it can only be read");
            return Err(Refused::new(Code::READ_ONLY, text));
        }
        Ok(())
    }

    pub(crate) fn load(self, host: &dyn Host) -> Result<u32, Refused> {
        let loaded = host.plant().load(self.plc, self.address.offset(), self.address.width());
        loaded.map_err(|_| self.unmapped())
    }

    pub(crate) fn unmapped(self) -> Refused {
        Refused::new(
            Code::UNMAPPED,
            format_args!("{}: {}", self.address, self.device.not_covered(self.address)),
        )
    }

    pub(crate) fn not_in_time(self, host: &dyn Host, waited: Waited) -> Refused {
        let Waited { time_us, value } = waited;
        let digits = self.address.width().bytes() as usize * 2;
        let text = format_args!(
            "{} did not become the awaited value in time; at {time_us} us it is 16#{value:0digits$X}",
            self.label(host)
        );
        Refused { waited: Some(waited), ..Refused::new(Code::NOT_IN_TIME, text) }
    }

    pub(crate) fn not_forcible(self, error: &ForceError) -> Refused {
        match error {
            ForceError::TooMany => Refused::new(Code::TOO_MANY_FORCES, error),
            ForceError::NotWhole { .. } => Refused::new(Code::NOT_WHOLE, error),
            ForceError::TooWide { .. } => Refused::new(Code::VALUE_TOO_WIDE, error),
            ForceError::NoSuchPlc | ForceError::NoArea(_) | ForceError::Memory(_) => self.unmapped(),
        }
    }
}

/// Returns the register map of a PLC. The PLC must exist.
pub(super) fn device_of(host: &dyn Host, plc: DeviceIndex) -> &'static DeviceLayout {
    host.plant().devices().get(plc.index()).map_or(&DeviceLayout::UNKNOWN, |device| device.layout())
}

pub(super) fn known_plc(host: &dyn Host, plc: DeviceIndex) -> Result<DeviceIndex, Refused> {
    let count = host.plant().devices().len();
    if plc.index() < count {
        return Ok(plc);
    }
    let text = format_args!("PLC {plc} does not exist; the instance has {count}, numbered from 0");
    Err(Refused::new(Code::UNKNOWN_PLC, text))
}
