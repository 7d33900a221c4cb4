//! The front panel of the device: words in the header page that no other device needs to have.

use super::{Names, Parts, meaning};
use crate::error::{Error, Reason};
use crate::model::{FrontWord, Scalar};
use crate::raw;
use crate::source::{Sources, at};

/// Number of bytes that the front panel has in the header page.
const BYTES: u32 = 256;

/// Checks all words of the front panel and brings them into ascending order.
pub(super) fn check(
    sources: &Sources,
    file: usize,
    (raw, areas): (&[raw::Front], &[raw::Area]),
    parts: &Parts,
) -> Result<Vec<FrontWord>, Error> {
    // The front panel becomes an area of this name, so no other area may have the name.
    if let Some(area) = areas.iter().find(|area| !raw.is_empty() && area.name.get_ref() == "front") {
        let reason = Reason::DuplicateName(area.name.get_ref().clone());
        return Err(sources.error(at(file, area.name.span()), reason));
    }
    let mut names = Names::default();
    let mut front: Vec<FrontWord> = Vec::new();
    for raw in raw {
        names.add(sources, file, &raw.name)?;
        let name = raw.name.get_ref().clone();
        let ty = raw.ty.get_ref();
        let Some(scalar) = Scalar::named(ty).filter(|scalar| scalar.width() == 4) else {
            return Err(sources.error(at(file, raw.ty.span()), Reason::FrontType { name, ty: ty.clone() }));
        };
        let offset = *raw.offset.get_ref();
        let misplaced = |reason| sources.error(at(file, raw.offset.span()), reason);
        if offset > BYTES - 4 || !offset.is_multiple_of(4) {
            return Err(misplaced(Reason::FrontOffset { name, offset }));
        }
        if let Some(other) = front.iter().find(|other| other.offset == offset) {
            return Err(misplaced(Reason::FrontTwice { name, offset, other: other.name.clone() }));
        }
        let meaning = match &raw.meaning {
            None => None,
            Some(wanted) => {
                let wanted = (wanted.get_ref().as_str(), at(file, wanted.span()));
                Some(meaning::find(sources, parts, wanted, &name, scalar)?)
            }
        };
        let (page, doc, source) = (raw.page.clone(), raw.doc.clone(), raw.source.clone());
        let (owner, is_text) = (raw.owner, raw.text);
        front.push(FrontWord { name, scalar, offset, owner, meaning, is_text, source, page, doc });
    }
    front.sort_by_key(|word| word.offset);
    Ok(front)
}
