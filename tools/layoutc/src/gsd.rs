//! Device description files (GSD) of PROFIBUS-DP slaves: the properties of a device for masters, from a TOML file of
//! its layout.

use crate::error::{Error, Reason};
use crate::model::{Area, FieldType, Structure};
use crate::raw::Provenance;
use crate::source::{SourcePlace, Sources, at};
use serde::Deserialize;
use toml::Spanned;

/// The file as written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    page: String,
    key: Vec<Spanned<RawKey>>,
    parameters: RawParameters,
    diagnosis: Option<RawDiagnosis>,
    #[serde(default)]
    module: Vec<RawModule>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawKey {
    name: String,
    is: Value,
    /// A text that is written without quotation marks.
    #[serde(default)]
    bare: bool,
    from: Option<Provenance>,
}

/// The value of a keyword.
#[derive(Deserialize, Clone)]
#[serde(untagged)]
pub(crate) enum Value {
    Number(u32),
    Text(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawParameters {
    area: Spanned<String>,
    first: Spanned<String>,
    constants: Vec<u8>,
    parameter: Vec<Spanned<RawParameter>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawParameter {
    register: Spanned<String>,
    bit: Option<u8>,
    #[serde(default)]
    inverted: bool,
    name: Option<String>,
    default: Option<u32>,
    from: Option<u32>,
    to: Option<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawDiagnosis {
    area: Spanned<String>,
    header: Spanned<String>,
    register: Spanned<String>,
    from: Option<Provenance>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawModule {
    name: String,
    octets: Vec<u8>,
    page: String,
    from: Option<Provenance>,
}

/// A device description file (GSD) that has been checked.
pub(crate) struct Gsd {
    pub page: String,
    pub keys: Vec<Key>,
    pub parameters: Vec<Parameter>,
    /// The user-specific octets of Set_Prm, with zeros for the parameters that a user can choose.
    pub constants: Vec<u8>,
    /// The user-specific octets of Set_Prm, with every parameter at its default.
    pub defaults: Vec<u8>,
    pub diagnosis: Option<Diagnosis>,
    pub modules: Vec<Module>,
}

pub(crate) struct Key {
    pub name: String,
    pub value: Value,
    pub bare: bool,
    pub from: Provenance,
}

/// A parameter that a user sets.
pub(crate) struct Parameter {
    /// The register's structure and name.
    pub register: (usize, String),
    /// Number of the first octet, counted from 0 over the octets of the user.
    pub octet: u32,
    pub name: String,
    /// Bit of the parameter, and whether its value 0 means yes.
    pub bit: Option<(u8, bool)>,
    pub default: u32,
    pub from: u32,
    pub to: u32,
}

/// The octet of the diagnosis with texts for its bits.
pub(crate) struct Diagnosis {
    pub register: (usize, String),
    /// Number of the octet, counted after the header.
    pub octet: u32,
    pub from: Provenance,
}

pub(crate) struct Module {
    pub name: String,
    pub octets: Vec<u8>,
    pub page: String,
    pub from: Provenance,
}

/// The layout in which registers are searched.
pub(crate) struct Layout<'a> {
    pub areas: &'a [Area],
    pub structures: &'a [Structure],
}

impl Layout<'_> {
    /// Returns the structure, offset and name of a register.
    fn find(
        &self,
        sources: &Sources,
        file: usize,
        area: &Spanned<String>,
        register: &Spanned<String>,
    ) -> Result<(usize, u32, String), Error> {
        let name = area.get_ref();
        let found = self.areas.iter().find(|known| known.name == *name);
        let found =
            found.ok_or_else(|| sources.error(at(file, area.span()), Reason::UnknownArea(name.clone())))?;
        let mut fields = found.structures.iter().flat_map(|placed| {
            let fields = &self.structures[placed.structure].fields;
            fields.iter().map(|field| (placed.structure, field))
        });
        let wanted = register.get_ref();
        let is_it =
            |field: &crate::model::Field| field.name == *wanted && matches!(field.kind, FieldType::Scalar(_));
        let (structure, field) = fields.find(|(_, field)| is_it(field)).ok_or_else(|| {
            let reason = Reason::NoSuchRegister { area: name.clone(), register: wanted.clone() };
            sources.error(at(file, register.span()), reason)
        })?;
        Ok((structure, field.offset, wanted.clone()))
    }
}

/// Reads and checks the file that `device.toml` names at `place`.
pub(crate) fn read(
    sources: &mut Sources,
    path: &str,
    place: SourcePlace,
    layout: &Layout<'_>,
) -> Result<Gsd, Error> {
    let (file, raw): (usize, File) = sources.parse(path, Some(place))?;
    let sources = &*sources;
    let mut keys: Vec<Key> = Vec::new();
    for key in raw.key {
        let place = at(file, key.span());
        let RawKey { name, is, bare, from } = key.into_inner();
        let is_keyword = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '.');
        if name.is_empty() || !is_keyword || keys.iter().any(|known| known.name == name) {
            return Err(sources.error(place, Reason::BadKeyword(name)));
        }
        keys.push(Key { name, value: is, bare, from: from.unwrap_or(Provenance::Manual) });
    }
    let RawParameters { area, first, constants, parameter } = raw.parameters;
    let (_, begin, _) = layout.find(sources, file, &area, &first)?;
    let (mut parameters, mut defaults) = (Vec::new(), constants.clone());
    for raw in parameter {
        let place = at(file, raw.span());
        let it = parameter_of(sources, (file, place), raw.into_inner(), (layout, &area, begin))?;
        it.put(&mut defaults)
            .ok_or_else(|| sources.error(place, Reason::GsdBehind(it.register.1.clone())))?;
        parameters.push(it);
    }
    let diagnosis = match raw.diagnosis {
        None => None,
        Some(raw) => {
            let (_, header, _) = layout.find(sources, file, &raw.area, &raw.header)?;
            let (structure, offset, name) = layout.find(sources, file, &raw.area, &raw.register)?;
            let octet = distance(sources, at(file, raw.register.span()), offset, header + 1, &name)?;
            Some(Diagnosis {
                register: (structure, name),
                octet,
                from: raw.from.unwrap_or(Provenance::Manual),
            })
        }
    };
    let modules = raw.module.into_iter().map(|RawModule { name, octets, page, from }| Module {
        name,
        octets,
        page,
        from: from.unwrap_or(Provenance::Manual),
    });
    Ok(Gsd { page: raw.page, keys, parameters, constants, defaults, diagnosis, modules: modules.collect() })
}

/// Returns the distance from `first` to `offset` in octets.
fn distance(
    sources: &Sources,
    place: SourcePlace,
    offset: u32,
    first: u32,
    name: &str,
) -> Result<u32, Error> {
    let reason = || Reason::RegisterBefore(name.to_owned());
    offset.checked_sub(first).ok_or_else(|| sources.error(place, reason()))
}

fn parameter_of(
    sources: &Sources,
    (file, place): (usize, SourcePlace),
    raw: RawParameter,
    (layout, area, begin): (&Layout<'_>, &Spanned<String>, u32),
) -> Result<Parameter, Error> {
    let (structure, offset, register) = layout.find(sources, file, area, &raw.register)?;
    let octet = distance(sources, place, offset, begin, &register)?;
    let RawParameter { bit, inverted, name, default, from, to, .. } = raw;
    let (from, default) = (from.unwrap_or(0), default.unwrap_or(0));
    let to = to.unwrap_or(1);
    let is_right = match bit {
        Some(bit) => bit < 8 && name.is_none() && from == 0 && to == 1,
        None => name.is_some() && !inverted,
    };
    if !is_right || !(from..=to).contains(&default) || to > u16::MAX.into() {
        return Err(sources.error(place, Reason::GsdParameter));
    }
    Ok(Parameter {
        register: (structure, register),
        octet,
        name: name.unwrap_or_default(),
        bit: bit.map(|bit| (bit, inverted)),
        default,
        from,
        to,
    })
}

impl Parameter {
    /// Returns the number of octets of the parameter.
    pub(crate) fn octets(&self) -> usize {
        if self.to > u8::MAX.into() { 2 } else { 1 }
    }

    /// Writes the default at its place in `octets`, high byte first. Returns `None` if the place is beyond the end.
    fn put(&self, octets: &mut [u8]) -> Option<()> {
        let first = self.octet as usize;
        let own = octets.get_mut(first..first + self.octets())?;
        match (self.bit, own) {
            (Some((bit, _)), [octet]) => *octet = *octet & !(1 << bit) | (self.default as u8) << bit,
            (_, [octet]) => *octet = self.default as u8,
            (_, own) => own.copy_from_slice(&(self.default as u16).to_be_bytes()),
        }
        Some(())
    }
}
