//! Frames and acceptance filters as values of a script.

use crate::can::{ExtendedId, Filter, Frame, Id, Payload, StandardId};
use rhai::{Array, Blob, Dynamic, INT, Map};

/// Most filters of a port.
const MOST_FILTERS: usize = 64;
/// Keys of a frame.
const OF_FRAME: [&str; 5] = ["id", "extended", "remote", "length", "data"];
/// Keys of a filter.
const OF_FILTER: [&str; 3] = ["id", "extended", "mask"];

/// Returns a frame as a map with the keys `id`, `extended`, `remote`, `length` and `data`.
pub(super) fn value_of(frame: &Frame) -> Dynamic {
    let field = frame.arbitration();
    let byte = |byte: &u8| Dynamic::from_int(INT::from(*byte));
    let data: Array = frame.payload().data().iter().map(byte).collect();
    let mut map = Map::new();
    map.insert("id".into(), Dynamic::from_int(INT::from(field.number())));
    map.insert("extended".into(), field.is_extended().into());
    map.insert("remote".into(), field.is_remote().into());
    map.insert("length".into(), Dynamic::from_int(frame.length() as INT));
    map.insert("data".into(), data.into());
    map.into()
}

/// Returns a data frame with an identifier of 11 bits.
///
/// # Errors
/// The identifier or the data do not fit a frame.
pub(super) fn data_frame(id: INT, data: &Dynamic) -> Result<Frame, String> {
    Ok(Frame::new(identifier(id, false)?, payload(data)?))
}

/// Returns the frame that a map describes. A missing `data` means no data. A missing `length` is the length
/// of the data, or 0 in a remote frame.
///
/// # Errors
/// A key is missing or unknown, or its value does not fit a frame.
pub(super) fn frame_of(map: &Map) -> Result<Frame, String> {
    check_keys(map, &OF_FRAME, "a frame")?;
    let id = identifier(number(map, "id")?.ok_or("a frame needs its key `id`")?, flag(map, "extended")?)?;
    let data = map.get("data").map_or(Ok(Payload::EMPTY), payload)?;
    let length = number(map, "length")?;
    if flag(map, "remote")? {
        if !data.is_empty() {
            return Err("a remote frame has a `length` and no `data`".to_owned());
        }
        let frame = length.map_or(Some(0), |length| usize::try_from(length).ok());
        let frame = frame.and_then(|length| Frame::remote(id, length));
        return frame.ok_or_else(|| "the `length` of a frame is 0 to 8".to_owned());
    }
    match length {
        Some(length) if length != data.len() as INT => {
            Err(format!("`length` is {length}, but `data` has {} bytes; leave out `length`", data.len()))
        }
        _ => Ok(Frame::new(id, data)),
    }
}

/// Returns the filters that an array describes. Its elements are identifiers of 11 bits, or maps with `id`,
/// `extended` and `mask`.
///
/// # Errors
/// An element is not a filter, or there are too many elements.
pub(super) fn filters_of(all: &Array) -> Result<Vec<Filter>, String> {
    if all.len() > MOST_FILTERS {
        return Err(format!("{} filters; a port has at most {MOST_FILTERS}", all.len()));
    }
    all.iter().map(filter_of).collect()
}

fn filter_of(value: &Dynamic) -> Result<Filter, String> {
    if let Ok(id) = value.as_int() {
        return Ok(Filter::exactly(identifier(id, false)?));
    }
    let Some(map) = value.read_lock::<Map>() else {
        return Err("a filter is an identifier, or a map as #{ id: 0x200, mask: 0x7F0 }".to_owned());
    };
    check_keys(&map, &OF_FILTER, "a filter")?;
    let id = identifier(number(&map, "id")?.ok_or("a filter needs its key `id`")?, flag(&map, "extended")?)?;
    match number(&map, "mask")?.map(u32::try_from) {
        None => Ok(Filter::exactly(id)),
        Some(Ok(mask)) => Ok(Filter::masked(id, mask)),
        Some(Err(_)) => Err("the `mask` of a filter is at most 16#1FFFFFFF".to_owned()),
    }
}

fn check_keys(map: &Map, known: &[&str], what: &str) -> Result<(), String> {
    match map.keys().find(|key| !known.contains(&key.as_str())) {
        None => Ok(()),
        Some(key) => Err(format!("{what} has no key `{key}`; its keys: {}", known.join(", "))),
    }
}

fn number(map: &Map, key: &str) -> Result<Option<INT>, String> {
    map.get(key).map(|value| value.as_int().map_err(|_| format!("`{key}` is a number"))).transpose()
}

fn flag(map: &Map, key: &str) -> Result<bool, String> {
    map.get(key).map_or(Ok(false), |value| value.as_bool().map_err(|_| format!("`{key}` is true or false")))
}

fn identifier(id: INT, is_extended: bool) -> Result<Id, String> {
    let raw = u32::try_from(id).ok();
    if is_extended {
        let id = raw.and_then(ExtendedId::new).map(Id::Extended);
        return id.ok_or_else(|| "an identifier of 29 bits is 0 to 16#1FFFFFFF".to_owned());
    }
    let short = raw.and_then(|raw| StandardId::new(raw.try_into().ok()?)).map(Id::Standard);
    short.ok_or_else(|| {
        format!("16#{id:X} is no identifier of 11 bits (0 to 16#7FF); for 29 bits set `extended: true`")
    })
}

/// Returns the bytes of an array of numbers, or of a blob.
fn payload(data: &Dynamic) -> Result<Payload, String> {
    let bytes = if let Some(blob) = data.read_lock::<Blob>() {
        blob.clone()
    } else if let Some(array) = data.read_lock::<Array>() {
        let byte = |value: &Dynamic| value.as_int().ok().and_then(|number| u8::try_from(number).ok());
        let bytes: Option<Vec<u8>> = array.iter().map(byte).collect();
        bytes.ok_or("`data` is an array of bytes, 0 to 255")?
    } else {
        return Err("`data` is an array of bytes, 0 to 255".to_owned());
    };
    Payload::new(&bytes).ok_or_else(|| format!("{} bytes of data; a frame has at most 8", bytes.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::reference;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn a_received_frame_can_be_sent(frame in reference::frame()) {
            let map = value_of(&frame).cast::<Map>();
            prop_assert_eq!(frame_of(&map), Ok(frame));
            if !frame.arbitration().is_remote() && !frame.arbitration().is_extended() {
                let id = INT::from(frame.arbitration().number());
                prop_assert_eq!(data_frame(id, &map["data"]), Ok(frame));
            }
        }
    }

    /// Evaluates a value of the language.
    fn value(text: &str) -> Dynamic {
        rhai::Engine::new().eval(text).unwrap()
    }

    #[test]
    fn wrong_frames_are_refused() {
        for (text, error) in [
            ("#{ data: [1] }", "needs its key `id`"),
            ("#{ id: 1, dat: [1] }", "no key `dat`; its keys: id, extended, remote, length, data"),
            ("#{ id: 0x800 }", "16#800 is no identifier of 11 bits"),
            ("#{ id: -1 }", "is no identifier of 11 bits"),
            ("#{ id: 0x20000000, extended: true }", "0 to 16#1FFFFFFF"),
            ("#{ id: \"1\" }", "`id` is a number"),
            ("#{ id: 1, remote: 1 }", "`remote` is true or false"),
            ("#{ id: 1, data: [256] }", "0 to 255"),
            ("#{ id: 1, data: 5 }", "0 to 255"),
            ("#{ id: 1, data: [0, 0, 0, 0, 0, 0, 0, 0, 0] }", "9 bytes of data"),
            ("#{ id: 1, length: 2, data: [1] }", "`length` is 2, but `data` has 1 bytes"),
            ("#{ id: 1, remote: true, data: [1] }", "no `data`"),
            ("#{ id: 1, remote: true, length: 9 }", "0 to 8"),
            ("#{ id: 1, remote: true, length: -1 }", "0 to 8"),
        ] {
            let found = frame_of(&value(text).cast()).unwrap_err();
            assert!(found.contains(error), "{text}: {found}");
        }
    }

    #[test]
    fn filters_are_identifiers_or_masks() {
        let filters = |text: &str| filters_of(&value(text).cast());
        let standard = StandardId::new(0x200).unwrap();
        let extended = ExtendedId::new(0x200).unwrap();
        let all = "[0x200, #{ id: 0x200, mask: 0x7F0 }, #{ id: 0x200, extended: true }]";
        let expected =
            [Filter::exactly(standard), Filter::masked(standard, 0x7F0), Filter::exactly(extended)];
        assert_eq!(filters(all), Ok(expected.to_vec()));
        for (text, error) in [
            ("[\"x\"]", "a filter is an identifier"),
            ("[#{ mask: 1 }]", "needs its key `id`"),
            ("[#{ id: 1, masks: 1 }]", "no key `masks`"),
            ("[#{ id: 1, mask: -1 }]", "at most 16#1FFFFFFF"),
            ("[0x800]", "11 bits"),
        ] {
            let found = filters(text).unwrap_err();
            assert!(found.contains(error), "{text}: {found}");
        }
        assert!(
            filters_of(&vec![Dynamic::from_int(1); MOST_FILTERS + 1]).unwrap_err().contains("at most 64")
        );
    }
}
