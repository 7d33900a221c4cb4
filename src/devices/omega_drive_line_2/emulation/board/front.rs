//! Front and power of the board, and the start of the PLC program (manual 5.00005.03a p. 22, 38-40).

use super::flags::Flags;
use super::project::Projects;
use super::report;
use crate::devices::emulation::program;
use crate::devices::omega_drive_line_2::registers::DIP_LAST;
use crate::devices::records::BoardEvent;
use crate::devices::{Context, FrontAction, Power};
use crate::memory::header::{self, ProgramState, Project, RunSwitch, Start};
use crate::memory::{FirmwareHeader, Header};
use crate::snapshot_fields;
use serde::{Deserialize, Serialize};

/// Half the period of the blinking display while a boot project is copied.
const BLINK_US: u64 = 500_000;
/// The decimal point of the display.
const POINT: u32 = 1 << 8;

/// The front panel at the last poll.
#[derive(Debug)]
pub(super) struct Front {
    /// Cells of the header page at the last poll.
    seen: PolledFront,
    switch: RunSwitch,
    powered: bool,
    program: ProgramState,
    up: bool,
    dip: u8,
    projects: Projects,
    /// True if the board has been started before. Only the first power-on uses the state of the plant file.
    is_used: bool,
    /// True if a request has stopped the program while the switch was at RUN.
    halted: bool,
    /// True if the PLC program may run.
    released: bool,
    /// True if a cold or warm start was ordered since the last call of `take_start`.
    started: bool,
    /// True if a start or stop was ordered since the last call of `take_order`.
    ordered: bool,
    flags: Flags,
}

/// Values of the cells that clients write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct PolledFront {
    switch: u32,
    power: u32,
    program: u32,
}

impl PolledFront {
    #[inline]
    fn now(asked: &Header) -> Self {
        PolledFront {
            switch: asked.board.switch.load(),
            power: asked.program.power.load(),
            program: asked.program.state.load(),
        }
    }
}

snapshot_fields!(Front {
    values: seen, switch, powered, program, up, dip, projects, is_used, halted, released, started, ordered;
    parts: flags
});

impl Front {
    pub(crate) fn new(face: &FirmwareHeader, flags: Flags, project: Project) -> Self {
        let mut projects = Projects::new(project);
        if flags.are_kept() {
            projects.retain_was_kept();
        }
        Front {
            flags,
            projects,
            seen: PolledFront::now(face.requested()),
            switch: RunSwitch::Run,
            powered: true,
            program: ProgramState::None,
            up: false,
            dip: 0,
            is_used: false,
            halted: false,
            released: false,
            started: false,
            ordered: false,
        }
    }

    pub(crate) fn is_up(&self) -> bool {
        self.up
    }

    pub(crate) fn has_supply(&self) -> bool {
        self.powered
    }

    pub(crate) fn dip(&self) -> u8 {
        self.dip
    }

    /// True if a switch was turned since the last poll, or the display must blink.
    #[inline]
    pub(crate) fn has_changed(&self, face: &FirmwareHeader) -> bool {
        PolledFront::now(face.requested()) != self.seen || self.program == ProgramState::CopyingBootProject
    }

    /// Called at power-on or at the end of a reset. Reads the DIP switches and returns their number.
    pub(crate) fn start(&mut self, ctx: &mut Context, face: &FirmwareHeader) -> u8 {
        self.up = true;
        self.flags.clear();
        self.dip = (face.requested().board.dip.load() & u32::from(DIP_LAST)) as u8;
        face.program.dip_latched.store(self.dip.into());
        // The first start is not reported.
        if face.program.restarts.increment() > 1 {
            report(ctx, BoardEvent::Up { dip: Some(self.dip) });
        }
        // At the first power-on, the state of the plant file is used.
        if core::mem::replace(&mut self.is_used, true) {
            // While the board was off, a process with a program may have attached or ended.
            self.read(face);
            let reported_state = ProgramState::from_code(self.seen.program).unwrap_or(self.program);
            self.note_program(face, reported_state);
            self.projects.restart();
        }
        self.halted = false;
        self.show_project(face);
        self.see(ctx, face);
        self.dip
    }

    /// Called at power-off, or when RESET becomes active. Display and LEDs become dark.
    pub(crate) fn stop(&mut self, face: &FirmwareHeader) {
        self.up = false;
        self.released = false;
        face.put(|page| &page.board.leds, 0);
        face.board.display.store(0);
    }

    pub(crate) fn set_power(&mut self, face: &FirmwareHeader, power: Power) -> FrontAction {
        match power {
            Power::Off => face.put(|page| &page.program.power, header::Power::Off.code()),
            Power::On => face.put(|page| &page.program.power, header::Power::On.code()),
            Power::HoldReset => face.put(|page| &page.board.switch, RunSwitch::Reset.code()),
            Power::ReleaseReset => face.put(|page| &page.board.switch, RunSwitch::Stop.code()),
        }
        let had_supply = self.powered;
        self.read(face);
        self.change(had_supply)
    }

    /// Takes over the switches that clients have turned. An invalid position changes nothing.
    fn read(&mut self, face: &FirmwareHeader) {
        self.seen = PolledFront::now(face.requested());
        self.switch = RunSwitch::from_code(self.seen.switch).unwrap_or(self.switch);
        if let Some(power) = header::Power::from_code(self.seen.power) {
            self.powered = power == header::Power::On;
        }
    }

    fn change(&self, had_supply: bool) -> FrontAction {
        let held = self.switch == RunSwitch::Reset;
        match (self.up, self.powered) {
            (_, false) if had_supply => FrontAction::Off,
            (true, true) if held => FrontAction::Held,
            (false, true) if !held => FrontAction::Up,
            _ => FrontAction::Nothing,
        }
    }

    pub(crate) fn look(&mut self, ctx: &mut Context, face: &FirmwareHeader) -> FrontAction {
        let (before, had_supply) = (self.switch, self.powered);
        self.read(face);
        if self.switch != before {
            report(ctx, BoardEvent::Switch { to: self.switch });
        }
        let change = self.change(had_supply);
        if change == FrontAction::Nothing && self.up {
            self.see(ctx, face);
        }
        change
    }

    /// Starts and stops the program according to the switch, and shows the program's state.
    fn see(&mut self, ctx: &mut Context, face: &FirmwareHeader) {
        self.read(face);
        let reported_state = ProgramState::from_code(self.seen.program).unwrap_or(self.program);
        self.note_program(face, reported_state);
        let is_loaded = self.projects.loaded() != Project::None;
        let may_run = self.switch == RunSwitch::Run && is_loaded;
        if may_run && !self.released {
            let kind = if self.projects.starts_cold() { Start::Cold } else { Start::Warm };
            self.order(ctx, face, kind);
        } else if self.released && !may_run && is_loaded {
            self.order(ctx, face, Start::Stop);
        }
        self.released = may_run;
        face.board.display.store(self.character(ctx.now));
    }

    /// Handles the program state that the PLC reports: the program has started or ended, or is copying the
    /// boot project.
    fn note_program(&mut self, face: &FirmwareHeader, reported_state: ProgramState) {
        use ProgramState::*;
        let before = self.program;
        self.program = reported_state;
        match (self.projects.loaded(), reported_state) {
            (Project::None, None) => {}
            (_, None) => {
                self.projects.taken_back();
                self.flags.forget();
            }
            // After its project was lost, a program may still report its state. Such a report does not
            // announce a new program.
            (Project::None, Initializing | Cyclic) if self.projects.is_lost() => self.program = None,
            (Project::None, Stopped | Initializing | Cyclic) => self.projects.brought(),
            (_, ErasingBootProject) if before != reported_state => self.projects.erased(),
            (_, BootProjectCopied) if before != reported_state => self.projects.copied(),
            _ => {}
        }
        face.project.store(self.projects.loaded().code());
    }

    /// Called when another project was loaded, or the project was deleted. The PLC's program stops.
    fn show_project(&mut self, face: &FirmwareHeader) {
        let loaded = self.projects.loaded();
        if loaded == Project::None {
            self.flags.forget();
        }
        let state = if loaded == Project::None { ProgramState::None } else { ProgramState::Stopped };
        self.program = state;
        face.put(|page| &page.program.state, state.code());
        face.project.store(loaded.code());
    }

    /// Handles the request of a client to send or delete a project. The control dialog makes such requests
    /// (manual p. 37-38).
    pub(crate) fn look_at_project_request(&mut self, ctx: &mut Context, face: &FirmwareHeader) {
        let Some(code) = face.take(|page| &page.project_request) else { return };
        let Some(project) = Project::from_code(code - 1) else { return };
        if self.released {
            self.order(ctx, face, Start::Stop);
            self.released = false;
        }
        self.projects.load(project);
        self.halted = false;
        self.show_project(face);
        report(ctx, BoardEvent::Project { project });
        self.see(ctx, face);
    }

    /// True if events may occur. No event task runs while the switch or the program is at STOP.
    pub(crate) fn runs_events(&self) -> bool {
        self.switch == RunSwitch::Run && !(self.halted && self.projects.loaded() != Project::None)
    }

    /// Handles the request of a client for a start. The control dialog makes such requests. A start is
    /// possible only at RUN (manual p. 38).
    pub(crate) fn look_at_start_request(&mut self, ctx: &mut Context, face: &FirmwareHeader) {
        let Some(code) = face.take(|page| &page.program.start_request) else { return };
        match Start::from_code(code) {
            Some(kind) if self.released => self.order(ctx, face, kind),
            _ => report(ctx, BoardEvent::StartRefused { code: code as u8 }),
        }
    }

    fn order(&mut self, ctx: &mut Context, face: &FirmwareHeader, kind: Start) {
        if kind == Start::Cold {
            self.projects.started_cold();
            self.flags.initialize();
        }
        if matches!(kind, Start::Cold | Start::Warm) {
            self.flags.clear();
        }
        self.halted = kind == Start::Stop;
        self.started |= matches!(kind, Start::Cold | Start::Warm);
        self.ordered = true;
        program::order(face, kind);
        report(ctx, BoardEvent::Start { kind });
    }

    /// Handles the request of a client to set initial values of retain flags.
    pub(crate) fn look_at_flags(&mut self, face: &FirmwareHeader) {
        self.flags.look(&face.requested().initial_flag, &face.initial_flag);
    }

    /// True if a start or stop was ordered since the last call.
    pub(crate) fn take_order(&mut self) -> bool {
        core::mem::take(&mut self.ordered)
    }

    /// True if a cold or warm start was ordered since the last call.
    pub(crate) fn take_start(&mut self) -> bool {
        core::mem::take(&mut self.started)
    }

    /// Returns the character on the display (manual p. 40).
    fn character(&self, now: u64) -> u32 {
        let program = self.program;
        let stopped = if program == ProgramState::None { '0' } else { '1' };
        let character = match (self.switch, program) {
            (RunSwitch::Reset, _) => return 0,
            (_, ProgramState::ErasingBootProject) => 'C',
            (_, ProgramState::CopyingBootProject) => {
                let point = if (now / BLINK_US).is_multiple_of(2) { POINT } else { 0 };
                return u32::from('L') | point;
            }
            (_, ProgramState::BootProjectCopied) => 'A',
            (RunSwitch::Run, ProgramState::Initializing) => '2',
            (RunSwitch::Run, ProgramState::Cyclic) => '3',
            _ => stopped,
        };
        character.into()
    }
}
