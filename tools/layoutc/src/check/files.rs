//! The files of a layout: the files of the device, and those of its family.

use super::identifier;
use crate::error::Error;
use crate::raw;
use crate::source::{SourcePlace, Sources, at};
use toml::Spanned;

/// The entry files of a layout: `device.toml`, and `family.toml` if the device has a family.
pub(crate) struct Top {
    pub file: usize,
    pub device: raw::Device,
    /// Family of the device, with the number of its file.
    pub family: Option<(usize, raw::Family)>,
    /// Files with meanings, sub-structures and blocks. The files of the family come first.
    pub parts: Vec<FileReference>,
    /// Files that contain one structure each. The files of the family come first.
    pub structures: Vec<FileReference>,
}

/// A file that another one names.
pub(crate) struct FileReference {
    /// Name in the form that [`Sources::parse`] takes.
    pub path: String,
    /// Place of the name.
    pub at: SourcePlace,
    /// True if the file belongs to the family.
    pub shared: bool,
}

/// Reads `device.toml`. If it names a family, also reads `family.toml`.
pub(crate) fn read(sources: &mut Sources) -> Result<Top, Error> {
    let (file, device): (usize, raw::Device) = sources.parse("device.toml", None)?;
    let mut top = Top { file, device, family: None, parts: Vec::new(), structures: Vec::new() };
    if let Some(name) = &top.device.family {
        let place = at(file, name.span());
        identifier(sources, place, name.get_ref())?;
        let dir = format!("../{}/", name.get_ref());
        let (file, family): (usize, raw::Family) =
            sources.parse(&format!("{dir}family.toml"), Some(place))?;
        (top.parts, top.structures) = lists(file, &dir, &family.parts, &family.structures);
        top.family = Some((file, family));
    }
    let (parts, structures) = lists(file, "", &top.device.parts, &top.device.structures);
    top.parts.extend(parts);
    top.structures.extend(structures);
    Ok(top)
}

/// Reads the family in the directory of `sources`, as if it were a device without areas.
pub(crate) fn read_family(
    sources: &mut Sources,
) -> Result<(usize, raw::Family, Vec<FileReference>, Vec<FileReference>), Error> {
    let (file, family): (usize, raw::Family) = sources.parse("family.toml", None)?;
    let (parts, structures) = lists(file, "", &family.parts, &family.structures);
    Ok((file, family, parts, structures))
}

fn lists(
    file: usize,
    dir: &str,
    parts: &[Spanned<String>],
    structures: &[Spanned<String>],
) -> (Vec<FileReference>, Vec<FileReference>) {
    let named = |name: &Spanned<String>, end: &str| FileReference {
        path: format!("{dir}{}{end}", name.get_ref()),
        at: at(file, name.span()),
        shared: !dir.is_empty(),
    };
    (
        parts.iter().map(|name| named(name, "")).collect(),
        structures.iter().map(|name| named(name, ".toml")).collect(),
    )
}
