//! Saves identifiers as numbers in a snapshot, because their types belong to another crate. Used as
//! `#[serde(with = "crate::can::kept")]`.

use embedded_can::{ExtendedId, Id, StandardId};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A type with identifiers, and its form in snapshots.
pub(crate) trait Kept: Sized {
    type Form: Serialize + for<'de> Deserialize<'de>;

    fn form(&self) -> Self::Form;

    /// Converts the form back; `None` if it is invalid.
    fn of(form: Self::Form) -> Option<Self>;
}

impl Kept for StandardId {
    type Form = u16;

    fn form(&self) -> u16 {
        self.as_raw()
    }

    fn of(form: u16) -> Option<Self> {
        StandardId::new(form)
    }
}

/// The form consists of the number, and of a flag that is true if the number has 29 bits.
impl Kept for Id {
    type Form = (bool, u32);

    fn form(&self) -> (bool, u32) {
        match self {
            Id::Standard(id) => (false, id.as_raw().into()),
            Id::Extended(id) => (true, id.as_raw()),
        }
    }

    fn of((is_extended, number): (bool, u32)) -> Option<Self> {
        if is_extended {
            ExtendedId::new(number).map(Id::Extended)
        } else {
            StandardId::new(number.try_into().ok()?).map(Id::Standard)
        }
    }
}

impl<T: Kept> Kept for Option<T> {
    type Form = Option<T::Form>;

    fn form(&self) -> Self::Form {
        self.as_ref().map(T::form)
    }

    fn of(form: Self::Form) -> Option<Self> {
        match form {
            Some(form) => T::of(form).map(Some),
            None => Some(None),
        }
    }
}

impl<T: Kept> Kept for Vec<T> {
    type Form = Vec<T::Form>;

    fn form(&self) -> Self::Form {
        self.iter().map(T::form).collect()
    }

    fn of(form: Self::Form) -> Option<Self> {
        form.into_iter().map(T::of).collect()
    }
}

impl<T: Kept, const N: usize> Kept for [T; N] {
    type Form = Vec<T::Form>;

    fn form(&self) -> Self::Form {
        self.iter().map(T::form).collect()
    }

    fn of(form: Self::Form) -> Option<Self> {
        Vec::of(form)?.try_into().ok()
    }
}

pub(crate) fn serialize<T: Kept, S: Serializer>(it: &T, serializer: S) -> Result<S::Ok, S::Error> {
    it.form().serialize(serializer)
}

pub(crate) fn deserialize<'de, T: Kept, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    T::of(T::Form::deserialize(deserializer)?).ok_or_else(|| D::Error::custom("no identifier"))
}
