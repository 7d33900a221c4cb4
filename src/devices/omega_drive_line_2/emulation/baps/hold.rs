//! Delays of tasks from the BAPS. Normally the drive executes a task immediately, but a fault can make the
//! drive slow or silent.

use serde::{Deserialize, Serialize};

/// Time at which the drive takes a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// The drive takes the task in this time slice.
    AtOnce,
    /// The drive takes the task at least the given number of microseconds later, in the first time slice from
    /// then on.
    Late(u32),
    /// The drive does not take the task in this time slice.
    Never,
}

/// A task that may wait.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Hold {
    /// Emulated time until which the task waits, in microseconds; `None` if it does not wait.
    until: Option<u64>,
}

impl Hold {
    /// True if a task waits.
    pub(crate) fn is_running(&self) -> bool {
        self.until.is_some()
    }

    /// Drops the waiting task, if there is one.
    pub(crate) fn forget(&mut self) {
        self.until = None;
    }

    /// Decides when the drive takes a command, in the slice at `now`. `pace` is called when the command
    /// appears, and once more when the command has waited; its argument is then true. A command waits only
    /// once.
    pub(crate) fn turn(&mut self, now: u64, pace: impl FnOnce(bool) -> Pace) -> Pace {
        if let Some(until) = self.until.filter(|&until| now < until) {
            return Pace::Late((until - now) as u32);
        }
        let has_waited = self.until.is_some();
        match pace(has_waited) {
            Pace::Late(us) if !has_waited => {
                self.until = Some(now + u64::from(us));
                Pace::Late(us)
            }
            Pace::Late(_) | Pace::AtOnce => {
                self.until = None;
                Pace::AtOnce
            }
            Pace::Never => Pace::Never,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_task_runs_once_and_then_the_next_is_late() {
        let mut hold = Hold::default();
        let mut asked = Vec::new();
        let mut turn = |now| {
            hold.turn(now, |has_waited| {
                asked.push((now, has_waited));
                if has_waited { Pace::AtOnce } else { Pace::Late(700) }
            })
        };
        let turns = [500, 1000, 1500, 2000].map(&mut turn);
        assert_eq!(turns, [Pace::Late(700), Pace::Late(200), Pace::AtOnce, Pace::Late(700)]);
        assert_eq!(asked, [(500, false), (1500, true), (2000, false)]);
    }

    #[test]
    fn a_delayed_task_can_still_be_suppressed() {
        let mut hold = Hold::default();
        assert_eq!(hold.turn(0, |_| Pace::Late(500)), Pace::Late(500));
        assert_eq!(hold.turn(500, |_| Pace::Never), Pace::Never);
        assert_eq!(
            hold.turn(1000, |has_waited| if has_waited { Pace::Late(9) } else { Pace::Never }),
            Pace::AtOnce
        );
        assert!(!hold.is_running());
    }
}
