//! Converts the files as written to the checked model.

mod area;
mod field;
pub(crate) mod files;
mod folder;
mod front;
mod id;
mod meaning;
mod phase;
mod port;
mod rate;
mod space;
mod structure;
mod view;

use crate::error::{Error, Reason};
use crate::gsd;
use crate::model::{Device, Structure};
use crate::objects;
use crate::raw;
use crate::source::{SourcePlace, Sources, at};
use files::{FileReference, Top};
use std::collections::BTreeMap;

/// All items to which structures refer by name.
struct Parts {
    /// Writer of the registers that the manual marks as reserved.
    reserved: raw::Reserved,
    /// The manual of the device that is checked.
    manual: String,
    /// Positions of the bits of each meaning in the file. An error about a bit that is too wide for a register uses
    /// them.
    meanings: Vec<meaning::CheckedMeaning>,
    meaning_names: Names,
    substructures: Vec<Structure>,
    structures: Vec<Structure>,
    blocks: Vec<(usize, raw::Structure)>,
    /// The names of all types that become Rust items.
    types: Names,
}

/// Reads and checks the layout with its `device.toml` in the directory of `sources`.
pub(crate) fn load(sources: &mut Sources) -> Result<Device, Error> {
    let Top { file, device: raw, family, parts, structures } = files::read(sources)?;
    if sources.is_folder() {
        folder::check(sources, file, &raw)?;
    }
    let family_manual = family.as_ref().map_or("", |(_, family)| &family.manual);
    let manual_of = |shared| if shared { family_manual } else { &raw.manual };
    let mut all = Parts::new(&raw.reserved, &raw.manual);
    let (shared, own): (Vec<_>, Vec<_>) = structures.into_iter().partition(|named| named.shared);
    all.read_parts(sources, &parts, manual_of)?;
    if let Some((_, family)) = &family {
        // The rules for reserved registers in the family's file apply to the registers of the family.
        let theirs = Parts::new(&family.reserved, &family.manual);
        let (reserved, manual) = (theirs.reserved, theirs.manual);
        let ours =
            (std::mem::replace(&mut all.reserved, reserved), std::mem::replace(&mut all.manual, manual));
        all.read_structures(sources, &shared)?;
        (all.reserved, all.manual) = ours;
    }
    all.read_structures(sources, &own)?;
    let mut spaces = space::check(sources, file, &raw.space)?;
    let of_family = family.as_ref().map(|(file, family)| (*file, family));
    let phases = phase::check(sources, of_family, (file, raw.phase.as_ref()))?;
    let of = area::Types { structures: &all.structures, subs: &all.substructures, phases: phases.as_ref() };
    let mut areas = area::check(sources, file, (&raw.area, &raw.names), &spaces, &of)?;
    if sources.is_folder() {
        folder::check_phases(sources, file, &raw, &all.structures)?;
    }
    area::check_variables(sources, file, &raw.area, &areas)?;
    space::close(sources, file, &raw.space, &mut spaces, &areas)?;
    let retain = area::retain(sources, file, &raw.area, &mut areas)?;
    areas.sort_by_key(|area| area.first);
    let objects = match &raw.objects {
        Some(path) => objects::read(sources, path.get_ref(), at(file, path.span()))?,
        None => Vec::new(),
    };
    let gsd = match &raw.gsd {
        Some(path) => {
            let layout = gsd::Layout { areas: &areas, structures: &all.structures };
            Some(gsd::read(sources, path.get_ref(), at(file, path.span()), &layout)?)
        }
        None => None,
    };
    let front = front::check(sources, file, (&raw.front, &raw.area), &all)?;
    let ports = port::check(sources, file, &raw.port, &areas)?;
    let own = raw.own.as_ref().map(|own| port::area(sources, file, own, &areas)).transpose()?;
    let baud_rates = raw.baud_rate.iter().map(|rate| rate::check(sources, file, rate));
    let baud_rates = baud_rates.collect::<Result<_, Error>>()?;
    identifier(sources, at(file, raw.name.span()), &raw.name.get_ref().replace('-', "_"))?;
    Ok(Device {
        name: raw.name.into_inner(),
        title: raw.title,
        manual: raw.manual,
        undocumented: raw.undocumented,
        family: raw.family.map(toml::Spanned::into_inner),
        dip_first: raw.dip.first,
        dip_last: raw.dip.last,
        meanings: all.meanings.into_iter().map(|checked| checked.meaning).collect(),
        substructures: all.substructures,
        structures: all.structures,
        spaces,
        areas,
        retain,
        objects,
        gsd,
        front,
        ports,
        own,
        baud_rates,
        phases: phases.map(|declared| declared.phases),
    })
}

/// Reads and checks the family with its `family.toml` in the directory of `sources`.
pub(crate) fn load_family(sources: &mut Sources) -> Result<Device, Error> {
    let (file, raw, parts, structures) = files::read_family(sources)?;
    let mut all = Parts::new(&raw.reserved, &raw.manual);
    all.read_parts(sources, &parts, |_| &raw.manual)?;
    all.read_structures(sources, &structures)?;
    identifier(sources, at(file, raw.name.span()), raw.name.get_ref())?;
    let phases = raw.phase.as_ref().map(|raw| phase::declared(sources, file, raw.get_ref(), false));
    let phases = phases.transpose()?.map(|declared| declared.phases);
    Ok(Device {
        name: raw.name.into_inner(),
        title: raw.title,
        manual: raw.manual,
        undocumented: String::new(),
        family: None,
        dip_first: 0,
        dip_last: 0,
        meanings: all.meanings.into_iter().map(|checked| checked.meaning).collect(),
        substructures: all.substructures,
        structures: all.structures,
        spaces: Vec::new(),
        areas: Vec::new(),
        retain: None,
        objects: Vec::new(),
        gsd: None,
        front: Vec::new(),
        ports: Vec::new(),
        own: None,
        baud_rates: Vec::new(),
        phases,
    })
}

impl Parts {
    fn new(reserved: &raw::Reserved, manual: &str) -> Self {
        Self {
            reserved: reserved.clone(),
            manual: manual.to_owned(),
            meanings: Vec::new(),
            meaning_names: Names::default(),
            substructures: Vec::new(),
            structures: Vec::new(),
            blocks: Vec::new(),
            types: Names::default(),
        }
    }

    /// Reads meanings, sub-structures and blocks. `manual_of` returns the manual of a file of the family, or of the
    /// device.
    fn read_parts<'a>(
        &mut self,
        sources: &mut Sources,
        files: &[FileReference],
        manual_of: impl Fn(bool) -> &'a str,
    ) -> Result<(), Error> {
        let mut read = Vec::new();
        for named in files {
            let (file, part) = sources.parse::<raw::Parts>(&named.path, Some(named.at))?;
            read.push((file, part, named.shared));
        }
        // Adds all meanings first, because sub-structures and blocks of any parts file may refer to them.
        for (file, part, shared) in &read {
            for raw in &part.meaning {
                self.meaning_names.add(sources, *file, &raw.name)?;
                let of = (manual_of(*shared), *shared);
                meaning::add(sources, *file, raw, of, &mut self.meanings)?;
            }
        }
        let mut block_names = Names::default();
        for (file, part, shared) in read {
            for raw in &part.substructure {
                self.types.add(sources, file, &raw.name)?;
                // The other sub-structures are hidden here, because a sub-structure must not contain another one.
                let others = std::mem::take(&mut self.substructures);
                let mut checked = structure::check(sources, self, file, raw)?;
                checked.shared = shared;
                if let Some(field) = checked.fields.iter().find(|field| field.dims.len() > 1) {
                    let reason = Reason::NestedArray(field.name.clone());
                    return Err(sources.error(at(file, raw.name.span()), reason));
                }
                self.substructures = others;
                self.substructures.push(checked);
            }
            for raw in part.block {
                block_names.add(sources, file, &raw.name)?;
                self.blocks.push((file, raw));
            }
        }
        Ok(())
    }

    fn read_structures(&mut self, sources: &mut Sources, files: &[FileReference]) -> Result<(), Error> {
        for named in files {
            let (file, raw): (usize, raw::Structure) = sources.parse(&named.path, Some(named.at))?;
            self.types.add(sources, file, &raw.name)?;
            let mut checked = structure::check(sources, self, file, &raw)?;
            checked.shared = named.shared;
            self.structures.push(checked);
        }
        Ok(())
    }
}

/// Names that must be unique even if upper and lower case are not distinguished: IEC 61131-3 does not distinguish them,
/// and constants in C have upper case only (D-787).
#[derive(Default)]
struct Names(BTreeMap<String, String>);

impl Names {
    fn add(&mut self, sources: &Sources, file: usize, name: &toml::Spanned<String>) -> Result<(), Error> {
        let place = at(file, name.span());
        identifier(sources, place, name.get_ref())?;
        let name = name.get_ref();
        let reason = match self.0.insert(name.to_ascii_lowercase(), name.clone()) {
            None => return Ok(()),
            Some(known) if known == *name => Reason::DuplicateName(known),
            Some(known) => Reason::DiffersInCase(name.clone(), known),
        };
        Err(sources.error(place, reason))
    }
}

/// Names become Rust identifiers.
fn identifier(sources: &Sources, place: SourcePlace, name: &str) -> Result<(), Error> {
    let good = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !name.starts_with(|c: char| c.is_ascii_digit())
        && name.contains(|c: char| c.is_ascii_alphanumeric());
    if good { Ok(()) } else { Err(sources.error(place, Reason::BadName(name.to_owned()))) }
}
