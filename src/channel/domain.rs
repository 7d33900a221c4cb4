//! The iceoryx2 domain of an instance: where its files lie, how its service is set up, and how remains of
//! killed runs are removed.
//!
//! Everything of one instance lies in its own root directory and, as POSIX shared memory, under a name
//! prefix made from that directory, so instances do not see each other. iceoryx2 removes most of what a
//! killed process leaves, but not all: a run killed while it creates the service can block it for good,
//! and a 16-byte counter per prefix always stays. So whoever owns the instance sweeps the domain before
//! the start and after the end, if nobody alive uses it; and a client that outlives the emulator does so
//! when it leaves ([`Guest`]).

use super::wire::{Block, WireOp};
use crate::memory::process;
use iceoryx2::node::NodeCreationFailure;
use iceoryx2::prelude::*;
use iceoryx2::service::builder::request_response::Builder;
use std::fs::File;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path as FsPath, PathBuf};
use std::sync::Once;
use std::time::{Duration, Instant};

pub(super) type Ipc = ipc::Service;
pub(super) type ServiceBuilder = Builder<[WireOp], (), [Block], (), Ipc>;
pub(super) type Service =
    iceoryx2::service::port_factory::request_response::PortFactory<Ipc, [WireOp], (), [Block], ()>;

/// Clients that can be connected at the same time.
pub const MAX_CLIENTS: usize = 32;
/// The clients' nodes, the server's, and some that died and are not yet cleaned up.
pub(super) const MAX_NODES: usize = MAX_CLIENTS + 8;
/// Longest root directory in bytes: what iceoryx2 puts below it must stay within its 255 bytes.
pub(super) const MAX_ROOT: usize = 120;
/// Where POSIX shared memory lies on Linux.
const SHM: &str = "/dev/shm";
/// Exists while a server is ready; holds its process id.
const READY: &str = "ready";
/// How long a shared memory object may have no content: far longer than a living process needs.
const HALF_MADE: Duration = Duration::from_millis(50);
/// The directories iceoryx2 makes in the root.
const DIRECTORIES: [&str; 2] = ["nodes", "services"];

/// Why a domain's directory cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RootError {
    /// The directory cannot be made or found.
    #[error("channel directory {}: {source}", .path.display())]
    Io {
        /// The directory.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The path is too long for iceoryx2, or not UTF-8.
    #[error("channel directory {}: the path must be UTF-8 of at most {MAX_ROOT} bytes; choose a shorter one", .path.display())]
    Unusable {
        /// The directory.
        path: PathBuf,
    },
}

/// The domain of one instance.
#[derive(Debug, Clone)]
pub(super) struct Domain {
    root: PathBuf,
    prefix: String,
    config: Config,
}

impl Domain {
    /// The domain of `instance` in `root`, which must exist.
    pub fn new(instance: &str, root: &FsPath) -> Result<Self, RootError> {
        quiet();
        let root = root.canonicalize().map_err(|source| RootError::Io { path: root.to_owned(), source })?;
        let unusable = || RootError::Unusable { path: root.clone() };
        let text = root.to_str().filter(|text| text.len() <= MAX_ROOT).ok_or_else(unusable)?;
        let prefix = format!("commram_{:016x}_", fnv1a(&[text, instance]));
        let mut config = Config::default();
        config.global.set_root_path(&Path::new(text.as_bytes()).map_err(|_| unusable())?);
        config.global.prefix = FileName::new(prefix.as_bytes()).map_err(|_| unusable())?;
        // The server cleans up after the dead; a client that only wants a value shall not spend its time
        // on it.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(Self { root, prefix, config })
    }

    /// A node of its own for one end of the channel.
    pub fn node(&self) -> Result<Node<Ipc>, NodeCreationFailure> {
        NodeBuilder::new()
            .config(&self.config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
    }

    /// The one service of the domain. One request per client may be under way, and a client that has given
    /// up does not block the next: its request is overwritten or skipped.
    pub fn service(node: &Node<Ipc>) -> Option<ServiceBuilder> {
        let name = ServiceName::new("commram.channel").ok()?;
        let builder = node
            .service_builder(&name)
            .request_response::<[WireOp], [Block]>()
            .max_servers(1)
            .max_clients(MAX_CLIENTS)
            .max_nodes(MAX_NODES)
            .max_active_requests_per_client(1)
            .max_loaned_requests(1)
            .max_response_buffer_size(1)
            .max_borrowed_responses_per_pending_response(1)
            .enable_safe_overflow_for_requests(true)
            .enable_safe_overflow_for_responses(true)
            .enable_fire_and_forget_requests(false);
        Some(builder)
    }

    /// Keeps those who leave from sweeping, as long as the value lives: for the owner while it moves in.
    pub fn hold(&self) -> io::Result<File> {
        loop {
            std::fs::create_dir_all(&self.root)?;
            let directory = File::open(&self.root)?;
            directory.lock()?;
            // Whoever held it may have removed it meanwhile.
            let is_there = |there: std::fs::Metadata| Ok(there.ino() == directory.metadata()?.ino());
            if std::fs::metadata(&self.root).and_then(is_there).unwrap_or(false) {
                return Ok(directory);
            }
        }
    }

    /// A client leaves. If the server has gone before, nobody else would remove what stays.
    fn leave(&self) {
        if self.is_served() {
            return;
        }
        let Ok(directory) = File::open(&self.root) else { return };
        if directory.try_lock().is_ok() && !self.is_served() && !self.in_use() {
            self.withdraw();
            self.sweep();
            self.remove_root();
        }
    }

    /// Whether a living process has announced itself.
    fn is_served(&self) -> bool {
        announced(&self.root).is_some_and(process::is_running)
    }

    /// Says that the server is ready. Clients stay away from the domain until then, so that they do not
    /// meet the sweep before it.
    pub fn announce(&self) -> io::Result<()> {
        std::fs::write(self.root.join(READY), format!("{}\n", std::process::id()))
    }

    /// Takes the announcement back.
    pub fn withdraw(&self) {
        let _ = std::fs::remove_file(self.root.join(READY));
    }

    /// Whether the server with process id `pid` has announced itself in `root` and not taken it back. An
    /// announcement that a killed server left has another id.
    pub fn is_announced(root: &FsPath, pid: u32) -> bool {
        announced(root) == Some(pid)
    }

    /// Removes all that remains of earlier runs, unless a living process still uses the domain after
    /// `patience`.
    pub fn sweep_if_unused(&self, patience: Duration) {
        if settles(patience, || !self.in_use()) {
            self.sweep();
        }
    }

    /// Removes what dead processes left, while others may use the domain.
    pub fn clean_up_after_the_dead(&self, node: &Node<Ipc>) {
        self.remove_half_made();
        node.try_cleanup_dead_nodes();
    }

    /// Removes shared memory objects without content. A process killed between creating one and giving it
    /// its size leaves such an object, and iceoryx2 0.10.0 waits for its size for ever, whatever the
    /// timeout (`dynamic_storage/posix_shared_memory.rs`, `MappingSizeIsZero`). A living process is
    /// through in microseconds.
    pub fn remove_half_made(&self) {
        let empty = || {
            shared_memory(&self.prefix)
                .filter(|path| path.metadata().is_ok_and(|data| data.len() == 0))
                .collect::<Vec<_>>()
        };
        let mut stale = empty();
        settles(HALF_MADE, || {
            let now = empty();
            stale.retain(|path| now.contains(path));
            stale.is_empty()
        });
        for path in stale {
            let _ = std::fs::remove_file(path);
        }
    }

    fn in_use(&self) -> bool {
        if !self.root.join(DIRECTORIES[0]).exists() {
            return false;
        }
        let mut used = false;
        let listed = Node::<Ipc>::list(&self.config, |node| match node {
            NodeState::Alive(_) | NodeState::Inaccessible(_) => {
                used = true;
                CallbackProgression::Stop
            }
            NodeState::Dead(_) | NodeState::Undefined(_) => CallbackProgression::Continue,
        });
        used || listed.is_err()
    }

    /// Removes everything of the domain. Only for the owner of the instance: whoever is still connected is
    /// cut off.
    pub fn sweep(&self) {
        for directory in DIRECTORIES {
            let _ = std::fs::remove_dir_all(self.root.join(directory));
        }
        for path in shared_memory(&self.prefix) {
            let _ = std::fs::remove_file(path);
        }
    }

    /// Removes the root directory if nothing is in it any more.
    pub fn remove_root(&self) {
        let _ = std::fs::remove_dir(&self.root);
    }

    /// The domain's shared memory objects.
    #[cfg(test)]
    pub fn remains(&self) -> Vec<PathBuf> {
        shared_memory(&self.prefix).collect()
    }
}

/// A client in a domain. Dropping it leaves.
pub(super) struct Guest {
    pub node: Node<Ipc>,
    // Behind the node, which must be gone by then.
    _leave: Leave,
}

impl Guest {
    /// Enters a domain.
    pub fn enter(domain: &Domain) -> Result<Self, NodeCreationFailure> {
        // Ahead of the node: an attempt that fails leaves things behind as well.
        let leave = Leave(Box::new(domain.clone()));
        Ok(Guest { node: domain.node()?, _leave: leave })
    }
}

struct Leave(Box<Domain>);

impl Drop for Leave {
    fn drop(&mut self) {
        self.0.leave();
    }
}

/// Which process has announced itself in `root`.
fn announced(root: &FsPath) -> Option<u32> {
    std::fs::read_to_string(root.join(READY)).ok()?.trim_end().parse().ok()
}

/// Whether it is so now or within `patience`.
fn settles(patience: Duration, mut is_so: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    loop {
        if is_so() {
            return true;
        }
        if start.elapsed() >= patience {
            return false;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The shared memory objects whose names begin with `prefix`.
fn shared_memory(prefix: &str) -> impl Iterator<Item = PathBuf> {
    let entries = std::fs::read_dir(SHM).into_iter().flatten().flatten();
    entries
        .filter(move |entry| entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()))
        .map(|entry| entry.path())
}

/// Keeps iceoryx2 from writing to the user's terminal, unless its variable `IOX2_LOG_LEVEL` asks for it.
fn quiet() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| set_log_level_from_env_or(LogLevel::Fatal));
}

/// FNV-1a over the texts, each with a zero behind it: the same in every build, which both ends need.
fn fnv1a(texts: &[&str]) -> u64 {
    let bytes = texts.iter().flat_map(|text| text.bytes().chain([0]));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_made_objects_are_removed_and_finished_ones_are_not() {
        let root = tempfile::TempDir::new().unwrap();
        let domain = Domain::new("half", root.path()).unwrap();
        let object = |name: &str| FsPath::new(SHM).join(format!("{}{name}", domain.prefix));
        std::fs::write(object("half"), "").unwrap();
        std::fs::write(object("done"), "x").unwrap();
        domain.remove_half_made();
        let left = domain.remains();
        domain.sweep();
        assert_eq!(left, [object("done")]);
        assert!(domain.remains().is_empty());
    }

    #[test]
    fn each_instance_and_each_root_has_a_prefix_of_its_own() {
        let roots = [(); 2].map(|()| tempfile::TempDir::new().unwrap());
        let prefix = |instance: &str, root: usize| Domain::new(instance, roots[root].path()).unwrap().prefix;
        assert_ne!(prefix("a", 0), prefix("b", 0));
        assert_ne!(prefix("a", 0), prefix("a", 1));
        assert_eq!(prefix("a", 0), prefix("a", 0));
        // No prefix is the beginning of another: all have the same length and end alike.
        assert_eq!(prefix("a", 0).len(), prefix("another", 1).len());
        assert!(prefix("a", 0).ends_with('_'));
    }
}
