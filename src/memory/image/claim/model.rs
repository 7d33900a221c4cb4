//! Tests every order in which the atomic file system steps of emulators that start and end, and of clients that check,
//! can happen.

use super::{ImageCreator, ImageName, LockableFile, enter, remove_dead};
use loom::sync::{Arc, Mutex, MutexGuard};
use loom::thread;

/// Behaviour of the modelled file system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum System {
    /// The model behaves like Linux.
    Right,
    /// Fault: a process does not detect that the name now belongs to another file.
    NamesStay,
    /// Fault: giving the name to a file replaces the file that has it.
    NamesReplace,
    /// Fault: a lock excludes no other process.
    LocksAreOpen,
}

#[derive(Default)]
struct World {
    /// The file that has the name.
    named: Option<usize>,
    /// For each file, true if it is locked.
    locked: Vec<bool>,
    /// The file that a running emulator serves.
    served: Option<usize>,
}

impl World {
    fn new_file(&mut self) -> usize {
        self.locked.push(false);
        self.locked.len() - 1
    }
}

/// A process that accesses the image.
struct Visitor {
    world: Arc<Mutex<World>>,
    system: System,
    /// Number of attempts after which the model assumes that the holder of a lock is alive.
    patience: core::cell::Cell<u32>,
}

struct File {
    world: Arc<Mutex<World>>,
    system: System,
    number: usize,
    is_ours: core::cell::Cell<bool>,
}

/// Error: the holder of a lock is alive.
#[derive(Debug, PartialEq, Eq)]
struct Running;

impl File {
    fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap()
    }
}

impl LockableFile for File {
    type Error = Running;

    fn lock(&self) -> Result<bool, Running> {
        let mut world = self.world();
        let is_free = !world.locked[self.number];
        world.locked[self.number] = true;
        self.is_ours.set(is_free);
        Ok(is_free || self.system == System::LocksAreOpen)
    }

    fn is_named(&self) -> Result<bool, Running> {
        Ok(self.world().named == Some(self.number) || self.system == System::NamesStay)
    }

    fn remove_name(&self) -> Result<(), Running> {
        self.world().named = None;
        Ok(())
    }
}

impl Drop for File {
    fn drop(&mut self) {
        if self.is_ours.get() && !std::thread::panicking() {
            self.world().locked[self.number] = false;
        }
    }
}

impl ImageName for Visitor {
    type File = File;
    type Error = Running;

    fn find(&self) -> Result<Option<File>, Running> {
        let named = self.world.lock().unwrap().named;
        Ok(named.map(|number| self.file(number)))
    }

    fn judge(&self, _: &File) -> Result<(), Running> {
        Ok(())
    }

    fn wait(&self, file: File) -> Result<(), Running> {
        drop(file);
        self.patience.set(self.patience.get().checked_sub(1).ok_or(Running)?);
        thread::yield_now();
        Ok(())
    }
}

impl ImageCreator for Visitor {
    type Image = File;

    fn nameless(&self) -> Result<File, Running> {
        let number = self.world.lock().unwrap().new_file();
        Ok(self.file(number))
    }

    fn fill(&self, file: File) -> Result<File, Running> {
        Ok(file)
    }

    fn name(&self, image: &File) -> Result<bool, Running> {
        let mut world = self.world.lock().unwrap();
        let may = world.named.is_none() || self.system == System::NamesReplace;
        if may {
            world.named = Some(image.number);
        }
        Ok(may)
    }

    fn fits(&self, file: &File) -> Result<bool, Running> {
        // In some tests, the first file has a shape that a new emulator cannot serve.
        Ok(file.number != UNFIT)
    }

    fn take_over(&self, file: File) -> Result<File, Running> {
        Ok(file)
    }
}

const UNFIT: usize = 0;
const FIT: usize = 1;

impl Visitor {
    fn file(&self, number: usize) -> File {
        File { world: Arc::clone(&self.world), system: self.system, number, is_ours: false.into() }
    }

    /// Behaves like an emulator: starts, serves the image and ends. Returns true if it got the image.
    fn starts(&self) -> bool {
        let Ok(image) = enter(self) else { return false };
        self.serves(&image);
        self.ends(image);
        true
    }

    fn serves(&self, image: &File) {
        let before = self.world.lock().unwrap().served.replace(image.number);
        assert_eq!(before, None, "two emulators serve one image");
    }

    fn ends(&self, image: File) {
        let mut world = self.world.lock().unwrap();
        assert_eq!(world.named, Some(image.number), "an emulator serves an image that cannot be found");
        assert_eq!(world.served.take(), Some(image.number));
        drop(world);
        image.unlink().unwrap();
    }

    /// Behaves like a client that checks whether the file is locked.
    fn looks(&self) {
        if let Some(file) = self.find().unwrap() {
            let _ = file.lock();
        }
    }
}

/// Checks all interleavings with few preemptions. One or two preemptions are enough to show the faults that the tests
/// put into the model.
fn model(system: System, left: Option<usize>, go: impl Fn(&dyn Fn(u32) -> Visitor) + Sync + Send + 'static) {
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = Some(2);
    builder.check(move || {
        let mut world = World::default();
        assert_eq!([world.new_file(), world.new_file()], [UNFIT, FIT]);
        world.named = left;
        let world = Arc::new(Mutex::new(world));
        go(&|patience| Visitor { world: Arc::clone(&world), system, patience: patience.into() });
        let world = world.lock().unwrap();
        assert_eq!((world.named, world.served), (None, None), "nothing stays");
    });
}

/// Two emulators start, with or without the file of a killed one.
fn two_start(system: System, left: Option<usize>) {
    model(system, left, |visitor| {
        let (one, other) = (visitor(2), visitor(2));
        let one = thread::spawn(move || one.starts());
        let other = other.starts();
        assert!(one.join().unwrap() || other, "one of them is let in");
    });
}

/// One emulator ends while others start.
fn two_start_while_one_ends(system: System) {
    model(system, Some(FIT), |visitor| {
        let old = visitor(0);
        let image = enter(&old).unwrap();
        old.serves(&image);
        let (one, other) = (visitor(1), visitor(1));
        let one = thread::spawn(move || one.starts());
        let other = thread::spawn(move || other.starts());
        old.ends(image);
        one.join().unwrap();
        other.join().unwrap();
    });
}

#[test]
fn two_starting_emulators_never_serve_together() {
    for left in [None, Some(UNFIT), Some(FIT)] {
        two_start(System::Right, left);
    }
}

#[test]
fn an_emulator_that_starts_while_one_ends_has_a_visible_image() {
    two_start_while_one_ends(System::Right);
}

#[test]
fn removing_remains_spares_a_starting_emulator() {
    model(System::Right, Some(FIT), |visitor| {
        let (cleaner, starter) = (visitor(2), visitor(2));
        let cleaner = thread::spawn(move || remove_dead(&cleaner));
        assert!(starter.starts());
        let _ = cleaner.join().unwrap();
        // Neither process has left a file, so there is nothing to remove.
        assert_eq!(remove_dead(&visitor(0)), Ok(false));
    });
}

#[test]
fn a_checking_client_blocks_no_emulator() {
    model(System::Right, Some(FIT), |visitor| {
        let (client, starter) = (visitor(0), visitor(1));
        let client = thread::spawn(move || client.looks());
        assert!(starter.starts());
        client.join().unwrap();
    });
}

#[test]
#[should_panic(expected = "that cannot be found")]
fn the_model_detects_a_takeover_of_a_removed_file() {
    two_start_while_one_ends(System::NamesStay);
}

#[test]
#[should_panic(expected = "assertion")]
fn the_model_detects_a_stolen_name() {
    two_start(System::NamesReplace, None);
}

#[test]
#[should_panic(expected = "assertion")]
fn the_model_detects_a_lock_that_excludes_no_process() {
    two_start(System::LocksAreOpen, Some(FIT));
}
