//! The program around a compiled IEC 61131-3 program: `plc IMAGE [EVENT [I_PAR1]]`. Its text is the same for all
//! compilers, except for its head, which adapts the names of the compiler.

use super::scope::Scope;
use super::text;

const USAGE: &str = include_str!("runner/usage.c");
const SCAN: &str = include_str!("runner/scan.c");

/// A compiler, and the special properties of programs compiled by it.
pub(crate) struct Compiler {
    /// Name of the compiler in texts.
    pub name: &'static str,
    /// The export that generates the program.
    pub format: &'static str,
    /// Declares `config_init__`, `config_run__`, `common_ticktime__` and `__CURRENT_TIME`.
    pub head: &'static str,
}

pub(crate) fn generate(scope: &Scope, compiler: &Compiler) -> String {
    let Compiler { name, format, head } = compiler;
    let about = format!(
        " *\n * The program around a program that {name} compiled: it maps the registers under the located variables, and scans.\n"
    );
    text::template(scope, format, &format!("{about}{USAGE}{head}{SCAN}"))
}
