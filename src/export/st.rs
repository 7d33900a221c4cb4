//! IEC 61131-3 declarations: either the structures as types with variables at their addresses, or an elementary
//! variable for each register. Each type has a separate `TYPE`, which the standard allows and some compilers require.
//!
//! matiec (the compiler of Beremiz and OpenPLC 3) and STruC++ (the compiler of OpenPLC 4) have other requirements, see
//! [`StCompiler`].

use super::c;
use super::members::{self, Member};
use super::names::UsedNames;
use super::rows;
use super::scope::Scope;
use super::text;
use crate::layout::{Dim, RegisterRef};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Form of the declarations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StForm {
    /// True for an elementary variable per register instead of structures.
    pub elementary: bool,
    /// The compiler for which the declarations are made.
    pub compiler: StCompiler,
}

/// A compiler with requirements beyond the standard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StCompiler {
    /// Declarations according to the standard.
    #[default]
    Any,
    /// A whole file for matiec, which includes the program and has its configuration. matiec accepts each spelling of
    /// an address only once. The C code that it generates for an array of arrays does not compile, so the file has
    /// arrays of two dimensions instead.
    Matiec,
    /// A configuration for STruC++, which reads the program from another file. In a configuration, STruC++ binds only
    /// variables of elementary types. It accepts each address only once, and no additional levels in an address
    /// (decision D-755).
    StruCpp,
}

impl StForm {
    fn command(self) -> &'static str {
        match (self.elementary, self.compiler) {
            (false, StCompiler::Any) => "st",
            (true, StCompiler::Any) => "st --elementary",
            (false, StCompiler::Matiec) => "st --matiec",
            (true, StCompiler::Matiec) => "st --elementary --matiec",
            (_, StCompiler::StruCpp) => "st --strucpp",
        }
    }

    /// True if there is a variable for each register.
    fn is_elementary(self) -> bool {
        self.elementary || self.compiler == StCompiler::StruCpp
    }

    fn is_matiec(self) -> bool {
        self.compiler == StCompiler::Matiec
    }
}

/// Generates the declarations. `blocks` are function blocks that follow the types.
pub(crate) fn generate(scope: &Scope, form: StForm, blocks: Option<&str>) -> String {
    let mut out = head(scope, form, blocks.map_or(form.command(), |_| "st --blocks"));
    let variables = if form.is_elementary() {
        elementary(scope, form.compiler)
    } else {
        out += &types(scope, form);
        out += blocks.unwrap_or_default();
        structures(scope, form)
    };
    let variables = format!("VAR_GLOBAL\n{variables}END_VAR\n");
    match form.compiler {
        StCompiler::Any => out + &variables,
        StCompiler::StruCpp => out + &configuration(&variables),
        // matiec accepts an include only before a configuration, so the include is between the types and the
        // configuration with the variables.
        StCompiler::Matiec => out + "{#include \"program.st\"}\n\n" + &configuration(&variables),
    }
}

/// Returns a configuration that runs `MAIN`. The configuration and the resource have the names that OpenPLC expects
/// when it builds a program.
fn configuration(variables: &str) -> String {
    format!(
        "(* Replace task and program by your own. Declare each register that a program uses in its VAR_EXTERNAL. *)\n\
         (* If program.st has a CONFIGURATION, move its VAR_GLOBAL, tasks and programs here and delete it there. *)\n\
         CONFIGURATION Config0\n{variables}\n\
         RESOURCE Res0 ON PLC\n    TASK scan(INTERVAL := T#2ms, PRIORITY := 0);\n    \
         PROGRAM instance1 WITH scan : MAIN;\nEND_RESOURCE\nEND_CONFIGURATION\n"
    )
}

/// Generates the types. Each type follows the types that it needs.
fn types(scope: &Scope, form: StForm) -> String {
    let structures = scope.structures();
    let mut arrays = Arrays { flat: form.is_matiec(), all: BTreeSet::new() };
    let names = TypeNames::of(scope, form.compiler);
    let (mut small, mut large) = (String::new(), String::new());
    for group in members::groups(&structures) {
        record(&mut small, &mut arrays, &names, group.type_name(), &group.about(), &group.members());
    }
    for of in structures {
        record(&mut large, &mut arrays, &names, of.name, &text::about(of), &members::of(of));
    }
    let declare = |of_records: bool| -> String {
        let wanted = arrays.all.iter().filter(|array| array.of_records == of_records);
        wanted.map(|array| array.declaration(form.is_matiec())).collect()
    };
    format!("{}{small}{}{large}", declare(false), declare(true))
}

/// Returns the variables with the manual's names.
fn structures(scope: &Scope, form: StForm) -> String {
    let mut out = String::new();
    let mut spellings = Spellings::default();
    let types = TypeNames::of(scope, form.compiler);
    let mut names = UsedNames::without_case(types.names.values().cloned());
    for (area, placed) in scope.placed() {
        let variable = names.add(identifier(placed.variable, form.compiler));
        let structure = types.name_of(placed.structure.name);
        let remark = text::made_up(placed).map(|made_up| format!(" (* {made_up} *)")).unwrap_or_default();
        let begin = area.begin();
        let address = if form.is_matiec() { spellings.next(begin, form.compiler) } else { begin };
        let _ = writeln!(out, "    {variable} AT {address} : {structure};{remark}");
    }
    out
}

/// Finds another spelling of an address for each further variable at the same place. An appended level of 0 does not
/// change the place. For STruC++, a segment number that is higher by 1000 does not change it, either.
#[derive(Default)]
struct Spellings(BTreeMap<String, usize>);

impl Spellings {
    fn next(&mut self, address: String, compiler: StCompiler) -> String {
        let used = self.0.entry(address.clone()).or_default();
        *used += 1;
        let more = *used - 1;
        match (compiler, address.split_once('.')) {
            (StCompiler::StruCpp, Some((segment, number))) if more > 0 => {
                let (letters, segment) = segment.split_at(3);
                format!("{letters}{more}{segment:0>3}.{number}")
            }
            _ => address + &".0".repeat(more),
        }
    }
}

/// Returns a variable for each register that the node in this area uses.
fn elementary(scope: &Scope, compiler: StCompiler) -> String {
    let mut out = String::new();
    let mut spellings = Spellings::default();
    let mut seen: BTreeSet<(String, u32)> = BTreeSet::new();
    let mut names = UsedNames::without_case([]);
    for (placed, found) in rows::all(scope) {
        if placed.unused.contains(&found.register.name) {
            continue;
        }
        let name = variable(&found);
        // Structures that overlay each other share some registers.
        if seen.insert((name.clone(), found.offset())) {
            let name = names.add(identifier(&name, compiler));
            let remark = text::remark(found.register);
            let address = spellings.next(found.address().to_string(), compiler);
            let _ = writeln!(out, "    {name} AT {address} : {}; (* {remark} *)", found.ty());
        }
    }
    out
}

fn head(scope: &Scope, form: StForm, command: &str) -> String {
    let mut lines = text::banner(scope, command);
    if form.compiler == StCompiler::StruCpp {
        lines.push(
            "Each address occurs once: the second name of an address has a thousand more in the number of its segment.".into(),
        );
    } else if form.is_matiec() || form.elementary {
        lines.push(
            "Each spelling of an address occurs once: the second name of an address has an additional level of 0."
                .into(),
        );
    }
    lines.iter().map(|line| format!("(* {line} *)\n")).collect::<String>() + "\n"
}

/// Returns the identifier for a register: `node2_a_DATA_PARAMETER_3_w_PAR_NR`. Consecutive `_` are not allowed in it.
fn variable(register: &RegisterRef) -> String {
    let name = register.name();
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("_")
}

/// Words of IEC 61131-3 that cannot be names.
const KEYWORDS: &str = "action and any array at bool by byte case configuration constant date date_and_time dint do dt dword else \
    elsif en end_action end_case end_configuration end_for end_function end_function_block end_if end_program end_repeat \
    end_resource end_step end_struct end_transition end_type end_var end_while eno exit f_edge false for from function \
    function_block if initial_step int lint lreal lword mod not of on or priority program r_edge read_only read_write real \
    repeat resource retain return sint step string struct task then time time_of_day to tod transition true type udint uint \
    ulint until usint var var_access var_config var_external var_global var_in_out var_input var_output var_temp while with \
    word wstring xor \
    abstract char class continue end_class end_interface end_method end_namespace end_property extends final implements interface internal \
    ldate ldate_and_time ldt ltime ltime_of_day ltod method namespace null overlap override pointer private property protected public ref ref_to reference super this using wchar";

/// Macros of `<float.h>`, `<math.h>` and `<time.h>`, which the code of matiec includes in addition to the headers of the C
/// export (glibc 2.36, gcc 12), except [`MATIEC_FAMILIES`].
const MATIEC_MACROS: &str =
    "CLOCKS_PER_SEC DECIMAL_DIG HUGE_VAL HUGE_VALF HUGE_VALL INFINITY NAN TIMER_ABSTIME TIME_UTC";

/// Beginnings of macros of which these headers have many, and of the macros of commram.
const MATIEC_FAMILIES: [&str; 8] = ["CLOCK_", "COMMRAM_", "DBL_", "FLT_", "FP_", "LDBL_", "MATH_", "M_"];

/// Returns the name of a structure, its member or a variable. Consecutive `_`, and `_` at the end, are not allowed in it. If
/// the name is a word of the language in upper or lower case, or begins with a digit, it gets the prefix `r_`. For matiec
/// also if C uses the name in capitals: matiec writes all names in capitals.
fn identifier(name: &str, compiler: StCompiler) -> String {
    let words: Vec<_> = name.split('_').filter(|word| !word.is_empty()).collect();
    let first = if name.starts_with('_') { "_" } else { "" };
    let plain = format!("{first}{}", words.join("_"));
    let has_case = |word: &str| word.eq_ignore_ascii_case(&plain);
    let is_macro = || {
        let name = plain.to_ascii_uppercase();
        c::is_used_by_system(&name)
            || MATIEC_MACROS.split_whitespace().any(has_case)
            || MATIEC_FAMILIES.iter().any(|family| name.starts_with(family))
    };
    if KEYWORDS.split_whitespace().any(has_case)
        || plain.starts_with(|first: char| first.is_ascii_digit())
        || words.is_empty()
        || compiler == StCompiler::Matiec && is_macro()
    {
        format!("r_{}", words.join("_")).trim_end_matches('_').to_owned()
    } else {
        plain
    }
}

/// The names of the types of structures and sub-structures. No two of them are equal.
struct TypeNames {
    compiler: StCompiler,
    /// The names by the names of the manual.
    names: BTreeMap<&'static str, String>,
}

impl TypeNames {
    fn of(scope: &Scope, compiler: StCompiler) -> Self {
        let structures = scope.structures();
        let groups = members::groups(&structures).into_iter().map(|group| group.type_name());
        let all: Vec<_> = groups.chain(structures.iter().map(|of| of.name)).collect();
        // A name that is allowed stays as it is.
        let is_allowed = |name: &str| identifier(name, compiler) == name;
        let allowed = all.iter().filter(|name| is_allowed(name)).map(|name| (*name).to_owned());
        let mut used = UsedNames::without_case(allowed);
        let mut names = BTreeMap::new();
        for name in all {
            names.entry(name).or_insert_with(|| match identifier(name, compiler) {
                same if same == name => same,
                changed => used.add(changed),
            });
        }
        TypeNames { compiler, names }
    }

    fn name_of(&self, name: &str) -> String {
        self.names.get(name).cloned().unwrap_or_default()
    }
}

/// A named array type. The vendor's compilers require a name for each array type. The manual names types with one
/// dimension by a pattern: `USINT_4_BMARRAY` (5.00005.03a p. 77), `BYTE_32_BMARRAY` (p. 213), `DINT_16_BMARRAY` (p.
/// 249). The order of this type puts the inner type of an array of arrays first, because its declaration must precede
/// the array.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Array {
    of_records: bool,
    dims: usize,
    element: String,
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

    /// Returns the element type after the first index, if it is an array.
    fn inner(&self) -> Option<Self> {
        let (_, rest) = self.counts.split_first()?;
        (!rest.is_empty()).then(|| Self {
            dims: rest.len(),
            counts: rest.to_vec(),
            named: "",
            ..self.clone()
        })
    }

    /// Declares the type as an array of arrays, or with `flat` as a single array with all dimensions.
    fn declaration(&self, flat: bool) -> String {
        let range = |count: &u32| format!("0..{}", count - 1);
        let (ranges, of) = match self.inner().filter(|_| !flat) {
            Some(inner) => (self.counts.first().map(range).unwrap_or_default(), inner.name()),
            None => (self.counts.iter().map(range).collect::<Vec<_>>().join(", "), self.element.clone()),
        };
        format!("TYPE\n    {} : ARRAY[{ranges}] OF {of};\nEND_TYPE\n\n", self.name())
    }
}

/// The required array types.
struct Arrays {
    /// True if an array of several dimensions is a single type.
    flat: bool,
    all: BTreeSet<Array>,
}

impl Arrays {
    /// Returns the name of the array's type, and declares the type. Without dimensions, returns the name of the
    /// element.
    fn name_of(&mut self, array: Array) -> String {
        if array.counts.is_empty() {
            return array.element;
        }
        let name = array.name();
        let mut next = Some(array);
        while let Some(array) = next {
            next = array.inner().filter(|_| !self.flat);
            self.all.insert(array);
        }
        name
    }
}

fn record(
    out: &mut String,
    arrays: &mut Arrays,
    types: &TypeNames,
    name: &str,
    doc: &str,
    members: &[Member],
) {
    let counts = |dims: &[Dim]| dims.iter().map(|dim| u32::from(dim.count)).collect::<Vec<_>>();
    let name = types.name_of(name);
    let _ = writeln!(out, "TYPE\n    {name} : (* {doc} *)\n    STRUCT");
    let names = members.iter().filter_map(|member| match member {
        Member::Register(register) => Some(register.name),
        Member::Group(group) => Some(group.member_name()),
        Member::Padding { .. } => None,
    });
    let mut used = UsedNames::without_case(names.map(str::to_owned));
    let mut own = |name: &str| match identifier(name, types.compiler) {
        same if same == name => same,
        changed => used.add(changed),
    };
    for member in members {
        let (field, of_records, element, counts, named, remark) = match member {
            Member::Register(register) => {
                let remark = format!(" (* {} *)", text::remark(register));
                let counts = counts(members::own_dims(register));
                (
                    own(register.name),
                    false,
                    register.ty.name().to_owned(),
                    counts,
                    register.array_type,
                    remark,
                )
            }
            Member::Group(group) => {
                let counts = counts(group.dims());
                (own(group.member_name()), true, types.name_of(group.type_name()), counts, "", String::new())
            }
            Member::Padding { offset, bytes } => {
                let counts = if *bytes == 1 { vec![] } else { vec![*bytes] };
                (members::padding_name(*offset, members), false, "BYTE".to_owned(), counts, "", String::new())
            }
        };
        let ty = arrays.name_of(Array { of_records, dims: counts.len(), element, counts, named });
        let _ = writeln!(out, "        {field} : {ty};{remark}");
    }
    out.push_str("    END_STRUCT;\nEND_TYPE\n\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;

    /// Identifiers do not distinguish upper and lower case and have no `__`.
    #[test]
    fn words_of_the_language_get_a_prefix() {
        let names = |names: [&str; 4], compiler| names.map(|name| identifier(name, compiler));
        assert_eq!(
            names(["AT", "type", "w_TYPE", "level"], StCompiler::Any),
            ["r_AT", "r_type", "w_TYPE", "level"]
        );
        assert_eq!(names(["a__b", "_c_", "_type", "__"], StCompiler::Any), ["a_b", "_c", "_type", "r"]);
        let macros = ["eof", "M_Pi", "int_max", "read"];
        assert_eq!(names(macros, StCompiler::Any), macros);
        assert_eq!(names(macros, StCompiler::Matiec), ["r_eof", "r_M_Pi", "r_int_max", "read"]);
    }

    #[test]
    fn elementary_variables_have_names_of_their_own() {
        let text = elementary(&Scope::new(&DEVICE, None).unwrap(), StCompiler::Any);
        assert!(!text.contains("node1_a_SL_TYP_0 "));
        let (mut names, mut addresses) = (BTreeSet::new(), BTreeSet::new());
        for line in text.lines().filter(|line| line.contains(" AT ")) {
            let mut words = line.split_whitespace();
            let name = words.next().unwrap().to_lowercase();
            assert!(!name.contains("__") && !name.ends_with('_'), "{name}");
            assert!(names.insert(name), "{line}");
            assert!(addresses.insert(words.nth(1).unwrap()), "{line}");
        }
        assert!(names.len() > 3000);
        assert!(text.contains("    node2_a_DATA_PARAMETER_3_w_PAR_NR AT %MW3.203104 : WORD; (* PLC: "));
        assert!(text.contains("    node2_b_MA_SL_MODE AT %MB3.200012 : BYTE;"));
        assert!(text.contains("    node2_b_CTRLREG_WRC1 AT %MB3.200012.0 : BYTE;"));
        let strucpp = elementary(&Scope::new(&DEVICE, None).unwrap(), StCompiler::StruCpp);
        assert_eq!(strucpp.lines().count(), text.lines().count());
        assert!(strucpp.contains("    node2_b_CTRLREG_WRC1 AT %MB1003.200012 : BYTE;"));
    }
}
