//! Errors in addresses and register names.

use super::descriptor::Role;

/// An address or a register name that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// The text is not an address.
    #[error(
        "`{text}` is no address; this device has {known}, with W for words, D for double words, and X and .bit for bits"
    )]
    BadAddress {
        /// The given text.
        text: String,
        /// The spaces of the device.
        known: String,
    },
    /// A bit number above the limit.
    #[error("{text}: a {of} has bits 0 to {last}, not {bit}")]
    BadBit {
        /// The given text.
        text: String,
        /// The bit number.
        bit: u32,
        /// The object that should have the bit.
        of: &'static str,
        /// Number of the last bit.
        last: u32,
    },
    /// An address in none of the device's spaces.
    #[error("{text} is no address of this device, which has {known}")]
    NoSpace {
        /// The given text.
        text: String,
        /// The spaces of the device.
        known: String,
    },
    /// An address not divisible by the access width.
    #[error("{address}: {rule}")]
    Misaligned {
        /// The address.
        address: String,
        /// The alignment that the width requires.
        rule: &'static str,
    },
    /// An address in no area.
    #[error("{address} is not in any area; {hint}")]
    NoArea {
        /// The address.
        address: String,
        /// The areas before and after the address.
        hint: String,
    },
    /// An address in an area, but in no register.
    #[error("{address}: area `{area}` has no register there ({hint})")]
    NoRegister {
        /// The address.
        address: String,
        /// The area.
        area: &'static str,
        /// The registers before and after the address.
        hint: String,
    },
    /// The text is not a name.
    #[error("`{text}` is no register name: {reason}; write for example node2.a_RD_BMARRAY[3][0]")]
    BadName {
        /// The given text.
        text: String,
        /// The error.
        reason: &'static str,
    },
    /// The device has no object dictionary.
    #[error("{title} has no object dictionary")]
    NoObjects {
        /// The device.
        title: &'static str,
    },
    /// The device is not a PROFIBUS-DP slave.
    #[error("{title} is no PROFIBUS-DP slave: it has no device description file")]
    NoGsd {
        /// The device.
        title: &'static str,
    },
    /// An area that the device does not have.
    #[error("unknown area `{area}`; the areas are {known}{hint}")]
    UnknownArea {
        /// The given text.
        area: String,
        /// All areas.
        known: String,
        /// Names that the user may have meant.
        hint: String,
    },
    /// A command needs the port of a master, and the first device has none.
    #[error("the first device has no port that is a master of a bus; name a port of another device")]
    NoMaster,
    /// A port that the device does not have.
    #[error("{}", if known.is_empty() { format!("unknown port `{port}`; the device has no ports") } else { format!("unknown port `{port}`; the ports are {known}") })]
    UnknownPort {
        /// The given text.
        port: String,
        /// All ports.
        known: String,
    },
    /// A name with wrong upper or lower case, or an address without its `%`.
    #[error("`{given}` is spelled `{right}`")]
    WrongCase {
        /// The given text.
        given: String,
        /// The right spelling.
        right: String,
    },
    /// A variable that the device does not have.
    #[error("unknown variable `{variable}`; the variables are {known}{hint}")]
    UnknownVariable {
        /// The given text.
        variable: String,
        /// All variables.
        known: String,
        /// Names that the user may have meant.
        hint: String,
    },
    /// The place of the register depends on the role of the port, and the role is not known.
    #[error("`{name}` is ambiguous: {names}")]
    Ambiguous {
        /// The given text.
        name: String,
        /// The names to use instead.
        names: String,
    },
    /// A variable that belongs to another role than the role of the port.
    #[error("`{variable}` belongs to a {variable_role}, but `{area}` is a {port_role}")]
    WrongRole {
        /// The variable.
        variable: &'static str,
        /// The role to which the variable belongs.
        variable_role: Role,
        /// The area of its registers.
        area: &'static str,
        /// The role of the port.
        port_role: Role,
    },
    /// A register that the area does not have.
    #[error("area `{area}` has no register `{name}`{hint}")]
    UnknownRegister {
        /// The area.
        area: &'static str,
        /// The given text.
        name: String,
        /// Names that the user may have meant.
        hint: String,
    },
    /// A register name without an area. No area has such a register.
    #[error("no area has a register `{name}`{hint}")]
    UnknownName {
        /// The given text.
        name: String,
        /// Names that the user may have meant.
        hint: String,
    },
    /// An area or a variable where a register was expected.
    #[error(
        "`{name}` is a block of registers, not one register; `commram dump {name}` shows what they hold, `commram map {name}` what they are"
    )]
    NotOneRegister {
        /// The given text.
        name: String,
    },
    /// A pattern that no register matches.
    #[error("no register matches `{pattern}`; `commram find` looks for names and meanings")]
    NoMatch {
        /// The given text.
        pattern: String,
    },
    /// A pattern where a single register was expected.
    #[error("`{pattern}` can mean several registers; name one of them")]
    Several {
        /// The given text.
        pattern: String,
    },
    /// A sub-structure where a register was expected.
    #[error("`{name}` is a sub-structure, not a register; its registers are {registers}")]
    NotARegister {
        /// The given text.
        name: String,
        /// The registers in the area.
        registers: String,
    },
    /// The name has too many or too few indices.
    #[error("`{name}` {needs}")]
    IndexCount {
        /// The given text.
        name: String,
        /// The required indices.
        needs: String,
    },
    /// An index beyond the array.
    #[error("`{name}`: index {index} is out of range, {of} has elements 0 to {last}")]
    IndexRange {
        /// The given text.
        name: String,
        /// The index.
        index: u32,
        /// The array.
        of: &'static str,
        /// Index of the last element.
        last: u16,
    },
}
