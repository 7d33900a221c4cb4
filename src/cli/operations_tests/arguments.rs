//! Verbs and methods have the arguments of their operations, in the same order (D-886).

use super::{only_name, page, root, rows};
use crate::request::ops::ops;
use crate::script::verbs;
use std::fs;

/// Names and types of the fields of an operation.
type Fields = &'static [(&'static str, &'static str)];

macro_rules! fields {
    ($(
        $(#[$doc:meta])*
        $op:ident = $number:literal, $name:ident, $class:ident -> $reply:ident
        $({$(
            $(#[$field_doc:meta])*
            $field:ident: $type:ty $([..=$most:ident, $code:ident])? => $($column:ident)+
        ),+ $(,)?})?
    ),+ $(,)?) => {
        /// Name and fields of each operation.
        const OPERATIONS: &[(&str, Fields)] =
            &[$((stringify!($name), &[$($((stringify!($field), stringify!($type))),+)?])),+];
    };
}

ops!(fields);

/// An argument of verbs and methods.
struct Argument {
    /// Name in scenarios.
    verb: &'static str,
    /// Name in Python.
    method: &'static str,
    /// Types in the definition files of the verbs and of the package.
    types: (&'static str, &'static str),
    is_optional: bool,
}

const fn argument(name: &'static str, types: (&'static str, &'static str)) -> Argument {
    Argument { verb: name, method: name, types, is_optional: false }
}

const fn optional(name: &'static str, types: (&'static str, &'static str)) -> Argument {
    Argument { is_optional: true, ..argument(name, types) }
}

const TEXT: (&str, &str) = ("String", "str");
const NUMBER: (&str, &str) = ("int", "int");
const VALUE: (&str, &str) = ("?", "_Value");
const TIME: (&str, &str) = ("?", "_Time");

/// The arguments for groups of fields. The first group that fits counts.
const FORMS: &[(Fields, &[Argument])] = &[
    (&[("plc", "DeviceIndex"), ("offset", "u32"), ("width", "Width")], &[argument("register", TEXT)]),
    (
        &[("plc", "DeviceIndex"), ("node", "PortNumber")],
        &[Argument { verb: "node", method: "port", types: TEXT, is_optional: true }],
    ),
    (&[("plc", "DeviceIndex"), ("setting", "BoardSetting")], &[argument("words", TEXT)]),
    (&[("plc", "DeviceIndex")], &[optional("plc", TEXT)]),
    (&[("drive", "u16")], &[argument("name", TEXT)]),
    (&[("fault", "Fault")], &[argument("words", TEXT)]),
    (&[("id", "Option<NonZeroU16>")], &[argument("number", NUMBER)]),
    (&[("bus", "BusIndex")], &[argument("bus", TEXT)]),
    (
        &[("frame", "Option<Frame>")],
        &[
            argument("identifier", NUMBER),
            argument("data", ("?", "_Data")),
            optional("extended", ("bool", "bool")),
        ],
    ),
    (&[("current", "u32")], &[argument("expected", VALUE)]),
    (&[("new", "u32")], &[argument("new", VALUE)]),
    (&[("mask", "u32")], &[argument("mask", VALUE)]),
    (&[("value", "u32")], &[argument("value", VALUE)]),
    (&[("us", "u64")], &[argument("time", TIME)]),
    (&[("within_us", "u64")], &[argument("within", TIME)]),
    (&[("number", "u32")], &[argument("saved", NUMBER)]),
    // No outside participant takes part in the plant of a scenario or a test.
    (&[("detached", "bool")], &[]),
];

/// Operations whose verbs and methods have other arguments, with the reason.
const NOT_PLAIN: &[(&str, &str)] = &[
    ("read_range", "`snapshot` copies all registers of an area"),
    ("journal", "`journal` returns the records from a time on, in as many operations as necessary"),
    ("advance_to_event", "`wait_until` evaluates a function of the caller at each event"),
    ("forces", "`describe` shows one register, with its forced value"),
    ("follow", "`record` records a register or an area"),
    ("drives", "`drive` finds the drive with a name"),
    ("is_recorded", "`plot` draws recorded registers"),
];

/// True if the first fields of an operation are this group. The compiler writes the types of fields with spaces.
fn begins_with(fields: Fields, group: Fields) -> bool {
    let is_same = |(field, wanted): (&(&str, &str), &(&str, &str))| {
        field.0 == wanted.0 && field.1.replace(' ', "") == wanted.1
    };
    fields.len() >= group.len() && fields.iter().zip(group).all(is_same)
}

/// Returns the arguments for the fields of an operation; `None` if a field has no form.
fn arguments(mut fields: Fields) -> Option<Vec<&'static Argument>> {
    let mut all = Vec::new();
    while !fields.is_empty() {
        let (group, arguments) = FORMS.iter().find(|(group, _)| begins_with(fields, group))?;
        all.extend(*arguments);
        fields = &fields[group.len()..];
    }
    Some(all)
}

/// Returns the parameters of a verb with these arguments. An optional argument leads to one more form of the verb.
fn forms_of_verb(arguments: &[&Argument]) -> Vec<Vec<(&'static str, &'static str)>> {
    let needed = arguments.iter().take_while(|argument| !argument.is_optional).count();
    let parameters = |count| arguments.iter().take(count).map(|it| (it.verb, it.types.0)).collect();
    (needed..=arguments.len()).map(parameters).collect()
}

/// Returns the parameters of a method with these arguments, without the default values.
fn parameters_of_method(arguments: &[&Argument]) -> Vec<String> {
    let text = |argument: &&Argument| {
        let default = if argument.is_optional { " =" } else { "" };
        format!("{}: {}{default}", argument.method, argument.types.1)
    };
    arguments.iter().map(text).collect()
}

/// Returns the parameters of a method in the definition file of the package.
fn parameters_in_python(definitions: &str, method: &str) -> Option<Vec<String>> {
    let (_, class) = definitions.split_once("\nclass Bench:\n")?;
    let class = class.split("\nclass ").next()?;
    let (_, rest) = class.split_once(&format!("    def {method}(self"))?;
    let (list, _) = rest.split_once(") -> ")?;
    let parameters = list.split(", ").map(str::trim).filter(|it| !it.is_empty() && *it != ",");
    let without_default = |parameter: &str| match parameter.split_once(" = ") {
        Some((name, _)) => format!("{name} ="),
        None => parameter.to_owned(),
    };
    Some(parameters.map(without_default).collect())
}

#[test]
fn verbs_and_methods_have_the_arguments_of_their_operations() {
    let (page, verbs) = (page(), verbs());
    let definitions = fs::read_to_string(root().join("tools/python/python/commram/_native.pyi")).unwrap();
    let mut compared = 0;
    for row in rows(&page) {
        let name = only_name(row[0]).unwrap();
        let (_, fields) = OPERATIONS.iter().find(|(known, _)| *known == name).unwrap();
        let arguments = arguments(fields);
        let verb = only_name(row[1]).map(|verb| {
            let forms = verbs.iter().filter(|it| it.name == verb).map(|it| it.parameters.clone());
            let mut forms: Vec<_> = forms.collect();
            forms.sort_by_key(Vec::len);
            (verb, arguments.as_deref().is_some_and(|it| forms_of_verb(it) == forms), format!("{forms:?}"))
        });
        let method = only_name(row[3]).map(|method| {
            let found = parameters_in_python(&definitions, method);
            let is_same = found == arguments.as_deref().map(parameters_of_method);
            (method, is_same, format!("{found:?}"))
        });
        let reason = NOT_PLAIN.iter().find(|(known, _)| *known == name);
        let all = [verb, method].into_iter().flatten();
        if let Some((_, reason)) = reason {
            assert!(all.into_iter().any(|(_, is_same, _)| !is_same), "{name} is plain now: {reason}");
            continue;
        }
        for (called, is_same, found) in all {
            assert!(is_same, "`{called}` of {name} {fields:?} has other arguments: {found}");
            compared += 1;
        }
    }
    assert!(compared > 30, "only {compared} verbs and methods");
}

#[test]
fn the_page_lists_the_forms_of_the_fields() {
    const HEAD: &str = "| Fields | Arguments of the verb | Arguments of the method |\n|---|---|---|\n";
    let cell = |names: Vec<&str>| match names.is_empty() {
        true => "none".to_owned(),
        false => format!("`{}`", names.join("`, `")),
    };
    let row = |(fields, arguments): &(Fields, &[Argument])| {
        let fields = fields.iter().map(|(name, _)| *name).collect();
        let verb = arguments.iter().map(|it| it.verb).collect();
        let method = arguments.iter().map(|it| it.method).collect();
        let is_optional = arguments.last().is_some_and(|it| it.is_optional);
        let may = if is_optional { " (may be omitted)" } else { "" };
        format!("| {} | {}{may} | {}{may} |", cell(fields), cell(verb), cell(method))
    };
    // A field with the same name as its argument needs no row.
    let differs = |(fields, arguments): &&(Fields, &[Argument])| {
        fields.len() != 1
            || arguments.len() != 1
            || fields[0].0 != arguments[0].verb
            || arguments[0].is_optional
    };
    let rows: Vec<_> = FORMS.iter().filter(differs).map(row).collect();
    let table = format!("{HEAD}{}\n", rows.join("\n"));
    crate::check_table_of_page("docs/reference/channel.md", HEAD, &table, "COMMRAM_UPDATE_OPERATIONS");
}
