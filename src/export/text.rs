//! Texts that several formats use.

use super::scope::Scope;
use crate::layout::{Area, AreaStructure, DeviceLayout, Dim, Provenance, Register, Structure};
use std::collections::BTreeSet;

/// Returns the text of the comment at the head of every exported file.
pub(crate) fn banner(scope: &Scope, format: &str) -> Vec<String> {
    let device = scope.device;
    let mut banner = vec![
        title(scope),
        format!("Made by commram {} with `{}`; do not edit.", version(), command(scope, format)),
        format!("Layout hash 16#{:016X}.", device.layout_hash),
    ];
    if !device.undocumented.is_empty() {
        banner.push("What the manual documents and what not: it does not state".to_owned());
        banner.push(format!("{}.", device.undocumented));
    }
    if let Some(decisions) = names_from(device) {
        banner
            .push(format!("Names of areas, and of variables for which it has none, are ours ({decisions})."));
    }
    if let Some(decisions) = phases_from(device) {
        banner.push(format!("The phases in which overlaid structures are valid are inferred ({decisions})."));
    }
    banner.push(
        "Each fact that it does not state names the decision (D-nn) it follows from. The pages decisions.md in docs"
            .to_owned(),
    );
    banner.push(
        "give the reasons. Do not take those facts, above all offsets, for the device's without a check."
            .to_owned(),
    );
    banner
}

/// Returns the device, and the folder that describes it.
fn title(scope: &Scope) -> String {
    let DeviceLayout { title, manual, .. } = scope.device;
    format!("Registers of the {title}{} (manual {manual}).", folder(scope))
}

/// Suffix with the device's name and folder: `, device counter in the folder ./cards/counter`; or with a device of a plant
/// file. The suffix is empty if the device is in neither.
pub(crate) fn folder(scope: &Scope) -> String {
    let described = |path: String| match path.contains(".toml:") {
        true => format!(", as {path} has it"),
        false => format!(", device {} in the folder {path}", scope.device.name),
    };
    path(scope).map_or_else(String::new, described)
}

/// Returns the path of the device's folder. `?` replaces each character that could end a comment or a word of a shell.
/// A shell that expands the `?` still finds the folder.
fn path(scope: &Scope) -> Option<String> {
    let plain = |sign: char| match sign {
        '.' | '/' | '_' | '-' | '+' | '@' | '~' | ':' => sign,
        _ if sign.is_alphanumeric() => sign,
        _ => '?',
    };
    scope.folder.as_ref().map(|path| path.chars().map(plain).collect())
}

/// Returns a file in C or C++. The file is the same for all devices, except for the name of the device in the first
/// comment. `rest` is the text that follows the name in this comment.
pub(crate) fn template(scope: &Scope, format: &str, rest: &str) -> String {
    let head = banner(scope, format).iter().take(2).map(|line| format!(" * {line}\n")).collect::<String>();
    format!("/*\n{head}{rest}")
}

/// Returns the command that generates the export.
pub(crate) fn command(scope: &Scope, format: &str) -> String {
    let block = scope.block.map_or_else(String::new, |block| format!(" --block {block}"));
    let device = path(scope).unwrap_or_else(|| scope.device.name.to_owned());
    format!("commram export {format} --device {device}{block}")
}

/// Returns the decisions that define names of areas and variables; `None` if all names come from the manual.
pub(crate) fn names_from(device: &DeviceLayout) -> Option<String> {
    let of_area = |area: &'static Area| {
        let variables = area.structures.iter().map(|placed| placed.variable_from);
        variables.chain([area.name_from])
    };
    decisions(device.areas.iter().flat_map(of_area))
}

/// Returns the decisions that define in which phases overlaid structures are valid; `None` if the manual does.
pub(crate) fn phases_from(device: &DeviceLayout) -> Option<String> {
    let sources = |area: &'static Area| area.structures.iter().map(|placed| area.phase_source(placed.live));
    decisions(device.areas.iter().flat_map(sources))
}

fn decisions(sources: impl Iterator<Item = Provenance>) -> Option<String> {
    let decisions: BTreeSet<_> = sources.filter_map(Provenance::decision).collect();
    (!decisions.is_empty()).then(|| decisions.into_iter().collect::<Vec<_>>().join(", "))
}

/// Returns the version of commram.
pub(crate) const fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// Array bounds in brackets: `[32][16]`.
pub(crate) fn bounds(dims: &[Dim]) -> String {
    dims.iter().map(|dim| format!("[{}]", dim.count)).collect()
}

/// Bounds of the used part, if only a part is used: `[0..31][0..7]`.
pub(crate) fn used(register: &Register) -> Option<String> {
    if register.dims.iter().all(|dim| dim.used == dim.count) {
        return None;
    }
    Some(register.dims.iter().map(|dim| format!("[0..{}]", dim.used.saturating_sub(1))).collect())
}

/// Returns a register's description on one line: owner, purpose, reserved values, pages, and the facts that are not in
/// the manual.
pub(crate) fn remark(register: &Register) -> String {
    let used = used(register).filter(|_| !register.reserved);
    let used = used.map(|used| format!("; {used} in use")).unwrap_or_default();
    let Register { owner, doc, page, .. } = register;
    let inferred = Provenance::inferred(&register.facts());
    let inferred = inferred.map_or_else(String::new, |facts| format!("; inferred: {facts}"));
    let sources = match page.is_empty() {
        true => inferred.trim_start_matches("; ").to_owned(),
        false => format!("p. {page}{inferred}"),
    };
    let sources = if sources.is_empty() { sources } else { format!(" ({sources})") };
    format!("{owner}: {doc}{used}{sources}")
}

/// Suffix with the pages of the manual: ` (p. 12)`. The suffix is empty if the manual has no page, as for the word of a
/// device's front that commram adds.
pub(crate) fn pages(page: &str) -> String {
    if page.is_empty() { String::new() } else { format!(" (p. {page})") }
}

/// Suffix of a variable: empty, or the decision from which its name follows.
pub(crate) fn made_up(placed: &AreaStructure) -> Option<String> {
    placed.variable_from.decision().map(|decision| format!("name inferred, {decision}"))
}

/// Returns the decisions for the facts about the registers of a structure; `None` if all are documented.
pub(crate) fn sources(registers: &[Register]) -> Option<String> {
    let mut known: Vec<(&str, Vec<&str>)> = Vec::new();
    for (fact, from) in registers.iter().flat_map(Register::facts) {
        let Some(decision) = from.decision() else { continue };
        match known.iter_mut().find(|(known, _)| *known == fact) {
            Some((_, decisions)) if decisions.contains(&decision) => {}
            Some((_, decisions)) => decisions.push(decision),
            None => known.push((fact, vec![decision])),
        }
    }
    let facts: Vec<_> =
        known.iter().map(|(fact, decisions)| format!("{fact} {}", decisions.join(" "))).collect();
    (!facts.is_empty()).then(|| format!("Inferred, not in the manual: {}.", facts.join(", ")))
}

/// Suffix of a type: the decision from which its name follows. The suffix is empty for a name of the manual.
pub(crate) fn source_of_type(name_from: Provenance) -> String {
    name_from
        .decision()
        .map_or_else(String::new, |decision| format!(" Name of the type: inferred, {decision}."))
}

/// Description of a structure: purpose, pages, the origin of its name, and its inferred facts.
pub(crate) fn about(structure: &Structure) -> String {
    let Structure { doc, page, name_from, registers, .. } = structure;
    let sources = sources(registers).map(|sources| format!(" {sources}")).unwrap_or_default();
    format!("{doc}{}.{}{sources}", pages(page), source_of_type(*name_from))
}

/// True if the text in a programming language contains `name` as a whole word.
pub(super) fn has_word(text: &str, name: &str) -> bool {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    text.split(|c| !is_part(c)).any(|word| word == name)
}

/// Converts a name to lower case with `_`: `event_slot` for `EventSlot`.
pub(crate) fn snake(name: &str) -> String {
    let mut snake = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !snake.is_empty() {
            snake.push('_');
        }
        snake.push(c.to_ascii_lowercase());
    }
    snake
}
