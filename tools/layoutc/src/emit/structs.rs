//! Typed views: structs of register cells.

use super::text::{cell_type, doc, field_doc, field_type};
use crate::model::{Device, Field, FieldType, Structure};
use std::fmt::Write;

pub(crate) fn emit(out: &mut String, device: &Device) {
    let unused = "#[allow(unused_imports, reason = \"not every width occurs\")]\n";
    let _ = writeln!(
        out,
        "{unused}use commram::memory::cell::{{Cell8, Cell16, Cell32, SharedRegs}};\n\
         {unused}use zerocopy::little_endian::{{U16, U32}};\n"
    );
    if let Some(names) = super::shared_names(device) {
        let _ = writeln!(out, "pub use {}::{{{names}}};\n", super::family_module(device));
    }
    for structure in device.own_types() {
        emit_struct(out, device, structure);
        emit_methods(out, structure);
        if let Some(view) = structure.view {
            emit_view(out, device, structure, &device.structures[view]);
        }
    }
}

/// Writes the conversion to the family's structure, and the proof that the layouts agree.
fn emit_view(out: &mut String, device: &Device, structure: &Structure, view: &Structure) {
    let (name, as_name) = (&structure.name, &view.name);
    let family = super::family_module(device);
    let _ = writeln!(
        out,
        "const _: () = {{\n    use {family}::{as_name} as View;\n    \
         const fn alike<T, A, B>(_: fn(&A) -> &T, _: fn(&B) -> &T) {{}}"
    );
    for field in structure.fields.iter().filter(|field| !field.is_padding()) {
        let (own, theirs) = (&field.name, &field.view_name);
        let _ = writeln!(
            out,
            "    assert!(core::mem::offset_of!({name}, {own}) == core::mem::offset_of!(View, {theirs}));\n    \
             alike(|own: &{name}| &own.{own}, |view: &View| &view.{theirs});"
        );
    }
    let _ = writeln!(
        out,
        "    assert!(size_of::<{name}>() == size_of::<View>() && align_of::<{name}>() == align_of::<View>());\n}};\n\n\
         impl AsRef<{family}::{as_name}> for {name} {{\n    \
         fn as_ref(&self) -> &{family}::{as_name} {{\n        \
         // SAFETY: both are cells only, of one size and alignment, and any bits are valid in a cell; that all registers\n        \
         // lie alike is asserted above.\n        \
         unsafe {{ &*core::ptr::from_ref(self).cast() }}\n    }}\n}}\n"
    );
}

fn emit_struct(out: &mut String, device: &Device, structure: &Structure) {
    let name = &structure.name;
    out.push_str(&doc("", &format!("{} (manual {} p. {}).", structure.doc, device.manual, structure.page)));
    out.push_str("#[derive(zerocopy::FromBytes, zerocopy::IntoBytes, zerocopy::KnownLayout)]\n#[repr(C)]\n");
    let _ = writeln!(out, "pub struct {name} {{");
    for field in &structure.fields {
        out.push_str(&doc("    ", &field_doc(device, field)));
        let _ = writeln!(out, "    pub {}: {},", field.name, field_type(device, field, "Cell8", cell_type));
    }
    out.push_str("}\n\n");
    let _ = writeln!(
        out,
        "// SAFETY: every field is a cell or made of cells, any bits are valid in a cell, and the offsets\n\
         // asserted below leave no room for padding.\n\
         unsafe impl SharedRegs for {name} {{}}\n"
    );
    let _ = writeln!(out, "const _: () = {{\n    const fn all_cells<T: SharedRegs>() {{}}");
    for field in &structure.fields {
        let _ = writeln!(out, "    all_cells::<{}>();", field_type(device, field, "Cell8", cell_type));
        let _ =
            writeln!(out, "    assert!(core::mem::offset_of!({name}, {}) == {});", field.name, field.offset);
    }
    let _ = writeln!(out, "    assert!(size_of::<{name}>() == {});\n}};\n", structure.size);
}

fn emit_methods(out: &mut String, structure: &Structure) {
    let name = &structure.name;
    let _ = writeln!(
        out,
        "impl {name} {{\n    \
         /// Copies the registers out, one by one at their width. Registers that change in the meantime\n    \
         /// may be old or new.\n    \
         pub fn snapshot(&self) -> snapshot::{name} {{\n        snapshot::{name} {{"
    );
    for field in &structure.fields {
        let place = format!("self.{}", field.name);
        let _ = writeln!(out, "            {}: {},", field.name, load(field, &place, field.dims.len()));
    }
    let _ = writeln!(
        out,
        "        }}\n    }}\n\n    \
         /// Writes the reset value into every register from offset `first` on, in ascending order;\n    \
         /// `reset_from(0)` is the state after power-on.\n    \
         pub fn reset_from(&self, first: usize) {{"
    );
    for field in &structure.fields {
        let _ = writeln!(
            out,
            "        if core::mem::offset_of!({name}, {}) >= first {{ {} }}",
            field.name,
            store(field)
        );
    }
    out.push_str("    }\n}\n\n");
}

/// Returns the expression that copies `place`, an array of `dims` dimensions.
fn load(field: &Field, place: &str, dims: usize) -> String {
    if let FieldType::Padding(_) = field.kind {
        return format!("core::array::from_fn(|i| {place}[i].load())");
    }
    match dims {
        0 => match field.kind {
            FieldType::Sub(_) => format!("{place}.snapshot()"),
            FieldType::Scalar(scalar) if scalar.width() > 1 => format!("{place}.load().into()"),
            _ => format!("{place}.load()"),
        },
        n => {
            let index = ["i", "j"][field.dims.len() - n];
            format!("core::array::from_fn(|{index}| {})", load(field, &format!("{place}[{index}]"), n - 1))
        }
    }
}

/// Returns the statement that writes the reset value into all elements.
fn store(field: &Field) -> String {
    let place = format!("self.{}", field.name);
    if let FieldType::Padding(_) = field.kind {
        return format!("for cell in &{place} {{ cell.store(0); }}");
    }
    let one = |place: &str| match field.kind {
        FieldType::Sub(_) => format!("{place}.reset_from(0);"),
        _ => format!("{place}.store({});", field.reset),
    };
    match field.dims.len() {
        0 => one(&place),
        1 => format!("for cell in &{place} {{ {} }}", one("cell")),
        _ => format!("for cell in {place}.as_flattened() {{ {} }}", one("cell")),
    }
}
