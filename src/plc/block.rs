//! Common parts of all function blocks: a name, declared pins, and a call for each PLC cycle.
//!
//! The macro `function_block` declares a block: from one declaration it makes the struct, the presets and the table of
//! pins. Code that finds blocks by name (scenarios, completions, tests of the documentation) uses the device's list of
//! [`BlockKind`]s.

use super::{Base, Pin, PinError, PinType, PinValue, Ram};
use crate::memory::{MemoryError, SharedRegs};
use core::any::{Any, TypeId};
use core::cell::RefCell;
use core::ops::DerefMut;
use std::collections::HashMap;
use std::rc::Rc;

/// A function block with its inputs and outputs.
pub trait FunctionBlock: Default + 'static {
    /// Name of the block in the manual.
    const NAME: &'static str;
    /// Inputs, outputs, and data that are both, in the order of the documentation.
    const PINS: &'static [Pin];
    /// The registers and variables that [`cycle`](Self::cycle) uses in addition to the pins.
    type Wires;

    /// Connects a block to the registers and variables at this place.
    ///
    /// # Errors
    /// The registers of the block do not fit at this place.
    fn connect(place: &BlockContext<'_>) -> Result<Self::Wires, MemoryError>;

    /// Returns the value of a pin; `None` if there is no such pin.
    fn pin(&self, wires: &Self::Wires, name: &str) -> Option<PinValue>;

    /// Mutable access to a pin; `None` if there is no such pin.
    fn pin_mut<'a>(&'a mut self, wires: &'a mut Self::Wires, name: &str) -> Option<&'a mut dyn PinType>;

    /// Runs one PLC cycle.
    fn cycle(&mut self, wires: &mut Self::Wires);
}

/// The place of a block.
pub struct BlockContext<'a> {
    /// The RAM of the PLC.
    pub ram: &'a Ram,
    /// Offset of the block's area in the RAM.
    pub offset: u32,
    /// Variables of the PLC program.
    pub variables: &'a Variables,
}

/// Variables of a PLC program through which blocks exchange data: one variable for each type.
#[derive(Default)]
pub struct Variables(RefCell<HashMap<TypeId, Rc<dyn Any>>>);

impl Variables {
    /// Returns the variable of a type.
    fn get<T: Default + 'static>(&self) -> Shared<T> {
        let mut variables = self.0.borrow_mut();
        let variable =
            variables.entry(TypeId::of::<T>()).or_insert_with(|| Rc::new(RefCell::new(T::default())));
        // `Variables` stores each variable under its type, so the downcast always succeeds.
        Shared(Rc::clone(variable).downcast().unwrap_or_default())
    }
}

/// A parameter of a block's `call`: registers, the board, or a shared variable.
pub trait Wire: Sized {
    /// The type that `call` gets.
    type CallView;

    /// Connects the parameter to the registers or variable at this place.
    ///
    /// # Errors
    /// The registers do not fit at this place.
    fn connect(place: &BlockContext<'_>) -> Result<Self, MemoryError>;

    /// Borrows the connected registers or variable for one call.
    fn lend(&mut self) -> impl DerefMut<Target = Self::CallView>;
}

impl<T: SharedRegs> Wire for Base<T> {
    type CallView = Self;

    fn connect(place: &BlockContext<'_>) -> Result<Self, MemoryError> {
        place.ram.at(place.offset)
    }

    fn lend(&mut self) -> impl DerefMut<Target = Self> {
        self
    }
}

/// The board. Its data are in the header page, not in registers.
impl Wire for Ram {
    type CallView = Self;

    fn connect(place: &BlockContext<'_>) -> Result<Self, MemoryError> {
        Ok(place.ram.clone())
    }

    fn lend(&mut self) -> impl DerefMut<Target = Self> {
        self
    }
}

/// A variable that several blocks of one PLC share.
pub struct Shared<T>(Rc<RefCell<T>>);

impl<T: Default + 'static> Wire for Shared<T> {
    type CallView = T;

    fn connect(place: &BlockContext<'_>) -> Result<Self, MemoryError> {
        Ok(place.variables.get())
    }

    fn lend(&mut self) -> impl DerefMut<Target = T> {
        self.0.borrow_mut()
    }
}

/// A connected block of any type.
pub trait BlockInstance {
    /// Returns the value of a pin; `None` if there is no such pin.
    fn get(&self, pin: &str) -> Option<PinValue>;

    /// Sets a pin; `None` if there is no such pin.
    fn set(&mut self, pin: &str, value: &PinValue) -> Option<Result<(), PinError>>;

    /// Runs one PLC cycle.
    fn cycle(&mut self);
}

struct Wired<B: FunctionBlock> {
    block: B,
    wires: B::Wires,
}

impl<B: FunctionBlock> BlockInstance for Wired<B> {
    fn get(&self, pin: &str) -> Option<PinValue> {
        self.block.pin(&self.wires, pin)
    }

    fn set(&mut self, pin: &str, value: &PinValue) -> Option<Result<(), PinError>> {
        Some(self.block.pin_mut(&mut self.wires, pin)?.set(value))
    }

    fn cycle(&mut self) {
        self.block.cycle(&mut self.wires);
    }
}

/// A kind of function block of a device, found by its name.
#[derive(Debug)]
pub struct BlockKind {
    /// Name of the block in the manual.
    pub name: &'static str,
    /// The structure that the block's area must have; `None` for blocks that belong to no area.
    pub structure: Option<&'static str>,
    /// Pins of the block.
    pub pins: &'static [Pin],
    make: fn(&BlockContext<'_>) -> Result<Box<dyn BlockInstance>, MemoryError>,
}

impl BlockKind {
    /// Returns the kind of block `B`. Its area must have the structure with this name.
    pub const fn of<B: FunctionBlock>(structure: Option<&'static str>) -> Self {
        BlockKind { name: B::NAME, structure, pins: B::PINS, make: make::<B> }
    }

    /// Creates a block with its presets.
    ///
    /// # Errors
    /// The registers of the block do not fit at this place.
    pub fn make(&self, place: &BlockContext<'_>) -> Result<Box<dyn BlockInstance>, MemoryError> {
        (self.make)(place)
    }

    /// True if the block has a pin with that name.
    pub fn has(&self, pin: &str) -> bool {
        self.pins.iter().any(|it| it.name == pin)
    }
}

fn make<B: FunctionBlock>(place: &BlockContext<'_>) -> Result<Box<dyn BlockInstance>, MemoryError> {
    Ok(Box::new(Wired { block: B::default(), wires: B::connect(place)? }))
}

/// Lists of blocks: `structure: blocks`, or `-: blocks` for blocks that belong to no area.
macro_rules! block_kinds {
    ($($structure:tt: $($block:ident)*;)*) => {
        &[$($($crate::plc::BlockKind::of::<$block>($crate::plc::block_kinds!(@ $structure)),)*)*]
    };
    (@ -) => { None };
    (@ $structure:literal) => { Some($structure) };
}

/// Declares a function block: its struct, its presets and its pins, from one text.
///
/// The block's name is followed by the parameters of `call`. Then come inputs with their presets that are not 0 or
/// FALSE, outputs, further program data for `call`, and the memory of the block between calls.
macro_rules! function_block {
    (@) => { Default::default() };
    (@ $preset:expr) => { $preset };
    (
        $(#[$doc:meta])*
        pub struct $name:ident($($wire:ident: $wire_type:ty),*) {
            $(in { $($(#[$in_doc:meta])* $in:ident: $in_type:ty $(= $in_preset:expr)?;)* })?
            $(out { $($(#[$out_doc:meta])* $out:ident: $out_type:ty $(= $out_preset:expr)?;)* })?
            $(in_out { $($data:ident: $data_type:ty;)* })?
            $(internal: $internal:ty;)?
        }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Debug)]
        pub struct $name {
            $($($(#[$in_doc])* pub $in: $in_type,)*)?
            $($($(#[$out_doc])* pub $out: $out_type,)*)?
            $(#[doc(hidden)] pub internal: $internal,)?
        }

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $($($in: $crate::plc::function_block!(@ $($in_preset)?),)*)?
                    $($($out: $crate::plc::function_block!(@ $($out_preset)?),)*)?
                    $(internal: <$internal>::default(),)?
                }
            }
        }

        #[allow(unused_variables, reason = "not every block has wires, or data")]
        impl $crate::plc::FunctionBlock for $name {
            const NAME: &'static str = stringify!($name);
            const PINS: &'static [$crate::plc::Pin] = &[
                $($($crate::plc::Pin::input(stringify!($in)),)*)?
                $($($crate::plc::Pin::output(stringify!($out)),)*)?
                $($($crate::plc::Pin::in_out(stringify!($data)),)*)?
            ];
            type Wires = ($($wire_type,)* $($(Box<$data_type>,)*)?);

            fn connect(place: &$crate::plc::BlockContext<'_>) -> Result<Self::Wires, $crate::memory::MemoryError> {
                Ok((
                    $(<$wire_type as $crate::plc::Wire>::connect(place)?,)*
                    $($(Box::new(<$data_type as zerocopy::FromZeros>::new_zeroed()),)*)?
                ))
            }

            fn pin(&self, wires: &Self::Wires, name: &str) -> Option<$crate::plc::PinValue> {
                let ($($wire,)* $($($data,)*)?) = wires;
                match name {
                    $($(stringify!($in) => Some($crate::plc::PinType::get(&self.$in)),)*)?
                    $($(stringify!($out) => Some($crate::plc::PinType::get(&self.$out)),)*)?
                    $($(stringify!($data) => Some($crate::plc::PinType::get(&**$data)),)*)?
                    _ => None,
                }
            }

            fn pin_mut<'a>(
                &'a mut self,
                wires: &'a mut Self::Wires,
                name: &str,
            ) -> Option<&'a mut dyn $crate::plc::PinType> {
                let ($($wire,)* $($($data,)*)?) = wires;
                match name {
                    $($(stringify!($in) => Some(&mut self.$in),)*)?
                    $($(stringify!($out) => Some(&mut self.$out),)*)?
                    $($(stringify!($data) => Some(&mut **$data),)*)?
                    _ => None,
                }
            }

            fn cycle(&mut self, wires: &mut Self::Wires) {
                let ($($wire,)* $($($data,)*)?) = wires;
                self.call($(&mut *$crate::plc::Wire::lend($wire),)* $($(&mut **$data,)*)?);
            }
        }
    };
}

pub(crate) use {block_kinds, function_block};
