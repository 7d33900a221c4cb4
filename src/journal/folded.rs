//! Lines for people, with cyclic traffic combined: each frame, handshake or SYNC edge that repeats between two other
//! events becomes one line with a count.

use super::text::{Text, seconds};
use super::{Catalogue, ChannelWrite, Format, Names, Record, Ring, Source};
use std::fmt::Write;

/// Writes records as [`Text`] does, but combines the cyclic traffic of a quiet period: the time until the next other
/// event.
///
/// Frames, telegrams, SYNC edges, and handshakes that do not answer a request of the channel are cyclic. Records with
/// the same source and the same text up to the first `: ` form a group. The text after the first `: ` counts as values,
/// which may differ within a group.
pub(crate) struct Folded {
    text: Text,
    /// The cyclic traffic since the last other event, in the order of the first records.
    groups: Vec<Group>,
    /// Maximum length of a quiet period in emulated microseconds.
    longest_us: u64,
}

/// Equal traffic of a quiet period.
struct Group {
    source: Source,
    /// The first record's text.
    first: String,
    /// The last record's text.
    last: String,
    begin_us: u64,
    end_us: u64,
    count: u64,
    /// Distance of the events in microseconds, if the group is a single record of counted events.
    period_us: Option<u32>,
    /// True if the count of the last record may continue.
    may_continue: bool,
}

impl Folded {
    /// Returns a writer with these names. A quiet period ends after `longest_us` microseconds of emulated time at the
    /// latest.
    pub(crate) fn new(names: Names, catalogue: &'static Catalogue, longest_us: u64) -> Self {
        Folded { text: Text::new(names, catalogue), groups: Vec::new(), longest_us }
    }

    fn count(&mut self, record: &Record) {
        let event = self.text.event(record);
        let source = record.event.source();
        let same = |group: &&mut Group| group.source == source && subject(&group.first) == subject(&event);
        if let Some(group) = self.groups.iter_mut().find(same) {
            group.add(record, event);
            return;
        }
        self.groups.push(Group {
            source,
            last: event.clone(),
            first: event,
            begin_us: record.first_us(),
            end_us: record.time_us,
            count: u64::from(record.count),
            period_us: (record.count > 1).then_some(record.period_us),
            may_continue: record.may_continue(),
        });
    }

    /// Ends the quiet period: appends its lines.
    fn unfold(&mut self, out: &mut String) {
        self.groups.sort_by_key(|group| group.begin_us);
        for group in self.groups.drain(..) {
            self.text.line(group.begin_us, group.source, &group.line(), out);
        }
    }
}

impl Group {
    fn add(&mut self, record: &Record, event: String) {
        self.count += u64::from(record.count);
        self.begin_us = self.begin_us.min(record.first_us());
        self.end_us = self.end_us.max(record.time_us);
        self.may_continue |= record.may_continue();
        self.period_us = None;
        self.last = event;
    }

    fn line(&self) -> String {
        let mut line = self.first.clone();
        if self.count == 1 {
            return line;
        }
        // Writing to a String cannot fail.
        let _ = write!(line, ", {} times", self.count);
        if let Some(period) = self.period_us {
            let _ = write!(line, " every {period} us");
        }
        let _ = write!(line, " until {}", seconds(self.end_us).trim_start());
        if self.first != self.last {
            let _ = write!(line, ", last: {}", values(&self.last));
        }
        if self.may_continue {
            line.push_str(", going on");
        }
        line
    }
}

/// Returns the part of an event's text that repetitions share.
fn subject(event: &str) -> &str {
    event.split_once(": ").map_or(event, |(subject, _)| subject)
}

/// Returns the part of an event's text that changes.
fn values(event: &str) -> &str {
    event.split_once(": ").map_or(event, |(_, values)| values)
}

/// True if the record belongs to the cyclic traffic. The answer to a request through the channel does not belong to it.
fn is_cyclic(record: &Record) -> bool {
    match record.event.kind().ring() {
        Ring::Traffic => true,
        Ring::Registers => record.latency_us.is_none() && !record.event.is::<ChannelWrite>(),
        Ring::Missed | Ring::Rare | Ring::History => false,
    }
}

impl Format for Folded {
    fn record(&mut self, record: &Record, out: &mut String) {
        let begin = self.groups.first().map_or(record.time_us, |group| group.begin_us);
        if !is_cyclic(record) {
            self.unfold(out);
            return self.text.record(record, out);
        }
        if record.time_us.saturating_sub(begin) > self.longest_us {
            self.unfold(out);
        }
        self.count(record);
    }

    fn skip(&mut self, record: &Record) {
        self.text.skip(record);
    }

    fn gap(&mut self, lost: u64, out: &mut String) -> bool {
        self.unfold(out);
        self.text.gap(lost, out)
    }

    fn end(&mut self, out: &mut String) {
        self.unfold(out);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Edge, Packet, Refused, catalogue};
    use super::*;
    use crate::identity::PortNumber;
    use crate::identity::{BusIndex, DeviceIndex};
    use crate::journal::{Event, Origin, Printer, Selection};

    const BUS: BusIndex = BusIndex(0);

    fn names() -> Names {
        Names { plcs: vec!["a".into()], buses: vec!["x".into()], ..Names::default() }
    }

    /// Returns the lines of these records, numbered from 0.
    fn lines(longest_us: u64, records: &[(u64, u32, Event)]) -> Vec<String> {
        let folded = Folded::new(names(), catalogue(), longest_us);
        let mut printer = Printer::new(Box::new(folded), Selection::default(), 0);
        let mut out = String::new();
        for (seq, &(time_us, count, event)) in (0..).zip(records) {
            let record = Record { seq, count, period_us: 10, ..Record::single(time_us, event) };
            printer.print(&record, &mut out);
        }
        printer.end(&mut out);
        out.lines().map(str::to_owned).collect()
    }

    fn packet(data: u8) -> Event {
        Packet { bus: BUS, data }.into()
    }

    fn refused() -> Event {
        Refused { origin: Origin { plc: DeviceIndex(0), node: PortNumber(2) } }.into()
    }

    #[test]
    fn traffic_between_two_events_is_one_line_for_each_subject() {
        let edge = Edge { bus: BUS }.into();
        let records = [
            (1, 1, packet(7)),
            (2, 1, packet(7)),
            (3, 1, refused()),
            (5, 1, packet(7)),
            (34, 4, edge),
            (35, 1, packet(7)),
        ];
        assert_eq!(
            lines(u64::MAX, &records),
            [
                "     0.000001 s  x        07, 2 times until 0.000002 s",
                "     0.000003 s  a:port2  refused",
                "     0.000004 s  x        EDGE, 4 times every 10 us until 0.000034 s",
                "     0.000005 s  x        07, 2 times until 0.000035 s",
            ]
        );
    }

    #[test]
    fn a_quiet_period_ends_after_its_longest_time() {
        let records = [(0, 1, packet(7)), (60, 1, packet(7)), (101, 1, packet(7))];
        assert_eq!(
            lines(100, &records),
            ["     0.000000 s  x        07, 2 times until 0.000060 s", "     0.000101 s  x        07"]
        );
    }

    #[test]
    fn values_are_those_of_the_first_and_the_last_event() {
        assert_eq!(
            (subject("16#301 RDC1 of slave 1: 0000"), values("RDC1: 0000")),
            ("16#301 RDC1 of slave 1", "0000")
        );
        let group = Group {
            source: Source::Bus(BUS),
            first: "RDC1: 0000".into(),
            last: "RDC1: 1111".into(),
            begin_us: 0,
            end_us: 1_500_000,
            count: 3,
            period_us: None,
            may_continue: true,
        };
        assert_eq!(group.line(), "RDC1: 0000, 3 times until 1.500000 s, last: 1111, going on");
    }
}
