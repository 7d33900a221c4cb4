//! The configuration: modules in the octets of Chk_Cfg, and their checks (p. 21, 31-39, 71-73).

use super::parameters::Parameters;
use crate::can::{ExtendedId, Id, StandardId};
use crate::devices::can_dp2::page;
use crate::devices::can_dp2::registers::gsd;
use serde::{Deserialize, Serialize};

/// Maximum number of modules of a station (p. 23).
pub(in crate::devices::can_dp2::emulation) const MODULES: usize = gsd::MAX_MODULE as usize;

/// Maximum number of octets of all inputs, and of all outputs. The second constant is the maximum of inputs
/// and outputs together (p. 10).
const OCTETS: usize = gsd::MAX_INPUT_LEN as usize;
const TOGETHER: usize = gsd::MAX_DATA_LEN as usize;

/// Number of octets of a Communication Window (p. 38).
pub(in crate::devices::can_dp2::emulation) const WINDOW: usize = 16;

/// The identifier of a Communication Window (p. 38-39), and of an output without CAN (p. 32).
const WINDOW_ID: [u8; 2] = [0xFF, 0xEF];
const DUMMY_ID: u16 = 0x07F8;

/// The bit that marks an identifier of 29 bits (p. 35).
pub(in crate::devices::can_dp2::emulation) const EXTENDED: u32 = 1 << 29;

/// Error in a module (p. 21; D-377).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) enum CfgError {
    /// The module is neither input nor output.
    Type = 1,
    /// The unit is words, not bytes.
    Unit = 2,
    /// The length is neither 1 to 8 nor 16.
    Length = 3,
    /// The identifier has only one byte.
    OneByte = 4,
    /// The format byte is missing.
    Form = 5,
    /// The identifier is not valid.
    Identifier = 6,
}

/// Number of the wrong module, from 0, and its error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) struct CfgFault {
    pub module: u8,
    pub error: CfgError,
}

/// Function of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) enum ModuleFunction {
    /// Data received with this identifier. `is_frozen` is true if a later module has the same identifier, so that this
    /// module never changes (p. 35).
    Input {
        /// Identifier of the frames.
        #[serde(with = "crate::can::kept")]
        id: Id,
        /// True if a later module of the configuration has the identifier of this module: then this module never
        /// changes.
        is_frozen: bool,
    },
    /// Data that the gateway sends with this identifier. Unless `cycle_ms` is 0, the gateway repeats the data
    /// every `cycle_ms`.
    Output {
        /// Identifier of the frames.
        #[serde(with = "crate::can::kept")]
        id: Id,
        /// Cycle time in ms.
        cycle_ms: u16,
    },
    /// An output without CAN (p. 32).
    Dummy,
    /// The read window (p. 41).
    WindowInput,
    /// The write window (p. 40).
    WindowOutput,
    /// A segment of the page that the DP master reads (p. 52).
    PageInput,
    /// A segment of the page that the DP master writes.
    PageOutput,
}

/// A module of the configuration, with its function and its octets in the process image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) struct Module {
    pub kind: ModuleFunction,
    /// Number of octets in the process image, including a counter.
    pub length: usize,
    /// Index of the first octet among inputs or outputs.
    pub first: usize,
    /// Format byte: the bytes that are swapped.
    pub form: u8,
    /// True if a PLC exchanges the module as a whole (p. 33, 72).
    pub is_consistent: bool,
}

impl Module {
    /// Returns the positions of the octets.
    pub(in crate::devices::can_dp2::emulation) fn range(&self) -> core::ops::Range<usize> {
        self.first..self.first + self.length
    }

    fn is_input(&self) -> bool {
        matches!(
            self.kind,
            ModuleFunction::Input { .. } | ModuleFunction::WindowInput | ModuleFunction::PageInput
        )
    }

    fn is_window(&self) -> bool {
        matches!(self.kind, ModuleFunction::WindowInput | ModuleFunction::WindowOutput)
    }
}

/// A valid configuration of modules.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) struct Configuration {
    /// Octets of Chk_Cfg as the slave received them.
    pub octets: Vec<u8>,
    pub modules: Vec<Module>,
    /// Number of octets of all inputs.
    pub inputs: usize,
    /// Number of octets of all outputs.
    pub outputs: usize,
    /// SYNC time in ms in the comment of a Communication Window (p. 39, 44).
    pub sync_ms: Option<u16>,
}

/// A module in the octets of Chk_Cfg, before its check.
struct RawModule<'a> {
    is_input: bool,
    length: usize,
    is_consistent: bool,
    comment: &'a [u8],
}

/// The bit of a module's length octet that makes the module consistent over its whole length (p. 72).
const CONSISTENT: u8 = 0x80;

/// Returns identifier, format byte and the remaining octets.
fn identifier(comment: &[u8]) -> Result<(Id, u8, &[u8]), CfgError> {
    let (&first, _) = comment.split_first().ok_or(CfgError::OneByte)?;
    if comment.len() < 2 {
        return Err(CfgError::OneByte);
    }
    // Identifiers of 29 bits begin with 16#20 to 16#3F; other octets begin an identifier of 11 bits (p. 35).
    if (0x20..0x40).contains(&first) {
        let (bytes, rest) = comment.split_first_chunk().ok_or(CfgError::Identifier)?;
        let (&form, rest) = rest.split_first().ok_or(CfgError::Form)?;
        let id = ExtendedId::new(u32::from_be_bytes(*bytes) & !EXTENDED).ok_or(CfgError::Identifier)?;
        return Ok((id.into(), form, rest));
    }
    let (bytes, rest) = comment.split_first_chunk().ok_or(CfgError::OneByte)?;
    let (&form, rest) = rest.split_first().ok_or(CfgError::Form)?;
    let id = StandardId::new(u16::from_be_bytes(*bytes)).ok_or(CfgError::Identifier)?;
    Ok((id.into(), form, rest))
}

/// Returns the next module, and the octets that follow it.
fn take(octets: &[u8], has_pages: bool) -> Result<(RawModule<'_>, &[u8]), CfgError> {
    let (&head, rest) = octets.split_first().ok_or(CfgError::Type)?;
    // A module of a single octet, the general format, has no identifier (p. 71). Segments of a page need no
    // identifier (p. 52).
    match head & 0x30 {
        0 => {}
        _ if !has_pages => return Err(CfgError::OneByte),
        _ if head & 0x40 != 0 => return Err(CfgError::Unit),
        0x30 => return Err(CfgError::Type),
        way => {
            let length = usize::from(head & 0x0F) + 1;
            let is_consistent = head & CONSISTENT != 0;
            return Ok((RawModule { is_input: way == 0x10, length, is_consistent, comment: &[] }, rest));
        }
    }
    let is_input = match head >> 6 {
        0b01 => true,
        0b10 => false,
        _ => return Err(CfgError::Type),
    };
    let (&structure, rest) = rest.split_first().ok_or(CfgError::Length)?;
    if structure & 0x40 != 0 {
        return Err(CfgError::Unit);
    }
    let comment_length = usize::from(head & 0x0F);
    let (comment, rest) = rest.split_at(comment_length.min(rest.len()));
    let (length, is_consistent) = (usize::from(structure & 0x3F) + 1, structure & CONSISTENT != 0);
    Ok((RawModule { is_input, length, is_consistent, comment }, rest))
}

impl Configuration {
    /// Checks the octets of a Chk_Cfg, which must agree with `parameters`. The error names the first wrong
    /// module.
    pub(in crate::devices::can_dp2::emulation) fn parse(
        octets: &[u8],
        parameters: &Parameters,
    ) -> Result<Self, CfgFault> {
        let mut it = Configuration::default();
        let mut rest = octets;
        while !rest.is_empty() {
            let module = it.modules.len() as u8;
            let (written, following) =
                take(rest, parameters.has_pages()).map_err(|error| CfgFault { module, error })?;
            it.add(&written, parameters).map_err(|error| CfgFault { module, error })?;
            rest = following;
        }
        if parameters.has_pages() {
            it.close_pages(parameters)?;
        }
        it.octets = octets.to_vec();
        Ok(it)
    }

    fn add(&mut self, written: &RawModule<'_>, parameters: &Parameters) -> Result<(), CfgError> {
        if self.modules.len() >= MODULES {
            return Err(CfgError::Type);
        }
        let RawModule { is_input, length, is_consistent, comment } = *written;
        let (kind, form) = if comment.starts_with(&WINDOW_ID) {
            self.window(written, parameters)?
        } else if parameters.has_pages() {
            (segments::kind(written)?, 0)
        } else {
            let (id, form, following) = identifier(comment)?;
            (self.of_identifier(id, is_input, following)?, form)
        };
        // A counter takes one more octet; a window has no counter (D-378).
        let counter = match kind {
            ModuleFunction::Input { .. } => usize::from(parameters.has_rx_counter()),
            ModuleFunction::Output { .. } | ModuleFunction::Dummy => usize::from(parameters.has_tx_counter()),
            ModuleFunction::WindowInput
            | ModuleFunction::WindowOutput
            | ModuleFunction::PageInput
            | ModuleFunction::PageOutput => 0,
        };
        let of_can = length.checked_sub(counter);
        let is_right = match kind {
            ModuleFunction::WindowInput | ModuleFunction::WindowOutput => length == WINDOW,
            // An output without CAN may have any unit (p. 32).
            ModuleFunction::Dummy => length <= WINDOW,
            ModuleFunction::PageInput | ModuleFunction::PageOutput => length <= page::SEGMENT,
            _ => of_can.is_some_and(|bytes| (1..=8).contains(&bytes)),
        };
        let side = if is_input { &mut self.inputs } else { &mut self.outputs };
        let first = *side;
        *side += length;
        if !is_right || *side > OCTETS || self.inputs + self.outputs > TOGETHER {
            return Err(CfgError::Length);
        }
        self.modules.push(Module { kind, length, first, form, is_consistent });
        Ok(())
    }

    /// Checks a window: each direction can have one, and only if the parameters enable windows (p. 39).
    fn window(
        &mut self,
        written: &RawModule<'_>,
        parameters: &Parameters,
    ) -> Result<(ModuleFunction, u8), CfgError> {
        let (_, following) = written.comment.split_at(WINDOW_ID.len());
        let (&form, following) = following.split_first().ok_or(CfgError::Form)?;
        let kind = if written.is_input { ModuleFunction::WindowInput } else { ModuleFunction::WindowOutput };
        if !parameters.has_window() || self.modules.iter().any(|module| module.kind == kind) {
            return Err(CfgError::Identifier);
        }
        match *following {
            [] => {}
            [high, low] => self.sync_ms = Some(u16::from_be_bytes([high, low])),
            _ => return Err(CfgError::Identifier),
        }
        Ok((kind, form))
    }

    fn of_identifier(
        &mut self,
        id: Id,
        is_input: bool,
        following: &[u8],
    ) -> Result<ModuleFunction, CfgError> {
        // Manual p. 10: an identifier can be used in one direction only.
        let is_other_way = |module: &Module| match module.kind {
            ModuleFunction::Input { id: other, .. } => !is_input && other == id,
            ModuleFunction::Output { id: other, .. } => is_input && other == id,
            _ => false,
        };
        if self.modules.iter().any(is_other_way) {
            return Err(CfgError::Identifier);
        }
        if is_input {
            if !following.is_empty() {
                return Err(CfgError::Identifier);
            }
            for module in &mut self.modules {
                if let ModuleFunction::Input { id: other, is_frozen } = &mut module.kind {
                    *is_frozen |= *other == id;
                }
            }
            return Ok(ModuleFunction::Input { id, is_frozen: false });
        }
        let cycle_ms = match *following {
            [] => 0,
            [high, low] => u16::from_be_bytes([high, low]),
            _ => return Err(CfgError::Identifier),
        };
        let is_dummy = matches!(id, Id::Standard(id) if id.as_raw() == DUMMY_ID);
        Ok(if is_dummy { ModuleFunction::Dummy } else { ModuleFunction::Output { id, cycle_ms } })
    }

    /// True if a module is a Communication Window that violates p. 39: consistent over its whole length, with the
    /// format byte 00 and a second window in the other direction. The firmware accepts it nevertheless (D-680).
    pub(in crate::devices::can_dp2::emulation) fn is_odd_window(&self, module: &Module) -> bool {
        let has_both = self.modules.iter().filter(|module| module.is_window()).count() == 2;
        module.is_window() && (!module.is_consistent || module.form != 0 || !has_both)
    }

    /// True if the configuration has any output; without outputs CAN is not used (p. 32).
    pub(in crate::devices::can_dp2::emulation) fn has_output(&self) -> bool {
        self.modules.iter().any(|module| !module.is_input())
    }
}

mod segments;
#[cfg(test)]
mod tests;
