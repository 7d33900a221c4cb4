//! `CANsync_SL_TYP_INIT`: the slaves that a master expects (p. 261-262).

use crate::plc::function_block;

macro_rules! inputs {
    ($($index:literal $name:ident,)*) => {
        function_block! {
            /// Collects the slave types for input `a_SL_TYP` of `CANsync_INIT` (manual p. 261-262). The block
            /// uses no register.
            pub struct CANsync_SL_TYP_INIT() {
                in {
                    $(
                        #[doc = concat!("Slave ", $index, ": 0 (default) does not exist, 1 exists.")]
                        $name: u8;
                    )*
                }
                out {
                    /// The types of slaves 0 to 31.
                    a_SL_TYP: [u8; 32];
                }
            }
        }

        impl CANsync_SL_TYP_INIT {
            /// Runs one PLC cycle.
            pub fn call(&mut self) {
                self.a_SL_TYP = [$(self.$name),*];
            }
        }
    };
}

inputs! {
    0 us_SL_TYP0, 1 us_SL_TYP1, 2 us_SL_TYP2, 3 us_SL_TYP3, 4 us_SL_TYP4, 5 us_SL_TYP5, 6 us_SL_TYP6,
    7 us_SL_TYP7, 8 us_SL_TYP8, 9 us_SL_TYP9, 10 us_SL_TYP10, 11 us_SL_TYP11, 12 us_SL_TYP12,
    13 us_SL_TYP13, 14 us_SL_TYP14, 15 us_SL_TYP15, 16 us_SL_TYP16, 17 us_SL_TYP17, 18 us_SL_TYP18,
    19 us_SL_TYP19, 20 us_SL_TYP20, 21 us_SL_TYP21, 22 us_SL_TYP22, 23 us_SL_TYP23, 24 us_SL_TYP24,
    25 us_SL_TYP25, 26 us_SL_TYP26, 27 us_SL_TYP27, 28 us_SL_TYP28, 29 us_SL_TYP29, 30 us_SL_TYP30,
    31 us_SL_TYP31,
}
