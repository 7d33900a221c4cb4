//! Effects of faults on a bus, exact to the bit.

use super::tests::{Bench, frame};
use crate::can::{BitRate, Fate, Frame, wire};
use crate::devices::emulation::can_faults::{
    self, DELAY_FRAME, DUPLICATE_FRAME, LOSE_FRAME, OF_CAN, OVERRUN,
};
use crate::devices::{Bus, Faulty};
use crate::fault::{Draft, Effect, Fault, FaultKind, Hit, Owner, Target};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};

const BIT_S: u32 = 1_000_000;

fn kind(name: &str) -> &'static FaultKind {
    OF_CAN.iter().find(|kind| kind.name() == name).unwrap()
}

/// Returns a fault of frames with this identifier.
fn of_id(kind: &'static FaultKind, id: u64, us: Option<u64>, count: Option<u64>) -> Fault {
    let mut draft = Draft { count, ..Draft::new(kind, Target::Bus(BusIndex(0))) };
    for (value, field) in draft.values.iter_mut().zip(kind.fields()) {
        *value = match field.name() {
            "id" => Some(id),
            "delay_us" => us,
            _ => None,
        };
    }
    draft.check().unwrap()
}

/// Returns three ports with a fault. The first port sends `frames` at 10 us.
fn bench(frames: &[Frame], fault: Fault) -> Bench {
    of_two(frames, &[], fault)
}

/// Returns three ports with a fault. The first port sends `frames` and the second port sends `others`, both at 10 us.
fn of_two(frames: &[Frame], others: &[Frame], fault: Fault) -> Bench {
    let script = |frames: &[Frame]| frames.iter().map(|frame| (10, *frame)).collect();
    let scripts = vec![(vec![], script(frames)), (vec![], script(others)), (vec![], vec![])];
    let mut bench = Bench::new(BIT_S, scripts);
    bench.add(fault);
    bench
}

impl Bench {
    fn add(&mut self, fault: Fault) {
        self.faults.add(0, fault, Owner::Bus(BusIndex(0)), &mut self.journal).unwrap();
        self.faults.advance(0, &mut self.journal);
    }

    fn hits(&self) -> u32 {
        self.faults.list().map(|fault| fault.hits).sum()
    }

    /// Returns times and first data bytes of the frames in the journal.
    fn marks(&self) -> Vec<(u64, u8)> {
        self.frames().iter().map(|(at, frame, _)| (*at, frame.payload().data()[0])).collect()
    }
}

/// Returns the time until the frame arrives, and until the next frame may begin, in us.
fn lasts(frame: &Frame) -> (u64, u64) {
    let airtime = wire::airtime(frame, BitRate::new(BIT_S).unwrap());
    (airtime.delivery_ns / 1000, airtime.occupation_ns / 1000)
}

#[test]
fn a_lost_frame_reaches_no_receiver_and_its_sender_does_not_notice() {
    let frames = [frame(0x100, 1), frame(0x101, 2), frame(0x100, 3)];
    let mut bench = bench(&frames, of_id(&LOSE_FRAME, 0x100, None, Some(1)));
    bench.run(10_000);
    let heard: Vec<_> =
        bench.log().into_iter().map(|(station, _, what, mark)| (station, what, mark)).collect();
    let expected = [
        (0, "sent", 1),
        (0, "sent", 2),
        (1, "received", 2),
        (2, "received", 2),
        (0, "sent", 3),
        (1, "received", 3),
        (2, "received", 3),
    ];
    assert_eq!(heard, expected);
    assert_eq!(bench.marks().iter().map(|(_, mark)| *mark).collect::<Vec<_>>(), [2, 3]);
}

/// Decision D-334.
#[test]
fn a_delayed_frame_is_held_back_once_and_others_go_first() {
    let (slow, fast) = (frame(0x100, 1), frame(0x200, 2));
    let mut bench = bench(&[slow], of_id(&DELAY_FRAME, 0x100, Some(500), None));
    bench.send(1, 20, fast);
    bench.run(10_000);
    assert_eq!(bench.marks(), [(20 + lasts(&fast).0, 2), (510 + lasts(&slow).0, 1)]);
    assert_eq!(bench.hits(), 1);
}

#[test]
fn a_duplicate_is_sent_once_more_and_not_reported_to_its_sender() {
    let it = frame(0x100, 1);
    for (us, gap) in [(None, 0), (Some(70), 70)] {
        let mut bench = bench(&[it, frame(0x101, 2)], of_id(&DUPLICATE_FRAME, 0x100, us, None));
        bench.run(10_000);
        let (arrives, free) = lasts(&it);
        let copy = 10 + free + gap;
        let next = copy + free + lasts(&frame(0x101, 2)).0;
        assert_eq!(bench.marks(), [(10 + arrives, 1), (copy + arrives, 1), (next, 2)]);
        let sent: Vec<_> = bench.log().iter().filter(|it| it.2 == "sent").map(|it| it.3).collect();
        assert_eq!((sent, bench.hits()), (vec![1, 2], 1));
    }
}

/// Decision D-331.
#[test]
fn error_frames_make_a_sender_passive_and_the_frame_is_repeated() {
    let it = frame(0x100, 1);
    let mut bench = bench(&[it], of_id(kind("error_frame"), 0x100, None, Some(16)));
    bench.run(10_000);
    let round = u64::from(wire::bits_to_acknowledgement(&it) + 6 + 8 + 3);
    // The last error makes the sender passive, so it waits for eight bits more.
    let begin = 10 + 16 * round + 8;
    assert_eq!(bench.marks(), [(begin + lasts(&it).0, 1)]);
    let first = 10 + u64::from(wire::bits_to_acknowledgement(&it));
    let lost: Vec<_> = (0..16).map(|nth| (first + nth * round, (it, Fate::Disturbed))).collect();
    assert_eq!(bench.lost(), lost);
    assert_eq!(bench.errors(), [(127, 0), (0, 15), (0, 15)]);
}

#[test]
fn after_32_error_frames_in_a_row_a_sender_is_bus_off() {
    let mut bench = bench(&[frame(0x100, 1)], of_id(kind("error_frame"), 0x100, None, None));
    bench.run(100_000);
    let states: Vec<_> = bench.log().into_iter().map(|(station, _, what, _)| (station, what)).collect();
    assert_eq!(states, [(0, "error_warning"), (0, "error_passive"), (0, "bus_off")]);
    assert_eq!((bench.hits(), bench.errors()), (32, vec![(256, 0), (0, 32), (0, 32)]));
}

/// Decision D-333.
#[test]
fn a_frame_that_loses_the_arbitration_waits_for_the_next_one() {
    let (low, high) = (frame(0x100, 1), frame(0x200, 2));
    let mut bench = of_two(&[low], &[high], of_id(kind("lost_arbitration"), 0x100, None, Some(1)));
    bench.run(10_000);
    let (arrives, free) = lasts(&high);
    assert_eq!(bench.marks(), [(10 + arrives, 2), (10 + free + lasts(&low).0, 1)]);
    assert_eq!((bench.lost(), bench.errors()), (vec![], vec![(0, 0); 3]));
}

/// Decision D-333.
#[test]
fn a_lost_arbitration_without_a_winner_leaves_an_error_frame() {
    let it = frame(0x100, 1);
    let mut bench = bench(&[it], of_id(kind("lost_arbitration"), 0x100, None, Some(2)));
    bench.run(10_000);
    assert_eq!(bench.lost(), [(17, (it, Fate::Withdrawn)), (17 + 24, (it, Fate::Withdrawn))]);
    assert_eq!(bench.marks(), [(10 + 2 * 24 + lasts(&it).0, 1)]);
    // All three stations first counted an error as receivers. Then the two other stations received the frame
    // and decremented their counters.
    assert_eq!(bench.errors(), [(0, 2), (0, 1), (0, 1)]);
}

#[test]
fn an_overrun_loses_the_frame_at_one_receiver_only() {
    let overrun = Draft {
        count: Some(1),
        ..Draft::new(&OVERRUN, Target::Port { device: DeviceIndex(1), port: PortNumber(1) })
    };
    let mut bench = bench(&[frame(0x100, 1), frame(0x100, 2)], overrun.check().unwrap());
    bench.run(10_000);
    let at_1: Vec<_> = bench.log().into_iter().filter(|it| it.0 == 1).map(|it| (it.2, it.3)).collect();
    assert_eq!((at_1, bench.marks().len()), (vec![("overrun", 1), ("received", 2)], 2));
}

#[test]
fn a_working_controller_can_be_put_into_bus_off() {
    let mut bench = Bench::new(BIT_S, vec![(vec![], vec![(100, frame(0x100, 1))]), (vec![], vec![])]);
    let (off, target) = (
        Effect::new(can_faults::Effect::BusOff),
        Target::Port { device: DeviceIndex(0), port: PortNumber(1) },
    );
    assert_eq!(bench.bus.fire(50, target, &off), Some(Hit::Plain));
    assert_eq!(bench.bus.fire(50, target, &off), None, "it is off already");
    bench.run(10_000);
    assert_eq!((bench.log(), bench.marks()), (vec![(0, 50, "bus_off", 0)], vec![]));
    let without_power = Target::Port { device: DeviceIndex(1), port: PortNumber(1) };
    bench.bus.power_off(1, 10_000, &mut bench.journal);
    assert_eq!(bench.bus.fire(10_000, without_power, &off), None);
}
