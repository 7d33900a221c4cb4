//! Register names: `[plc:]area.register[i][j]` and `[plc:]area.group[i].register`. The area may be replaced by the
//! variable that the manual declares there, as in `_CTRL_MA.w_CPU_CONTROL`, or omitted if only one area has such a
//! register.

mod unqualified;

use crate::identity::DeviceIndex;
pub use unqualified::AreaOrRegisters;

use super::descriptor::{Area, AreaStructure, DeviceLayout, Register};
use super::device_fit::{DeviceFit, Fit};
use super::error::LayoutError;
use super::nearest::did_you_mean;
use super::pattern::Pattern;
use super::register::RegisterRef;
use std::collections::BTreeSet;
use unqualified::Split;

/// Splits a name such as `line2:node2.w_CPU_CONTROL` into the name of the PLC, if there is one, and the rest.
#[must_use]
pub fn split_plc(text: &str) -> (Option<&str>, &str) {
    match text.split_once(':') {
        Some((plc, rest)) => (Some(plc), rest),
        None => (None, text),
    }
}

/// Returns the prefix of register names of PLC number `plc`. If there are several PLCs, it is the name of the PLC and a
/// colon; if not, it is empty. This is the reverse of [`split_plc`].
#[must_use]
pub fn plc_prefix(plcs: &[String], plc: DeviceIndex) -> String {
    match plcs.get(plc.index()) {
        Some(name) if plcs.len() > 1 => format!("{name}:"),
        _ => String::new(),
    }
}

/// A part of a name, with the indices that follow it.
struct NamePart<'a> {
    name: &'a str,
    index: Vec<u32>,
}

/// The text after the area in a name. It consists of one or two parts.
struct Path<'a> {
    text: &'a str,
    group: Option<NamePart<'a>>,
    register: NamePart<'a>,
}

impl<'a> Path<'a> {
    fn parse(text: &'a str) -> Result<Self, LayoutError> {
        let wrong = |reason| LayoutError::BadName { text: text.to_owned(), reason };
        let mut parts = Vec::new();
        for piece in text.split('.') {
            let (name, mut rest) = piece.split_at(piece.find('[').unwrap_or(piece.len()));
            let mut index = Vec::new();
            while !rest.is_empty() {
                let inner = rest.strip_prefix('[').ok_or(wrong("something after a `]`"))?;
                let (number, following) = inner.split_once(']').ok_or(wrong("a `[` without `]`"))?;
                index.push(number.trim().parse().map_err(|_| wrong("an index that is no number"))?);
                rest = following;
            }
            match (name.is_empty(), parts.last_mut()) {
                (false, _) => parts.push(NamePart { name, index }),
                // The vendor's watch window may show a dot between the brackets (manual p. 159).
                (true, Some(NamePart { index: all, .. })) if !index.is_empty() => all.extend(index),
                (true, _) => return Err(wrong("an empty part")),
            }
        }
        let mut parts = parts.into_iter();
        match (parts.next(), parts.next(), parts.next()) {
            (Some(register), None, _) => Ok(Self { text, group: None, register }),
            (Some(group), Some(register), None) => Ok(Self { text, group: Some(group), register }),
            _ => Err(wrong("too many parts")),
        }
    }

    /// If the path has the manual's other name for a register ([`Register::also`]), replaces it by the register's own
    /// name.
    fn in_block(mut self, block: &Block) -> Self {
        let registers = || block.placed().flat_map(|placed| placed.structure.registers);
        let is_also = |register: &&Register| {
            !register.also.is_empty()
                && register.also == self.register.name
                && register.group == self.group_name()
        };
        if !registers().any(|register| self.is(register))
            && let Some(register) = registers().find(is_also)
        {
            self.register.name = register.name;
        }
        self
    }

    fn group_name(&self) -> &'a str {
        self.group.as_ref().map_or("", |group| group.name)
    }

    fn is(&self, register: &Register) -> bool {
        register.name == self.register.name && register.group == self.group_name()
    }

    fn is_but_for_case(&self, register: &Register) -> bool {
        register.name.eq_ignore_ascii_case(self.register.name)
            && register.group.eq_ignore_ascii_case(self.group_name())
    }
}

impl DeviceLayout {
    /// Returns the area called `name`.
    ///
    /// # Errors
    /// [`LayoutError::UnknownArea`], which lists all areas, or [`LayoutError::WrongCase`].
    pub fn area(&'static self, name: &str) -> Result<&'static Area, LayoutError> {
        if let Some(area) = self.named_areas().find(|area| area.name == name) {
            return Ok(area);
        }
        if let Some(area) = self.named_areas().find(|area| area.name.eq_ignore_ascii_case(name)) {
            return Err(LayoutError::WrongCase { given: name.to_owned(), right: area.name.to_owned() });
        }
        let known: Vec<_> = self.named_areas().map(|area| area.name).collect();
        let hint = did_you_mean(name, known.iter().copied());
        Err(LayoutError::UnknownArea { area: name.to_owned(), known: known.join(", "), hint })
    }

    /// Returns the register with the name `name`, for a device with unknown ports. See [`DeviceFit::register`].
    ///
    /// # Errors
    /// The error describes the mistake in the name, and gives the correct notation.
    pub fn register(&'static self, name: &str) -> Result<RegisterRef, LayoutError> {
        DeviceFit::unknown(self).register(name)
    }

    /// Returns all registers that `name` covers, for a device with unknown ports. See [`DeviceFit::registers`].
    ///
    /// # Errors
    /// Returns the errors of [`DeviceLayout::register`].
    pub fn registers(&'static self, name: &str) -> Result<Vec<RegisterRef>, LayoutError> {
        DeviceFit::unknown(self).registers(name)
    }
}

impl DeviceFit {
    /// Returns the register with the name `name`, which has no PLC as a prefix. A register that INIT and cyclic
    /// structure share is returned as a register of the cyclic structure.
    ///
    /// # Errors
    /// The error describes the mistake in the name, and gives the correct notation. [`LayoutError::Ambiguous`], if the
    /// place of the register depends on the unknown role of the port.
    pub fn register(&self, name: &str) -> Result<RegisterRef, LayoutError> {
        if Pattern::is_one(name) {
            return Err(LayoutError::Several { pattern: name.to_owned() });
        }
        let found = match Split::of(self, name)? {
            Split::Block(block, path) => self.named(&block, path, name)?,
            Split::Unqualified => return self.only(name, |block| self.named(block, name, name)?.register()),
        };
        found.register()
    }

    /// Returns all registers that `name` covers, in address order. `name` is an area or a variable alone, an array
    /// without indices, a sub-structure, a single register, or a pattern ([`is_pattern`](super::is_pattern)). In a
    /// pattern, `*` matches any text and `[0..3]` matches a range of indices. If the place of a register depends on the
    /// unknown role of the port, the result has the registers of every role.
    ///
    /// # Errors
    /// Returns the errors of [`DeviceFit::register`], and [`LayoutError::NoMatch`] if no register matches the
    /// pattern.
    pub fn registers(&self, name: &str) -> Result<Vec<RegisterRef>, LayoutError> {
        if Pattern::is_one(name) {
            return self.matching(name);
        }
        if !name.contains('.')
            && let Ok(block) = self.block(name)
        {
            return Ok(block.by_address(|_| true, |_| true));
        }
        match Split::of(self, name)? {
            Split::Block(block, path) => self.all_named(&block, path, name),
            Split::Unqualified => self.only(name, |block| self.all_named(block, name, name)),
        }
    }

    /// Returns the registers of an area that `wanted` accepts, each once, in ascending order.
    pub(super) fn registers_where(
        &self,
        area: &'static Area,
        wanted: impl Fn(&RegisterRef) -> bool,
    ) -> Vec<RegisterRef> {
        Block { area, fit: self.area(area), only: None }.by_address(|_| true, wanted)
    }

    /// Returns all registers of a block that `path` covers.
    fn all_named(&self, block: &Block, path: &str, name: &str) -> Result<Vec<RegisterRef>, LayoutError> {
        let parsed = Path::parse(path)?;
        let parsed = if path == name { parsed } else { parsed.in_block(block) };
        let matches = |given: &[u32], index: &[u16]| {
            given.len() <= index.len()
                && given.iter().zip(index).all(|(given, index)| *given == u32::from(*index))
        };
        if parsed.group.is_none() {
            let NamePart { name: wanted, index } = &parsed.register;
            let is_meant = |Register { group, name, .. }: &Register| {
                group == wanted || group.is_empty() && name == wanted && index.is_empty()
            };
            let all = block.by_address(is_meant, |found| {
                let Register { group, group_dims, .. } = found.register;
                group != wanted || matches(index, &found.index[..*group_dims])
            });
            if !all.is_empty() {
                return Ok(all);
            }
            let mut members =
                block.placed().flat_map(|it| it.structure.registers.iter().map(move |own| (it, own)));
            if let Some((placed, register)) =
                members.find(|(_, own)| !own.group.is_empty() && own.group == *wanted)
            {
                // The sub-structure exists, so its indices are wrong.
                let member = NamePart { name: register.name, index: Vec::new() };
                let path = Path { text: path, group: Some(parsed.register), register: member };
                return Found { block: block.clone(), placed, register, path }
                    .register()
                    .map(|one| vec![one]);
            }
        }
        let one = self.named(block, path, name).and_then(Found::register);
        if !matches!(one, Err(LayoutError::IndexCount { .. } | LayoutError::Ambiguous { .. })) {
            return one.map(|one| vec![one]);
        }
        let all = block.by_address(
            |register| parsed.is(register),
            |found| {
                let Register { group_dims, dims, .. } = found.register;
                let (group, own) = found.index[..dims.len()].split_at(*group_dims);
                let group_index = parsed.group.as_ref().map_or(&[][..], |group| &group.index);
                matches(group_index, group) && matches(&parsed.register.index, own)
            },
        );
        if all.is_empty() { one.map(|one| vec![one]) } else { Ok(all) }
    }

    /// Returns place and descriptor of the register with the name `path` in a block, but does not check the indices.
    /// `name` is the complete text, for errors.
    fn named<'a>(&self, block: &Block, path: &'a str, name: &str) -> Result<Found<'a>, LayoutError> {
        let parsed = Path::parse(path)?;
        // In a text without an area, the register has its own name already, so nothing is replaced.
        let path = if path == name { parsed } else { parsed.in_block(block) };
        let mut found: Vec<(&'static AreaStructure, &'static Register)> = Vec::new();
        for placed in block.placed() {
            let hidden = found.iter().any(|(preferred, _)| preferred.shares_role(placed));
            let register = placed.structure.registers.iter().find(|register| path.is(register));
            found.extend(register.filter(|_| !hidden).map(|register| (placed, register)));
        }
        if let Some((placed, register)) = found.first().copied() {
            if found.iter().any(|(_, other)| !other.lies_like(register)) {
                // Sorted as in the layout.
                let names =
                    found.iter().rev().map(|(placed, _)| format!("{}.{}", placed.variable, path.text));
                let names = names.collect::<Vec<_>>().join(" or ");
                return Err(LayoutError::Ambiguous { name: name.to_owned(), names });
            }
            return Ok(Found { block: block.clone(), placed, register, path });
        }
        let mut registers = block.placed().flat_map(|placed| placed.structure.registers);
        match registers.find(|register| path.is_but_for_case(register)) {
            Some(register) => {
                Err(LayoutError::WrongCase { given: path.text.to_owned(), right: register.pattern() })
            }
            None => Err(unknown(block, &path)),
        }
    }

    /// Returns the block with the name `front`, which is the text before the first dot: an area, or the variable that
    /// the manual declares there.
    fn block(&self, front: &str) -> Result<Block, LayoutError> {
        let variables = || {
            let areas = self.device().named_areas();
            areas.flat_map(|area| area.structures.iter().map(move |placed| (area, placed)))
        };
        if let Some((area, placed)) = variables().find(|(_, placed)| placed.variable == front) {
            let fit = self.area(area);
            return match (fit, placed.role) {
                (Fit::As(port_role), Some(variable_role)) if port_role != variable_role => {
                    let (variable, area) = (placed.variable, area.name);
                    Err(LayoutError::WrongRole { variable, variable_role, area, port_role })
                }
                _ => Ok(Block { area, fit, only: Some(placed) }),
            };
        }
        match self.device().area(front) {
            Ok(area) => Ok(Block { area, fit: self.area(area), only: None }),
            Err(LayoutError::UnknownArea { .. }) if front.starts_with('_') => {
                let names = || variables().map(|(_, placed)| placed.variable);
                if let Some(right) = names().find(|name| name.eq_ignore_ascii_case(front)) {
                    return Err(LayoutError::WrongCase { given: front.to_owned(), right: right.to_owned() });
                }
                let known = names().collect::<Vec<_>>().join(", ");
                let hint = did_you_mean(front, names());
                Err(LayoutError::UnknownVariable { variable: front.to_owned(), known, hint })
            }
            Err(error) => Err(error),
        }
    }
}

/// The area or the variable that a register name begins with.
#[derive(Clone)]
struct Block {
    area: &'static Area,
    fit: Fit,
    /// Structure to search, if the name begins with the variable of a structure.
    only: Option<&'static AreaStructure>,
}

impl Block {
    /// Returns the structures that the name can mean. Cyclic structures, which come last in the layout, are preferred
    /// and come first here. For an empty slot, returns all structures that the slot can have with any module.
    fn placed(&self) -> impl Iterator<Item = &'static AreaStructure> + use<'_> {
        let named = self
            .area
            .structures
            .iter()
            .rev()
            .filter(|placed| self.only.is_none_or(|only| core::ptr::eq(only, *placed)));
        named.filter(|placed| self.fit == Fit::Empty || self.fit.has(placed.role))
    }

    /// Returns the registers that `wanted` accepts, and that have a descriptor with `has`, each once, in ascending order.
    fn by_address(
        &self,
        has: impl Fn(&Register) -> bool,
        wanted: impl Fn(&RegisterRef) -> bool,
    ) -> Vec<RegisterRef> {
        let role = self.fit.role();
        let all = self.placed().flat_map(|placed| self.area.registers_with(placed, &has));
        let mut all: Vec<_> = all.map(|found| RegisterRef { role, ..found }).filter(wanted).collect();
        all.sort_by_key(RegisterRef::offset);
        let mut kept: Vec<RegisterRef> = Vec::with_capacity(all.len());
        for register in all {
            // Registers that structures share are adjacent after sorting.
            let here = kept.iter().rev().take_while(|other| other.offset() == register.offset());
            let is_twin = |other: &RegisterRef| other.register.name == register.register.name;
            if !here.copied().any(|other| is_twin(&other)) {
                kept.push(register);
            }
        }
        kept
    }
}

struct Found<'a> {
    block: Block,
    placed: &'static AreaStructure,
    register: &'static Register,
    path: Path<'a>,
}

impl Found<'_> {
    /// Returns the register, if the name has exactly the required indices.
    fn register(self) -> Result<RegisterRef, LayoutError> {
        let Found { block, placed, register, path } = self;
        let mut given = path.group.iter().flat_map(|group| group.index.iter()).collect::<Vec<_>>();
        let group_given = given.len();
        given.extend(&path.register.index);
        if group_given != register.group_dims || given.len() != register.dims.len() {
            return Err(index_count(register, path.text));
        }
        let mut index = [0; 2];
        for ((slot, dim), given) in index.iter_mut().zip(register.dims).zip(given) {
            *slot = u16::try_from(*given).ok().filter(|i| *i < dim.count).ok_or_else(|| {
                let of = if register.group_dims > 0 { register.group } else { register.name };
                LayoutError::IndexRange { name: path.text.to_owned(), index: *given, of, last: dim.count - 1 }
            })?;
        }
        Ok(RegisterRef { area: block.area, placed, register, index, role: block.fit.role() })
    }
}

impl Register {
    /// Returns the name of the register, with the sub-structure as a prefix and without indices:
    /// `a_DATA_PARAMETER.w_PAR_NR`.
    fn full_name(&self) -> String {
        full_name(self.group, self.name)
    }

    /// Returns the name of the register with the ranges of its indices: `a_RD_BMARRAY[0..31][0..15]`.
    #[must_use]
    pub fn pattern(&self) -> String {
        let mut ranges = self.dims.iter().map(|dim| format!("[0..{}]", dim.count - 1));
        let group: String = ranges.by_ref().take(self.group_dims).collect();
        let own: String = ranges.collect();
        let dot = if self.group.is_empty() { "" } else { "." };
        format!("{}{group}{dot}{}{own}", self.group, self.name)
    }
}

fn full_name(group: &str, name: &str) -> String {
    if group.is_empty() { name.to_owned() } else { format!("{group}.{name}") }
}

fn index_count(register: &Register, text: &str) -> LayoutError {
    let needs = if register.dims.is_empty() {
        "is not an array; leave out the index".to_owned()
    } else {
        format!("needs indices: {}", register.pattern())
    };
    LayoutError::IndexCount { name: text.to_owned(), needs }
}

fn unknown(block: &Block, path: &Path<'_>) -> LayoutError {
    let registers = || block.placed().flat_map(|placed| placed.structure.registers);
    if path.group.is_none() {
        let members: Vec<_> =
            registers().filter(|register| register.group == path.register.name).map(|r| r.name).collect();
        if !members.is_empty() {
            return LayoutError::NotARegister { name: path.text.to_owned(), registers: members.join(", ") };
        }
    }
    let wanted = full_name(path.group_name(), path.register.name);
    let names: BTreeSet<String> = registers().map(Register::full_name).collect();
    let hint = if names.is_empty() {
        ": it is plain RAM, use an address".to_owned()
    } else {
        did_you_mean(&wanted, names.iter().map(String::as_str))
    };
    LayoutError::UnknownRegister { area: block.area.name, name: wanted, hint }
}

#[cfg(test)]
mod tests;
