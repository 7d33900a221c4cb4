//! Clusters: PLCs that are slaves on one bus and masters of another, with one SYNC signal for all (D-12).

use crate::rig::bring_up::{Mode, Node, Stage, bring_up_in};
use crate::rig::cluster::Cluster;
use crate::rig::{FASTEST, RATES, Rate, plant_of};
use commram::devices::cansync::bus::drives;
use commram::devices::cansync::records::{BaudRateMismatch, SyncEdge, Transmitted};
use commram::devices::{cansync, fault_kinds};
use commram::fault::FaultSpec;
use commram::identity::{BusIndex, DeviceIndex};
use commram::journal::Record;
use commram::memory::header::BoardSetting;
use commram::plant::Plant;
use core::num::NonZero;

/// Returns the times of the SYNC edges of a bus.
fn edges(cluster: &Cluster, bus: BusIndex) -> Vec<u64> {
    let journal = cluster.plant.journal();
    let edge = |record: &Record| record.event == SyncEdge { bus }.into();
    journal.records().chain(journal.pending()).filter(edge).flat_map(|record| record.times()).collect()
}

/// Returns the number of frames so far on a bus.
fn frames(cluster: &Cluster, bus: BusIndex) -> usize {
    let of_bus = |record: &Record| record.event.get().is_some_and(|it: Transmitted| it.bus == bus);
    cluster.plant.journal().records().filter(of_bus).count()
}

/// Three PLCs, one below the other, and a drive: a value goes down by one level per interval, needs two intervals in
/// the drive (D-34), and comes back up by one level per interval.
#[test]
fn a_value_goes_through_three_levels_and_back() {
    for rate in RATES {
        let mut cluster = Cluster::new(rate, &[1, 1, 1]);
        cluster.activate();
        cluster.plcs[0].master.a_WR_VALUE[0].store(0x1122_3344);
        let mut seen = [None; 3];
        for interval in 0..10 {
            cluster.interval();
            for (level, plc) in cluster.plcs.iter().enumerate() {
                if plc.sum() == 0x1122_3344 {
                    seen[level].get_or_insert(interval);
                }
            }
        }
        assert_eq!(seen, [Some(6), Some(5), Some(4)], "{rate:?}");
    }
}

#[test]
fn all_levels_have_their_edges_at_the_same_microsecond() {
    for rate in FASTEST {
        let mut cluster = Cluster::new(rate, &[2, 1, 1]);
        cluster.activate();
        (0..10).for_each(|_| cluster.interval());
        let buses: Vec<_> = BusIndex::first(cluster.plcs.len()).map(|bus| edges(&cluster, bus)).collect();
        assert_eq!(buses.len(), 5, "one bus at the top, two below it, two below those");
        let evenly = |pair: &[u64]| pair[1] - pair[0] == rate.interval_us;
        assert!(buses[0].len() > 100 && buses[0].windows(2).all(evenly));
        assert!(buses.iter().all(|bus| bus.len() > 100 && buses[0].ends_with(bus)));
    }
}

/// The top PLC restarts. Without edges there are no frames and no answers on the lower buses; everything works again
/// when the signal returns.
#[test]
fn a_cluster_pauses_while_its_top_restarts() {
    for rate in FASTEST {
        let mut cluster = Cluster::new(rate, &[1, 1, 2]);
        cluster.activate();
        cluster.interval();
        let top = cluster.plcs[0].master.clone();
        top.w_CPU_CONTROL.store(0x0000);
        cluster.plant.advance_to(cluster.plant.now() + rate.interval_us);
        let before = [0, 1, 2].map(BusIndex).map(|bus| (edges(&cluster, bus).len(), frames(&cluster, bus)));
        assert_eq!(cluster.next_sync(2), None);
        cluster.plant.advance_to(cluster.plant.now() + 20 * rate.interval_us);
        assert_eq!(
            [0, 1, 2].map(BusIndex).map(|bus| (edges(&cluster, bus).len(), frames(&cluster, bus))),
            before
        );
        assert_eq!(cluster.plcs[2].master.w_OPTION_STATUS.load(), 0x0080, "no station ordered it to leave");

        let mut again = Cluster::new(rate, &[1, 1, 2]);
        again.activate();
        cluster.activate();
        for cluster in [&mut cluster, &mut again] {
            cluster.plcs[0].master.a_WR_VALUE[0].store(500);
            (0..20).for_each(|_| cluster.interval());
            assert_eq!(cluster.plcs[0].sum(), 1000);
        }
    }
}

/// 1 + 32 + 32 x 32 participants: no participant is omitted, no value is lost or invented.
#[test]
fn the_largest_two_level_cluster_runs() {
    for rate in FASTEST {
        let mut cluster = Cluster::new(rate, &[32, 32]);
        assert_eq!(cluster.plcs.len() + drives(cluster.plant.buses()).count(), 1 + 32 + 32 * 32);
        cluster.activate();
        cluster.plcs[0].master.a_WR_VALUE[0].store(7);
        // Runs two rounds of requests to 32 slaves on each level, plus the intervals that a value needs on its way down
        // and up.
        (0..2 * 64 + 8).for_each(|_| cluster.interval());
        assert!(cluster.plcs[1..].iter().all(|plc| plc.sum() == 7 * 32));
        assert_eq!(cluster.plcs[0].sum(), 7 * 1024);
    }
}

/// 33 buses with faults: a PLC restarts, another loses its supply, and programs violate rules.
#[test]
fn a_run_on_several_cores_equals_a_run_on_one() {
    for rate in FASTEST {
        // Runs with different numbers of cores and lengths of steps. In steps that are shorter than a processor cycle,
        // the plant skips no cycle and handles few events per step.
        let outcomes = [(1, 250), (1, 2000), (2, 2000), (3, 2000)].map(|(cores, step_us)| {
            let mut cluster = Cluster::new(rate, &[32, 1]);
            cluster.plant.set_cores(NonZero::new(cores).unwrap());
            cluster.activate();
            let intervals = |cluster: &mut Cluster, count: u32| {
                for value in 0..count {
                    cluster.plcs[0].master.a_WR_VALUE[0].store(value);
                    cluster.interval_by(step_us);
                }
            };
            intervals(&mut cluster, 20);
            let names = cluster.plant.names();
            for fault in
                ["kind = 'lose_frame'\nbus = 'p3'\ncount = 2", "kind = 'lose_sync'\nbus = 'p0'\ncount = 1"]
            {
                let fault: FaultSpec = toml::from_str(fault).unwrap();
                cluster.plant.add_fault(fault.resolve(fault_kinds(), &names).unwrap()).unwrap();
                intervals(&mut cluster, 10);
            }
            assert_eq!(cluster.plant.faults().count(), 0, "both are over");
            // The programs of these PLCs set reserved bits, so the checker reports a warning or an error for each of
            // these PLCs.
            for plc in [5, 31, 7] {
                cluster.plcs[plc].master.b_MAX_SL_NR.store(0x7F);
            }
            intervals(&mut cluster, 3);
            let broken = cluster.plant.journal().findings().iter().count();
            assert!(broken >= 3, "{broken} findings");
            cluster.plcs[9].master.w_CPU_CONTROL.store(0);
            intervals(&mut cluster, 10);
            cluster.plant.set_board(DeviceIndex(12), BoardSetting::PowerCycle);
            intervals(&mut cluster, 30);
            let findings: Vec<_> = cluster.plant.journal().findings().iter().cloned().collect();
            cluster.plant.clear_findings();
            let plant = &cluster.plant;
            let records: Vec<_> = plant.journal().records().collect();
            let (hash, pending) = (plant.journal().hash(), plant.journal().pending());
            (hash, records, pending, findings, plant.snapshot())
        });
        assert!(outcomes[0] == outcomes[1], "one core");
        assert!(outcomes[0] == outcomes[2], "two cores");
        assert!(outcomes[0] == outcomes[3], "three cores");
    }
}

/// Brings nodes to set-up mode one after the other.
fn set_up(plant: &mut Plant, nodes: &[(usize, Mode, Rate)]) {
    for &(plc, mode, rate) in nodes {
        let at = if mode == Mode::Slave { rate.kind.slave } else { rate.kind.master };
        let node = Node::at(plant.devices()[plc].segment(), at.base, rate.timing, mode);
        bring_up_in(plant, &[&node], ..=Stage::SetUp);
    }
}

/// Decision D-282: edges with the interval of another rate synchronize no station, at any level of the cluster, and the
/// journal reports the difference.
#[test]
fn a_cluster_of_unlike_rates_says_so() {
    let pairs = RATES.iter().flat_map(|upper| RATES.map(|lower| (*upper, lower)));
    let unlike =
        |(upper, lower): &(Rate, Rate)| core::ptr::eq(upper.kind, lower.kind) && upper.kbit_s != lower.kbit_s;
    for (upper, lower) in pairs.filter(unlike) {
        let kind = upper.kind;
        let mut plant = plant_of(
            &[
                kind.plc("top", 0, None, Some("upper")),
                kind.plc("middle", 3, Some("upper"), Some("lower")),
                kind.plc("below", 0, Some("lower"), Some("lowest")),
                upper.bus("upper", ""),
                lower.bus("lower", ""),
                lower.bus("lowest", "[[bus.drive]]\nname = 'd'\nslave_number = 0\nlock_time_us = 10000\n"),
            ]
            .concat(),
        );
        set_up(&mut plant, &[(0, Mode::Master, upper), (1, Mode::Slave, upper)]);
        set_up(&mut plant, &[(1, Mode::SyncIn, lower), (2, Mode::Slave, lower), (2, Mode::SyncIn, lower)]);
        plant.advance_to(plant.now() + 100_000);
        let status = |plant: &Plant, plc: usize| {
            let node = Node::at(plant.devices()[plc].segment(), kind.master.base, lower.timing, Mode::SyncIn);
            node.init.w_CANsync_STATUS.load() & 0x0040
        };
        assert_eq!([0, 1, 2].map(|plc| status(&plant, plc)), [0, 0x40, 0x40], "{upper:?}, {lower:?}");
        assert!(drives(plant.buses()).all(|drive| !drive.is_synchronized()));
        let recorded: Vec<_> = plant
            .journal()
            .records()
            .filter_map(|record| {
                let BaudRateMismatch { origin, node_kbit_s, bus_kbit_s, .. } = record.event.get()?;
                Some((origin.plc.0, origin.node, node_kbit_s, bus_kbit_s))
            })
            .collect();
        let once = [1, 2].map(|plc| (plc, kind.master.port, lower.kbit_s, upper.kbit_s));
        assert_eq!(recorded, once, "once each");
        assert_eq!(plant.journal().findings().errors(), [&cansync::rules::CLUSTER_BAUD_RATE]);

        set_up(&mut plant, &[(0, Mode::Master, lower), (1, Mode::Slave, lower)]);
        plant.advance_to(plant.now() + 100_000);
        assert_eq!([0, 1, 2].map(|plc| status(&plant, plc)), [0, 0, 0], "one rate everywhere");
        assert!(drives(plant.buses()).all(commram::devices::cansync::drive::Drive::is_synchronized));
    }
}
