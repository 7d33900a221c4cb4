//! What a snapshot holds of a structure, and how it is read back into one.
//!
//! A structure mixes what was made of the plant file (views of registers, tables, names) and what has happened since. A
//! snapshot holds the latter only. It is read into a structure that was built of the same plant file, so that what was
//! made of it stays as it is.
//!
//! [`snapshot_fields!`](macro@crate::snapshot_fields) names **each** field of a structure and says whether it is kept: who adds a field and does not
//! say so gets an error of the compiler instead of a snapshot in which something is missing.
//!
//! Bytes may come from a file that somebody else has made. Whatever is in them, reading ends with a value or with
//! [`Damaged`], in memory that is bounded by the length of the bytes.

mod saved;
mod sealed;

pub use saved::{Damaged, Saved, Saving};
pub use sealed::{seal, unseal};

/// Something of which a snapshot holds what has happened to it.
pub trait SnapshotFields {
    /// Appends its state.
    fn save(&self, to: &mut Saving);

    /// Takes over a state that one like it has saved. After an error it is neither what it was nor what was saved: it is to
    /// be restored from another snapshot, or dropped.
    ///
    /// # Errors
    /// [`Damaged`]: the bytes are not the state of one like it.
    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged>;
}

/// Says what a snapshot holds of a structure; each of its fields must stand in one of the three lists.
///
/// - `values`: the field is written and read as a whole by `serde`.
/// - `parts`: the field has a [`SnapshotFields`] of its own, which is read into the one that is there.
/// - `built`: the field was made of the plant file, or is empty between two events. Nothing is kept.
///
/// ```
/// # use commram::snapshot_fields;
/// # use commram::snapshot_fields::{Saved, Saving, SnapshotFields};
/// struct Pump {
///     name: String,
///     speed: u16,
///     starts: u32,
/// }
/// snapshot_fields!(Pump { values: speed, starts; built: name });
///
/// let mut saving = Saving::default();
/// Pump { name: "p1".into(), speed: 1500, starts: 3 }.save(&mut saving);
/// let mut other = Pump { name: "p1".into(), speed: 0, starts: 0 };
/// other.restore(&mut Saved::new(saving.bytes()))?;
/// assert_eq!((other.speed, other.starts), (1500, 3));
/// # Ok::<(), commram::snapshot_fields::Damaged>(())
/// ```
#[macro_export]
macro_rules! snapshot_fields {
    ($(where [$($generics:tt)*])? $name:ty {
        $(values: $($value:ident),+ $(;)?)? $(parts: $($part:ident),+ $(;)?)? $(built: $($built:tt),+ $(;)?)?
    }) => {
        impl$(<$($generics)*>)? $crate::snapshot_fields::SnapshotFields for $name {
            #[allow(unused_variables, reason = "there may be nothing to keep")]
            fn save(&self, to: &mut $crate::snapshot_fields::Saving) {
                let Self { $($($value,)+)? $($($part,)+)? $($($built: _,)+)? } = self;
                $($(to.value($value);)+)?
                $($($crate::snapshot_fields::SnapshotFields::save($part, to);)+)?
            }

            #[allow(unused_variables, reason = "there may be nothing to keep")]
            fn restore(
                &mut self,
                from: &mut $crate::snapshot_fields::Saved<'_>,
            ) -> ::core::result::Result<(), $crate::snapshot_fields::Damaged> {
                let Self { $($($value,)+)? $($($part,)+)? $($($built: _,)+)? } = self;
                $($(*$value = from.value()?;)+)?
                $($($crate::snapshot_fields::SnapshotFields::restore($part, from)?;)+)?
                Ok(())
            }
        }
    };
}

/// Nothing has happened to it.
impl SnapshotFields for () {
    fn save(&self, _: &mut Saving) {}

    fn restore(&mut self, _: &mut Saved<'_>) -> Result<(), Damaged> {
        Ok(())
    }
}

impl<T: SnapshotFields> SnapshotFields for [T] {
    fn save(&self, to: &mut Saving) {
        to.value(&self.len());
        self.iter().for_each(|part| part.save(to));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        from.expect(self.len(), "number of parts")?;
        self.iter_mut().try_for_each(|part| part.restore(from))
    }
}

impl<T: SnapshotFields> SnapshotFields for Vec<T> {
    fn save(&self, to: &mut Saving) {
        self.as_slice().save(to);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.as_mut_slice().restore(from)
    }
}

impl<T: SnapshotFields, const N: usize> SnapshotFields for [T; N] {
    fn save(&self, to: &mut Saving) {
        self.iter().for_each(|part| part.save(to));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.iter_mut().try_for_each(|part| part.restore(from))
    }
}

/// Whether there is one is what the plant file says.
impl<T: SnapshotFields> SnapshotFields for Option<T> {
    fn save(&self, to: &mut Saving) {
        self.iter().for_each(|part| part.save(to));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.iter_mut().try_for_each(|part| part.restore(from))
    }
}

impl<T: SnapshotFields + ?Sized> SnapshotFields for Box<T> {
    fn save(&self, to: &mut Saving) {
        self.as_ref().save(to);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.as_mut().restore(from)
    }
}
