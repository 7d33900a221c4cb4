//! The firmware that a script describes.

use super::budget::Budget;
use super::frames;
use super::mistake::Mistake;
use super::program::{Outcome, Program};
use super::state::State;
use super::timers::Timers;
use super::verb_context::Acting;
use super::{Hooks, Script};
use crate::devices::Context;
use crate::devices::folder::card::{Card, Place};
use crate::devices::folder::own_faults::FaultChange;
use crate::devices::folder::part::Part;
use crate::devices::folder::port::Arrival;
use crate::devices::folder::records::Stopped;
use crate::devices::folder::{rules, state_word};
use crate::journal::Finding;
use crate::layout::DeviceLayout;
use crate::memory::header::Start;
use core::mem;
use rhai::{Dynamic, INT, Map};

/// Calls the functions of a script when they are due.
pub(super) struct ScriptFirmware {
    script: &'static Script,
    layout: &'static DeviceLayout,
    /// The map `this` of the script.
    state: State,
    timers: Timers,
    budget: Budget,
    /// True if an error has stopped the script until the next power-on.
    is_stopped: bool,
    /// True if a function has run since the last poll. It may have written registers that other parts read.
    has_moved: bool,
}

crate::snapshot_fields!(ScriptFirmware {
    values: budget, is_stopped, has_moved;
    parts: state, timers;
    built: script, layout
});

impl ScriptFirmware {
    pub(super) fn new(script: &'static Script, layout: &'static DeviceLayout) -> Self {
        ScriptFirmware {
            script,
            layout,
            state: State::empty(),
            timers: Timers::default(),
            budget: Budget::default(),
            is_stopped: false,
            has_moved: true,
        }
    }

    /// Calls a function of the script.
    fn call(&mut self, ctx: &mut Context, card: &mut Card, function: &str, arguments: Vec<Dynamic>) {
        if self.is_stopped {
            return;
        }
        self.has_moved = true;
        let program = match Program::of(self.script, self.layout) {
            Ok(program) => program,
            Err(mistake) => return self.halt(ctx, card, &mistake),
        };
        let acting = Acting {
            now: ctx.now,
            origin: ctx.origin,
            card: card.lend(),
            timers: mem::take(&mut self.timers),
            reports: Vec::new(),
        };
        let Outcome { result, acting } =
            program.call(acting, &mut self.budget, &mut self.state, function, arguments);
        if let Some(acting) = acting {
            card.give_back(acting.card);
            self.timers = acting.timers;
            acting.reports.into_iter().for_each(|report| report.write(ctx));
        }
        if let Err(mistake) = result {
            self.halt(ctx, card, &mistake);
        }
    }

    /// Stops the script after an error. The emulator and the other devices continue.
    fn halt(&mut self, ctx: &mut Context, card: &mut Card, mistake: &Mistake) {
        self.is_stopped = true;
        self.timers.clear();
        let what = mistake.to_string();
        Stopped::write(ctx.journal, ctx.now, ctx.origin.plc, &what);
        self.show_state(card);
        if let Ok(word) = self.layout.register(state_word::NAME) {
            let (rule, plc, offset) = (&rules::SCRIPT_STOPPED, ctx.origin.plc, word.offset());
            let finding = Finding { rule, plc, offset, live: word.placed.live, value: 1, late_us: 0 };
            ctx.journal.find_with(ctx.now, finding, &what);
        }
    }

    /// Shows in the front panel of the device whether the script is running.
    fn show_state(&self, card: &mut Card) {
        if let Ok(word) = self.layout.register(state_word::NAME) {
            card.update(Place::of(&word), |_| self.is_stopped.into());
        }
    }

    /// Calls the hooks for the events of the port, in the order of the events. A stopped script handles no
    /// events.
    fn take_arrivals(&mut self, ctx: &mut Context, card: &mut Card) {
        let Hooks { frame: has_frame, bus_event: has_event, .. } = self.script.hooks;
        while let Some(arrival) = card.take_arrival() {
            match arrival {
                Arrival::Frame(frame) if has_frame => {
                    self.call(ctx, card, "frame", vec![frames::value_of(&frame)]);
                }
                Arrival::State(state) if has_event => {
                    self.call(ctx, card, "bus_event", vec![state.name().into()]);
                }
                Arrival::Overrun if has_event => {
                    self.call(ctx, card, "bus_event", vec!["overrun".into()]);
                }
                Arrival::Frame(_) | Arrival::State(_) | Arrival::Overrun => {}
            }
        }
    }

    /// Calls the functions that are due now.
    fn run_timers(&mut self, ctx: &mut Context, card: &mut Card) {
        while let Some(timer) = self.timers.take(ctx.now) {
            self.call(ctx, card, &timer.function, timer.arguments.values());
        }
    }
}

impl Part for ScriptFirmware {
    fn start(&mut self, ctx: &mut Context, card: &mut Card) {
        self.state = State::empty();
        self.timers = Timers::default();
        self.is_stopped = false;
        self.has_moved = true;
        card.forget_changes();
        self.show_state(card);
        if self.script.hooks.power_on {
            self.call(ctx, card, "power_on", Vec::new());
        }
    }

    fn stop(&mut self, ctx: &mut Context, card: &mut Card) {
        if self.script.hooks.power_off {
            self.call(ctx, card, "power_off", Vec::new());
        }
        self.timers.clear();
    }

    fn look(&mut self, ctx: &mut Context, card: &mut Card) {
        self.has_moved = false;
        self.take_arrivals(ctx, card);
        if self.is_stopped {
            return;
        }
        if self.script.hooks.written {
            for (register, old, new) in card.changes() {
                let number = |value| Dynamic::from_int(INT::from(register.ty().number(value)));
                let arguments = vec![register.name().into(), number(old), number(new)];
                self.call(ctx, card, "written", arguments);
            }
        }
        self.run_timers(ctx, card);
        if self.script.hooks.poll {
            self.call(ctx, card, "poll", Vec::new());
        }
    }

    fn is_quiescent(&self) -> bool {
        self.is_stopped || !self.has_moved && !self.script.hooks.poll
    }

    fn next_time(&self) -> u64 {
        self.timers.next()
    }

    fn due(&mut self, ctx: &mut Context, card: &mut Card) {
        self.take_arrivals(ctx, card);
        self.run_timers(ctx, card);
    }

    /// Takes over a changed script. The script continues with its state, even if an error had stopped it.
    fn take_over(&mut self, _: &mut Context, card: &mut Card, script: &'static Script) {
        if script.watches() {
            card.watch_again(self.layout, script.written());
        }
        (self.script, self.is_stopped, self.has_moved) = (script, false, true);
        self.show_state(card);
    }

    fn fault(&mut self, ctx: &mut Context, card: &mut Card, change: &FaultChange) {
        if !self.script.hooks.fault {
            return;
        }
        let FaultChange { kind, values, is_on } = change;
        let fields = kind.fields().iter().zip(values);
        let fields: Map = fields
            .filter_map(|(field, value)| Some((field.name().into(), INT::from((*value)?).into())))
            .collect();
        let arguments = vec![kind.name().into(), (*is_on).into(), fields.into()];
        self.call(ctx, card, "fault", arguments);
    }

    fn trigger(&mut self, ctx: &mut Context, card: &mut Card) {
        if self.script.hooks.trigger {
            self.call(ctx, card, "trigger", Vec::new());
        }
    }

    fn sync_edge(&mut self, ctx: &mut Context, card: &mut Card) {
        if self.script.hooks.sync_edge {
            self.call(ctx, card, "sync_edge", Vec::new());
        }
    }

    fn ordered(&mut self, ctx: &mut Context, card: &mut Card, order: Start) {
        if self.script.hooks.board {
            let order = format!("{order:?}").to_lowercase();
            self.call(ctx, card, "board", vec![order.into()]);
        }
    }
}
