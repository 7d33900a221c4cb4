//! Access of the firmware to the image.

use crate::devices::cs0015::registers::{
    CS0015_FLAGS, CS0015_FUNCTION, CS0015_INPUTS, CS0015_JOBS, CS0015_OUTPUTS, CS0015_PARAMETERS,
    CS0015_PERIPHERALS, CS0015_RX_PDO, CS0015_SLAVES, CS0015_TX_PDO, DEVICE, FLAGS, FRONT_PROGRAM, FUNCTION,
    INPUTS, JOBS, OUTPUTS, PARAMETERS, PERIPHERALS, RX_PDO, SLAVES, TX_PDO,
};
use crate::devices::emulation::program;
use crate::layout::Width;
use crate::memory::header::{ProgramState, Project, Start};
use crate::memory::{Cell16, Cell32, FirmwareHeader, MemoryError, Segment, View};

/// Number of bytes of the retain flags, %MB0 to %MB255 (p. 107).
pub(super) const RETAIN_BYTES: usize = 256;

/// Number of bytes of the operating system's area (p. 154) that follow the flags with names.
pub(super) const UNNAMED: usize = 256 - size_of::<CS0015_FLAGS>();

/// The structures of the image that the firmware uses.
pub(super) struct Registers {
    pub inputs: View<CS0015_INPUTS>,
    pub outputs: View<CS0015_OUTPUTS>,
    pub rx: View<CS0015_RX_PDO>,
    pub tx: View<CS0015_TX_PDO>,
    pub flags: View<CS0015_FLAGS>,
    pub parameters: View<CS0015_PARAMETERS>,
    pub jobs: View<CS0015_JOBS>,
    pub function: View<CS0015_FUNCTION>,
    pub peripherals: View<CS0015_PERIPHERALS>,
    /// Words of I/O modules.
    pub slaves: View<CS0015_SLAVES>,
    face: FirmwareHeader,
    segment: Segment,
}

/// Converts four words to the eight bytes of a PDO. The low byte of each word comes first (D-431).
fn bytes(words: &[Cell16; 4]) -> [u8; 8] {
    let mut bytes = [0; 8];
    bytes
        .chunks_exact_mut(2)
        .zip(words)
        .for_each(|(two, word)| two.copy_from_slice(&word.load().to_le_bytes()));
    bytes
}

impl Registers {
    pub(super) fn new(segment: &Segment) -> Result<Self, MemoryError> {
        Ok(Registers {
            inputs: segment.view(INPUTS)?,
            outputs: segment.view(OUTPUTS)?,
            rx: segment.view(RX_PDO)?,
            tx: segment.view(TX_PDO)?,
            flags: segment.view(FLAGS)?,
            parameters: segment.view(PARAMETERS)?,
            jobs: segment.view(JOBS)?,
            function: segment.view(FUNCTION)?,
            peripherals: segment.view(PERIPHERALS)?,
            slaves: segment.view(SLAVES)?,
            face: segment.firmware_header()?,
            segment: segment.clone(),
        })
    }

    /// Returns a word of the front panel that the firmware sets.
    pub(super) fn shown(&self, word: usize) -> &Cell32 {
        &self.face.front[word]
    }

    /// Reads a word of the front panel that users set.
    pub(super) fn turned(&self, word: usize) -> u32 {
        self.face.requested().front[word].load()
    }

    /// Takes a command at the front panel.
    pub(super) fn take_command(&self) -> Option<u32> {
        self.face.take(|page| &page.front[FRONT_PROGRAM])
    }

    /// Shows the state of the program in the board's entries of the header page. The state also says whether
    /// a program is loaded.
    pub(super) fn show_program(&self, state: ProgramState) {
        self.face.put(|page| &page.program.state, state.code());
        let project = if state == ProgramState::None { Project::None } else { Project::Boot };
        self.face.project.store(project.code());
    }

    /// Returns the program state that clients have reported.
    pub(super) fn reported_program(&self) -> u32 {
        self.face.requested().program.state.load()
    }

    /// Requests a start or stop of the program.
    pub(super) fn order(&self, kind: Start) {
        program::order(&self.face, kind);
    }

    /// True if a client requests a start.
    pub(super) fn has_start_request(&self) -> bool {
        self.face.requested().program.start_request.load() != 0
    }

    /// Takes a client's request for a start.
    pub(super) fn take_start_request(&self) -> Option<u32> {
        self.face.take(|page| &page.program.start_request)
    }

    /// Fires an event of the program.
    pub(super) fn fire_event(&self, event: usize, now: u64) {
        if let Some(slot) = self.face.events.get(event) {
            slot.fire(now);
        }
    }

    /// Returns the data of transmit PDO `pdo`, counted from 0.
    pub(super) fn transmit(&self, pdo: usize) -> [u8; 8] {
        bytes(&self.tx.a_TX_PDO[pdo])
    }

    /// Returns the data of receive PDO `pdo`, counted from 0.
    pub(super) fn received(&self, pdo: usize) -> [u8; 8] {
        bytes(&self.rx.a_RX_PDO[pdo])
    }

    /// Writes the data of receive PDO `pdo`, counted from 0.
    pub(super) fn receive(&self, pdo: usize, data: [u8; 8]) {
        let words = data.as_chunks::<2>().0.iter().map(|two| u16::from_le_bytes(*two));
        self.rx.a_RX_PDO[pdo].iter().zip(words).for_each(|(cell, word)| cell.store(word));
    }

    /// Returns the part of the operating system's area that follows the flags with names.
    pub(super) fn unnamed(&self) -> [u8; UNNAMED] {
        let mut bytes = [0; UNNAMED];
        // The range is in the image, so this cannot fail.
        let _ = self.segment.read_range(self.unnamed_at(), &mut bytes);
        bytes
    }

    /// Returns the offset of this area.
    pub(super) fn unnamed_at(&self) -> u32 {
        FLAGS + size_of::<CS0015_FLAGS>() as u32
    }

    /// Returns the retain flags.
    pub(super) fn retain(&self) -> Vec<u8> {
        let mut flags = vec![0; RETAIN_BYTES];
        // The range is in the image, so this cannot fail.
        let _ = self.segment.read_range(retain_at(), &mut flags);
        flags
    }

    /// Writes the retain flags, beginning with the first flag.
    pub(super) fn set_retain(&self, flags: &[u8]) {
        for (offset, flag) in (retain_at()..).zip(flags.iter().take(RETAIN_BYTES)) {
            let _ = self.segment.store(offset, Width::Byte, (*flag).into());
        }
    }

    /// Clears the flags that are not registers, except the retained flags, as at power-on (D-401).
    pub(super) fn clear_flags(&self) {
        let mut areas: Vec<_> = DEVICE.areas.iter().chain(DEVICE.retain.map(|retain| &retain.area)).collect();
        areas.sort_by_key(|area| area.first);
        let Some(space) = DEVICE.spaces.iter().find(|space| space.name == "flags") else { return };
        let mut free = space.offset;
        let ends = areas
            .iter()
            .filter(|area| area.space.name == space.name)
            .map(|area| (area.first, area.last() + 1));
        for (first, end) in ends.chain([(space.offset + space.bytes, u32::MAX)]) {
            (free..first).step_by(4).for_each(|offset| {
                let _ = self.segment.store(offset, Width::Dword, 0);
            });
            free = end;
        }
    }
}

fn retain_at() -> u32 {
    DEVICE.retain.map_or(0, |retain| retain.area.first)
}
