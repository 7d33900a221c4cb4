//! Selects variables by name.

use super::variables::{Causality, Variable, VariablesError, Wanted, of_registers};
use crate::plant::Plant;

/// Returns the variables that a name or pattern covers: registers, or a value at the shaft of a drive. For a register
/// that both sides write, it returns the variable that can be set.
///
/// # Errors
/// There are no such variables.
pub(crate) fn named(plant: &Plant, name: &str) -> Result<Vec<Variable>, VariablesError> {
    let mut of_drive: Vec<Variable> = Vec::new();
    for (number, drive) in plant.drives().iter().enumerate() {
        if name.strip_prefix(&drive.name).is_some_and(|rest| rest.starts_with('.')) {
            of_drive = super::variables::of_drive(number, &drive.name);
        }
    }
    if let Some(found) = of_drive.iter().position(|it| it.name == name) {
        return Ok(vec![of_drive.swap_remove(found)]);
    }
    let wanted = Wanted::of(plant, &[name.to_owned()]);
    if let (Err(_), Some((drive, value))) = (&wanted, name.rsplit_once('.'))
        && !of_drive.is_empty()
    {
        let known: Vec<_> = of_drive.iter().filter_map(|it| it.name.rsplit('.').next()).collect();
        let (drive, value, known) = (drive.to_owned(), value.to_owned(), known.join(", "));
        return Err(VariablesError::UnknownOfDrive { drive, value, known });
    }
    let mut found = of_registers(plant, &wanted?)?;
    found.retain(|it| !(it.causality == Causality::Output && it.name.ends_with(".out")));
    Ok(found)
}
