//! The header page: the first 4096 bytes of the segment, below the device's first register.
//!
//! It is the attach contract's data structure; `docs/attach.md` describes it byte by byte. Everything in
//! it is a cell in little-endian order. Whoever is not named as a writer of a field only reads it.

use super::{Bell, Cell8, Cell32, Cell64, SharedRegs};
use core::mem::offset_of;
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// Length of the header page in bytes.
pub const HEADER_SIZE: usize = 4096;
/// The first eight bytes of an image: `commram` and a zero.
pub const MAGIC: u64 = u64::from_le_bytes(*b"commram\0");
/// Version of the header's layout and rules. It changes when an old client would go wrong.
pub const ABI_VERSION: u32 = 1;
/// Number of event slots, one per event number (manual 5.00005.03a p. 47-60 uses 0 to 12).
pub const EVENT_SLOTS: usize = 16;
/// Length of the instance's and the PLC's name field in bytes, with the terminating zero.
pub const NAME_LENGTH: usize = 32;
/// Length of the device name field in bytes, with the terminating zero.
pub const DEVICE_LENGTH: usize = 64;

/// The header page.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct Header {
    /// [`MAGIC`].
    pub magic: Cell64,
    /// [`ABI_VERSION`].
    pub abi_version: Cell32,
    /// [`HEADER_SIZE`].
    pub header_size: Cell32,
    /// Hash of the device's register map; equal hashes mean equal registers at equal offsets.
    pub layout_hash: Cell64,
    /// [`super::SEGMENT_SIZE`].
    pub segment_size: Cell32,
    /// Counts the emulators that have used this file, from 1.
    pub generation: Cell32,
    /// A [`State`].
    pub state: Cell32,
    /// A [`ClockMode`].
    pub clock_mode: Cell32,
    /// Process id of the emulator.
    pub firmware_pid: Cell32,
    /// Emulated time per real time x 1000 (1000 = real time); 0 in stepped mode.
    pub speed: Cell32,
    /// Start time of the emulator's process: field 22 of `/proc/<pid>/stat`, in clock ticks since boot.
    pub firmware_start: Cell64,
    /// Emulated time in microseconds since the emulator's start.
    pub virtual_time_us: Cell64,
    /// The processor cycle in microseconds: at the latest then a store is seen that nobody rang for.
    pub processor_cycle_us: Cell32,
    /// SYNC pulses seen on CANsync node 1 and node 2, wrapping.
    pub sync_counter: [Cell32; 2],
    /// Zero.
    pub reserved_76: [Cell32; 13],
    /// Rung by clients that have stored something; the firmware is the only waiter.
    pub doorbell: Bell,
    /// Zero.
    pub reserved_136: [Cell32; 14],
    /// Rung by the firmware when it has changed registers.
    pub answer: Bell,
    /// Zero.
    pub reserved_200: [Cell32; 14],
    /// Rung by the firmware when it has sent a reply through the iceoryx2 channel.
    pub channel_reply: Bell,
    /// Zero.
    pub reserved_264: [Cell32; 14],
    /// One slot per event number.
    pub events: [EventSlot; EVENT_SLOTS],
    /// Name of the emulator instance: UTF-8, zero-padded.
    pub instance: [Cell8; NAME_LENGTH],
    /// Name of the PLC: UTF-8, zero-padded.
    pub plc: [Cell8; NAME_LENGTH],
    /// Name of the emulated device: UTF-8, zero-padded.
    pub device: [Cell8; DEVICE_LENGTH],
    /// What one can see and turn on the board's front.
    pub board: Board,
    /// Zero.
    pub reserved_720: [Cell8; HEADER_SIZE - 720],
}

/// An interrupt event: its bell counts the events of this number.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct EventSlot {
    /// Rung by the firmware once per event.
    pub bell: Bell,
    /// Emulated time of the last event in microseconds; written before the bell rings.
    pub time_us: Cell64,
}

/// The board's front: switches are written by clients, displays by the firmware.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct Board {
    /// DIP switch S33, switches 1 to 5: 0 to 31. The firmware reads it at power-on and reset only.
    pub dip: Cell32,
    /// The four LEDs in bits 0 to 3, red top, green top, red bottom, green bottom: function block `LED`
    /// (manual 5.00005.03a p. 51).
    pub leds: Cell32,
    /// The character on the seven-segment display (ASCII); 0 is dark.
    pub display: Cell32,
    /// A [`RunSwitch`].
    pub switch: Cell32,
}

// SAFETY: every field of the three is a cell, an array of cells or such a struct; IntoBytes proves that
// there is no padding and FromBytes that any bit pattern is valid.
unsafe impl SharedRegs for Header {}
// SAFETY: as above.
unsafe impl SharedRegs for EventSlot {}
// SAFETY: as above.
unsafe impl SharedRegs for Board {}

macro_rules! offsets {
    ($($offset:literal => $field:ident),* $(,)?) => {
        $(const _: () = assert!(offset_of!(Header, $field) == $offset);)*
        #[cfg(test)]
        const PUBLISHED: &[(usize, &str)] = &[$(($offset, stringify!($field))),*];
    };
}

// The published offsets. A change here is a new ABI version.
offsets! {
    0 => magic, 8 => abi_version, 12 => header_size, 16 => layout_hash, 24 => segment_size,
    28 => generation, 32 => state, 36 => clock_mode, 40 => firmware_pid, 44 => speed,
    48 => firmware_start, 56 => virtual_time_us, 64 => processor_cycle_us, 68 => sync_counter,
    76 => reserved_76, 128 => doorbell, 136 => reserved_136, 192 => answer, 200 => reserved_200,
    256 => channel_reply, 264 => reserved_264, 320 => events, 576 => instance, 608 => plc,
    640 => device, 704 => board, 720 => reserved_720,
}
const _: () = assert!(size_of::<Header>() == HEADER_SIZE);
const _: () = assert!(offset_of!(EventSlot, time_us) == 8 && size_of::<EventSlot>() == 16);
const _: () = assert!(offset_of!(Board, leds) == 4 && offset_of!(Board, display) == 8);
const _: () = assert!(offset_of!(Board, switch) == 12 && size_of::<Board>() == 16);

macro_rules! codes {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $value:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u32)]
        pub enum $name { $($(#[$vdoc])* $variant = $value,)* }

        impl $name {
            /// The meaning of the number in the header, if it has one.
            pub const fn from_code(code: u32) -> Option<Self> {
                match code {
                    $($value => Some(Self::$variant),)*
                    _ => None,
                }
            }

            /// The number in the header.
            pub const fn code(self) -> u32 {
                self as u32
            }
        }
    };
}

codes! {
    /// What the emulator behind an image is doing.
    State {
        /// The image is being filled.
        Starting = 1,
        /// Registers have their start values and the firmware runs.
        Ready = 2,
        /// The emulator is shutting down; nothing is answered any more.
        Stopping = 3,
        /// The emulator has ended; the file is about to disappear.
        Stopped = 4,
    }
}
codes! {
    /// What drives the emulated time.
    ClockMode {
        /// The wall clock, times the speed.
        RealTime = 0,
        /// Requests through the channel or the script; time stands still in between.
        Stepped = 1,
    }
}
codes! {
    /// The RUN/STOP/RESET switch (manual 5.00005.03a p. 40).
    RunSwitch {
        /// The PLC program may run.
        Run = 0,
        /// The PLC program is stopped.
        Stop = 1,
        /// Held in RESET; it springs back to STOP when released.
        Reset = 2,
    }
}

impl Header {
    /// Announces a change of state to everybody who waits for an answer. The bells of the events do not
    /// ring: they count events.
    pub(super) fn announce(&self) {
        self.answer.ring();
        self.channel_reply.ring();
    }
}

impl Board {
    /// All dark, all switches at 0.
    pub fn clear(&self) {
        [&self.dip, &self.leds, &self.display, &self.switch].iter().for_each(|cell| cell.store(0));
    }
}

impl EventSlot {
    /// Announces one event at the given emulated time, in microseconds.
    pub fn fire(&self, time_us: u64) {
        self.time_us.store(time_us);
        self.bell.ring();
    }
}

/// A name field as text, up to its first zero. Anything that is not UTF-8 becomes U+FFFD.
pub fn name<const N: usize>(field: &[Cell8; N]) -> String {
    let bytes: Vec<u8> = field.iter().map(Cell8::load).take_while(|&b| b != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Fills a name field. Text too long is cut at a character, so that the field ends in a zero.
pub fn set_name<const N: usize>(field: &[Cell8; N], text: &str) {
    let cut = (0..=text.len().min(N.saturating_sub(1))).rev().find(|&i| text.is_char_boundary(i));
    let text = &text.as_bytes()[..cut.unwrap_or(0)];
    for (i, cell) in field.iter().enumerate() {
        cell.store(text.get(i).copied().unwrap_or(0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerocopy::FromZeros;

    #[test]
    fn names_are_cut_at_a_character_and_end_in_zero() {
        let field: [Cell8; 8] = <[Cell8; 8]>::new_zeroed();
        set_name(&field, "press-1");
        assert_eq!(name(&field), "press-1");
        set_name(&field, "größer-ü");
        assert_eq!(name(&field), "größe");
        assert_eq!(field[7].load(), 0);
        set_name(&field, "abcdefü");
        assert_eq!(name(&field), "abcdef");
    }

    #[test]
    fn codes_have_a_way_back() {
        for code in 0..6 {
            assert_eq!(State::from_code(code).map(State::code), (1..=4).contains(&code).then_some(code));
            assert_eq!(RunSwitch::from_code(code).is_some(), code < 3);
            assert_eq!(ClockMode::from_code(code).is_some(), code < 2);
        }
    }

    #[test]
    fn the_magic_reads_as_text_in_a_hex_dump() {
        let header = Header::new_box_zeroed().unwrap();
        header.magic.store(MAGIC);
        let mut header = header;
        assert_eq!(&header.as_mut_bytes()[..8], b"commram\0");
    }

    /// Every byte of the page is in the contract's table, under the name it has here.
    #[test]
    fn the_attach_contract_describes_every_byte() {
        let contract = include_str!("../../docs/attach.md");
        let ends = PUBLISHED.iter().skip(1).map(|&(offset, _)| offset).chain([HEADER_SIZE]);
        for (&(offset, field), end) in PUBLISHED.iter().zip(ends) {
            let row = format!("| {offset} | {} | `{field}` |", end - offset);
            assert!(contract.contains(&row), "docs/attach.md lacks {row}");
        }
    }

    #[test]
    fn an_event_carries_its_time() {
        let header = Header::new_box_zeroed().unwrap();
        header.events[12].fire(8_000);
        header.events[12].fire(16_000);
        assert_eq!(header.events[12].bell.rings(), 2);
        assert_eq!(header.events[12].time_us.load(), 16_000);
    }
}
