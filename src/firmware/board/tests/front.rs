//! RUN/STOP/RESET switch, seven-segment display, supply, starts of the program.

use super::*;

impl Rig {
    pub(super) fn turn(&mut self, switch: RunSwitch) -> Look {
        self.header.board.switch.store(switch.code());
        self.look()
    }

    pub(super) fn program(&mut self, state: ProgramState) {
        self.header.program.state.store(state.code());
        self.look();
    }

    pub(super) fn display(&self) -> (char, bool) {
        let display = self.header.board.display.load();
        (char::from(display as u8), display & 0x100 != 0)
    }

    /// Starts ordered so far, and the last one.
    pub(super) fn ordered(&self) -> (u32, Start) {
        let kind = Start::from_code(self.header.program.start_kind.load()).unwrap();
        (self.header.program.start.rings(), kind)
    }

    pub(super) fn ask_for(&mut self, start: Start) {
        self.header.program.start_request.store(start.code());
        self.header.submit_request();
        self.look();
        assert_eq!(self.header.program.start_request.load(), 0, "taken");
    }
}

/// The table of p. 40.
#[test]
fn the_display_shows_switch_and_program() {
    use ProgramState::*;
    use RunSwitch::{Run, Stop};
    let table = [
        (Stop, None, '0'),
        (Stop, Stopped, '1'),
        (Stop, Cyclic, '1'),
        (Run, None, '0'),
        (Run, Stopped, '1'),
        (Run, Initializing, '2'),
        (Run, Cyclic, '3'),
        (Run, ErasingBootProject, 'C'),
        (Run, BootProjectCopied, 'A'),
    ];
    for (switch, state, wanted) in table {
        let mut rig = Rig::new();
        rig.turn(switch);
        rig.program(state);
        assert_eq!(rig.display(), (wanted, false), "{switch:?} {state:?}");
    }
}

#[test]
fn the_display_blinks_while_a_boot_project_is_copied() {
    let mut rig = Rig::new();
    rig.program(ProgramState::CopyingBootProject);
    let mut seen = Vec::new();
    for _ in 0..4 {
        seen.push(rig.display());
        rig.now += 500_000;
        rig.look();
    }
    assert_eq!(seen, [('L', true), ('L', false), ('L', true), ('L', false)]);
}

/// p. 40: dark while RESET is held.
#[test]
fn reset_is_dark_and_reads_the_dip_switches_at_its_end() {
    let mut rig = Rig::new();
    rig.header.board.leds.store(0b1010);
    rig.header.board.dip.store(17);
    rig.look();
    assert_eq!(rig.board.dip(), 0, "not before a reset");
    assert_eq!(rig.turn(RunSwitch::Reset), Look::Held);
    rig.board.stop();
    assert_eq!((rig.header.board.display.load(), rig.header.board.leds.load()), (0, 0));
    assert_eq!(rig.look(), Look::Nothing, "still held");
    assert_eq!(rig.turn(RunSwitch::Stop), Look::Up);
    rig.start();
    assert_eq!((rig.display().0, rig.board.dip(), rig.header.program.dip_latched.load()), ('0', 17, 17));
}

#[test]
fn the_supply_takes_it_down_whatever_the_switch_says() {
    let mut rig = Rig::new();
    rig.header.program.power.store(1);
    assert_eq!(rig.look(), Look::Off);
    rig.board.stop();
    assert_eq!(rig.turn(RunSwitch::Reset), Look::Nothing);
    rig.header.program.power.store(0);
    assert_eq!(rig.look(), Look::Nothing, "RESET is still held");
    assert_eq!(rig.turn(RunSwitch::Stop), Look::Up);
}

#[test]
fn the_supply_may_fail_while_reset_is_held() {
    let mut rig = Rig::new();
    assert_eq!(rig.turn(RunSwitch::Reset), Look::Held);
    rig.board.stop();
    rig.header.program.power.store(1);
    assert!(rig.board.has_supply(), "before anybody looks");
    assert_eq!(rig.look(), Look::Off);
    assert_eq!((rig.look(), rig.board.has_supply()), (Look::Nothing, false));
    assert_eq!(rig.turn(RunSwitch::Stop), Look::Nothing, "no supply");
    rig.header.program.power.store(0);
    assert_eq!((rig.look(), rig.board.has_supply()), (Look::Up, true));
}

#[test]
fn numbers_that_mean_nothing_change_nothing() {
    let mut rig = Rig::new();
    rig.program(ProgramState::Cyclic);
    let before = rig.ordered();
    rig.header.board.switch.store(7);
    rig.header.program.power.store(9);
    rig.header.program.state.store(99);
    assert_eq!(rig.look(), Look::Answered);
    assert_eq!((rig.display(), rig.ordered()), (('3', false), before));
    rig.header.board.dip.store(u32::MAX);
    rig.start();
    assert_eq!(rig.board.dip(), 31, "five switches");
}

/// p. 38: cold start after a project was sent, warm start at every further change from STOP to RUN.
#[test]
fn a_new_project_starts_cold_and_then_warm() {
    let mut rig = Rig::new();
    rig.turn(RunSwitch::Stop);
    rig.program(ProgramState::Stopped);
    assert_eq!(rig.ordered(), (0, Start::None));
    rig.turn(RunSwitch::Run);
    assert_eq!(rig.ordered(), (1, Start::Cold));
    rig.turn(RunSwitch::Stop);
    assert_eq!(rig.ordered(), (2, Start::Stop));
    rig.turn(RunSwitch::Run);
    assert_eq!(rig.ordered(), (3, Start::Warm));
    // Another project.
    rig.program(ProgramState::None);
    rig.program(ProgramState::Stopped);
    assert_eq!(rig.ordered(), (4, Start::Cold), "at once, the switch is at RUN");
}

#[test]
fn kept_retain_flags_make_the_first_start_a_warm_one() {
    let mut rig = Rig::new();
    rig.board.retain_was_kept();
    rig.program(ProgramState::Stopped);
    assert_eq!(rig.ordered(), (1, Start::Warm));
}

#[test]
fn starts_can_be_asked_for_at_run_only() {
    let mut rig = Rig::new();
    rig.ask_for(Start::Warm);
    assert_eq!(rig.ordered(), (0, Start::None), "no program");
    rig.program(ProgramState::Stopped);
    for (count, kind) in [(2, Start::Hot), (3, Start::Stop), (4, Start::Cold)] {
        rig.ask_for(kind);
        assert_eq!(rig.ordered(), (count, kind));
    }
    rig.turn(RunSwitch::Stop);
    rig.ask_for(Start::Warm);
    assert_eq!(rig.ordered(), (5, Start::Stop), "refused");
    let refused = |record: &Record| {
        matches!(record.event, Event::Board { what: BoardEvent::StartRefused { code: 2 }, .. })
    };
    assert_eq!(rig.journal.records().filter(|record| refused(record)).count(), 2);
}
