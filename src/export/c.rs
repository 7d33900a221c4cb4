//! One C header, also for C++: header page, constants, structures with checks of every offset and size, and the
//! functions of `c/attach.h` and `c/tasks.h` to attach to an image and to act as its PLC.

use super::constants;
use super::members::{self, Member};
use super::names::UsedNames;
use super::scope::Scope;
use super::text;
#[cfg(feature = "cli")]
use crate::layout::DeviceLayout;
use crate::layout::{AreaStructure, RegType, format_value};
use crate::memory::HEADER_SIZE;
use crate::memory::contract::{self, Codes, FieldKind, HeaderStruct};
use crate::memory::header::{ABI_VERSION, MAGIC};
use std::collections::BTreeSet;
use std::fmt::Write;

const PROLOGUE: &str = include_str!("c/prologue.h");
const ATTACH: &str = include_str!("c/attach.h");
const TASKS: &str = include_str!("c/tasks.h");
const EPILOGUE: &str = include_str!("c/epilogue.h");

/// Words of C and C++, macros of their standard headers, and the types of registers. A register of a device folder or a
/// field of the header page can have such a name. A field in C cannot, and a field in C++ cannot have the name of a type
/// that its structure uses.
const KEYWORDS: &str = "alignas alignof and and_eq asm assert auto bitand bitor bool break case catch char char8_t char16_t \
    char32_t class co_await co_return co_yield compl concept const const_cast consteval constexpr constinit continue \
    decltype default delete do double dynamic_cast else enum EOF errno explicit export extern false float for friend goto if \
    inline int int8_t int16_t int32_t linux long mutable namespace new noexcept not not_eq nullptr NULL offsetof operator or or_eq private \
    protected public register reinterpret_cast requires restrict return short signed sizeof static static_assert \
    static_cast stderr stdin stdout struct switch template this thread_local throw true try typedef typeid typename typeof typeof_unqual \
    uint8_t uint16_t uint32_t union unix unsigned using virtual void volatile wchar_t while xor xor_eq";

/// Macros without arguments that the included headers of the system define (glibc 2.36, gcc 12), except [`FAMILIES`].
const MACROS: &str = include_str!("c/macros.txt");

/// Functions and types that these headers declare.
const NAMES: &str = include_str!("c/names.txt");

/// Beginnings of macros of which each version of the system has others.
const FAMILIES: [&str; 3] = ["SYS_", "FUTEX_", "__"];

pub(crate) fn generate(scope: &Scope) -> String {
    header(scope, "c", "")
}

/// Generates the header for export `format`. The names of structures begin with `prefix`.
pub(crate) fn header(scope: &Scope, format: &str, prefix: &str) -> String {
    let mut out = String::from("/*\n");
    for line in text::banner(scope, format) {
        let _ = writeln!(out, " * {line}");
    }
    out.push_str(" */\n");
    out.push_str(PROLOGUE);
    header_page(&mut out, scope);
    let mut macros = UsedNames::default();
    meanings(&mut out, &mut macros, scope);
    let structures = scope.structures();
    out.push_str("\n/* Registers. */\n");
    for group in members::groups(&structures) {
        let remark = group.about();
        structure(
            &mut out,
            prefix,
            group.type_name(),
            group.bytes(),
            &remark,
            &group.members(),
            group.offset(),
        );
    }
    for of in structures {
        let remark = text::about(of);
        structure(&mut out, prefix, of.name, of.bytes, &remark, &members::of(of), 0);
    }
    out.push_str(ATTACH);
    out.push_str(TASKS);
    places(&mut out, &mut macros, prefix, scope);
    out.push_str(EPILOGUE);
    out
}

/// Name of a constant of the header page, such as the code of a state.
fn code_name(of: &Codes, code: &str) -> String {
    format!("COMMRAM_{}_{}", text::snake(of.name), text::snake(code)).to_uppercase()
}

fn header_page(out: &mut String, scope: &Scope) {
    let numbers = [
        ("MAGIC", format!("UINT64_C(0x{MAGIC:016X})"), "\"commram\" and a zero"),
        ("ABI_VERSION", format!("{ABI_VERSION}u"), "of the attach contract"),
        ("LAYOUT_HASH", format!("UINT64_C(0x{:016X})", scope.device.layout_hash), "of these registers"),
        ("HEADER_SIZE", format!("{HEADER_SIZE}u"), "bytes of the header page"),
        ("SEGMENT_SIZE", format!("{}u", scope.device.segment_size()), "bytes of the image"),
    ];
    for (name, value, remark) in numbers {
        let _ = writeln!(out, "#define COMMRAM_{name} {value} /* {remark} */");
    }
    for of in &contract::CODES {
        out.push_str("\nenum {\n");
        for (value, code, doc) in of.codes {
            let _ = writeln!(out, "    {} = {value}, /* {} */", code_name(of, code), doc.trim());
        }
        out.push_str("};\n");
    }
    out.push_str("\n/* The header page: docs/reference/attach.md, byte by byte. */\n");
    for of in contract::structures() {
        header_struct(out, of);
    }
}

fn header_struct(out: &mut String, of: &HeaderStruct) {
    let name = format!("commram_{}", text::snake(of.name));
    let _ = writeln!(out, "\ntypedef struct {name} {{");
    for field in of.fields {
        let ty = match field.kind {
            FieldKind::Integer(bytes) => format!("COMMRAM_CELL(uint{}_t)", 8 * bytes),
            FieldKind::Struct(of) => format!("commram_{}", text::snake(of.name)),
        };
        let bounds = field.count.map(|count| format!("[{count}]")).unwrap_or_default();
        let meaning = field.meaning().filter(|meaning| !meaning.is_empty());
        let remark = meaning.map(|meaning| format!(" /* {meaning} */")).unwrap_or_default();
        let _ = writeln!(out, "    {ty} {}{bounds};{remark}", field_name(field.name));
    }
    let _ = writeln!(out, "}} {name};");
    for field in of.fields {
        assert_offset(out, &name, &field_name(field.name), field.offset as u32);
    }
    assert_size(out, &name, of.bytes as u32);
}

fn meanings(out: &mut String, macros: &mut UsedNames, scope: &Scope) {
    out.push_str("\n/* Values and bits, named after what they mean. */\n");
    for (meaning, register) in scope.meanings() {
        let constants = constants::of(meaning);
        if constants.is_empty() {
            continue;
        }
        let _ = writeln!(out, "\n/* {}, for example of {}. */", meaning.name, register.name);
        for constant in constants {
            let value = match constant.number(register.ty) {
                negative @ ..0 => format!("({negative})"),
                shift if constant.kind == constants::NumberKind::Shift => shift.to_string(),
                _ => hex(register.ty, constant.value),
            };
            let name = macros.add(free_name(&format!("COMMRAM_{}", constant.name)));
            let _ = writeln!(out, "#define {name} {value} /* {} */", constant.text);
        }
    }
}

/// Formats a bit pattern with all digits of the type.
fn hex(ty: RegType, value: u32) -> String {
    format!("{}u", format_value(ty, value).replace("16#", "0x"))
}

/// `start` is the base of the offsets of the registers.
fn structure(
    out: &mut String,
    prefix: &str,
    name: &str,
    bytes: u32,
    remark: &str,
    members: &[Member],
    start: u32,
) {
    let name = &free_name(&format!("{prefix}{name}"));
    let _ = writeln!(out, "\n/* {remark} */\ntypedef struct {name} {{");
    let mut asserts = String::new();
    let types = members.iter().filter_map(|member| match member {
        Member::Group(group) => Some(free_name(&format!("{prefix}{}", group.type_name()))),
        _ => None,
    });
    let mut fields = UsedNames::of(types);
    for member in members {
        let (declaration, field, offset) = match member {
            Member::Register(register) => {
                let dims = text::bounds(members::own_dims(register));
                let remark = text::remark(register);
                let (ty, name) = (c_type(register.ty), fields.add(field_name(register.name)));
                (format!("COMMRAM_CELL({ty}) {name}{dims}; /* {remark} */"), name, register.offset - start)
            }
            Member::Group(group) => {
                let dims = text::bounds(group.dims());
                let name = fields.add(field_name(group.member_name()));
                let of = free_name(&format!("{prefix}{}", group.type_name()));
                (format!("{of} {name}{dims};"), name, group.offset())
            }
            Member::Padding { offset, bytes } => {
                let field = members::padding_name(*offset, members);
                let _ = writeln!(out, "    uint8_t {field}[{bytes}];");
                continue;
            }
        };
        let _ = writeln!(out, "    {declaration}");
        assert_offset(&mut asserts, name, &field, offset);
    }
    let _ = writeln!(out, "}} {name};");
    out.push_str(&asserts);
    assert_size(out, name, bytes);
}

fn assert_offset(out: &mut String, name: &str, field: &str, offset: u32) {
    let _ = writeln!(
        out,
        "COMMRAM_ASSERT(offsetof({name}, {field}) == {offset}, \"{name}.{field} is not at {offset}\");"
    );
}

fn assert_size(out: &mut String, name: &str, bytes: u32) {
    let _ = writeln!(out, "COMMRAM_ASSERT(sizeof({name}) == {bytes}, \"{name} has not {bytes} bytes\");");
}

/// Returns the C expression for a register of the image `ram`. It consists of the function that returns the register's
/// structure, `(&ram)->`, and the register. `name` begins with the name of an area. Returns `None` if the device has no
/// such register.
#[cfg(feature = "cli")]
pub(crate) fn register_expression(device: &'static DeviceLayout, name: &str) -> Option<String> {
    let (area, register) = name.split_once('.')?;
    let area = device.area(area).ok()?;
    let bare = register.split('[').next()?;
    let has_it = |placed: &&AreaStructure| placed.structure.registers.iter().any(|it| it.name == bare);
    let placed = area.structures.iter().find(has_it)?;
    let index = register.strip_prefix(bare)?;
    let scope = Scope::new(device, None).ok()?;
    Some(format!("{}(&ram)->{}{index}", accessor(placed, &type_names(&scope, "")), field_name(bare)))
}

/// Returns the names of the types of a header. Functions cannot have these names.
fn type_names(scope: &Scope, prefix: &str) -> BTreeSet<String> {
    let structures = scope.structures();
    let groups = members::groups(&structures).into_iter().map(|group| group.type_name());
    let names = structures.iter().map(|of| of.name).chain(groups);
    names.map(|name| free_name(&format!("{prefix}{name}"))).collect()
}

/// Returns the name of the function that returns a structure in an image. `types` are the names of the types.
fn accessor(placed: &AreaStructure, types: &BTreeSet<String>) -> String {
    let mut name = free_name(&format!("commram{}", placed.variable));
    while types.contains(&name) {
        name.push('_');
    }
    name
}

/// Generates the offsets of the structures, and functions that return the structures of an image.
fn places(out: &mut String, macros: &mut UsedNames, prefix: &str, scope: &Scope) {
    let types = type_names(scope, prefix);
    out.push_str("\n/* The areas, their first bytes in an image, and the structures. */\n\n");
    for area in &scope.areas {
        let name = macros.add(free_name(&format!("COMMRAM_{}", constants::upper(area.name))));
        let _ = writeln!(out, "#define {name} {}u /* {} */", area.first, area.doc);
        let size = macros.add(free_name(&format!("{name}_BYTES")));
        let _ = writeln!(out, "#define {size} {}u", area.bytes);
    }
    for (area, placed) in scope.placed() {
        let doc = placed.structure.doc;
        let name = free_name(&format!("{prefix}{}", placed.structure.name));
        let phase = area.phase_facts(placed.live);
        let live = phase.map_or_else(String::new, |phase| format!(", {}", phase.doc));
        let _ = writeln!(
            out,
            "\n/* {doc}{live}. */\nstatic inline {name} *{}(const commram *ram)\n{{\n    \
             return ({name} *)(ram->base + {}u);\n}}",
            accessor(placed, &types),
            area.first
        );
    }
}

/// `uint16_t` for a WORD.
pub(crate) fn c_type(ty: RegType) -> &'static str {
    match ty {
        RegType::Byte | RegType::Usint => "uint8_t",
        RegType::Word | RegType::Uint => "uint16_t",
        RegType::Dword | RegType::Udint => "uint32_t",
        RegType::Sint => "int8_t",
        RegType::Int => "int16_t",
        RegType::Dint => "int32_t",
    }
}

/// True if `name` is `word` with any number of `_` appended. Such names get one `_` more, so that they stay different.
fn is_base(word: &str, name: &str) -> bool {
    name.strip_prefix(word).is_some_and(|rest| rest.bytes().all(|sign| sign == b'_'))
}

/// Returns the name of a field, with `_` appended if C or C++ has another use of it: a word of the language, or a macro.
fn field_name(name: &str) -> String {
    let is_word = |words: &str| words.split_whitespace().any(|word| is_base(word, name));
    let is_in_family = FAMILIES.iter().any(|family| name.starts_with(family));
    if is_in_family || is_word(KEYWORDS) || is_word(MACROS) { format!("{name}_") } else { name.to_owned() }
}

/// True if the headers of the system use this name: as a word of C or C++, a macro, a function or a type.
pub(crate) fn is_used_by_system(name: &str) -> bool {
    field_name(name) != name || NAMES.lines().any(|declared| declared == name)
}

/// Returns the name of a type, a function or a macro, with `_` appended if the name has another meaning in C, in C++ or
/// in the header itself.
fn free_name(name: &str) -> String {
    let is_used = [PROLOGUE, ATTACH, TASKS, EPILOGUE].iter().any(|text| {
        core::iter::successors(Some(name), |name| name.strip_suffix('_'))
            .any(|base| text::has_word(text, base))
    });
    let is_declared = NAMES.lines().any(|declared| is_base(declared, name));
    let mut codes =
        contract::CODES.iter().flat_map(|of| of.codes.iter().map(move |(_, code, _)| code_name(of, code)));
    if is_used || is_declared || codes.any(|code| is_base(&code, name)) {
        format!("{name}_")
    } else {
        field_name(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;

    fn header() -> String {
        generate(&Scope::new(&DEVICE, None).unwrap())
    }

    #[test]
    fn names_that_c_needs_itself_get_an_underscore() {
        assert_eq!(["int", "NULL", "w_INT", "xor_eq"].map(field_name), ["int_", "NULL_", "w_INT", "xor_eq_"]);
    }

    #[test]
    fn names_of_system_headers_get_an_underscore() {
        let fields = ["INT_MAX", "EINTR", "O_RDWR", "SYS_futex", "st_mtime", "read", "__linux__", "E_STATE"];
        let right =
            ["INT_MAX_", "EINTR_", "O_RDWR_", "SYS_futex_", "st_mtime_", "read", "__linux___", "E_STATE"];
        assert_eq!(fields.map(field_name), right);
        assert_eq!(["FILE", "read", "FILES"].map(free_name), ["FILE_", "read_", "FILES"]);
    }

    #[test]
    fn names_of_the_header_itself_get_an_underscore() {
        assert_eq!(
            ["COMMRAM_STATE_READY", "COMMRAM_STATE_FULL"].map(free_name),
            ["COMMRAM_STATE_READY_", "COMMRAM_STATE_FULL"]
        );
        let names = ["uint8_t", "commram", "commram_attach", "COMMRAM_LOAD", "commram_card", "CARD"];
        let free = ["uint8_t_", "commram_", "commram_attach_", "COMMRAM_LOAD_", "commram_card", "CARD"];
        assert_eq!(names.map(free_name), free);
    }

    #[test]
    fn every_member_of_every_structure_has_an_assertion() {
        let text = header();
        for structure in Scope::new(&DEVICE, None).unwrap().structures() {
            for register in structure.registers.iter().filter(|register| register.group.is_empty()) {
                let assertion = format!(
                    "COMMRAM_ASSERT(offsetof({}, {}) == {},",
                    structure.name, register.name, register.offset
                );
                assert!(text.contains(&assertion), "{assertion}");
            }
            assert!(
                text.contains(&format!("COMMRAM_ASSERT(sizeof({}) == {},", structure.name, structure.bytes))
            );
        }
        for field in crate::memory::Header::STRUCT.fields {
            let name = field_name(field.name);
            let assertion = format!("COMMRAM_ASSERT(offsetof(commram_header, {name}) == {},", field.offset);
            assert!(text.contains(&assertion), "{assertion}");
        }
    }

    #[test]
    fn comments_do_not_end_early() {
        for register in Scope::new(&DEVICE, None).unwrap().structures().iter().flat_map(|of| of.registers) {
            assert!(!register.doc.contains("*/"), "{}", register.name);
        }
        assert_eq!(header().matches("/*").count(), header().matches("*/").count());
    }
}
