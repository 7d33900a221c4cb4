//! The header page as the firmware of a device has it: what it shows there, and what it is asked.
//!
//! For most plants that is one page. Where several plants are to go the same way, what programs ask must be told to all of them
//! before any firmware sees it, whenever a program stores it: there firmware reads it in a page of its own, which whoever tells it
//! renews.

use super::header::Interrupt;
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

    /// Stores what programs write as well, as a switch that the firmware turns.
    pub fn put(&self, cell: impl Fn(&Header) -> &Cell32, value: u32) {
        cell(&self.asked).store(value);
        if !self.is_one() {
            cell(&self.shown).store(value);
        }
    }

    /// Takes a request: `false` if another one stands there meanwhile.
    pub fn take(&self, cell: impl Fn(&Header) -> &Cell32, request: u32) -> bool {
        let is_taken = cell(&self.asked).compare_exchange(request, 0).is_ok();
        if is_taken && !self.is_one() {
            // A further one that stands there is told in its turn.
            let _ = cell(&self.shown).compare_exchange(request, 0);
        }
        is_taken
    }

    /// Counts one further in a cell that programs count in as well.
    pub fn count(&self, cell: impl Fn(&Header) -> &Cell32) {
        cell(&self.asked).increment();
        if !self.is_one() {
            cell(&self.shown).increment();
        }
    }

    /// No `INTR_SET` was asked for or answered.
    pub fn clear_interrupts(&self) {
        [self.asked(), self].into_iter().for_each(|page| page.interrupts.iter().for_each(Interrupt::clear));
    }

    /// No `OPT_INIT` was asked for or answered.
    pub fn clear_opt_init(&self) {
        [self.asked(), self].into_iter().for_each(|page| page.opt_init.clear());
    }

    /// Puts in a request, as a program that submits it.
    pub fn ask(&self, cell: impl Fn(&Header) -> &Cell32, request: u32) {
        self.put(cell, request);
        self.asked.board_requests.increment();
    }
}
