//! Structures in a form for languages with record types: registers, sub-structures, and padding between these.

use super::text;
use crate::layout::{Dim, Register, Structure};

/// A part of a structure or sub-structure.
#[derive(Debug)]
pub(crate) enum Member {
    /// A register or an array of registers.
    Register(&'static Register),
    /// A sub-structure or an array of them.
    Group(Group),
    /// Bytes without a register.
    Padding {
        /// Offset in bytes from the start of the enclosing structure.
        offset: u32,
        /// Number of bytes without a register.
        bytes: u32,
    },
}

/// A sub-structure with its registers.
#[derive(Debug)]
pub(crate) struct Group {
    /// Registers of the sub-structure. Their offsets count from the start of the whole structure.
    registers: &'static [Register],
    /// First register of the sub-structure.
    first: &'static Register,
}

impl Group {
    /// Returns the name of the member.
    pub(crate) const fn member_name(&self) -> &'static str {
        self.first.group
    }

    /// Returns the name of the type.
    pub(crate) const fn type_name(&self) -> &'static str {
        self.first.group_type
    }

    /// Description of the type: the origin of its name, and the inferred facts about its registers.
    pub(crate) fn about(&self) -> String {
        let name = text::source_of_type(self.first.group_type_from);
        let sources = text::sources(self.registers).map(|sources| format!(" {sources}")).unwrap_or_default();
        format!("Sub-structure {}.{name}{sources}", self.member_name())
    }

    /// Describes the registers of one element. Types of one name with other registers are different types.
    #[cfg(feature = "cli")]
    pub(crate) fn shape(&self) -> String {
        let register = |register: &'static Register| {
            let (name, offset) = (register.name, register.offset - self.offset());
            format!(" {name} {} {offset} {:?}", register.ty, own_dims(register))
        };
        format!("{}{}", self.bytes(), self.registers.iter().map(register).collect::<String>())
    }

    /// Returns the size of one element in bytes.
    pub(crate) const fn bytes(&self) -> u32 {
        self.first.group_bytes
    }

    /// Array bounds; empty if there is only one element.
    pub(crate) fn dims(&self) -> &'static [Dim] {
        self.first.dims.get(..self.first.group_dims).unwrap_or_default()
    }

    /// Returns the offset of the first element in the structure. The first register of a sub-structure begins with it.
    pub(crate) const fn offset(&self) -> u32 {
        self.first.offset
    }

    /// Returns the parts of one element.
    pub(crate) fn members(&self) -> Vec<Member> {
        members(self.registers, self.offset(), self.bytes(), Member::Register)
    }
}

/// Returns a name for the padding at this offset of a structure with these parts. No register has this name.
pub(crate) fn padding_name(offset: u32, members: &[Member]) -> String {
    let is_taken = |name: &str| {
        members.iter().any(|member| match member {
            Member::Register(register) => register.name.eq_ignore_ascii_case(name),
            Member::Group(group) => group.member_name().eq_ignore_ascii_case(name),
            Member::Padding { .. } => false,
        })
    };
    let plain = format!("padding_{offset}");
    let numbered = (2..).map(|number| format!("{plain}_{number}"));
    core::iter::once(plain.clone()).chain(numbered).find(|name| !is_taken(name)).unwrap_or(plain)
}

/// Array bounds of the register alone, without the bounds of its sub-structure.
pub(crate) fn own_dims(register: &'static Register) -> &'static [Dim] {
    register.dims.get(register.group_dims..).unwrap_or_default()
}

/// Returns the parts of a structure in ascending order, without gaps.
pub(crate) fn of(structure: &'static Structure) -> Vec<Member> {
    members(structure.registers, 0, structure.bytes, |register| {
        if register.group.is_empty() {
            return Member::Register(register);
        }
        let same = |other: &&Register| other.group == register.group;
        let start = structure.registers.iter().position(|other| same(&other)).unwrap_or_default();
        let rest = structure.registers.get(start..).unwrap_or_default();
        let count = rest.iter().take_while(same).count();
        Member::Group(Group { registers: rest.get(..count).unwrap_or_default(), first: register })
    })
}

/// Returns the sub-structure types of several structures, each once.
pub(crate) fn groups(structures: &[&'static Structure]) -> Vec<Group> {
    let mut found: Vec<Group> = Vec::new();
    for member in structures.iter().flat_map(|structure| of(structure)) {
        if let Member::Group(group) = member
            && !found.iter().any(|known| known.type_name() == group.type_name())
        {
            found.push(group);
        }
    }
    found
}

/// Converts registers that begin at `start` into parts that fill `bytes`; `part` converts the next register.
fn members(
    registers: &'static [Register],
    start: u32,
    bytes: u32,
    part: impl Fn(&'static Register) -> Member,
) -> Vec<Member> {
    let mut members = Vec::new();
    let mut end = 0;
    let pad = |members: &mut Vec<Member>, end: u32, next: u32| {
        if end < next {
            members.push(Member::Padding { offset: end, bytes: next - end });
        }
    };
    for register in registers {
        let offset = register.offset - start;
        // Skips the other registers of a sub-structure, because the sub-structure contains them.
        if offset < end {
            continue;
        }
        pad(&mut members, end, offset);
        let member = part(register);
        end = offset + size(&member);
        members.push(member);
    }
    pad(&mut members, end, bytes);
    members
}

fn size(member: &Member) -> u32 {
    let (element, dims) = match member {
        Member::Register(register) => (register.ty.width(), own_dims(register)),
        Member::Group(group) => (group.bytes(), group.dims()),
        Member::Padding { bytes, .. } => return *bytes,
    };
    dims.iter().fold(element, |bytes, dim| bytes * u32::from(dim.count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;

    fn end_of(members: &[Member], start: u32) -> u32 {
        members.iter().fold(0, |end, member| {
            let offset = match member {
                Member::Register(register) => register.offset - start,
                Member::Group(group) => group.offset() - start,
                Member::Padding { offset, .. } => *offset,
            };
            assert_eq!(offset, end, "{member:?}");
            end + size(member)
        })
    }

    #[test]
    fn members_fill_every_structure_without_a_gap() {
        for placed in DEVICE.areas.iter().flat_map(|area| area.structures) {
            let members = of(placed.structure);
            assert_eq!(end_of(&members, 0), placed.structure.bytes, "{}", placed.structure.name);
            for member in &members {
                if let Member::Group(group) = member {
                    assert_eq!(end_of(&group.members(), group.offset()), group.bytes());
                }
            }
        }
    }

    #[test]
    fn sub_structures_have_their_types() {
        let master = DEVICE.register("node2.a_WR_VALUE[0]").unwrap().structure();
        let names: Vec<_> =
            groups(&[master]).iter().map(|group| (group.member_name(), group.type_name())).collect();
        assert_eq!(
            names,
            [
                ("_CFG_WRC_WORD", "CFG_WRC_WORD_MA"),
                ("a_STATREG_RDC", "STATREG_RDC"),
                ("a_CFG_RDC_WORD", "CFG_RDC_WORD"),
                ("a_CTRLREG_PAR_CMD_SL", "CTRLREG_PAR_CMD_SL"),
                ("a_DATA_PARAMETER", "DATA_PARAMETER"),
            ]
        );
        let padding = of(master).iter().filter(|member| matches!(member, Member::Padding { .. })).count();
        assert_eq!(padding, 5);
    }
}
