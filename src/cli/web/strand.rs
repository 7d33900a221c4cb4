//! Panics in calls of iceoryx2 that do not end the server.
//!
//! Another program can shorten a part of the channel at any moment. iceoryx2 then reads zeros and may panic, and panic
//! again while the first panic unwinds: this would end the process, with the connections to all other instances. A
//! thread with a connection therefore stops for good at the first panic, before it unwinds. Its memory and its connection
//! stay until the server ends; its owner is notified and starts another thread when it needs one.

use std::cell::{Cell, RefCell};
use std::panic;
use std::sync::Once;
use std::thread;

/// What a thread that stops has to do.
type LastAct = Box<dyn Fn()>;

thread_local! {
    static IS_GUARDED: Cell<bool> = const { Cell::new(false) };
    static LAST_ACT: RefCell<Option<LastAct>> = const { RefCell::new(None) };
}

/// The thread of the library in which it connects and disconnects. Its callers wait with a limit.
const LIBRARY: &str = "channel";

/// Makes guarded threads stop at a panic, after the message about it. The first call of the process counts.
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

/// Defines the last act of this thread, if it stops at a panic.
pub(super) fn at_the_end(act: impl Fn() + 'static) {
    LAST_ACT.set(Some(Box::new(act)));
}

/// Does `work`; if it panics, this thread does its last act and stops.
pub(super) fn guarded<T>(work: impl FnOnce() -> T) -> T {
    /// Ends the guarded part, also if `work` unwinds in a process without the hook.
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

    /// As a connection of iceoryx2 does when its part of the channel is missing.
    struct PanicsAgain;

    impl Drop for PanicsAgain {
        fn drop(&mut self) {
            panic!("again");
        }
    }

    /// Name of the variable that is set in the process of the stopped thread.
    const CHILD: &str = "COMMRAM_TEST_STRAND";
    /// Exit code of that process.
    const STOPPED: i32 = 47;

    /// The thread stops within the panic hook, which it keeps from the test harness. Its test therefore runs in another
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

    /// Other panics unwind as usual.
    #[test]
    fn other_parts_of_a_thread_unwind() {
        stop_at_panics();
        assert_eq!(guarded(|| 7), 7);
        assert!(panic::catch_unwind(|| panic!("an expected panic of a test")).is_err());
    }
}
