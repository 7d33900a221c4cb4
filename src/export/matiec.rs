//! C code for IEC 61131-3 programs that matiec has compiled. It binds their located variables to an image, in every
//! address space of the device. The C header comes first, then tables of the device, then the templates in `matiec/`.

use super::c;
use super::runner::{self, Compiler};
use super::scope::Scope;
use crate::layout::{Area, DeviceFit, Space, Unit};
use std::fmt::Write;

const RULES: &str = include_str!("matiec/rules.h");
const STORAGE: &str = include_str!("matiec/storage.h");
const GLUE: &str = include_str!("matiec/glue.h");
const ACCESS: &str = include_str!("matiec/access.h");
const NAMES: &str = include_str!("matiec/names.h");
const REFERENCES: &str = include_str!("matiec/references.h");
/// Functions through which blocks in Structured Text access the board.
const BLOCKS: &str = include_str!("matiec/blocks.h");
const MATIEC: Compiler =
    Compiler { name: "matiec", format: "matiec --main", head: include_str!("runner/matiec.c") };
/// Alignment of the storage of variables: a multiple of every page size, because the image is mapped over this storage
/// in whole pages.
const ALIGNMENT: usize = 0x10000;

pub(crate) fn generate(scope: &Scope) -> String {
    let mut out = header(scope, "matiec");
    out.push_str("\n#ifndef COMMRAM_MATIEC_H\n#define COMMRAM_MATIEC_H\n\n");
    out.push_str(&tables(scope));
    for part in [RULES, STORAGE, GLUE] {
        out.push_str(part);
    }
    let _ = write!(
        out,
        "#if defined(COMMRAM_MATIEC_ACCESS) || defined(COMMRAM_MATIEC_BY_NAME)\n{ACCESS}#endif\n\n\
         #ifdef COMMRAM_MATIEC_ACCESS\n{REFERENCES}{BLOCKS}#endif\n\n\
         #ifdef COMMRAM_MATIEC_BY_NAME\n{NAMES}#endif\n\n#endif\n"
    );
    out
}

/// Generates the C header. matiec declares types for these structures, too, with names in capitals. Some names in this
/// header differ from the names of matiec only in their case.
pub(crate) fn header(scope: &Scope, format: &str) -> String {
    c::header(scope, format, "commram_")
}

/// Returns the code that maps an image to the memory of located variables. It follows [`header`] and [`tables`].
pub(crate) fn storage() -> &'static str {
    STORAGE
}

/// Returns the code through which generated C code accesses located variables by name. It follows [`tables`] and
/// includes no system header.
pub(crate) fn by_name() -> String {
    format!("{RULES}{ACCESS}{NAMES}")
}

/// Returns the rules of located variables, for compilers that pass their addresses as numbers.
pub(crate) fn rules() -> &'static str {
    RULES
}

/// Generates macros that describe the device.
pub(crate) fn tables(scope: &Scope) -> String {
    let bytes = scope.device.segment_size().next_multiple_of(ALIGNMENT);
    let mut out = format!(
        "/* What located variables take in memory: whole pages, however large those are. */\n\
         #define COMMRAM_MATIEC_BYTES {bytes}u\n#define COMMRAM_NO_NUMBER 0xFFFFFFFFu\n\n"
    );
    let retain = scope.device.retain.filter(|_| scope.block.is_none()).map(|retain| &retain.area);
    for (name, what, area) in [("RETAIN", "retain flags", retain), ("FLAGS", "other flags", flags(scope))] {
        let bytes = area.map_or(0, |area| area.bytes);
        let _ = write!(
            out,
            "/* Bytes of {what}, as many as there can be. */\n#define COMMRAM_MATIEC_{name}_BYTES {bytes}u\n\n"
        );
    }
    let memory = program_memory(scope, retain);
    out.push_str(&bits(&memory));
    let spaces = || scope.device.spaces.iter().filter(|space| !scope.device.is_front(space.offset));
    out.push_str(
        "/* Whether the numbers of a located variable stand for a place of the device; other variables are the program's own. */\n\
         #define COMMRAM_IN_RAM(letter, is_bit, size, a, b) (0",
    );
    for space in spaces() {
        let _ = write!(out, " \\\n    || {}", is_meant(space));
    }
    // All `%M` addresses belong to the device, even those without memory: if variables of the program had such
    // addresses, they would not overlay each other (decision D-740).
    if spaces().any(|space| space.letter == 'M') {
        out.push_str(" \\\n    || (letter) == 'M'");
    }
    out.push_str(
        ")\n\n/* The byte of the image that it begins at; 0, which is in the header page, where there is none. */\n\
         #define COMMRAM_PLACE(letter, is_bit, size, a, b) (0u",
    );
    for space in spaces() {
        let (number, offset, first) = (number(space), space.offset, first_byte(space));
        let _ = write!(
            out,
            " \\\n    + ({} && {} ? (unsigned)({number} - {first}u) + {offset}u : 0u)",
            is_meant(space),
            is_inside(space)
        );
    }
    out.push_str(")\n\n/* Whether byte n of the image lies in an area. */\n#define COMMRAM_IN_AREA(n) (0");
    for Area { first, bytes, .. } in scope.areas.iter().copied().chain(retain) {
        let _ = write!(out, " \\\n    || ((n) >= {first}u && (n) < {}u)", first + bytes);
    }
    out.push_str(
        ")\n\n/* Widths in bytes, added up, of registers that byte n of the image belongs to; 0 where there is none. */\n",
    );
    out.push_str("#define COMMRAM_WIDTHS_AT(n) (0u");
    for (first, end, width) in widths(scope) {
        let _ = write!(out, " \\\n    + ((n) >= {first}u && (n) < {end}u ? {width}u : 0u)");
    }
    out.push_str(
        ")\n\n/* Whether a structure of so many bytes begins at byte n of the image. In memory of programs any array or structure can lie. */\n\
         #define COMMRAM_STRUCTURE_AT(n, bytes) (0",
    );
    for (area, placed) in scope.placed() {
        let _ = write!(out, " \\\n    || ((n) == {}u && (bytes) == {}u)", area.first, placed.structure.bytes);
    }
    for (first, end) in stretches(&memory) {
        let _ = write!(out, " \\\n    || ((bytes) > 8u && (n) >= {first}u && (n) + (bytes) <= {end}u)");
    }
    out.push_str(")\n\n");
    out
}

/// Flags that are not retained: memory without registers, with addresses that belong only to the device's program.
fn flags(scope: &Scope) -> Option<&'static Area> {
    scope.areas.iter().copied().find(|area| {
        let is_free = area.structures.is_empty() && !scope.device.is_retain(area.first);
        is_free && area.space.letter == 'M' && area.space.segment.is_empty()
    })
}

/// Returns the areas that are memory of programs, in this order: retain flags, other flags, all other areas.
fn program_memory(scope: &Scope, retain: Option<&'static Area>) -> Vec<&'static Area> {
    let mut memory: Vec<_> = retain.into_iter().chain(flags(scope)).collect();
    for area in scope.areas.iter().copied().filter(|area| is_programs(scope, area)) {
        if memory.iter().all(|known| known.first != area.first) {
            memory.push(area);
        }
    }
    memory
}

/// Returns the ranges of bytes that the areas cover, each as first byte and end. Adjacent areas form one range.
fn stretches(areas: &[&Area]) -> Vec<(u32, u32)> {
    let mut areas: Vec<_> = areas.iter().map(|area| (area.first, area.first + area.bytes)).collect();
    areas.sort_unstable();
    areas.dedup_by(|(first, end), (_, last)| {
        let follows = first == last;
        if follows {
            *last = *end;
        }
        follows
    });
    areas
}

/// True if programs access the area by bits and by any width, so that registers only name parts of the area. This is so
/// for inputs, for outputs, and for flags that are neither the retain flags nor the other flags (D-772).
fn is_programs(scope: &Scope, area: &Area) -> bool {
    let space = area.space;
    let has = |other: Option<&Area>| other.is_some_and(|other| other.space.offset == space.offset);
    let retain = scope.device.retain.map(|retain| &retain.area);
    space.segment.is_empty() && (matches!(space.letter, 'I' | 'Q') || has(retain) || has(flags(scope)))
}

/// Generates two C functions. The first converts an offset in the image to the number of a flag bit, the second
/// converts such a number to the offset of the byte. The numbers continue from one of the `areas` of flags to the next.
fn bits(areas: &[&Area]) -> String {
    let (mut bit, mut byte, mut bytes) = (String::new(), "0u".to_owned(), 0);
    for area in areas {
        let (first, end, unit) = (area.first, area.first + area.bytes, 8 * area.space.unit.width().bytes());
        let _ = write!(
            bit,
            "(n) >= {first}u && (n) < {end}u && (bit) < {unit}u ? ((n) - {first}u + {bytes}u) * 8u + (bit) \\\n    : "
        );
        byte = match bytes {
            0 => format!("{first}u + (n)"),
            _ => format!("(n) < {bytes}u ? {byte} : {first}u + (n) - {bytes}u"),
        };
        bytes += area.bytes;
    }
    format!(
        "/* The number of a bit among those of all flags, if byte n of the image is a flag; and the byte of the image that flag n is. */\n\
         #define COMMRAM_FLAG_BIT(n, bit) ({bit}COMMRAM_NO_NUMBER)\n#define COMMRAM_FLAG_BYTE(n) ({byte})\n\
         #define COMMRAM_FLAG_BITS {}u\n\n",
        8 * bytes.max(1)
    )
}

/// Returns the C program that runs a program compiled by matiec with the glue code.
pub(crate) fn main(scope: &Scope) -> String {
    runner::generate(scope, &MATIEC)
}

/// Returns a C expression. It is true if an address with the numbers `a` and `b` belongs to this space. The number of
/// the segment decides; in a space without a segment, the number itself decides.
fn is_meant(space: &Space) -> String {
    let letter = space.letter;
    match space.segment.trim_end_matches('.') {
        "" => {
            let inside = is_inside(space);
            format!("((letter) == '{letter}' && ((is_bit) || COMMRAM_IS_NO_LEVEL(b)) && {inside})")
        }
        segment => format!("((letter) == '{letter}' && (a) == {segment}u && (b) != COMMRAM_NO_NUMBER)"),
    }
}

/// Returns a C expression. It is true if the number is in the range of the space.
fn is_inside(space: &Space) -> String {
    let (number, first) = (number(space), first_byte(space));
    let end = u64::from(first) + u64::from(space.bytes);
    let is_behind = if first == 0 { String::new() } else { format!("{number} >= {first}u && ") };
    format!("({is_behind}{number} < UINT64_C({end}))")
}

/// Returns a C expression for the first byte of the addressed unit, counted from the byte with number 0 of the space.
/// For the address of a bit, it is the first byte of the unit that contains the bit.
fn number(space: &Space) -> String {
    let number = if space.segment.is_empty() { "(a)" } else { "(b)" };
    match space.unit {
        Unit::Byte => format!("(uint64_t){number}"),
        Unit::Word => format!("(uint64_t){number} * ((is_bit) ? {}u : (size))", space.unit.width().bytes()),
    }
}

/// Returns the first byte of the space, counted as in [`number`].
fn first_byte(space: &Space) -> u32 {
    space.first * space.unit.width().bytes()
}

/// Returns ranges of bytes in which registers have the same widths, as first byte, end, and the sum of the widths. The
/// widths are powers of two, so the sum shows which widths occur. In overlaid structures the used registers have the
/// same widths, unless a module decides which structure the area has.
fn widths(scope: &Scope) -> Vec<(u32, u32, u32)> {
    let mut stretches: Vec<(u32, u32, u32)> = Vec::new();
    for area in scope.areas.iter().filter(|area| !is_programs(scope, area)) {
        let mut bytes = vec![0; area.bytes as usize];
        for found in DeviceFit::unknown(scope.device).used_registers(area) {
            let first = found.offset_in_structure() as usize;
            let width = found.width();
            bytes.iter_mut().skip(first).take(width as usize).for_each(|byte| *byte |= width);
        }
        for (offset, width) in (area.first..).zip(bytes).filter(|(_, width)| *width > 0) {
            match stretches.last_mut() {
                Some((_, end, last)) if *end == offset && *last == width => *end += 1,
                _ => stretches.push((offset, offset + 1, width)),
            }
        }
    }
    stretches
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::{NODES as DEVICE, SLOTS};
    use crate::layout::samples::WORDS;

    #[test]
    fn widths_are_those_of_the_registers() {
        let scope = Scope::new(&DEVICE, None).unwrap();
        let widths = widths(&scope);
        let at = |n| widths.iter().find(|(first, end, _)| (*first..*end).contains(&n)).map(|found| found.2);
        assert_eq!([at(200_000), at(200_012), at(200_052), at(202_893)], [Some(2), Some(1), Some(4), None]);
        assert!(widths.iter().all(|(first, _, width)| first % width == 0));
        // A master's and a slave's module have registers of different widths at the same place.
        let modules = self::widths(&Scope::new(&SLOTS, None).unwrap());
        assert!(modules.iter().any(|(_, _, widths)| *widths == 1 | 4), "{modules:?}");
    }

    /// The glue code does not contain `>= 0u`: this comparison is always true, and a compiler may warn of it.
    #[test]
    fn nothing_is_compared_with_0() {
        for device in [&DEVICE, &WORDS] {
            let text = generate(&Scope::new(device, None).unwrap());
            assert!(text.contains("#define COMMRAM_PLACE(") && !text.contains(">= 0u"), "{device:?}");
        }
    }
}
