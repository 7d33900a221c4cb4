//! IEC 61131-3 declarations: the structures as types and the variables at their addresses; or, for compilers
//! that cannot place a structure, one elementary variable per register. Each type has a `TYPE` of its own, which
//! the standard allows and some compilers want.

use super::members::{self, Member};
use super::rows;
use super::scope::Scope;
use super::text;
use crate::layout::{Dim, RegisterRef};
use std::collections::BTreeSet;
use std::fmt::Write;

/// Types and variables with the manual's names.
pub(crate) fn generate(scope: &Scope) -> String {
    let structures = scope.structures();
    let mut arrays = BTreeSet::new();
    let (mut small, mut large) = (String::new(), String::new());
    for group in members::groups(&structures) {
        record(&mut small, &mut arrays, group.type_name(), &group.about(), &group.members());
    }
    for of in structures {
        record(&mut large, &mut arrays, of.name, &text::about(of), &members::of(of));
    }
    let declare = |of_records: bool| -> String {
        arrays.iter().filter(|array| array.of_records == of_records).map(Array::declaration).collect()
    };
    let mut out = head(scope, "st");
    // Whatever a type needs stands before it.
    out += &format!("{}{small}{}{large}VAR_GLOBAL\n", declare(false), declare(true));
    for (area, placed) in scope.placed() {
        let (variable, structure) = (placed.variable, placed.structure.name);
        let remark = text::made_up(placed).map(|made_up| format!(" (* {made_up} *)")).unwrap_or_default();
        let _ = writeln!(out, "    {variable} AT {} : {structure};{remark}", area.begin());
    }
    out.push_str("END_VAR\n");
    out
}

/// Elementary variables only.
pub(crate) fn elementary(scope: &Scope) -> String {
    let mut out = head(scope, "st --elementary");
    out.push_str("VAR_GLOBAL\n");
    let mut seen: BTreeSet<(String, u32)> = BTreeSet::new();
    for (_, found) in rows::all(scope) {
        let name = variable(&found);
        // Structures that overlay each other share some registers.
        if seen.insert((name.clone(), found.offset())) {
            let remark = text::remark(found.register);
            let _ = writeln!(out, "    {name} AT {} : {}; (* {remark} *)", found.address(), found.ty());
        }
    }
    out.push_str("END_VAR\n");
    out
}

fn head(scope: &Scope, format: &str) -> String {
    text::banner(scope, format).iter().map(|line| format!("(* {line} *)\n")).collect::<String>() + "\n"
}

/// An identifier for one register: `node2_a_DATA_PARAMETER_3_w_PAR_NR`. Two `_` in a row are not allowed.
fn variable(register: &RegisterRef) -> String {
    let name = register.name();
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("_")
}

/// A named array type. Compilers of the vendor's kind want one, and the manual names those of one dimension by a
/// pattern: `USINT_4_BMARRAY` (5.00005.03a p. 77), `BYTE_32_BMARRAY` (p. 213), `DINT_16_BMARRAY` (p. 249). Of arrays of
/// arrays the inner one sorts first.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Array {
    of_records: bool,
    dims: usize,
    element: &'static str,
    counts: Vec<u32>,
    /// The manual's name, if it does not follow the pattern.
    named: &'static str,
}

impl Array {
    fn name(&self) -> String {
        if !self.named.is_empty() {
            return self.named.to_owned();
        }
        let counts = self.counts.iter().map(|count| format!("_{count}")).collect::<String>();
        format!("{}{counts}_BMARRAY", self.element)
    }

    /// What is left when the first index is given, if that is an array.
    fn inner(&self) -> Option<Self> {
        let (_, rest) = self.counts.split_first()?;
        (!rest.is_empty()).then(|| Self {
            dims: rest.len(),
            counts: rest.to_vec(),
            named: "",
            ..self.clone()
        })
    }

    fn declaration(&self) -> String {
        let of = self.inner().map_or(self.element.to_owned(), |inner| inner.name());
        let last = self.counts.first().map_or(0, |count| count - 1);
        format!("TYPE\n    {} : ARRAY[0..{last}] OF {of};\nEND_TYPE\n\n", self.name())
    }
}

fn record(out: &mut String, arrays: &mut BTreeSet<Array>, name: &str, doc: &str, members: &[Member]) {
    let counts = |dims: &[Dim]| dims.iter().map(|dim| u32::from(dim.count)).collect::<Vec<_>>();
    let _ = writeln!(out, "TYPE\n    {name} : (* {doc} *)\n    STRUCT");
    for member in members {
        let (field, of_records, element, counts, named, remark) = match member {
            Member::Register(register) => {
                let remark = format!(" (* {} *)", text::remark(register));
                let counts = counts(members::own_dims(register));
                (register.name.to_owned(), false, register.ty.name(), counts, register.array_type, remark)
            }
            Member::Group(group) => {
                let counts = counts(group.dims());
                (group.member_name().to_owned(), true, group.type_name(), counts, "", String::new())
            }
            Member::Padding { offset, bytes } => {
                let counts = if *bytes == 1 { vec![] } else { vec![*bytes] };
                (format!("padding_{offset}"), false, "BYTE", counts, "", String::new())
            }
        };
        let ty = type_name(arrays, Array { of_records, dims: counts.len(), element, counts, named });
        let _ = writeln!(out, "        {field} : {ty};{remark}");
    }
    out.push_str("    END_STRUCT;\nEND_TYPE\n\n");
}

/// The name of the array's type, which is then declared, or of its element if it has no dimensions.
fn type_name(arrays: &mut BTreeSet<Array>, array: Array) -> String {
    if array.counts.is_empty() {
        return array.element.to_owned();
    }
    let name = array.name();
    let mut next = Some(array);
    while let Some(array) = next {
        next = array.inner();
        arrays.insert(array);
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;

    /// Identifiers do not distinguish upper and lower case and have no `__`.
    #[test]
    fn elementary_variables_have_names_of_their_own() {
        let text = elementary(&Scope::new(&DEVICE, None).unwrap());
        let mut names = BTreeSet::new();
        for line in text.lines().filter(|line| line.contains(" AT ")) {
            let name = line.split_whitespace().next().unwrap().to_lowercase();
            assert!(!name.contains("__") && !name.ends_with('_'), "{name}");
            assert!(names.insert(name), "{line}");
        }
        assert!(names.len() > 3000);
        assert!(text.contains("    node2_a_DATA_PARAMETER_3_w_PAR_NR AT %MW3.203104 : WORD; (* PLC: "));
    }
}
