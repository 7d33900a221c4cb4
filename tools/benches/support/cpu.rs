//! Chooses the processors on which processes run.

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// Returns the first two processors that this process may use.
///
/// # Panics
/// If only one processor is available. On one processor, two processes that poll would take turns of milliseconds, so
/// no latency could be measured.
pub(crate) fn pair() -> [usize; 2] {
    let allowed = sched_getaffinity(None).expect("the processors can be listed");
    let mut usable = (0..CpuSet::MAX_CPU).filter(|&cpu| allowed.is_set(cpu));
    match (usable.next(), usable.next()) {
        (Some(first), Some(second)) => [first, second],
        _ => panic!("these benchmarks need two processors"),
    }
}

/// Pins this thread to one processor. Threads and processes that it starts later are pinned, too.
pub(crate) fn pin(cpu: usize) {
    let mut set = CpuSet::new();
    set.set(cpu);
    sched_setaffinity(None, &set).expect("a thread can be pinned");
}

/// Pins this thread until the guard is dropped.
pub(crate) struct Pinned {
    before: CpuSet,
}

impl Pinned {
    /// Pins this thread to one processor.
    pub(crate) fn to(cpu: usize) -> Self {
        let before = sched_getaffinity(None).expect("the processors can be listed");
        pin(cpu);
        Pinned { before }
    }
}

impl Drop for Pinned {
    fn drop(&mut self) {
        let _ = sched_setaffinity(None, &self.before);
    }
}
