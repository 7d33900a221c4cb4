//! Comma-separated values (RFC 4180): a head line, then one line for each register and each element of an array.

use super::rows;
use super::scope::Scope;
use crate::layout::{AreaStructure, Provenance, RegisterRef, format_value};
use std::borrow::Cow;

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
            provenance(&found),
            register.meaning.map_or("", |meaning| meaning.name).to_owned(),
            register.doc.to_owned(),
        ];
        text.push_str(&line(&cells));
    }
    text
}

/// Lists the inferred facts about a line, including the phase, and the names of area, structure and variable.
fn provenance(found: &RegisterRef) -> String {
    let AreaStructure { structure, variable_from, live, .. } = found.placed;
    let [name, offset, ty, owner, reset] = found.register.facts();
    let (area, structure) = (("area", found.area.name_from), ("structure", structure.name_from));
    let (live, variable) = (("live", found.area.phase_source(*live)), ("variable", *variable_from));
    Provenance::summary(&[area, name, offset, ty, owner, reset, structure, live, variable])
}

/// Joins cells to a line, with quotes where a cell needs them. A spreadsheet shows each text as it is, and does not
/// evaluate it as a formula (D-798).
pub fn line<S: AsRef<str>>(cells: &[S]) -> String {
    cells.iter().map(|text| cell(text.as_ref())).collect::<Vec<_>>().join(",") + "\n"
}

fn cell(text: &str) -> String {
    let text = without_formulas(text);
    if text.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.into_owned()
    }
}

/// Puts an apostrophe before each text that a spreadsheet evaluates as a formula. Spreadsheets of some countries
/// separate cells by semicolons. So the function treats the text after a semicolon, tab or line end like a separate
/// cell. Numbers stay numbers.
fn without_formulas(text: &str) -> Cow<'_, str> {
    let is_separator = |sign: char| matches!(sign, ';' | '\t' | '\r' | '\n');
    if is_number(text) || !text.split(is_separator).any(is_formula) {
        return Cow::Borrowed(text);
    }
    let parts = text.split_inclusive(is_separator);
    let safe = |part: &str| if is_formula(part) { format!("'{part}") } else { part.to_owned() };
    Cow::Owned(parts.map(safe).collect())
}

/// True if the text begins like a formula. In some languages, spreadsheets also accept the full-width forms of the
/// signs.
fn is_formula(text: &str) -> bool {
    let text = text.trim().trim_end_matches(';');
    let is_sign = |sign: char| matches!(sign, '=' | '+' | '-' | '@' | '＝' | '＋' | '－' | '＠');
    // A single sign is no formula: it marks an absent value.
    text.starts_with(is_sign) && text.chars().nth(1).is_some() && !is_number(text)
}

/// True for numbers with or without a fraction and an exponent: `-5`, `+0.25`, `-1.5e-3`.
fn is_number(text: &str) -> bool {
    let is_part = |sign: char| sign.is_ascii_digit() || matches!(sign, '+' | '-' | '.' | 'e' | 'E');
    text.chars().all(is_part) && text.parse::<f64>().is_ok()
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
    fn texts_are_no_formulas_and_numbers_stay_numbers() {
        for formula in ["=1+1", "+A1", "-A1", "@SUM(A1)", " =1", "-2+3", "--5", "＝1", "-5 rpm", "-inf", "=="]
        {
            assert_eq!(line(&[formula]), format!("'{formula}\n"));
        }
        assert_eq!(line(&["\t=1"]), "\t'=1\n");
        assert_eq!(line(&["\r=1"]), "\"\r'=1\"\n");
        assert_eq!(line(&["a;=1; -b;c"]), "a;'=1;' -b;c\n");
        assert_eq!(line(&["=HYPERLINK(\"x\",A2)"]), "\"'=HYPERLINK(\"\"x\"\",A2)\"\n");
        for plain in ["-5", "+0.25", "-1.5e-3", "-", "", "16#FF", "%MW3.0", "a-b", "a =b", "-5;-6"] {
            assert_eq!(line(&[plain]), format!("{plain}\n"));
        }
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
