//! The pages of the documentation: where they are installed, and which page describes a section of a TOML file.

use super::tables::TableKind;
use crate::devices::pages;
use std::path::{Path, PathBuf};

/// A section of a TOML file, its page, and a heading of this page; an empty heading is the beginning of the page.
type Section = (&'static str, &'static str, &'static str);

const PLANT: &str = "reference/plant.md";
const LAYOUTS: &str = "reference/layouts.md";
const FOLDERS: &str = "reference/device-folders.md";

const OF_PLANTS: &[Section] = &[
    ("plc", PLANT, ""),
    ("plc.drive", PLANT, "## The drive of a PLC"),
    ("plc.drive.monitoring", PLANT, "## Communication monitoring"),
    ("plc.option", FOLDERS, "## Option cards"),
    ("device", PLANT, ""),
    ("device.module", pages::OF_MODULES, ""),
    ("device.option", FOLDERS, "## Option cards"),
    ("bus", PLANT, ""),
    ("bus.drive", PLANT, "## Drives on a bus"),
    ("fault", "reference/faults.md", ""),
];

const OF_LAYOUTS: &[Section] = &[
    ("phase", LAYOUTS, "## Phases"),
    ("space", LAYOUTS, "## Spaces of addresses"),
    ("area", LAYOUTS, "## device.toml"),
    ("front", LAYOUTS, "## device.toml"),
    ("port", LAYOUTS, "## device.toml"),
    ("baud_rate", LAYOUTS, "## device.toml"),
    ("substructure", LAYOUTS, "## Structures, sub-structures, blocks"),
    ("block", LAYOUTS, "## Structures, sub-structures, blocks"),
    ("register", LAYOUTS, "## Registers"),
    ("substructure.register", LAYOUTS, "## Registers"),
    ("block.register", LAYOUTS, "## Registers"),
    ("meaning", LAYOUTS, "## Meanings"),
    ("object", LAYOUTS, "## Object dictionaries"),
    ("diagnosis", LAYOUTS, "## Device description files"),
    ("module", LAYOUTS, "## Device description files"),
    ("parameters", LAYOUTS, "## Device description files"),
    ("parameter", LAYOUTS, "## Parameter tables"),
];

const OF_HANDSHAKES: &[Section] = &[
    ("ready", FOLDERS, "## Handshakes"),
    ("answer", FOLDERS, "## Handshakes"),
    ("toggle", FOLDERS, "## Handshakes"),
    ("counter", FOLDERS, "## Handshakes"),
    ("watchdog", FOLDERS, "## Handshakes"),
    ("mirror", FOLDERS, "## Handshakes"),
    ("process_image", FOLDERS, "## PROFIBUS master"),
    ("record", FOLDERS, "## Handshakes"),
    ("fault", FOLDERS, "## Faults"),
];

/// A place in a page.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct PagePlace {
    pub(super) file: PathBuf,
    /// Line of the heading, from 1; `None` for the beginning of the page.
    pub(super) line: Option<usize>,
}

/// The directory with the pages.
#[derive(Debug)]
pub(super) struct Pages(Option<PathBuf>);

impl Pages {
    /// Finds the pages that belong to this program: in its package, or in the checkout that contains the program. Other
    /// programs, such as the one of the wheel, have no pages (D-875).
    #[cfg(not(test))]
    pub(super) fn of_program() -> Self {
        let program = std::env::current_exe().ok();
        let above = program.iter().flat_map(|program| program.ancestors().skip(1));
        let candidates = above.enumerate().flat_map(|(distance, directory)| {
            let installed = (distance == 1).then(|| directory.join("share/doc/commram/docs"));
            let is_checkout = directory.join("Cargo.toml").is_file();
            installed.into_iter().chain(is_checkout.then(|| directory.join("docs")))
        });
        Self::in_one_of(candidates)
    }

    /// The pages of this checkout, wherever Cargo puts the tests.
    #[cfg(test)]
    pub(super) fn of_program() -> Self {
        Self::in_one_of([PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs")].into_iter())
    }

    fn in_one_of(mut candidates: impl Iterator<Item = PathBuf>) -> Self {
        Self(candidates.find(|directory| directory.join(PLANT).is_file()))
    }

    /// Returns the description of a section, such as `plc.drive`, or of the section around it.
    pub(super) fn of_section(&self, kind: &TableKind, section: &str) -> Option<PagePlace> {
        let sections = match kind {
            TableKind::Plant => OF_PLANTS,
            TableKind::Layout(_) => OF_LAYOUTS,
            TableKind::Handshakes(_) => OF_HANDSHAKES,
        };
        let mut name = section;
        loop {
            if let Some((_, page, heading)) = sections.iter().find(|(section, ..)| *section == name) {
                return self.place(page, |line| !heading.is_empty() && line == *heading);
            }
            name = name.rsplit_once('.')?.0;
        }
    }

    /// Returns the description of a device, a module or a bus of this kind.
    pub(super) fn of_kind(&self, kind: &str) -> Option<PagePlace> {
        if let Some((_, page, heading)) = pages::OF_KINDS.iter().find(|(name, ..)| *name == kind) {
            return self.place(page, |line| !heading.is_empty() && line == *heading);
        }
        let is_name = kind.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '-');
        self.place(&format!("devices/{kind}/overview.md"), |_| false).filter(|_| is_name && !kind.is_empty())
    }

    /// Returns the description of a kind of fault: the heading with its name, or its line in the list of all kinds.
    pub(super) fn of_fault(&self, kind: &str) -> Option<PagePlace> {
        let (quoted, row) = (format!("`{kind}`"), format!("| `{kind}`"));
        let heading =
            self.place("reference/faults.md", |line| line.starts_with('#') && line.contains(&quoted))?;
        let found = if heading.line.is_some() {
            heading
        } else {
            self.place("reference/faults.md", |line| line.starts_with(&row))?
        };
        // A fault that a device declares is not in the page.
        found.line.is_some().then_some(found)
    }

    /// Returns the page with the first line for which `is_wanted` returns true; `None` if the page is missing.
    fn place(&self, page: &str, is_wanted: impl Fn(&str) -> bool) -> Option<PagePlace> {
        let file = self.0.as_deref()?.join(page);
        let text = std::fs::read_to_string(&file).ok()?;
        let line = text.lines().position(is_wanted).map(|line| line + 1);
        Some(PagePlace { file, line })
    }

    /// Name of a page for the user, for example `reference/plant.md`.
    pub(super) fn name_of<'a>(&self, file: &'a Path) -> &'a Path {
        self.0.as_deref().and_then(|root| file.strip_prefix(root).ok()).unwrap_or(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices;

    fn pages() -> Pages {
        Pages::of_program()
    }

    #[test]
    fn every_section_has_its_heading() {
        let kinds = [
            (TableKind::Plant, OF_PLANTS),
            (TableKind::Layout(PathBuf::new()), OF_LAYOUTS),
            (TableKind::Handshakes(PathBuf::new()), OF_HANDSHAKES),
        ];
        for (kind, sections) in kinds {
            for (section, page, heading) in sections {
                let place = pages().of_section(&kind, section).unwrap_or_else(|| panic!("{section}: {page}"));
                assert_eq!(place.line.is_some(), !heading.is_empty(), "{section}: {page} has no {heading}");
                assert!(place.file.ends_with(page), "{section}: {place:?}");
            }
            assert_eq!(pages().of_section(&kind, "unknown"), None);
        }
        let inner = pages().of_section(&TableKind::Plant, "bus.drive.parameters");
        assert_eq!(inner, pages().of_section(&TableKind::Plant, "bus.drive"));
    }

    #[test]
    fn every_kind_has_its_page() {
        let buses = devices::BUS_KINDS.iter().map(|kind| kind.name);
        let kinds = devices::all().iter().filter(|device| device.emulation.read.is_some());
        for kind in kinds.map(|device| device.layout.name).chain(buses).chain(["can-05", "can-06"]) {
            assert!(pages().of_kind(kind).is_some(), "{kind}");
        }
        for (kind, _, heading) in pages::OF_KINDS {
            assert_eq!(pages().of_kind(kind).unwrap().line.is_some(), !heading.is_empty(), "{kind}");
        }
        for none in ["", "../..", "../can-dp2", "unknown"] {
            assert_eq!(pages().of_kind(none), None, "{none}");
        }
    }

    #[test]
    fn every_kind_of_fault_has_its_place() {
        let of_devices = devices::all().iter().flat_map(|device| device.emulation.faults);
        let of_buses = devices::BUS_KINDS.iter().flat_map(|kind| kind.faults);
        for kind in of_devices.chain(of_buses).map(|kind| kind.name()) {
            assert!(pages().of_fault(kind).is_some(), "{kind}");
        }
        assert_eq!(pages().of_fault("unknown"), None);
    }

    #[test]
    fn a_program_without_pages_has_no_links() {
        let none = Pages::in_one_of(std::iter::empty());
        assert_eq!((none.of_kind("can"), none.of_fault("lose_frame")), (None, None));
        assert_eq!(none.of_section(&TableKind::Plant, "plc"), None);
    }
}
