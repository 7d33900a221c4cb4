//! Device description files (GSD) of PROFIBUS-DP slaves, for masters.

use super::descriptor::{Provenance, Register};

/// The device description of a PROFIBUS-DP slave.
#[derive(Debug)]
pub struct Gsd {
    /// Pages of the manual.
    pub page: &'static str,
    /// Facts about the slave, in the order of the file.
    pub keys: &'static [Key],
    /// The user-specific octets of the service Set_Prm (`User_Prm_Data`), with zeros for the parameters that a user can
    /// choose.
    pub constants: &'static [u8],
    /// The data that a user chooses.
    pub parameters: &'static [Parameter],
    /// The octet of the diagnosis that has texts.
    pub diagnosis: Option<Texts>,
    /// Predefined modules, which a user selects unchanged.
    pub modules: &'static [Module],
}

/// A fact about the slave.
#[derive(Debug)]
pub struct Key {
    /// Keyword of the line in the device description file.
    pub name: &'static str,
    /// The value of the keyword.
    pub value: Value,
    /// Source of the value.
    pub from: Provenance,
}

/// The value of a keyword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// The value of the keyword is a number.
    Number(u32),
    /// A text, written in quotation marks.
    Text(&'static str),
    /// A text, written without quotation marks.
    Bare(&'static str),
}

/// A parameter of Set_Prm.
#[derive(Debug)]
pub struct Parameter {
    /// The register that shows the parameter, or the first of several such registers.
    pub register: &'static Register,
    /// Index of the parameter's first octet among the user-specific octets, from 0.
    pub octet: u32,
    /// Number of octets. The high octet comes first.
    pub octets: u32,
    /// Name of the parameter; empty if its bit has a name.
    pub name: &'static str,
    /// Bit of the parameter, if the parameter is a single bit.
    pub bit: Option<Bit>,
    /// Default value of the parameter.
    pub default: u32,
    /// Smallest permitted value of the parameter.
    pub from: u32,
    /// Largest permitted value of the parameter.
    pub to: u32,
}

/// A parameter of one bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bit {
    /// Number of the bit, 0 to 7.
    pub at: u8,
    /// True if 0 means yes and 1 means no.
    pub inverted: bool,
}

/// An octet of the diagnosis with texts for its values.
#[derive(Debug)]
pub struct Texts {
    /// The register that shows the octet.
    pub register: &'static Register,
    /// Number of the octet in the device-specific diagnosis, counted from 0 after the header of this diagnosis.
    pub octet: u32,
    /// Source of the entries of the file.
    pub from: Provenance,
}

/// A predefined module, which a user selects unchanged.
#[derive(Debug)]
pub struct Module {
    /// Name of the module.
    pub name: &'static str,
    /// Octets of the module in Chk_Cfg.
    pub octets: &'static [u8],
    /// Page of the manual.
    pub page: &'static str,
    /// Source of the module in the file.
    pub from: Provenance,
}
