//! Phases: their order, and the register that shows them.

use super::Names;
use crate::error::{Error, Reason};
use crate::model::{ALWAYS, AreaStructure, FieldType, Phase, Phases, Structure};
use crate::raw;
use crate::source::{Sources, at};
use toml::Spanned;

/// Checked phases, with the file that declares them and the places of their first values in the file.
pub(super) struct Declared {
    pub phases: Phases,
    file: usize,
    firsts: Vec<std::ops::Range<usize>>,
}

/// Checks the phases of the family. Without a family, checks those of the device itself.
pub(super) fn check(
    sources: &Sources,
    family: Option<(usize, &raw::Family)>,
    (file, device): (usize, Option<&Spanned<raw::Phases>>),
) -> Result<Option<Declared>, Error> {
    let of_family = family.and_then(|(file, family)| Some((file, family.phase.as_ref()?)));
    match (of_family, device) {
        (Some(_), Some(own)) => Err(sources.error(at(file, own.span()), Reason::PhasesTwice)),
        (Some((file, raw)), None) => declared(sources, file, raw.get_ref(), true).map(Some),
        (None, Some(own)) => declared(sources, file, own.get_ref(), false).map(Some),
        (None, None) => Ok(None),
    }
}

/// Checks names and values.
pub(super) fn declared(
    sources: &Sources,
    file: usize,
    raw: &raw::Phases,
    shared: bool,
) -> Result<Declared, Error> {
    let mut names = Names::default();
    let mut phases: Vec<Phase> = Vec::new();
    if raw.values.get_ref().is_empty() || raw.values.get_ref().len() > u8::MAX.into() {
        return Err(sources.error(at(file, raw.values.span()), Reason::PhaseCount));
    }
    for raw in raw.values.get_ref() {
        names.add(sources, file, &raw.name)?;
        let (name, from) = (raw.name.get_ref().clone(), *raw.from.get_ref());
        if name == ALWAYS {
            return Err(sources.error(at(file, raw.name.span()), Reason::DuplicateName(name)));
        }
        if phases.last().map_or(from != 0, |before| from <= before.from) {
            return Err(sources.error(at(file, raw.from.span()), Reason::PhaseOrder(name)));
        }
        phases.push(Phase { name, from, variable: raw.variable.clone(), doc: raw.doc.clone() });
    }
    let firsts = raw.values.get_ref().iter().map(|raw| raw.from.span()).collect();
    let register = raw.register.get_ref().clone();
    let phases = Phases { register, source: raw.source.clone(), shared, values: phases };
    Ok(Declared { phases, file, firsts })
}

/// Returns the number of the phase called `name`. The phase `always` has the number 0.
pub(super) fn number(
    sources: &Sources,
    file: usize,
    name: &Spanned<String>,
    declared: Option<&Declared>,
) -> Result<usize, Error> {
    let wanted = name.get_ref();
    let known = || declared.into_iter().flat_map(|declared| &declared.phases.values);
    if wanted == ALWAYS {
        return Ok(0);
    }
    known().position(|phase| phase.name == *wanted).map(|index| index + 1).ok_or_else(|| {
        let known = known().map(|phase| format!(", `{}`", phase.name)).collect();
        sources.error(at(file, name.span()), Reason::UnknownPhase { name: wanted.clone(), known })
    })
}

/// Checks that a structure which is valid in one phase only has the register of the phases, at the same offset as the
/// others in its area.
pub(super) fn check_register(
    sources: &Sources,
    (file, live): (usize, &Spanned<String>),
    structure: &Structure,
    others: &[AreaStructure],
    (structures, declared): (&[Structure], &Declared),
) -> Result<(), Error> {
    let register = &declared.phases.register;
    let found = |structure: &Structure| {
        let field = structure.fields.iter().find(|field| field.name == *register)?;
        match field.kind {
            FieldType::Scalar(scalar) if field.dims.is_empty() => Some((field.offset, scalar)),
            _ => None,
        }
    };
    let wrong = |reason| Err(sources.error(at(file, live.span()), reason));
    let Some((offset, scalar)) = found(structure) else {
        let (structure, register) = (structure.name.clone(), register.clone());
        return wrong(Reason::NoPhaseRegister { structure, register });
    };
    // A comparison with one other structure is enough: all other structures were already compared with each other.
    if let Some(other) = others.iter().find(|other| other.live != 0) {
        let other = &structures[other.structure];
        if found(other).is_some_and(|(elsewhere, _)| elsewhere != offset) {
            let (structure, other, register) = (structure.name.clone(), other.name.clone(), register.clone());
            return wrong(Reason::PhaseRegisterMoved { structure, other, register });
        }
    }
    let bits = 8 * scalar.width();
    for (phase, place) in declared.phases.values.iter().zip(&declared.firsts) {
        if u64::from(phase.from) >> bits != 0 {
            let (value, name) = (phase.from.to_string(), register.clone());
            let reason = Reason::ValueTooWide { what: "`from`", value, name, ty: scalar.name(), bits };
            return Err(sources.error(at(declared.file, place.clone()), reason));
        }
    }
    Ok(())
}
