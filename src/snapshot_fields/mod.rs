//! Snapshots of structures: their contents, and how to restore them.
//!
//! A structure mixes two kinds of data: data made from the plant file (views of registers, tables, names), and data
//! that change during the run. A snapshot contains only the second kind. A snapshot is restored into a structure that
//! was built from the same plant file, so data of the first kind are already there.
//!
//! [`snapshot_fields!`](macro@crate::snapshot_fields) names **each** field of a structure and declares whether it is
//! kept. A new field without a declaration is a compiler error instead of a snapshot with a missing field.
//!
//! Bytes may come from a file of an unknown author. Reading any bytes ends with a value or with [`Damaged`], and uses
//! at most memory in proportion to the length of the bytes.

mod saved;
mod sealed;

pub use saved::{Damaged, Saved, Saving};
pub(crate) use sealed::{read_format, save_header};
pub use sealed::{seal, unseal};

/// A value with changes that are part of a snapshot.
pub trait SnapshotFields {
    /// Appends the state of the value.
    fn save(&self, to: &mut Saving);

    /// Restores a state that a structure of the same type has saved. After an error the contents are undefined: they
    /// must be restored from another snapshot, or dropped.
    ///
    /// # Errors
    /// [`Damaged`]: the bytes are not the state of such a structure.
    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged>;
}

/// Declares the snapshot contents of a structure; each of its fields must be in one of the three lists.
///
/// - `values`: the field is written and read as a whole by `serde`.
/// - `parts`: the field implements [`SnapshotFields`] and is read into the existing value.
/// - `built`: the field was made from the plant file, or is empty between two events. It is not kept.
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

/// The unit type has no state.
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

/// The plant file decides whether a value is `Some`. A snapshot does not change `Some` to `None` or back.
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
