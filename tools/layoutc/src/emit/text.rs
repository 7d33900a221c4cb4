//! Pieces of source text.

use crate::model::{Device, Field, FieldType, Provenance, Scalar};

/// Returns one documentation line per line of `text`, each with `indent` at its begin.
pub(crate) fn doc(indent: &str, text: &str) -> String {
    // Brackets in names such as `a_X[3]` must not be taken for links.
    text.lines().map(|line| format!("{indent}/// {}\n", escape(line))).collect()
}

fn escape(line: &str) -> String {
    line.replace('[', "\\[").replace(']', "\\]").replace('<', "\\<").replace('>', "\\>")
}

/// Returns a register's documentation: meaning, source, and origin of the offset.
pub(crate) fn field_doc(device: &Device, field: &Field) -> String {
    if field.is_padding() {
        return format!("Bytes without a register ({}).", provenance(&field.offset_from));
    }
    let reserved = if field.reserved { " Reserved." } else { "" };
    let used = match field.used.iter().zip(&field.dims).find(|(used, n)| used < n) {
        Some((used, _)) => format!(" Elements from number {used} on are reserved."),
        None => String::new(),
    };
    format!(
        "{}.{reserved}{used}\nOffset {} ({}); manual {} p. {}.",
        field.doc.trim_end_matches('.'),
        field.offset,
        provenance(&field.offset_from),
        device.manual,
        field.page,
    )
}

fn provenance(from: &Provenance) -> String {
    match from {
        Provenance::Manual => "from the manual".to_owned(),
        Provenance::Documented(document) => format!("from {document}"),
        Provenance::Inferred(decision) => format!("inferred, {decision}"),
    }
}

/// Returns the type of a field, with `scalar` naming the type of elementary registers.
pub(crate) fn field_type(
    device: &Device,
    field: &Field,
    byte: &str,
    scalar: fn(Scalar) -> &'static str,
) -> String {
    let element = match field.kind {
        FieldType::Scalar(kind) => scalar(kind).to_owned(),
        FieldType::Sub(index) => device.substructures[index].name.clone(),
        FieldType::Padding(bytes) => return format!("[{byte}; {bytes}]"),
    };
    field.dims.iter().rev().fold(element, |inner, n| format!("[{inner}; {n}]"))
}

pub(crate) fn cell_type(scalar: Scalar) -> &'static str {
    match scalar.width() {
        1 => "Cell8",
        2 => "Cell16",
        _ => "Cell32",
    }
}

pub(crate) fn snapshot_type(scalar: Scalar) -> &'static str {
    match scalar.width() {
        1 => "u8",
        2 => "U16",
        _ => "U32",
    }
}
