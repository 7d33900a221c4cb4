//! Tests every order in which the atomic file system steps of an ending owner, the next owner, and leaving
//! clients can happen.

use super::{ChannelRoot, ChannelSite, close, leave, own};
use core::convert::Infallible;
use loom::sync::{Arc, Mutex, MutexGuard};
use loom::thread;

/// Behaviour of the modelled file system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum System {
    /// The model behaves like Linux.
    Right,
    /// Fault: a lock excludes no other process.
    LocksAreOpen,
    /// Fault: a sweep affects the directory that has the name, not the opened directory.
    SweepsGoByName,
    /// Fault: a leaving client does not search for a directory that was created again.
    DirectoriesStayRemoved,
    /// Fault: after a sweep, a client does not check whether another client has created files during the sweep.
    SweepsAreFinal,
}

/// Content of a directory in the model.
#[derive(Debug, Default)]
struct Content {
    /// True if the directory is locked.
    is_locked: bool,
    /// True if the instance's lock, a file in the directory, is held.
    is_owned: bool,
    /// Number of the owner that has announced itself.
    ready: Option<u32>,
    /// Numbers of the processes in the domain; `has_remains`: files of iceoryx2 exist.
    inside: Vec<u32>,
    has_remains: bool,
}

impl Content {
    fn is_empty(&self) -> bool {
        !self.is_owned && self.ready.is_none() && self.inside.is_empty() && !self.has_remains
    }
}

#[derive(Default)]
struct World {
    directories: Vec<Content>,
    /// The directory that has the name.
    named: Option<usize>,
}

impl World {
    /// Returns the directory that has the name; creates it if there is none.
    fn make(&mut self) -> usize {
        *self.named.get_or_insert_with(|| {
            self.directories.push(Content::default());
            self.directories.len() - 1
        })
    }

    /// An operation on a path affects the directory that has the name at the time of the operation.
    fn at_path(&mut self) -> Option<&mut Content> {
        self.named.and_then(|number| self.directories.get_mut(number))
    }

    fn remove_if_empty(&mut self, number: usize) {
        if self.named == Some(number) && self.directories[number].is_empty() {
            self.named = None;
        }
    }
}

/// A directory that a process has opened.
#[derive(Clone)]
struct Opened {
    world: Arc<Mutex<World>>,
    system: System,
    number: usize,
}

struct ModelLock(Opened, bool);

impl Opened {
    fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap()
    }

    fn content<R>(&self, look: impl FnOnce(&mut Content) -> R) -> R {
        self.content_of(self.number, look)
    }

    fn content_of<R>(&self, number: usize, look: impl FnOnce(&mut Content) -> R) -> R {
        look(&mut self.world().directories[number])
    }
}

impl Drop for ModelLock {
    fn drop(&mut self) {
        if self.1 && !std::thread::panicking() {
            self.0.content(|it| it.is_locked = false);
        }
    }
}

impl ChannelRoot for Opened {
    type Lock = ModelLock;

    fn try_lock(&self) -> Option<ModelLock> {
        let is_free = self.content(|it| !core::mem::replace(&mut it.is_locked, true));
        (is_free || self.system == System::LocksAreOpen).then(|| ModelLock(self.clone(), is_free))
    }

    fn is_named(&self) -> bool {
        self.world().named == Some(self.number)
    }
}

impl ChannelSite for Opened {
    type ChannelRoot = Self;

    fn root(&self) -> &Self {
        self
    }

    fn is_served(&self) -> bool {
        self.content(|it| it.ready.is_some())
    }

    fn in_use(&self) -> bool {
        // iceoryx2 works with paths.
        self.world().at_path().is_some_and(|it| !it.inside.is_empty())
    }

    fn has_files(&self) -> bool {
        self.system != System::SweepsAreFinal && self.world().at_path().is_some_and(|it| it.has_remains)
    }

    fn withdraw(&self) {
        self.content(|it| it.ready = None);
    }

    fn sweep(&self) {
        let mut world = self.world();
        let by_name = world.named.filter(|_| self.system == System::SweepsGoByName);
        let content = &mut world.directories[by_name.unwrap_or(self.number)];
        content.inside.clear();
        content.has_remains = false;
    }

    fn remove_root(&self) {
        self.world().remove_if_empty(self.number);
    }

    fn made_again(&self) -> Option<Self> {
        let named = self.world().named?;
        if named == self.number || self.system == System::DirectoriesStayRemoved {
            return None;
        }
        let is_without_owner = self.content_of(named, |it| !it.is_owned && it.ready.is_none());
        is_without_owner.then(|| Self { number: named, ..self.clone() })
    }
}

/// The modelled file system, at the site that all processes use.
#[derive(Clone)]
struct Site {
    world: Arc<Mutex<World>>,
    system: System,
}

impl Site {
    fn open(&self, number: usize) -> Opened {
        Opened { world: Arc::clone(&self.world), system: self.system, number }
    }

    /// Behaves like `Server::open`: takes the lock of the instance, so that there is only one owner, and starts to
    /// serve the channel.
    fn opens(&self, owner: u32) -> Opened {
        loop {
            let mut world = self.world.lock().unwrap();
            let number = world.make();
            if !core::mem::replace(&mut world.directories[number].is_owned, true) {
                break;
            }
            drop(world);
            thread::yield_now();
        }
        let create = || Ok::<_, Infallible>(self.open(self.world.lock().unwrap().make()));
        let wait = || {
            thread::yield_now();
            Ok(())
        };
        let (root, _held) = own(create, wait).unwrap_or_else(|never| match never {});
        root.withdraw();
        if !root.in_use() {
            root.sweep();
        }
        root.content(|it| {
            it.inside.push(owner);
            it.has_remains = true;
        });
        root.content(|it| it.ready = Some(owner));
        root
    }

    /// Behaves like `client::ports`: a client enters and checks that the owner of the domain has not ended.
    fn enters(&self, client: u32, owner: u32) -> Option<Opened> {
        let number = self.world.lock().unwrap().named?;
        let place = self.open(number);
        if place.content(|it| it.ready) != Some(owner) {
            return None;
        }
        // iceoryx2 works with paths. It creates the directory if it is missing, then directories in it, then the files
        // of the client. A step fails if the result of an earlier step has been removed.
        self.world.lock().unwrap().make();
        let makes = || self.world.lock().unwrap().at_path().map(|it| it.has_remains = true).is_some();
        let goes_in = || {
            let mut world = self.world.lock().unwrap();
            world.at_path().filter(|it| it.has_remains).map(|it| it.inside.push(client)).is_some()
        };
        if !(makes() && goes_in()) {
            leaves(&place, client);
            return None;
        }
        if place.content(|it| it.ready) == Some(owner) {
            return Some(place);
        }
        leaves(&place, client);
        None
    }
}

/// Behaves like a client that ends.
fn leaves(place: &Opened, client: u32) {
    for content in &mut place.world().directories {
        content.inside.retain(|other| *other != client);
    }
    leave(place);
}

/// Behaves like an emulator that ends normally.
fn ends(place: &Opened, owner: u32) {
    place.withdraw();
    place.content(|it| it.inside.retain(|other| *other != owner));
    close(place, || {});
    let mut world = place.world();
    world.directories[place.number].is_owned = false;
    world.remove_if_empty(place.number);
}

/// A client finds an owner that has announced itself, with all its files.
fn serves(place: &Opened, owner: u32) {
    let world = place.world();
    assert_eq!(world.named, Some(place.number), "the owner cannot be found");
    let content = &world.directories[place.number];
    assert!(content.inside.contains(&owner) && content.has_remains, "the owner was swept away: {content:?}");
    assert_eq!(content.ready, Some(owner));
}

const FIRST: u32 = 1;
const SECOND: u32 = 2;
const CLIENT: u32 = 10;

/// Checks all interleavings with few preemptions; no run leaves files.
fn model(system: System, go: impl Fn(&Site) + Sync + Send + 'static) {
    model_with(2, system, go);
}

fn model_with(preemptions: usize, system: System, go: impl Fn(&Site) + Sync + Send + 'static) {
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = Some(preemptions);
    builder.check(move || {
        let site = Site { world: Arc::default(), system };
        go(&site);
        let world = site.world.lock().unwrap();
        assert_eq!(world.named, None, "something stays: {:?}", world.directories);
    });
}

/// An owner ends or is killed, a client leaves at any time, and the next owner enters.
fn one_after_the_other(system: System, is_killed: bool) {
    model(system, move |site| {
        let first = site.opens(FIRST);
        let client = site.enters(CLIENT, FIRST).unwrap();
        let leaving = thread::spawn(move || leaves(&client, CLIENT));
        if is_killed {
            // A killed process loses its announcement, which is valid only while the process runs, its place in the
            // domain, and its locks.
            first.content(|it| {
                it.ready = None;
                it.inside.retain(|other| *other != FIRST);
                it.is_owned = false;
            });
        } else {
            ends(&first, FIRST);
        }
        let second = site.opens(SECOND);
        serves(&second, SECOND);
        let is_in = site.enters(CLIENT + 1, SECOND).expect("the owner is ready");
        leaving.join().unwrap();
        serves(&second, SECOND);
        assert!(second.content(|it| it.inside.contains(&(CLIENT + 1))), "a client was swept away");
        ends(&second, SECOND);
        leaves(&is_in, CLIENT + 1);
    });
}

#[test]
fn a_late_client_does_not_sweep_the_next_owner() {
    one_after_the_other(System::Right, false);
    one_after_the_other(System::Right, true);
}

/// The last process removes everything, even if several leave at the same time.
#[test]
fn no_files_remain_when_all_leave_together() {
    model(System::Right, |site| {
        let owner = site.opens(FIRST);
        let clients = [CLIENT, CLIENT + 1].map(|client| (site.enters(client, FIRST).unwrap(), client));
        let leaving = clients.map(|(place, client)| thread::spawn(move || leaves(&place, client)));
        ends(&owner, FIRST);
        leaving.into_iter().for_each(|thread| thread.join().unwrap());
    });
}

/// A client that enters while the owner ends either is in the domain until the owner's end, or gets an error.
fn one_enters_at_the_end(system: System) {
    model(system, |site| {
        let owner = site.opens(FIRST);
        let entering = {
            let site = site.clone();
            thread::spawn(move || {
                if let Some(place) = site.enters(CLIENT, FIRST) {
                    leaves(&place, CLIENT);
                }
            })
        };
        ends(&owner, FIRST);
        entering.join().unwrap();
    });
}

#[test]
fn a_client_that_enters_while_the_owner_ends_leaves_no_files() {
    one_enters_at_the_end(System::Right);
}

/// Two clients enter while the owner ends. Both can create the directory again, and each can find the directory locked
/// by the other.
fn two_enter_at_the_end(system: System) {
    model_with(4, system, |site| {
        let owner = site.opens(FIRST);
        let entering = [CLIENT, CLIENT + 1].map(|client| {
            let site = site.clone();
            thread::spawn(move || {
                if let Some(place) = site.enters(client, FIRST) {
                    leaves(&place, client);
                }
            })
        });
        ends(&owner, FIRST);
        entering.into_iter().for_each(|thread| thread.join().unwrap());
    });
}

#[test]
fn two_clients_that_enter_while_the_owner_ends_leave_no_files() {
    two_enter_at_the_end(System::Right);
}

#[test]
#[should_panic(expected = "something stays")]
fn the_model_detects_a_client_that_sweeps_only_once() {
    two_enter_at_the_end(System::SweepsAreFinal);
}

#[test]
#[should_panic(expected = "something stays")]
fn the_model_detects_a_directory_that_a_client_has_made_again() {
    one_enters_at_the_end(System::DirectoriesStayRemoved);
}

#[test]
#[should_panic(expected = "swept away")]
fn the_model_detects_a_lock_that_excludes_no_process() {
    one_after_the_other(System::LocksAreOpen, true);
}

#[test]
#[should_panic(expected = "swept away")]
fn the_model_detects_a_sweep_by_name() {
    one_after_the_other(System::SweepsGoByName, false);
}
