//! Parsers of names and texts that must not be empty: an empty name would select everything.

/// Returns a parser of texts that are not empty. `right` is the correct form, for the error message.
pub(crate) fn text(
    right: &'static str,
) -> impl Fn(&str) -> Result<String, String> + Clone + Send + Sync + 'static {
    move |text| match text.trim() {
        "" => Err(format!("an empty name; {right}")),
        _ => Ok(text.to_owned()),
    }
}

/// Correct form of the name of a block, array or register.
pub(crate) const BLOCK: &str = "write a block or a register, for example node2 or node2.w_CPU_CONTROL";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_text_is_refused_with_the_right_form() {
        let parse = text(BLOCK);
        assert_eq!(parse("node2"), Ok("node2".to_owned()));
        for empty in ["", "  "] {
            let refused = parse(empty).unwrap_err();
            assert!(refused.contains("empty name") && refused.contains(BLOCK), "{refused}");
        }
    }
}
