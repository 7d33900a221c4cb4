//! Initial values of retain flags. A cold start gives the flags these values (manual 5.00005.03a p. 38).

use crate::memory::struct_tables::publish;
use crate::memory::{Cell32, SharedRegs};
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// A request that gives retain flags an initial value, and the firmware's answer. Only one client at a time may use it.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct InitialFlag {
    /// Number of the flag, from 0: the n of `%MB10000000` + n.
    pub flag: Cell32,
    /// Width in bytes: 1, 2 or 4. The width must suit the address of the flag. 0 removes all initial values.
    pub width: Cell32,
    /// Initial value for the flag.
    pub value: Cell32,
    /// Number of the request, different from `answer`; stored last.
    pub request: Cell32,
    /// Number of the request to which `result` belongs.
    pub answer: Cell32,
    /// An [`InitialFlagResult`], stored before `answer`.
    pub result: Cell32,
}

codes! {
    /// Result of a request.
    InitialFlagResult {
        /// The firmware has taken over the initial value; the next cold start writes it into the flag.
        Done = 0,
        /// There is no such flag, it does not suit the width, or the value does not fit.
        NoSuchFlag = 1,
    }
}

// SAFETY: every field is a cell; IntoBytes proves that there is no padding and FromBytes that any bit pattern is valid.
unsafe impl SharedRegs for InitialFlag {}

publish! { InitialFlag: 0 => flag, 4 => width, 8 => value, 12 => request, 16 => answer, 20 => result }
const _: () = assert!(size_of::<InitialFlag>() == 24);

impl InitialFlag {
    /// Removes request and answer.
    pub fn clear(&self) {
        let cells = [&self.flag, &self.width, &self.value, &self.request, &self.answer, &self.result];
        cells.iter().for_each(|cell| cell.store(0));
    }

    /// Stores a request and returns its number. The caller submits it with [`super::Header::submit_request`] and waits
    /// until [`InitialFlag::outcome`] returns the result.
    pub fn ask(&self, flag: u32, width: u32, value: u32) -> u32 {
        self.flag.store(flag);
        self.width.store(width);
        self.value.store(value);
        let request = self.answer.load().wrapping_add(1);
        self.request.store(request);
        request
    }

    /// Returns the result of `request`; `None` while the firmware has not answered.
    pub fn outcome(&self, request: u32) -> Option<u32> {
        (self.answer.load() == request).then(|| self.result.load())
    }
}
