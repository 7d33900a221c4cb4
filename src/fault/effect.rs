//! Effect of a fault. The family of the fault's kind computes the effect from the values of the fault.

use core::any::Any;

/// Effect of a fault. The type of the content belongs to the family of the fault's kind, and only this family reads it.
pub struct Effect(Box<dyn Any + Send>);

impl Effect {
    /// Creates an effect from a value of the family's own type.
    pub fn new<T: Any + Send>(effect: T) -> Self {
        Effect(Box::new(effect))
    }

    /// Returns the effect as a `T`, if it has that type.
    #[inline]
    pub fn get<T: Any>(&self) -> Option<&T> {
        self.0.downcast_ref()
    }
}
