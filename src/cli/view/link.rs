//! The thread that talks to the emulator, so that the screen never waits for it.

use super::look::{Looker, Seen, Wish};
use super::source::{Source, Trouble};
use super::work::{Outcome, Task};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

/// Real time between two looks.
const INTERVAL: Duration = Duration::from_millis(50);
/// Real time between two tries to connect.
const RETRY: Duration = Duration::from_millis(250);

/// What the thread is told.
#[derive(Debug)]
pub(super) enum Order {
    /// What the screen wants to show from now on.
    Show(Wish),
    /// Something to be done.
    Do(Task),
    /// What is being done ends.
    Cancel,
}

/// What the thread tells.
#[derive(Clone, Debug)]
pub(super) enum News {
    /// What there was to see.
    Seen(Box<Seen>),
    /// The emulator does not answer this time: another client lets time pass.
    Busy,
    /// There is no emulator: why.
    Absent(String),
    /// Work goes on: what.
    GoesOn(String),
    /// Work is done.
    Done(String),
    /// Work was refused, or a look.
    Failed(String),
}

/// Looks and works until nobody tells it anything any more.
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

/// What is to be done.
#[derive(Default)]
pub(super) struct Desk {
    wish: Wish,
    tasks: Vec<Task>,
    /// Work that was ended before its end, which is still to be told.
    given_up: Option<Task>,
}

impl Desk {
    /// Takes what has come, and waits at most for so long for it; `false` if nobody will say anything any more.
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

    /// Takes an order.
    pub(super) fn take(&mut self, order: Order) {
        match order {
            Order::Show(wish) => self.wish = wish,
            Order::Do(task) => self.tasks.push(task),
            Order::Cancel => self.given_up = self.tasks.drain(..).next(),
        }
    }

    /// Does a part of the work there is, and looks.
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
