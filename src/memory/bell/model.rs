//! Checks every interleaving of the handshake, with the memory orders of [`super::Bell`].
//!
//! On x86 the hardware usually hides a missing order, so tests with real threads are not enough.

use super::{Line, ring, wait_once};
use loom::sync::{
    Arc, Condvar, Mutex,
    atomic::{
        AtomicU32,
        Ordering::{AcqRel, Acquire, Relaxed, Release, SeqCst},
        fence,
    },
};

/// A bell with or without the fence.
struct Model<const FENCE: bool> {
    word: AtomicU32,
    waiters: AtomicU32,
    /// The kernel's lock around comparing the word and starting to sleep.
    kernel: Mutex<()>,
    asleep: Condvar,
}

impl<const FENCE: bool> Model<FENCE> {
    fn new() -> Self {
        let zero = || AtomicU32::new(0);
        Self { word: zero(), waiters: zero(), kernel: Mutex::new(()), asleep: Condvar::new() }
    }

    fn sleep(&self, seen: u32) {
        let kernel = self.kernel.lock().unwrap();
        if self.word.load(Relaxed) == seen {
            drop(self.asleep.wait(kernel).unwrap());
        }
    }
}

impl<const FENCE: bool> Line for Model<FENCE> {
    fn rings(&self) -> u32 {
        self.word.load(Acquire)
    }

    fn count_ring(&self) {
        self.word.fetch_add(1, AcqRel);
    }

    fn has_waiters(&self) -> bool {
        self.waiters.load(Acquire) != 0
    }

    fn enter(&self) {
        self.waiters.fetch_add(1, AcqRel);
    }

    fn leave(&self) {
        self.waiters.fetch_sub(1, AcqRel);
    }

    fn wake_all(&self) {
        drop(self.kernel.lock().unwrap());
        self.asleep.notify_all();
    }

    fn fence() {
        if FENCE {
            fence(SeqCst);
        }
    }
}

/// A client stores a register and rings; the firmware sleeps until it sees the register. A lost wake-up
/// is a deadlock, which loom reports.
fn client_and_firmware<const FENCE: bool>() {
    loom::model(|| {
        let bell = Arc::new(Model::<FENCE>::new());
        let register = Arc::new(AtomicU32::new(0));
        let client = {
            let (bell, register) = (Arc::clone(&bell), Arc::clone(&register));
            loom::thread::spawn(move || {
                register.store(5, Release);
                ring(&*bell);
            })
        };
        loop {
            let seen = bell.rings();
            if register.load(Acquire) == 5 {
                break;
            }
            wait_once(&[(&*bell, seen)], || bell.sleep(seen));
        }
        client.join().unwrap();
        assert_eq!(bell.waiters.load(SeqCst), 0);
    });
}

#[test]
fn no_wake_up_is_lost() {
    client_and_firmware::<true>();
}

#[test]
#[should_panic(expected = "deadlock")]
fn the_model_detects_a_missing_fence() {
    client_and_firmware::<false>();
}
