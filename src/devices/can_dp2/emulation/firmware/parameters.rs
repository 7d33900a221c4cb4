//! The parameters: octets of Set_Prm, and their checks (p. 10, 20-24, 27-30).

use crate::devices::can_dp2::registers::gsd;
use crate::devices::can_dp2::registers::values::{
    flags_1, flags_2, prm_station_status as status, wakeup_time,
};
use serde::{Deserialize, Serialize};

/// Number of octets of a valid Set_Prm (p. 10, 22).
pub(in crate::devices::can_dp2::emulation) const LENGTH: usize = 16;

/// Ident number (p. 19, 22).
pub(in crate::devices::can_dp2::emulation) const IDENT: [u8; 2] = gsd::IDENT_NUMBER.to_be_bytes();

/// Bit rates by their index, in bit/s (p. 23, 28).
const BIT_RATES: [u32; 14] = [
    1_000_000, 666_600, 500_000, 333_300, 250_000, 166_000, 125_000, 100_000, 66_600, 50_000, 33_300, 20_000,
    12_500, 10_000,
];

/// A valid Set_Prm with default values: the octets of the DP standard, then the user's octets from the device
/// description file (p. 22-24).
const DEFAULTS: [u8; LENGTH] = {
    let mut octets = [0x88, 1, 10, 11, IDENT[0], IDENT[1], 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    octets.split_at_mut(LENGTH - gsd::DEFAULTS.len()).1.copy_from_slice(&gsd::DEFAULTS);
    octets
};

/// A wrong octet of Set_Prm (p. 20-21).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) struct PrmFault {
    /// Number of the octet in the telegram, from 0 (D-374).
    pub number: u8,
    /// Value that would have been right.
    pub right: u8,
    /// True if the telegram requests Freeze or Sync, which the device does not have (p. 10, 17). The
    /// diagnosis reports this in addition to any other fault.
    pub is_unsupported: bool,
}

/// Role of the gateway on CAN (p. 29).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices::can_dp2::emulation) enum Role {
    /// Neither CANopen master nor CANopen slave: CANopen settings have no effect.
    Layer2,
    /// The gateway is a CANopen master.
    Master,
    /// CANopen slave with this number.
    Slave(u8),
}

/// Functions that a master can request but the device does not have (p. 10).
const UNSUPPORTED: u8 = status::FREEZE_REQ | status::SYNC_REQ;

/// Bits of the first flags that the manual does not use (p. 28).
const UNUSED_FLAGS: u8 = 0x60;

/// Returns the right value of octet `number` if the octet is wrong. `octets` must contain all octets up to
/// this one.
fn right_octet(octets: &[u8], number: usize) -> Option<u8> {
    let octet = octets[number];
    let right = match number {
        0 => octet & !UNSUPPORTED,
        // If the watchdog is on, both of its factors must be above 0.
        1 | 2 if octets[0] & status::WD_ON != 0 => octet.max(1),
        4 => IDENT[0],
        5 => IDENT[1],
        7 | 12 => 0,
        8 if usize::from(octet) >= BIT_RATES.len() => DEFAULTS[8],
        // The manual does not have the combination of slave and master (p. 29).
        9 => {
            let both = flags_1::CANOPEN_MASTER | flags_1::CANOPEN_SLAVE;
            let too_much = if octet & both == both { flags_1::CANOPEN_MASTER } else { 0 };
            octet & !(UNUSED_FLAGS | too_much)
        }
        // Number of the CANopen slave: only a slave must have one (D-375).
        10 if octet > 127 || octets[9] & flags_1::CANOPEN_SLAVE != 0 && octet == 0 => DEFAULTS[10],
        11 => octet & (flags_2::CAN_DIAGNOSIS | flags_2::RX_COUNTER | flags_2::TX_COUNTER),
        _ => octet,
    };
    (octet != right).then_some(right)
}

/// Valid parameters of the slave.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) struct Parameters {
    /// Octets of Set_Prm as the slave received them.
    pub octets: [u8; LENGTH],
}

impl Parameters {
    /// Checks the octets of a Set_Prm. A wrong ident number is reported first, because the telegram is then
    /// for another device. Otherwise the error names the first wrong octet. A missing or additional octet
    /// counts as an error after all others (D-375).
    pub(in crate::devices::can_dp2::emulation) fn parse(octets: &[u8]) -> Result<Self, PrmFault> {
        let is_unsupported = octets.first().is_some_and(|status| status & UNSUPPORTED != 0);
        let fault = |(number, right): (usize, u8)| PrmFault { number: number as u8, right, is_unsupported };
        let wrong = |number: usize| right_octet(octets, number).map(|right| (number, right));
        let places = [4, 5].into_iter().chain(0..octets.len().min(LENGTH));
        if let Some(found) = places.filter(|number| *number < octets.len()).find_map(wrong) {
            return Err(fault(found));
        }
        match <[u8; LENGTH]>::try_from(octets) {
            Ok(octets) => Ok(Parameters { octets }),
            Err(_) => {
                let number = octets.len().min(LENGTH);
                Err(fault((number, DEFAULTS.get(number).copied().unwrap_or(0))))
            }
        }
    }

    /// Returns the watchdog time in us; `None` without a watchdog. If the master sends no request within this
    /// time, the slave ends data exchange.
    pub(in crate::devices::can_dp2::emulation) fn watchdog_us(&self) -> Option<u64> {
        let factors = u64::from(self.octets[1]) * u64::from(self.octets[2]);
        (self.octets[0] & status::WD_ON != 0).then_some(factors * 10_000)
    }

    /// True if the master releases the slave for other masters.
    pub(in crate::devices::can_dp2::emulation) fn unlocks(&self) -> bool {
        self.octets[0] & status::UNLOCK_REQ != 0
    }

    /// True if the master reserves the slave.
    pub(in crate::devices::can_dp2::emulation) fn locks(&self) -> bool {
        self.octets[0] & status::LOCK_REQ != 0
    }

    /// Returns the minimum number of bit times before an answer.
    pub(in crate::devices::can_dp2::emulation) fn min_tsdr(&self) -> u64 {
        self.octets[3].into()
    }

    /// Returns the bit rate of CAN in bit/s.
    pub(in crate::devices::can_dp2::emulation) fn can_bit_s(&self) -> u32 {
        BIT_RATES.get(usize::from(self.octets[8])).copied().unwrap_or_default()
    }

    fn flag_1(&self, flag: u8) -> bool {
        self.octets[9] & flag != 0
    }

    pub(in crate::devices::can_dp2::emulation) fn role(&self) -> Role {
        if self.flag_1(flags_1::CANOPEN_SLAVE) {
            Role::Slave(self.octets[10])
        } else if self.flag_1(flags_1::CANOPEN_MASTER) {
            Role::Master
        } else {
            Role::Layer2
        }
    }

    /// True if the master starts the network.
    pub(in crate::devices::can_dp2::emulation) fn has_start_frame(&self) -> bool {
        self.flag_1(flags_1::START_FRAME)
    }

    /// True if the gateway sends remote frames for its inputs.
    pub(in crate::devices::can_dp2::emulation) fn has_rtr(&self) -> bool {
        !self.flag_1(flags_1::NO_RTR)
    }

    /// True if identifiers are defined by pages (p. 50).
    pub(in crate::devices::can_dp2::emulation) fn has_pages(&self) -> bool {
        self.flag_1(flags_1::PAGE_MODE)
    }

    /// True if the gateway has a Communication Window.
    pub(in crate::devices::can_dp2::emulation) fn has_window(&self) -> bool {
        self.flag_1(flags_1::WINDOW)
    }

    pub(in crate::devices::can_dp2::emulation) fn has_can_diagnosis(&self) -> bool {
        self.octets[11] & flags_2::CAN_DIAGNOSIS != 0
    }

    /// True if the last octet of each input counts received frames. Pages have separate counters (D-467).
    pub(in crate::devices::can_dp2::emulation) fn has_rx_counter(&self) -> bool {
        !self.has_pages() && self.octets[11] & flags_2::RX_COUNTER != 0
    }

    /// True if a change of the last octet of an output sends the output again.
    pub(in crate::devices::can_dp2::emulation) fn has_tx_counter(&self) -> bool {
        !self.has_pages() && self.octets[11] & flags_2::TX_COUNTER != 0
    }

    /// Returns the wake-up time in s; `None` for the stored wake-up time.
    pub(in crate::devices::can_dp2::emulation) fn wakeup_s(&self) -> Option<u8> {
        Some(self.octets[13]).filter(|time| *time != wakeup_time::STORED)
    }

    /// Returns the SYNC time in ms. 16#FFFF means the stored SYNC time.
    pub(in crate::devices::can_dp2::emulation) fn sync_ms(&self) -> u16 {
        u16::from_be_bytes([self.octets[14], self.octets[15]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(number: usize, octet: u8) -> Result<Parameters, PrmFault> {
        let mut octets = DEFAULTS;
        octets[number] = octet;
        Parameters::parse(&octets)
    }

    #[test]
    fn bit_rates_by_their_index() {
        for (index, bit_s) in
            [(6, 125_000), (0, 1_000_000), (2, 500_000), (4, 250_000), (13, 10_000), (1, 666_600)]
        {
            assert_eq!(with(8, index).unwrap().can_bit_s(), bit_s);
        }
    }

    #[test]
    fn flags_by_their_bits() {
        let rtr = |octet| with(9, octet).unwrap().has_rtr();
        assert!(rtr(0) && !rtr(0x10));
        assert!(with(9, 0x80).unwrap().has_window() && with(9, 0x06).unwrap().has_start_frame());
        assert!(with(9, 0x01).unwrap().has_pages() && !with(9, 0xFE & !0x68).unwrap().has_pages());
        let role = |octet| with(9, octet).unwrap().role();
        assert_eq!((role(0), role(4), role(8)), (Role::Layer2, Role::Master, Role::Slave(1)));
    }

    #[test]
    fn the_minimum_time_before_an_answer_is_a_parameter() {
        for bits in [11, 12, 200, 255] {
            assert_eq!(with(3, bits).unwrap().min_tsdr(), u64::from(bits));
        }
    }

    #[test]
    fn stored_times_are_marked_in_the_parameters() {
        let defaults = Parameters::parse(&DEFAULTS).unwrap();
        assert_eq!((defaults.wakeup_s(), defaults.sync_ms()), (None, 0xFFFF));
        assert_eq!(with(13, 254).unwrap().wakeup_s(), Some(254));
        assert_eq!(with(14, 2).unwrap().sync_ms(), 0x2FF);
        assert_eq!((defaults.watchdog_us(), with(0, 0x80).unwrap().watchdog_us()), (Some(100_000), None));
    }

    /// Checks each octet that can be wrong, with its right value.
    #[test]
    fn a_wrong_octet_is_reported_with_its_number() {
        for (number, octet, right) in [
            (0, 0xA8, 0x88),
            (0, 0x98, 0x88),
            (1, 0, 1),
            (2, 0, 1),
            (4, 5, 4),
            (5, 0xA3, 0xA4),
            (7, 1, 0),
            (8, 14, 6),
            (9, 0x41, 0x01),
            (9, 0x20, 0),
            (9, 0x4C, 0x08),
            (10, 128, 1),
            (11, 0x0F, 7),
            (12, 9, 0),
        ] {
            let fault = with(number, octet).unwrap_err();
            assert_eq!((usize::from(fault.number), fault.right), (number, right), "octet {number} = {octet}");
            assert_eq!(fault.is_unsupported, number == 0);
        }
        let mut slave = DEFAULTS;
        (slave[9], slave[10]) = (8, 0);
        assert_eq!(Parameters::parse(&slave).map_err(|fault| fault.number), Err(10));
    }

    /// Manual p. 17, 20: the report of another device's ident number has priority over any other fault. A
    /// request for Freeze or Sync also sets its bit.
    #[test]
    fn parameters_of_another_device_report_the_ident_number() {
        let fault = |octets: &[u8]| {
            Parameters::parse(octets).map_err(|fault| (fault.number, fault.right, fault.is_unsupported))
        };
        let others = [0x88, 1, 10, 11, 0x80, 0x1D, 0, 0xC0, 0x60];
        // The test sends telegrams that are shorter than, equal to, and longer than a valid telegram.
        for length in [7, 9, 16, 30] {
            let mut octets = others.to_vec();
            octets.resize(length, 0xFF);
            assert_eq!(fault(&octets), Err((4, 4, false)), "{length} octets");
            octets[0] |= 0x30;
            assert_eq!(fault(&octets), Err((4, 4, true)), "{length} octets with Freeze and Sync");
            (octets[4], octets[2]) = (4, 0);
            assert_eq!(fault(&octets), Err((5, 0xA4, true)), "{length} octets of the same manufacturer");
        }
        // A wrong octet is reported before a missing or additional one.
        let mut long = [&DEFAULTS[..], &[0; 4]].concat();
        assert_eq!(fault(&long), Err((16, 0, false)));
        long[8] = 14;
        assert_eq!(fault(&long), Err((8, 6, false)));
        long[0] |= 0x20;
        assert_eq!(fault(&long), Err((0, 0x88, true)));
        assert_eq!(fault(&long[..12]), Err((0, 0x88, true)));
    }

    #[test]
    fn wrong_lengths_report_the_position() {
        let fault = |octets: &[u8]| Parameters::parse(octets).map_err(|fault| (fault.number, fault.right));
        assert_eq!(fault(&DEFAULTS[..7]), Err((7, 0)));
        assert_eq!(fault(&DEFAULTS[..8]), Err((8, 6)));
        assert_eq!(fault(&[]), Err((0, 0x88)));
        assert_eq!(fault(&[&DEFAULTS[..], &[0]].concat()), Err((16, 0)));
    }
}
