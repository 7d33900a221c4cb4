//! Selects variables by name.

use super::variables::{self, Causality, Variable, VariablesError};
use crate::identity::DeviceIndex;
use crate::layout::{DeviceFit, Fit, RegisterRef, is_pattern, plc_prefix, split_plc};
use crate::plant::Plant;
use std::collections::HashMap;

/// Maximum number of registers with which a finder compares patterns, for all names together. The comparisons take about
/// two seconds.
const MOST_COMPARISONS: u64 = 4_000_000;
/// Number of descriptors of registers that a finder compares with a name in the time of one register and a pattern.
const DESCRIPTORS: u64 = 8;
/// Maximum number of variables that a finder returns.
const MOST_VARIABLES: usize = 100_000;

/// Finds variables of a plant by their names. The time for a name does not depend on the number of PLCs and drives, and
/// for the name of a single register it does not depend on the lengths of arrays.
pub(crate) struct VariableFinder<'a> {
    plant: &'a Plant,
    plc_names: Vec<String>,
    plcs: HashMap<String, DeviceIndex>,
    drives: HashMap<String, usize>,
    /// PLCs with the same registers, in the order of their first PLCs.
    groups: Vec<PlcGroup>,
    /// Index in `groups` of each PLC.
    group_of: Vec<usize>,
    comparisons_left: u64,
    variables_left: usize,
}

/// PLCs with the same registers.
struct PlcGroup {
    fit: DeviceFit,
    plcs: Vec<DeviceIndex>,
    /// Number of descriptors of registers, and number of registers.
    size: (u64, u64),
    /// All registers in the order of variables, and their indices by offset and name; `None` before the first use.
    registers: Option<(Vec<RegisterRef>, RegisterIndices)>,
}

type RegisterIndices = HashMap<(u32, &'static str), Vec<usize>>;

impl<'a> VariableFinder<'a> {
    /// Creates a finder for a plant that has its buses, devices and drives already.
    pub(crate) fn of(plant: &'a Plant) -> Self {
        let names = plant.names();
        let (mut groups, mut group_of): (Vec<PlcGroup>, Vec<usize>) = (Vec::new(), Vec::new());
        let mut known: HashMap<DeviceFit, usize> = HashMap::new();
        for (plc, fit) in DeviceIndex::enumerate(&names.devices) {
            let group = *known.entry(*fit).or_insert_with(|| {
                groups.push(PlcGroup { fit: *fit, plcs: Vec::new(), size: size(fit), registers: None });
                groups.len() - 1
            });
            group_of.push(group);
            groups[group].plcs.push(plc);
        }
        Self {
            plcs: DeviceIndex::enumerate(&names.plcs).map(|(plc, name)| (name.clone(), plc)).collect(),
            drives: plant.drives().into_iter().enumerate().map(|(number, it)| (it.name, number)).collect(),
            plant,
            plc_names: names.plcs,
            groups,
            group_of,
            comparisons_left: MOST_COMPARISONS,
            variables_left: MOST_VARIABLES,
        }
    }

    /// Returns the variables that a name or pattern covers: registers, or a value at the shaft of a drive. For a register
    /// that both sides write, it returns the variable that can be set.
    ///
    /// # Errors
    /// There are no such variables, or the finder would return too many variables or take too long.
    pub(crate) fn find(&mut self, name: &str) -> Result<Vec<Variable>, VariablesError> {
        let mut of_drive = self.of_drive(name);
        if let Some(found) = of_drive.iter().position(|it| it.name == name) {
            return Ok(vec![of_drive.swap_remove(found)]);
        }
        match (self.registers(name), name.rsplit_once('.')) {
            (Err(VariablesError::Layout(_) | VariablesError::UnknownPlc { .. }), Some((drive, value)))
                if !of_drive.is_empty() =>
            {
                let known: Vec<_> = of_drive.iter().filter_map(|it| it.name.rsplit('.').next()).collect();
                let (drive, value, known) = (drive.to_owned(), value.to_owned(), known.join(", "));
                Err(VariablesError::UnknownOfDrive { drive, value, known })
            }
            (found, _) => found,
        }
    }

    /// Returns all values of the drive with which a name begins.
    fn of_drive(&self, name: &str) -> Vec<Variable> {
        let ends = name.match_indices('.').map(|(end, _)| end);
        let found = ends.filter_map(|end| {
            let drive = name.get(..end)?;
            Some((*self.drives.get(drive)?, drive))
        });
        found.max().map_or_else(Vec::new, |(number, drive)| variables::of_drive(number, drive))
    }

    fn registers(&mut self, text: &str) -> Result<Vec<Variable>, VariablesError> {
        let (plc, name) = split_plc(text);
        let plc = match plc {
            None => None,
            Some(plc) => {
                let known = self.plcs.get(plc);
                Some(*known.ok_or_else(|| VariablesError::unknown_plc(plc, &self.plc_names))?)
            }
        };
        let groups = match plc {
            None => 0..self.groups.len(),
            Some(plc) => {
                let group = self.group_of.get(plc.index()).copied().unwrap_or_default();
                group..group + 1
            }
        };
        // Without a PLC as its prefix, a name means the registers of all PLCs that have such registers.
        let (mut found, mut first_error) = (Vec::new(), None);
        for group in self.groups.get_mut(groups).unwrap_or_default() {
            let (descriptors, registers) = group.size;
            let cost = if is_pattern(name) { registers } else { descriptors.div_ceil(DESCRIPTORS) };
            self.comparisons_left =
                self.comparisons_left.checked_sub(cost.max(1)).ok_or(VariablesError::TooLong)?;
            let registers = match variables::registers(&group.fit, name) {
                Ok(registers) => group.in_order(&registers),
                Err(error) => {
                    first_error.get_or_insert(error);
                    continue;
                }
            };
            let plcs = plc.as_ref().map_or(&group.plcs[..], core::slice::from_ref);
            self.variables_left = plcs
                .len()
                .checked_mul(registers.len())
                .and_then(|count| self.variables_left.checked_sub(count))
                .ok_or(VariablesError::TooMany { most: MOST_VARIABLES })?;
            found.extend(plcs.iter().map(|plc| (*plc, registers.clone())));
        }
        if let Some(error) = first_error.filter(|_| found.is_empty()) {
            return Err(error);
        }
        found.sort_by_key(|(plc, _)| plc.index());
        let mut all = Vec::new();
        for (plc, registers) in found {
            let prefix = plc_prefix(&self.plc_names, plc);
            for register in registers {
                all.extend(variables::of_register(self.plant, plc, &prefix, &register));
            }
        }
        all.retain(|it| !(it.causality == Causality::Output && it.name.ends_with(".out")));
        Ok(all)
    }
}

impl PlcGroup {
    /// Returns the registers of variables among `found`, in the order of variables.
    fn in_order(&mut self, found: &[RegisterRef]) -> Vec<RegisterRef> {
        let fit = &self.fit;
        let (all, indices) = self.registers.get_or_insert_with(|| {
            let all = variables::registers_of(fit);
            let mut indices = RegisterIndices::new();
            for (index, register) in all.iter().enumerate() {
                indices.entry((register.offset(), register.register.name)).or_default().push(index);
            }
            (all, indices)
        });
        let keys = found.iter().map(|it| (it.offset(), it.register.name));
        let mut wanted: Vec<usize> = keys.filter_map(|key| indices.get(&key)).flatten().copied().collect();
        wanted.sort_unstable();
        wanted.dedup();
        wanted.into_iter().filter_map(|index| all.get(index)).copied().collect()
    }
}

/// Returns the number of descriptors of registers, and the number of registers.
fn size(fit: &DeviceFit) -> (u64, u64) {
    let areas = fit.device().areas.iter().filter(|area| fit.area(area) != Fit::Empty);
    let registers = areas.flat_map(|area| fit.placed(area)).flat_map(|placed| placed.structure.registers);
    registers.fold((0, 0), |(descriptors, count), register| {
        let elements: u64 = register.dims.iter().map(|dim| u64::from(dim.count)).product();
        (descriptors + 1, count + elements)
    })
}
