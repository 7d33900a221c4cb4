//! Describes the name under the pointer.

use super::scenario::ScriptView;
use super::scenes::Scene;
use super::signature::description;
use crate::cli::complete::start_of_word;
use crate::cli::map;
use crate::devices;
use crate::layout::split_plc;
use crate::script::check::ArgumentKind;
use core::ops::Range;

/// Returns the description of the name at a position in Markdown, and the range of the name.
pub(super) fn at(
    view: &ScriptView<'_>,
    scene: Option<&mut Scene>,
    offset: usize,
) -> Option<(String, Range<usize>)> {
    let index = view.outline.token_at(offset).filter(|_| !view.outline.tokens.is_comment(offset))?;
    let token = &view.outline.tokens.all[index];
    let of_call = view.outline.calls.iter().find(|call| call.name == index);
    if of_call.is_some_and(|call| call.module.is_none()) {
        return Some((description(view, token.text(view.text))?, token.range.clone()));
    }
    let named = view.outline.calls.iter().flat_map(|call| view.named_texts(call));
    let mut named = named.filter(|named| named.range.start <= offset && offset <= named.range.end);
    let named = named.next()?;
    let text = view.text.get(named.range.clone())?;
    match named.kind {
        ArgumentKind::Register | ArgumentKind::Registers | ArgumentKind::RegisterOrArea => {
            Some((register(scene?, text)?, named.range))
        }
        ArgumentKind::Fault => fault(text, offset - named.range.start)
            .map(|(about, word)| (about, named.range.start + word.start..named.range.start + word.end)),
        ArgumentKind::Plant => {
            let names = scene?.bench.names();
            let about = format!("PLCs: {}  \nbuses: {}", names.plcs.join(", "), names.buses.join(", "));
            Some((about, named.range))
        }
        _ => None,
    }
}

/// Returns the facts that `commram map` prints for a register, with the values and bits before the sources.
pub(super) fn register(scene: &mut Scene, text: &str) -> Option<String> {
    let (_, name) = split_plc(text);
    let pages = scene.scope.each(text).into_iter().filter_map(|(_, fitted)| {
        let (entries, _) = map::entries_of(&fitted, name).ok().filter(|_| !name.is_empty())?;
        let entry = entries.first()?;
        Some(format!(
            "```text\n{}\n```",
            map::detail::text_with_values_first(fitted.device(), entry).trim_end()
        ))
    });
    pages.into_iter().next()
}

/// Returns the description of the kind of fault or of the field at a byte of the text, and the range of the word.
fn fault(text: &str, at: usize) -> Option<(String, Range<usize>)> {
    let start = start_of_word(&text[..at.min(text.len())]);
    let word = text[start..].split_whitespace().next()?;
    let range = start..start + word.len();
    let kind_name = text.split_whitespace().next()?.replace('-', "_");
    // The present version of a device folder is the last one that this process has read.
    let kind = devices::emulation::catalogue::known_fault_kinds()
        .into_iter()
        .rfind(|kind| kind.name() == kind_name)?;
    if start <= text.len() - text.trim_start().len() {
        return Some((kind.about().to_owned(), range));
    }
    let name = word.split('=').next().unwrap_or_default();
    let field = kind.all_fields().find(|field| field.name() == name || field.other_name() == Some(name))?;
    Some((format!("`{}`: {}, {}", field.name(), field.about(), field.range_text()), range))
}
