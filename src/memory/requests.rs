//! Requests of programs in the header page, which firmware may read in a separate page.

use super::{Cell32, FirmwareHeader, Header, Segment};
use crate::layout::{FrontWord, Owner};
use core::iter;

impl Header {
    /// Returns the cells that programs write, for a device with this front. Requests precede their parameters in this
    /// list, but programs store the parameters first. So a reader that reads the cells in this order and finds a
    /// request also finds its parameters.
    fn request_cells<'a>(&'a self, front: &'a [FrontWord]) -> impl Iterator<Item = &'a Cell32> {
        let Header { board, program, initial_flag: flag, opt_init, .. } = self;
        let requests =
            [&program.start_request, &self.project_request, &flag.request, &opt_init.request].into_iter();
        let requests = requests.chain(self.interrupts.iter().map(|it| &it.request));
        let switches = [&board.dip, &board.leds, &board.switch, &program.state, &program.power];
        let inputs = [&self.program_cycles, &flag.flag, &flag.width, &flag.value];
        let timers = opt_init.timers.iter().flat_map(|it| [&it.divider, &it.enable, &it.cfg_mode]);
        let ports = self.ports.iter().flat_map(|port| [&port.dip, &port.restarts_written]);
        let front = front.iter().filter(|word| word.owner == Owner::Plc);
        let front = front.filter_map(|word| self.front.get(word.index()));
        requests
            .chain(switches)
            .chain(inputs)
            .chain(timers)
            .chain(&opt_init.triggers)
            .chain(ports)
            .chain(front)
    }
}

impl Segment {
    /// Calls `each` for each cell, with its value in the firmware's page and in the programs' page. Does nothing if
    /// both are the same page.
    fn for_each_request_cell(&self, front: &[FrontWord], mut each: impl FnMut(u16, &Cell32, &Cell32)) {
        let Some(face) = self.both_pages() else { return };
        let cells = face.requested().request_cells(front).zip((*face).request_cells(front));
        iter::zip(0.., cells).for_each(|(index, (asked, written))| each(index, asked, written));
    }

    /// True if programs have written something that the firmware's page does not have yet.
    pub(crate) fn has_new_requests(&self, front: &[FrontWord]) -> bool {
        let mut has_any = false;
        self.for_each_request_cell(front, |_, asked, written| has_any |= asked.load() != written.load());
        has_any
    }

    /// Copies new requests to the firmware's page; returns the index and value of each changed cell.
    pub(crate) fn deliver_requests(&self, front: &[FrontWord]) -> Vec<(u16, u32)> {
        let mut changed = Vec::new();
        self.for_each_request_cell(front, |index, asked, written| {
            let value = written.load();
            if asked.load() != value {
                asked.store(value);
                changed.push((index, value));
            }
        });
        if !changed.is_empty() {
            self.submit_requests();
        }
        changed
    }

    /// Repeats in this memory segment a change that [`Segment::deliver_requests`] has returned for the same device on
    /// another host. Ignores an index without a cell.
    pub(crate) fn store_request(&self, front: &[FrontWord], index: u16, value: u32) {
        self.for_each_request_cell(front, |at, asked, written| {
            if at == index {
                asked.store(value);
                written.store(value);
            }
        });
        self.submit_requests();
    }

    /// Copies the programs' page to the firmware's page, after a snapshot was restored.
    pub(crate) fn copy_requests(&self, front: &[FrontWord]) {
        self.for_each_request_cell(front, |_, asked, written| asked.store(written.load()));
        if let Some(face) = self.both_pages() {
            face.requested().board_requests.store(face.board_requests.load());
        }
    }

    fn submit_requests(&self) {
        if let Some(face) = self.both_pages() {
            face.requested().board_requests.increment();
        }
    }

    /// Returns the pages of firmware and programs; `None` if both are the same page.
    fn both_pages(&self) -> Option<FirmwareHeader> {
        self.asked.as_ref().and_then(|_| self.firmware_header().ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::PANEL;
    use crate::memory::header::RunSwitch;

    fn deliver(segment: &Segment) -> Vec<u32> {
        segment.deliver_requests(PANEL.front).into_iter().map(|(_, value)| value).collect()
    }

    #[test]
    fn firmware_with_a_separate_page_reads_only_delivered_requests() {
        let segment = Segment::of(&PANEL).with_request_page();
        let (header, face) = (segment.header().unwrap(), segment.firmware_header().unwrap());
        let word = PANEL.front.iter().find(|word| word.owner == Owner::Plc).unwrap();
        header.board.switch.store(RunSwitch::Stop.code());
        header.front[word.index()].store(3);
        header.interrupts[12].ask(7, true);
        header.program.start_kind.store(9);
        assert_eq!(
            (face.requested().board.switch.load(), face.requested().interrupts[12].request.load()),
            (0, 0)
        );
        assert!(segment.has_new_requests(PANEL.front));
        let before = face.requested().board_requests.load();
        assert_eq!(
            deliver(&segment),
            [0x0007_0003, 1, 3],
            "requests first, and nothing that programs do not write"
        );
        assert!(!segment.has_new_requests(PANEL.front) && deliver(&segment).is_empty());
        assert_eq!(face.requested().board_requests.load(), before + 1);
        assert_eq!(face.requested().board.switch.load(), RunSwitch::Stop.code());
    }

    #[test]
    fn delivered_requests_make_another_segment_equal() {
        let [segment, other] = [Segment::of(&PANEL), Segment::of(&PANEL)].map(Segment::with_request_page);
        let header = segment.header().unwrap();
        header.board.dip.store(21);
        header.opt_init.triggers[1].store(4);
        header.opt_init.ask();
        for (index, value) in segment.deliver_requests(PANEL.front) {
            other.store_request(PANEL.front, index, value);
        }
        other.store_request(PANEL.front, u16::MAX, 1);
        let face = other.firmware_header().unwrap();
        for page in [face.requested(), &*face] {
            let triggers = [0, 1, 2].map(|n| page.opt_init.triggers[n].load());
            let request = page.opt_init.request.load();
            assert_eq!((page.board.dip.load(), triggers, request), (21, [0, 4, 0], 1));
        }
        assert!(!other.has_new_requests(PANEL.front), "it is not delivered back");
    }

    #[test]
    fn taking_a_request_keeps_the_next_one() {
        let segment = Segment::of(&PANEL).with_request_page();
        let (header, face) = (segment.header().unwrap(), segment.firmware_header().unwrap());
        let request = |page: &Header| page.program.start_request.load();
        header.program.start_request.store(2);
        assert_eq!(deliver(&segment), [2]);
        header.program.start_request.store(4);
        assert_eq!(
            face.take(|page| &page.program.start_request),
            Some(2),
            "the other one was not delivered yet"
        );
        assert_eq!(face.take(|page| &page.program.start_request), None);
        assert_eq!((request(face.requested()), request(&header)), (0, 4));
        assert_eq!(deliver(&segment), [4]);
        assert_eq!(face.take(|page| &page.program.start_request), Some(4));
        assert_eq!((request(face.requested()), request(&header)), (0, 0));
        assert!(deliver(&segment).is_empty());
    }

    #[test]
    fn firmware_usually_reads_the_page_that_programs_write() {
        let segment = Segment::of(&PANEL);
        let (header, face) = (segment.header().unwrap(), segment.firmware_header().unwrap());
        header.program.power.store(1);
        assert_eq!(face.requested().program.power.load(), 1);
        assert!(!segment.has_new_requests(PANEL.front) && deliver(&segment).is_empty());
        face.both(|page| {
            page.program.restarts.increment();
        });
        face.ask(|page| &page.program.start_request, 3);
        assert_eq!((header.program.restarts.load(), header.board_requests.load()), (1, 1), "once");
        assert_eq!(face.take(|page| &page.program.start_request), Some(3));
        assert_eq!(header.program.start_request.load(), 0);
    }

    #[test]
    fn a_restored_state_is_requested_as_written() {
        let segment = Segment::of(&PANEL).with_request_page();
        let (header, face) = (segment.header().unwrap(), segment.firmware_header().unwrap());
        header.board.switch.store(1);
        header.board_requests.store(77);
        segment.copy_requests(PANEL.front);
        assert_eq!((face.requested().board.switch.load(), face.requested().board_requests.load()), (1, 77));
        assert!(!segment.has_new_requests(PANEL.front));
    }
}
