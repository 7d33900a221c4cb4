//! Values of a script between two calls, in a form that snapshots can save.
//!
//! A value is a list of items. Each container comes before its contents. So reading a value from a snapshot
//! of an unknown author takes no more memory than its bytes, and no more stack than the permitted depth.

use super::engine::{LARGEST_ARRAY, LARGEST_MAP, LONGEST_TEXT, most_elements, most_entries, most_texts};
use super::weight;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::slice::{Iter, IterMut};
use rhai::{Array, Blob, Dynamic, INT, Map};
use serde::{Deserialize, Serialize};

/// Maximum number of items of a value: each key and each element counts, and the value itself.
const MOST_ITEMS: usize = 1 + LARGEST_ARRAY + 2 * LARGEST_MAP;
/// Maximum total number of bytes of all keys of maps in a value.
const MOST_KEY_BYTES: usize = 64 << 10;
/// Deepest nesting of arrays and maps in a value.
const DEEPEST: usize = 16;

/// An element of the list: a number, a text, or the head of an array or a map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Item {
    Nothing,
    Bool(bool),
    Int(i64),
    /// Bits of a number with decimals.
    Float(u64),
    Char(char),
    Text(String),
    Bytes(Vec<u8>),
    /// An array: the given number of values follows.
    Array(u32),
    /// A map: the given number of pairs follows, each with a text and a value.
    Map(u32),
}

/// A value as data.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Data(Vec<Item>);

impl Data {
    /// Returns an empty map.
    pub(super) fn empty_map() -> Self {
        Data(vec![Item::Map(0)])
    }

    /// Returns an empty array.
    pub(super) fn empty_array() -> Self {
        Data(vec![Item::Array(0)])
    }

    /// Converts a value of the engine.
    ///
    /// # Errors
    /// The value is too large, nested too deeply, or contains something that cannot be saved.
    pub(super) fn of(value: &Dynamic) -> Result<Self, String> {
        let mut data = Data(Vec::new());
        data.push(value, 0, &mut Size::default())?;
        Ok(data)
    }

    /// Converts the state of a script, the map `this`.
    ///
    /// # Errors
    /// The value is not a map, or the errors of [`Data::of`].
    pub(super) fn of_state(this: &Dynamic) -> Result<Self, String> {
        if !this.is_map() {
            return Err(format!("it is a value of type {}; it must stay a map", this.type_name()));
        }
        Data::of(this)
    }

    /// Appends a value. `size` is that of all values so far.
    fn push(&mut self, value: &Dynamic, depth: usize, size: &mut Size) -> Result<(), String> {
        if depth > DEEPEST {
            return Err(format!("this value is nested more than {DEEPEST} deep"));
        }
        if let Some(array) = value.read_lock::<Array>() {
            size.add_elements(array.len())?;
            self.0.push(Item::Array(array.len() as u32));
            return array.iter().try_for_each(|value| self.push(value, depth + 1, size));
        }
        if let Some(map) = value.read_lock::<Map>() {
            size.add_entries(map.len())?;
            self.0.push(Item::Map(map.len() as u32));
            return map.iter().try_for_each(|(key, value)| {
                size.add_key(key.len())?;
                self.0.push(Item::Text(key.to_string()));
                self.push(value, depth + 1, size)
            });
        }
        let item = item(value)?;
        match &item {
            Item::Text(text) => size.add_text(text.len())?,
            // The array of bytes counts, too.
            Item::Bytes(bytes) => size.add_elements(bytes.len() + 1)?,
            _ => {}
        }
        self.0.push(item);
        Ok(())
    }

    /// Returns the value for the engine.
    pub(super) fn value(&self) -> Dynamic {
        read(&mut self.0.iter(), 0).unwrap_or(Dynamic::UNIT)
    }

    /// Returns the values of an array. If the data are not an array, returns a list with the data as a single
    /// value.
    pub(super) fn values(&self) -> Vec<Dynamic> {
        let mut items = self.0.iter();
        match items.next() {
            Some(Item::Array(count)) => (0..*count).map_while(|_| read(&mut items, 1)).collect(),
            _ => vec![self.value()],
        }
    }

    /// Takes over the state of a script if it differs from these data only in numbers, bools and characters.
    /// All sizes are then unchanged. This is faster than [`Data::of_state`], because it allocates nothing.
    pub(super) fn take_over(&mut self, this: &Dynamic) -> Update {
        let mut items = self.0.iter();
        match compare(&mut items, this).filter(|_| items.as_slice().is_empty()) {
            None => Update::Other,
            Some(false) => Update::Same,
            Some(true) => {
                copy(&mut self.0.iter_mut(), this);
                Update::Changed
            }
        }
    }

    /// Returns the weight of the value.
    pub(super) fn weight(&self) -> u64 {
        self.0.iter().map(weight_of).sum()
    }

    /// True if the items form exactly one value within the limits.
    fn is_whole(&self) -> bool {
        let mut items = self.0.iter();
        self.0.len() <= 2 * MOST_ITEMS && read(&mut items, 0).is_some() && items.next().is_none()
    }
}

/// Weight of an item without the contents of a container. A key counts as a text.
fn weight_of(item: &Item) -> u64 {
    match item {
        Item::Text(text) => weight::of_text(text.len()),
        Item::Bytes(bytes) => weight::of_bytes(bytes.len()),
        Item::Array(_) | Item::Map(_) => weight::CONTAINER,
        Item::Nothing | Item::Bool(_) | Item::Int(_) | Item::Float(_) | Item::Char(_) => 1,
    }
}

/// Result of [`Data::take_over`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Update {
    /// The state is the same as before.
    Same,
    /// The data have taken over the changes of the state.
    Changed,
    /// The state has other elements or texts, so the data could not take over its changes. The data are
    /// unchanged.
    Other,
}

/// Compares a value with the next items. Returns `None` if the value has another form, or properties that
/// data cannot keep. Otherwise returns true if a number, bool or character differs.
fn compare(items: &mut Iter<'_, Item>, value: &Dynamic) -> Option<bool> {
    if value.is_shared() || value.is_read_only() || value.tag() != 0 {
        return None;
    }
    match items.next()? {
        Item::Nothing => value.is_unit().then_some(false),
        Item::Bool(known) => Some(value.as_bool().ok()? != *known),
        Item::Int(known) => Some(value.as_int().ok()? != *known),
        Item::Float(known) => Some(value.as_float().ok()?.to_bits() != *known),
        Item::Char(known) => Some(value.as_char().ok()? != *known),
        Item::Text(known) => (*value.as_immutable_string_ref().ok()? == known.as_str()).then_some(false),
        Item::Bytes(known) => (*value.read_lock::<Blob>()? == *known).then_some(false),
        Item::Array(count) => {
            let array = value.read_lock::<Array>()?;
            if array.len() != *count as usize {
                return None;
            }
            array.iter().try_fold(false, |any, value| Some(any | compare(items, value)?))
        }
        Item::Map(count) => {
            let map = value.read_lock::<Map>()?;
            if map.len() != *count as usize {
                return None;
            }
            map.iter().try_fold(false, |any, (key, value)| match items.next()? {
                Item::Text(known) if known == key.as_str() => Some(any | compare(items, value)?),
                _ => None,
            })
        }
    }
}

/// Copies the numbers, bools and characters of a value to items. The value must have the form of the items;
/// [`compare`] has checked this.
fn copy(items: &mut IterMut<'_, Item>, value: &Dynamic) {
    match items.next() {
        Some(Item::Bool(known)) => *known = value.as_bool().unwrap_or(*known),
        Some(Item::Int(known)) => *known = value.as_int().unwrap_or(*known),
        Some(Item::Float(known)) => *known = value.as_float().map_or(*known, f64::to_bits),
        Some(Item::Char(known)) => *known = value.as_char().unwrap_or(*known),
        Some(Item::Array(_)) => {
            if let Some(array) = value.read_lock::<Array>() {
                array.iter().for_each(|value| copy(items, value));
            }
        }
        Some(Item::Map(_)) => {
            if let Some(map) = value.read_lock::<Map>() {
                for value in map.values() {
                    // The key.
                    items.next();
                    copy(items, value);
                }
            }
        }
        Some(Item::Nothing | Item::Text(_) | Item::Bytes(_)) | None => {}
    }
}

/// Size of a value, counted in the same way as in the engine. This count is necessary because the engine checks its
/// limits only in some operations: for `this.text = text`, but not for `this["text"] = text`.
#[derive(Clone, Copy, Default)]
struct Size {
    elements: usize,
    entries: usize,
    text_bytes: usize,
    key_bytes: usize,
}

impl Size {
    fn add_elements(&mut self, count: usize) -> Result<(), String> {
        add(&mut self.elements, count, LARGEST_ARRAY, most_elements)
    }

    fn add_entries(&mut self, count: usize) -> Result<(), String> {
        add(&mut self.entries, count, LARGEST_MAP, most_entries)
    }

    fn add_text(&mut self, bytes: usize) -> Result<(), String> {
        add(&mut self.text_bytes, bytes, LONGEST_TEXT, most_texts)
    }

    fn add_key(&mut self, bytes: usize) -> Result<(), String> {
        let most = || format!("a value has at most {MOST_KEY_BYTES} bytes in all keys of its maps");
        add(&mut self.key_bytes, bytes, MOST_KEY_BYTES, most)
    }
}

/// Adds to a sum.
///
/// # Errors
/// The sum exceeds `most`; `limit` describes this limit.
fn add(sum: &mut usize, count: usize, most: usize, limit: impl Fn() -> String) -> Result<(), String> {
    *sum += count;
    if *sum <= most { Ok(()) } else { Err(limit()) }
}

/// Returns the item of a value. For an array or a map, this is only its head.
fn item(value: &Dynamic) -> Result<Item, String> {
    if value.is_unit() {
        return Ok(Item::Nothing);
    }
    let number = value.as_bool().map(Item::Bool).or_else(|_| value.as_int().map(Item::Int));
    let number = number.or_else(|_| value.as_float().map(|float| Item::Float(float.to_bits())));
    if let Ok(item) = number.or_else(|_| value.as_char().map(Item::Char)) {
        return Ok(item);
    }
    if let Some(bytes) = value.read_lock::<Blob>() {
        return Ok(Item::Bytes(bytes.to_vec()));
    }
    match value.as_immutable_string_ref() {
        Ok(text) => Ok(Item::Text(text.to_string())),
        Err(other) => Err(format!(
            "a snapshot cannot keep a value of type {other}; keep numbers, texts, arrays and maps"
        )),
    }
}

/// Returns the next value; `None` if there is no value within the limits.
fn read(items: &mut Iter<'_, Item>, depth: usize) -> Option<Dynamic> {
    if depth > DEEPEST {
        return None;
    }
    Some(match items.next()? {
        Item::Nothing => Dynamic::UNIT,
        Item::Bool(value) => (*value).into(),
        Item::Int(value) => Dynamic::from_int(INT::from(*value)),
        Item::Float(bits) => f64::from_bits(*bits).into(),
        Item::Char(value) => (*value).into(),
        Item::Text(text) => text.as_str().into(),
        Item::Bytes(bytes) => Dynamic::from_blob(bytes.clone()),
        Item::Array(count) => {
            let mut array = Array::new();
            for _ in 0..*count {
                array.push(read(items, depth + 1)?);
            }
            array.into()
        }
        Item::Map(count) => {
            let mut map = Map::new();
            for _ in 0..*count {
                let Item::Text(key) = items.next()? else { return None };
                let key = key.as_str().into();
                map.insert(key, read(items, depth + 1)?);
            }
            map.into()
        }
    })
}

impl SnapshotFields for Data {
    fn save(&self, to: &mut Saving) {
        to.value(&self.0);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        *self = Data(from.value()?);
        from.check(self.is_whole(), "value of a script")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nested(depth: usize) -> Dynamic {
        (0..depth).fold(Dynamic::UNIT, |inner, _| vec![inner].into())
    }

    #[test]
    fn values_come_back_as_they_were() {
        let map = Map::from([
            ("text".into(), "ä".into()),
            ("numbers".into(), vec![Dynamic::from_int(-1), 0.5.into(), 'x'.into(), true.into()].into()),
            ("bytes".into(), Dynamic::from_blob(vec![1, 2])),
            ("none".into(), Dynamic::UNIT),
        ]);
        let data = Data::of(&map.into()).unwrap();
        let mut saving = Saving::default();
        data.save(&mut saving);
        let mut back = Data::empty_map();
        back.restore(&mut Saved::new(saving.bytes())).unwrap();
        assert_eq!((&back, Data::of(&back.value()).unwrap()), (&data, data.clone()));
    }

    /// Data take over changes that do not change their form. The result equals that of new data.
    #[test]
    fn changed_numbers_are_taken_over() {
        let map = |number: INT, letter: char, text: &str, array: Vec<INT>| -> Dynamic {
            let array: Array = array.into_iter().map(Dynamic::from_int).collect();
            let inner = Map::from([("letter".into(), letter.into()), ("ratio".into(), 0.5.into())]);
            Map::from([
                ("array".into(), array.into()),
                ("inner".into(), inner.into()),
                ("number".into(), number.into()),
                ("text".into(), text.into()),
            ])
            .into()
        };
        let first = map(1, 'a', "x", vec![1, 2]);
        let mut tagged = first.clone();
        tagged.set_tag(1);
        for (value, expected) in [
            (first.clone(), Update::Same),
            (map(2, 'b', "x", vec![1, 3]), Update::Changed),
            (map(1, 'a', "y", vec![1, 2]), Update::Other),
            (map(1, 'a', "x", vec![1]), Update::Other),
            (map(1, 'a', "x", vec![1, 2, 3]), Update::Other),
            (Map::new().into(), Update::Other),
            (Dynamic::UNIT, Update::Other),
            (tagged, Update::Other),
        ] {
            let before = Data::of(&first).unwrap();
            let mut data = before.clone();
            assert_eq!(data.take_over(&value), expected);
            let after = if expected == Update::Other { before } else { Data::of(&value).unwrap() };
            assert_eq!(data, after);
        }
        let mut array = Data::of(&vec![Dynamic::from_int(1), "x".into()].into()).unwrap();
        assert_eq!(array.values().len(), 2);
        assert_eq!(array.take_over(&vec![Dynamic::from_int(1), 7.into()].into()), Update::Other);
    }

    #[test]
    fn values_have_limits() {
        assert!(Data::of(&nested(DEEPEST)).is_ok());
        assert!(Data::of(&nested(DEEPEST + 1)).unwrap_err().contains("16 deep"));
        let refusal = |value: Dynamic| Data::of(&value).unwrap_err();
        let units = |count| -> Dynamic { vec![Dynamic::UNIT; count].into() };
        assert_eq!(refusal(units(LARGEST_ARRAY + 1)), most_elements());
        assert_eq!(refusal(vec![units(LARGEST_ARRAY / 2); 2].into()), most_elements());
        assert_eq!(refusal(vec![Dynamic::from_blob(vec![0; LARGEST_ARRAY])].into()), most_elements());
        let long: Array = vec!["x".repeat(LONGEST_TEXT / 2 + 1).into(); 2];
        assert_eq!(refusal(long.into()), most_texts());
        let map = |length: usize, count| -> Map {
            (0..count).map(|number| (format!("{number:0length$}").into(), Dynamic::UNIT)).collect()
        };
        assert_eq!(refusal(map(1, LARGEST_MAP + 1).into()), most_entries());
        assert!(refusal(map(200, LARGEST_MAP).into()).contains("65536 bytes in all keys"));
        // Values of the largest size come back from a snapshot.
        let mut largest = map(1, LARGEST_MAP - 1);
        largest.insert("array".into(), units(LARGEST_ARRAY));
        let data = Data::of(&largest.into()).unwrap();
        assert_eq!(data.0.len(), MOST_ITEMS);
        assert!(data.is_whole());
    }

    /// The items in a snapshot of an unknown author may end too early, be too many, or be nested without a
    /// limit.
    #[test]
    fn wrong_items_are_refused() {
        let deep = vec![Item::Array(1); 100_000];
        for items in
            [vec![], vec![Item::Array(1)], vec![Item::Map(1), Item::Int(1)], vec![Item::Int(1); 2], deep]
        {
            let mut saving = Saving::default();
            saving.value(&items);
            let restored = Data::empty_map().restore(&mut Saved::new(saving.bytes()));
            assert!(restored.is_err(), "{} items", items.len());
        }
    }
}
