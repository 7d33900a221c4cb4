//! Conversion of a fault description to a checked fault.

use super::error::{kind_list, list};
use super::kind::{AT_US, COUNT, DURATION_US, NODE, SLAVE};
use super::{
    Draft, Fault, FaultError, FaultKind, FaultSpec, Field, FieldValue, Form, MAX_FIELDS, Refusal, Target,
    TargetKind,
};
use crate::identity::{BusIndex, DeviceIndex};
use crate::journal::Names;
use crate::layout::{Port, did_you_mean};

impl FaultSpec {
    /// Returns the fault of this description as a checked fault, in an installation with these `names`. Only `kinds`
    /// are accepted.
    ///
    /// # Errors
    /// [`FaultError`] names the field and a correct value. Only the installation can check that the slave
    /// or port exists: [`Sites::owner`](super::Sites::owner).
    pub fn resolve(&self, kinds: &[&'static FaultKind], names: &Names) -> Result<Fault, FaultError> {
        let kinds = &in_installation(kinds, names);
        let Some(kind) = self.chosen(kinds, names) else {
            let hint = did_you_mean(&self.kind, kinds.iter().map(|kind| kind.name()));
            return Err(FaultError::UnknownKind { kind: self.kind.clone(), hint, known: kind_list(kinds) });
        };
        Reader::new(self, kind, kinds, names)?.fault()
    }

    /// Returns the kind of this description. Several devices in folders may declare kinds of the same name. Then the
    /// kind is that of the device in the description; without a device, it is a kind that has the given fields.
    fn chosen(&self, kinds: &[&'static FaultKind], names: &Names) -> Option<&'static FaultKind> {
        let first = named(&self.kind, kinds)?;
        let field = TargetKind::Device.fields()[0];
        let device = self.fields.iter().find_map(|(name, value)| match value {
            FieldValue::Text(device) if field.is_called(name) => Some(device),
            _ => None,
        });
        let mut same = kinds.iter().copied().filter(|kind| kind.name() == first.name());
        let found = match device {
            Some(device) => {
                let index = names.plcs.iter().position(|known| known == device);
                let device = index.map(|index| names.fitted(DeviceIndex::at(index)));
                same.find(|kind| device.is_some_and(|device| kind.is_declared_by(&device)))
            }
            None => {
                let has = |kind: &'static FaultKind, name: &str| {
                    kind.all_fields().any(|field| field.is_called(name))
                };
                same.find(|kind| self.fields.iter().all(|(name, _)| has(kind, name)))
            }
        };
        Some(found.unwrap_or(first))
    }
}

/// Returns the kinds without those that devices outside of the installation declare. A process may have read several
/// versions of a device folder; only the versions in the installation count.
pub(crate) fn in_installation(kinds: &[&'static FaultKind], names: &Names) -> Vec<&'static FaultKind> {
    let is_declared = |kind: &FaultKind| names.devices.iter().any(|device| kind.is_declared_by(device));
    let is_possible = |kind: &&FaultKind| kind.declaration().is_none() || is_declared(kind);
    kinds.iter().copied().filter(is_possible).collect()
}

/// Returns the kind of this name; `-` and `_` are equivalent.
pub(super) fn named(name: &str, kinds: &[&'static FaultKind]) -> Option<&'static FaultKind> {
    let name = name.replace('-', "_");
    kinds.iter().copied().find(|kind| kind.name() == name)
}

/// Reads the fields of a description.
struct Reader<'a> {
    given: Vec<(&'static Field, &'a FieldValue)>,
    kind: &'static FaultKind,
    names: &'a Names,
    /// Names of the devices that declare a kind of this name. Empty for a kind of commram.
    declaring: Vec<String>,
}

impl<'a> Reader<'a> {
    fn new(
        spec: &'a FaultSpec,
        kind: &'static FaultKind,
        kinds: &[&'static FaultKind],
        names: &'a Names,
    ) -> Result<Self, FaultError> {
        let mut given: Vec<(&'static Field, &FieldValue)> = Vec::with_capacity(spec.fields.len());
        for (name, value) in &spec.fields {
            let Some(field) = kind.all_fields().find(|field| field.is_called(name)) else {
                let mut others = kinds.iter().flat_map(|kind| kind.all_fields());
                return Err(match others.find(|field| field.is_called(name)) {
                    Some(field) => FaultError::NotForKind { kind, field },
                    None => FaultError::UnknownField { kind, field: name.clone() },
                });
            };
            if given.iter().any(|(other, _)| *other == field) {
                return Err(FaultError::Twice { kind, field });
            }
            given.push((field, value));
        }
        let declares = |index| {
            let device = names.fitted(DeviceIndex::at(index));
            let mut same = kinds.iter().filter(|other| other.name() == kind.name());
            same.any(|kind| kind.is_declared_by(&device))
        };
        let named = names.plcs.iter().enumerate();
        let declaring = named.filter(|(index, _)| declares(*index)).map(|(_, name)| name.clone()).collect();
        Ok(Reader { given, kind, names, declaring })
    }

    fn fault(&self) -> Result<Fault, FaultError> {
        let kind = self.kind;
        let mut values = [None; MAX_FIELDS];
        for (value, field) in values.iter_mut().zip(kind.fields()) {
            *value = match field.form() {
                Form::Word(words) => self.word(field, words)?,
                _ => self.number(field)?,
            };
        }
        let draft = Draft {
            kind,
            target: self.target()?,
            values,
            at_us: self.number(&AT_US)?.unwrap_or(0),
            count: self.number(&COUNT)?,
            duration_us: self.number(&DURATION_US)?,
        };
        draft.check().map_err(|refusal| self.refused(refusal))
    }

    fn target(&self) -> Result<Target, FaultError> {
        Ok(match self.kind.place() {
            TargetKind::Bus => Target::Bus(self.bus()?),
            TargetKind::Participant => {
                let bus = self.bus()?;
                let right = SLAVE.missing().unwrap_or_default();
                let number = self.number(&SLAVE)?.ok_or_else(|| self.missing(&SLAVE, right.to_owned()))?;
                let number = SLAVE.check(number).map_err(|refusal| self.refused(refusal))?;
                Target::Participant { bus, number: number as u8 }
            }
            TargetKind::Port => {
                let device = self.plc()?;
                Target::Port { device, port: self.port(device)?.number }
            }
            TargetKind::Device => Target::Device(self.plc()?),
        })
    }

    fn bus(&self) -> Result<BusIndex, FaultError> {
        let kind = self.kind;
        let unknown = |bus, known| FaultError::UnknownBus { kind, bus, known };
        self.named(TargetKind::Bus, &self.names.buses, unknown).map(BusIndex::at)
    }

    fn plc(&self) -> Result<DeviceIndex, FaultError> {
        let kind = self.kind;
        let unknown = |plc, known| FaultError::UnknownPlc { kind, plc, known };
        let field = TargetKind::Device.fields()[0];
        if self.given(field).is_none() {
            match &self.declaring[..] {
                [] => {}
                [only] => {
                    let index = self.names.plcs.iter().position(|known| known == only);
                    return Ok(DeviceIndex::at(index.unwrap_or_default()));
                }
                several => return Err(self.missing(field, format!("give one of: {}", list(several)))),
            }
        }
        self.named(TargetKind::Device, &self.names.plcs, unknown).map(DeviceIndex::at)
    }

    /// Returns the index of the bus or PLC. If the name is omitted, the installation must have exactly one bus or PLC.
    fn named(
        &self,
        place: TargetKind,
        known: &[String],
        unknown: impl Fn(String, String) -> FaultError,
    ) -> Result<usize, FaultError> {
        let field = place.fields()[0];
        let index = match self.given(field) {
            Some(FieldValue::Text(name)) => known.iter().position(|known| known == name),
            Some(number @ FieldValue::Number(_)) => {
                return Err(self.form(field, number, "its name".to_owned()));
            }
            None if known.len() == 1 => Some(0),
            None => return Err(self.missing(field, format!("give one of: {}", list(known)))),
        };
        let name = || match self.given(field) {
            Some(FieldValue::Text(name)) => name.clone(),
            _ => String::new(),
        };
        index.ok_or_else(|| unknown(name(), list(known)))
    }

    fn port(&self, plc: DeviceIndex) -> Result<&'static Port, FaultError> {
        let device = self.names.device(plc);
        let its = |port: &&'static Port| self.kind.families().contains(&port.medium);
        let ports: Vec<&'static Port> = device.ports.iter().filter(its).collect();
        let found = match self.given(&NODE) {
            Some(FieldValue::Text(name)) => device.port(name).filter(its),
            Some(FieldValue::Number(number)) => {
                ports.iter().copied().find(|port| u64::from(port.number.0) == *number)
            }
            None => match ports[..] {
                [only] => Some(only),
                _ => return Err(self.missing(&NODE, format!("give {}", choice(&ports)))),
            },
        };
        found.ok_or_else(|| match self.given(&NODE) {
            Some(FieldValue::Number(value)) if are_numbered(&ports) => {
                let numbers = || ports.iter().map(|port| u64::from(port.number.0));
                let (least, most) = (numbers().min().unwrap_or(0), numbers().max().unwrap_or(0));
                self.refused(Refusal::Range { field: &NODE, value: *value, least, most })
            }
            given => FaultError::NoPort {
                kind: self.kind,
                plc: self.names.plc(plc).into_owned(),
                port: given.map(FieldValue::to_string).unwrap_or_default(),
                known: list(&ports.iter().map(|port| port.name).collect::<Vec<_>>()),
            },
        })
    }

    fn given(&self, field: &Field) -> Option<&'a FieldValue> {
        self.given.iter().find(|(given, _)| *given == field).map(|(_, value)| *value)
    }

    fn number(&self, field: &'static Field) -> Result<Option<u64>, FaultError> {
        match self.given(field) {
            None => Ok(None),
            Some(FieldValue::Number(number)) => Ok(Some(*number)),
            Some(text) => Err(self.form(field, text, format!("a number, {}", field.range_text()))),
        }
    }

    fn word(&self, field: &'static Field, words: &[&str]) -> Result<Option<u64>, FaultError> {
        let Some(given) = self.given(field) else { return Ok(None) };
        let index = match given {
            FieldValue::Text(word) => words.iter().position(|known| known.eq_ignore_ascii_case(word)),
            FieldValue::Number(_) => None,
        };
        match index {
            Some(index) => Ok(Some(index as u64)),
            None => Err(self.form(field, given, field.range_text())),
        }
    }

    fn form(&self, field: &'static Field, given: &FieldValue, right: String) -> FaultError {
        FaultError::Form { kind: self.kind, field, given: given.to_string(), right }
    }

    fn missing(&self, field: &'static Field, right: String) -> FaultError {
        self.refused(Refusal::Missing { field, right })
    }

    fn refused(&self, refusal: Refusal) -> FaultError {
        FaultError::Refused { kind: self.kind, refusal }
    }
}

/// Returns the name of a port in the description of a fault. A name that consists of digits becomes a number.
pub(super) fn port_given(port: &Port) -> FieldValue {
    if port.name.strip_prefix(NODE.name()) == Some(&port.number.to_string()) {
        FieldValue::Number(port.number.0.into())
    } else {
        FieldValue::Text(port.name.to_owned())
    }
}

/// True if the names of all ports are numbers.
fn are_numbered(ports: &[&Port]) -> bool {
    !ports.is_empty() && ports.iter().all(|port| matches!(port_given(port), FieldValue::Number(_)))
}

/// Returns ports for messages: `1 (slave) or 2 (master)`.
fn choice(ports: &[&Port]) -> String {
    let port = |port: &&Port| {
        let name = match port_given(port) {
            FieldValue::Number(number) => number.to_string(),
            FieldValue::Text(name) => name,
        };
        port.role().map_or_else(|| name.clone(), |role| format!("{name} ({role})"))
    };
    let ports: Vec<_> = ports.iter().map(port).collect();
    match &ports[..] {
        [] => "a port; the PLC has none".to_owned(),
        [others @ .., last] if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        ports => ports.join(""),
    }
}
