//! Emulated intervals per second of a cluster in stepped mode: a PLC, 32 PLCs below it, 32 drives below each
//! of them; WRC1 and RDC1 busy on all 33 buses in every interval, the tasks of all PLCs included.

#[path = "../../tests/rig/mod.rs"]
mod rig;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rig::OMEGA_RATES;
use rig::cluster::Cluster;

fn clusters(criterion: &mut Criterion) {
    let mut cluster = Cluster::new(OMEGA_RATES[0], &[32, 32]);
    cluster.activate();
    let mut group = criterion.benchmark_group("clusters");
    group.throughput(Throughput::Elements(1));
    let mut value = 0;
    group.bench_function("1 + 32 + 32 x 32 participants", |bencher| {
        bencher.iter(|| {
            value += 1;
            cluster.plcs[0].master.a_WR_VALUE[0].store(value);
            cluster.interval();
        });
    });
    group.finish();
    // The figure counts only if values really go through.
    cluster.plcs[0].master.a_WR_VALUE[0].store(3);
    (0..2 * 64 + 8).for_each(|_| cluster.interval());
    assert_eq!(cluster.plcs[0].sum(), 3 * 1024);
}

criterion_group!(benches, clusters);
criterion_main!(benches);
