//! Emulated intervals per second of clusters in stepped mode: a PLC, 32 PLCs on the bus of this PLC, 32 participants on
//! the bus of each of these PLCs, and so on. In every interval WRC1 and RDC1 are sent on all buses, and the tasks of
//! all PLCs run.
//!
//! `COMMRAM_BENCH_PARTICIPANTS` names other sizes: `1057,65535`. `COMMRAM_BENCH_CORES` is the number of cores that the
//! plant may use. `COMMRAM_BENCH_IMAGES=1` puts the registers into image files. The benchmark also reports the memory
//! use.

#[path = "../../tests/rig/mod.rs"]
mod rig;

use core::num::NonZero;
use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use rig::cluster::Cluster;
use rig::{Memory, OMEGA_RATES};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Numbers of participants: a PLC with one drive, a PLC with 32 drives, clusters of 33, 331 and 1,000 PLCs, and the
/// largest possible cluster. The difference of the first two is the memory of 31 drives.
const SIZES: [usize; 6] = [2, 33, 1_057, 10_570, 32_001, 65_535];

/// Number of allocated bytes without images: an image takes memory only for the pages that were accessed.
static USED: AtomicUsize = AtomicUsize::new(0);

/// Counts the memory in use.
struct Counting;

/// Allocations that are longer than this size count as images; few other allocations are so long.
const IMAGE: usize = 3 << 20;

// SAFETY: all calls are passed to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if layout.size() < IMAGE {
            USED.fetch_add(layout.size(), Ordering::Relaxed);
        }
        // SAFETY: the caller guarantees the conditions of this function.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if layout.size() < IMAGE {
            USED.fetch_add(layout.size(), Ordering::Relaxed);
        }
        // SAFETY: the caller guarantees the conditions of this function.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        if layout.size() < IMAGE {
            USED.fetch_sub(layout.size(), Ordering::Relaxed);
        }
        // SAFETY: the caller guarantees the conditions of this function.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn sizes() -> Vec<usize> {
    let asked = std::env::var("COMMRAM_BENCH_PARTICIPANTS").ok();
    let asked = asked.map(|list| list.split(',').filter_map(|size| size.parse().ok()).collect());
    asked.unwrap_or_else(|| SIZES.to_vec())
}

fn cores() -> NonZero<usize> {
    let asked = std::env::var("COMMRAM_BENCH_CORES").ok();
    asked.and_then(|count| count.parse().ok()).unwrap_or(NonZero::<usize>::MIN)
}

/// Returns the memory for the registers. Image files may need the maximum number of open files.
fn memory() -> Memory {
    if std::env::var_os("COMMRAM_BENCH_IMAGES").is_none() {
        return Memory::Heap;
    }
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum }).expect("up to the maximum one may");
    Memory::Mapped
}

fn clusters(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("clusters");
    group.throughput(Throughput::Elements(1)).sample_size(10);
    let memory = memory();
    for participants in sizes() {
        let before = USED.load(Ordering::Relaxed);
        let mut cluster = Cluster::filled(OMEGA_RATES[0], participants, memory);
        cluster.plant.set_cores(cores());
        cluster.activate();
        let used = USED.load(Ordering::Relaxed) - before;
        let (plcs, drives) = (cluster.plcs.len(), participants - cluster.plcs.len());
        println!(
            "{participants} participants: {plcs} PLCs, {drives} drives, {} KiB beside the images",
            used / 1024
        );
        let mut value = 0;
        // A longer measurement of one size would give no more information.
        group.warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(2));
        group.sampling_mode(if plcs > 100 { SamplingMode::Flat } else { SamplingMode::Auto });
        group.bench_function(BenchmarkId::from_parameter(participants), |bencher| {
            bencher.iter(|| {
                value += 1;
                cluster.plcs[0].master.a_WR_VALUE[0].store(value);
                cluster.interval();
            });
        });
        // The figure is valid only if values arrive: each bus polls all of its slaves in turn.
        cluster.plcs[0].master.a_WR_VALUE[0].store(3);
        (0..4 * 64 + 8).for_each(|_| cluster.interval());
        assert_eq!(cluster.plcs[0].sum() as usize, 3 * drives);
    }
    group.finish();
}

criterion_group! {
    name = benches;
    // Plots need a font of the system.
    config = Criterion::default().without_plots();
    targets = clusters
}
criterion_main!(benches);
