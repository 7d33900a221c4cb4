//! Removes function blocks from `commram export st --blocks`. A program needs this if it has a variable with the name
//! of a block: matiec does not accept both.

use super::{CliError, wrong};

const BLOCK: &str = "FUNCTION_BLOCK ";

/// Removes the named function blocks from a text in Structured Text. The remaining blocks must not use them.
pub(super) fn without(mut blocks: String, names: &[String]) -> Result<String, CliError> {
    for name in names {
        let refused = |right: String| wrong(format!("st --blocks --without {name}"), right);
        let shorter = without_block(&blocks, name)
            .ok_or_else(|| refused(format!("the blocks are: {}", block_names(&blocks).join(", "))))?;
        if shorter.lines().any(|line| is_of_type(line, name)) {
            return Err(refused("other blocks use it; rename the variable of the program".to_owned()));
        }
        blocks = shorter;
    }
    Ok(blocks)
}

/// Returns names of the function blocks, without the helpers of other blocks.
fn block_names(blocks: &str) -> Vec<&str> {
    let names = blocks.lines().filter_map(|line| line.strip_prefix(BLOCK));
    names.filter(|name| !name.starts_with("COMMRAM_")).collect()
}

/// Removes a block and the comments before it. Returns nothing if there is no block of this name.
fn without_block(blocks: &str, name: &str) -> Option<String> {
    let lines: Vec<_> = blocks.lines().collect();
    let is_it = |line: &&str| line.strip_prefix(BLOCK).is_some_and(|known| known.eq_ignore_ascii_case(name));
    let begin = lines.iter().position(is_it)?;
    let end = begin + lines[begin..].iter().position(|line| *line == "END_FUNCTION_BLOCK")?;
    let comments = lines[..begin].iter().rposition(|line| line.is_empty()).map_or(0, |at| at + 1);
    let behind = lines[end + 1..].iter().skip_while(|line| line.is_empty());
    Some(lines[..comments].iter().chain(behind).flat_map(|line| [line, "\n"]).collect())
}

/// True if a line declares a variable of this type.
fn is_of_type(line: &str, name: &str) -> bool {
    let ty = line.split_once(':').map(|(_, ty)| ty.trim().trim_end_matches(';'));
    ty.is_some_and(|ty| ty.eq_ignore_ascii_case(name))
}
