//! Values that CANsync registers take, in one place.

/// Bytes written to and read from handshake registers (manual 5.00005.03a p. 151-157, 175-187).
pub struct Code;

impl Code {
    /// The PLC: data are valid, send them.
    pub const RELEASED: u8 = 0x05;
    /// The firmware: done.
    pub const DONE: u8 = 0x04;
    /// The firmware: a frame was received.
    pub const RECEIVED: u8 = 0x02;
    /// The PLC: take the next slave number in every interval by itself.
    pub const AUTOMATIC: u8 = 0x80;
}

/// `w_CPU_CONTROL` (manual 5.00005.03a p. 149, 174).
pub(super) mod control {
    pub(crate) const RESTART: u16 = 0x0000;
    pub(crate) const HANDSHAKE: u16 = 0x0001;
    pub(crate) const TAKE_OVER_INIT_DATA: u16 = 0x0002;
    pub(crate) const RESERVED: [u16; 2] = [0x0012, 0x0013];
    pub(crate) const START_SYNCHRONOUS: u16 = 0x0020;
    pub(crate) const ENABLE_ACTIVE: u16 = 0x0040;
    pub(crate) const RESET_CONTROLLER: u16 = 0x0080;
}

/// `w_CANsync_STATUS` (manual 5.00005.03a p. 148, 173).
pub(super) mod status {
    pub(crate) const OVERRUN: u16 = 1 << 1;
    pub(crate) const SEND_BUFFER_FREE: u16 = 1 << 2;
    pub(crate) const SEND_JOB_DONE: u16 = 1 << 3;
    pub(crate) const RECEIVING: u16 = 1 << 4;
    pub(crate) const SENDING: u16 = 1 << 5;
    pub(crate) const WARNING: u16 = 1 << 6;
    pub(crate) const BUS_OFF: u16 = 1 << 7;
    /// The bits that change with every frame.
    pub(crate) const TRAFFIC: u16 = SEND_BUFFER_FREE | SEND_JOB_DONE | RECEIVING | SENDING;
}

/// Automatic slave numbers (manual 5.00005.03a p. 159-160; counters: decision D-08).
pub mod auto {
    use super::Code;
    use crate::devices::cansync::bus::LAST_SLAVE;

    /// A counter behind a register that takes a slave number or 16#80.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Counter(Option<u8>);

    impl Counter {
        /// Begins a new interval: 0 in the first one of active operation, then one more each time up to
        /// `max` (`b_MAX_SL_NR`; above 31 it counts as 31, decision D-25), then 0 again.
        #[inline]
        pub fn next_interval(&mut self, max: u8) {
            self.0 = Some(match self.0 {
                Some(n) if n < max.min(LAST_SLAVE) => n + 1,
                _ => 0,
            });
        }

        /// Back to the state before active operation.
        pub fn restart(&mut self) {
            self.0 = None;
        }

        /// The slave number that `register` means in this interval; `None` if it names nobody (decision D-25).
        #[inline]
        pub fn resolve(self, register: u8) -> Option<u8> {
            match register {
                0..=LAST_SLAVE => Some(register),
                Code::AUTOMATIC => Some(self.0.unwrap_or(0)),
                _ => None,
            }
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        /// T19: 16#80 with `b_MAX_SL_NR` = 3 asks 0, 1, 2, 3, 0, 1 ...
        #[test]
        fn counts_to_the_maximum_and_starts_again() {
            let mut counter = Counter::default();
            let asked: Vec<_> = (0..6)
                .map(|_| {
                    counter.next_interval(3);
                    counter.resolve(Code::AUTOMATIC)
                })
                .collect();
            assert_eq!(asked, [0, 1, 2, 3, 0, 1].map(Some));
            assert_eq!(counter.resolve(7), Some(7));
        }

        #[test]
        fn a_number_that_no_slave_has_names_nobody() {
            let counter = Counter(Some(5));
            for register in 0..=u8::MAX {
                let expected = match register {
                    0..=31 => Some(register),
                    0x80 => Some(5),
                    _ => None,
                };
                assert_eq!(counter.resolve(register), expected, "16#{register:02X}");
            }
        }

        #[test]
        fn a_maximum_that_no_slave_has_counts_as_31() {
            for max in [31, 32, 127, 128, 255] {
                let mut counter = Counter(Some(30));
                counter.next_interval(max);
                assert_eq!(counter.resolve(Code::AUTOMATIC), Some(31), "{max}");
                counter.next_interval(max);
                assert_eq!(counter.resolve(Code::AUTOMATIC), Some(0), "{max}");
            }
        }

        #[test]
        fn a_lowered_maximum_starts_again_at_zero() {
            let mut counter = Counter::default();
            for _ in 0..6 {
                counter.next_interval(31);
            }
            counter.next_interval(2);
            assert_eq!(counter.resolve(Code::AUTOMATIC), Some(0));
        }
    }
}
