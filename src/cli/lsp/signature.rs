//! Descriptions of verbs and functions: for a call at the cursor, and for a name under the pointer.

use super::outline::Function;
use super::scenario::ScriptView;
use crate::script::Verb;
use lsp_types::{Documentation, ParameterInformation, ParameterLabel, SignatureHelp, SignatureInformation};

/// Formats the signature of a verb: `wait(register: String, value: ?, within: ?) -> int`. The types have the names of
/// the reference.
pub(super) fn signature(verb: &Verb) -> String {
    let parameters: Vec<_> = verb.parameters.iter().map(parameter).collect();
    let result = verb.result.map(|result| format!(" -> {result}")).unwrap_or_default();
    format!("{}({}){result}", verb.name, parameters.join(", "))
}

/// Formats a parameter with its type. For a parameter with the type `?`, the description of the verb names the possible
/// types.
fn parameter((name, ty): &(&str, &str)) -> String {
    match *ty {
        "?" => (*name).to_owned(),
        ty => format!("{name}: {ty}"),
    }
}

fn of_function(function: &Function) -> String {
    format!("{}({})", function.name, function.parameters.join(", "))
}

/// Returns the description of a verb, or of a function of this script, in Markdown.
pub(super) fn description(view: &ScriptView<'_>, name: &str) -> Option<String> {
    let block = |signature: &str, about: &str| format!("```rhai\n{signature}\n```\n{about}");
    if let Some(function) = view.outline.function(name) {
        return Some(block(&of_function(function), &function.about));
    }
    let verbs = view.verbs.iter().filter(|verb| verb.name == name);
    let texts: Vec<_> = verbs.map(|verb| block(&signature(verb), verb.about)).collect();
    (!texts.is_empty()).then(|| texts.join("\n\n"))
}

/// Returns the signatures for the call at a position.
pub(super) fn help(view: &ScriptView<'_>, offset: usize) -> Option<SignatureHelp> {
    let (call, argument) = view.outline.call_at(offset)?;
    let active = u32::try_from(argument).ok();
    let information = |label: String, about: &str, parameters: Vec<String>| SignatureInformation {
        label,
        documentation: (!about.is_empty()).then(|| Documentation::String(about.to_owned())),
        parameters: Some(parameters.into_iter().map(of_parameter).collect()),
        active_parameter: active,
    };
    let name = view.name(call);
    let (signatures, fits): (Vec<_>, _) = match view.outline.function(name).filter(|_| call.module.is_none())
    {
        Some(function) => {
            (vec![information(of_function(function), &function.about, function.parameters.clone())], None)
        }
        None => {
            let verbs = view.verbs_of(call);
            let fits = verbs.iter().position(|verb| verb.parameters.len() > argument);
            let all = verbs.iter().map(|verb| {
                information(signature(verb), verb.about, verb.parameters.iter().map(parameter).collect())
            });
            (all.collect(), fits)
        }
    };
    let active_signature = fits.and_then(|fits| u32::try_from(fits).ok());
    (!signatures.is_empty()).then_some(SignatureHelp {
        signatures,
        active_signature,
        active_parameter: active,
    })
}

fn of_parameter(label: String) -> ParameterInformation {
    ParameterInformation { label: ParameterLabel::Simple(label), documentation: None }
}
