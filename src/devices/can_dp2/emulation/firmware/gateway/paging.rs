//! Page mode: pages come with the outputs of a data exchange (p. 50-60; D-467).

use super::Gateway;
use crate::can::Frame;
use crate::devices::can_dp2::emulation::firmware::parameters::Role;
use crate::devices::can_dp2::registers::values::can_state;

impl Gateway {
    /// Handles the outputs of a data exchange if they are a new page.
    pub(super) fn page(&mut self, outputs: &[u8]) {
        let Some(pages) = &mut self.pages else { return };
        let is_working = self.state == can_state::WORKING;
        let taken = pages.written(outputs, is_working);
        if !taken.is_new {
            return;
        }
        self.registers.set_inputs(0, pages.shown());
        taken.frames.into_iter().for_each(|frame| self.push(frame));
        if taken.has_configured {
            self.is_new = true;
            if is_working {
                self.page_requests().into_iter().for_each(|frame| self.push(frame));
            }
        }
        self.show();
    }

    /// Returns the remote frames for the inputs of the pages. A CANopen master or slave sends them at the
    /// start (p. 29).
    pub(super) fn page_requests(&self) -> Vec<Frame> {
        let asks = self
            .setup
            .as_ref()
            .is_some_and(|setup| setup.parameters.has_rtr() && setup.parameters.role() != Role::Layer2);
        let ids = self.pages.iter().filter(|_| asks).flat_map(|pages| pages.received_ids());
        ids.filter_map(|(id, length)| Frame::remote(id, length)).collect()
    }
}
