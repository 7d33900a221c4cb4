//! Prints records from the journal in a format: selects them and reports gaps.

#[cfg(feature = "script")]
use super::Ring;
use super::kind::RINGS;
use super::{EventKind, Format, Record, Source};
use crate::identity::{BusIndex, DeviceIndex};

/// Selects records. An empty selection means all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Kinds of the wanted records.
    pub kinds: Vec<&'static EventKind>,
    /// Indices of the wanted buses.
    pub buses: Vec<BusIndex>,
    /// Indices of the wanted PLCs, with their nodes. If buses are selected too, records of both are printed.
    pub plcs: Vec<DeviceIndex>,
    /// Excludes records that ended before this emulated time, in microseconds.
    pub since_us: u64,
}

impl Selection {
    /// True if the record is wanted.
    pub fn takes(&self, record: &Record) -> bool {
        let from_there = match record.event.source() {
            _ if self.buses.is_empty() && self.plcs.is_empty() => true,
            Source::Bus(bus) => self.buses.contains(&bus),
            Source::Plc(plc) => self.plcs.contains(&plc),
            Source::Node(origin) => self.plcs.contains(&origin.plc),
        };
        from_there
            && record.time_us >= self.since_us
            && (self.kinds.is_empty() || self.kinds.contains(&record.event.kind()))
    }
}

/// Prints records in the order of their numbers.
///
/// A gap in the numbers means that records are missing. The printer reports a gap only if it may contain wanted
/// records. Every ring drops only its oldest records. So after the first record of a ring in a part of the journal, no
/// later records of that ring are missing in this part.
pub struct Printer<Out = String> {
    format: Box<dyn Format<Out>>,
    selection: Selection,
    /// Number of the next record.
    next: u64,
    /// Number of records missing before the next printed one.
    lost: u64,
    /// Rings that may have dropped wanted records before the next record.
    forgetful: [bool; RINGS],
}

impl<Out> Printer<Out> {
    /// Returns a printer that begins with record number `from`.
    pub fn new(format: Box<dyn Format<Out>>, selection: Selection, from: u64) -> Self {
        Printer { format, selection, next: from, lost: 0, forgetful: [true; RINGS] }
    }

    /// Appends the head of the output.
    pub fn begin(&self, out: &mut Out) {
        self.format.begin(out);
    }

    /// Begins a part: the following records are read from the journal at one moment.
    pub fn begin_part(&mut self) {
        let kinds = &self.selection.kinds;
        self.forgetful = [kinds.is_empty(); RINGS];
        kinds.iter().for_each(|kind| self.forgetful[kind.ring() as usize] = true);
    }

    /// Returns the number of the next record, for the next read.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Continues with record number `from` of another run of the plant. The states of the ports are then unknown.
    pub fn turn_to(&mut self, from: u64)
    where
        Out: Default,
    {
        self.format.gap(0, &mut Out::default());
        (self.next, self.lost) = (from, 0);
    }

    /// Appends the record to `out` if it is wanted. If records are missing before it, appends a note about them first.
    /// Returns the number of missing records if the format cannot express such a note, otherwise 0.
    ///
    /// Records without a number are printed as well. A caller that will read further parts must not print them, because
    /// they come again with their number.
    pub fn print(&mut self, record: &Record, out: &mut Out) -> u64 {
        let lost = self.admit(record);
        self.write(record, lost, out)
    }

    /// First half of [`Printer::print`]. Must be called in the order of the records' numbers. Returns the number of
    /// records missing before the record, or `None` if the user did not select the record.
    pub(crate) fn admit(&mut self, record: &Record) -> Option<u64> {
        if !record.is_pending() {
            if self.forgetful.contains(&true) {
                self.lost += record.seq.saturating_sub(self.next);
            }
            self.next = record.seq.saturating_add(1);
            self.forgetful[record.event.kind().ring() as usize] = false;
        }
        if record.time_us < self.selection.since_us {
            // The missing records are older than the time from which the user wants records, so they are not reported.
            self.lost = 0;
        }
        self.selection.takes(record).then(|| std::mem::take(&mut self.lost))
    }

    /// Second half of [`Printer::print`]. Must be called in the order of the output. `lost` is the result of the first
    /// half.
    pub(crate) fn write(&mut self, record: &Record, lost: Option<u64>, out: &mut Out) -> u64 {
        let Some(lost) = lost else {
            self.format.skip(record);
            return 0;
        };
        let untold = if lost == 0 || self.format.gap(lost, out) { 0 } else { lost };
        self.format.record(record, out);
        untold
    }

    /// Appends a note about the missing records before record number `end`, which cannot be read any more, if there are any.
    /// Returns their number if the format cannot express such a note, otherwise 0.
    pub fn miss(&mut self, end: u64, out: &mut Out) -> u64 {
        let lost = std::mem::take(&mut self.lost) + end.saturating_sub(self.next);
        if lost == 0 || self.format.gap(lost, out) { 0 } else { lost }
    }

    /// Ends the output: appends the text that the format has held back.
    pub fn end(&mut self, out: &mut Out) {
        self.format.end(out);
    }
}

/// True if records of a ring that end at `since_us` or later may be lost. `kept` are the records that a journal keeps, and
/// `begin` is the number of its first record, or that of a return to an earlier moment. A journal that begins with a later record
/// continues from a snapshot; `known_us` is a time at which it had begun.
#[cfg(feature = "script")]
pub(crate) fn may_be_lost(kept: &[Record], ring: Ring, begin: u64, since_us: u64, known_us: u64) -> bool {
    // After a return, the records before it are in the journal, too.
    let is_return = kept.first().is_some_and(|first| first.seq < begin);
    let mut may_be_older = !is_return && begin > 0 && since_us < known_us;
    let (mut next, mut has_gap) = (if is_return { 0 } else { begin }, false);
    for record in kept.iter().filter(|record| !record.is_pending()) {
        has_gap |= record.seq > next;
        next = record.seq.saturating_add(1);
        if record.time_us < since_us {
            (has_gap, may_be_older) = (false, false);
        }
        // A ring drops only its oldest records.
        if record.event.kind().ring() == ring {
            return has_gap || may_be_older;
        }
    }
    // Without a return, a ring that has lost records has later ones. A return removes the later ones.
    may_be_older || is_return && (has_gap || next < begin)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Edge, Refused, catalogue};
    use super::*;
    use crate::identity::PortNumber;
    use crate::journal::candump::Candump;
    use crate::journal::text::Text;
    use crate::journal::{ChannelWrite, Event, EventCodec, Names, Origin};

    fn names() -> Names {
        Names { plcs: vec!["a".into(), "b".into()], buses: vec!["x".into(), "y".into()], ..Names::default() }
    }

    fn record(seq: u64, event: Event) -> Record {
        Record { seq, ..Record::single(10 * seq, event) }
    }

    fn sync(seq: u64, bus: BusIndex) -> Record {
        record(seq, Edge { bus }.into())
    }

    fn write(seq: u64, plc: DeviceIndex) -> Record {
        record(seq, ChannelWrite { plc, offset: 200_000, width: 2, value: 1 }.into())
    }

    fn refused(seq: u64, plc: DeviceIndex) -> Record {
        record(seq, Refused { origin: Origin { plc, node: PortNumber(2) } }.into())
    }

    /// The times are ten times the numbers.
    #[cfg(feature = "script")]
    #[test]
    fn records_since_a_time_may_be_lost_if_a_gap_comes_before_their_ring_begins() {
        let (write, refused) = (|seq| write(seq, DeviceIndex(0)), |seq| refused(seq, DeviceIndex(0)));
        let ring = write(0).event.kind().ring();
        let is_lost = |kept: &[Record], begin, since_us| may_be_lost(kept, ring, begin, since_us, 0);
        assert!(!is_lost(&[write(0), write(1)], 0, 1));
        // The lost records are older than the oldest one.
        assert!(!is_lost(&[write(5)], 0, 51) && is_lost(&[write(5)], 0, 50));
        assert!(is_lost(&[refused(0), refused(3), write(5)], 0, 30));
        assert!(!is_lost(&[refused(0), refused(4), write(5)], 0, 41));
        // The gap after the first record of the ring concerns another ring.
        assert!(!is_lost(&[write(0), refused(5), write(6)], 0, 1));
        // The journal begins with record 5, and in the second case the plant has returned to the moment of record 5.
        assert!(!is_lost(&[write(5)], 5, 1) && is_lost(&[write(4)], 5, 1));
        // The ring has dropped its records before the return.
        assert!(is_lost(&[refused(0)], 5, 1) && !is_lost(&[refused(0), refused(1)], 2, 1));
        assert!(!is_lost(&[refused(5)], 0, 1));
        // The journal begins with record 5 of a snapshot at a time up to 60.
        let is_lost = |kept: &[Record], since_us| may_be_lost(kept, ring, 5, since_us, 60);
        assert!(is_lost(&[], 59) && !is_lost(&[], 60));
        assert!(is_lost(&[write(5)], 50) && !is_lost(&[write(5)], 51));
        assert!(is_lost(&[refused(5)], 50) && !is_lost(&[refused(5), write(6)], 51));
    }

    #[test]
    fn sources_kinds_and_time_select() {
        let all = [
            sync(0, BusIndex(0)),
            sync(1, BusIndex(1)),
            write(2, DeviceIndex(0)),
            write(3, DeviceIndex(1)),
            refused(4, DeviceIndex(0)),
            refused(5, DeviceIndex(1)),
        ];
        let numbers = |selection: Selection| {
            all.iter().filter(|record| selection.takes(record)).map(|record| record.seq).collect::<Vec<_>>()
        };
        let none = Selection::default;
        assert_eq!(numbers(none()), [0, 1, 2, 3, 4, 5]);
        assert_eq!(numbers(Selection { buses: vec![BusIndex(1)], ..none() }), [1]);
        assert_eq!(numbers(Selection { plcs: vec![DeviceIndex(1)], ..none() }), [3, 5]);
        assert_eq!(
            numbers(Selection { plcs: vec![DeviceIndex(1)], buses: vec![BusIndex(0)], ..none() }),
            [0, 3, 5]
        );
        assert_eq!(numbers(Selection { kinds: vec![Edge::KIND, Refused::KIND], ..none() }), [0, 1, 4, 5]);
        assert_eq!(numbers(Selection { since_us: 40, ..none() }), [4, 5]);
    }

    fn lost(selection: Selection, parts: &[&[Record]]) -> u64 {
        let mut printer = Printer::new(Box::new(Candump::new(&names())), selection, 0);
        let mut omitted = 0;
        for part in parts {
            printer.begin_part();
            omitted += part.iter().map(|record| printer.print(record, &mut String::new())).sum::<u64>();
        }
        omitted
    }

    #[test]
    fn a_gap_without_wanted_records_is_not_reported() {
        let kinds = |kind| Selection { kinds: vec![kind], ..Selection::default() };
        // The ring of states still has its first record, so no state is missing. The later gap concerns another ring.
        let first = [refused(0, DeviceIndex(0)), sync(9, BusIndex(0)), refused(10, DeviceIndex(0))];
        assert_eq!(lost(kinds(Refused::KIND), &[&first]), 0);
        assert_eq!(lost(kinds(Edge::KIND), &[&first]), 8);
        assert_eq!(lost(Selection::default(), &[&first]), 8);
        // In the next part, the ring may have dropped records.
        assert_eq!(
            lost(
                kinds(Refused::KIND),
                &[&first, &[refused(20, DeviceIndex(0)), refused(22, DeviceIndex(0))]]
            ),
            9
        );
        let since = Selection { since_us: 90, ..Selection::default() };
        assert_eq!(
            lost(since.clone(), &[&[sync(3, BusIndex(0)), sync(8, BusIndex(0)), sync(9, BusIndex(0))]]),
            0
        );
        assert_eq!(lost(since, &[&[sync(3, BusIndex(0)), sync(8, BusIndex(0)), sync(10, BusIndex(0))]]), 1);
    }

    #[test]
    fn a_gap_is_reported_before_the_next_wanted_record() {
        let selection = Selection { kinds: vec![Edge::KIND], ..Selection::default() };
        let mut printer = Printer::new(Box::new(Text::new(names(), catalogue())), selection, 3);
        let mut out = String::new();
        for record in
            [sync(3, BusIndex(0)), write(5, DeviceIndex(0)), sync(8, BusIndex(1)), sync(9, BusIndex(0))]
        {
            assert_eq!(printer.print(&record, &mut out), 0);
        }
        assert_eq!(printer.next(), 10);
        let lines: Vec<_> = out.lines().map(str::trim_start).collect();
        let (first, last) = ("0.000030 s  x        EDGE", "0.000090 s  x        EDGE");
        assert_eq!(lines, [first, "-- 3 records lost here --", "0.000080 s  y        EDGE", last]);
    }

    #[test]
    fn formats_without_a_place_for_it_leave_it_to_the_caller() {
        let selection = Selection::default();
        let mut printer = Printer::new(Box::new(Candump::new(&names())), selection, 0);
        let mut out = String::new();
        assert_eq!(printer.print(&sync(7, BusIndex(0)), &mut out), 7);
        assert_eq!(printer.print(&Record { seq: Record::PENDING, ..sync(8, BusIndex(0)) }, &mut out), 0);
        assert_eq!((printer.next(), out.as_str()), (8, ""));
    }
}
