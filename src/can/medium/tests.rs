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
    /// Frames, and when each is there to be sent.
    queues: Vec<VecDeque<(u64, Frame)>>,
    off: Vec<usize>,
    /// Time, station, frame, and whether it is the station's own.
    told: Vec<(u64, usize, Frame, bool)>,
}

impl Stations {
    fn new(queues: impl IntoIterator<Item = Vec<(u64, Frame)>>) -> Self {
        Stations { queues: queues.into_iter().map(VecDeque::from).collect(), ..Stations::default() }
    }

    /// Everything until `end_ns` or until nothing is left to do: what begins, arrives or is lost.
    fn run(&mut self, medium: &mut Medium, end_ns: u64) -> Vec<Event> {
        let mut events = Vec::new();
        loop {
            events.extend(std::iter::from_fn(|| medium.advance(self.now_ns, self)));
            let ready = self.queues.iter().filter_map(|queue| queue.front()).map(|(time, _)| *time);
            let next = ready.filter(|time| *time > self.now_ns).chain(medium.next_ns()).min();
            match next.filter(|next| *next <= end_ns) {
                Some(next) => self.now_ns = next,
                None => return events,
            }
        }
    }
}

impl Participants for Stations {
    fn count(&self) -> usize {
        self.queues.len()
    }

    fn is_on(&self, who: usize) -> bool {
        !self.off.contains(&who)
    }

    fn offer(&self, who: usize) -> Option<Frame> {
        let (ready, frame) = self.queues[who].front()?;
        (*ready <= self.now_ns).then_some(*frame)
    }

    fn sent(&mut self, who: usize, now_ns: u64, frame: &Frame) {
        self.told.push((now_ns, who, *frame, true));
        self.queues[who].pop_front();
    }

    fn received(&mut self, who: usize, now_ns: u64, frame: &Frame) {
        self.told.push((now_ns, who, *frame, false));
    }
}

fn standard(id: u16) -> Frame {
    Frame::standard(id, Payload::EMPTY)
}

fn delivered(events: &[Event]) -> Vec<(usize, Frame)> {
    let of = |event: &Event| match event {
        Event::Delivered(it) => Some((it.sender, it.frame)),
        Event::Begun(_) | Event::Lost(_) => None,
    };
    events.iter().filter_map(of).collect()
}

#[test]
fn the_dominant_frame_goes_first_and_the_others_wait() {
    let remote = Frame::remote(StandardId::new(0x123).unwrap(), 0).unwrap();
    let extended = Frame::new(ExtendedId::new(0x123 << 18).unwrap(), Payload::EMPTY);
    let frames = [standard(0x124), extended, remote, standard(0x123)];
    let mut stations = Stations::new(frames.map(|frame| vec![(0, frame)]));
    let events = stations.run(&mut Medium::new(RATE), u64::MAX);
    let expected = [(3, standard(0x123)), (2, remote), (1, extended), (0, standard(0x124))];
    assert_eq!(delivered(&events), expected);
}

#[test]
fn a_dominant_frame_that_comes_later_waits_for_the_one_on_the_wire() {
    let (late, mut medium) = (standard(0), Medium::new(RATE));
    let mut stations = Stations::new([vec![(0, standard(0x7FF)), (0, standard(0x700))], vec![(1, late)]]);
    let events = stations.run(&mut medium, 1);
    let [Event::Begun(first)] = events[..] else { panic!("{events:?}") };
    assert_eq!(medium.on_wire(), Some(&first));
    let events = stations.run(&mut medium, first.free_ns);
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
        let events = stations.run(&mut Medium::new(RATE), u64::MAX);
        assert_eq!(delivered(&events), [(0, frames[order[0]]), (1, frames[order[1]])]);
    }
}

/// Decision D-350.
#[test]
fn nobody_to_acknowledge_nothing_arrives() {
    let mut medium = Medium::new(RATE);
    let mut stations = Stations::new([vec![(0, standard(1))], vec![]]);
    stations.off = vec![1];
    assert_eq!(stations.run(&mut medium, 1_000_000), []);
    stations.off.clear();
    let events = stations.run(&mut medium, stations.now_ns);
    let [Event::Begun(frame)] = events[..] else { panic!("{events:?}") };
    stations.off = vec![1];
    assert_eq!(stations.run(&mut medium, frame.free_ns), [Event::Lost(frame)]);
    assert_eq!((&stations.told[..], stations.queues[0].len()), (&[][..], 1), "it remains to be sent");
}

#[test]
fn who_is_off_sends_and_hears_nothing() {
    let mut medium = Medium::new(RATE);
    let mut stations = Stations::new([vec![(0, standard(1))], vec![(0, standard(2))], vec![]]);
    stations.off = vec![0];
    let events = stations.run(&mut medium, 1_000_000);
    assert_eq!(delivered(&events), [(1, standard(2))]);
    assert_eq!(stations.told.iter().map(|told| told.1).collect::<Vec<_>>(), [1, 2]);
}

#[test]
fn a_frame_whose_sender_goes_off_is_lost() {
    let mut medium = Medium::new(RATE);
    let mut stations = Stations::new([vec![(0, standard(1))], vec![(0, standard(2))], vec![]]);
    let events = stations.run(&mut medium, 0);
    let [Event::Begun(frame)] = events[..] else { panic!("{events:?}") };
    stations.off = vec![0];
    let events = stations.run(&mut medium, 1_000_000);
    assert_eq!(events[0], Event::Lost(frame));
    assert_eq!(delivered(&events), [(1, standard(2))]);
}

/// Traffic as it must be: at each beginning the heads of the queues bit by bit, times from the frames bit by bit.
fn expected(stations: &Stations, bit_ns: u64) -> Vec<(u64, usize, Frame)> {
    let (mut queues, mut free, mut traffic) = (stations.queues.clone(), 0, Vec::new());
    while let Some(earliest) = queues.iter().filter_map(|queue| queue.front()).map(|(ready, _)| *ready).min()
    {
        let begin = earliest.max(free);
        let ready = |queue: &VecDeque<(u64, Frame)>| queue.front().is_some_and(|(ready, _)| *ready <= begin);
        let (who, frames): (Vec<_>, Vec<_>) =
            queues.iter().enumerate().filter(|(_, it)| ready(it)).map(|(who, it)| (who, it[0].1)).unzip();
        let winner = reference::winner(&frames).unwrap();
        let frame = frames[winner];
        let bits =
            reference::stuffed_part(&frame).len() as u64 + u64::from(reference::stuff_bits(&frame)) + 10;
        traffic.push((begin + bits * bit_ns, who[winner], frame));
        free = begin + (bits + 3) * bit_ns;
        queues[who[winner]].pop_front();
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
        let events = stations.run(&mut Medium::new(rate), u64::MAX);
        let of = |event: &Event| match event {
            Event::Delivered(it) => Some((it.delivery_ns, it.sender, it.frame)),
            Event::Begun(_) | Event::Lost(_) => None,
        };
        prop_assert_eq!(events.iter().filter_map(of).collect::<Vec<_>>(), expected.clone());
        // Everybody has heard everything once, in order.
        for who in 0..stations.queues.len() {
            let told = stations.told.iter().filter(|told| told.1 == who);
            let told: Vec<_> = told.map(|(time, _, frame, own)| (*time, *frame, *own)).collect();
            let all: Vec<_> = expected.iter().map(|(time, by, frame)| (*time, *frame, *by == who)).collect();
            prop_assert_eq!(told, all);
        }
    }
}
