//! Named fields as maps of scripts.

use crate::script::{Field, Fields};
use rhai::{Dynamic, Map};

/// Returns the fields as a map.
pub(super) fn map(fields: Fields) -> Map {
    fields.into_iter().map(|(name, field)| (name.into(), value(field))).collect()
}

fn value(field: Field) -> Dynamic {
    match field {
        Field::Flag(flag) => flag.into(),
        Field::Number(number) => number.into(),
        Field::Text(text) => text.into(),
        Field::Fields(fields) => map(fields).into(),
    }
}
