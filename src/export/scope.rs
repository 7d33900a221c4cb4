//! Scope of an export: the whole device or one area of it.

#[cfg(feature = "cli")]
use super::members::{self, Member};
use crate::layout::{Area, AreaStructure, DeviceLayout, LayoutError, Meaning, Register, Structure};
#[cfg(feature = "cli")]
use std::collections::BTreeSet;

/// The areas to export.
#[derive(Debug)]
pub struct Scope {
    /// Layout of the device to export.
    pub device: &'static DeviceLayout,
    /// Areas to export, in ascending order.
    pub areas: Vec<&'static Area>,
    /// The requested area; `None` for all areas.
    pub block: Option<&'static str>,
    /// Path of the device's folder for the head of the export; `None`: the device is not in a folder.
    pub folder: Option<String>,
}

impl Scope {
    /// Returns the whole device, or only the area with the name `block`.
    ///
    /// # Errors
    /// [`LayoutError`] if there is no such area.
    pub fn new(device: &'static DeviceLayout, block: Option<&str>) -> Result<Self, LayoutError> {
        let block = block.map(|name| device.area(name)).transpose()?;
        let areas = block.map_or_else(|| device.named_areas().collect(), |area| vec![area]);
        Ok(Self { device, areas, block: block.map(|area| area.name), folder: None })
    }

    /// Removes the front panel, which neither programs nor the processor of the device can access.
    pub(crate) fn without_front(mut self) -> Self {
        self.areas.retain(|area| !self.device.is_front(area.first));
        self
    }

    /// True if the scope is the whole device.
    pub fn is_whole(&self) -> bool {
        self.block.is_none()
    }

    /// Returns all structures with their places, in ascending order.
    pub fn placed(&self) -> impl Iterator<Item = (&'static Area, &'static AreaStructure)> {
        self.areas.iter().flat_map(|area| area.structures.iter().map(move |placed| (*area, placed)))
    }

    /// Returns the structures, each once.
    pub fn structures(&self) -> Vec<&'static Structure> {
        let mut found: Vec<&'static Structure> = Vec::new();
        for (_, placed) in self.placed() {
            if !found.iter().any(|known| core::ptr::eq(*known, placed.structure)) {
                found.push(placed.structure);
            }
        }
        found
    }

    /// Finds a name that two structures, sub-structures or meanings have, in upper or lower case: what has it, and the name. Only
    /// cards of a controller can have such names.
    #[cfg(feature = "cli")]
    pub(crate) fn ambiguous_name(&self) -> Option<(&'static str, &'static str)> {
        let structures = self.structures();
        // Several registers refer to one meaning, and several structures contain one sub-structure.
        let registers = structures.iter().flat_map(|of| of.registers);
        let meanings: BTreeSet<_> = registers
            .filter_map(|register| register.meaning)
            .map(|meaning| (meaning.name, format!("{:?} {:?}", meaning.values, meaning.bits)))
            .collect();
        let members = structures.iter().flat_map(|structure| members::of(structure));
        let groups: BTreeSet<_> = members
            .filter_map(|member| match member {
                Member::Group(group) => Some((group.type_name(), group.shape())),
                _ => None,
            })
            .collect();
        let types = structures.iter().map(|of| of.name).chain(groups.iter().map(|(name, _)| *name));
        let types = types.map(|name| ("structures", name));
        let meanings = meanings.iter().map(|(name, _)| ("meanings", *name));
        let mut seen = BTreeSet::new();
        types.chain(meanings).find(|(what, name)| !seen.insert((*what, name.to_ascii_lowercase())))
    }

    /// Returns the meanings that registers refer to, each once, with the first of these registers.
    pub fn meanings(&self) -> Vec<(&'static Meaning, &'static Register)> {
        let mut found: Vec<(&'static Meaning, &'static Register)> = Vec::new();
        for register in self.structures().iter().flat_map(|structure| structure.registers) {
            let Some(meaning) = register.meaning else { continue };
            if !found.iter().any(|(known, _)| known.name == meaning.name) {
                found.push((meaning, register));
            }
        }
        found
    }
}
