//! Identities in a plant: indices of devices and buses.
//!
//! In files and on wires an identity is its plain number. `plc` in journals, plant files, JSON and the channel is a
//! [`DeviceIndex`], `bus` a [`BusIndex`].

use core::fmt;

macro_rules! indices {
    ($($(#[$doc:meta])* $name:ident: $number:ident;)+) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[cfg_attr(feature = "emulator", derive(serde::Serialize, serde::Deserialize), serde(transparent))]
        #[repr(transparent)]
        pub struct $name(pub $number);

        impl $name {
            /// The identity of the element at `position` of a list.
            #[inline]
            #[must_use]
            pub const fn at(position: usize) -> Self {
                debug_assert!(position as u64 <= $number::MAX as u64, "a plant has no such element");
                $name(position as $number)
            }

            /// Position in lists with one element for each identity.
            #[inline]
            #[must_use]
            pub const fn index(self) -> usize {
                self.0 as usize
            }

            /// The first `count` identities.
            pub fn first(count: usize) -> impl DoubleEndedIterator<Item = Self> + ExactSizeIterator {
                (0..count).map(Self::at)
            }

            /// The elements of a list, each with its identity.
            pub fn enumerate<T: IntoIterator>(list: T) -> impl Iterator<Item = (Self, T::Item)> {
                list.into_iter().enumerate().map(|(position, element)| (Self::at(position), element))
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }
    )+};
}

indices! {
    /// A device of a plant, by its place in the plant file, from 0.
    DeviceIndex: u16;
    /// A bus of a plant, by its place in the plant file, from 0. A plant file has fewer than 65,536 buses. Placeholders for
    /// ports without a bus follow, so the index has more than 16 bits.
    BusIndex: u32;
}

impl BusIndex {
    /// The bus with this number in journals, in faults and on the wire.
    #[inline]
    #[must_use]
    pub const fn of_number(number: u16) -> Self {
        BusIndex(number as u32)
    }

    /// Its number in journals, in faults and on the wire. Placeholders are not named there.
    #[inline]
    #[must_use]
    pub const fn number(self) -> u16 {
        self.0 as u16
    }
}
