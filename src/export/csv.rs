//! Comma-separated values (RFC 4180): a head line, then one line for each register and each element of an array.

use super::rows;
use super::scope::Scope;
use crate::layout::{AreaStructure, Provenance, Register, format_value};

const HEAD: [&str; 15] = [
    "name",
    "address",
    "cpu_address",
    "type",
    "owner",
    "reset",
    "reserved",
    "structure",
    "offset",
    "live",
    "variable",
    "page",
    "provenance",
    "meaning",
    "doc",
];

pub(crate) fn generate(scope: &Scope) -> String {
    let mut text = line(&HEAD);
    for (placed, found) in rows::all(scope) {
        let register = found.register;
        let cells = [
            found.name(),
            found.address().to_string(),
            found.area.cpu_address(found.offset()),
            register.ty.to_string(),
            register.owner.to_string(),
            format_value(register.ty, register.reset),
            found.is_reserved().to_string(),
            placed.structure.name.to_owned(),
            found.offset_in_structure().to_string(),
            rows::live(found.area, placed).to_owned(),
            format!("{}.{}", placed.variable, found.path()),
            register.page.to_owned(),
            provenance(placed, register),
            register.meaning.map_or("", |meaning| meaning.name).to_owned(),
            register.doc.to_owned(),
        ];
        text.push_str(&line(&cells));
    }
    text
}

/// Lists the inferred facts about a line, including the name of the variable.
fn provenance(placed: &AreaStructure, register: &Register) -> String {
    let [name, offset, ty, owner, reset] = register.facts();
    Provenance::summary(&[name, offset, ty, owner, reset, ("variable", placed.variable_from)])
}

/// Joins cells to a line, with quotes where a cell needs them.
pub fn line<S: AsRef<str>>(cells: &[S]) -> String {
    cells.iter().map(|text| cell(text.as_ref())).collect::<Vec<_>>().join(",") + "\n"
}

fn cell(text: &str) -> String {
    if text.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;

    #[test]
    fn cells_are_quoted_where_they_need_it() {
        assert_eq!(line(&["a,b", "say \"x\"", "plain", ""]), "\"a,b\",\"say \"\"x\"\"\",plain,\n");
    }

    #[test]
    fn every_register_has_a_line_with_all_cells() {
        let text = generate(&Scope::new(&DEVICE, Some("ethernet_config")).unwrap());
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 1 + 10);
        assert!(lines[1].starts_with("ethernet_config.d_IP_CONFIG,%MD3.180016,16#B0000010,DWORD,PLC,"));
        assert!(lines[2].contains(",_Ethernet_config.a_IP_ADDRESS[0],"), "{}", lines[2]);
    }
}
