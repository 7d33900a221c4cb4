//! Address spaces: after the header page, aligned, and without overlap.

use super::Names;
use crate::error::{Error, Reason};
use crate::model::{Area, Space};
use crate::raw;
use crate::source::{Sources, at};

/// Bytes of the header page at the beginning of every image.
const HEADER: u32 = 4096;

/// Checks each space by itself. A space that gets its end from its areas has no bytes yet.
pub(super) fn check(sources: &Sources, file: usize, raw: &[raw::Space]) -> Result<Vec<Space>, Error> {
    let mut names = Names::default();
    let mut spaces: Vec<Space> = Vec::new();
    for raw in raw {
        names.add(sources, file, &raw.name)?;
        let space = Space {
            name: raw.name.get_ref().clone(),
            letter: raw.letter,
            segment: raw.segment,
            unit: raw.unit,
            first: *raw.first.get_ref(),
            offset: *raw.offset.get_ref(),
            bytes: raw.bytes.as_ref().map_or(0, |bytes| *bytes.get_ref()),
            page: raw.page.clone(),
            doc: raw.doc.clone(),
        };
        let (name, offset) = (space.name.clone(), space.offset);
        if offset < HEADER {
            let reason = Reason::SpaceInHeader { name, offset, header: HEADER };
            return Err(sources.error(at(file, raw.offset.span()), reason));
        }
        let by = 4 / space.unit_bytes();
        let numbers = [("first", &raw.first, by), ("offset", &raw.offset, 4)];
        let bytes = raw.bytes.iter().map(|bytes| ("bytes", bytes, space.unit_bytes()));
        for (key, given, by) in numbers.into_iter().chain(bytes) {
            let value = *given.get_ref();
            if !value.is_multiple_of(by) || (key == "bytes" && value == 0) {
                let reason = Reason::SpaceMisaligned { key, name, value, by };
                return Err(sources.error(at(file, given.span()), reason));
            }
        }
        spaces.push(space);
    }
    Ok(spaces)
}

/// Sets the end of spaces that end with their last area, and checks that no two spaces overlap.
pub(super) fn close(
    sources: &Sources,
    file: usize,
    raw: &[raw::Space],
    spaces: &mut [Space],
    areas: &[Area],
) -> Result<(), Error> {
    for (index, raw) in raw.iter().enumerate() {
        let wrong = |reason| Err(sources.error(at(file, raw.name.span()), reason));
        let (others, rest) = spaces.split_at_mut(index);
        let Some(space) = rest.first_mut() else { return Ok(()) };
        if space.bytes == 0 {
            let ends = areas.iter().filter(|area| area.space == index).map(|area| area.first + area.bytes);
            let Some(end) = ends.max() else { return wrong(Reason::SpaceWithoutEnd(space.name.clone())) };
            space.bytes = end - space.offset;
        }
        let bytes = u64::from(space.first) * u64::from(space.unit_bytes()) + u64::from(space.bytes);
        if space.end().max(bytes) > u64::from(u32::MAX) {
            return wrong(Reason::SpaceTooLong(space.name.clone()));
        }
        for other in others {
            let (name, other_name) = (space.name.clone(), other.name.clone());
            if u64::from(space.offset) < other.end() && u64::from(other.offset) < space.end() {
                let (first, last) = (space.offset, space.end() - 1);
                return wrong(Reason::SpaceOverlap { name, first, last, other: other_name });
            }
            if (space.letter, space.segment) == (other.letter, other.segment)
                && (space.unit != other.unit || numbers_meet(space, other))
            {
                return wrong(Reason::SpaceAmbiguous { name, other: other_name });
            }
        }
    }
    Ok(())
}

fn numbers_meet(one: &Space, other: &Space) -> bool {
    let end = |space: &Space| u64::from(space.first) + u64::from(space.bytes / space.unit_bytes());
    u64::from(one.first) < end(other) && u64::from(other.first) < end(one)
}
