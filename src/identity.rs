//! Identities in a plant: indices of devices and buses.
//!
//! In files and on wires an identity is its plain number. `plc` in journals, plant files, JSON and the channel is a
//! [`DeviceIndex`], `bus` a [`BusIndex`].

use core::fmt;

macro_rules! indices {
    ($($(#[$doc:meta])* $name:ident;)+) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[cfg_attr(feature = "emulator", derive(serde::Serialize, serde::Deserialize), serde(transparent))]
        #[repr(transparent)]
        pub struct $name(pub u16);

        impl $name {
            /// The identity of the element at `position` of a list. A plant has fewer than 65,536 of them.
            #[inline]
            #[must_use]
            pub const fn at(position: usize) -> Self {
                debug_assert!(position <= u16::MAX as usize, "indices have 16 bits");
                $name(position as u16)
            }

            /// Position in lists that have an element for each of them.
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
    DeviceIndex;
    /// A bus of a plant, by its place in the plant file, from 0. Placeholders for ports without a bus follow.
    BusIndex;
}
