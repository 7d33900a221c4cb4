//! Going back in a scenario. The engine of scripts cannot go back, but a scenario gives the same result in every run. So the
//! scenario runs again from its beginning, up to an earlier place.

use crate::script::debug::{StopReason, Visit};

/// Goal of a user who goes back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    /// Back to the previous place of this function or of a caller. After a failure, back to the place at which the
    /// scenario has failed.
    Step,
    /// Back to the last place with a breakpoint. If there is no such place, back to the first place.
    Breakpoint,
}

/// A place in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Visited {
    /// Number of the visit in the run, from 1.
    number: u64,
    line: usize,
}

enum Goal {
    /// The run stops at this place.
    Place(Visited, StopReason),
    /// This run searches the last place with a breakpoint that has a lower number of the visit than `before`. The next
    /// run stops at the found place.
    Search { before: u64, found: Option<Visited> },
}

/// The visits of the present run, and the goal of the next one.
#[derive(Default)]
pub(super) struct History {
    first: Option<Visited>,
    /// The latest place.
    here: Option<Visited>,
    /// The place to which a step back from the present place leads.
    before: Option<Visited>,
    /// The latest place of each function in the call stack, the outermost first.
    latest: Vec<Visited>,
    /// Changes of the user: number of the visit, register and value.
    changes: Vec<(u64, String, String)>,
    goal: Option<Goal>,
    /// True if the present run ends because another one begins.
    ends: bool,
    /// True if a run came to another line than the previous run, because the files of the scenario have changed.
    differs: bool,
}

impl History {
    /// Begins a run. Changes at the goal or later are forgotten.
    pub(super) fn begin(&mut self) {
        let end = match &self.goal {
            None => u64::MAX,
            Some(Goal::Place(place, _)) => place.number,
            Some(Goal::Search { before, .. }) => *before,
        };
        self.changes.retain(|(number, ..)| *number < end);
        self.latest.clear();
        (self.first, self.here, self.before) = (None, None, None);
    }

    /// Returns true once if the run has ended because another one begins.
    pub(super) fn takes_end(&mut self) -> bool {
        core::mem::take(&mut self.ends)
    }

    /// Returns true once if the run came to another line than the previous run.
    pub(super) fn takes_difference(&mut self) -> bool {
        core::mem::take(&mut self.differs)
    }

    /// True if the run repeats an earlier one.
    pub(super) fn goes_back(&self) -> bool {
        self.goal.is_some()
    }

    /// Notes a visit of a line in a function at a depth of the call stack.
    pub(super) fn visit(&mut self, depth: usize, line: usize) {
        let here = Visited { number: self.here.map_or(1, |last| last.number + 1), line };
        self.latest.truncate(depth + 1);
        self.before = self.latest.last().copied();
        self.latest.truncate(depth);
        self.latest.resize(depth + 1, here);
        self.first = self.first.or(Some(here));
        self.here = Some(here);
    }

    /// Notes that the user has changed a register at the present stop.
    pub(super) fn change(&mut self, register: &str, value: &str) {
        let number = self.here.map_or(0, |here| here.number);
        self.changes.push((number, register.to_owned(), value.to_owned()));
    }

    /// The changes of the user at the present visit, in a run that repeats an earlier one: register and value.
    pub(super) fn changes_here(&self) -> impl Iterator<Item = (&str, &str)> {
        let here = self.here.map(|here| here.number);
        let changes = self.changes.iter().filter(move |(number, ..)| Some(*number) == here);
        changes.map(|(_, register, value)| (register.as_str(), value.as_str()))
    }

    /// Decides at the present visit. `has_breakpoint` says whether the place has a breakpoint.
    pub(super) fn decide(&mut self, has_breakpoint: impl FnOnce() -> bool) -> Visit {
        let Some(here) = self.here else { return Visit::Run };
        match &mut self.goal {
            None => Visit::Run,
            Some(Goal::Place(place, _)) if here.number < place.number => Visit::Pass,
            Some(Goal::Place(place, reason)) => {
                self.differs = place.line != here.line;
                let reason = reason.clone();
                self.goal = None;
                Visit::Stop(reason)
            }
            Some(Goal::Search { before, .. }) if here.number >= *before => Visit::Stop(StopReason::Step),
            Some(Goal::Search { found, .. }) => {
                if has_breakpoint() {
                    *found = Some(here);
                }
                Visit::Pass
            }
        }
    }

    /// Ends the repetition: the run goes on from the present place.
    pub(super) fn stay(&mut self) {
        self.goal = None;
    }

    /// Sets the goal of the next run; false if no place is before the present stop. The caller ends the run.
    pub(super) fn turns(&mut self, direction: Direction, is_failure: bool) -> bool {
        let Some(here) = self.here else { return false };
        let previous = if is_failure { Some(here) } else { self.before };
        let Some(previous) = previous else { return false };
        self.goal = Some(match direction {
            Direction::Step => Goal::Place(previous, StopReason::Step),
            Direction::Breakpoint => {
                Goal::Search { before: here.number + u64::from(is_failure), found: None }
            }
        });
        self.ends = true;
        true
    }

    /// Called at a place where a run would stop. Returns true if the run was only a search: the caller then ends it,
    /// and the next run stops at the place that the search has found.
    pub(super) fn has_searched(&mut self) -> bool {
        let Some(Goal::Search { found, .. }) = self.goal.take() else { return false };
        let entry = || self.first.map(|first| Goal::Place(first, StopReason::Entry));
        self.goal = found.map(|place| Goal::Place(place, StopReason::Breakpoint)).or_else(entry);
        self.ends = self.goal.is_some();
        self.ends
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Visits lines, each with its depth, and returns the decision at the last one.
    fn run(history: &mut History, visits: &[(usize, usize)], breakpoint: usize) -> Visit {
        history.begin();
        let mut last = Visit::Run;
        for (depth, line) in visits {
            history.visit(*depth, *line);
            last = history.decide(|| *line == breakpoint);
            if matches!(last, Visit::Stop(_)) {
                break;
            }
        }
        last
    }

    /// Line 1 calls a function with lines 10 and 11; line 2 follows.
    const VISITS: [(usize, usize); 4] = [(0, 1), (1, 10), (1, 11), (0, 2)];

    #[test]
    fn a_step_back_skips_a_called_function() {
        let mut history = History::default();
        run(&mut history, &VISITS, 0);
        assert!(history.turns(Direction::Step, false) && history.takes_end());
        assert_eq!(run(&mut history, &VISITS, 0), Visit::Stop(StopReason::Step));
        assert_eq!(history.here, Some(Visited { number: 1, line: 1 }));
        assert!(!history.goes_back() && !history.takes_difference());
        assert!(!history.turns(Direction::Step, false), "line 1 is the first place");
    }

    #[test]
    fn a_step_back_stays_in_its_function_and_reaches_the_caller() {
        let mut history = History::default();
        for (visits, expected) in [(3, 10), (2, 1)] {
            run(&mut history, &VISITS[..visits], 0);
            assert!(history.turns(Direction::Step, false));
            run(&mut history, &VISITS, 0);
            assert_eq!(history.here.unwrap().line, expected);
        }
    }

    #[test]
    fn the_last_breakpoint_is_found_or_the_first_place() {
        for (breakpoint, reason, line) in [(10, StopReason::Breakpoint, 10), (99, StopReason::Entry, 1)] {
            let mut history = History::default();
            run(&mut history, &VISITS, 0);
            assert!(history.turns(Direction::Breakpoint, false));
            assert_eq!(run(&mut history, &VISITS, breakpoint), Visit::Stop(StopReason::Step));
            assert!(history.has_searched());
            assert_eq!(run(&mut history, &VISITS, breakpoint), Visit::Stop(reason));
            assert_eq!(history.here.unwrap().line, line);
        }
    }

    #[test]
    fn a_step_back_from_a_failure_reaches_the_line_that_fails() {
        let mut history = History::default();
        run(&mut history, &VISITS, 0);
        assert!(history.turns(Direction::Step, true));
        assert_eq!(run(&mut history, &VISITS, 0), Visit::Stop(StopReason::Step));
        assert_eq!(history.here.unwrap().line, 2);
        assert!(!History::default().turns(Direction::Step, true), "a script that does not compile");
    }

    #[test]
    fn earlier_changes_are_repeated_and_later_ones_forgotten() {
        let mut history = History::default();
        run(&mut history, &VISITS[..2], 0);
        history.change("a.x", "1");
        for (depth, line) in &VISITS[2..] {
            history.visit(*depth, *line);
        }
        history.change("a.y", "2");
        assert!(history.turns(Direction::Step, true));
        history.begin();
        let mut repeated = Vec::new();
        for (depth, line) in VISITS {
            history.visit(depth, line);
            repeated.extend(history.changes_here().map(|(name, _)| (line, name.to_owned())));
        }
        assert_eq!(repeated, [(10, "a.x".to_owned())]);
    }

    #[test]
    fn a_changed_script_is_noticed() {
        let mut history = History::default();
        run(&mut history, &VISITS, 0);
        assert!(history.turns(Direction::Step, true));
        run(&mut history, &[(0, 1), (0, 2), (0, 3), (0, 4)], 0);
        assert!(history.takes_difference());
    }
}
