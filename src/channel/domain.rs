//! The iceoryx2 domain of an instance: the location of its files, the settings of its service, and the removal of files
//! of killed runs.
//!
//! All files of an instance are in its root directory, which only its user can enter. The names of its POSIX shared
//! memory objects begin with a prefix, which is stored in that directory. Half of the prefix is random, so no other
//! program can create such an object first.
//!
//! iceoryx2 removes most files of a killed process, but not all of them. If an emulator is killed while it creates the
//! service, the remaining files can block the service permanently. A counter of 16 bytes for each prefix always
//! remains. So the owner of the instance sweeps the domain: it removes all files before its start, if no living process
//! uses the domain, and after its end. If a client enters while the emulator ends, or the emulator is killed, the client
//! sweeps the domain when it leaves ([`Guest`](super::guest::Guest)).

use super::inherited;
use super::limit::{self, LimitError};
use super::passage::{self, ChannelRoot, ChannelSite};
use super::shm::{self, settles};
use super::wire::{Block, WireOp};
use crate::memory::MemoryError;
use crate::memory::names::CHANNEL_PREFIX;
use crate::memory::private::PrivateDir;
use crate::memory::private::for_channel::DirectoryLock;
use crate::memory::process::ProcessId;
use crate::memory::room;
use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::node::{NodeCreationFailure, NodeView};
use iceoryx2::prelude::*;
use iceoryx2::service::builder::request_response::Builder;
use std::io;
use std::path::{Path as FsPath, PathBuf};
use std::sync::{Arc, Once};
use std::time::{Duration, Instant};

/// Variant of iceoryx2 for the server.
pub(super) type Ipc = ipc::Service;
/// Variant of iceoryx2 for clients, with objects that may move to another thread: one thread enters the
/// domain, and another thread uses it.
pub(super) type Threads = ipc_threadsafe::Service;
pub(super) type ServiceBuilder<S> = Builder<[WireOp], (), [Block], (), S>;
pub(super) type Service<S> =
    iceoryx2::service::port_factory::request_response::PortFactory<S, [WireOp], (), [Block], ()>;

/// Clients that can be connected at the same time.
pub(crate) const MAX_CLIENTS: usize = 32;
/// Maximum number of nodes: those of the clients and the server, and some nodes of dead processes that were not removed
/// yet.
pub(super) const MAX_NODES: usize = MAX_CLIENTS + 8;
/// Longest root directory in bytes: the paths of iceoryx2 below it are limited to 255 bytes.
pub(super) const MAX_ROOT: usize = 120;
/// Name of the service.
const SERVICE: &str = "commram.channel";
/// File that exists while a server is ready. It contains the process id of the server.
const READY: &str = "ready";
/// Contains the prefix of the domain's shared memory.
const PREFIX: &str = "prefix";
/// Directories that iceoryx2 creates in the root.
const DIRECTORIES: [&str; 2] = ["nodes", "services"];
/// Longest time for which an owner that starts waits for clients that are leaving.
const MOVE_IN: Duration = Duration::from_secs(2);

/// The reason why a domain's directory cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RootError {
    /// The directory cannot be created or found.
    #[error("channel directory {}: {source}{}", .path.display(), room::named(.path, .source))]
    Io {
        /// Directory of the channels that cannot be used.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The directory is accessible to other users.
    #[error(transparent)]
    Private(#[from] MemoryError),
    /// The path is too long for iceoryx2, or not UTF-8.
    #[error("channel directory {}: the path must be UTF-8 of at most {MAX_ROOT} bytes; choose a shorter one", .path.display())]
    Unusable {
        /// Path of the directory, too long or not UTF-8.
        path: PathBuf,
    },
    /// A leaving client hangs.
    #[error("channel directory {}: a client that is leaving has it locked and is stopped; end it", .path.display())]
    Held {
        /// Directory of the channels that a client has locked.
        path: PathBuf,
    },
}

/// The domain of one instance.
#[derive(Debug, Clone)]
pub(super) struct Domain {
    root: Arc<PrivateDir>,
    tag: String,
    prefix: String,
    config: Config,
    /// True if this process has chosen the prefix.
    is_new: bool,
}

impl Domain {
    /// Creates the domain of `instance` in `root`, for its owner. While the returned lock exists, leaving clients do
    /// not sweep.
    pub(crate) fn own(instance: &str, root: &FsPath) -> Result<(Self, DirectoryLock), RootError> {
        let start = Instant::now();
        let create = || Ok(Arc::new(PrivateDir::create(root)?));
        let wait = || {
            if start.elapsed() >= MOVE_IN {
                return Err(RootError::Held { path: root.to_owned() });
            }
            std::thread::sleep(Duration::from_millis(1));
            Ok(())
        };
        let (directory, held) = passage::own(create, wait)?;
        let tag = tag(instance, &canonical(root)?);
        let (prefix, is_new) = match prefix(&directory, &tag) {
            Some(prefix) => (prefix, false),
            None => {
                // The directory of a killed run may be missing, so the objects of that run are found by the
                // beginning of their names.
                shm::remove(&tag);
                (new_prefix(&directory, &tag).map_err(|source| io_error(root, source))?, true)
            }
        };
        Ok((Self { is_new, ..Self::new(directory, tag, prefix)? }, held))
    }

    /// Returns the domain of `instance` in `root`; `None` if there is none.
    pub(crate) fn find(instance: &str, root: &FsPath) -> Result<Option<Self>, RootError> {
        let Some(directory) = PrivateDir::open(root)? else { return Ok(None) };
        let tag = tag(instance, &canonical(root)?);
        let Some(prefix) = prefix(&directory, &tag) else { return Ok(None) };
        Self::new(Arc::new(directory), tag, prefix).map(Some)
    }

    fn new(root: Arc<PrivateDir>, tag: String, prefix: String) -> Result<Self, RootError> {
        quiet();
        let path = canonical(root.path())?;
        let unusable = || RootError::Unusable { path: path.clone() };
        let bytes = path.as_os_str().as_encoded_bytes();
        let mut config = Config::default();
        config.global.set_root_path(&Path::new(bytes).map_err(|_| unusable())?);
        config.global.prefix = FileName::new(prefix.as_bytes()).map_err(|_| unusable())?;
        // The server removes files of dead processes. A client that only reads a value should not spend time on this.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(Self { root, tag, prefix, config, is_new: false })
    }

    /// True if this process has chosen the prefix, so that no other process uses objects of the domain.
    pub(crate) fn is_new(&self) -> bool {
        self.is_new
    }

    /// Gives the domain a new prefix. Only for the owner: clients that are still connected lose their connection.
    pub(crate) fn renew(self) -> Result<Self, RootError> {
        self.sweep();
        let prefix =
            new_prefix(&self.root, &self.tag).map_err(|source| io_error(self.root.path(), source))?;
        Ok(Self { is_new: true, ..Self::new(self.root, self.tag, prefix)? })
    }

    /// Creates a separate node for one side of the channel.
    pub(crate) fn node<S: iceoryx2::service::Service>(&self) -> Result<Node<S>, NodeCreationFailure> {
        NodeBuilder::new()
            .config(&self.config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<S>()
    }

    /// Settings of the domain's service. Each client may have one request in progress. A client that has given up does
    /// not block the next: its request is overwritten or skipped.
    pub(crate) fn service<S: iceoryx2::service::Service>(node: &Node<S>) -> Option<ServiceBuilder<S>> {
        let name = ServiceName::new(SERVICE).ok()?;
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

    /// Describes the format of the domain's service: the version in its type names, and the version of iceoryx2.
    pub(crate) fn format(&self) -> String {
        let details = || {
            let name = ServiceName::new(SERVICE).ok()?;
            <Ipc as iceoryx2::service::Service>::details(
                &name,
                &self.config,
                MessagingPattern::RequestResponse,
            )
            .ok()?
        };
        let Some(details) = details() else { return "another format".to_owned() };
        let details = details.static_details;
        let name = details.request_response().request_message_type_details().payload.type_name().to_string();
        let format = match name.rsplit_once(".v") {
            Some((_, version)) => format!("format {version}"),
            None => format!("requests of type {name}"),
        };
        format!("{format} of iceoryx2 {}", details.iceoryx2_version())
    }

    /// Creates the owner's node. iceoryx2 makes one file accessible to every user: the counter of the nodes
    /// with this prefix. This function replaces the file by a private copy before any client uses it. The node has
    /// already got its number from the counter, and does not use the file any more.
    pub(crate) fn owners_node(&self) -> Result<Node<Ipc>, NodeCreationFailure> {
        let node = self.node()?;
        shm::make_private(&self.prefix).map_err(|reason| {
            tracing::debug!(?reason, "the node counter cannot be made private");
            NodeCreationFailure::InsufficientPermissions
        })?;
        Ok(node)
    }

    /// Announces that the server, which is this process, is ready. Clients enter the domain only after the
    /// announcement, so a sweep before it cannot affect them.
    pub(crate) fn announce(&self) -> Result<(), RootError> {
        let published = self.root.publish(READY, &format!("{}\n", ProcessId::own()));
        published.map_err(|source| io_error(self.root.path(), source))
    }

    /// True if the server with process id `pid` has announced itself and has not withdrawn the announcement. The
    /// announcement of a killed server has another id.
    pub(crate) fn is_announced(&self, pid: u32) -> bool {
        self.announced().is_some_and(|process| process.pid == pid)
    }

    fn announced(&self) -> Option<ProcessId> {
        ProcessId::parse(&self.root.read(READY)?)
    }

    /// Keeps the open files of the domain from programs that this process starts. Call this after iceoryx2 has opened
    /// files.
    pub(crate) fn keep_from_programs(&self) {
        if let Ok(root) = canonical(self.root.path()) {
            inherited::keep_from_programs(&root, &self.prefix);
        }
    }

    /// Removes the files of dead processes. Other processes may use the domain at the same time.
    pub(crate) fn clean_up_after_the_dead<S: iceoryx2::service::Service>(&self, node: &Node<S>) {
        self.remove_half_made();
        node.try_cleanup_dead_nodes();
    }

    /// Removes shared memory objects without content, which would block other processes.
    pub(crate) fn remove_half_made(&self) {
        for path in self.half_made() {
            let _ = std::fs::remove_file(path);
        }
    }

    /// True if another program has shortened a part of the domain that this process has mapped.
    #[cfg(feature = "web")]
    pub(super) fn is_shortened(&self) -> bool {
        shm::is_shortened(&self.prefix)
    }

    /// Returns the shared memory objects of the domain with their lengths in bytes.
    pub(crate) fn lengths(&self) -> Vec<(PathBuf, u64)> {
        shm::lengths(&self.prefix)
    }

    /// Returns shared memory objects that stay without content, and so prevent clients from entering the
    /// domain. First removes such objects that no process uses, because their process was killed while it
    /// created them. The returned objects are damaged, or a slow process uses them.
    pub(crate) fn half_made(&self) -> Vec<PathBuf> {
        let (used, left): (Vec<_>, Vec<_>) =
            shm::half_made(&self.prefix).into_iter().partition(|path| shm::is_in_use(path));
        for path in left {
            let _ = std::fs::remove_file(path);
        }
        used
    }

    /// Returns the nodes of processes that have died without leaving. May never return if another program has damaged
    /// the channel.
    pub(crate) fn dead_nodes(&self) -> Vec<UniqueNodeId> {
        let mut dead = Vec::new();
        // An error is ignored: the next call finds the nodes that cannot be listed now.
        let _ = Node::<Ipc>::list(&self.config, |node| {
            if let NodeState::Dead(node) = &node {
                dead.push(*node.id());
            }
            CallbackProgression::Continue
        });
        dead
    }

    /// Removes the files and shared memory objects of dead nodes. May never return if another program has damaged the
    /// channel.
    pub(crate) fn remove_objects_of(&self, dead: &[UniqueNodeId]) {
        if dead.is_empty() {
            return;
        }
        // Errors are ignored: another process may remove the objects at the same time.
        let _ = Node::<Ipc>::list(&self.config, |node| {
            if let NodeState::Dead(node) = node
                && dead.contains(node.id())
            {
                let _ = node.try_remove_stale_resources();
            }
            CallbackProgression::Continue
        });
    }

    /// Removes all files of earlier runs, unless a living process still uses the domain.
    pub(crate) fn sweep_if_unused(&self) {
        if !self.in_use() {
            self.sweep();
        }
    }

    /// Called after the server has ended. Waits at most `patience` until no living process uses the domain, and removes
    /// everything.
    pub(crate) fn close(&self, patience: Duration) {
        passage::close(self, || {
            settles(patience, || !self.in_use());
        });
    }
}

impl ChannelRoot for Arc<PrivateDir> {
    type Lock = DirectoryLock;

    fn try_lock(&self) -> Option<DirectoryLock> {
        PrivateDir::try_lock(self)
    }

    fn is_named(&self) -> bool {
        PrivateDir::is_named(self)
    }
}

impl ChannelSite for Domain {
    type ChannelRoot = Arc<PrivateDir>;

    fn root(&self) -> &Arc<PrivateDir> {
        &self.root
    }

    fn is_served(&self) -> bool {
        self.announced().is_some_and(ProcessId::is_running)
    }

    fn withdraw(&self) {
        self.root.remove(READY);
    }

    /// True if a living process uses the domain. If iceoryx2 cannot list the nodes because of damage, the
    /// domain counts as unused. If the thread for the query cannot be started, the domain counts as used.
    fn in_use(&self) -> bool {
        if !self.root.path().join(DIRECTORIES[0]).exists() {
            return false;
        }
        let config = self.config.clone();
        let listed = limit::on_a_thread(limit::SHORT, move || has_living_node(&config));
        listed.unwrap_or_else(|why| matches!(why, LimitError::NoThread(_)))
    }

    fn has_files(&self) -> bool {
        DIRECTORIES.iter().any(|directory| self.root.path().join(directory).exists())
    }

    /// Removes all files of the domain. Clients that are still connected lose their connection. Works on the opened
    /// directory only, because its name may already belong to the directory of the next owner.
    fn sweep(&self) {
        for directory in DIRECTORIES {
            self.root.remove(directory);
        }
        shm::remove(&self.prefix);
        // The prefix is removed last: without it the other files cannot be found.
        self.root.remove(PREFIX);
    }

    fn remove_root(&self) {
        self.root.remove_if_empty();
    }

    /// A directory that already has a prefix belongs to another run.
    fn made_again(&self) -> Option<Self> {
        if self.root.is_named() {
            return None;
        }
        let root = Arc::new(PrivateDir::open(self.root.path()).ok()??);
        let is_without_owner = root.read(PREFIX).is_none();
        is_without_owner.then(|| Self { root, ..self.clone() })
    }
}

fn has_living_node(config: &Config) -> bool {
    let mut used = false;
    let listed = Node::<Ipc>::list(config, |node| match node {
        NodeState::Alive(_) | NodeState::Inaccessible(_) => {
            used = true;
            CallbackProgression::Stop
        }
        NodeState::Dead(_) | NodeState::Undefined(_) => CallbackProgression::Continue,
    });
    used || listed.is_err()
}

fn io_error(path: &FsPath, source: io::Error) -> RootError {
    RootError::Io { path: path.to_owned(), source }
}

/// Returns the root path for iceoryx2.
fn canonical(root: &FsPath) -> Result<PathBuf, RootError> {
    let path = root.canonicalize().map_err(|source| io_error(root, source))?;
    let short = path.to_str().is_some_and(|text| text.len() <= MAX_ROOT);
    if short { Ok(path) } else { Err(RootError::Unusable { path }) }
}

/// Returns the beginning of all prefixes of an instance, by which the owner of an object can be recognized. `root` must
/// be a path without links.
pub(super) fn tag(instance: &str, root: &FsPath) -> String {
    let hash = fnv1a(&[&root.to_string_lossy(), instance]);
    format!("{CHANNEL_PREFIX}{:08x}", hash >> 32 ^ hash & 0xFFFF_FFFF)
}

/// Reads the prefix from the directory.
fn prefix(root: &PrivateDir, tag: &str) -> Option<String> {
    let text = root.read(PREFIX)?;
    let rest = text.trim_end().strip_prefix(tag)?.strip_suffix('_')?;
    (rest.len() == 8 && rest.bytes().all(|b| b.is_ascii_hexdigit())).then(|| format!("{tag}{rest}_"))
}

fn new_prefix(root: &PrivateDir, tag: &str) -> io::Result<String> {
    let prefix = format!("{tag}{}_", shm::random()?);
    root.publish(PREFIX, &format!("{prefix}\n"))?;
    Ok(prefix)
}

/// Prevents iceoryx2 from writing to the user's terminal, unless the environment variable `IOX2_LOG_LEVEL` is set.
fn quiet() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| set_log_level_from_env_or(LogLevel::Fatal));
}

/// Computes FNV-1a over the texts, each followed by a zero.
fn fnv1a(texts: &[&str]) -> u64 {
    let bytes = texts.iter().flat_map(|text| text.bytes().chain([0]));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::guest::Guest;
    use tempfile::TempDir;

    #[test]
    fn a_prefix_lasts_until_the_domain_is_swept_and_is_never_used_again() {
        let root = TempDir::new().unwrap();
        let own = || Domain::own("a", root.path()).unwrap().0;
        let first = own();
        assert_eq!(own().prefix, first.prefix);
        assert_eq!(Domain::find("a", root.path()).unwrap().unwrap().prefix, first.prefix);
        let second = own().renew().unwrap();
        assert_ne!(second.prefix, first.prefix);
        second.sweep();
        assert!(Domain::find("a", root.path()).unwrap().is_none());
    }

    /// Returns the path of a domain after the end of its owner, and the domain as a client has found it before this
    /// end.
    fn found_before_the_end() -> (TempDir, PathBuf, Domain) {
        let parent = TempDir::new().unwrap();
        let path = parent.path().join("iox.d");
        let (owner, held) = Domain::own("a", &path).unwrap();
        let client = Domain::find("a", &path).unwrap().unwrap();
        drop(held);
        owner.close(Duration::ZERO);
        (parent, path, client)
    }

    #[test]
    fn a_client_that_enters_while_the_owner_ends_leaves_no_directory() {
        let (_parent, path, client) = found_before_the_end();
        assert!(!path.exists());
        let client = Guest::enter(client).unwrap();
        assert!(path.exists(), "iceoryx2 makes the directory again");
        drop(client);
        assert!(!path.exists());
    }

    #[test]
    fn a_late_client_leaves_the_directory_of_the_next_owner_alone() {
        let (_parent, path, client) = found_before_the_end();
        let client = Guest::enter(client).unwrap();
        let (next, held) = Domain::own("a", &path).unwrap();
        drop(held);
        drop(client);
        assert_eq!(Domain::find("a", &path).unwrap().unwrap().prefix, next.prefix);
        next.close(Duration::ZERO);
        assert!(!path.exists());
    }

    #[test]
    fn remains_of_a_run_without_a_directory_are_removed() {
        let root = TempDir::new().unwrap();
        let path = root.path().join("iox.d");
        let (domain, held) = Domain::own("a", &path).unwrap();
        let object = FsPath::new(shm::SHM).join(format!("{}x.data", domain.prefix));
        std::fs::write(&object, "x").unwrap();
        drop(held);
        std::fs::remove_dir_all(&path).unwrap();
        let (again, _held) = Domain::own("a", &path).unwrap();
        let left = object.exists();
        let _ = std::fs::remove_file(&object);
        assert!(!left);
        assert_ne!(again.prefix, domain.prefix);
    }

    /// A client that leaves late has the old directory open.
    #[test]
    fn a_sweep_leaves_the_next_owners_directory_alone() {
        let root = TempDir::new().unwrap();
        let path = root.path().join("iox.d");
        let own = || {
            let (domain, held) = Domain::own("a", &path).unwrap();
            std::fs::create_dir(path.join(DIRECTORIES[0])).unwrap();
            std::fs::write(path.join(DIRECTORIES[0]).join("node"), "").unwrap();
            (domain, held)
        };
        let (old, _held) = own();
        std::fs::rename(&path, root.path().join("gone")).unwrap();
        let (next, _held) = own();
        old.sweep();
        assert!(!root.path().join("gone").join(DIRECTORIES[0]).exists());
        assert!(path.join(DIRECTORIES[0]).join("node").exists());
        next.sweep();
        assert!(!path.join(DIRECTORIES[0]).exists());
    }

    #[test]
    fn instances_and_roots_have_different_tags() {
        let roots = [(); 2].map(|()| TempDir::new().unwrap());
        let tag = |instance: &str, root: usize| tag(instance, roots[root].path());
        assert_ne!(tag("a", 0), tag("b", 0));
        assert_ne!(tag("a", 0), tag("a", 1));
        assert_eq!(tag("a", 0), tag("a", 0));
        // All prefixes have one length and one ending, so no prefix is the beginning of another prefix.
        assert_eq!(tag("a", 0).len(), tag("another", 1).len());
    }

    #[test]
    fn an_invalid_prefix_is_not_swept() {
        let root = TempDir::new().unwrap();
        let (domain, _held) = Domain::own("a", root.path()).unwrap();
        for text in ["", "_", "commram_", "commram_00000000_", &domain.tag, "../"] {
            domain.root.publish(PREFIX, text).unwrap();
            assert!(Domain::find("a", root.path()).unwrap().is_none(), "{text:?}");
        }
    }

    #[test]
    fn nothing_of_the_domain_is_open_to_others() {
        use crate::channel::guest::Guest;
        use std::os::unix::fs::MetadataExt;
        let root = TempDir::new().unwrap();
        let (domain, _held) = Domain::own("a", root.path()).unwrap();
        let node = domain.owners_node().unwrap();
        // The node uses no counter that other users may have open.
        let open = std::fs::read_dir("/proc/self/fd").unwrap().flatten();
        let open: Vec<_> = open.filter_map(|file| std::fs::read_link(file.path()).ok()).collect();
        let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
        let is_counter = |path: &str| path.contains(&domain.prefix) && path.contains("global_mgmt");
        assert!(!maps.lines().any(is_counter), "{maps}");
        assert!(!open.iter().any(|path| is_counter(&path.to_string_lossy())), "{open:?}");
        let client = Guest::enter(domain.clone()).unwrap();
        let objects: Vec<_> = shm::objects(&domain.prefix).collect();
        assert!(!objects.is_empty());
        for path in objects.iter().map(PathBuf::as_path).chain([root.path()]) {
            assert_eq!(path.metadata().unwrap().mode() & 0o077, 0, "{}", path.display());
        }
        drop((client, node));
        domain.sweep();
        assert_eq!(shm::objects(&domain.tag).count(), 0);
    }
}
