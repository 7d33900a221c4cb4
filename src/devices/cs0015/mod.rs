//! ifm ecomat 100 "Platinensteuerung" CS0015: a board controller with a CAN interface, CANopen slave (Systemhandbuch
//! Platinensteuerung CS0015, October 1999).

#[cfg(test)]
mod registers_tests;

/// Areas, structures, front and object dictionary, generated from `layouts/cs0015`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/cs0015.rs"));
}
