//! Tests events, timers and triggers. [`front`] tests switch, display and starts.

mod front;

use super::*;
use crate::devices::omega_drive_line_2::registers::SEGMENT_END;
use crate::identity::{DeviceIndex, PortNumber};
use crate::journal::{Journal, Origin, Record};
use crate::memory::header::{InterruptResult, OptInitResult, ProgramState, Project, RunSwitch, Start};
use crate::memory::{Header, View};

/// A board on heap memory, with a clock that the test sets.
struct Rig {
    board: Board,
    header: View<Header>,
    segment: Segment,
    journal: Journal,
    now: u64,
}

impl Rig {
    fn new() -> Self {
        Self::with_option_card(None)
    }

    fn with_option_card(option_sync_us: Option<u32>) -> Self {
        Self::of(Segment::heap(SEGMENT_END), option_sync_us, Project::None)
    }

    fn of(segment: Segment, option_sync_us: Option<u32>, project: Project) -> Self {
        segment.header().unwrap().retain_size.store(64);
        let board = Board::new(&segment, option_sync_us, project).unwrap();
        let header = segment.header().unwrap();
        let mut rig = Rig { board, header, segment, journal: Journal::default(), now: 0 };
        rig.start();
        rig
    }

    fn start(&mut self) {
        let (board, mut ctx) = self.parts();
        board.start(&mut ctx);
    }

    fn parts(&mut self) -> (&mut Board, Context<'_>) {
        let ctx = Context {
            now: self.now,
            journal: &mut self.journal,
            origin: Origin { plc: DeviceIndex(0), node: PortNumber(1) },
            base: 0,
        };
        (&mut self.board, ctx)
    }

    fn look(&mut self) -> FrontAction {
        let (board, mut ctx) = self.parts();
        board.look(&mut ctx)
    }

    fn set_event(&mut self, event: usize, factor: i16, enable: bool) -> InterruptResult {
        let request = self.header.interrupts[event].ask(factor, enable);
        self.header.submit_request();
        self.look();
        InterruptResult::from_code(self.header.interrupts[event].outcome(request).unwrap()).unwrap()
    }

    /// Calls `OPT_INIT` with these trigger modes. Each timer, A and B, has the settings `(divider, enable,
    /// configuration mode)`.
    fn opt_init(&mut self, modes: [u32; 3], timers: [(u32, u32, u32); 2]) -> OptInitResult {
        let block = &self.header.opt_init;
        block.triggers.iter().zip(modes).for_each(|(cell, mode)| cell.store(mode));
        for (timer, (divider, enable, cfg_mode)) in block.timers.iter().zip(timers) {
            timer.divider.store(divider);
            timer.enable.store(enable);
            timer.cfg_mode.store(cfg_mode);
        }
        let request = block.ask();
        self.header.submit_request();
        self.look();
        OptInitResult::from_code(self.header.opt_init.outcome(request).unwrap()).unwrap()
    }

    fn run_to(&mut self, time: u64) {
        while self.board.next_time() <= time {
            self.now = self.board.next_time();
            self.board.timers_due(self.now);
        }
        self.now = time;
    }

    fn count(&self, event: usize) -> u32 {
        self.header.events[event].bell.rings()
    }

    fn counts(&self) -> Vec<(usize, u32)> {
        (0..16).map(|event| (event, self.count(event))).filter(|(_, count)| *count > 0).collect()
    }
}

const OFF: [(u32, u32, u32); 2] = [(0, 0, 0); 2];

/// The event numbers and levels of p. 43 and 48.
#[test]
fn events_have_the_levels_of_the_manual() {
    let expected =
        [(0, 14), (2, 13), (4, 13), (5, 14), (6, 13), (8, 14), (11, 14), (12, 14)].map(|(n, l)| (n, Some(l)));
    for event in 0..20 {
        let wanted = expected.iter().find(|(n, _)| *n == event).and_then(|(_, level)| *level);
        assert_eq!(level(event), wanted, "event {event}");
    }
}

#[test]
fn reserved_events_are_refused() {
    for event in 0..16 {
        let mut rig = Rig::new();
        let wanted =
            if level(event).is_some() { InterruptResult::Done } else { InterruptResult::NoSuchEvent };
        assert_eq!(rig.set_event(event, 1, true), wanted, "event {event}");
    }
}

/// Manual p. 48: events 11 and 12 exclude each other, and events 4 and 8 exclude each other. All other events can be
/// enabled together.
#[test]
fn events_exclude_each_other_in_pairs() {
    let events = [0, 2, 4, 5, 6, 8, 11, 12];
    for first in events {
        for second in events {
            let mut rig = Rig::new();
            assert_eq!(rig.set_event(first, 1, true), InterruptResult::Done);
            let excluded = [(11, 12), (4, 8)]
                .iter()
                .any(|&(a, b)| (first, second) == (a, b) || (second, first) == (a, b));
            let wanted = if excluded { InterruptResult::Excluded } else { InterruptResult::Done };
            assert_eq!(rig.set_event(second, 1, true), wanted, "{first} then {second}");
            // The refused call does not change the enabled event. When that event is disabled, the other
            // event can be enabled.
            assert_eq!(rig.set_event(first, 1, false), InterruptResult::Done);
            assert_eq!(rig.set_event(second, 1, true), InterruptResult::Done);
        }
    }
}

/// Manual p. 49: i_PAR1 = 20 gives 1 ms. In general, the period is i_PAR1 x 50 us.
#[test]
fn cpu_timers_run_in_steps_of_50_us() {
    for (event, factor, period) in [(0, 20, 1000), (2, 20, 1000), (0, 1, 50), (2, 32_767, 1_638_350)] {
        let mut rig = Rig::new();
        rig.now = 7;
        assert_eq!(rig.set_event(event, factor, true), InterruptResult::Done);
        rig.run_to(7 + 3 * period - 1);
        assert_eq!(rig.counts(), [(event, 2)]);
        rig.run_to(7 + 3 * period);
        assert_eq!(rig.counts(), [(event, 3)]);
        assert_eq!(rig.header.events[event].time_us.load(), 7 + 3 * period);
    }
}

#[test]
fn a_cpu_timer_needs_a_factor() {
    for factor in [0, -1, i16::MIN] {
        for event in [0, 2] {
            assert_eq!(Rig::new().set_event(event, factor, true), InterruptResult::BadFactor);
        }
        assert_eq!(Rig::new().set_event(12, factor, true), InterruptResult::Done, "it has none");
    }
}

#[test]
fn a_timer_can_be_stopped_and_restarted() {
    let mut rig = Rig::new();
    rig.set_event(0, 1, true);
    rig.run_to(120);
    rig.set_event(0, 4, true);
    rig.run_to(319);
    assert_eq!(rig.count(0), 2);
    rig.run_to(320);
    assert_eq!(rig.count(0), 3);
    rig.set_event(0, 4, false);
    rig.run_to(100_000);
    assert_eq!(rig.count(0), 3);
    assert_eq!(rig.board.next_time(), u64::MAX);
}

/// Manual p. 50, 58, 66: a divider of 2499 gives 1 ms. Timer A is the source of both events 5 and 6.
#[test]
fn board_timer_a_divides_5_mhz() {
    let mut rig = Rig::new();
    rig.set_event(5, 0, true);
    rig.set_event(6, 0, true);
    rig.run_to(10_000);
    assert_eq!(rig.counts(), [], "it does not run yet");
    assert_eq!(rig.opt_init([0; 3], [(2499, 1, 0), (4999, 1, 0)]), OptInitResult::Done);
    rig.run_to(19_999);
    assert_eq!(rig.counts(), [(5, 9), (6, 9)]);
    rig.run_to(20_000);
    assert_eq!(rig.counts(), [(5, 10), (6, 10)]);
    assert_eq!([0, 1].map(|n| rig.header.timers[n].bell.rings()), [10, 5], "timer B runs, without event");
}

/// If the period is not a whole number of microseconds, the rounding errors must not accumulate.
#[test]
fn odd_dividers_keep_their_phase() {
    let mut rig = Rig::new();
    rig.set_event(5, 0, true);
    rig.opt_init([0; 3], [(1000, 1, 0), (0, 0, 0)]);
    rig.run_to(400_400_000);
    assert_eq!(rig.count(5), 1_000_000, "1001 x 2 / 5 MHz = 400.4 us");
    assert_eq!(rig.header.events[5].time_us.load(), 400_400_000);
}

#[test]
fn bad_timers_are_refused_and_start_nothing() {
    for timer in [(123, 1, 0), (65_536, 1, 0), (2499, 2, 0), (2499, 1, 1)] {
        let mut rig = Rig::new();
        assert_eq!(rig.opt_init([0; 3], [timer, (0, 0, 0)]), OptInitResult::BadTimer, "{timer:?}");
        assert_eq!(rig.opt_init([0; 3], [(2499, 1, 0), timer]), OptInitResult::BadTimer, "{timer:?}");
        assert_eq!(rig.board.next_time(), u64::MAX);
        // A call that was refused does not count as the one call that is permitted.
        assert_eq!(rig.opt_init([0; 3], [(124, 1, 0), (65_535, 1, 0)]), OptInitResult::Done);
    }
}

#[test]
fn opt_init_may_run_once_only() {
    let mut rig = Rig::new();
    assert_eq!(rig.opt_init([3, 3, 1], OFF), OptInitResult::Done);
    assert_eq!(rig.opt_init([4, 4, 2], OFF), OptInitResult::AlreadyRun);
    rig.board.sync_net(5);
    assert_eq!(rig.header.triggers[0].bell.rings(), 1, "the first one holds");
    rig.start();
    assert_eq!(rig.opt_init([4, 4, 2], OFF), OptInitResult::Done, "after a restart");
}

/// Decision D-260: start tasks run `OPT_INIT`. So it may run once in each cold or warm start. A hot start has no start
/// tasks.
#[test]
fn opt_init_may_run_once_in_each_start_of_the_program() {
    let mut rig = Rig::new();
    let with_timer = [(2499, 1, 0), (0, 0, 0)];
    assert_eq!(rig.opt_init([4, 4, 2], with_timer), OptInitResult::Done);
    rig.program(ProgramState::Stopped);
    assert_eq!(rig.ordered().1, Start::Cold);
    assert_eq!(rig.opt_init([4, 4, 2], with_timer), OptInitResult::Done, "another program");
    for (start, wanted) in [(Start::Hot, OptInitResult::AlreadyRun), (Start::Warm, OptInitResult::Done)] {
        rig.ask_for(start);
        assert_eq!(rig.opt_init([3, 3, 1], OFF), wanted, "{start:?}");
        assert_eq!(rig.opt_init([3, 3, 1], OFF), OptInitResult::AlreadyRun, "{start:?}");
    }
    assert_eq!(rig.board.next_time(), u64::MAX, "the last one has not started timer A");
    rig.turn(RunSwitch::Stop);
    rig.turn(RunSwitch::Run);
    assert_eq!(rig.opt_init([4, 4, 2], with_timer), OptInitResult::Done, "warm start by the switch");
    // Now the program makes its start request before the board is started.
    let mut rig = Rig::new();
    assert_eq!(rig.opt_init([0; 3], OFF), OptInitResult::Done);
    rig.header.program.state.store(ProgramState::Stopped.code());
    assert_eq!(rig.opt_init([3, 3, 1], OFF), OptInitResult::Done);
}

/// The three tables of p. 58.
#[test]
fn trigger_modes_are_those_of_the_manual() {
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum Pulsed {
        Nothing,
        Card,
        Net,
        TimerA,
        Interrupt(u8),
        Refused,
    }
    use Pulsed::{Card, Interrupt, Net, Nothing, Refused, TimerA};
    let one_and_two = [Nothing, Refused, Card, Net, TimerA, Refused, Interrupt(1), Refused];
    let controller = [Card, Net, TimerA, Refused, Interrupt(1), Interrupt(2), Refused, Refused];
    for (place, table) in [(0, one_and_two), (1, one_and_two), (2, controller)] {
        for (mode, wanted) in table.into_iter().enumerate() {
            let mut rig = Rig::with_option_card(Some(700));
            let mut modes = [0; 3];
            modes[place] = mode as u32;
            let result = rig.opt_init(modes, [(2499, 1, 0), (0, 0, 0)]);
            let pulses = |rig: &Rig| rig.header.triggers[place].bell.rings();
            let mut seen = Vec::new();
            rig.board.sync_net(1);
            seen.extend((pulses(&rig) == 1).then_some(Net));
            for slot in [1, 2] {
                let before = pulses(&rig);
                rig.board.option_card(slot, CardPulses { interrupt: true, sync: false }, 2);
                seen.extend((pulses(&rig) == before + 1).then_some(Interrupt(slot)));
            }
            let is_card_pulsed = rig.board.take_card_pulses().triggers;
            let wanted_pulses = |index| index == place && !seen.is_empty();
            assert_eq!(is_card_pulsed, [0, 1].map(wanted_pulses), "trigger {place}, mode {mode}");
            rig.run_to(700);
            seen.extend((pulses(&rig) == 1 && seen.is_empty()).then_some(Card));
            rig.run_to(1000);
            seen.extend((pulses(&rig) == 1 && seen.is_empty()).then_some(TimerA));
            let found = match (result, seen.as_slice()) {
                (OptInitResult::BadTrigger, []) => Refused,
                (OptInitResult::Done, []) => Nothing,
                (OptInitResult::Done, [one]) => *one,
                other => panic!("{other:?}"),
            };
            assert_eq!(found, wanted, "trigger {place}, mode {mode}");
        }
    }
}

#[test]
fn events_that_are_not_enabled_leave_no_trace() {
    let mut rig = Rig::with_option_card(Some(500));
    rig.board.sync_net(0);
    rig.board.baps(0);
    rig.run_to(5_000);
    assert_eq!((rig.counts(), rig.board.events().take_fired()), (vec![], 0));
    rig.set_event(12, 0, true);
    rig.set_event(8, 0, true);
    rig.board.sync_net(6_000);
    rig.board.baps(6_500);
    assert_eq!(rig.counts(), [(8, 1), (12, 1)]);
    assert_eq!((rig.board.events().take_fired(), rig.board.events().take_fired()), (1 << 8 | 1 << 12, 0));
}

#[test]
fn an_option_card_makes_event_11() {
    let mut rig = Rig::new();
    rig.set_event(11, 0, true);
    rig.board.option_card(2, CardPulses { interrupt: true, sync: false }, 1);
    assert_eq!(rig.counts(), []);
    rig.board.option_card(2, CardPulses { interrupt: false, sync: true }, 2);
    assert_eq!(rig.counts(), [(11, 1)]);
}

#[test]
fn a_simulated_option_card_makes_event_11() {
    let mut rig = Rig::with_option_card(Some(500));
    rig.set_event(11, 0, true);
    rig.run_to(1_600);
    assert_eq!(rig.counts(), [(11, 3)]);
}

#[test]
fn a_restart_disables_everything() {
    let mut rig = Rig::new();
    for event in [0, 5, 8, 12] {
        rig.set_event(event, 1, true);
    }
    rig.opt_init([0; 3], [(2499, 1, 0), (0, 0, 0)]);
    rig.board.stop();
    rig.start();
    rig.run_to(10_000);
    rig.board.sync_net(10_000);
    rig.board.baps(10_000);
    assert_eq!(rig.counts(), []);
    assert_eq!(rig.header.program.restarts.load(), 2);
    assert_eq!(rig.header.interrupts[0].request.load(), 0);
}

#[test]
fn watched_events_ask_to_stop() {
    let mut rig = Rig::new();
    rig.board.events().watched = 1 << 12;
    rig.set_event(8, 0, true);
    rig.board.baps(1);
    rig.board.sync_net(2);
    assert!(!rig.board.events().take_stop(), "12 is watched but not enabled");
    rig.set_event(12, 0, true);
    rig.board.sync_net(3);
    assert!(rig.board.events().take_stop());
    assert!(!rig.board.events().take_stop());
}
