//! Other devices of the family. If an import moves a shared structure, the registers of these devices move, too.

use super::homes::{Home, Homes, Table};
use super::matching::Placement;
use super::{ImportError, offsets};
use crate::check::files;
use crate::declaration::{Declarations, TypeId};
use crate::error::Error;
use crate::raw::Provenance;
use crate::source::Sources;
use std::path::{Path, PathBuf};

/// Another device that uses the family's structures.
pub(super) struct Other(Homes);

/// A shared list of registers that an import moves.
struct MovedList<'a> {
    /// The structure, sub-structure or block.
    home: &'a Home,
    /// The first register with another offset, or `size`.
    register: &'a str,
    before: u32,
    after: u32,
    /// The declared type that contains this offset.
    declared: TypeId,
}

/// Returns the other devices of the family of the layout in `dir`, in alphabetical order.
pub(super) fn of_family(dir: &Path, homes: &Homes) -> Result<Vec<Other>, Error> {
    let (Some(family), Some(parent)) = (&homes.family, dir.parent()) else { return Ok(Vec::new()) };
    let parent = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    let entries = parent.read_dir().into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let mut beside: Vec<PathBuf> = entries
        .filter(|path| path.file_name() != dir.file_name() && path.join("device.toml").is_file())
        .collect();
    beside.sort();
    // The family of an unreadable layout cannot be determined.
    beside.retain(|path| {
        let top = files::read(&mut Sources::new(path)).ok();
        top.and_then(|top| top.device.family).is_some_and(|it| it.get_ref() == family)
    });
    beside.iter().map(|path| Homes::read(Sources::new(path)).map(Other)).collect()
}

/// Refuses to move registers with offsets that the library of another device has confirmed. Returns the devices with
/// registers that move, too.
pub(super) fn check(
    homes: &Homes,
    placements: &[Placement],
    others: &[Other],
    declarations: &Declarations,
) -> Result<Vec<String>, ImportError> {
    let moved: Vec<_> = placements.iter().filter_map(|placement| moved(homes, placement)).collect();
    for (moved, other) in moved.iter().flat_map(|moved| others.iter().map(move |other| (moved, other))) {
        if let Some(confirmed) = other.confirms(moved.home.name()) {
            let library = match &confirmed.raw.offsets {
                Provenance::Documented(document) => document.clone(),
                Provenance::Manual | Provenance::Inferred(_) => "the manual".to_owned(),
            };
            return Err(ImportError::Confirmed {
                path: declarations.file_of(moved.declared).to_owned(),
                structure: moved.home.name().to_owned(),
                register: moved.register.into(),
                before: moved.before,
                after: moved.after,
                confirmed: other.0.files[confirmed.file].0.clone(),
                library: library.into(),
            });
        }
    }
    let also = if moved.is_empty() { &[] } else { others };
    Ok(also.iter().map(|other| other.0.device.clone()).collect())
}

/// Returns the first register of a shared list that `placement` moves.
fn moved<'a>(homes: &'a Homes, placement: &Placement) -> Option<MovedList<'a>> {
    let home = Some(&homes.all[placement.home]).filter(|home| home.is_shared)?;
    let before = home.offsets();
    let pairs = home.raw.register.iter().zip(before.into_iter().zip(offsets(placement)));
    let differs = pairs.filter_map(|(entry, (before, after))| {
        let name = entry.get_ref().name.as_ref()?.get_ref().as_str();
        Some((name, before?, after?)).filter(|(_, before, after)| before != after)
    });
    let of_size = Some(("size", home.size(), placement.size));
    let of_size =
        of_size.filter(|(_, before, after)| !matches!(home.table, Table::Block(_)) && before != after);
    let (register, before, after) = differs.chain(of_size).next()?;
    Some(MovedList { home, register, before, after, declared: placement.declared })
}

impl Other {
    /// Returns the structure of this device with confirmed offsets that has the registers of the family's list `name`.
    fn confirms(&self, name: &str) -> Option<&Home> {
        let homes = &self.0;
        let has_it = |structure: usize| {
            let parts = homes.parts(structure);
            parts.into_iter().any(|part| homes.all[part].is_shared && homes.all[part].name() == name)
        };
        let confirmed = homes.structures().filter(|index| !homes.is_viewed(*index));
        let confirmed = confirmed.filter(|index| homes.all[*index].is_confirmed());
        let mut uses_it =
            confirmed.filter(|index| has_it(*index) || homes.all[*index].view.is_some_and(&has_it));
        uses_it.next().map(|index| &homes.all[index])
    }
}
