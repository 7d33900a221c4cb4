//! Access of the firmware to the image.

use super::modules::{Configuration, EXTENDED, MODULES, ModuleFunction};
use super::parameters::{LENGTH, Parameters, Role};
use crate::can::Id;
use crate::devices::can_dp2::registers::values::module_kind;
use crate::devices::can_dp2::registers::{
    CAN, CAN_DP2_CAN, CAN_DP2_CFG, CAN_DP2_DIAG, CAN_DP2_INPUTS, CAN_DP2_OUTPUTS, CAN_DP2_PRM,
    CAN_DP2_STORED, CFG, DIAG, INPUTS, OUTPUTS, PRM, STORED,
};
use crate::memory::{Cell8, Cell32, FirmwareHeader, MemoryError, Segment, View};

/// Value of a SYNC time that means the stored SYNC time (p. 30).
pub(in crate::devices::can_dp2::emulation) const SYNC_STORED: u16 = 0xFFFF;

/// The structures of the image that the gateway's firmware uses.
pub(in crate::devices::can_dp2::emulation) struct Registers {
    pub prm: View<CAN_DP2_PRM>,
    pub stored: View<CAN_DP2_STORED>,
    pub diag: View<CAN_DP2_DIAG>,
    pub can: View<CAN_DP2_CAN>,
    pub cfg: View<CAN_DP2_CFG>,
    inputs: View<CAN_DP2_INPUTS>,
    outputs: View<CAN_DP2_OUTPUTS>,
    face: FirmwareHeader,
}

/// Writes octets from the first cell on, and 0 to the remaining cells.
pub(in crate::devices::can_dp2::emulation) fn fill(cells: &[Cell8], octets: &[u8]) {
    let octets = octets.iter().copied().chain(core::iter::repeat(0));
    cells.iter().zip(octets).for_each(|(cell, octet)| cell.store(octet));
}

fn load(cells: &[Cell8]) -> Vec<u8> {
    cells.iter().map(Cell8::load).collect()
}

impl Registers {
    pub(in crate::devices::can_dp2::emulation) fn new(segment: &Segment) -> Result<Self, MemoryError> {
        Ok(Registers {
            prm: segment.view(PRM)?,
            stored: segment.view(STORED)?,
            diag: segment.view(DIAG)?,
            can: segment.view(CAN)?,
            cfg: segment.view(CFG)?,
            inputs: segment.view(INPUTS)?,
            outputs: segment.view(OUTPUTS)?,
            face: segment.firmware_header()?,
        })
    }

    /// Returns a word of the front panel that the firmware sets, such as an LED.
    pub(in crate::devices::can_dp2::emulation) fn shown(&self, word: usize) -> &Cell32 {
        &self.face.front[word]
    }

    /// Reads a word of the front panel that a user sets, such as a switch.
    pub(in crate::devices::can_dp2::emulation) fn turned(&self, word: usize) -> u32 {
        self.face.requested().front[word].load()
    }

    /// Returns the first `octets` inputs.
    pub(in crate::devices::can_dp2::emulation) fn inputs(&self, octets: usize) -> Vec<u8> {
        load(&self.inputs.inputs[..octets.min(self.inputs.inputs.len())])
    }

    /// Returns the first `octets` outputs.
    pub(in crate::devices::can_dp2::emulation) fn outputs(&self, octets: usize) -> Vec<u8> {
        load(&self.outputs.outputs[..octets.min(self.outputs.outputs.len())])
    }

    /// Writes inputs from index `first` on.
    pub(in crate::devices::can_dp2::emulation) fn set_inputs(&self, first: usize, octets: &[u8]) {
        self.inputs.inputs.iter().skip(first).zip(octets).for_each(|(cell, octet)| cell.store(*octet));
    }

    /// Returns the octet of input `number` in the image.
    pub(in crate::devices::can_dp2::emulation) fn input(&self, number: usize) -> u8 {
        self.inputs.inputs.get(number).map_or(0, Cell8::load)
    }

    /// Writes all outputs; missing octets are 0.
    pub(in crate::devices::can_dp2::emulation) fn set_outputs(&self, octets: &[u8]) {
        fill(&self.outputs.outputs, octets);
    }

    /// Shows the parameters in force.
    pub(in crate::devices::can_dp2::emulation) fn set_parameters(&self, parameters: &Parameters) {
        let prm = &self.prm;
        let cells: [&Cell8; LENGTH] = [
            &prm.station_status,
            &prm.wd_fact_1,
            &prm.wd_fact_2,
            &prm.min_tsdr,
            &prm.ident_high,
            &prm.ident_low,
            &prm.group_ident,
            &prm.constant_7,
            &prm.can_bitrate,
            &prm.flags_1,
            &prm.module_id,
            &prm.flags_2,
            &prm.constant_12,
            &prm.wakeup_time,
            &prm.sync_time_high,
            &prm.sync_time_low,
        ];
        cells.into_iter().zip(parameters.octets).for_each(|(cell, octet)| cell.store(octet));
        prm.prm_len.store(LENGTH as u8);
        if parameters.role() == Role::Layer2 {
            // Manual p. 29: in layer 2, wake-up time and SYNC time are ignored (D-720).
            return;
        }
        if let Some(time) = parameters.wakeup_s() {
            self.stored.stored_wakeup_time.store(time);
        }
        self.set_sync_time(parameters.sync_ms());
    }

    /// Sets the SYNC time in ms, from parameters, the comment of a window or command 20. The most recent of
    /// these settings is valid. 16#FFFF keeps the stored time (p. 30, 39, 44; D-385). Returns true if the
    /// time has become the stored time.
    pub(in crate::devices::can_dp2::emulation) fn set_sync_time(&self, time: u16) -> bool {
        let is_taken = time != SYNC_STORED;
        if is_taken {
            self.stored.stored_sync_time.store(time);
        }
        is_taken
    }

    /// Writes the configuration in force into the registers, and sets all inputs and outputs to 0.
    pub(in crate::devices::can_dp2::emulation) fn set_configuration(&self, configuration: &Configuration) {
        let Configuration { octets, modules, inputs, outputs, sync_ms: _ } = configuration;
        self.cfg.cfg_len.store(octets.len() as u8);
        self.cfg.input_len.store(*inputs as u8);
        self.cfg.output_len.store(*outputs as u8);
        self.cfg.modules.store(modules.len() as u8);
        fill(&self.cfg.cfg, octets);
        fill(&self.inputs.inputs, &[]);
        fill(&self.outputs.outputs, &[]);
        for number in 0..MODULES {
            let (cells, module) = (&self.cfg.module[number], modules.get(number));
            let number_of = |id: &Id| match id {
                Id::Standard(id) => id.as_raw().into(),
                Id::Extended(id) => id.as_raw() | EXTENDED,
            };
            let (kind, id, cycle) = match module.map(|module| module.kind) {
                None => (module_kind::NONE, 0, 0),
                Some(ModuleFunction::Input { id, is_frozen: false }) => {
                    (module_kind::INPUT, number_of(&id), 0)
                }
                Some(ModuleFunction::Input { id, is_frozen: true }) => {
                    (module_kind::FROZEN_INPUT, number_of(&id), 0)
                }
                Some(ModuleFunction::Output { id, cycle_ms }) => {
                    (module_kind::OUTPUT, number_of(&id), cycle_ms)
                }
                Some(ModuleFunction::Dummy) => (module_kind::DUMMY_OUTPUT, 0, 0),
                Some(ModuleFunction::WindowInput) => (module_kind::WINDOW_INPUT, 0, 0),
                Some(ModuleFunction::WindowOutput) => (module_kind::WINDOW_OUTPUT, 0, 0),
                Some(ModuleFunction::PageInput) => (module_kind::PAGE_INPUT, 0, 0),
                Some(ModuleFunction::PageOutput) => (module_kind::PAGE_OUTPUT, 0, 0),
            };
            cells.kind.store(kind);
            cells.id.store(id);
            cells.cycle.store(cycle);
            let octet = |of: fn(&super::modules::Module) -> usize| module.map_or(0, of) as u8;
            cells.length.store(octet(|module| module.length));
            cells.first.store(octet(|module| module.first));
            cells.form.store(octet(|module| module.form.into()));
        }
    }
}
