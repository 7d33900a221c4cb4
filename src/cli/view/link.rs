//! The thread that communicates with the emulator, so that the screen never waits for the emulator.

use super::poll::{PollData, Poller, Query};
use super::source::{RequestError, Source};
use super::work::{Outcome, Task};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

/// Real time between two polls.
const INTERVAL: Duration = Duration::from_millis(50);
/// Real time between two attempts to connect.
const RETRY: Duration = Duration::from_millis(250);

/// A command to the thread.
#[derive(Debug)]
pub(super) enum LinkCommand {
    /// Sets the data that the screen needs from now on.
    Show(Query),
    /// Starts a task of the thread that communicates with the emulator.
    Do(Task),
    /// Cancels the current task.
    Cancel,
}

/// A report of the thread.
#[derive(Clone, Debug)]
pub(super) enum LinkReport {
    /// Result of a poll.
    Data(Box<PollData>),
    /// The emulator does not answer this time: another client advances the clock.
    Busy,
    /// The emulator cannot be reached, with the reason.
    Absent(String),
    /// Progress of a task.
    Progress(String),
    /// A task is done.
    Done(String),
    /// A task or a poll was refused.
    Failed(String),
}

/// Polls and executes tasks, until the screen's end of `commands` or `reports` is closed.
pub(super) fn serve<S: Source>(
    mut connect: impl FnMut() -> Result<S, String>,
    commands: &Receiver<LinkCommand>,
    reports: &Sender<LinkReport>,
) {
    let mut queue = TaskQueue::default();
    let mut link: Option<(S, Poller)> = None;
    loop {
        let pause = if link.is_none() { RETRY } else { INTERVAL };
        if !queue.wait(commands, pause) {
            return;
        }
        let new_reports = match &mut link {
            Some((source, poller)) => queue.turn(source, poller),
            None => match connect() {
                Ok(source) => {
                    link = Some((source, Poller::default()));
                    continue;
                }
                Err(why) => vec![LinkReport::Absent(why)],
            },
        };
        if new_reports.iter().any(|report| matches!(report, LinkReport::Absent(_))) {
            link = None;
        }
        if new_reports.into_iter().any(|report| reports.send(report).is_err()) {
            return;
        }
    }
}

/// Current query and pending tasks.
#[derive(Default)]
pub(super) struct TaskQueue {
    query: Query,
    tasks: Vec<Task>,
    /// A cancelled task that has not been reported yet.
    cancelled: Option<Task>,
}

impl TaskQueue {
    /// Waits at most `pause` for a command, then takes all pending commands. Returns false if the channel is closed.
    fn wait(&mut self, commands: &Receiver<LinkCommand>, pause: Duration) -> bool {
        let pause = if self.tasks.is_empty() { pause } else { Duration::ZERO };
        match commands.recv_timeout(pause) {
            Ok(command) => self.take(command),
            Err(RecvTimeoutError::Timeout) => return true,
            Err(RecvTimeoutError::Disconnected) => return false,
        }
        commands.try_iter().for_each(|command| self.take(command));
        true
    }

    /// Takes a command of the screen.
    pub(super) fn take(&mut self, command: LinkCommand) {
        match command {
            LinkCommand::Show(query) => self.query = query,
            LinkCommand::Do(task) => self.tasks.push(task),
            LinkCommand::Cancel => self.cancelled = self.tasks.drain(..).next(),
        }
    }

    /// Executes a part of the first task, then polls.
    pub(super) fn turn(&mut self, source: &mut dyn Source, poller: &mut Poller) -> Vec<LinkReport> {
        let mut reports = Vec::new();
        reports.extend(self.cancelled.take().map(|task| LinkReport::Done(task.cancelled())));
        if !self.tasks.is_empty() {
            let task = self.tasks.remove(0);
            match task.go(source) {
                Ok(Outcome::More(task)) => {
                    reports.push(LinkReport::Progress(task.progress()));
                    self.tasks.insert(0, task);
                }
                Ok(Outcome::Done(text)) => reports.push(LinkReport::Done(text)),
                Ok(Outcome::Refused(why)) => reports.push(LinkReport::Failed(why)),
                Err(trouble) => reports.push(self.report_of(trouble)),
            }
        }
        match poller.poll(source, &self.query) {
            Ok(seen) => reports.push(LinkReport::Data(Box::new(seen))),
            Err(trouble) => reports.push(self.report_of(trouble)),
        }
        reports
    }

    /// Returns the report of a failed request. Drops all tasks if the emulator has ended.
    fn report_of(&mut self, trouble: RequestError) -> LinkReport {
        match trouble {
            RequestError::Busy => LinkReport::Busy,
            RequestError::Gone(why) => {
                self.tasks.clear();
                LinkReport::Absent(why)
            }
            RequestError::Refused(why) => LinkReport::Failed(why),
        }
    }
}
