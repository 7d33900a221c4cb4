//! The header page as the firmware of a device sees it: the values that it shows, and the requests that it reads.
//!
//! Usually values and requests are in the same page. In a federation several hosts run the same plant, and all of them
//! must have a request of a program before the firmware of any host reads it. In a federation, the firmware therefore
//! reads requests in a separate page, which the emulator updates.

use super::{Cell32, Header, View};
use core::ops::Deref;

/// The header page as firmware uses it. It dereferences to the page that programs see.
pub struct FirmwareHeader {
    current: View<Header>,
    requested: View<Header>,
}

impl Deref for FirmwareHeader {
    type Target = Header;

    #[inline]
    fn deref(&self) -> &Header {
        &self.current
    }
}

impl FirmwareHeader {
    pub(super) fn new(current: View<Header>, requested: View<Header>) -> Self {
        FirmwareHeader { current, requested }
    }

    /// Returns the page with everything that programs write: switches, requests, the state of a program.
    #[inline]
    #[must_use]
    pub fn requested(&self) -> &Header {
        &self.requested
    }

    fn is_one_page(&self) -> bool {
        core::ptr::eq(&raw const *self.current, &raw const *self.requested)
    }

    /// Applies an action to cells that programs write: in the page of programs, and in the separate page of the
    /// firmware if there is one.
    pub fn both(&self, act: impl Fn(&Header)) {
        act(&self.requested);
        if !self.is_one_page() {
            act(&self.current);
        }
    }

    /// Stores to a cell that programs write as well, such as a switch that the firmware turns.
    pub fn put(&self, cell: impl Fn(&Header) -> &Cell32, value: u32) {
        self.both(|page| cell(page).store(value));
    }

    /// Takes a request from the cell, if there is one. If a program replaces the request at this moment, the next call
    /// takes the new request.
    pub fn take(&self, cell: impl Fn(&Header) -> &Cell32) -> Option<u32> {
        let request = cell(&self.requested).load();
        let is_taken = request != 0 && cell(&self.requested).compare_exchange(request, 0).is_ok();
        if is_taken && !self.is_one_page() {
            // If a program has stored a newer request, the exchange fails and keeps it. The emulator copies it to the
            // firmware's page later.
            let _ = cell(&self.current).compare_exchange(request, 0);
        }
        is_taken.then_some(request)
    }

    /// Stores a request in a cell, as a program does.
    pub fn ask(&self, cell: impl Fn(&Header) -> &Cell32, request: u32) {
        self.put(cell, request);
        self.requested.board_requests.increment();
    }
}
