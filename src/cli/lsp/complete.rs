//! Completion in scripts.

use super::outline::Call;
use super::scenario::{ScriptKind, ScriptView};
use super::scenes::Scene;
use super::signature::signature;
use super::tokens::TokenKind;
use crate::cli::complete::{NamedValue, PlcScope, start_of_word};
use crate::cli::map::entry::firsts;
use crate::devices;
use crate::layout::Fit;
use crate::script::check::{self, ArgumentKind};
use core::ops::Range;
use lsp_types::CompletionItemKind;

/// Words of the language that begin or join statements.
const WORDS: [&str; 20] = [
    "break", "catch", "const", "continue", "else", "false", "fn", "for", "if", "import", "in", "let", "loop",
    "private", "return", "switch", "throw", "true", "try", "while",
];

/// Examples of emulated times, which show the units.
const TIMES: [(&str, &str); 4] = [
    ("500us", "a processor cycle of a node"),
    ("1ms", "1000 microseconds"),
    ("100ms", "100 milliseconds"),
    ("1s", "a second"),
];

/// A text that the editor proposes at the cursor.
pub(super) struct Proposal {
    pub(super) label: String,
    /// Short description beside the label.
    pub(super) detail: String,
    /// Longer description of the proposal, which the editor shows beside it.
    pub(super) about: String,
    pub(super) kind: CompletionItemKind,
}

impl Proposal {
    pub(super) fn new(label: impl Into<String>, detail: impl Into<String>, kind: CompletionItemKind) -> Self {
        Self { label: label.into(), detail: detail.into(), about: String::new(), kind }
    }

    /// True if the proposal is a word of the language, false if it is a name inside a text.
    pub(super) fn is_word(&self) -> bool {
        use CompletionItemKind as Item;
        [Item::FUNCTION, Item::VARIABLE, Item::KEYWORD, Item::CONSTANT].contains(&self.kind)
    }
}

/// Returns the texts that fit at a position, and the range of bytes that each text replaces.
pub(super) fn at(
    view: &ScriptView<'_>,
    scene: Option<&mut Scene>,
    offset: usize,
) -> (Vec<Proposal>, Range<usize>) {
    let nothing = (Vec::new(), offset..offset);
    if view.outline.tokens.is_comment(offset) {
        return nothing;
    }
    let token = view.outline.token_at(offset).map(|index| &view.outline.tokens.all[index]);
    let call = view.outline.call_at(offset);
    match token {
        Some(token)
            if matches!(token.kind, TokenKind::Text | TokenKind::Template) && token.range.start < offset =>
        {
            let Some(content) = token.content(view.text).filter(|content| offset <= content.end) else {
                return nothing;
            };
            let Some((call, argument)) = call else { return nothing };
            in_text(view, scene, call, argument, content, offset)
        }
        Some(token)
            if token.kind == TokenKind::Piece
                && token.range.start < offset
                && (offset < token.range.end || !token.begins_code(view.text)) =>
        {
            nothing
        }
        Some(token) if token.kind == TokenKind::Word => (words(view, scene, call), token.range.clone()),
        Some(token) if matches!(token.kind, TokenKind::Number | TokenKind::Letter) => nothing,
        _ => (words(view, scene, call), offset..offset),
    }
}

/// Proposals within the quotes of a text.
fn in_text(
    view: &ScriptView<'_>,
    scene: Option<&mut Scene>,
    call: &Call,
    argument: usize,
    content: Range<usize>,
    offset: usize,
) -> (Vec<Proposal>, Range<usize>) {
    let typed = view.text.get(content.start..offset).unwrap_or_default();
    let (Some(kind), Some(scene)) = (view.argument_kind(call, argument), scene) else {
        return (Vec::new(), content);
    };
    let simple = |names: Vec<String>, kind: CompletionItemKind| {
        names.into_iter().map(|name| Proposal::new(name, "", kind)).collect::<Vec<_>>()
    };
    let found = match kind {
        ArgumentKind::Register | ArgumentKind::Registers => registers(&scene.scope, typed),
        ArgumentKind::RegisterOrArea => {
            areas(scene).into_iter().chain(registers(&scene.scope, typed)).collect()
        }
        ArgumentKind::Area | ArgumentKind::Place => areas(scene),
        ArgumentKind::Port => ports(&scene.scope),
        ArgumentKind::Bus => simple(scene.bench.names().buses.clone(), CompletionItemKind::MODULE),
        ArgumentKind::Plc => simple(scene.bench.names().plcs.clone(), CompletionItemKind::MODULE),
        ArgumentKind::Drive => simple(scene.drives.clone(), CompletionItemKind::MODULE),
        ArgumentKind::Block => blocks(&scene.scope),
        ArgumentKind::Rules => rules(),
        ArgumentKind::Value => values(view, scene, call, |value| value.name.clone()),
        ArgumentKind::Fault => return fault(scene, view.text, content, offset),
        ArgumentKind::Time => {
            TIMES.map(|(text, about)| Proposal::new(text, about, CompletionItemKind::UNIT)).into()
        }
        ArgumentKind::Plant | ArgumentKind::Board => Vec::new(),
    };
    (found, content)
}

/// Returns all registers with their addresses and meanings. An array is represented by its first element. Indices are
/// completed step by step.
pub(super) fn registers(scope: &PlcScope, typed: &str) -> Vec<Proposal> {
    if typed.contains('[') {
        let found = scope.registers(typed, "").into_iter();
        return found.map(|(name, about)| Proposal::new(name, about, CompletionItemKind::FIELD)).collect();
    }
    let mut found = Vec::new();
    for (prefix, fitted) in scope.each(typed) {
        let areas = fitted.device().named_areas().filter(|area| fitted.area(area) != Fit::Empty);
        for register in
            areas.flat_map(|area| firsts(&fitted, area)).filter(|register| !register.is_reserved())
        {
            let detail = format!("{} {}, {}", register.address(), register.ty().name(), register.owner());
            let mut proposal =
                Proposal::new(format!("{prefix}{}", register.name()), detail, CompletionItemKind::FIELD);
            proposal.about = register.register.doc.to_owned();
            found.push(proposal);
        }
    }
    found
}

/// Returns the areas that have registers. Plain RAM and the front panel are not included.
fn areas(scene: &mut Scene) -> Vec<Proposal> {
    let all = scene.scope.areas("", "").into_iter();
    let found = all.filter(|(name, _)| check::argument(&mut scene.bench, ArgumentKind::Area, name).is_ok());
    found.map(|(name, about)| Proposal::new(name, about, CompletionItemKind::MODULE)).collect()
}

fn ports(scope: &PlcScope) -> Vec<Proposal> {
    let prefixed = scope.each("").into_iter();
    let names = prefixed.flat_map(|(prefix, fitted)| {
        fitted.device().ports.iter().map(move |port| format!("{prefix}{}", port.name))
    });
    names.map(|name| Proposal::new(name, "", CompletionItemKind::MODULE)).collect()
}

fn blocks(scope: &PlcScope) -> Vec<Proposal> {
    let mut names: Vec<_> = scope
        .plcs()
        .filter_map(|(_, fitted)| devices::of_hash(fitted.device().layout_hash))
        .flat_map(|device| device.blocks)
        .map(|block| block.name)
        .collect();
    names.sort_unstable();
    names.dedup();
    names.into_iter().map(|name| Proposal::new(name, "function block", CompletionItemKind::CLASS)).collect()
}

fn rules() -> Vec<Proposal> {
    let rules = devices::catalogue().rules.iter();
    rules.map(|rule| Proposal::new(rule.id(), rule.text(), CompletionItemKind::ENUM_MEMBER)).collect()
}

/// Returns the named values of the register of a call. `label` formats each value.
fn values(
    view: &ScriptView<'_>,
    scene: &Scene,
    call: &Call,
    label: impl Fn(&NamedValue) -> String,
) -> Vec<Proposal> {
    let values = view.register_of(call).map(|register| scene.scope.values(register)).unwrap_or_default();
    let proposal = |value: &NamedValue| match value.bit {
        None => Proposal::new(label(value), value.meaning.clone(), CompletionItemKind::ENUM_MEMBER),
        Some(bit) => {
            Proposal::new(label(value), format!("bit {bit}: {}", value.meaning), CompletionItemKind::PROPERTY)
        }
    };
    let mut found: Vec<_> = values.iter().map(proposal).collect();
    found.dedup_by(|next, before| next.label == before.label);
    found
}

/// Proposes the words of a fault: first the kinds, then the fields and their values. A proposal replaces the word under
/// the cursor.
fn fault(scene: &Scene, text: &str, content: Range<usize>, offset: usize) -> (Vec<Proposal>, Range<usize>) {
    let whole = text.get(content.clone()).unwrap_or_default();
    let at = offset - content.start;
    let start = start_of_word(&whole[..at]);
    let end = whole[at..].find(char::is_whitespace).map_or(whole.len(), |blank| at + blank);
    let range = content.start + start..content.start + end;
    if whole[..start].trim().is_empty() {
        let kinds = devices::emulation::catalogue::fault_kinds_of(scene.bench.names()).into_iter();
        let kinds = kinds.map(|kind| Proposal::new(kind.name(), kind.about(), CompletionItemKind::EVENT));
        return (kinds.collect(), range);
    }
    let words = whole[..start].split_whitespace().chain(whole[end..].split_whitespace());
    let words: Vec<_> = words.map(str::to_owned).collect();
    let fields = scene.scope.fault_fields(&whole[start..at], &words, || scene.bench.names().buses.clone());
    let found =
        fields.into_iter().map(|(name, about)| Proposal::new(name, about, CompletionItemKind::PROPERTY));
    let required =
        Proposal::new("required", "the scenario fails if the fault never hits", CompletionItemKind::PROPERTY);
    let has_required = words.iter().any(|word| word == "required") || whole[start..at].contains('=');
    (found.chain((!has_required).then_some(required)).collect(), range)
}

/// Proposals outside of texts: verbs, functions, variables, words, and the values of a register.
fn words(view: &ScriptView<'_>, scene: Option<&mut Scene>, call: Option<(&Call, usize)>) -> Vec<Proposal> {
    let mut found = Vec::new();
    if let (Some(scene), Some((call, argument))) = (scene, call)
        && view.argument_kind(call, argument) == Some(ArgumentKind::Value)
    {
        found.extend(values(view, scene, call, |value| format!("{:#06x}", value.bits)));
    }
    if call.is_some_and(|(call, argument)| view.argument_kind(call, argument) == Some(ArgumentKind::Time)) {
        let quoted = |(text, about)| Proposal::new(format!("\"{text}\""), about, CompletionItemKind::UNIT);
        found.extend(TIMES.map(quoted));
    }
    let mut last = "";
    for verb in &view.verbs {
        if verb.name != last {
            let mut proposal = Proposal::new(verb.name, signature(verb), CompletionItemKind::FUNCTION);
            proposal.about = verb.about.to_owned();
            found.push(proposal);
        }
        last = verb.name;
    }
    for function in &view.outline.functions {
        let detail = format!("{}({})", function.name, function.parameters.join(", "));
        let mut proposal = Proposal::new(function.name.as_str(), detail, CompletionItemKind::FUNCTION);
        proposal.about.clone_from(&function.about);
        found.push(proposal);
    }
    let variables = view.outline.variables.iter();
    found.extend(variables.map(|name| Proposal::new(name.as_str(), "", CompletionItemKind::VARIABLE)));
    found.extend(WORDS.map(|word| Proposal::new(word, "", CompletionItemKind::KEYWORD)));
    if view.kind != ScriptKind::Firmware {
        found.push(Proposal::new("extended", "the identifier has 29 bits", CompletionItemKind::CONSTANT));
    }
    found
}
