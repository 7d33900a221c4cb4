//! What a family makes of a fault's values.

use core::any::Any;

/// What a fault does, in a type of the family that has it. Only that family looks into it.
pub struct Effect(Box<dyn Any + Send>);

impl Effect {
    /// An effect of the family's own type.
    pub fn new<T: Any + Send>(effect: T) -> Self {
        Effect(Box::new(effect))
    }

    /// It as what it is, if that is a `T`.
    #[inline]
    pub fn get<T: Any>(&self) -> Option<&T> {
        self.0.downcast_ref()
    }
}
