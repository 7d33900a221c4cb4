//! The parameters: what Set_Prm brings, and what of it is wrong (p. 10, 20-24, 27-30).

use super::registers::gsd;
use super::registers::values::{flags_1, flags_2, prm_station_status as status, wakeup_time};
use serde::{Deserialize, Serialize};

/// Octets of a good Set_Prm (p. 10, 22).
pub(super) const LENGTH: usize = 16;

/// Ident number (p. 19, 22).
pub(super) const IDENT: [u8; 2] = gsd::IDENT_NUMBER.to_be_bytes();

/// Bit rates by their index, in bit/s (p. 23, 28).
const BIT_RATES: [u32; 14] = [
    1_000_000, 666_600, 500_000, 333_300, 250_000, 166_000, 125_000, 100_000, 66_600, 50_000, 33_300, 20_000,
    12_500, 10_000,
];

/// The octets of a good Set_Prm without anything special: those of the DP standard, then the user's by the device description file
/// (p. 22-24).
const DEFAULTS: [u8; LENGTH] = {
    let mut octets = [0x88, 1, 10, 11, IDENT[0], IDENT[1], 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    octets.split_at_mut(LENGTH - gsd::DEFAULTS.len()).1.copy_from_slice(&gsd::DEFAULTS);
    octets
};

/// SYNC time that means the one that is stored (p. 30).
const SYNC_STORED: u16 = 0xFFFF;

/// What is wrong with an octet of Set_Prm (p. 20-21).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct PrmFault {
    /// Its number, from 0 over the telegram (D-374).
    pub number: u8,
    /// The right value.
    pub right: u8,
    /// It asks for a function that the device does not have, and is not wrong otherwise.
    pub is_unsupported: bool,
}

/// What the gateway is on CAN (p. 29).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// Neither: CANopen settings do not count.
    Layer2,
    /// CANopen master.
    Master,
    /// CANopen slave with this number.
    Slave(u8),
}

/// Good parameters.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Parameters {
    /// As they came.
    pub octets: [u8; LENGTH],
}

impl Parameters {
    /// Looks at the octets of a Set_Prm, from the first one on; the first that is wrong counts.
    pub(super) fn parse(octets: &[u8]) -> Result<Self, PrmFault> {
        let wrong =
            |number: usize, right: u8| PrmFault { number: number as u8, right, is_unsupported: false };
        let taken: [u8; LENGTH] = match octets.len() {
            LENGTH => octets.try_into().unwrap_or(DEFAULTS),
            // D-375: the first octet that is not there, or there too much.
            short @ 0..LENGTH => return Err(wrong(short, DEFAULTS[short])),
            _ => return Err(wrong(LENGTH, 0)),
        };
        let it = Parameters { octets: taken };
        let has_watchdog = taken[0] & status::WD_ON != 0;
        let unused = |number: usize, bits: u8| {
            (taken[number] & bits != 0).then(|| wrong(number, taken[number] & !bits))
        };
        let unsupported = status::FREEZE_REQ | status::SYNC_REQ;
        if taken[0] & unsupported != 0 {
            return Err(PrmFault { is_unsupported: true, ..wrong(0, taken[0] & !unsupported) });
        }
        if let Some(number) = [1, 2].into_iter().find(|number| has_watchdog && taken[*number] == 0) {
            return Err(wrong(number, 1));
        }
        for (number, right) in [(4, IDENT[0]), (5, IDENT[1]), (7, 0)] {
            if taken[number] != right {
                return Err(wrong(number, right));
            }
        }
        if usize::from(taken[8]) >= BIT_RATES.len() {
            return Err(wrong(8, DEFAULTS[8]));
        }
        // Slave and master at once is no combination of the manual (p. 29).
        let both = flags_1::CANOPEN_MASTER | flags_1::CANOPEN_SLAVE;
        let never = 0x60;
        let too_much = if taken[9] & both == both { never | flags_1::CANOPEN_MASTER } else { never };
        if let Some(fault) = unused(9, too_much) {
            return Err(fault);
        }
        // A number counts for a slave only (D-375).
        let is_slave = taken[9] & flags_1::CANOPEN_SLAVE != 0;
        if taken[10] > 127 || is_slave && taken[10] == 0 {
            return Err(wrong(10, DEFAULTS[10]));
        }
        let known = flags_2::CAN_DIAGNOSIS | flags_2::RX_COUNTER | flags_2::TX_COUNTER;
        match unused(11, !known).or_else(|| unused(12, 0xFF)) {
            Some(fault) => Err(fault),
            None => Ok(it),
        }
    }

    /// Time without a request of its master after which the slave leaves data exchange, in us; none without a watchdog.
    pub(super) fn watchdog_us(&self) -> Option<u64> {
        let factors = u64::from(self.octets[1]) * u64::from(self.octets[2]);
        (self.octets[0] & status::WD_ON != 0).then_some(factors * 10_000)
    }

    /// Whether it is to be free for other masters.
    pub(super) fn unlocks(&self) -> bool {
        self.octets[0] & status::UNLOCK_REQ != 0
    }

    /// Whether its master keeps it for itself.
    pub(super) fn locks(&self) -> bool {
        self.octets[0] & status::LOCK_REQ != 0
    }

    /// Bit times until an answer, at least.
    pub(super) fn min_tsdr(&self) -> u64 {
        self.octets[3].into()
    }

    /// Bit rate of CAN.
    pub(super) fn can_bit_s(&self) -> u32 {
        BIT_RATES.get(usize::from(self.octets[8])).copied().unwrap_or_default()
    }

    fn flag_1(&self, flag: u8) -> bool {
        self.octets[9] & flag != 0
    }

    pub(super) fn role(&self) -> Role {
        if self.flag_1(flags_1::CANOPEN_SLAVE) {
            Role::Slave(self.octets[10])
        } else if self.flag_1(flags_1::CANOPEN_MASTER) {
            Role::Master
        } else {
            Role::Layer2
        }
    }

    /// Whether it starts the network as master.
    pub(super) fn has_start_frame(&self) -> bool {
        self.flag_1(flags_1::START_FRAME)
    }

    /// Whether it asks for what its inputs are to bring.
    pub(super) fn has_rtr(&self) -> bool {
        !self.flag_1(flags_1::NO_RTR)
    }

    /// Whether identifiers come by pages (p. 50).
    pub(super) fn has_pages(&self) -> bool {
        self.flag_1(flags_1::PAGE_MODE)
    }

    /// Whether it has a Communication Window.
    pub(super) fn has_window(&self) -> bool {
        self.flag_1(flags_1::WINDOW)
    }

    pub(super) fn has_can_diagnosis(&self) -> bool {
        self.octets[11] & flags_2::CAN_DIAGNOSIS != 0
    }

    /// Whether the last octet of each input counts what has come. Pages have counters of their own (D-467).
    pub(super) fn has_rx_counter(&self) -> bool {
        !self.has_pages() && self.octets[11] & flags_2::RX_COUNTER != 0
    }

    /// Whether the last octet of each output lets it be sent anew.
    pub(super) fn has_tx_counter(&self) -> bool {
        !self.has_pages() && self.octets[11] & flags_2::TX_COUNTER != 0
    }

    /// Wake-up time in s; none: the one that is stored.
    pub(super) fn wakeup_s(&self) -> Option<u8> {
        Some(self.octets[13]).filter(|time| *time != wakeup_time::STORED)
    }

    /// SYNC time in ms; none: the one that is stored.
    pub(super) fn sync_ms(&self) -> Option<u16> {
        Some(u16::from_be_bytes([self.octets[14], self.octets[15]])).filter(|time| *time != SYNC_STORED)
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
    fn answers_may_be_wanted_late() {
        for bits in [11, 12, 200, 255] {
            assert_eq!(with(3, bits).unwrap().min_tsdr(), u64::from(bits));
        }
    }

    #[test]
    fn times_that_are_stored_are_none() {
        let defaults = Parameters::parse(&DEFAULTS).unwrap();
        assert_eq!((defaults.wakeup_s(), defaults.sync_ms()), (None, None));
        assert_eq!(with(13, 254).unwrap().wakeup_s(), Some(254));
        assert_eq!(with(14, 2).unwrap().sync_ms(), Some(0x2FF));
        assert_eq!((defaults.watchdog_us(), with(0, 0x80).unwrap().watchdog_us()), (Some(100_000), None));
    }

    /// Each octet that can be wrong, with the right value.
    #[test]
    fn what_is_wrong_is_told_with_its_number() {
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

    #[test]
    fn too_short_or_too_long_tells_where() {
        let fault = |octets: &[u8]| Parameters::parse(octets).map_err(|fault| (fault.number, fault.right));
        assert_eq!(fault(&DEFAULTS[..7]), Err((7, 0)));
        assert_eq!(fault(&DEFAULTS[..8]), Err((8, 6)));
        assert_eq!(fault(&[]), Err((0, 0x88)));
        assert_eq!(fault(&[&DEFAULTS[..], &[0]].concat()), Err((16, 0)));
    }
}
