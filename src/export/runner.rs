//! The program around a compiled IEC 61131-3 program: `plc IMAGE [EVENT [I_PAR1]]`. Its text is the same for all compilers except
//! for the head, which gives the compiler's names to what the rest uses.

use super::scope::Scope;
use super::text;

const USAGE: &str = include_str!("runner/usage.c");
const SCAN: &str = include_str!("runner/scan.c");

/// A compiler, and what is special about programs that it has compiled.
pub(crate) struct Compiler {
    /// Name in texts.
    pub name: &'static str,
    /// The export that makes the program.
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
