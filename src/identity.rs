//! Identities in a plant: indices of devices and buses, numbers of ports.
//!
//! Files and messages contain an identity as a plain number. In journals, plant files, JSON and the channel, `plc` is a
//! [`DeviceIndex`], `node` is a [`PortNumber`], and `bus` is a [`BusIndex`].

use core::fmt;

macro_rules! indices {
    ($($(#[$doc:meta])* $name:ident: $number:ident;)+) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[cfg_attr(feature = "emulator", derive(serde::Serialize, serde::Deserialize), serde(transparent))]
        #[repr(transparent)]
        pub struct $name(pub $number);

        impl $name {
            /// Returns the identity of the element at `position` of a list.
            #[inline]
            #[must_use]
            pub const fn at(position: usize) -> Self {
                debug_assert!(position as u64 <= $number::MAX as u64, "a plant has no such element");
                $name(position as $number)
            }

            /// Returns the position of this identity's element in lists with one element for each identity.
            #[inline]
            #[must_use]
            pub const fn index(self) -> usize {
                self.0 as usize
            }

            /// Returns the first `count` identities.
            pub fn first(count: usize) -> impl DoubleEndedIterator<Item = Self> + ExactSizeIterator {
                (0..count).map(Self::at)
            }

            /// Returns the elements of a list, each with its identity.
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
    /// A device of a plant. Devices are numbered from 0 in the order of the plant file.
    DeviceIndex: u16;
    /// A bus of a plant. Buses are numbered from 0 in the order of the plant file, which has fewer than 65,536 buses.
    /// Each port without a bus gets a placeholder bus with a number after these numbers, so the index has more than 16
    /// bits.
    BusIndex: u32;
}

impl BusIndex {
    /// Returns the bus with this number in journals, in faults and on the wire.
    #[inline]
    #[must_use]
    pub const fn of_number(number: u16) -> Self {
        BusIndex(number as u32)
    }

    /// Returns the number of the bus in journals, in faults and on the wire. Journals, faults and the wire never name
    /// placeholders.
    #[inline]
    #[must_use]
    pub const fn number(self) -> u16 {
        self.0 as u16
    }
}

/// Number of a port of a device, 1 to 255, as in the layout of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "emulator", derive(serde::Serialize, serde::Deserialize), serde(transparent))]
#[repr(transparent)]
pub struct PortNumber(pub u8);

impl PortNumber {
    /// Means the device itself, in places where a port or a device can be named.
    pub const DEVICE: Self = PortNumber(0);

    /// Number below that of option interface 1. A device has fewer ports.
    const OPTION_INTERFACES: u8 = 240;

    /// Number of an option interface, 1 to 15, in journals: its registers belong to an option card.
    #[must_use]
    pub const fn of_option_interface(interface: u8) -> Self {
        PortNumber(Self::OPTION_INTERFACES + interface % 16)
    }

    /// Returns the number of the option interface, if this is the number of one.
    #[must_use]
    pub const fn option_interface(self) -> Option<u8> {
        if self.0 > Self::OPTION_INTERFACES { Some(self.0 - Self::OPTION_INTERFACES) } else { None }
    }

    /// Returns the position of the port's entry in the header page. For [`DEVICE`](Self::DEVICE), returns `usize::MAX`,
    /// a position at which no list has an entry.
    #[inline]
    #[must_use]
    pub const fn index(self) -> usize {
        (self.0 as usize).wrapping_sub(1)
    }
}

impl fmt::Display for PortNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
