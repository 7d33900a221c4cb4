//! A server with a plant in a separate thread, and bells that work between processes.

use crate::channel::client::Patience;
use crate::channel::domain::{Domain, tag};
use crate::channel::shm;
use crate::channel::{Bells, Client, ClientError, Server, ServerError};
use crate::request::Host;
use crate::request::testing::TestHost;
use memmap2::MmapRaw;
use rustix::thread::futex;
use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use tempfile::TempDir;

/// Watchdog limit, longer than any test runs.
pub(crate) const LONG: Duration = Duration::from_secs(30);

/// Bells in a small file, in the same form as in the header page of an image.
pub(crate) struct FileBells {
    map: MmapRaw,
}

const DOORBELL: usize = 0;
const REPLIES: usize = 1;
const PID: usize = 2;

impl FileBells {
    pub(crate) fn open(path: &Path) -> Self {
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).unwrap();
        file.set_len(64).unwrap();
        Self { map: MmapRaw::map_raw(&file).unwrap() }
    }

    fn word(&self, index: usize) -> &AtomicU32 {
        assert!(index < 16);
        // SAFETY: the map is 64 bytes, page-aligned, lives as long as `self`, and is only used here.
        unsafe { &*self.map.as_mut_ptr().cast::<AtomicU32>().add(index) }
    }

    pub(crate) fn set_pid(&self, pid: u32) {
        self.word(PID).store(pid, Ordering::SeqCst);
    }

    pub(crate) fn doorbell_count(&self) -> u32 {
        self.word(DOORBELL).load(Ordering::SeqCst)
    }

    pub(crate) fn wait_doorbell(&self, seen: u32, timeout: Duration) {
        self.wait(DOORBELL, seen, timeout);
    }

    fn ring(&self, index: usize) {
        self.word(index).fetch_add(1, Ordering::SeqCst);
        futex::wake(self.word(index), futex::Flags::empty(), i32::MAX as u32).unwrap();
    }

    fn wait(&self, index: usize, seen: u32, timeout: Duration) {
        let timeout = timeout.try_into().ok();
        let _ = futex::wait(self.word(index), futex::Flags::empty(), seen, timeout.as_ref());
    }
}

impl Bells for FileBells {
    fn ring_doorbell(&self) {
        self.ring(DOORBELL);
    }

    fn reply_count(&self) -> u32 {
        self.word(REPLIES).load(Ordering::SeqCst)
    }

    fn wait_reply(&self, seen: u32, timeout: Duration) {
        self.wait(REPLIES, seen, timeout);
    }

    fn announce_reply(&self) {
        self.ring(REPLIES);
    }

    fn emulator_pid(&self) -> u32 {
        self.word(PID).load(Ordering::SeqCst)
    }

    fn emulator_alive(&self) -> bool {
        let pid = i32::try_from(self.emulator_pid()).unwrap();
        rustix::process::Pid::from_raw(pid).is_some_and(|pid| !is_gone(pid))
    }

    fn emulator_has_ended(&self) -> bool {
        false
    }
}

/// True if a process has ended; a zombie has.
pub(crate) fn is_gone(pid: rustix::process::Pid) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", pid.as_raw_nonzero())).unwrap_or_default();
    let state = stat.rsplit(") ").next().unwrap_or_default().chars().next();
    matches!(state, None | Some('Z' | 'X'))
}

/// The files of one instance.
pub(crate) struct InstanceFiles {
    /// Directory that is removed at the end; `None` in a child process.
    owned: Option<TempDir>,
    pub directory: PathBuf,
    pub instance: String,
}

impl InstanceFiles {
    pub(crate) fn new() -> Self {
        static COUNTER: AtomicU32 = AtomicU32::new(0);
        let number = COUNTER.fetch_add(1, Ordering::Relaxed);
        let instance = format!("test-{}-{number}", std::process::id());
        let owned = TempDir::new().unwrap();
        let directory = owned.path().to_owned();
        Self { owned: Some(owned), directory, instance }
    }

    /// Creates a rig in a child process, on the files of the parent.
    pub(crate) fn inherited(directory: PathBuf, instance: String) -> Self {
        Self { owned: None, directory, instance }
    }

    pub(crate) fn root(&self) -> PathBuf {
        self.directory.join("iox")
    }

    pub(crate) fn bells(&self) -> Arc<FileBells> {
        Arc::new(FileBells::open(&self.directory.join("bells")))
    }

    pub(crate) fn server(&self) -> Result<Server, ServerError> {
        let bells = self.bells();
        bells.set_pid(std::process::id());
        Server::open(&self.instance, &self.root(), Box::new(bells))
    }

    pub(crate) fn connect(&self, patience: Patience) -> Result<Client, ClientError> {
        Client::connect(&self.instance, &self.root(), Box::new(self.bells()), patience)
    }

    /// A client that waits for the server.
    pub(crate) fn client(&self) -> Client {
        self.connect(Patience { connect: LONG, reply: LONG, ..Patience::default() }).unwrap()
    }

    /// Returns the domain; creates its root directory.
    pub(crate) fn domain(&self) -> Domain {
        Domain::own(&self.instance, &self.root()).unwrap().0
    }

    /// Returns the beginning of the names of the instance's shared memory.
    fn tag(&self) -> String {
        // The tag is computed from the absolute path, which does not change when the root directory is
        // removed.
        let directory = self.directory.canonicalize().unwrap();
        tag(&self.instance, &directory.join("iox"))
    }

    /// Returns the shared memory of the instance.
    pub(crate) fn remains(&self) -> Vec<PathBuf> {
        shm::objects(&self.tag()).collect()
    }
}

impl Drop for InstanceFiles {
    /// Removes all files of a test from /dev/shm, even after a failure.
    fn drop(&mut self) {
        if self.owned.is_some() {
            shm::remove(&self.tag());
        }
    }
}

/// Runs the firmware thread until it has to stop.
pub(crate) fn serve(place: &InstanceFiles, mut host: TestHost) {
    let bells = place.bells();
    let mut server = place.server().unwrap();
    while !host.should_stop() {
        let seen = bells.doorbell_count();
        let answered = server.poll(&mut host);
        if !host.is_stepped {
            // The clock runs as fast as the loop, and stops while no request waits.
            if server.waiting() > 0 && !host.is_frozen {
                let next = host.next_event();
                host.run_to(next);
                continue;
            }
        }
        let is_time_passing = host.is_stepped && server.waiting() > 0;
        if answered == 0 && !is_time_passing {
            bells.wait_doorbell(seen, Duration::from_millis(50));
        }
    }
    server.close(&mut host);
}

/// A server in a separate thread; ended on drop.
pub(crate) struct Emulator {
    stop: Arc<AtomicBool>,
    bells: Arc<FileBells>,
    thread: Option<JoinHandle<()>>,
}

impl Emulator {
    pub(crate) fn start(place: &Arc<InstanceFiles>, stepped: bool) -> Self {
        Self::start_with(place, TestHost::new(stepped))
    }

    pub(crate) fn start_with(place: &Arc<InstanceFiles>, host: TestHost) -> Self {
        let stop = Arc::clone(&host.stop);
        let bells = place.bells();
        let place = Arc::clone(place);
        let thread = std::thread::spawn(move || serve(&place, host));
        Self { stop, bells, thread: Some(thread) }
    }

    /// Ends the emulator and waits for its end.
    pub(crate) fn end(mut self) {
        self.finish();
    }

    fn finish(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.bells.ring_doorbell();
        if let Some(thread) = self.thread.take() {
            let outcome = thread.join();
            assert!(outcome.is_ok() || std::thread::panicking(), "the server thread panicked");
        }
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        self.finish();
    }
}
