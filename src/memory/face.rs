//! The header page as the firmware of a device has it: what it shows there, and what it is asked.
//!
//! For most plants that is one page. Where several plants are to go the same way, what programs ask must be told to all of them
//! before any firmware sees it, whenever a program stores it: there firmware reads it in a page of its own, which whoever tells it
//! renews.

use super::{Cell32, Header, View};
use core::ops::Deref;

/// The header page, for firmware. What it dereferences to is the page that programs see.
pub struct Face {
    shown: View<Header>,
    asked: View<Header>,
}

impl Deref for Face {
    type Target = Header;

    #[inline]
    fn deref(&self) -> &Header {
        &self.shown
    }
}

impl Face {
    pub(super) fn new(shown: View<Header>, asked: View<Header>) -> Self {
        Face { shown, asked }
    }

    /// Where everything stands that programs write: switches, requests, what a program does.
    #[inline]
    #[must_use]
    pub fn asked(&self) -> &Header {
        &self.asked
    }

    fn is_one(&self) -> bool {
        core::ptr::eq(&raw const *self.shown, &raw const *self.asked)
    }

    /// Does something to what programs write as well, once.
    pub fn both(&self, act: impl Fn(&Header)) {
        act(&self.asked);
        if !self.is_one() {
            act(&self.shown);
        }
    }

    /// Stores what programs write as well, as a switch that the firmware turns.
    pub fn put(&self, cell: impl Fn(&Header) -> &Cell32, value: u32) {
        self.both(|page| cell(page).store(value));
    }

    /// Takes a request, if there is one; if it was replaced meanwhile, the next look takes the new one.
    pub fn take(&self, cell: impl Fn(&Header) -> &Cell32) -> Option<u32> {
        let request = cell(&self.asked).load();
        let is_taken = request != 0 && cell(&self.asked).compare_exchange(request, 0).is_ok();
        if is_taken && !self.is_one() {
            // A further one that stands there is told in its turn.
            let _ = cell(&self.shown).compare_exchange(request, 0);
        }
        is_taken.then_some(request)
    }

    /// Puts in a request, as a program that submits it.
    pub fn ask(&self, cell: impl Fn(&Header) -> &Cell32, request: u32) {
        self.put(cell, request);
        self.asked.board_requests.increment();
    }
}
