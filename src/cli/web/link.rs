//! A connection to an emulator in a separate thread. Requests wait for their replies in this thread, because the server
//! must not block.

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
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{oneshot, watch};

/// Number of requests that may wait for the connection; further requests are refused.
const WAITING: usize = 64;

/// Minimum time between two checks whether another program has shortened the channel.
const CHECK: Duration = Duration::from_millis(20);

/// Time after which a thread without work checks whether the emulator has ended.
const IDLE: Duration = Duration::from_secs(2);

/// An open connection to an emulator.
pub(super) struct Connection {
    pub session: Session,
    /// Names of PLCs and buses.
    pub names: Names,
    /// Time of the last check whether another program has shortened the channel.
    checked: Cell<Instant>,
    is_damaged: Cell<bool>,
    // Declared after the session: dropping this field reports that the connection is closed.
    open: OpenConnections,
}

/// Counts an open connection of this process until it is dropped.
struct OpenConnections;

thread_local! {
    /// True if this thread has an open connection.
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

/// Waits at most `limit` until all connections are closed. A process that ends earlier does not disconnect from the
/// channels, and its files stay.
pub(super) fn wait_until_closed(limit: Duration) {
    let open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    drop(CLOSED.wait_timeout_while(open, limit, |open| *open > 0));
}

impl Connection {
    /// Connects to a running instance.
    ///
    /// # Errors
    /// The instance is not running, or its channel cannot be used.
    pub(super) fn open(instance: &str) -> Result<Self, CliError> {
        let session = Session::open(&Instance::running(instance), 0)?;
        let open = OpenConnections::enter();
        let names = session.info()?.names;
        Ok(Self { session, names, checked: Cell::new(Instant::now()), is_damaged: Cell::default(), open })
    }

    /// Returns the error if another program has shortened the channel: the connection has read zeros in place of the
    /// missing part, or would read them.
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

    /// Closes the connection. A connection through a damaged channel is abandoned instead: closing it could end this
    /// process, which serves other instances.
    pub(super) fn close(self) {
        if self.damage().is_some() || self.session.has_shortened_channel() {
            let Self { session, open, .. } = self;
            core::mem::forget(session);
            drop(open);
        }
    }
}

/// Returns the error for a damaged channel.
pub(super) fn broken(instance: &str) -> CliError {
    ClientError::Broken { instance: instance.to_owned() }.into()
}

/// Stops counting the connection of this thread, because the thread will never close it.
pub(super) fn abandon() {
    if HAS_CONNECTION.replace(false) {
        *OPEN.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
        CLOSED.notify_all();
    }
}

/// Work for the thread. Receives the connection, or the reason why there is none. Returns true if the connection can be
/// used again.
type Job = Box<dyn FnOnce(Result<&mut Connection, Problem>) -> bool + Send>;

/// A client that waits for the result of a job. Dropping this value means that the client has disconnected.
#[derive(Default)]
struct Waiter {
    has_gone: Arc<AtomicBool>,
}

impl Drop for Waiter {
    fn drop(&mut self) {
        self.has_gone.store(true, Ordering::Relaxed);
    }
}

/// Handle for the thread. The thread ends when its last handle is dropped.
#[derive(Clone)]
pub(super) struct Link {
    jobs: SyncSender<Job>,
    instance: Arc<str>,
    /// Becomes true if the thread stops because of a panic.
    has_stopped: watch::Receiver<bool>,
}

impl Link {
    /// Starts a thread. The thread connects when its first job arrives. If the emulator ends while the thread has no work,
    /// the thread closes the connection and calls `forget`.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub(super) fn start(instance: &str, forget: impl Fn() + Send + 'static) -> Result<Self, Problem> {
        let (sender, jobs) = mpsc::sync_channel(WAITING);
        let instance: Arc<str> = instance.into();
        let (stop, has_stopped) = watch::channel(false);
        let thread = std::thread::Builder::new().name("web-link".to_owned());
        let own = Arc::clone(&instance);
        let work = move || {
            strand::at_the_end(move || {
                abandon();
                // Sending fails if all handles have been dropped.
                let _ = stop.send(true);
            });
            serve(&own, &jobs, &forget);
        };
        thread.spawn(work).map_err(|reason| Problem::from(CliError::Process { reason }))?;
        Ok(Self { jobs: sender, instance, has_stopped })
    }

    /// Executes `work` in the thread. If the client closes its connection, the returned future is dropped, and the
    /// request to the emulator is cancelled.
    ///
    /// # Errors
    /// `work` fails, the emulator cannot be reached, or too many jobs wait.
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
            // Sending fails if the client has disconnected.
            let _ = answer.send(result);
            is_usable
        });
        let busy = || Problem::too_many("too many requests wait for the emulator");
        self.jobs.try_send(job).map_err(|_| busy())?;
        let mut has_stopped = self.has_stopped.clone();
        let stopped = async {
            // The sender of this value exists until the thread ends.
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

/// Executes `work` with a value that contains a connection. Fails if another program damages the channel before or
/// during the work: the data may then be wrong, and iceoryx2 can panic.
///
/// # Errors
/// `work` fails, or [`ClientError::Broken`].
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

fn serve(instance: &str, jobs: &Receiver<Job>, forget: &dyn Fn()) {
    let mut connection: Option<Connection> = None;
    loop {
        let next = jobs.recv_timeout(IDLE);
        // The names of the connection belong to its emulator; the next emulator of the instance may have others.
        let ended = connection.take_if(|open| !open.session.is_served());
        let has_ended = ended.is_some();
        if let Some(ended) = ended {
            strand::guarded(|| ended.close());
        }
        let job = match next {
            Ok(job) => job,
            Err(RecvTimeoutError::Timeout) if has_ended => {
                forget();
                continue;
            }
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => break,
        };
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
