//! Access to an image for programs of OpenPLC. It consists of a header and the hardware layer. Half of the header is
//! for OpenPLC's library, the other half for the hardware layer. OpenPLC compiles the output of matiec as C++11 and
//! defines every located variable itself, so the variables are bound by their names.

use super::matiec;
use super::scope::Scope;
use super::text;

const LAYER: &str = include_str!("openplc/hardware_layer.cpp");

pub(crate) fn generate(scope: &Scope) -> String {
    let tables = matiec::tables(scope);
    let (header, storage, by_name) = (matiec::header(scope, FORMAT), matiec::storage(), matiec::by_name());
    format!(
        "#ifndef COMMRAM_OPENPLC_H\n#define COMMRAM_OPENPLC_H\n\n\
         #ifdef COMMRAM_OPENPLC_LAYER\n{header}\n{tables}{storage}\n#else\n\
         /* The end of iec_std_lib.h includes this half: docs/guide/plc-programs.md. */\n{tables}{by_name}\
         /* OpenPLC's glueVars.cpp has a variable for each located one, and does not know the program's types. */\n\
         #include \"../POUS.h\"\n#endif\n\n#endif\n"
    )
}

const FORMAT: &str = "openplc";

/// Returns the hardware layer.
pub(crate) fn hardware_layer(scope: &Scope) -> String {
    text::template(scope, "openplc --main", LAYER)
}
