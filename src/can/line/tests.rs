use super::*;
use crate::can::{Payload, reference};
use embedded_can::{ExtendedId, StandardId};
use proptest::prelude::*;
use std::collections::VecDeque;

const RATE: BitRate = BitRate::new(1_000_000).unwrap();

/// Controllers with a queue each.
#[derive(Default)]
struct Stations {
    now_ns: u64,
    /// Frames of each station. A station has a frame to send from the given time on, in nanoseconds.
    queues: Vec<VecDeque<(u64, Frame)>>,
    off: Vec<usize>,
    passive: Vec<usize>,
}

impl Stations {
    fn new(queues: impl IntoIterator<Item = Vec<(u64, Frame)>>) -> Self {
        Stations { queues: queues.into_iter().map(VecDeque::from).collect(), ..Stations::default() }
    }

    /// Runs all actions until `end_ns`, or until all actions have run.
    fn run(&mut self, line: &mut Line, end_ns: u64) -> Vec<Event> {
        let mut events = Vec::new();
        loop {
            while let Some(event) = line.advance(self.now_ns, self) {
                if let Event::Delivered(it) = event {
                    self.queues[it.sender].pop_front();
                }
                events.push(event);
            }
            let ready = self.queues.iter().filter_map(|queue| queue.front()).map(|(time, _)| *time);
            let next = ready.chain(line.next_ns()).filter(|time| *time > self.now_ns).min();
            match next.filter(|next| *next <= end_ns) {
                Some(next) => self.now_ns = next,
                None => return events,
            }
        }
    }
}

impl Participants for Stations {
    fn first(&self, at_ns: u64, but: Option<usize>) -> Option<(usize, Frame)> {
        let fronts = self
            .queues
            .iter()
            .enumerate()
            .filter_map(|(participant, queue)| Some((participant, queue.front()?)));
        let ready = fronts.filter(|(participant, (ready, _))| {
            *ready <= at_ns && but != Some(*participant) && !self.off.contains(participant)
        });
        ready
            .map(|(participant, (_, frame))| (participant, *frame))
            .min_by_key(|(_, frame)| frame.arbitration())
    }

    fn is_heard(&self, sender: usize, _: u64) -> bool {
        (0..self.queues.len()).any(|participant| participant != sender && !self.off.contains(&participant))
    }

    fn is_passive(&self, participant: usize) -> bool {
        self.passive.contains(&participant)
    }
}

/// Returns the duration of bits at the rate of these tests.
fn bits(count: u32) -> u64 {
    RATE.time_ns(count)
}

fn standard(id: u16) -> Frame {
    Frame::standard(id, Payload::EMPTY)
}

fn delivered(events: &[Event]) -> Vec<(usize, Frame)> {
    let of = |event: &Event| match event {
        Event::Delivered(it) => Some((it.sender, it.frame)),
        Event::Begun(_) | Event::Failed(_) => None,
    };
    events.iter().filter_map(of).collect()
}

#[test]
fn the_dominant_frame_goes_first_and_the_others_wait() {
    let remote = Frame::remote(StandardId::new(0x123).unwrap(), 0).unwrap();
    let extended = Frame::new(ExtendedId::new(0x123 << 18).unwrap(), Payload::EMPTY);
    let frames = [standard(0x124), extended, remote, standard(0x123)];
    let mut stations = Stations::new(frames.map(|frame| vec![(0, frame)]));
    let events = stations.run(&mut Line::new(RATE), u64::MAX);
    let expected = [(3, standard(0x123)), (2, remote), (1, extended), (0, standard(0x124))];
    assert_eq!(delivered(&events), expected);
}

#[test]
fn a_dominant_frame_that_comes_later_waits_for_the_one_on_the_wire() {
    let (late, mut line) = (standard(0), Line::new(RATE));
    let mut stations = Stations::new([vec![(0, standard(0x7FF)), (0, standard(0x700))], vec![(1, late)]]);
    let events = stations.run(&mut line, 1);
    let [Event::Begun(first)] = events[..] else { panic!("{events:?}") };
    assert_eq!(line.on_wire(), Some(&first));
    let events = stations.run(&mut line, first.free_ns);
    assert_eq!(events[0], Event::Delivered(first));
    let [_, Event::Begun(second)] = events[..] else { panic!("{events:?}") };
    assert_eq!((second.sender, second.frame, second.begin_ns), (1, late, first.free_ns));
}

/// Decision D-349.
#[test]
fn of_equal_arbitration_fields_that_of_the_first_participant_goes_first() {
    let frames = [0, 1].map(|byte| Frame::standard(0x55, Payload::new(&[byte]).unwrap()));
    for order in [[0, 1], [1, 0]] {
        let mut stations = Stations::new(order.map(|which| vec![(0, frames[which])]));
        let events = stations.run(&mut Line::new(RATE), u64::MAX);
        assert_eq!(delivered(&events), [(0, frames[order[0]]), (1, frames[order[1]])]);
    }
}

/// Decision D-350.
#[test]
fn alone_a_station_repeats_its_frame_for_ever() {
    let mut line = Line::new(RATE);
    let mut stations = Stations::new([vec![(0, standard(1))], vec![]]);
    stations.off = vec![1];
    let to_flag = wire::bits_to_acknowledgement(&standard(1)) + 1;
    let round = to_flag + 6 + 8 + 3;
    let events = stations.run(&mut line, bits(2 * round + to_flag));
    let begun = |event: &Event| match event {
        Event::Begun(it) | Event::Failed(it) if it.fate == Fate::NotAcknowledged => (it.begin_ns, it.end_ns),
        _ => panic!("{event:?}"),
    };
    let expected = [0, 0, 1, 1, 2, 2].map(|nth| (bits(nth * round), bits(nth * round + to_flag)));
    assert_eq!(events.iter().map(begun).collect::<Vec<_>>(), expected);
    // Now a second station is on the bus.
    stations.off.clear();
    let events = stations.run(&mut line, u64::MAX);
    assert_eq!(delivered(&events), [(0, standard(1))]);
}

#[test]
fn a_passive_station_waits_after_its_own_frame() {
    let mut line = Line::new(RATE);
    let urgent = vec![(0, standard(1)), (0, standard(2))];
    let mut stations = Stations::new([urgent, vec![(0, standard(0x300))], vec![]]);
    stations.passive = vec![0, 2];
    let events = stations.run(&mut line, u64::MAX);
    assert_eq!(delivered(&events), [(0, standard(1)), (1, standard(0x300)), (0, standard(2))]);
    // No other station has a frame to send.
    let mut stations = Stations::new([vec![(0, standard(1)), (0, standard(2))], vec![]]);
    stations.passive = vec![0];
    let events = stations.run(&mut Line::new(RATE), u64::MAX);
    let [_, Event::Delivered(first), Event::Begun(second), _] = events[..] else { panic!("{events:?}") };
    assert_eq!(second.begin_ns, first.free_ns + bits(8));
    // Another station has a frame within the eight bits.
    let late = first.free_ns + bits(5);
    let frames = vec![(0, standard(1)), (0, standard(2))];
    let mut stations = Stations::new([frames, vec![(late, standard(0x300))]]);
    stations.passive = vec![0];
    let events = stations.run(&mut Line::new(RATE), u64::MAX);
    let [_, _, Event::Begun(second), ..] = events[..] else { panic!("{events:?}") };
    assert_eq!((second.sender, second.begin_ns), (1, late));
}

#[test]
fn a_station_without_power_sends_nothing() {
    let mut line = Line::new(RATE);
    let mut stations = Stations::new([vec![(0, standard(1))], vec![(0, standard(2))], vec![]]);
    stations.off = vec![0];
    let events = stations.run(&mut line, 1_000_000);
    assert_eq!(delivered(&events), [(1, standard(2))]);
}

/// If a sender goes off in the middle of its frame, the bus stays recessive, and the sixth recessive bit after the cut
/// makes the other stations send an error flag.
#[test]
fn a_frame_is_destroyed_if_its_sender_goes_off() {
    let to_acknowledgement = wire::bits_to_acknowledgement(&standard(1));
    for (over, to_flag) in [
        (10, Some(16)),
        (to_acknowledgement - 1, Some(to_acknowledgement + 2)),
        (to_acknowledgement, None),
        (to_acknowledgement + 5, None),
    ] {
        let mut line = Line::new(RATE);
        let mut stations = Stations::new([vec![(0, standard(1))], vec![(0, standard(2))], vec![]]);
        stations.run(&mut line, bits(over) - 1);
        line.sender_gone(bits(over) - 1);
        stations.off = vec![0];
        let events = stations.run(&mut line, 1_000_000);
        let Some(to_flag) = to_flag else {
            assert_eq!(delivered(&events), [(0, standard(1)), (1, standard(2))], "{over}");
            continue;
        };
        let [Event::Failed(it), Event::Begun(next), ..] = events[..] else { panic!("{events:?}") };
        assert_eq!((it.fate, it.end_ns), (Fate::SenderGone, bits(to_flag)), "{over}");
        assert_eq!((next.sender, next.begin_ns), (1, bits(to_flag + 6 + 8 + 3)));
    }
}

#[test]
fn a_frame_without_receivers_is_not_acknowledged() {
    let to_acknowledgement = wire::bits_to_acknowledgement(&standard(1));
    for (over, fate) in [(to_acknowledgement, Fate::NotAcknowledged), (to_acknowledgement + 1, Fate::Arrives)]
    {
        let mut line = Line::new(RATE);
        let mut stations = Stations::new([vec![(0, standard(1))], vec![]]);
        stations.run(&mut line, bits(over) - 1);
        line.nobody_left(bits(over));
        assert_eq!(line.on_wire().map(|it| it.fate), Some(fate), "{over}");
    }
}

#[test]
fn a_disturbed_frame_is_repeated_at_once() {
    let mut line = Line::new(RATE);
    let mut stations = Stations::new([vec![(0, standard(1))], vec![(0, standard(2))]]);
    stations.run(&mut line, 0);
    line.disturb();
    let events = stations.run(&mut line, u64::MAX);
    let to_flag = wire::bits_to_acknowledgement(&standard(1));
    let [Event::Failed(it), Event::Begun(again), ..] = events[..] else { panic!("{events:?}") };
    assert_eq!((it.fate, it.end_ns), (Fate::Disturbed, bits(to_flag)));
    assert_eq!((again.sender, again.begin_ns), (0, bits(to_flag + 6 + 8 + 3)));
    assert_eq!(delivered(&events), [(0, standard(1)), (1, standard(2))]);
}

#[test]
fn a_lone_sender_that_withdraws_causes_an_error() {
    let mut line = Line::new(RATE);
    let mut stations = Stations::new([vec![(0, standard(1))], vec![]]);
    stations.passive = vec![0];
    assert_eq!(line.next_sender(0, &stations), Some((0, standard(1))));
    let Event::Begun(it) = line.withdraw(0, 0, standard(1)) else { panic!() };
    assert_eq!((it.fate, it.end_ns, it.free_ns), (Fate::Withdrawn, bits(7), bits(7 + 6 + 8 + 3)));
    assert_eq!(line.next_sender(0, &stations), None);
    // This station did not send the last frame, so it need not wait for the additional eight bits.
    let events = stations.run(&mut line, bits(24));
    let [Event::Failed(_), Event::Begun(again)] = events[..] else { panic!("{events:?}") };
    assert_eq!((again.sender, again.begin_ns), (0, bits(24)));
}

#[test]
fn the_wire_is_quiet_after_each_frame() {
    let mut line = Line::new(RATE);
    let mut stations = Stations::new([vec![(0, standard(1)), (0, standard(2))], vec![]]);
    stations.run(&mut line, 0);
    assert_eq!(line.quiet_ns(), None);
    let Some(first) = line.on_wire().copied() else { panic!() };
    stations.run(&mut line, first.end_ns);
    assert_eq!(line.quiet_ns(), Some(first.end_ns - bits(8)));
    stations.run(&mut line, first.free_ns);
    line.disturb();
    let Some(second) = line.on_wire().copied() else { panic!() };
    stations.run(&mut line, second.end_ns);
    assert_eq!(line.quiet_ns(), Some(second.end_ns + bits(6)));
}

/// Returns the expected traffic, computed in another way than in the line. At each start of a frame, this function
/// arbitrates between the first frames of the queues bit by bit. It counts the bits of the winner for the duration of
/// the frame.
fn expected(stations: &Stations, bit_ns: u64) -> Vec<(u64, usize, Frame)> {
    let (mut queues, mut free, mut traffic) = (stations.queues.clone(), 0, Vec::new());
    while let Some(earliest) = queues.iter().filter_map(|queue| queue.front()).map(|(ready, _)| *ready).min()
    {
        let begin = earliest.max(free);
        let ready = |queue: &VecDeque<(u64, Frame)>| queue.front().is_some_and(|(ready, _)| *ready <= begin);
        let (participant, frames): (Vec<_>, Vec<_>) = queues
            .iter()
            .enumerate()
            .filter(|(_, it)| ready(it))
            .map(|(participant, it)| (participant, it[0].1))
            .unzip();
        let winner = reference::winner(&frames).unwrap();
        let frame = frames[winner];
        let bits =
            reference::stuffed_part(&frame).len() as u64 + u64::from(reference::stuff_bits(&frame)) + 10;
        traffic.push((begin + bits * bit_ns, participant[winner], frame));
        free = begin + (bits + 3) * bit_ns;
        queues[participant[winner]].pop_front();
    }
    traffic
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn traffic_is_that_of_the_bit_by_bit_reference(
        queues in prop::collection::vec(prop::collection::vec((0u64..1_000_000, reference::frame()), 0..6), 2..6),
        bit_ns in prop::sample::select(vec![1000u64, 1250, 8000]),
    ) {
        let mut stations = Stations::new(queues);
        let expected = expected(&stations, bit_ns);
        let rate = BitRate::new((1_000_000_000 / bit_ns) as u32).unwrap();
        let events = stations.run(&mut Line::new(rate), u64::MAX);
        let of = |event: &Event| match event {
            Event::Delivered(it) => Some((it.end_ns, it.sender, it.frame)),
            Event::Begun(_) | Event::Failed(_) => None,
        };
        prop_assert_eq!(events.iter().filter_map(of).collect::<Vec<_>>(), expected);
    }
}
