//! Errors in addresses and register names.

use super::descriptor::Role;
use super::value::article;

/// An address or a register name that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// The text is not an address.
    #[error(
        "`{text}` is no address; this device has {known}, with W for words, D for double words, and X and .bit for bits"
    )]
    BadAddress {
        /// Text that should be an address.
        text: String,
        /// The spaces of the device.
        known: String,
    },
    /// A bit number above the limit.
    #[error("{text}: {} {of} has bits 0 to {last}, not {bit}", article(.of))]
    BadBit {
        /// Address with its bit number, as the user wrote it.
        text: String,
        /// Number of the bit that does not exist.
        bit: u32,
        /// The object that should have the bit.
        of: &'static str,
        /// Number of the last bit.
        last: u32,
    },
    /// A single bit where the whole register is needed.
    #[error("{text}: a single bit is not possible here; name the whole register: {whole}")]
    OneBit {
        /// Name or address of the bit, as the user wrote it.
        text: String,
        /// Name of the register, or address of the byte, that contains the bit.
        whole: String,
    },
    /// An address in none of the device's spaces.
    #[error("{text} is no address of this device, which has {known}")]
    NoSpace {
        /// Address in none of the device's spaces, as the user wrote it.
        text: String,
        /// The spaces of the device.
        known: String,
    },
    /// An address not divisible by the access width.
    #[error("{address}: {rule}")]
    Misaligned {
        /// Address, not divisible by the width of the access.
        address: String,
        /// The alignment that the width requires.
        rule: &'static str,
    },
    /// An address in no area.
    #[error("{address} is not in any area; {hint}")]
    NoArea {
        /// Address outside all areas.
        address: String,
        /// The areas before and after the address.
        hint: String,
    },
    /// An address in an area, but in no register.
    #[error("{address}: area `{area}` has no register there ({hint})")]
    NoRegister {
        /// Address at which no register is.
        address: String,
        /// Name of the area that contains the address.
        area: &'static str,
        /// The registers before and after the address.
        hint: String,
    },
    /// The text is not a name.
    #[error("`{text}` is no register name: {reason}; write for example node2.a_RD_BMARRAY[3][0]")]
    BadName {
        /// Text that should be the name of a register.
        text: String,
        /// Description of the syntax error in the text.
        reason: &'static str,
    },
    /// The device has no object dictionary.
    #[error("{title} has no object dictionary")]
    NoObjects {
        /// The vendor's name for the device.
        title: &'static str,
    },
    /// The device is not a PROFIBUS-DP slave.
    #[error("{title} is no PROFIBUS-DP slave: it has no device description file")]
    NoGsd {
        /// The vendor's name for the device.
        title: &'static str,
    },
    /// An area that the device does not have.
    #[error("unknown area `{area}`; the areas are {known}{hint}")]
    UnknownArea {
        /// Name of the area, as the user wrote it.
        area: String,
        /// Names of all areas of the device, separated by commas.
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
        /// Name of the port, as the user wrote it.
        port: String,
        /// Names of all ports of the device, separated by commas; empty if it has none.
        known: String,
    },
    /// A name with wrong upper or lower case, or an address without its `%`.
    #[error("`{given}` is spelled `{right}`")]
    WrongCase {
        /// Name or address with the wrong spelling, as the user wrote it.
        given: String,
        /// Correct spelling of the name or address.
        right: String,
    },
    /// A variable that the device does not have.
    #[error("unknown variable `{variable}`; the variables are {known}{hint}")]
    UnknownVariable {
        /// Name of the variable, as the user wrote it.
        variable: String,
        /// Names of all variables of the device, separated by commas.
        known: String,
        /// Names that the user may have meant.
        hint: String,
    },
    /// The place of the register depends on the role of the port, and the role is not known.
    #[error("`{name}` is ambiguous: {names}")]
    Ambiguous {
        /// Name of the register, as the user wrote it.
        name: String,
        /// Names that the user can use instead of this name.
        names: String,
    },
    /// A variable that belongs to another role than the role of the port.
    #[error("`{variable}` belongs to a {variable_role}, but `{area}` is a {port_role}")]
    WrongRole {
        /// Name of the variable, which has another role than the port.
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
        /// Name of the area that does not have the register.
        area: &'static str,
        /// Name of the register, as the user wrote it.
        name: String,
        /// Names that the user may have meant.
        hint: String,
    },
    /// A register name without an area. No area has such a register.
    #[error("no area has a register `{name}`{hint}")]
    UnknownName {
        /// Name of the register, as the user wrote it.
        name: String,
        /// Names that the user may have meant.
        hint: String,
    },
    /// An area or a variable where a register was expected.
    #[error(
        "`{name}` is a block of registers, not one register; `commram dump {name}` shows what they hold, `commram map {name}` what they are"
    )]
    NotOneRegister {
        /// Name of the block of registers, as the user wrote it.
        name: String,
    },
    /// A pattern that no register matches.
    #[error("no register matches `{pattern}`; `commram find` looks for names and meanings")]
    NoMatch {
        /// Pattern that no register matches, as the user wrote it.
        pattern: String,
    },
    /// A pattern where a single register was expected.
    #[error("`{pattern}` can mean several registers; name one of them")]
    Several {
        /// Pattern, as the user wrote it, where one register is needed.
        pattern: String,
    },
    /// A sub-structure where a register was expected.
    #[error("`{name}` is a sub-structure, not a register; its registers are {registers}")]
    NotARegister {
        /// Name of the sub-structure, as the user wrote it.
        name: String,
        /// The registers in the area.
        registers: String,
    },
    /// The name has too many or too few indices.
    #[error("`{name}` {needs}")]
    IndexCount {
        /// Name of the register, as the user wrote it.
        name: String,
        /// Description of the indices that the name needs.
        needs: String,
    },
    /// An index beyond the array.
    #[error("`{name}`: index {index} is out of range, {of} has elements 0 to {last}")]
    IndexRange {
        /// Name of the register with its indices, as the user wrote it.
        name: String,
        /// Index above the last element of the array.
        index: u32,
        /// Name of the array to which the index belongs.
        of: &'static str,
        /// Index of the last element.
        last: u16,
    },
}
