//! The variables of a unit: list, names and descriptions.

use crate::identity::DeviceIndex;
use crate::layout::{
    DeviceFit, Fit, LayoutError, Owner, Provenance, RegType, RegisterRef, Width, plc_prefix, split_plc,
};
use crate::plant::Plant;
use std::collections::BTreeSet;

/// A variable of the unit.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Name of the variable: the name of the register, with the PLC as a prefix if there are several.
    pub name: String,
    /// Description of the variable.
    pub description: String,
    /// Type of the variable.
    pub kind: VariableType,
    /// Source of the value.
    pub causality: Causality,
    /// Value at the start of the unit; `None` for variables that the unit calculates.
    pub start: Option<String>,
    /// Unit of the value, if it has one.
    pub unit: &'static str,
    pub(crate) quantity: Quantity,
}

/// Type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VariableType {
    /// FMI type `UInt8`.
    U8,
    /// FMI type `UInt16`.
    U16,
    /// FMI type `UInt32`.
    U32,
    /// FMI type `Int8`.
    I8,
    /// FMI type `Int16`.
    I16,
    /// FMI type `Int32`.
    I32,
    /// FMI type `Float64`.
    F64,
    /// FMI type `Boolean`.
    Bool,
}

impl VariableType {
    /// Returns the name in FMI.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            VariableType::U8 => "UInt8",
            VariableType::U16 => "UInt16",
            VariableType::U32 => "UInt32",
            VariableType::I8 => "Int8",
            VariableType::I16 => "Int16",
            VariableType::I32 => "Int32",
            VariableType::F64 => "Float64",
            VariableType::Bool => "Boolean",
        }
    }
}

impl From<RegType> for VariableType {
    fn from(of: RegType) -> Self {
        match of {
            RegType::Byte | RegType::Usint => VariableType::U8,
            RegType::Word | RegType::Uint => VariableType::U16,
            RegType::Dword | RegType::Udint => VariableType::U32,
            RegType::Sint => VariableType::I8,
            RegType::Int => VariableType::I16,
            RegType::Dint => VariableType::I32,
        }
    }
}

/// Source of the value of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// The variable is the time.
    Independent,
    /// The user of the unit sets the variable, also during the simulation.
    Parameter,
    /// The user of the unit sets the variable.
    Input,
    /// The unit calculates the variable.
    Output,
}

impl Causality {
    /// Returns the name in FMI.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Causality::Independent => "independent",
            Causality::Parameter => "parameter",
            Causality::Input => "input",
            Causality::Output => "output",
        }
    }
}

/// The quantity of a variable.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Quantity {
    Time,
    Register { plc: DeviceIndex, offset: u32, width: Width, ty: RegType, owner: Owner },
    Shaft { drive: usize, value: ShaftValue },
}

/// A value at the shaft of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ShaftValue {
    Reference,
    Demand,
    IsFed,
    Actual,
    Angle,
    IsModelled,
    Modelled,
}

/// Reason for which there are no such variables.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum VariablesError {
    /// No register has this name.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The plant does not have this PLC.
    #[error(
        "there is no PLC '{plc}' in the plant; its PLCs are: {known}; a name or pattern without a PLC means the registers of \
         all PLCs that have them"
    )]
    UnknownPlc {
        /// Name of a PLC, as the caller gave it.
        plc: String,
        /// Names of all PLCs of the plant, separated by commas.
        known: String,
    },
    /// An address is not that of a whole register.
    #[error("{address}: a variable is a whole register, so use the address of one: {known}")]
    NotWhole {
        /// The address as the caller gave it.
        address: String,
        /// Names and addresses of the registers at this address.
        known: String,
    },
    /// No drive has this value.
    #[error("drive '{drive}' has no value '{value}'; it has: {known}")]
    UnknownOfDrive {
        /// Name of the drive.
        drive: String,
        /// Name of a value that the drive does not have.
        value: String,
        /// Names of all values of the drive, separated by commas.
        known: String,
    },
    /// There are too many variables.
    #[error("more than {most} values; select fewer of them")]
    TooMany {
        /// Maximum number of values.
        most: usize,
    },
    /// The search for the variables would take too long.
    #[error(
        "the search for this name and the names before it would take too long; write fewer patterns, and the PLC before \
         each of them"
    )]
    TooLong,
    /// Two variables have the same name.
    #[error("two variables are called '{0}'; give the drive another name")]
    Twice(String),
}

impl VariablesError {
    pub(super) fn unknown_plc(plc: &str, known: &[String]) -> Self {
        VariablesError::UnknownPlc { plc: plc.to_owned(), known: known.join(", ") }
    }
}

/// Returns the variables of a plant that has its buses, devices and drives already. The position of a variable in the
/// list is its reference.
pub(super) fn variables(plant: &Plant, patterns: &[String]) -> Result<Vec<Variable>, VariablesError> {
    let mut all = vec![Variable {
        name: "time".to_owned(),
        description: "Time of the co-simulation".to_owned(),
        kind: VariableType::F64,
        causality: Causality::Independent,
        start: None,
        unit: "s",
        quantity: Quantity::Time,
    }];
    all.extend(of_registers(plant, &Wanted::of(plant, patterns)?));
    for (number, drive) in plant.drives().iter().enumerate() {
        all.extend(of_drive(number, &drive.name));
    }
    let mut names = BTreeSet::new();
    match all.iter().find(|variable| !names.insert(variable.name.as_str())) {
        None => Ok(all),
        Some(twice) => Err(VariablesError::Twice(twice.name.clone())),
    }
}

fn of_registers(plant: &Plant, wanted: &Wanted) -> Vec<Variable> {
    let (plcs, mut all) = (plant.names(), Vec::new());
    for (plc, fitted) in DeviceIndex::enumerate(&plcs.devices) {
        let prefix = plc_prefix(&plcs.plcs, plc);
        let registers = registers_of(fitted);
        let wanted = registers.iter().filter(|register| wanted.has(plc, register));
        all.extend(wanted.flat_map(|register| of_register(plant, plc, &prefix, register)));
    }
    all
}

/// Returns the registers of a device that can be variables, area by area in address order.
pub(super) fn registers_of(fitted: &DeviceFit) -> Vec<RegisterRef> {
    let areas = fitted.device().areas.iter().filter(|area| fitted.area(area) != Fit::Empty);
    // The name of an area with structures has registers.
    let all =
        areas.filter(|area| !area.structures.is_empty()).filter_map(|area| fitted.registers(area.name).ok());
    all.flatten().filter(|register| !register.is_reserved()).collect()
}

/// The requested registers; `None` for all.
struct Wanted(Option<BTreeSet<(DeviceIndex, u32, &'static str)>>);

impl Wanted {
    fn of(plant: &Plant, patterns: &[String]) -> Result<Self, VariablesError> {
        if patterns.is_empty() {
            return Ok(Self(None));
        }
        let plcs = plant.names();
        let mut wanted = BTreeSet::new();
        for pattern in patterns {
            let (plc, name) = split_plc(pattern);
            if let Some(unknown) = plc.filter(|plc| !plcs.plcs.iter().any(|known| known == plc)) {
                return Err(VariablesError::unknown_plc(unknown, &plcs.plcs));
            }
            let meant =
                DeviceIndex::enumerate(&plcs.plcs).filter(|(_, known)| plc.is_none_or(|plc| plc == *known));
            let found: Vec<_> =
                meant.map(|(index, _)| (index, registers(&plcs.devices[index.index()], name))).collect();
            // A name without a PLC as its prefix means the registers of all PLCs that have such registers.
            let has_any = found.iter().any(|(_, registers)| registers.is_ok());
            for (index, registers) in found {
                match registers {
                    Ok(registers) => {
                        wanted.extend(registers.iter().map(|it| (index, it.offset(), it.register.name)));
                    }
                    Err(_) if has_any => {}
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(Self(Some(wanted)))
    }

    fn has(&self, plc: DeviceIndex, register: &RegisterRef) -> bool {
        let key = (plc, register.offset(), register.register.name);
        self.0.as_ref().is_none_or(|wanted| wanted.contains(&key))
    }
}

/// Returns the registers that a name, an area, a pattern or an address covers.
pub(super) fn registers(fitted: &DeviceFit, name: &str) -> Result<Vec<RegisterRef>, VariablesError> {
    if !name.starts_with('%') {
        return Ok(fitted.registers(name)?);
    }
    let address = fitted.device().address(name)?;
    let (whole, parts): (Vec<_>, Vec<_>) =
        fitted.registers_at(address, None)?.into_iter().partition(|it| it.address() == address);
    if whole.is_empty() {
        let known: Vec<_> = parts.iter().map(|it| format!("{it} at {}", it.address())).collect();
        return Err(VariablesError::NotWhole { address: name.to_owned(), known: known.join(", ") });
    }
    Ok(whole)
}

pub(super) fn of_register(
    plant: &Plant,
    plc: DeviceIndex,
    prefix: &str,
    register: &RegisterRef,
) -> Vec<Variable> {
    let (ty, owner) = (register.ty(), register.owner());
    let width = Width::of(ty);
    let value = plant.load(plc, register.offset(), width).unwrap_or_default();
    let written_by = match owner {
        Owner::Plc => "a PLC writes it",
        Owner::Firmware => "the firmware writes it",
        Owner::Both => "PLC and firmware write it",
    };
    let doc = register.register.doc.trim_end_matches('.');
    let doc = if doc.is_empty() { String::new() } else { format!("{doc}; ") };
    let page = register.register.page;
    let page = if page.is_empty() { String::new() } else { format!("; manual p. {page}") };
    let mut facts = vec![("area", register.area.name_from)];
    facts.extend(register.register.facts());
    let inferred = Provenance::inferred(&facts);
    let inferred = inferred.map_or_else(String::new, |facts| format!("; inferred: {facts}"));
    let description = format!("{doc}{written_by}; {}{page}{inferred}", register.address());
    let variable = |name, causality, start| Variable {
        name,
        description: description.clone(),
        kind: ty.into(),
        causality,
        start,
        unit: "",
        quantity: Quantity::Register { plc, offset: register.offset(), width, ty, owner },
    };
    let name = format!("{prefix}{register}");
    let start = || Some(ty.number(value).to_string());
    match owner {
        Owner::Plc => vec![variable(name, Causality::Input, start())],
        Owner::Firmware => vec![variable(name, Causality::Output, None)],
        // The present value has a separate output variable (decision D-535).
        Owner::Both => {
            let out = format!("{name}.out");
            vec![variable(name, Causality::Input, start()), variable(out, Causality::Output, None)]
        }
    }
}

pub(super) fn of_drive(drive: usize, name: &str) -> Vec<Variable> {
    use Causality::{Input, Output, Parameter};
    use ShaftValue::{Actual, Angle, Demand, IsFed, IsModelled, Modelled, Reference};
    let variable = |suffix, kind, causality, start: Option<&str>, unit, value, description: &str| Variable {
        name: format!("{name}.{suffix}"),
        description: description.to_owned(),
        kind,
        causality,
        start: start.map(str::to_owned),
        unit,
        quantity: Quantity::Shaft { drive, value },
    };
    let speed = |suffix, value, text| variable(suffix, VariableType::F64, Output, None, "rad/s", value, text);
    vec![
        speed("speed_reference", Reference, "Speed that the drive has been given"),
        speed(
            "speed_demand",
            Demand,
            "Speed that the drive demands of its motor: limited, and along its ramp; 0 if it is not enabled",
        ),
        variable(
            "is_fed",
            VariableType::Bool,
            Output,
            None,
            "",
            IsFed,
            "Whether the drive feeds its motor; else the motor coasts",
        ),
        speed("speed_actual", Actual, "Speed of the motor, as the drive tells it its master"),
        variable(
            "angle_actual",
            VariableType::F64,
            Output,
            None,
            "rad",
            Angle,
            "Angle of the motor within a revolution, from 0 on",
        ),
        variable(
            "is_modelled",
            VariableType::Bool,
            Parameter,
            Some("false"),
            "",
            IsModelled,
            "Whether the motor turns with speed_modelled; else it does what the drive demands",
        ),
        variable(
            "speed_modelled",
            VariableType::F64,
            Input,
            Some("0"),
            "rad/s",
            Modelled,
            "Speed of the motor by a model of what it turns; counts while is_modelled is true",
        ),
    ]
}
