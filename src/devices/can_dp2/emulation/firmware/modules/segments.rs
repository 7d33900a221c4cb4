//! Segments of a page: the modules of a configuration in page mode, without identifiers (p. 50-54).

use super::{CfgError, CfgFault, Configuration, Module, ModuleFunction, RawModule, WINDOW};
use crate::devices::can_dp2::emulation::firmware::pages::Pages;
use crate::devices::can_dp2::emulation::firmware::parameters::Parameters;
use crate::devices::can_dp2::page::{HEAD, MARK, RECORD, SEGMENT};
use core::ops::Range;

/// Returns the function of a module without an identifier. A module with an identifier is an error, because
/// segments of pages have none.
pub(super) fn kind(written: &RawModule<'_>) -> Result<ModuleFunction, CfgError> {
    match (written.comment, written.is_input) {
        ([], true) => Ok(ModuleFunction::PageInput),
        ([], false) => Ok(ModuleFunction::PageOutput),
        _ => Err(CfgError::Identifier),
    }
}

impl Configuration {
    /// Checks the rules of p. 54 for all modules. A Communication Window must be the last module of each
    /// direction. It has no identifier, as in figure 6.4.2.
    pub(super) fn close_pages(&mut self, parameters: &Parameters) -> Result<(), CfgFault> {
        let has_window = self.modules.iter().any(Module::is_window);
        if let [.., one, other] = &mut self.modules[..]
            && parameters.has_window()
            && !has_window
            && (one.length, other.length) == (WINDOW, WINDOW)
            && one.kind != other.kind
        {
            for module in [one, other] {
                let is_input = module.kind == ModuleFunction::PageInput;
                module.kind =
                    if is_input { ModuleFunction::WindowInput } else { ModuleFunction::WindowOutput };
            }
        }
        let last = self.modules.len().saturating_sub(1);
        let wrong = |module: usize, error| CfgFault { module: module as u8, error };
        let numbered = || self.modules.iter().enumerate();
        let is_segment =
            |module: &Module| matches!(module.kind, ModuleFunction::PageInput | ModuleFunction::PageOutput);
        if let Some((early, _)) = numbered().find(|(_, module)| module.is_window())
            && numbered().skip(early).any(|(_, module)| is_segment(module))
        {
            return Err(wrong(early, CfgError::Identifier));
        }
        for (kind, least) in
            [(ModuleFunction::PageInput, SEGMENT), (ModuleFunction::PageOutput, HEAD + RECORD + MARK)]
        {
            let own: Vec<_> = numbered().filter(|(_, module)| module.kind == kind).collect();
            let before = own.split_last().map_or(&[][..], |(_, before)| before);
            if let Some((number, _)) = before.iter().find(|(_, module)| module.length != SEGMENT) {
                return Err(wrong(*number, CfgError::Length));
            }
            if own.iter().map(|(_, module)| module.length).sum::<usize>() < least {
                return Err(wrong(own.last().map_or(last, |(number, _)| *number), CfgError::Length));
            }
        }
        Ok(())
    }

    /// Returns the pages, if the configuration has any.
    pub(in crate::devices::can_dp2::emulation) fn pages(&self) -> Option<Pages> {
        let segments = |kind: ModuleFunction| -> Vec<Range<usize>> {
            self.modules.iter().filter(|module| module.kind == kind).map(Module::range).collect()
        };
        let (outputs, inputs) = (segments(ModuleFunction::PageOutput), segments(ModuleFunction::PageInput));
        (!outputs.is_empty()).then(|| Pages::new(outputs, inputs))
    }
}
