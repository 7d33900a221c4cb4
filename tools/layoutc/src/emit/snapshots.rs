//! Plain copies of the structures, without cells.

use super::text::{doc, field_doc, field_type, snapshot_type};
use crate::model::Device;
use std::fmt::Write;

pub(crate) fn emit(out: &mut String, device: &Device) {
    out.push_str(
        "/// Plain copies of the structures, little-endian as in the RAM, for files, comparison and display.\n\
         pub mod snapshot {\n    #[allow(unused_imports, reason = \"not every width occurs\")]\n    use super::{U16, U32};\n\n",
    );
    if let Some(names) = super::shared_names(device) {
        let _ = writeln!(out, "    pub use {}::snapshot::{{{names}}};\n", super::family_module(device));
    }
    for structure in device.own_types() {
        let name = &structure.name;
        let _ = writeln!(
            out,
            "    /// A copy of [`{name}`](super::{name}).\n    \
             #[derive(\n        zerocopy::FromBytes, zerocopy::IntoBytes, zerocopy::KnownLayout, \
             zerocopy::Immutable, zerocopy::Unaligned,\n        Clone, Copy, Debug, PartialEq, Eq,\n    )]\n    \
             #[repr(C)]\n    pub struct {name} {{"
        );
        for field in &structure.fields {
            out.push_str(&doc("        ", &field_doc(device, field)));
            let ty = field_type(device, field, "u8", snapshot_type);
            let _ = writeln!(out, "        pub {}: {ty},", field.name);
        }
        let _ = writeln!(
            out,
            "    }}\n\n    const _: () = assert!(size_of::<{name}>() == {});\n",
            structure.size
        );
    }
    out.push_str("}\n");
}
