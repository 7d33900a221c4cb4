//! Requests of programs in the header page, which firmware may read in a separate page.

use super::{Cell32, Face, Header, Segment};
use crate::layout::{FrontWord, Owner};
use core::iter;

impl Header {
    /// The cells that programs write, for a device with this front. Requests come first: a reader that goes in this
    /// order and finds a request also finds its parameters.
    fn asked<'a>(&'a self, front: &'a [FrontWord]) -> impl Iterator<Item = &'a Cell32> {
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
    /// For each cell, the value in the page of the firmware and in the page of the programs; does nothing if both are
    /// one page.
    fn asked_and_written(&self, front: &[FrontWord], mut each: impl FnMut(u16, &Cell32, &Cell32)) {
        let Some(face) = self.apart() else { return };
        let cells = face.asked().asked(front).zip((*face).asked(front));
        iter::zip(0.., cells).for_each(|(index, (asked, written))| each(index, asked, written));
    }

    /// True if programs have written something that the firmware's page does not have yet.
    pub(crate) fn is_asked(&self, front: &[FrontWord]) -> bool {
        let mut is_asked = false;
        self.asked_and_written(front, |_, asked, written| is_asked |= asked.load() != written.load());
        is_asked
    }

    /// Copies it to the firmware's page; returns the index and value of each changed cell.
    pub(crate) fn tell_asked(&self, front: &[FrontWord]) -> Vec<(u16, u32)> {
        let mut told = Vec::new();
        self.asked_and_written(front, |index, asked, written| {
            let value = written.load();
            if asked.load() != value {
                asked.store(value);
                told.push((index, value));
            }
        });
        if !told.is_empty() {
            self.submit_asked();
        }
        told
    }

    /// Stores in this segment a change of another segment of the same device. Ignores an index without a cell.
    pub(crate) fn store_asked(&self, front: &[FrontWord], index: u16, value: u32) {
        self.asked_and_written(front, |at, asked, written| {
            if at == index {
                asked.store(value);
                written.store(value);
            }
        });
        self.submit_asked();
    }

    /// Copies the programs' page to the firmware's page, after a state was restored.
    pub(crate) fn ask_as_written(&self, front: &[FrontWord]) {
        self.asked_and_written(front, |_, asked, written| asked.store(written.load()));
        if let Some(face) = self.apart() {
            face.asked().board_requests.store(face.board_requests.load());
        }
    }

    fn submit_asked(&self) {
        if let Some(face) = self.apart() {
            face.asked().board_requests.increment();
        }
    }

    /// Both pages; `None` if they are one.
    fn apart(&self) -> Option<Face> {
        self.asked.as_ref().and_then(|_| self.face().ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::PANEL;
    use crate::memory::header::RunSwitch;

    fn told(segment: &Segment) -> Vec<u32> {
        segment.tell_asked(PANEL.front).into_iter().map(|(_, value)| value).collect()
    }

    #[test]
    fn firmware_that_reads_a_page_of_its_own_knows_what_it_was_told() {
        let segment = Segment::of(&PANEL).asked_apart();
        let (header, face) = (segment.header().unwrap(), segment.face().unwrap());
        let word = PANEL.front.iter().find(|word| word.owner == Owner::Plc).unwrap();
        header.board.switch.store(RunSwitch::Stop.code());
        header.front[word.index()].store(3);
        header.interrupts[12].ask(7, true);
        header.program.start_kind.store(9);
        assert_eq!((face.asked().board.switch.load(), face.asked().interrupts[12].request.load()), (0, 0));
        assert!(segment.is_asked(PANEL.front));
        let before = face.asked().board_requests.load();
        assert_eq!(
            told(&segment),
            [0x0007_0003, 1, 3],
            "requests first, and nothing that programs do not write"
        );
        assert!(!segment.is_asked(PANEL.front) && told(&segment).is_empty());
        assert_eq!(face.asked().board_requests.load(), before + 1);
        assert_eq!(face.asked().board.switch.load(), RunSwitch::Stop.code());
    }

    #[test]
    fn what_was_told_makes_another_segment_alike() {
        let [segment, other] = [Segment::of(&PANEL), Segment::of(&PANEL)].map(Segment::asked_apart);
        let header = segment.header().unwrap();
        header.board.dip.store(21);
        header.opt_init.triggers[1].store(4);
        header.opt_init.ask();
        for (index, value) in segment.tell_asked(PANEL.front) {
            other.store_asked(PANEL.front, index, value);
        }
        other.store_asked(PANEL.front, u16::MAX, 1);
        let face = other.face().unwrap();
        for page in [face.asked(), &*face] {
            let triggers = [0, 1, 2].map(|n| page.opt_init.triggers[n].load());
            let request = page.opt_init.request.load();
            assert_eq!((page.board.dip.load(), triggers, request), (21, [0, 4, 0], 1));
        }
        assert!(!other.is_asked(PANEL.front), "it is not told back");
    }

    #[test]
    fn a_request_that_was_taken_leaves_the_next_one_where_it_is() {
        let segment = Segment::of(&PANEL).asked_apart();
        let (header, face) = (segment.header().unwrap(), segment.face().unwrap());
        let request = |page: &Header| page.program.start_request.load();
        header.program.start_request.store(2);
        assert_eq!(told(&segment), [2]);
        header.program.start_request.store(4);
        assert_eq!(face.take(|page| &page.program.start_request), Some(2), "the other one was not told yet");
        assert_eq!(face.take(|page| &page.program.start_request), None);
        assert_eq!((request(face.asked()), request(&header)), (0, 4));
        assert_eq!(told(&segment), [4]);
        assert_eq!(face.take(|page| &page.program.start_request), Some(4));
        assert_eq!((request(face.asked()), request(&header)), (0, 0));
        assert!(told(&segment).is_empty());
    }

    #[test]
    fn usually_firmware_is_asked_in_the_page_that_programs_write() {
        let segment = Segment::of(&PANEL);
        let (header, face) = (segment.header().unwrap(), segment.face().unwrap());
        header.program.power.store(1);
        assert_eq!(face.asked().program.power.load(), 1);
        assert!(!segment.is_asked(PANEL.front) && told(&segment).is_empty());
        face.both(|page| {
            page.program.restarts.increment();
        });
        face.ask(|page| &page.program.start_request, 3);
        assert_eq!((header.program.restarts.load(), header.board_requests.load()), (1, 1), "once");
        assert_eq!(face.take(|page| &page.program.start_request), Some(3));
        assert_eq!(header.program.start_request.load(), 0);
    }

    #[test]
    fn another_state_is_asked_as_it_was_written() {
        let segment = Segment::of(&PANEL).asked_apart();
        let (header, face) = (segment.header().unwrap(), segment.face().unwrap());
        header.board.switch.store(1);
        header.board_requests.store(77);
        segment.ask_as_written(PANEL.front);
        assert_eq!((face.asked().board.switch.load(), face.asked().board_requests.load()), (1, 77));
        assert!(!segment.is_asked(PANEL.front));
    }
}
