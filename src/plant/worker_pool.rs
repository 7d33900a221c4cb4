//! Permanent worker threads, so that repeated work for several cores does not start new threads each time.
//!
//! A piece of work is moved to a thread as a whole, and moved back when it is finished. So no other thread
//! can access it at the same time. An idle thread first polls for work for a short time, because the next
//! piece usually follows soon. If none comes, the thread sleeps on a futex of the channel that delivers the
//! work.

use core::time::Duration;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{self, Receiver, Sender, TryRecvError};
use std::thread::{Builder, JoinHandle, available_parallelism};
use std::time::Instant;

type Work = Box<dyn FnOnce() + Send>;

/// Time for which an idle thread polls before it sleeps: about the time that sleeping and waking up take.
const LOOKS: Duration = Duration::from_micros(100);

/// The worker threads. If a thread cannot be started, the pool works without it.
#[derive(Default)]
pub(super) struct WorkerPool {
    workers: Vec<Worker>,
    /// Time for which a thread polls before it sleeps.
    looks: Duration,
}

struct Worker {
    /// Sender of the work for the thread; `None` when the thread has to end.
    work: Option<Sender<Work>>,
    thread: Option<JoinHandle<()>>,
}

impl WorkerPool {
    /// Starts a pool of `count` threads.
    pub(super) fn of(count: usize) -> Self {
        // With fewer processors than threads, a polling thread would occupy the processor that a working
        // thread needs.
        let is_room = count > 0 && available_parallelism().is_ok_and(|processors| processors.get() > count);
        let looks = if is_room { LOOKS } else { Duration::ZERO };
        let start = |_| {
            let (work, works) = mpsc::channel::<Work>();
            let run = move || core::iter::from_fn(|| next(&works, looks)).for_each(|work| work());
            let thread = Builder::new().name("commram-crew".to_owned()).spawn(run).ok()?;
            Some(Worker { work: Some(work), thread: Some(thread) })
        };
        WorkerPool { workers: (0..count).filter_map(start).collect(), looks }
    }

    /// Runs the parts in parallel, the first one in the calling thread. Returns the results in the order of the parts.
    pub(super) fn share<P, R>(&self, parts: Vec<P>, run: impl Fn(P) -> R + Clone + Send + 'static) -> Vec<R>
    where
        P: Send + 'static,
        R: Send + 'static,
    {
        let (done, all_done) = mpsc::channel();
        let count = parts.len();
        let mut parts = parts.into_iter().enumerate();
        let own = parts.next();
        let mut rest = Vec::new();
        for (place, (index, part)) in parts.enumerate() {
            let (run, done) = (run.clone(), done.clone());
            let work: Work = Box::new(move || {
                let outcome = catch_unwind(AssertUnwindSafe(|| run(part)));
                // If the channel is closed, the receiver has panicked, and no thread waits for the result.
                let _ = done.send((index, outcome));
            });
            let worker = self.workers.get(place).and_then(|worker| worker.work.as_ref());
            let unsent = match worker {
                Some(worker) => worker.send(work).err().map(|unsent| unsent.0),
                None => Some(work),
            };
            rest.extend(unsent);
        }
        drop(done);
        let mut outcomes: Vec<_> = own.map(|(index, part)| (index, Ok(run(part)))).into_iter().collect();
        rest.into_iter().for_each(|work| work());
        let left = count - outcomes.len();
        outcomes.extend(core::iter::from_fn(|| next(&all_done, self.looks)).take(left));
        outcomes.sort_by_key(|(index, _)| *index);
        // If a worker has panicked, the panic continues in this thread.
        outcomes.into_iter().map(|(_, done)| done.unwrap_or_else(|panic| resume_unwind(panic))).collect()
    }
}

impl Drop for WorkerPool {
    fn drop(&mut self) {
        self.workers.iter_mut().for_each(|worker| drop(worker.work.take()));
        for worker in &mut self.workers {
            // The join cannot fail, because the work cannot panic.
            let _ = worker.thread.take().map(JoinHandle::join);
        }
    }
}

/// Returns the next item; `None` if no more items will come.
fn next<T>(from: &Receiver<T>, looks: Duration) -> Option<T> {
    let begin = Instant::now();
    loop {
        match from.try_recv() {
            Ok(next) => return Some(next),
            Err(TryRecvError::Disconnected) => return None,
            Err(TryRecvError::Empty) if begin.elapsed() < looks => core::hint::spin_loop(),
            Err(TryRecvError::Empty) => return from.recv().ok(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_come_back_in_their_order_however_many_work() {
        for count in 0..4 {
            let workers = WorkerPool::of(count);
            for round in 0..50 {
                let parts: Vec<u64> = (0..round % 7).collect();
                let squares: Vec<_> = parts.iter().map(|part| part * part).collect();
                assert_eq!(workers.share(parts, |part| part * part), squares);
            }
        }
    }

    #[test]
    fn a_panic_comes_through_and_the_threads_stay() {
        let workers = WorkerPool::of(2);
        for bad in 0..3 {
            let run = move |part: u32| if part == bad { panic!("part {part}") } else { part };
            let outcome = catch_unwind(AssertUnwindSafe(|| workers.share(vec![0, 1, 2], run)));
            let panic = outcome.unwrap_err();
            assert_eq!(panic.downcast_ref::<String>(), Some(&format!("part {bad}")));
            assert_eq!(workers.share(vec![0, 1, 2], |part: u32| part), [0, 1, 2]);
        }
    }
}
