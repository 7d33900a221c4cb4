//! Functions that read and set variables.

use super::border::{Instance, Refused, Status, exported, read, with, write};
use super::instance::Mode;
use commram::fmi::{Value, VariableType};

/// A type of values.
trait Typed: Copy {
    const KIND: VariableType;
    fn of(value: Value) -> Option<Self>;
    fn value(self) -> Value;
}

macro_rules! typed {
    ($($ty:ty as $kind:ident),*) => {$(
        impl Typed for $ty {
            const KIND: VariableType = VariableType::$kind;

            fn of(value: Value) -> Option<Self> {
                match value {
                    Value::Integer(value) => value.try_into().ok(),
                    _ => None,
                }
            }

            fn value(self) -> Value {
                Value::Integer(self.into())
            }
        }
    )*};
}
typed!(i8 as I8, u8 as U8, i16 as I16, u16 as U16, i32 as I32, u32 as U32);

impl Typed for f64 {
    const KIND: VariableType = VariableType::F64;

    fn of(value: Value) -> Option<Self> {
        match value {
            Value::Float(value) => Some(value),
            _ => None,
        }
    }

    fn value(self) -> Value {
        Value::Float(self)
    }
}

impl Typed for bool {
    const KIND: VariableType = VariableType::Bool;

    fn of(value: Value) -> Option<Self> {
        match value {
            Value::Boolean(value) => Some(value),
            _ => None,
        }
    }

    fn value(self) -> Value {
        Value::Boolean(self)
    }
}

/// Checks that there are as many values as references, because no variable is an array.
fn are_as_many(references: usize, values: usize) -> Result<(), Refused> {
    match references == values {
        true => Ok(()),
        false => Err(Refused(format!("{values} values for {references} variables; each has one"))),
    }
}

/// # Safety
/// `references` points to `count` references, and `values` to `value_count` values.
unsafe fn get<T: Typed>(
    instance: Instance,
    references: *const u32,
    count: usize,
    values: *mut T,
    value_count: usize,
) -> Status {
    with(instance, |it| {
        are_as_many(count, value_count)?;
        // SAFETY: by the contract of this function.
        let (references, values) = unsafe { (read(references, count)?, write(values, count)?) };
        for (reference, to) in references.iter().zip(values) {
            let value = it.unit.get(*reference, T::KIND)?;
            *to = T::of(value).ok_or_else(|| Refused(format!("variable {reference} has no value")))?;
        }
        Ok(())
    })
}

/// # Safety
/// `references` points to `count` references, and `values` to `value_count` values.
unsafe fn set<T: Typed>(
    instance: Instance,
    references: *const u32,
    count: usize,
    values: *const T,
    value_count: usize,
) -> Status {
    with(instance, |it| {
        it.is_in(&[Mode::Instantiated, Mode::Initializing, Mode::Stepping], "fmi3Set")?;
        are_as_many(count, value_count)?;
        // SAFETY: by the contract of this function.
        let (references, values) = unsafe { (read(references, count)?, read(values, count)?) };
        let values = values.iter().map(|value| value.value());
        Ok(it.unit.set_all(T::KIND, references.iter().copied().zip(values))?)
    })
}

exported! {
    fn fmi3GetFloat64(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *mut f64,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { get(instance, references, count, values, value_count) }
    }

    fn fmi3SetFloat64(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *const f64,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { set(instance, references, count, values, value_count) }
    }

    fn fmi3GetInt8(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *mut i8,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { get(instance, references, count, values, value_count) }
    }

    fn fmi3SetInt8(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *const i8,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { set(instance, references, count, values, value_count) }
    }

    fn fmi3GetUInt8(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *mut u8,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { get(instance, references, count, values, value_count) }
    }

    fn fmi3SetUInt8(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *const u8,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { set(instance, references, count, values, value_count) }
    }

    fn fmi3GetInt16(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *mut i16,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { get(instance, references, count, values, value_count) }
    }

    fn fmi3SetInt16(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *const i16,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { set(instance, references, count, values, value_count) }
    }

    fn fmi3GetUInt16(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *mut u16,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { get(instance, references, count, values, value_count) }
    }

    fn fmi3SetUInt16(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *const u16,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { set(instance, references, count, values, value_count) }
    }

    fn fmi3GetInt32(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *mut i32,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { get(instance, references, count, values, value_count) }
    }

    fn fmi3SetInt32(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *const i32,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { set(instance, references, count, values, value_count) }
    }

    fn fmi3GetUInt32(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *mut u32,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { get(instance, references, count, values, value_count) }
    }

    fn fmi3SetUInt32(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *const u32,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { set(instance, references, count, values, value_count) }
    }

    fn fmi3GetBoolean(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *mut bool,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { get(instance, references, count, values, value_count) }
    }

    fn fmi3SetBoolean(
        instance: Instance,
        references: *const u32,
        count: usize,
        values: *const bool,
        value_count: usize,
    ) -> Status {
        // SAFETY: the caller guarantees the lengths of the arrays.
        unsafe { set(instance, references, count, values, value_count) }
    }
}
