//! From the files as written to the checked model.

mod area;
mod field;
mod meaning;
mod port;
mod rate;
mod structure;

use crate::error::{Error, Reason};
use crate::model::Device;
use crate::raw;
use crate::source::{At, Sources, at};
use std::collections::BTreeMap;

/// Everything structures refer to by name.
struct Parts {
    /// Who writes what the manual reserves.
    reserved: raw::Reserved,
    /// Where the bits of each meaning stand, to point at a bit that is too wide for a register.
    meanings: Vec<meaning::Checked>,
    substructures: Vec<crate::model::Structure>,
    blocks: Vec<(usize, raw::Structure)>,
    /// Every name of a type that becomes a Rust item.
    types: Names,
}

/// Reads and checks the layout whose `device.toml` lies in the directory of `sources`.
pub fn load(sources: &mut Sources) -> Result<Device, Error> {
    let (file, raw): (usize, raw::Device) = sources.parse("device.toml", None)?;
    let mut parts = Parts {
        reserved: raw.reserved,
        meanings: Vec::new(),
        substructures: Vec::new(),
        blocks: Vec::new(),
        types: Names::default(),
    };
    let mut part_files = Vec::new();
    for name in &raw.parts {
        part_files.push(sources.parse::<raw::Parts>(name.get_ref(), Some(at(file, name.span())))?);
    }
    // All meanings first: sub-structures and blocks of any parts file may refer to them.
    for (file, part) in &part_files {
        for meaning in &part.meaning {
            meaning::add(sources, *file, meaning, &mut parts.meanings)?;
        }
    }
    let mut block_names = Names::default();
    for (file, part) in part_files {
        for raw in &part.substructure {
            parts.types.add(sources, file, &raw.name)?;
            // Without the others in sight: sub-structures do not nest.
            let others = std::mem::take(&mut parts.substructures);
            let checked = structure::check(sources, &parts, file, raw)?;
            if let Some(field) = checked.fields.iter().find(|field| field.dims.len() > 1) {
                let reason = Reason::NestedArray(field.name.clone());
                return Err(sources.error(at(file, raw.name.span()), reason));
            }
            parts.substructures = others;
            parts.substructures.push(checked);
        }
        for raw in part.block {
            block_names.add(sources, file, &raw.name)?;
            parts.blocks.push((file, raw));
        }
    }

    let mut structures = Vec::new();
    for name in &raw.structures {
        let file_name = format!("{}.toml", name.get_ref());
        let (file, raw): (usize, raw::Structure) = sources.parse(&file_name, Some(at(file, name.span())))?;
        parts.types.add(sources, file, &raw.name)?;
        structures.push(structure::check(sources, &parts, file, &raw)?);
    }
    let mut areas = area::check(sources, file, (&raw.area, &raw.names), &structures, &parts.substructures)?;
    areas.sort_by_key(|area| area.first);
    let ports = port::check(sources, file, &raw.port, &areas)?;
    let baud_rates = raw.baud_rate.iter().map(|rate| rate::check(sources, file, rate));
    let baud_rates = baud_rates.collect::<Result<_, Error>>()?;
    identifier(sources, at(file, raw.name.span()), &raw.name.get_ref().replace('-', "_"))?;
    Ok(Device {
        name: raw.name.into_inner(),
        title: raw.title,
        manual: raw.manual,
        dip_first: raw.dip.first,
        dip_last: raw.dip.last,
        meanings: parts.meanings.into_iter().map(|checked| checked.meaning).collect(),
        substructures: parts.substructures,
        structures,
        areas,
        ports,
        baud_rates,
    })
}

/// Names that must be unique.
#[derive(Default)]
struct Names(BTreeMap<String, ()>);

impl Names {
    fn add(&mut self, sources: &Sources, file: usize, name: &toml::Spanned<String>) -> Result<(), Error> {
        let place = at(file, name.span());
        identifier(sources, place, name.get_ref())?;
        match self.0.insert(name.get_ref().clone(), ()) {
            None => Ok(()),
            Some(()) => Err(sources.error(place, Reason::DuplicateName(name.get_ref().clone()))),
        }
    }
}

/// Names become Rust identifiers.
fn identifier(sources: &Sources, place: At, name: &str) -> Result<(), Error> {
    let good = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !name.starts_with(|c: char| c.is_ascii_digit())
        && name.contains(|c: char| c.is_ascii_alphanumeric());
    if good { Ok(()) } else { Err(sources.error(place, Reason::BadName(name.to_owned()))) }
}
