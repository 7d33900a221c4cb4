//! The header page contains numbers with names.

// The numbers are `tt`, because derives cannot parse a `literal` fragment.
macro_rules! codes {
    ($(#[$doc:meta])* $name:ident { $($(#[doc = $vdoc:literal])* $variant:ident = $value:tt,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, bytemuck::CheckedBitPattern)]
        #[cfg_attr(feature = "emulator", derive(serde::Serialize, serde::Deserialize))]
        #[repr(u32)]
        pub enum $name { $($(#[doc = $vdoc])* $variant = $value,)* }

        impl $name {
            /// All numbers as data.
            pub const CODES: $crate::memory::struct_tables::Codes = $crate::memory::struct_tables::Codes {
                name: stringify!($name),
                codes: &[$(($value, stringify!($variant), concat!($($vdoc),*))),*],
            };

            /// Returns the meaning of a number in the header page; `None` if the number has no meaning.
            pub fn from_code(code: u32) -> Option<Self> {
                bytemuck::checked::try_cast(code).ok()
            }

            /// Returns the number in the header.
            pub const fn code(self) -> u32 {
                self as u32
            }
        }
    };
}
