//! Reads the text of a plant file: passes each section to the device or bus that it belongs to, and finds the line of
//! an error.

use super::folders::Folders;
use super::keys::{self, Section};
use super::{PlantConfig, PlantError};
use crate::devices::folder::{self, FolderConfig, OptionSection};
use crate::devices::{self, BUS_KINDS, BusSection, DeviceConfig};
use crate::fault::FaultSpec;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::path::Path;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue, Deserializer, Error, ValueDeserializer};

/// The keys that are not in sections of devices and buses. The fields for sections exist only so that
/// messages list their names.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a plant: tables of its parts")]
struct Rest {
    #[serde(default = "default_cycle")]
    processor_cycle_us: u32,
    #[serde(default, rename = "plc")]
    _plc: Option<IgnoredAny>,
    #[serde(default, rename = "device")]
    _device: Option<IgnoredAny>,
    #[serde(default, rename = "bus")]
    _bus: Option<IgnoredAny>,
    #[serde(default)]
    fault: Vec<Spanned<FaultSpec>>,
}

fn default_cycle() -> u32 {
    500
}

/// Text of the plant file, for messages.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) file: &'a str,
    pub(super) text: &'a str,
}

/// Reads a plant file; relative paths of device folders begin at `base`. Also returns the offset of each
/// fault in the text, for errors that only a check of the whole plant can detect.
pub(super) fn read(base: &Path, file: &str, text: &str) -> Result<(PlantConfig, Vec<usize>), PlantError> {
    let source = Source { file, text };
    let mut table = DeTable::parse(text).map_err(|error| source.syntax(&error))?;
    let plcs = source.sections(table.get_mut(), "plc", "plc")?;
    let others = source.sections(table.get_mut(), "device", "device")?;
    let buses = source.sections(table.get_mut(), "bus", "bus")?;
    let section = Section { name: "", before: &[], keys: Vec::new() };
    let rest =
        Rest::deserialize(Deserializer::from(table)).map_err(|error| source.wrong(&error, &section))?;

    let mut devices: Vec<Arc<dyn DeviceConfig>> = Vec::with_capacity(plcs.len() + others.len());
    let kinds: Vec<_> = devices::all()
        .iter()
        .filter_map(|device| {
            let has_slots = !device.emulation.option_interfaces.is_empty();
            Some((device.layout.name, (device.emulation.read?, has_slots)))
        })
        .collect();
    let mut cards = Vec::new();
    for mut section in plcs {
        cards.extend(source.option_cards("plc.option", &mut section)?);
        devices.push(source.read("plc", &["option"], section, kinds[0].1.0)?);
    }
    let mut folders = Folders::new(source, base);
    for mut section in others {
        if let Some((folder, dir)) = folders.of(&mut section)? {
            let read = |section: ValueDeserializer<'_>| FolderConfig::read(folder, dir, section);
            devices.push(source.read("device", &["kind"], section, read)?);
            continue;
        }
        let (mut section, (read, has_slots)) = source.of_kind(section, "device", None, &kinds)?;
        let before: &[_] = if has_slots { &["kind", "option"] } else { &["kind"] };
        if has_slots {
            cards.extend(source.option_cards("device.option", &mut section)?);
        }
        devices.push(source.read("device", before, section, read)?);
    }
    for (controller, section) in cards {
        let (folder, dir) = folders.of_card(&section.card)?;
        devices.push(FolderConfig::card(folder, dir, controller, section));
    }
    let mut read_buses: Vec<Arc<dyn BusSection>> = Vec::with_capacity(buses.len());
    let kinds: Vec<_> = BUS_KINDS.iter().map(|bus| (bus.name, bus.read)).collect();
    for section in buses {
        let (section, read) = source.of_kind(section, "bus", Some(kinds[0].0), &kinds)?;
        read_buses.push(source.read("bus", &["kind"], section, read)?);
    }
    let Rest { processor_cycle_us, fault: faults, .. } = rest;
    let text = folders.absolute(text).into();
    let places = faults.iter().map(|fault| fault.span().start).collect();
    let faults = faults.into_iter().map(Spanned::into_inner).collect();
    Ok((PlantConfig { processor_cycle_us, devices, buses: read_buses, faults, text }, places))
}

/// Returns the line, from 1, of an offset. The function counts the lines from the beginning of the text. This
/// is slow, so only errors use it.
pub(super) fn line_of(text: &str, offset: usize) -> usize {
    1 + text.as_bytes().iter().take(offset).filter(|byte| **byte == b'\n').count()
}

impl PlantError {
    /// Returns the line of the plant file, from 1, that the error is about; `None` if the error has no line.
    #[must_use]
    pub fn line(&self) -> Option<usize> {
        match self {
            Self::At { line, .. } | Self::Syntax { line, .. } => *line,
            Self::NoSection { line, .. } | Self::Kind { line, .. } | Self::Folder { line, .. } => Some(*line),
            _ => None,
        }
    }

    /// Description of the error, without file and line.
    #[must_use]
    pub fn message(&self) -> String {
        let whole = match self {
            Self::At { source, .. } => return source.to_string(),
            Self::Syntax { what, .. } => return what.clone(),
            other => other.to_string(),
        };
        match self {
            Self::NoSection { file, line, .. }
            | Self::Kind { file, line, .. }
            | Self::Folder { file, line, .. } => {
                whole.strip_prefix(&format!("{file}: line {line}: ")).map_or(whole.clone(), str::to_owned)
            }
            _ => whole,
        }
    }
}

impl Source<'_> {
    fn syntax(&self, error: &Error) -> PlantError {
        let line = error.span().map(|span| self.line_of(span.start));
        // The parser puts its hint on a second line. Here both lines become one.
        let what = error.message().lines().collect::<Vec<_>>().join(", ");
        PlantError::Syntax { file: self.file.to_owned(), line, what }
    }

    /// Converts an error of the TOML reader in a section.
    fn wrong(&self, error: &Error, section: &Section) -> PlantError {
        match self.syntax(error) {
            PlantError::Syntax { file, line, what } => {
                let what = keys::describe(&what, self.text, error.span(), section);
                PlantError::Syntax { file, line, what }
            }
            other => other,
        }
    }

    fn line_of(&self, offset: usize) -> usize {
        line_of(self.text, offset)
    }

    /// Takes all sections `[[name]]` out of the file. `key` is their key in `table`.
    fn sections<'t>(
        &self,
        table: &mut DeTable<'t>,
        key: &str,
        name: &'static str,
    ) -> Result<DeArray<'t>, PlantError> {
        let Some(value) = table.remove(key) else { return Ok(DeArray::new()) };
        let place = value.span().start;
        match value.into_inner() {
            DeValue::Array(sections) => Ok(sections),
            _ => Err(PlantError::NoSection { file: self.file.to_owned(), line: self.line_of(place), name }),
        }
    }

    /// Takes the option cards, sections `[[name]]`, out of the section of their controller. Returns each card with the name
    /// of the controller.
    fn option_cards(
        &self,
        name: &'static str,
        section: &mut Spanned<DeValue<'_>>,
    ) -> Result<Vec<(String, OptionSection)>, PlantError> {
        let DeValue::Table(table) = section.get_mut() else { return Ok(Vec::new()) };
        let cards = self.sections(table, "option", name)?;
        let controller = table.get("name").and_then(|name| name.get_ref().as_str()).unwrap_or_default();
        let read = |section: ValueDeserializer<'_>| OptionSection::deserialize(section);
        cards.into_iter().map(|card| Ok((controller.to_owned(), self.read(name, &[], card, read)?))).collect()
    }

    /// Removes the key `kind` from a section and finds the reader for the other keys.
    fn of_kind<'t, R: Copy>(
        &self,
        mut section: Spanned<DeValue<'t>>,
        what: &'static str,
        default: Option<&str>,
        kinds: &[(&'static str, R)],
    ) -> Result<(Spanned<DeValue<'t>>, R), PlantError> {
        let given = match section.get_mut() {
            DeValue::Table(table) => table.remove("kind"),
            _ => None,
        };
        let place = given.as_ref().map_or(section.span().start, |kind| kind.span().start);
        let kind = given.as_ref().and_then(|kind| kind.get_ref().as_str());
        let kind = kind.or(default.filter(|_| given.is_none())).unwrap_or_default();
        match kinds.iter().find(|(name, _)| *name == kind) {
            Some((_, read)) => Ok((section, *read)),
            None => {
                let names = kinds.iter().map(|(name, _)| (*name).to_owned());
                let folders = if what == "device" { folder::names_in_search_path() } else { Vec::new() };
                let known = names.chain(folders).collect::<Vec<_>>().join(", ");
                let (file, line, kind) = (self.file.to_owned(), self.line_of(place), kind.to_owned());
                Err(PlantError::Kind { file, line, what, kind, known })
            }
        }
    }

    /// Reads a section. `before` are its keys that were removed before.
    fn read<T>(
        &self,
        name: &'static str,
        before: &'static [&'static str],
        section: Spanned<DeValue<'_>>,
        read: impl FnOnce(ValueDeserializer<'_>) -> Result<T, Error>,
    ) -> Result<T, PlantError> {
        let keys = match section.get_ref() {
            DeValue::Table(table) => table.keys().map(Spanned::span).collect(),
            _ => Vec::new(),
        };
        let section_keys = Section { name, before, keys };
        read(ValueDeserializer::from(section)).map_err(|error| self.wrong(&error, &section_keys))
    }
}
