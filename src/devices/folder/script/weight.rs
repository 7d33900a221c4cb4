//! Weights of values. The weight of a value is a measure of the work of an operation with the whole value: to copy it, to
//! sort it, or to write it as a text. Steps count by weights, because real time must not decide where a script stops
//! (D-801).

use rhai::{AST, ASTNode, Array, Blob, Dynamic, Expr, Map};

/// Weight of an array or a map in addition to its contents: a copy allocates memory.
pub(super) const CONTAINER: u64 = 4;
/// Deepest nesting that is weighed. The stack must suffice for the recursion.
const DEEPEST: usize = 24;
/// Weight of a value that is nested deeper: at least that of each value within the limits of the engine.
const OF_DEEP: u64 = 16 << 10;

/// Weight of a text with this number of bytes.
pub(super) fn of_text(bytes: usize) -> u64 {
    1 + bytes as u64 / 2
}

/// Weight of an array of bytes with this length.
pub(super) fn of_bytes(bytes: usize) -> u64 {
    CONTAINER + bytes as u64 / 8
}

/// Returns the weight of a value.
pub(super) fn of(value: &Dynamic) -> u64 {
    at_depth(value, 0)
}

fn at_depth(value: &Dynamic, depth: usize) -> u64 {
    if depth > DEEPEST {
        return OF_DEEP;
    }
    let inner = |value: &Dynamic| at_depth(value, depth + 1);
    if value.is_array() {
        let array = value.read_lock::<Array>();
        return CONTAINER + array.map_or(0, |array| array.iter().map(inner).sum::<u64>());
    }
    if value.is_map() {
        let map = value.read_lock::<Map>();
        let contents = |map: &Map| map.iter().map(|(key, value)| of_key(key) + inner(value)).sum::<u64>();
        return CONTAINER + map.map_or(0, |map| contents(&map));
    }
    if value.is_blob() {
        return value.read_lock::<Blob>().map_or(CONTAINER, |blob| of_bytes(blob.len()));
    }
    value.as_immutable_string_ref().map_or(1, |text| of_text(text.len()))
}

/// Weight of a key of a map.
pub(super) fn of_key(key: &str) -> u64 {
    4 + key.len() as u64 / 32
}

/// Returns the weight of the heaviest constant in a script.
pub(super) fn of_constants(ast: &AST) -> u64 {
    let mut heaviest = 0;
    let mut add = |expression: &Expr| {
        if let Expr::DynamicConstant(value, _) = expression {
            heaviest = of(value).max(heaviest);
        }
    };
    ast.walk(&mut |path: &[ASTNode<'_>]| {
        if let Some(ASTNode::Expr(expression)) = path.last() {
            add(expression);
        }
        // The walk does not visit all arguments of a call.
        if let Some(call) = path.last().and_then(crate::whole_script::call_of) {
            call.args.iter().for_each(&mut add);
        }
        true
    });
    heaviest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_and_deep_values_are_heavy() {
        let value = |text: &str| rhai::Engine::new().eval::<Dynamic>(text).unwrap();
        for (text, weight) in [
            ("5", 1),
            ("\"\"", 1),
            ("\"abcd\"", 3),
            ("[]", 4),
            ("[1, 2, []]", 10),
            ("#{ a: 1, b: [7] }", 4 + 4 + 1 + 4 + 5),
            ("blob(16, 0)", 6),
        ] {
            assert_eq!(of(&value(text)), weight, "{text}");
        }
        let deep = (0..2000).fold(Dynamic::UNIT, |inner, _| Dynamic::from_array(vec![inner]));
        assert!(of(&deep) >= OF_DEEP);
    }

    #[test]
    fn constants_are_weighed_where_they_are() {
        let weight = |text: &str| of_constants(&rhai::Engine::new().compile(text).unwrap());
        assert_eq!(weight("let a = 5; fn f(x) { x }"), 0);
        for text in ["const A = [1, 2, 3];", "fn f() { [1, 2, 3] }", "fn f() { g(1, [1, 2, 3]) }"] {
            assert_eq!(weight(text), 7, "{text}");
        }
    }
}
