//! Finds the registers at an address, and the address and registers for a text.

use super::address::Address;
use super::descriptor::{Area, DeviceLayout, RegisterPhase};
use super::device_fit::{DeviceFit, Fit};
use super::error::LayoutError;
use super::name::split_plc;
use super::register::RegisterRef;
use super::space::Space;

/// Length of the header page of an image in bytes.
const HEADER_PAGE: usize = 4096;

/// The PLC, address and registers that a text such as `line2:node2.w_CPU_CONTROL` or `%MW3.200000` means.
#[derive(Debug, Clone)]
pub struct Target<'a> {
    /// The PLC before the colon.
    pub plc: Option<&'a str>,
    /// The place and width of the access.
    pub address: Address,
    /// The area of the target.
    pub area: &'static Area,
    /// The registers at the address. There are several if structures overlay each other, and none in plain RAM and
    /// padding. For a name, only the register of this name.
    pub registers: Vec<RegisterRef>,
}

impl Target<'_> {
    /// Returns the register that is valid in phase `live`. If none is valid, any register.
    #[must_use]
    pub fn register(&self, live: RegisterPhase) -> Option<&RegisterRef> {
        self.registers.iter().find(|found| is_valid(found, live)).or(self.registers.first())
    }
}

fn is_valid(found: &RegisterRef, live: RegisterPhase) -> bool {
    found.placed.live.is_valid_in(live)
}

impl DeviceLayout {
    /// Returns the end of the last area, exclusive.
    #[must_use]
    pub const fn end(&self) -> u32 {
        let areas = match self.areas.last() {
            Some(area) => area.last() + 1,
            None => 0,
        };
        match self.retain {
            Some(retain) if retain.area.last() >= areas => retain.area.last() + 1,
            _ => areas,
        }
    }

    /// Returns the number of bytes of the device's segment: its image file or its RAM on the heap. It is a multiple of
    /// 8, because the access checker compares structures up to their end in words of 64 bits. The image of a device without
    /// areas has the header page only.
    #[must_use]
    pub const fn segment_size(&self) -> usize {
        let end = self.end() as usize;
        if end < HEADER_PAGE { HEADER_PAGE } else { end.next_multiple_of(8) }
    }

    /// Returns the area that contains `address`.
    ///
    /// # Errors
    /// [`LayoutError::NoArea`], which names the areas before and after the address.
    pub fn area_at(&'static self, address: Address) -> Result<&'static Area, LayoutError> {
        let offset = address.offset();
        self.all_areas().find(|area| area.contains(offset)).ok_or_else(|| {
            let hint = self.areas_around(self.space_at(offset), offset.into());
            LayoutError::NoArea { address: self.in_device_spelling(address).to_string(), hint }
        })
    }

    /// Describes the area that precedes byte `offset` of the image and the area that follows it. If `space` is given,
    /// only areas of this space are considered.
    pub(super) fn areas_around(&'static self, space: Option<&Space>, offset: i64) -> String {
        let wanted = |area: &&Area| space.is_none_or(|space| core::ptr::eq(area.space, space));
        let areas = || self.areas.iter().filter(wanted);
        let before = areas().rev().find(|area| i64::from(area.last()) < offset);
        let next = areas().find(|area| i64::from(area.first) > offset);
        match (before, next) {
            (Some(a), Some(b)) => {
                format!("`{}` ends at {}, `{}` starts at {}", a.name, a.end(), b.name, b.begin())
            }
            (None, Some(b)) => format!("the first one, `{}`, starts at {}", b.name, b.begin()),
            (Some(a), None) => format!("the last one, `{}`, ends at {}", a.name, a.end()),
            (None, None) => "there are none".to_owned(),
        }
    }

    /// Returns a message with the reason for which no area contains `address`.
    #[must_use]
    pub fn not_covered(&self, address: Address) -> String {
        let width = address.width();
        if self.is_retain(address.offset()) {
            return format!(
                "this PLC has fewer retain flags than this {width} needs; `retain_bytes` in the plant file gives it more"
            );
        }
        format!("no register area of the device covers this {width}")
    }

    /// Returns the registers that have a byte at `address`, for a device with unknown ports. See
    /// [`DeviceFit::registers_at`].
    ///
    /// # Errors
    /// Returns the errors of [`DeviceFit::registers_at`].
    pub fn registers_at(
        &'static self,
        address: Address,
        live: Option<RegisterPhase>,
    ) -> Result<Vec<RegisterRef>, LayoutError> {
        DeviceFit::unknown(self).registers_at(address, live)
    }

    /// Returns the target of `text`, for a device with unknown ports. See [`DeviceFit::target`].
    ///
    /// # Errors
    /// Returns the errors of [`DeviceFit::target`].
    pub fn target<'a>(&'static self, text: &'a str) -> Result<Target<'a>, LayoutError> {
        DeviceFit::unknown(self).target(text)
    }
}

impl DeviceFit {
    /// Returns the registers that have a byte at `address`. If `live` is given and the structure that is valid in this
    /// phase has registers there, only these are returned.
    ///
    /// # Errors
    /// [`LayoutError::NoArea`], and [`LayoutError::NoRegister`] for plain RAM and padding.
    pub fn registers_at(
        &self,
        address: Address,
        live: Option<RegisterPhase>,
    ) -> Result<Vec<RegisterRef>, LayoutError> {
        let area = self.device().area_at(address)?;
        let first = address.offset();
        let end = first + address.width().bytes();
        let mut found: Vec<RegisterRef> = Vec::new();
        // The structure of the last phase comes first, because users usually mean this structure.
        for placed in self.placed(area).rev() {
            found.extend(
                self.registers_of(area, placed)
                    .filter(|r| r.offset() < end && first < r.offset() + r.width()),
            );
        }
        if let Some(live) = live
            && found.iter().any(|r| is_valid(r, live))
        {
            found.retain(|r| is_valid(r, live));
        }
        if found.is_empty() { Err(self.no_register(area, address)) } else { Ok(found) }
    }

    /// Returns the target of `text`: an address or a name, each with an optional PLC as a prefix. The number of a bit
    /// may follow a name: `node2.w_CPU_CONTROL.2` or `node2.w_CPU_CONTROL.%X2` (IEC 61131-3, 6.5.2.4).
    ///
    /// # Errors
    /// The text does not mean a register or an address of the device. The error gives the correct notation. An address
    /// in plain RAM is not an error.
    pub fn target<'a>(&self, text: &'a str) -> Result<Target<'a>, LayoutError> {
        let (plc, rest) = split_plc(text);
        if rest.starts_with('%') {
            let address = self.device().address(rest)?;
            let area = self.device().area_at(address)?;
            let registers = match self.registers_at(address, None) {
                Ok(registers) => registers,
                Err(LayoutError::NoRegister { .. }) => Vec::new(),
                Err(error) => return Err(error),
            };
            return Ok(Target { plc, address, area, registers });
        }
        let (name, bit) = split_bit(rest);
        let register =
            self.register(name).map_err(|refusal| self.without_percent(rest).unwrap_or(refusal))?;
        let address = match bit {
            None => register.address(),
            Some(bit) => register.bit_address(bit).ok_or_else(|| {
                let (of, last) = (register.ty().name(), 8 * register.width() - 1);
                LayoutError::BadBit { text: rest.to_owned(), bit, of, last }
            })?,
        };
        let area = register.area;
        Ok(Target { plc, address, area, registers: vec![register] })
    }

    /// Returns an error if `text` is an address of the device without its `%`.
    pub(super) fn without_percent(&self, text: &str) -> Option<LayoutError> {
        let right = self.device().address(&format!("%{text}")).ok()?.to_string();
        Some(LayoutError::WrongCase { given: text.to_owned(), right })
    }

    fn no_register(&self, area: &'static Area, address: Address) -> LayoutError {
        let all = || self.placed(area).flat_map(|placed| self.registers_of(area, placed));
        let before = all().filter(|r| r.offset() < address.offset()).max_by_key(RegisterRef::offset);
        let next = all().filter(|r| r.offset() > address.offset()).min_by_key(RegisterRef::offset);
        let hint = match (before, next) {
            (Some(a), Some(b)) => format!("padding between `{}` and `{}`", a.path(), b.path()),
            (Some(a), None) => format!("the last register is `{}` at {}", a.path(), a.address()),
            _ if self.area(area) == Fit::Empty => "nothing is plugged in".to_owned(),
            _ => "plain RAM".to_owned(),
        };
        LayoutError::NoRegister {
            address: self.device().in_device_spelling(address).to_string(),
            area: area.name,
            hint,
        }
    }
}

/// Splits the number of a bit off a name.
fn split_bit(name: &str) -> (&str, Option<u32>) {
    let split = name.rsplit_once('.').and_then(|(name, bit)| {
        let bit = bit.strip_prefix("%X").unwrap_or(bit);
        let is_number = !bit.is_empty() && bit.bytes().all(|digit| digit.is_ascii_digit());
        // A too large number becomes a bit that no register has, so that the error names the bit.
        is_number.then(|| (name, Some(bit.parse().unwrap_or(u32::MAX))))
    });
    split.unwrap_or((name, None))
}

#[cfg(test)]
mod tests {
    use crate::devices::samples::tables::NODES as DEVICE;
    use crate::devices::samples::tables::phases;
    use crate::layout::RegisterPhase;

    fn names(address: &str, live: Option<RegisterPhase>) -> Vec<String> {
        let address = DEVICE.address(address).unwrap();
        DEVICE.registers_at(address, live).unwrap().iter().map(|register| register.path()).collect()
    }

    fn error(address: &str) -> String {
        DEVICE
            .address(address)
            .and_then(|address| DEVICE.registers_at(address, None))
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn overlaid_registers_are_distinguished_by_the_phase() {
        assert_eq!(names("%MB3.200012", None), ["b_CTRLREG_WRC1", "b_MA_SL_MODE"]);
        assert_eq!(names("%MB3.200012", Some(phases::INIT)), ["b_MA_SL_MODE"]);
        assert_eq!(names("%MB3.200012", Some(phases::CYCLIC)), ["b_CTRLREG_WRC1"]);
        // This address is after the end of the INIT structure. So even in the phase INIT only the cyclic structure has
        // a register there.
        assert_eq!(names("%MD3.200052", Some(phases::INIT)), ["a_WR_VALUE[0]"]);
    }

    #[test]
    fn an_address_finds_the_registers_it_touches() {
        assert_eq!(names("%MB3.201025", None), ["a_RD_BMARRAY[3][0]"]);
        assert_eq!(names("%MD3.200000", Some(phases::CYCLIC)), ["w_CPU_CONTROL", "w_OPTION_STATUS"]);
        assert_eq!(names("%MX3.100013.7", Some(phases::CYCLIC)), ["b_CTRLREG_WRC2"]);
        let config = names("%MD3.180020", None);
        assert_eq!(config, ["a_IP_ADDRESS[0]", "a_IP_ADDRESS[1]", "a_IP_ADDRESS[2]", "a_IP_ADDRESS[3]"]);
    }

    #[test]
    fn addresses_outside_registers_are_explained() {
        let first = DEVICE.areas.first().unwrap().name;
        assert_eq!(
            error("%MB3.0"),
            format!("%MB3.0 is not in any area; the first one, `{first}`, starts at %MB3.80000")
        );
        assert_eq!(
            error("%MW3.150000"),
            "%MW3.150000 is not in any area; `node1` ends at %MB3.132767, `ethernet_config` starts at %MB3.180016"
        );
        assert_eq!(
            error("%MB3.4000000"),
            "%MB3.4000000 is not in any area; the last one, `option3`, ends at %MB3.3262143"
        );
        assert!(error("%MB3.1000000").ends_with("area `option1` has no register there (plain RAM)"));
        assert!(error("%MB3.232767").contains("the last register is `a_STAT_SL[31]` at %MB3.203995"));
        let padding = error("%MW3.202894");
        assert!(padding.ends_with("(padding between `b_CTRL_REG_BC1` and `d_SL_MASK_BC1`)"), "{padding}");
    }

    #[test]
    fn a_bit_follows_the_name_of_its_register() {
        let address = |text: &str| DEVICE.target(text).map(|target| target.address.to_string());
        assert_eq!(address("node2.w_CPU_CONTROL.2"), address("%MX3.200000.2"));
        assert_eq!(address("line2:node2.w_CPU_CONTROL.%X9"), address("%MX3.200001.1"));
        assert_eq!(address("node2.a_RD_BMARRAY[3][0].31"), address("%MX3.201027.7"));
        let error = |text: &str| address(text).unwrap_err().to_string();
        assert_eq!(
            error("node2.w_CPU_CONTROL.16"),
            "node2.w_CPU_CONTROL.16: a WORD has bits 0 to 15, not 16"
        );
        assert!(error("node2.w_CPU_CONTROL.99999999999").contains("bits 0 to 15"));
        assert!(error("node2.2").contains("`node2` is a block of registers"));
    }

    #[test]
    fn an_address_needs_its_percent_sign() {
        let error = |text: &str| DEVICE.target(text).unwrap_err().to_string();
        assert_eq!(error("MW3.200000"), "`MW3.200000` is spelled `%MW3.200000`");
        assert_eq!(error("line2:mx3.200000.1"), "`mx3.200000.1` is spelled `%MX3.200000.1`");
        assert!(error("MW3").starts_with("no area has a register"));
    }

    #[test]
    fn a_target_is_a_name_or_an_address() {
        let target = DEVICE.target("line2:node2.a_STAT_SL[4]").unwrap();
        assert_eq!((target.plc, target.address.to_string().as_str()), (Some("line2"), "%MB3.203968"));
        let target = DEVICE.target("%mw3.200002").unwrap();
        assert_eq!(target.register(phases::INIT).unwrap().placed.live, phases::INIT);
        assert_eq!(target.register(phases::CYCLIC).unwrap().placed.live, phases::CYCLIC);
        let plain = DEVICE.target("%MD3.1000000").unwrap();
        assert!(plain.registers.is_empty());
        assert_eq!(plain.area.name, "option1");
        assert!(DEVICE.target("%MD3.0").is_err());
    }
}
