//! A connection to an emulator in a separate thread: requests wait for replies, but the server must not wait.

use super::problem::Problem;
use super::strand;
use crate::channel::ClientError;
use crate::cli::Instance;
use crate::cli::error::CliError;
use crate::cli::session::Session;
use crate::journal::Names;
use crate::memory::take_gap_of_thread;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{oneshot, watch};

/// Requests that wait for the connection; further ones are refused.
const WAITING: usize = 64;

/// Real time between two checks whether a channel is shortened.
const CHECK: Duration = Duration::from_millis(20);

/// An open connection.
pub(super) struct Connection {
    pub session: Session,
    /// Names of PLCs and buses.
    pub names: Names,
    /// Time of the last check whether the channel is shortened.
    checked: Cell<Instant>,
    is_damaged: Cell<bool>,
    // After the session: the connection is closed when this is dropped.
    open: OpenConnections,
}

/// Counts the open connections of this process while it exists.
struct OpenConnections;

thread_local! {
    /// Whether this thread has an open connection.
    static HAS_CONNECTION: Cell<bool> = const { Cell::new(false) };
}

static OPEN: Mutex<usize> = Mutex::new(0);
static CLOSED: Condvar = Condvar::new();

impl OpenConnections {
    fn enter() -> Self {
        *OPEN.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        HAS_CONNECTION.set(true);
        Self
    }
}

impl Drop for OpenConnections {
    fn drop(&mut self) {
        *OPEN.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
        HAS_CONNECTION.set(false);
        CLOSED.notify_all();
    }
}

/// Waits until all connections are closed, for at most `limit`. If the process ended earlier, it would not leave the
/// channels, and its files would stay.
pub(super) fn wait_until_closed(limit: Duration) {
    let open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    drop(CLOSED.wait_timeout_while(open, limit, |open| *open > 0));
}

impl Connection {
    /// Connects to a running instance.
    ///
    /// # Errors
    /// It is not running, or its channel cannot be used.
    pub(super) fn open(instance: &str) -> Result<Self, CliError> {
        let session = Session::open(&Instance::running(instance), 0)?;
        let open = OpenConnections::enter();
        let names = session.info()?.names;
        Ok(Self { session, names, checked: Cell::new(Instant::now()), is_damaged: Cell::default(), open })
    }

    /// The reason why this connection is of no use, if another program has shortened the channel: this thread has read zeros
    /// instead of the missing part, or would do so.
    fn damage(&self) -> Option<CliError> {
        if take_gap_of_thread() {
            self.is_damaged.set(true);
        }
        if !self.is_damaged.get() && self.checked.get().elapsed() >= CHECK {
            self.checked.set(Instant::now());
            self.is_damaged.set(self.session.has_shortened_channel());
        }
        self.is_damaged.get().then(|| broken(self.session.instance()))
    }

    /// Closes the connection. A connection through a damaged channel is given up instead: leaving it could end this
    /// process, which serves other instances.
    pub(super) fn close(self) {
        if self.damage().is_some() || self.session.has_shortened_channel() {
            let Self { session, open, .. } = self;
            core::mem::forget(session);
            drop(open);
        }
    }
}

/// The error of a damaged channel.
pub(super) fn broken(instance: &str) -> CliError {
    ClientError::Broken { instance: instance.to_owned() }.into()
}

/// Stops counting the connection of this thread, which will never close it.
pub(super) fn abandon() {
    if HAS_CONNECTION.replace(false) {
        *OPEN.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
        CLOSED.notify_all();
    }
}

/// Work with the connection, or with the reason why there is none. Returns whether the connection can be used again.
type Job = Box<dyn FnOnce(Result<&mut Connection, Problem>) -> bool + Send>;

/// A client that waits for the result of a job. When this value is dropped, the client has gone.
#[derive(Default)]
struct Waiter {
    has_gone: Arc<AtomicBool>,
}

impl Drop for Waiter {
    fn drop(&mut self) {
        self.has_gone.store(true, Ordering::Relaxed);
    }
}

/// Access to the thread. The thread ends when the last link is dropped.
#[derive(Clone)]
pub(super) struct Link {
    jobs: SyncSender<Job>,
    instance: Arc<str>,
    /// Becomes true if the thread stops at a panic.
    has_stopped: watch::Receiver<bool>,
}

impl Link {
    /// Starts a thread, which connects when the first job arrives.
    ///
    /// # Errors
    /// The system has no thread.
    pub(super) fn start(instance: &str) -> Result<Self, Problem> {
        let (sender, jobs) = mpsc::sync_channel(WAITING);
        let instance: Arc<str> = instance.into();
        let (stop, has_stopped) = watch::channel(false);
        let thread = std::thread::Builder::new().name("web-link".to_owned());
        let own = Arc::clone(&instance);
        let work = move || {
            strand::at_the_end(move || {
                abandon();
                // Fails if no link is left.
                let _ = stop.send(true);
            });
            serve(&own, &jobs);
        };
        thread.spawn(work).map_err(|reason| Problem::from(CliError::Process { reason }))?;
        Ok(Self { jobs: sender, instance, has_stopped })
    }

    /// Does `work` in the thread. If the returned future is dropped, because the client has closed its connection, the
    /// request to the emulator is withdrawn.
    ///
    /// # Errors
    /// The errors of `work`; the emulator cannot be reached; or too many jobs wait.
    pub(super) async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut Connection) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let (answer, result) = oneshot::channel();
        let waiter = Waiter::default();
        let has_gone = Arc::clone(&waiter.has_gone);
        let job: Job = Box::new(move |connection| {
            if has_gone.load(Ordering::Relaxed) {
                return true;
            }
            let result = connection.and_then(|connection| {
                connection.session.set_cancel(has_gone);
                guarded(connection, |it| it, work)
            });
            let is_usable = !matches!(&result, Err(problem) if problem.is_gone());
            // Fails if the client has gone.
            let _ = answer.send(result);
            is_usable
        });
        let busy = || Problem::too_many("too many requests wait for the emulator");
        self.jobs.try_send(job).map_err(|_| busy())?;
        let mut has_stopped = self.has_stopped.clone();
        let stopped = async {
            // The sender exists until the thread ends.
            if has_stopped.wait_for(|stopped| *stopped).await.is_err() {
                std::future::pending::<()>().await;
            }
        };
        let result = tokio::select! {
            biased;
            result = result => result.map_err(|_| busy())?,
            () = stopped => Err(broken(&self.instance).into()),
        };
        drop(waiter);
        result
    }
}

/// Does `work` with a value that has a connection. Fails if the channel is damaged before or during the work: the data
/// read may then be wrong, and iceoryx2 can panic.
///
/// # Errors
/// The errors of `work`, or [`ClientError::Broken`].
pub(super) fn guarded<C, T, E: From<CliError>>(
    user: &mut C,
    connection: impl Fn(&C) -> &Connection,
    work: impl FnOnce(&mut C) -> Result<T, E>,
) -> Result<T, E> {
    if let Some(damage) = connection(user).damage() {
        return Err(damage.into());
    }
    let result = strand::guarded(|| catch_unwind(AssertUnwindSafe(|| work(user))));
    match connection(user).damage() {
        Some(damage) => Err(damage.into()),
        None => result.unwrap_or_else(|panic| resume_unwind(panic)),
    }
}

fn serve(instance: &str, jobs: &Receiver<Job>) {
    let mut connection: Option<Connection> = None;
    for job in jobs {
        let opened = match connection.take() {
            Some(open) => Ok(open),
            None => strand::guarded(|| Connection::open(instance)).map_err(Problem::from),
        };
        match opened {
            Ok(mut open) => match job(Ok(&mut open)) {
                true => connection = Some(open),
                false => strand::guarded(|| open.close()),
            },
            Err(problem) => drop(job(Err(problem))),
        }
    }
    if let Some(open) = connection {
        strand::guarded(|| open.close());
    }
}
