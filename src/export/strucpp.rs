//! Access to an image for programs that STruC++, the compiler of OpenPLC 4, has compiled. It consists of a header that
//! every file of the program includes first, and the C++ program that runs the compiled program. STruC++ lists located
//! variables with the numbers of their addresses, so the variables are bound when the program starts.

use super::matiec;
use super::runner::{self, Compiler};
use super::scope::Scope;
use super::text;

/// C++ code that every file of the compiled program includes. It defines global variables that can be bound to
/// registers.
const VARIABLES: &str = include_str!("strucpp/variables.hpp");
const BINDING: &str = include_str!("strucpp/binding.hpp");
const STRUCPP: Compiler =
    Compiler { name: "STruC++", format: "strucpp --main", head: include_str!("runner/strucpp.cpp") };

pub(crate) fn generate(scope: &Scope) -> String {
    let (header, tables) = (matiec::header(scope, "strucpp"), matiec::tables(scope));
    let (rules, storage) = (matiec::rules(), matiec::storage());
    let variables = text::template(scope, "strucpp", VARIABLES);
    format!(
        "{variables}\n#if defined(COMMRAM_STRUCPP_MAIN) && !defined(COMMRAM_STRUCPP_BINDING)\n#define COMMRAM_STRUCPP_BINDING\n\
         {header}\n{tables}{rules}{storage}{BINDING}#endif\n"
    )
}

/// Returns the C++ program around a program that STruC++ compiled with the header.
pub(crate) fn main(scope: &Scope) -> String {
    runner::generate(scope, &STRUCPP)
}
