//! Keeps a panic in iceoryx2 from ending the server.
//!
//! Another program can shorten a part of the channel at any moment. iceoryx2 then reads zeros and may panic. While this
//! panic unwinds, a destructor may panic again, which would end the process and the connections to all other instances.
//! Therefore a thread with a connection stops forever at its first panic, before the stack unwinds. The memory and the
//! connection of the thread stay until the server ends. The owner of the thread is notified, and starts another one when
//! needed.

use std::cell::{Cell, RefCell};
use std::panic;
use std::sync::Once;
use std::thread;

/// The last action of a thread that stops.
type LastAct = Box<dyn Fn()>;

thread_local! {
    static IS_GUARDED: Cell<bool> = const { Cell::new(false) };
    static LAST_ACT: RefCell<Option<LastAct>> = const { RefCell::new(None) };
}

/// Name of the thread in which the library connects and disconnects. Its callers wait with a time limit.
const LIBRARY: &str = "channel";

/// Installs a panic hook that stops guarded threads after the panic message. Further calls in the same process do
/// nothing.
pub(super) fn stop_at_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            before(info);
            if IS_GUARDED.get() || thread::current().name() == Some(LIBRARY) {
                if let Ok(Some(act)) = LAST_ACT.try_with(|act| act.try_borrow_mut().ok()?.take()) {
                    act();
                }
                loop {
                    thread::park();
                }
            }
        }));
    });
}

/// Sets the last action of this thread, for the case that the thread stops.
pub(super) fn at_the_end(act: impl Fn() + 'static) {
    LAST_ACT.set(Some(Box::new(act)));
}

/// Executes `work`. If it panics, this thread executes its last action and stops.
pub(super) fn guarded<T>(work: impl FnOnce() -> T) -> T {
    /// Ends the guarded part when it is dropped. This also happens if `work` unwinds, in a process without the hook.
    struct End(bool);
    impl Drop for End {
        fn drop(&mut self) {
            IS_GUARDED.set(self.0);
        }
    }
    let _end = End(IS_GUARDED.replace(true));
    work()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    /// Panics while it is dropped, like a connection of iceoryx2 to a channel with a missing part.
    struct PanicsAgain;

    impl Drop for PanicsAgain {
        fn drop(&mut self) {
            panic!("again");
        }
    }

    /// Environment variable that is set in the process in which the thread stops.
    const CHILD: &str = "COMMRAM_TEST_STRAND";
    /// Exit code of the child process in which the guarded thread has stopped.
    const STOPPED: i32 = 47;

    /// The thread stops inside the panic hook and blocks it for the test harness. Therefore the test runs in a separate
    /// process. Without the guard, the second panic ends that process.
    #[test]
    fn a_second_panic_during_the_first_one_ends_only_the_thread() {
        if std::env::var_os(CHILD).is_none() {
            let name = "cli::web::strand::tests::a_second_panic_during_the_first_one_ends_only_the_thread";
            let mut child = std::process::Command::new(std::env::current_exe().unwrap());
            let status = child.args(["--exact", name]).env(CHILD, "1").status().unwrap();
            assert_eq!(status.code(), Some(STOPPED), "{status}");
            return;
        }
        stop_at_panics();
        let (end, ended) = mpsc::channel();
        let thread = thread::spawn(move || {
            at_the_end(move || {
                let _ = end.send("the owner is notified");
            });
            guarded::<()>(|| {
                let _connection = PanicsAgain;
                panic!("the channel is missing");
            })
        });
        assert_eq!(ended.recv(), Ok("the owner is notified"));
        assert!(!thread.is_finished());
        std::process::exit(STOPPED);
    }

    /// A panic outside of the guarded part of a thread unwinds, as in a thread without a guard.
    #[test]
    fn other_parts_of_a_thread_unwind() {
        stop_at_panics();
        assert_eq!(guarded(|| 7), 7);
        assert!(panic::catch_unwind(|| panic!("an expected panic of a test")).is_err());
    }
}
