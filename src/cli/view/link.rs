//! The thread that communicates with the emulator, so that the screen never waits for it.

use super::look::{Looker, Seen, Wish};
use super::source::{Source, Trouble};
use super::work::{Outcome, Task};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

/// Real time between two polls.
const INTERVAL: Duration = Duration::from_millis(50);
/// Real time between two attempts to connect.
const RETRY: Duration = Duration::from_millis(250);

/// A command to the thread.
#[derive(Debug)]
pub(super) enum Order {
    /// Sets the data that the screen needs from now on.
    Show(Wish),
    /// Starts a task.
    Do(Task),
    /// Cancels the current task.
    Cancel,
}

/// A report of the thread.
#[derive(Clone, Debug)]
pub(super) enum News {
    /// Result of a poll.
    Seen(Box<Seen>),
    /// The emulator does not answer this time: another client advances the clock.
    Busy,
    /// The emulator cannot be reached, with the reason.
    Absent(String),
    /// Progress of a task.
    GoesOn(String),
    /// A task is done.
    Done(String),
    /// A task or a poll was refused.
    Failed(String),
}

/// Polls and executes tasks until the other end of a channel is closed.
pub(super) fn serve<S: Source>(
    mut connect: impl FnMut() -> Result<S, String>,
    orders: &Receiver<Order>,
    news: &Sender<News>,
) {
    let mut desk = Desk::default();
    let mut link: Option<(S, Looker)> = None;
    loop {
        let pause = if link.is_none() { RETRY } else { INTERVAL };
        if !desk.wait(orders, pause) {
            return;
        }
        let told = match &mut link {
            Some((source, looker)) => desk.turn(source, looker),
            None => match connect() {
                Ok(source) => {
                    link = Some((source, Looker::default()));
                    continue;
                }
                Err(why) => vec![News::Absent(why)],
            },
        };
        if told.iter().any(|news| matches!(news, News::Absent(_))) {
            link = None;
        }
        if told.into_iter().any(|told| news.send(told).is_err()) {
            return;
        }
    }
}

/// Current query and pending tasks.
#[derive(Default)]
pub(super) struct Desk {
    wish: Wish,
    tasks: Vec<Task>,
    /// A cancelled task that has not been reported yet.
    given_up: Option<Task>,
}

impl Desk {
    /// Waits for a command at most for `pause` and takes all commands; returns false if the channel is closed.
    fn wait(&mut self, orders: &Receiver<Order>, pause: Duration) -> bool {
        let pause = if self.tasks.is_empty() { pause } else { Duration::ZERO };
        match orders.recv_timeout(pause) {
            Ok(order) => self.take(order),
            Err(RecvTimeoutError::Timeout) => return true,
            Err(RecvTimeoutError::Disconnected) => return false,
        }
        orders.try_iter().for_each(|order| self.take(order));
        true
    }

    /// Takes a command.
    pub(super) fn take(&mut self, order: Order) {
        match order {
            Order::Show(wish) => self.wish = wish,
            Order::Do(task) => self.tasks.push(task),
            Order::Cancel => self.given_up = self.tasks.drain(..).next(),
        }
    }

    /// Executes a part of the first task, and polls.
    pub(super) fn turn(&mut self, source: &mut dyn Source, looker: &mut Looker) -> Vec<News> {
        let mut told = Vec::new();
        told.extend(self.given_up.take().map(|task| News::Done(task.given_up())));
        if !self.tasks.is_empty() {
            let task = self.tasks.remove(0);
            match task.go(source) {
                Ok(Outcome::More(task)) => {
                    told.push(News::GoesOn(task.going_on()));
                    self.tasks.insert(0, task);
                }
                Ok(Outcome::Done(text)) => told.push(News::Done(text)),
                Ok(Outcome::Refused(why)) => told.push(News::Failed(why)),
                Err(trouble) => told.push(self.tell(trouble)),
            }
        }
        match looker.look(source, &self.wish) {
            Ok(seen) => told.push(News::Seen(Box::new(seen))),
            Err(trouble) => told.push(self.tell(trouble)),
        }
        told
    }

    fn tell(&mut self, trouble: Trouble) -> News {
        match trouble {
            Trouble::Busy => News::Busy,
            Trouble::Gone(why) => {
                self.tasks.clear();
                News::Absent(why)
            }
            Trouble::Refused(why) => News::Failed(why),
        }
    }
}
