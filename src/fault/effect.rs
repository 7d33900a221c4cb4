//! Effect of a fault, as its family defines it from the values.

use core::any::Any;

/// Effect of a fault, in a type of its family. Only that family reads it.
pub struct Effect(Box<dyn Any + Send>);

impl Effect {
    /// An effect of the family's own type.
    pub fn new<T: Any + Send>(effect: T) -> Self {
        Effect(Box::new(effect))
    }

    /// Returns the effect as a `T`, if it has that type.
    #[inline]
    pub fn get<T: Any>(&self) -> Option<&T> {
        self.0.downcast_ref()
    }
}
