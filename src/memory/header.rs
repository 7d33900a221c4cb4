//! The header page: the first 4096 bytes of the memory segment, below the device's first register.
//!
//! The header page is the data structure of the attach contract; `docs/reference/attach.md` describes it byte by byte.
//! Every value in it is a cell in little-endian order. A participant that is not named as a writer of a field only
//! reads it.

#[macro_use]
mod codes;
mod board;
mod board_words;
mod events;
mod initial_flag;
mod lockstep;
mod table;

pub use board::{Board, BoardSetting, BoardState, Power, Program, ProgramState, Project, RunSwitch, Start};
pub use board_words::{BoardAssignment, BoardAssignmentError, BoardWords};
pub use events::{EventSlot, Interrupt, InterruptResult, OptInit, OptInitResult, TimerSetup, Trigger};
pub use initial_flag::{InitialFlag, InitialFlagResult};
pub use lockstep::{SEAT_ORDERS, SEAT_WAITS, Seat, SeatState};
pub use table::{AREAS, AreaEntry, PORTS, PortEntry, TABLE_NAME_LENGTH};

use super::struct_tables::publish;
use super::{Bell, Cell8, Cell32, Cell64, SharedRegs};
use crate::layout::{DeviceFit, DeviceLayout, FrontWord};
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// Length of the header page in bytes.
pub const HEADER_SIZE: usize = 4096;
/// The first eight bytes of an image: `commram` and a zero.
pub const MAGIC: u64 = u64::from_le_bytes(*b"commram\0");
/// Version of the header's layout and rules. It changes when an old client would misread the page.
pub const ABI_VERSION: u32 = 3;
/// Number of event slots, one for each event number. The manual uses the numbers 0 to 12 (5.00005.03a p. 47-60).
pub const EVENT_SLOTS: usize = 16;
/// Number of triggers that `OPT_INIT` routes: trigger 1, trigger 2, trigger controller (p. 57-58).
pub const TRIGGERS: usize = 3;
/// Tasks of one PLC that can take part in lockstep at the same time.
pub const SEATS: usize = 8;
/// Number of words for front elements of devices that [`Board`] does not describe.
pub const FRONT: usize = 64;
/// Length of the instance's and the PLC's name field in bytes, with the terminating zero.
pub const NAME_LENGTH: usize = 32;
/// Length of the device name field in bytes, with the terminating zero.
pub const DEVICE_LENGTH: usize = 64;

/// Cells of the header page, in the order of their offsets.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct Header {
    /// Identifies the file as an image of commram: [`MAGIC`].
    pub magic: Cell64,
    /// Version of the header page: [`ABI_VERSION`].
    pub abi_version: Cell32,
    /// Length of the header page in bytes: [`HEADER_SIZE`].
    pub header_size: Cell32,
    /// Hash of the device's register map; equal hashes mean equal registers at equal offsets.
    pub layout_hash: Cell64,
    /// Length of the memory segment in bytes, including the header page: the minimum length of the file.
    pub segment_size: Cell32,
    /// Number of emulators that have used this file, from 1.
    pub generation: Cell32,
    /// State of the emulator, a [`State`].
    pub state: Cell32,
    /// Mode of the emulator's clock, a [`ClockMode`].
    pub clock_mode: Cell32,
    /// Process id of the emulator.
    pub firmware_pid: Cell32,
    /// Emulated time per real time x 1000 (1000 = real time); 0 in stepped mode and while the clock is paused.
    pub speed: Cell32,
    /// Start time of the emulator's process: field 22 of `/proc/<pid>/stat`, in clock ticks since boot.
    pub firmware_start: Cell64,
    /// Emulated time in microseconds since the emulator's start.
    pub virtual_time_us: Cell64,
    /// The processor cycle in microseconds. If a client stores without ringing the doorbell, the firmware sees the
    /// store after at most this time.
    pub processor_cycle_us: Cell32,
    /// Number of SYNC pulses that each port has received, wrapping, in the order of [`Header::ports`].
    pub sync_counter: [Cell32; PORTS],
    /// Rung by clients after a store; the firmware is the only waiter.
    pub doorbell: Bell,
    /// Reserved; always zero.
    pub reserved_136: [Cell32; 14],
    /// Rung by the firmware when it has changed registers.
    pub answer: Bell,
    /// Reserved; always zero.
    pub reserved_200: [Cell32; 14],
    /// Rung by the firmware when it has sent a reply through the iceoryx2 channel.
    pub channel_reply: Bell,
    /// Reserved; always zero.
    pub reserved_264: [Cell32; 14],
    /// One slot per event number.
    pub events: [EventSlot; EVENT_SLOTS],
    /// Name of the emulator instance: UTF-8, zero-padded.
    pub instance: [Cell8; NAME_LENGTH],
    /// Name of the PLC: UTF-8, zero-padded.
    pub plc: [Cell8; NAME_LENGTH],
    /// Name of the emulated device: UTF-8, zero-padded.
    pub device: [Cell8; DEVICE_LENGTH],
    /// Switches and displays on the board's front panel.
    pub board: Board,
    /// State of the PLC program, its starts, and the power switch.
    pub program: Program,
    /// Clients increment this counter after each request in [`Header::interrupts`], [`Header::opt_init`],
    /// [`Header::initial_flag`], [`Header::project_request`], [`Header::lockstep`] or [`Program::start_request`].
    pub board_requests: Cell32,
    /// Number of cycles of the cyclic task since the last cold or warm start, including the present cycle. The PLC
    /// counts them; 0 if it does not count.
    pub program_cycles: Cell32,
    /// Value of `CLOCK_MONOTONIC` at emulated time 0, in ns modulo 2^64. It is extrapolated if the clock's speed is not
    /// 1000. 0 in stepped mode, before the clock runs, and while the clock is paused.
    pub real_epoch_ns: Cell64,
    /// Offset of the first retain flag in this file; 0 if the device has none.
    pub retain_offset: Cell32,
    /// Number of retain flags in bytes.
    pub retain_size: Cell32,
    /// Hash of the device's register map without its option cards; equal to [`Header::layout_hash`] if it has none. All
    /// registers of this map exist.
    pub base_layout_hash: Cell64,
    /// Request to set the initial value of a retain flag. A cold start gives the flag this value.
    pub initial_flag: InitialFlag,
    /// Request to load a project: the number of a [`Project`] plus 1. The firmware sets the request back to 0.
    pub project_request: Cell32,
    /// The loaded [`Project`], written by the firmware.
    pub project: Cell32,
    /// Reserved; always zero.
    pub reserved_816: [Cell32; 4],
    /// Pulses on trigger 1, trigger 2 and trigger controller, as routed by `OPT_INIT`.
    pub triggers: [EventSlot; TRIGGERS],
    /// Pulses of board timer A and B.
    pub timers: [EventSlot; 2],
    /// Reserved; always zero.
    pub reserved_912: [Cell32; 12],
    /// Function block `INTR_SET`, one slot per event number.
    pub interrupts: [Interrupt; EVENT_SLOTS],
    /// Requests and results of the function block `OPT_INIT`.
    pub opt_init: OptInit,
    /// Tasks that the emulated time waits for.
    pub lockstep: [Seat; SEATS],
    /// The areas of the device.
    pub areas: [AreaEntry; AREAS],
    /// The ports of the device.
    pub ports: [PortEntry; PORTS],
    /// Front elements of devices that [`Header::board`] does not describe.
    pub front: [Cell32; FRONT],
    /// Reserved; always zero.
    pub reserved_3776: [Cell8; HEADER_SIZE - 3776],
}

// SAFETY: every field is a cell, an array of cells or such a struct; IntoBytes proves that there is no padding
// and FromBytes that any bit pattern is valid.
unsafe impl SharedRegs for Header {}

// The published offsets. A change here is a new ABI version.
publish! { Header:
    0 => magic, 8 => abi_version, 12 => header_size, 16 => layout_hash, 24 => segment_size,
    28 => generation, 32 => state, 36 => clock_mode, 40 => firmware_pid, 44 => speed,
    48 => firmware_start, 56 => virtual_time_us, 64 => processor_cycle_us, 68 => sync_counter,
    128 => doorbell, 136 => reserved_136, 192 => answer, 200 => reserved_200,
    256 => channel_reply, 264 => reserved_264, 320 => events, 576 => instance, 608 => plc,
    640 => device, 704 => board, 720 => program, 752 => board_requests, 756 => program_cycles,
    760 => real_epoch_ns, 768 => retain_offset, 772 => retain_size, 776 => base_layout_hash,
    784 => initial_flag, 808 => project_request,
    812 => project, 816 => reserved_816, 832 => triggers, 880 => timers, 912 => reserved_912, 960 => interrupts, 1216 => opt_init,
    1280 => lockstep, 1792 => areas, 2560 => ports, 3520 => front, 3776 => reserved_3776,
}
const _: () = assert!(size_of::<Header>() == HEADER_SIZE);

codes! {
    /// State of the emulator that serves an image.
    State {
        /// The emulator is filling the image.
        Starting = 1,
        /// Registers have their start values and the firmware runs.
        Ready = 2,
        /// The emulator is shutting down. It answers no requests, except of clients that read the rest of the journal.
        Stopping = 3,
        /// The emulator has ended and will remove the file immediately.
        Stopped = 4,
        /// The emulator has ended as in `Stopped`, but could not save the changes in NOVRAM.
        Unsaved = 5,
    }
}
impl State {
    /// True if the emulator no longer answers: it ends or has ended.
    #[must_use]
    pub fn is_ending(self) -> bool {
        self == State::Stopping || self.is_over()
    }

    /// True if the emulator has ended.
    #[must_use]
    pub fn is_over(self) -> bool {
        matches!(self, State::Stopped | State::Unsaved)
    }
}

codes! {
    /// Source of the emulated time.
    ClockMode {
        /// The emulated time is the wall clock, times the speed.
        RealTime = 0,
        /// Requests of clients or of a script. Between two requests the emulated time does not advance.
        Stepped = 1,
    }
}

/// Returns the name of the field, array or bell that contains byte `offset` of the header page.
pub fn field_at(offset: usize) -> Option<&'static str> {
    let field = Header::STRUCT.fields.iter().rev().find(|field| field.offset <= offset)?;
    (offset < HEADER_SIZE).then_some(field.name)
}

impl Header {
    /// Announces a change of [`Header::state`] to all processes that wait for an answer. The bells of the events do not
    /// ring, because each ring of such a bell counts as an event.
    pub(super) fn announce(&self) {
        self.answer.ring();
        self.channel_reply.ring();
    }

    /// Writes the name and the tables of the device.
    pub(super) fn describe(&self, device: &'static DeviceLayout) {
        self.layout_hash.store(device.layout_hash);
        self.base_layout_hash.store(device.layout_hash);
        set_name(&self.device, device.title);
        self.areas.iter().for_each(AreaEntry::clear);
        let (retain, bytes) =
            device.retain.map_or((0, 0), |retain| (retain.area.first, retain.default_bytes));
        self.retain_offset.store(retain);
        self.retain_size.store(bytes);
        let areas = device.areas.iter().chain(device.retain.map(|retain| &retain.area));
        self.areas.iter().zip(areas).for_each(|(entry, area)| entry.fill(area));
        self.ports.iter().for_each(PortEntry::clear);
        self.ports.iter().zip(device.ports).for_each(|(entry, port)| entry.fill(port));
        self.set_fitted(&DeviceFit::unknown(device));
    }

    /// Writes the kinds of the ports.
    pub fn set_fitted(&self, fitted: &DeviceFit) {
        let ports = self.ports.iter().zip(fitted.device().ports);
        ports.for_each(|(entry, port)| entry.set_fit(fitted.port(port.number)));
    }

    /// Returns `device` with the options that the port entries of this page describe. `device` must be the device of
    /// this image.
    #[must_use]
    pub fn fitted(&self, device: &'static DeviceLayout) -> DeviceFit {
        let ports = self.ports.iter().zip(device.ports);
        ports.fold(DeviceFit::unknown(device), |fitted, (entry, port)| fitted.with(port.number, entry.fit()))
    }

    /// Resets the board to its state before power-on: no event is enabled, and no task has a seat. Bells keep their
    /// counts.
    pub(super) fn clear_board(&self) {
        self.board.clear();
        self.program.clear();
        self.interrupts.iter().for_each(Interrupt::clear);
        self.opt_init.clear();
        self.initial_flag.clear();
        self.project.store(Project::None.code());
        self.project_request.store(0);
        self.lockstep.iter().for_each(Seat::clear);
        self.front.iter().for_each(|word| word.store(0));
        let pulses = self.events.iter().chain(&self.triggers).chain(&self.timers);
        pulses.for_each(|slot| slot.time_us.store(0));
        self.real_epoch_ns.store(0);
    }

    /// Publishes a real-time clock. The epoch is 0 while the clock is paused. `permille` is the emulated time per real
    /// time x 1000. During the change of both fields the epoch is 0, so [`Header::exact_us`] never combines the epoch
    /// of one clock with the speed of another.
    pub fn set_real_clock(&self, epoch_ns: u64, permille: u32) {
        self.withdraw_real_clock();
        self.speed.store(permille);
        self.real_epoch_ns.store(epoch_ns);
    }

    /// Begins a change of a real-time clock. Until [`Header::set_real_clock`], programs wait for the new clock.
    pub(crate) fn withdraw_real_clock(&self) {
        self.real_epoch_ns.store(0);
    }

    /// Emulated time in microseconds at this very moment: in real time the clock also advances between two actions of
    /// the firmware. The time is at most [`LONGEST_LEAD_US`] after the emulator's time, so that it does not fall when
    /// the speed changes (D-789).
    #[must_use]
    pub fn exact_us(&self) -> u64 {
        for _ in 0..LONGEST_CHANGE {
            let (epoch_ns, permille) = (self.real_epoch_ns.load(), self.speed.load());
            // The speed is 0 in stepped mode, and while the clock is paused.
            if permille == 0 {
                break;
            }
            let (last_us, now_ns) = (self.virtual_time_us.load(), monotonic_ns());
            if epoch_ns == 0 || self.real_epoch_ns.load() != epoch_ns {
                core::hint::spin_loop();
                continue;
            }
            // The epoch of a slow clock may be before the begin of `CLOCK_MONOTONIC`.
            let passed = u64::try_from(now_ns.wrapping_sub(epoch_ns) as i64).unwrap_or(0);
            let us = u128::from(passed) * u128::from(permille) / 1_000_000;
            let us = u64::try_from(us).unwrap_or(u64::MAX);
            return us.clamp(last_us, last_us.saturating_add(LONGEST_LEAD_US));
        }
        self.virtual_time_us.load()
    }

    /// Returns the value of a word of the device's front panel.
    #[must_use]
    pub fn front_value(&self, word: &FrontWord) -> u32 {
        self.front.get(word.index()).map_or(0, Cell32::load)
    }

    /// Returns values of the front panel of `device`, which must be the device of this image. Words that [`Board`] or
    /// [`Program`] contain under the same name are omitted.
    pub fn front_words(
        &self,
        device: &'static DeviceLayout,
    ) -> impl Iterator<Item = (&'static FrontWord, u32)> {
        let own = device.front.iter().filter(|word| !BoardWords::NAMES.contains(&word.name));
        own.map(|word| (word, self.front_value(word)))
    }

    /// Announces to the emulator that a request was stored.
    pub fn submit_request(&self) {
        self.board_requests.increment();
        self.doorbell.ring();
    }
}

/// A program computes the emulated time at most this time ahead of `virtual_time_us`, in microseconds. The emulator
/// makes no longer step in real time: if its clock is late by more and its speed changes, it drops the rest (D-789).
pub const LONGEST_LEAD_US: u64 = 100_000;

/// Number of reads after which a program stops to wait for the new clock, because the emulator may have died during the
/// change.
const LONGEST_CHANGE: u32 = 1_000_000;

/// Returns a name field as text, up to its first zero. Invalid UTF-8 becomes U+FFFD.
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

/// Returns the value of `CLOCK_MONOTONIC` in nanoseconds.
pub(crate) fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::PANEL;
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
        for code in 0..7 {
            assert_eq!(State::from_code(code).map(State::code), (1..=5).contains(&code).then_some(code));
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

    #[test]
    fn each_word_of_a_front_is_separate() {
        let header = Header::new_box_zeroed().unwrap();
        for (word, cell) in (100..).zip(&header.front) {
            cell.store(word);
        }
        let words: Vec<_> = header.front_words(&PANEL).collect();
        assert!(!words.is_empty());
        for (word, value) in words {
            assert_eq!(
                (value, header.front_value(word)),
                (100 + word.index() as u32, value),
                "{}",
                word.name
            );
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
