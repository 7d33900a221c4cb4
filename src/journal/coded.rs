//! Events encoded as three words. The running hash, the count of equal events, and the channel use the words.
//!
//! First word: bits 0-7 are the number of the [`EventKind`], bits 8-15 the number of the port, bits 16-31 the index of
//! the device or bus. The upper 32 bits of the first word and the other two words contain the fields of the kind, one
//! [`Part`] after the other. [`event_kinds!`](crate::event_kinds!) makes the encoder and the decoder from one list of
//! fields.

use super::event::{Origin, Source};
use super::kind::EventKind;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::layout::RegisterPhase;

/// An event as numbers. Equal events have equal words, and different events have different words.
pub type Words = [u64; 3];

/// Number of 32-bit halves that contain the fields of the kind.
const HALVES: usize = 5;

/// An event kind that can be encoded as words and decoded.
pub trait EventCodec: Copy + 'static {
    /// The kind of this event.
    const KIND: &'static EventKind;

    /// Encodes the event as words.
    fn words(&self) -> Words;

    /// Decodes the words of an event of this kind; `None` if the words are invalid. Ignores bits that the kind does not
    /// use.
    fn read(words: Words) -> Option<Self>;

    /// Returns the device or bus of the event.
    fn source(&self) -> Source;
}

/// A field of an event kind.
pub trait Part: Copy {
    /// Appends the field to the words of an event.
    fn put(self, packer: &mut Packer);

    /// Reads the field from the words; `None` if the number has no meaning.
    fn take(unpacker: &mut Unpacker) -> Option<Self>;
}

/// Puts parts into words.
pub struct Packer {
    first: u64,
    halves: [u32; HALVES],
    used: usize,
}

impl Packer {
    /// Creates the words of an event of this kind. The fields are added later. `index` and `number` are the location of
    /// the event.
    #[inline]
    pub fn new(kind: &EventKind, index: u16, number: u8) -> Self {
        let first = u64::from(kind.number()) | u64::from(number) << 8 | u64::from(index) << 16;
        Packer { first, halves: [0; HALVES], used: 0 }
    }

    /// Appends a number. An event has room for five numbers.
    #[inline]
    pub fn put(&mut self, number: u32) {
        debug_assert!(self.used < HALVES, "an event has five numbers at most");
        if let Some(half) = self.halves.get_mut(self.used) {
            *half = number;
        }
        self.used += 1;
    }

    /// Returns the words with all parts.
    #[inline]
    pub fn words(self) -> Words {
        let pair = |high: u32, low: u32| u64::from(high) << 32 | u64::from(low);
        let [first, second, third, fourth, fifth] = self.halves;
        [self.first | u64::from(first) << 32, pair(third, second), pair(fifth, fourth)]
    }
}

/// Reads parts from words.
pub struct Unpacker {
    first: u64,
    halves: [u32; HALVES],
    used: usize,
}

impl Unpacker {
    /// Begins with the first part.
    #[inline]
    pub fn new([first, second, third]: Words) -> Self {
        let high = |word: u64| (word >> 32) as u32;
        let halves = [high(first), second as u32, high(second), third as u32, high(third)];
        Unpacker { first, halves, used: 0 }
    }

    /// Returns the index of the device or bus.
    #[inline]
    pub fn index(&self) -> u16 {
        (self.first >> 16) as u16
    }

    /// Returns the number of the port.
    #[inline]
    pub fn number(&self) -> u8 {
        (self.first >> 8) as u8
    }

    /// Returns the next number; 0 after the last one.
    #[inline]
    pub fn take(&mut self) -> u32 {
        let number = self.halves.get(self.used).copied().unwrap_or(0);
        self.used += 1;
        number
    }
}

macro_rules! parts {
    ($($ty:ty)*) => {$(
        impl Part for $ty {
            #[inline]
            fn put(self, packer: &mut Packer) {
                packer.put(self as u32);
            }

            #[inline]
            fn take(unpacker: &mut Unpacker) -> Option<Self> {
                Some(unpacker.take() as $ty)
            }
        }
    )*};
}

parts!(u8 u16 u32 i32);

impl Part for bool {
    #[inline]
    fn put(self, packer: &mut Packer) {
        packer.put(self.into());
    }

    #[inline]
    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        Some(unpacker.take() != 0)
    }
}

impl Part for u64 {
    #[inline]
    fn put(self, packer: &mut Packer) {
        packer.put(self as u32);
        packer.put((self >> 32) as u32);
    }

    #[inline]
    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        Some(u64::from(unpacker.take()) | u64::from(unpacker.take()) << 32)
    }
}

impl Part for Origin {
    #[inline]
    fn put(self, packer: &mut Packer) {
        packer.put(u32::from(self.plc.0) << 8 | u32::from(self.node.0));
    }

    #[inline]
    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        let number = unpacker.take();
        Some(Origin { plc: DeviceIndex((number >> 8) as u16), node: PortNumber(number as u8) })
    }
}

impl Part for RegisterPhase {
    #[inline]
    fn put(self, packer: &mut Packer) {
        packer.put(self.number().into());
    }

    #[inline]
    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        Some(RegisterPhase::numbered(u8::try_from(unpacker.take()).ok()?))
    }
}

/// The location of an event, as encoded in the first word.
pub trait EventSource: Copy {
    /// Returns the index of device or bus, and number of the port.
    fn numbers(self) -> (u16, u8);

    /// Returns the inverse of [`EventSource::numbers`].
    fn of_numbers(index: u16, number: u8) -> Self;
}

impl EventSource for DeviceIndex {
    #[inline]
    fn numbers(self) -> (u16, u8) {
        (self.0, 0)
    }

    #[inline]
    fn of_numbers(index: u16, _: u8) -> Self {
        DeviceIndex(index)
    }
}

impl EventSource for BusIndex {
    #[inline]
    fn numbers(self) -> (u16, u8) {
        (self.number(), 0)
    }

    #[inline]
    fn of_numbers(index: u16, _: u8) -> Self {
        BusIndex::of_number(index)
    }
}

impl EventSource for Origin {
    #[inline]
    fn numbers(self) -> (u16, u8) {
        (self.plc.0, self.node.0)
    }

    #[inline]
    fn of_numbers(plc: u16, node: u8) -> Self {
        Origin { plc: DeviceIndex(plc), node: PortNumber(node) }
    }
}

/// Declares an event kind: a structure with the location of the event (`bus`, `plc` or `origin`) and further fields,
/// each a [`Part`]. The family implements its text: [`EventText`](crate::journal::EventText). A device registers the
/// `KIND`s, and its firmware reports an event with `ctx.report(It { .. })`.
///
/// ```
/// use commram::event_kinds;
/// use commram::journal::{EventCodec, Fields, EventKind, Reader, EventText};
///
/// event_kinds! {
///     /// A door was opened.
///     Opened = 250, "opened", Rare, at origin {
///         /// How far, in degrees.
///         angle: u16,
///     }
/// }
///
/// impl EventText for Opened {
///     fn text(&self, _: &mut Reader) -> String {
///         format!("opened by {} degrees", self.angle)
///     }
///
///     fn fields(&self, _: &mut Reader) -> Fields {
///         Fields::new().with("angle", self.angle)
///     }
/// }
///
/// static KINDS: &[&EventKind] = &[Opened::KIND];
/// assert_eq!(KINDS[0].name(), "opened");
/// ```
#[macro_export]
macro_rules! event_kinds {
    (@type bus) => { $crate::identity::BusIndex };
    (@type plc) => { $crate::identity::DeviceIndex };
    (@type origin) => { $crate::journal::Origin };
    (@source bus, $place:expr) => { $crate::journal::Source::Bus($place) };
    (@source plc, $place:expr) => { $crate::journal::Source::of_index($place) };
    (@source origin, $place:expr) => { $crate::journal::Source::Node($place) };
    ($(
        $(#[$doc:meta])*
        $name:ident = $number:literal, $text:literal, $ring:ident, at $place:tt {
            $($(#[$field_doc:meta])* $field:ident: $ty:ty,)*
        }
    )+) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(unreachable_pub, reason = "the module may be private")]
        pub struct $name {
            /// Location of the event.
            pub $place: $crate::event_kinds!(@type $place),
            $($(#[$field_doc])* pub $field: $ty,)*
        }

        impl $crate::journal::EventCodec for $name {
            const KIND: &'static $crate::journal::EventKind = {
                // A static has the same address in all modules. The catalogue uses this address to recognize a kind
                // that several devices register.
                static KIND: $crate::journal::EventKind =
                    $crate::journal::EventKind::new::<$name>($number, $text, $crate::journal::Ring::$ring);
                &KIND
            };

            #[inline]
            fn words(&self) -> $crate::journal::Words {
                let (index, number) = $crate::journal::EventSource::numbers(self.$place);
                #[allow(unused_mut, reason = "a kind may have no fields except its place")]
                let mut packer = $crate::journal::Packer::new(Self::KIND, index, number);
                $($crate::journal::Part::put(self.$field, &mut packer);)*
                packer.words()
            }

            #[inline]
            fn read(words: $crate::journal::Words) -> Option<Self> {
                #[allow(unused_mut, reason = "a kind may have no fields except its place")]
                let mut unpacker = $crate::journal::Unpacker::new(words);
                Some($name {
                    $place: $crate::journal::EventSource::of_numbers(unpacker.index(), unpacker.number()),
                    $($field: $crate::journal::Part::take(&mut unpacker)?,)*
                })
            }

            #[inline]
            fn source(&self) -> $crate::journal::Source {
                $crate::event_kinds!(@source $place, self.$place)
            }
        }
    )+};
}
