//! Explores every interleaving of tasks and an emulator, with the memory orders of [`super::Cell32`]. The tasks take a
//! seat, send a request and leave. The emulator answers requests, gives up tasks and frees seats. The model omits times
//! and bells; bells have a separate model.

use super::{NO_OWNER, SeatState, SeatWords, Word};
use loom::sync::Arc;
use loom::sync::atomic::AtomicU32;
use loom::sync::atomic::Ordering::{AcqRel, Acquire, Release};

/// A word with an exchange in one atomic step, or in two.
struct Model<const WHOLE: bool>(AtomicU32);

impl<const WHOLE: bool> Model<WHOLE> {
    fn store(&self, value: u32) {
        // The model exchanges the value, because loom does not order a plain store with concurrent exchanges.
        self.0.swap(value, Release);
    }
}

impl<const WHOLE: bool> Word for Model<WHOLE> {
    fn load(&self) -> u32 {
        self.0.load(Acquire)
    }

    fn exchange(&self, current: u32, new: u32) -> bool {
        if WHOLE {
            return self.0.compare_exchange(current, new, AcqRel, Acquire).is_ok();
        }
        let is_so = self.load() == current;
        if is_so {
            self.store(new);
        }
        is_so
    }
}

struct Seat<const WHOLE: bool> {
    owner: Model<WHOLE>,
    state: Model<WHOLE>,
    event: Model<WHOLE>,
    /// 1 if the first task has died.
    is_dead: AtomicU32,
}

const FIRST: u32 = 1;
const SECOND: u32 = 2;

impl<const WHOLE: bool> Seat<WHOLE> {
    fn new() -> Self {
        let zero = || Model(AtomicU32::new(0));
        Self { owner: zero(), state: zero(), event: zero(), is_dead: AtomicU32::new(0) }
    }

    fn hands(&self) -> SeatWords<'_, Model<WHOLE>> {
        SeatWords { owner: &self.owner, state: &self.state, event: &self.event }
    }

    /// Behaves like a task: takes the seat, which can have only one owner, and requests the event with its own number.
    fn ask(&self, task: u32) -> bool {
        let is_ours = self.owner.0.compare_exchange(0, task, AcqRel, Acquire).is_ok();
        if is_ours {
            self.event.store(task);
            self.state.store(SeatState::Asking.code());
        }
        is_ours
    }

    fn leave(&self) {
        self.state.store(SeatState::Free.code());
        self.owner.store(0);
    }

    fn free_if_dead(&self) {
        let is_running = |owner| owner != FIRST || self.is_dead.load(Acquire) == 0;
        // Behaves like the seat itself: frees the owner last.
        self.hands().free_if_dead(is_running, || {
            self.event.store(0);
            self.leave();
        });
    }
}

/// A task requests an event, leaves and dies, and the next task requests another event. In the meantime the emulator
/// answers requests, gives up a task and frees the seat. At the end the emulator checks the seat once more, as it does
/// after each request.
fn one_after_the_other<const WHOLE: bool>(may_first: bool) {
    loom::model(move || {
        let seat = Arc::new(Seat::<WHOLE>::new());
        assert!(seat.ask(FIRST));
        let tasks = {
            let seat = Arc::clone(&seat);
            loom::thread::spawn(move || {
                seat.leave();
                seat.is_dead.store(1, Release);
                let is_asking = seat.ask(SECOND);
                // Behaves like a task that waits for the answer.
                let answer = SeatState::from_code(seat.state.load());
                assert!(
                    !matches!(answer, Some(SeatState::Refused | SeatState::Lost)),
                    "{answer:?} to a good event"
                );
                is_asking
            })
        };
        let may = |event| event == SECOND || may_first;
        let answered = seat.hands().decide(may);
        if matches!(answered, Some((FIRST, true))) {
            seat.hands().lose();
        }
        seat.free_if_dead();
        let is_asking = tasks.join().unwrap();
        assert!(is_asking, "a seat that was left is free");
        let again = seat.hands().decide(may);
        // The emulator has given two answers. The last one was for the second task, and the seat still contains it.
        assert_eq!(seat.state.load(), SeatState::Seated.code(), "{answered:?} {again:?}");
        assert_eq!([seat.owner.load(), seat.event.load()], [SECOND, SECOND]);
        assert!(again.or(answered) == Some((SECOND, true)));
    });
}

#[test]
fn the_next_task_gets_the_seat_of_a_lost_one() {
    one_after_the_other::<true>(true);
}

#[test]
fn the_next_task_gets_the_seat_of_a_refused_one() {
    one_after_the_other::<true>(false);
}

/// A task that dies without leaving loses its seat, and the next one finds the seat free.
#[test]
fn the_next_task_gets_the_seat_of_a_dead_one() {
    loom::model(|| {
        let seat = Arc::new(Seat::<true>::new());
        assert!(seat.ask(FIRST));
        assert_eq!(seat.hands().decide(|_| false), Some((FIRST, false)));
        seat.is_dead.store(1, Release);
        let next = {
            let seat = Arc::clone(&seat);
            loom::thread::spawn(move || seat.ask(SECOND))
        };
        seat.free_if_dead();
        let is_ours = next.join().unwrap();
        assert_eq!(seat.owner.load(), if is_ours { SECOND } else { 0 });
        assert_ne!(seat.owner.load(), NO_OWNER);
        assert_eq!(seat.hands().decide(|_| true), is_ours.then_some((SECOND, true)));
    });
}

#[test]
#[should_panic(expected = "assertion")]
fn the_model_detects_exchanges_in_two_steps() {
    one_after_the_other::<false>(true);
}
