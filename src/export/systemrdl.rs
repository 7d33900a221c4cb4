//! SystemRDL 2.0, the register description for hardware tools and PeakRDL. Addresses are byte offsets in the image.

use super::constants;
use super::members::{self, Group, Member};
use super::names::UsedNames;
use super::rows;
use super::scope::Scope;
use super::text;
use crate::layout::{Area, AreaStructure, BitField, Meaning, Owner, Register, Role, ValueMeaning};
use crate::plain_text::is_interpreted;
use std::collections::HashMap;
use std::fmt::Write;

/// Words that SystemRDL 2.0 uses or reserves (section 4.4). With a backslash in front, such a word is a name (section
/// 4.3).
const KEYWORDS: &str = "abstract accesstype addressingtype addrmap alias all alternate bit boolean bothedge byte compact component \
    componentwidth constraint default encode enum external false field fullalign hw inside int internal level longint mem na \
    negedge nonsticky number onreadtype onwritetype posedge precedencetype property r rclr real ref reg regalign regfile rset \
    ruser rw rw1 shortint shortreal signal signed string struct sw this true type unsigned w w1 wclr within with woclr woset \
    wot wr wset wuser wzc wzs wzt";

/// Returns a name in SystemRDL.
fn identifier(name: &str) -> String {
    if KEYWORDS.split_whitespace().any(|word| word == name) { format!("\\{name}") } else { name.to_owned() }
}

/// Returns a text as a string of SystemRDL.
fn quoted(text: &str) -> String {
    let escaped = without_code(text).replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{escaped}\"")
}

/// Changes the parts of a text that a compiler executes, or that a viewer of descriptions treats as markup (D-798):
///
/// - `<%` begins Perl, a backquote begins a macro, also in comments and strings (SystemRDL 2.0, section 16). Neither of them has an
///   escape. So a blank follows `<`, and an apostrophe replaces the backquote.
/// - Descriptions may contain tags in brackets (annex F). `[lb]` is the tag of the bracket. `PeakRDL` also accepts HTML and the
///   links of Markdown.
fn without_code(text: &str) -> String {
    let mut out = String::new();
    let mut signs = text.chars().peekable();
    while let Some(sign) = signs.next() {
        let next = signs.peek().copied().unwrap_or(' ');
        match sign {
            '<' if next.is_ascii_alphabetic() || matches!(next, '%' | '/' | '!' | '?') => out.push_str("< "),
            '[' if next.is_ascii_alphabetic() || matches!(next, '/' | '*') => out.push_str("[lb]"),
            ']' if matches!(next, '(' | ':') => out.push_str("] "),
            '`' => out.push('\''),
            _ if is_interpreted(sign) => out.push(' '),
            _ => out.push(sign),
        }
    }
    out
}

pub(crate) fn generate(scope: &Scope) -> String {
    let mut out: String =
        text::banner(scope, "systemrdl").iter().map(|line| format!("// {}\n", without_code(line))).collect();
    // Types share one space of names.
    let groups = members::groups(&scope.structures());
    let names = scope.structures().into_iter().map(|of| of.name).chain(groups.iter().map(Group::type_name));
    let mut types = UsedNames::of(names.map(str::to_owned));
    let mut enumerations = Enumerations::default();
    for (meaning, register) in scope.meanings() {
        enumerations.generate(&mut out, &mut types, meaning, 8 * register.ty.width());
    }
    for group in &groups {
        self::group(&mut out, &enumerations, group);
    }
    for of in scope.structures() {
        let _ =
            writeln!(out, "\nregfile {} {{\n    desc = {};", identifier(of.name), quoted(&text::about(of)));
        for member in members::of(of) {
            match member {
                Member::Register(of) => register(&mut out, &enumerations, of, 0),
                Member::Group(of) => {
                    let (ty, name, offset) =
                        (identifier(of.type_name()), identifier(of.member_name()), of.offset());
                    let _ = writeln!(out, "    {ty} {name}{} @ 0x{offset:X};", text::bounds(of.dims()));
                }
                Member::Padding { .. } => {}
            }
        }
        out.push_str("};\n");
    }
    maps(&mut out, types, scope);
    out
}

/// Writes separate maps for overlaid structures: for each phase, and for each possible role of a port if the structures
/// depend on the role.
fn maps(out: &mut String, mut types: UsedNames, scope: &Scope) {
    let mut roles = Vec::new();
    for role in scope.placed().filter_map(|(_, placed)| placed.role) {
        if !roles.contains(&Some(role)) {
            roles.push(Some(role));
        }
    }
    if roles.is_empty() {
        roles.push(None);
    }
    let declared = scope.areas.iter().find_map(|area| area.phases).map_or(&[][..], |phases| phases.phases);
    let mut phases: Vec<_> = declared.iter().map(|phase| Some(phase.name)).collect();
    if phases.is_empty() {
        phases.push(None);
    }
    for phase in phases {
        for role in &roles {
            map(out, &mut types, scope, phase, *role);
        }
    }
}

fn map(out: &mut String, types: &mut UsedNames, scope: &Scope, phase: Option<&str>, role: Option<Role>) {
    let (mut name, mut of) = (scope.device.name.replace('-', "_"), String::new());
    if let Some(phase) = phase {
        let _ = write!(name, "_{phase}");
        let _ = write!(of, ", {phase} structures");
    }
    if let Some(role) = role {
        let _ = write!(name, "_{role}");
        let _ = write!(of, " of every {role}");
    }
    if types.contains(&name) {
        name.push_str("_map");
    }
    let name = identifier(&types.add(name));
    let desc = quoted(&format!("Image of the {}{of}", scope.device.title));
    let _ = writeln!(
        out,
        "\naddrmap {name} {{\n    desc = {desc};\n    littleendian;\n    addressing = compact;"
    );
    let mut instances = UsedNames::default();
    for (area, placed) in scope.placed() {
        let AreaStructure { structure, variable, .. } = placed;
        let is_fitted = placed.role.is_none() || placed.role == role;
        if is_fitted && [phase, Some("always")].contains(&Some(rows::live(area, placed))) {
            let _ = writeln!(
                out,
                "    {} {} @ {};",
                identifier(structure.name),
                identifier(&instances.add(*variable)),
                area.first
            );
        }
    }
    for area in scope.areas.iter().filter(|area| area.structures.is_empty()) {
        plain(out, area, &instances.add(area.name));
    }
    out.push_str("};\n");
}

/// Writes an area without registers.
fn plain(out: &mut String, area: &Area, name: &str) {
    let Area { first, bytes, doc, .. } = area;
    let name = identifier(name);
    let (entries, desc) = (bytes / 4, quoted(doc));
    let _ = writeln!(
        out,
        "    external mem {{ desc = {desc}; mementries = {entries}; memwidth = 32; sw = rw; }} {name} @ {first};"
    );
}

fn group(out: &mut String, enumerations: &Enumerations, group: &Group) {
    let _ = writeln!(
        out,
        "\nregfile {} {{\n    desc = {};",
        identifier(group.type_name()),
        quoted(&group.about())
    );
    for member in group.members() {
        if let Member::Register(of) = member {
            register(out, enumerations, of, group.offset());
        }
    }
    out.push_str("};\n");
}

/// Writes a register. `start` is the base of the offset.
fn register(out: &mut String, enumerations: &Enumerations, of: &'static Register, start: u32) {
    let Register { name, ty, offset, meaning, reset, .. } = of;
    let bits = 8 * ty.width();
    let desc = quoted(&format!("{ty}, {}", text::remark(of)));
    let _ = writeln!(out, "    reg {{\n        desc = {desc};\n        regwidth = {bits};");
    let access = match of.owner {
        Owner::Plc => "sw = rw; hw = r;",
        Owner::Firmware => "sw = r; hw = w;",
        Owner::Both => "sw = rw; hw = rw;",
    };
    match meaning {
        Some(meaning) if !meaning.bits.is_empty() => {
            for (field, name) in constants::fields(meaning) {
                let BitField { first, last, .. } = field;
                let encode = enumerations.encode(meaning, Some(field));
                let (desc, name) = (quoted(&constants::about(field)), field_name(&name));
                let (width, reset) = (last - first + 1, field.of(*reset));
                let _ = writeln!(
                    out,
                    "        field {{ desc = {desc}; {access}{encode} }} {name}[{last}:{first}] = {width}'h{reset:X};"
                );
            }
        }
        _ => {
            let encode = meaning.map_or(String::new(), |meaning| enumerations.encode(meaning, None));
            let last = bits - 1;
            let _ =
                writeln!(out, "        field {{ {access}{encode} }} value[{last}:0] = {bits}'h{reset:X};");
        }
    }
    let array = text::bounds(members::own_dims(of));
    let name = identifier(name);
    let _ = writeln!(out, "    }} {name}{array} @ 0x{:X};", offset - start);
}

/// Returns the name of a field with the prefix `f_`, for example `f_enable`, because some names of bits are reserved
/// words.
fn field_name(name: &str) -> String {
    format!("f_{}", name.to_lowercase())
}

/// Names of enumerations, by the meaning and the first bit of the field, or by the meaning alone.
#[derive(Default)]
struct Enumerations(HashMap<(&'static str, Option<u8>), String>);

impl Enumerations {
    /// Generates the enumerations for the values of a meaning, or of its fields. `types` are the names of other types.
    fn generate(&mut self, out: &mut String, types: &mut UsedNames, meaning: &'static Meaning, bits: u32) {
        if meaning.bits.is_empty() {
            self.add(out, types, (meaning.name, None), format!("e_{}", meaning.name), (meaning.values, bits));
        }
        for (field, name) in constants::fields(meaning) {
            let name = format!("e_{}_{}", meaning.name, name.to_lowercase());
            let width = u32::from(field.last - field.first) + 1;
            self.add(out, types, (meaning.name, Some(field.first)), name, (field.values, width));
        }
    }

    fn add(
        &mut self,
        out: &mut String,
        types: &mut UsedNames,
        key: (&'static str, Option<u8>),
        name: String,
        (values, bits): (&[ValueMeaning], u32),
    ) {
        if !constants::singles(values).is_empty() {
            let name = types.add(name);
            enumeration(out, &name, values, bits);
            self.0.insert(key, name);
        }
    }

    /// Returns the property that gives a field its enumeration, if it has one.
    fn encode(&self, meaning: &Meaning, field: Option<&BitField>) -> String {
        let name = self.0.get(&(meaning.name, field.map(|field| field.first)));
        name.map_or(String::new(), |name| format!(" encode = {name};"))
    }
}

fn enumeration(out: &mut String, name: &str, values: &[ValueMeaning], bits: u32) {
    let _ = writeln!(out, "\nenum {name} {{");
    for constant in constants::singles(values) {
        let (name, value, doc) = (constant.name, constant.value, quoted(&constant.text));
        let _ = writeln!(out, "    {name} = {bits}'h{value:X} {{ desc = {doc}; }};");
    }
    out.push_str("};\n");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_contain_no_code() {
        assert_eq!(quoted("a < b, c <= d, e[0..3]\u{2028}\u{e4}"), "\"a < b, c <= d, e[0..3] \u{e4}\"");
        assert_eq!(quoted("\"a\"\\\n"), "\"\\\"a\\\"\\\\ \"");
        for (text, safe) in [
            ("<%=6*7%> <<%", "< %=6*7%> << %"),
            ("`include `id`", "'include 'id'"),
            ("<script> </script> <!-- <?", "< script> < /script> < !-- < ?"),
            ("[url=x]y[/url] [*]", "[lb]url=x]y[lb]/url] [lb]*]"),
            ("![x](y) [x][y] [x]: y", "![lb]x] (y) [lb]x][lb]y] [lb]x] : y"),
        ] {
            assert_eq!(without_code(text), safe);
        }
    }
}
