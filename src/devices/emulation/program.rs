//! Starts and stops of the program, for devices without a RUN/STOP switch. The program may run while the
//! device is up (decision D-630).

use super::records::{BoardEvent, OnBoard};
use super::{Context, Events};
use crate::memory::FirmwareHeader;
use crate::memory::header::{
    InitialFlagResult, InterruptResult, OptInitResult, ProgramState, Project, Start,
};
use crate::snapshot_fields;
use serde::{Deserialize, Serialize};

/// The program of a client, and the last order for it.
pub(in crate::devices) struct Starts {
    seen: ProgramCells,
    is_loaded: bool,
    /// True if the next start must be a cold start, because the program is new.
    is_new: bool,
}

snapshot_fields!(Starts { values: seen, is_loaded, is_new });

/// Values that the cells of the header page had at the last poll. Only cells that clients write are included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct ProgramCells {
    requests: u32,
    program: u32,
}

impl ProgramCells {
    #[inline]
    fn now(face: &FirmwareHeader) -> Self {
        let asked = face.requested();
        ProgramCells { requests: asked.board_requests.load(), program: asked.program.state.load() }
    }
}

impl Starts {
    /// No program is loaded.
    pub(in crate::devices) fn new(face: &FirmwareHeader) -> Self {
        Starts { seen: ProgramCells::now(face), is_loaded: false, is_new: true }
    }

    /// True if a client has made a request or reported its program state since the last poll.
    #[inline]
    pub(in crate::devices) fn has_changed(&self, face: &FirmwareHeader) -> bool {
        ProgramCells::now(face) != self.seen
    }

    /// True if a client has made a request since the last poll.
    pub(in crate::devices) fn has_requests(&self, face: &FirmwareHeader) -> bool {
        face.requested().board_requests.load() != self.seen.requests
    }

    /// Polls only the requests of clients, for a device that starts and stops the program itself.
    pub(in crate::devices) fn look_at_requests(
        &mut self,
        ctx: &mut Context,
        face: &FirmwareHeader,
        has_interrupts: bool,
    ) {
        if self.has_requests(face) {
            self.seen.requests = face.requested().board_requests.load();
            refuse_requests(ctx, face, has_interrupts);
        }
    }

    /// Polls the requests and reports of clients. With `is_up`, the program may run. `has_interrupts`: the
    /// device answers `INTR_SET`. Returns the start or stop that was requested last.
    pub(in crate::devices) fn look(
        &mut self,
        ctx: &mut Context,
        face: &FirmwareHeader,
        is_up: bool,
        has_interrupts: bool,
    ) -> Option<Start> {
        let seen = ProgramCells::now(face);
        let is_asked = core::mem::replace(&mut self.seen, seen).requests != seen.requests;
        let mut ordered = self.note_program(ctx, face, is_up);
        if is_asked {
            refuse_requests(ctx, face, has_interrupts);
            ordered = self.look_at_request(ctx, face, is_up).or(ordered);
        }
        ordered
    }

    /// Called at power-on. Starts the program if one is loaded. A new program gets a cold start, any other
    /// program a warm start.
    pub(in crate::devices) fn start(&mut self, ctx: &mut Context, face: &FirmwareHeader) -> Option<Start> {
        self.is_loaded.then(|| self.order(ctx, face, if self.is_new { Start::Cold } else { Start::Warm }))
    }

    /// Handles the start or end of a program.
    fn note_program(&mut self, ctx: &mut Context, face: &FirmwareHeader, is_up: bool) -> Option<Start> {
        let is_loaded = self.seen.program != ProgramState::None.code();
        if core::mem::replace(&mut self.is_loaded, is_loaded) == is_loaded {
            return None;
        }
        self.is_new = true;
        let project = if is_loaded { Project::Boot } else { Project::None };
        face.project.store(project.code());
        (is_loaded && is_up).then(|| self.order(ctx, face, Start::Cold))
    }

    fn look_at_request(&mut self, ctx: &mut Context, face: &FirmwareHeader, is_up: bool) -> Option<Start> {
        let code = face.take(|page| &page.program.start_request)?;
        match Start::from_code(code) {
            Some(kind) if self.is_loaded && is_up => Some(self.order(ctx, face, kind)),
            _ => {
                refuse_start(ctx, code);
                None
            }
        }
    }

    fn order(&mut self, ctx: &mut Context, face: &FirmwareHeader, kind: Start) -> Start {
        self.is_new &= kind != Start::Cold;
        order(face, kind);
        report(ctx, BoardEvent::Start { kind });
        kind
    }
}

/// Requests a start or stop of the program.
pub(in crate::devices) fn order(face: &FirmwareHeader, kind: Start) {
    face.program.start_kind.store(kind.code());
    face.program.start.ring();
}

/// Refuses a start that a client requests.
pub(in crate::devices) fn refuse_start(ctx: &mut Context, code: u32) {
    report(ctx, BoardEvent::StartRefused { code: code as u8 });
}

/// Refuses the requests for functions that only other devices have, so that no client waits without a limit (D-213).
/// The device has no cold start that would write the initial value of a retain flag, no triggers, and no projects.
/// Without `has_interrupts` the device enables no events by `INTR_SET`.
fn refuse_requests(ctx: &mut Context, face: &FirmwareHeader, has_interrupts: bool) {
    if !has_interrupts {
        Events::default().answer(ctx, face, |_, _, _, _| InterruptResult::NoSuchEvent);
    }
    let asked = &face.requested().opt_init;
    let request = asked.request.load();
    if request != face.opt_init.answer.load() {
        let result = OptInitResult::NoTriggers;
        face.opt_init.answer(request, result);
        let modes = [0, 1, 2].map(|at| asked.triggers[at].load() as u8);
        report(ctx, BoardEvent::Triggers { modes, result });
    }
    face.take(|page| &page.project_request);
    let (slot, request) = (&face.initial_flag, face.requested().initial_flag.request.load());
    if request != slot.answer.load() {
        slot.result.store(InitialFlagResult::NoSuchFlag.code());
        slot.answer.store(request);
    }
}

pub(in crate::devices) fn report(ctx: &mut Context, what: BoardEvent) {
    ctx.report(OnBoard { plc: ctx.origin.plc, what });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::DeviceIndex;
    use crate::journal::{Journal, Origin};
    use crate::memory::{Header, Segment};

    struct Rig {
        face: FirmwareHeader,
        starts: Starts,
        journal: Journal,
    }

    impl Rig {
        fn new() -> Self {
            let face = Segment::heap(8192).firmware_header().unwrap();
            Rig { starts: Starts::new(&face), face, journal: Journal::default() }
        }

        fn with(
            &mut self,
            act: impl FnOnce(&mut Starts, &mut Context, &FirmwareHeader) -> Option<Start>,
        ) -> Option<Start> {
            let origin = Origin::of_device(DeviceIndex(0));
            let ctx = &mut Context { now: 0, journal: &mut self.journal, origin, base: 0 };
            act(&mut self.starts, ctx, &self.face)
        }

        /// Handles the state that a program reports.
        fn report(&mut self, state: ProgramState, is_up: bool) -> Option<Start> {
            self.face.program.state.store(state.code());
            self.with(|starts, ctx, face| starts.look(ctx, face, is_up, false))
        }

        fn ask(&mut self, kind: Start, is_up: bool) -> Option<Start> {
            self.face.ask(|page: &Header| &page.program.start_request, kind.code());
            self.with(|starts, ctx, face| starts.look(ctx, face, is_up, false))
        }

        fn power_on(&mut self) -> Option<Start> {
            self.with(Starts::start)
        }
    }

    /// If a stopped program reports its state, this does not count as a new program.
    #[test]
    fn a_program_starts_when_it_comes_and_when_the_supply_comes() {
        let mut rig = Rig::new();
        assert_eq!((rig.power_on(), rig.ask(Start::Cold, true)), (None, None), "there is none");
        assert_eq!(rig.report(ProgramState::Stopped, true), Some(Start::Cold));
        assert_eq!(rig.face.project.load(), Project::Boot.code());
        assert_eq!(rig.report(ProgramState::Cyclic, true), None);
        assert_eq!(rig.ask(Start::Stop, true), Some(Start::Stop));
        assert_eq!(rig.report(ProgramState::Stopped, true), None);
        assert_eq!(rig.ask(Start::Hot, true), Some(Start::Hot));
        assert_eq!((rig.report(ProgramState::Stopped, false), rig.ask(Start::Warm, false)), (None, None));
        assert_eq!(rig.power_on(), Some(Start::Warm));
        assert_eq!(
            (rig.face.program.start.rings(), rig.face.program.start_kind.load()),
            (4, Start::Warm.code())
        );
        assert_eq!((rig.report(ProgramState::None, true), rig.power_on()), (None, None));
        assert_eq!(rig.face.project.load(), Project::None.code());
    }

    #[test]
    fn a_program_that_comes_without_supply_starts_cold_with_it() {
        let mut rig = Rig::new();
        assert_eq!(rig.report(ProgramState::Stopped, false), None);
        assert_eq!((rig.power_on(), rig.power_on()), (Some(Start::Cold), Some(Start::Warm)));
    }

    /// A refused request is answered, so that no client waits without a limit.
    #[test]
    fn initial_values_of_retain_flags_are_refused() {
        let mut rig = Rig::new();
        let request = rig.face.initial_flag.ask(0, 1, 7);
        rig.face.board_requests.increment();
        rig.with(|starts, ctx, face| starts.look(ctx, face, true, false));
        assert_eq!(rig.face.initial_flag.outcome(request), Some(InitialFlagResult::NoSuchFlag.code()));
    }
}
