//! Tests the RUN/STOP/RESET switch, the seven-segment display, the supply, and starts of the program.

use super::*;
use crate::devices::omega_drive_line_2::registers::RETAIN;
use crate::devices::omega_drive_line_2::registers::SEGMENT_END;
use crate::identity::DeviceIndex;
use crate::memory::Width;
use crate::memory::header::InitialFlagResult;

impl Rig {
    pub(super) fn turn(&mut self, switch: RunSwitch) -> FrontAction {
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

    /// Returns the number of starts that were ordered, and the kind of the last one.
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

/// Manual p. 40: the display and the LEDs are dark while RESET is held.
#[test]
fn reset_is_dark_and_reads_the_dip_switches_at_its_end() {
    let mut rig = Rig::new();
    rig.header.board.leds.store(0b1010);
    rig.header.board.dip.store(17);
    rig.look();
    assert_eq!(rig.board.dip(), 0, "not before a reset");
    assert_eq!(rig.turn(RunSwitch::Reset), FrontAction::Held);
    rig.board.stop();
    assert_eq!((rig.header.board.display.load(), rig.header.board.leds.load()), (0, 0));
    assert_eq!(rig.look(), FrontAction::Nothing, "still held");
    assert_eq!(rig.turn(RunSwitch::Stop), FrontAction::Up);
    rig.start();
    assert_eq!((rig.display().0, rig.board.dip(), rig.header.program.dip_latched.load()), ('0', 17, 17));
}

#[test]
fn a_supply_failure_stops_the_board_in_any_switch_position() {
    let mut rig = Rig::new();
    rig.header.program.power.store(1);
    assert_eq!(rig.look(), FrontAction::Off);
    rig.board.stop();
    assert_eq!(rig.turn(RunSwitch::Reset), FrontAction::Nothing);
    rig.header.program.power.store(0);
    assert_eq!(rig.look(), FrontAction::Nothing, "RESET is still held");
    assert_eq!(rig.turn(RunSwitch::Stop), FrontAction::Up);
}

#[test]
fn the_supply_may_fail_while_reset_is_held() {
    let mut rig = Rig::new();
    assert_eq!(rig.turn(RunSwitch::Reset), FrontAction::Held);
    rig.board.stop();
    rig.header.program.power.store(1);
    assert!(rig.board.has_supply(), "before the first poll");
    assert_eq!(rig.look(), FrontAction::Off);
    assert_eq!((rig.look(), rig.board.has_supply()), (FrontAction::Nothing, false));
    assert_eq!(rig.turn(RunSwitch::Stop), FrontAction::Nothing, "no supply");
    rig.header.program.power.store(0);
    assert_eq!((rig.look(), rig.board.has_supply()), (FrontAction::Up, true));
}

#[test]
fn invalid_numbers_change_nothing() {
    let mut rig = Rig::new();
    rig.program(ProgramState::Cyclic);
    let before = rig.ordered();
    rig.header.board.switch.store(7);
    rig.header.program.power.store(9);
    rig.header.program.state.store(99);
    assert_eq!(rig.look(), FrontAction::Answered);
    assert_eq!((rig.display(), rig.ordered()), (('3', false), before));
    rig.header.board.dip.store(u32::MAX);
    rig.start();
    assert_eq!(rig.board.dip(), 31, "five switches");
}

/// Manual p. 38: the first start of a project that was sent is a cold start. Every later change from STOP to
/// RUN is a warm start.
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
    // The PLC gets another project.
    rig.program(ProgramState::None);
    rig.program(ProgramState::Stopped);
    assert_eq!(rig.ordered(), (4, Start::Cold), "at once, the switch is at RUN");
}

#[test]
fn kept_retain_flags_make_the_first_start_warm() {
    for (project, first) in
        [(Project::None, Start::Warm), (Project::Boot, Start::Warm), (Project::Sent, Start::Cold)]
    {
        let segment = Segment::heap(SEGMENT_END);
        segment.store(RETAIN + 60, Width::Dword, 7).unwrap();
        let mut rig = Rig::of(segment, None, project);
        rig.program(ProgramState::Stopped);
        assert_eq!(rig.ordered(), (1, first), "{project:?}");
        let kept = if first == Start::Warm { 7 } else { 0 };
        assert_eq!(rig.segment.load(RETAIN + 60, Width::Dword).unwrap(), kept);
    }
}

/// Manual p. 38: a cold start sets the retain flags to their initial values. Warm and hot starts do not
/// change them.
#[test]
fn a_cold_start_alone_touches_the_retain_flags() {
    let mut rig = Rig::of(Segment::heap(SEGMENT_END), None, Project::Boot);
    let slot = &rig.header.initial_flag;
    let (good, flag) = (slot.ask(4, 4, 99), |rig: &Rig| {
        [0, 4].map(|flag| rig.segment.load(RETAIN + flag, Width::Dword).unwrap())
    });
    rig.header.submit_request();
    rig.look();
    assert_eq!(rig.header.initial_flag.outcome(good), Some(InitialFlagResult::Done.code()));
    let bad = rig.header.initial_flag.ask(64, 1, 1);
    rig.header.submit_request();
    rig.look();
    assert_eq!(rig.header.initial_flag.outcome(bad), Some(InitialFlagResult::NoSuchFlag.code()));
    for (start, held) in [(Start::Warm, [5, 5]), (Start::Hot, [5, 5]), (Start::Cold, [0, 99])] {
        for flag in [0, 4] {
            rig.segment.store(RETAIN + flag, Width::Dword, 5).unwrap();
        }
        rig.ask_for(start);
        assert_eq!(flag(&rig), held, "{start:?}");
    }
    rig.segment.store(RETAIN, Width::Dword, 5).unwrap();
    rig.board.set_power(Power::Off);
    rig.board.stop();
    rig.board.set_power(Power::On);
    rig.start();
    assert_eq!((flag(&rig), rig.ordered().1), ([5, 99], Start::Warm), "NOVRAM keeps them");
}

/// Manual p. 37, 40: if a project was sent but is not a boot project, a reset loses it, and the display shows
/// the loss. The reset loads the boot project again.
#[test]
fn a_reset_loses_a_project_that_was_only_sent() {
    for (project, after, display) in
        [(Project::Sent, ProgramState::None, '0'), (Project::Boot, ProgramState::Stopped, '1')]
    {
        let mut rig = Rig::of(Segment::heap(SEGMENT_END), None, project);
        assert_eq!(rig.header.project.load(), project.code());
        assert_eq!((rig.ordered(), rig.display()), ((1, Start::Cold), ('1', false)));
        rig.program(ProgramState::Cyclic);
        rig.turn(RunSwitch::Reset);
        rig.board.stop();
        rig.header.board.switch.store(RunSwitch::Stop.code());
        rig.start();
        assert_eq!((rig.header.program.state.load(), rig.display()), (after.code(), (display, false)));
        // The program of the lost project reports its state late. This report does not restore the project.
        rig.program(ProgramState::Cyclic);
        rig.turn(RunSwitch::Run);
        let is_back = project == Project::Boot;
        assert_eq!(rig.header.project.load() == Project::Boot.code(), is_back);
        assert_eq!(rig.display(), (if is_back { '3' } else { '0' }, false));
        assert_eq!(rig.ordered().1 == Start::Warm, is_back, "{project:?}");
        let orders = rig.ordered().0;
        rig.ask_for(Start::Hot);
        assert_eq!(
            rig.ordered() == (orders + 1, Start::Hot),
            is_back,
            "p. 38: a hot start needs a project too"
        );
    }
}

/// Manual p. 38: only the first start of a new project is a cold start.
#[test]
fn a_project_can_be_sent_and_deleted() {
    let mut rig = Rig::new();
    let load = |rig: &mut Rig, project: Project| {
        rig.header.project_request.store(project.code() + 1);
        rig.header.submit_request();
        rig.look();
        assert_eq!((rig.header.project_request.load(), rig.header.project.load()), (0, project.code()));
    };
    load(&mut rig, Project::Sent);
    assert_eq!((rig.ordered(), rig.display().0), ((1, Start::Cold), '1'));
    rig.program(ProgramState::Cyclic);
    load(&mut rig, Project::Boot);
    assert_eq!((rig.ordered(), rig.display().0), ((3, Start::Cold), '1'), "stopped, then a new one");
    load(&mut rig, Project::None);
    assert_eq!((rig.ordered(), rig.display().0), ((4, Start::Stop), '0'));
    rig.start();
    assert_eq!((rig.ordered(), rig.display().0), ((5, Start::Warm), '1'), "the boot project");
    rig.header.project_request.store(9);
    rig.header.submit_request();
    rig.look();
    assert_eq!((rig.header.project_request.load(), rig.ordered().0), (0, 5), "no such project");
}

/// Decision D-300: while the switch or the program is at STOP, no event occurs, so no event task runs.
#[test]
fn no_event_occurs_at_stop() {
    let mut rig = Rig::new();
    rig.set_event(12, 0, true);
    let events = |rig: &mut Rig| {
        rig.board.sync_net(0);
        rig.header.events[12].bell.rings()
    };
    assert_eq!(events(&mut rig), 1, "no project, but at RUN");
    rig.turn(RunSwitch::Stop);
    assert_eq!(events(&mut rig), 1);
    rig.turn(RunSwitch::Run);
    assert_eq!(events(&mut rig), 2, "it is still enabled");
    rig.program(ProgramState::Stopped);
    assert_eq!(events(&mut rig), 3);
    rig.ask_for(Start::Stop);
    assert_eq!(events(&mut rig), 3, "the program is stopped");
    rig.ask_for(Start::Hot);
    assert_eq!(events(&mut rig), 4);
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
        record.event == OnBoard { plc: DeviceIndex(0), what: BoardEvent::StartRefused { code: 2 } }.into()
    };
    assert_eq!(rig.journal.records().filter(|record| refused(record)).count(), 2);
}
