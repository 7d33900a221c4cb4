//! `INTR_SET`: an event task of any device subscribes to its event. The block writes a request in the header
//! page (`docs/reference/attach.md`).

#![allow(non_snake_case, non_camel_case_types, reason = "the manual's names, letter for letter")]

use crate::memory::header::InterruptResult;
use crate::plc::{Ram, function_block};

/// A request to the board. A power-on or reset deletes it.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    number: u32,
    restarts: u32,
}

impl Request {
    pub(crate) fn new(ram: &Ram, number: u32) -> Self {
        ram.header().submit_request();
        Request { number, restarts: ram.header().program.restarts.load() }
    }

    pub(crate) fn number(&self) -> u32 {
        self.number
    }

    pub(crate) fn is_of_this_life(&self, ram: &Ram) -> bool {
        self.restarts == ram.header().program.restarts.load()
    }
}

function_block! {
    /// Enables or disables an event (manual 5.00005.03a p. 47-49; 5.02066.01a p. 25 names it with event 11,
    /// decision D-314).
    ///
    /// A call submits the inputs if they have changed since the last call, or if the board was reset. `x_ERR`
    /// is FALSE until [`INTR_SET::is_answered`] is true (decision D-213).
    pub struct INTR_SET(ram: Ram) {
        in {
            /// Event number, 0 to 12.
            i_EVENT: i8;
            /// Reserved by the manual; without effect.
            i_MODE: i16;
            /// CPU timer: its period in units of 50 us.
            i_PAR1: i16;
            /// Reserved by the manual; without effect.
            i_PAR2: i16;
            /// TRUE enables, FALSE disables the event.
            x_EN: bool;
        }
        out {
            /// The inputs were refused.
            x_ERR: bool;
        }
        internal: Option<((i8, i16, bool), Request, bool)>;
    }
}

impl INTR_SET {
    /// Runs one PLC cycle.
    pub fn call(&mut self, ram: &Ram) {
        let inputs = (self.i_EVENT, self.i_PAR1, self.x_EN);
        let slot = usize::try_from(self.i_EVENT).ok().and_then(|event| ram.header().interrupts.get(event));
        let Some(slot) = slot else {
            // No slot is free for the request.
            (self.x_ERR, self.internal) = (true, None);
            return;
        };
        match self.internal {
            Some((of, request, answered)) if of == inputs && request.is_of_this_life(ram) => {
                if let Some(result) = slot.outcome(request.number).filter(|_| !answered) {
                    self.x_ERR = result != InterruptResult::Done.code();
                    self.internal = Some((inputs, request, true));
                }
            }
            _ => {
                self.x_ERR = false;
                let request = Request::new(ram, slot.ask(self.i_PAR1, self.x_EN));
                self.internal = Some((inputs, request, false));
            }
        }
    }

    /// True if `x_ERR` is the result for the inputs of the last call.
    pub fn is_answered(&self) -> bool {
        self.x_ERR || matches!(self.internal, Some((.., true)))
    }
}
