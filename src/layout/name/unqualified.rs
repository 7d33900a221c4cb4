//! Names without an area or a variable as a prefix.

use super::super::nearest::did_you_mean;
use super::{Area, Block, DeviceFit, Fit, LayoutError, RegisterRef};
use std::collections::BTreeSet;

/// Maximum number of names in the message about an ambiguous name.
const MOST_TOLD: usize = 6;

/// A name that is split at the first dot.
pub(super) enum Split<'a> {
    /// The block before the first dot, and the text after it.
    Block(Block, &'a str),
    /// The text before the first dot is not a block. The whole text may be the name of a register without an area.
    Unqualified,
}

impl<'a> Split<'a> {
    pub(super) fn of(fitted: &DeviceFit, name: &'a str) -> Result<Self, LayoutError> {
        let Some((front, path)) = name.split_once('.') else {
            return match fitted.block(name) {
                Ok(_) => Err(LayoutError::NotOneRegister { name: name.to_owned() }),
                Err(wrong_case @ LayoutError::WrongCase { .. }) => Err(wrong_case),
                Err(_) => Ok(Self::Unqualified),
            };
        };
        match fitted.block(front) {
            Ok(block) => Ok(Self::Block(block, path)),
            Err(unknown @ (LayoutError::UnknownArea { .. } | LayoutError::UnknownVariable { .. })) => {
                // The text before the dot may be a sub-structure.
                let group = front.split('[').next().unwrap_or_default();
                let areas = fitted.device().named_areas();
                let mut registers =
                    areas.flat_map(|area| fitted.placed(area)).flat_map(|placed| placed.structure.registers);
                if registers.any(|register| !group.is_empty() && register.group == group) {
                    Ok(Self::Unqualified)
                } else {
                    Err(unknown)
                }
            }
            Err(error) => Err(error),
        }
    }
}

/// The target of a text that can mean a whole area.
#[derive(Debug)]
pub enum AreaOrRegisters {
    /// The name means this area.
    Area(&'static Area),
    /// The registers that [`DeviceFit::registers`] finds.
    Registers(Vec<RegisterRef>),
}

impl DeviceFit {
    /// Returns the area or the registers that `name` means.
    ///
    /// # Errors
    /// Returns the errors of [`DeviceFit::registers`], and [`LayoutError::UnknownArea`] if `name` looks more like the
    /// name of an area.
    pub fn area_or_registers(&self, name: &str) -> Result<AreaOrRegisters, LayoutError> {
        let area = match self.device().area(name) {
            Ok(area) => return Ok(AreaOrRegisters::Area(area)),
            Err(refusal) => refusal,
        };
        self.registers(name)
            .map(AreaOrRegisters::Registers)
            .map_err(|refusal| match (&area, &refusal) {
                (LayoutError::UnknownArea { hint, .. }, LayoutError::UnknownName { hint: other, .. })
                    if !hint.is_empty() || other.is_empty() =>
                {
                    area
                }
                _ => refusal,
            })
            .map_err(|refusal| self.without_percent(name).unwrap_or(refusal))
    }

    /// Calls `look` for each area. Returns the result if exactly one area gives one.
    pub(super) fn only<T>(
        &self,
        name: &str,
        look: impl Fn(&Block) -> Result<T, LayoutError>,
    ) -> Result<T, LayoutError> {
        let mut found = Vec::new();
        // If an index is out of range in one area, this error is more helpful than a missing register in other areas.
        let mut refusal = None;
        for area in self.device().named_areas().filter(|area| self.area(area) != Fit::Empty) {
            match look(&Block { area, fit: self.area(area), only: None }) {
                Ok(one) => found.push((area, one)),
                Err(LayoutError::UnknownRegister { .. }) => {}
                Err(other) => {
                    refusal.get_or_insert(other);
                }
            }
        }
        if found.len() > 1 {
            let mut names: Vec<_> = found.iter().map(|(area, _)| format!("{}.{name}", area.name)).collect();
            if names.len() > MOST_TOLD {
                names.truncate(MOST_TOLD);
                names.push("...".to_owned());
            }
            return Err(LayoutError::Ambiguous { name: name.to_owned(), names: names.join(" or ") });
        }
        let nowhere = || refusal.unwrap_or_else(|| self.unknown_everywhere(name));
        found.pop().map(|(_, one)| one).ok_or_else(nowhere)
    }

    /// Returns the error that no area has a register of this name.
    fn unknown_everywhere(&self, name: &str) -> LayoutError {
        let areas = || self.device().named_areas().filter(|area| self.area(area) != Fit::Empty);
        let placed = areas().flat_map(|area| self.placed(area));
        let registers = placed.flat_map(|placed| placed.structure.registers);
        let names: BTreeSet<_> = registers.map(super::Register::full_name).collect();
        let plain = name.split('[').next().unwrap_or_default();
        let hint = did_you_mean(plain, areas().map(|area| area.name).chain(names.iter().map(String::as_str)));
        LayoutError::UnknownName { name: name.to_owned(), hint }
    }
}
