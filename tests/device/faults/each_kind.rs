//! Every kind of fault that a CANsync bus or an Omega Drive-Line II has, through every interface and with every kind of end: plant file, words of the command line, and
//! [`Plant::add_fault`](commram::plant::Plant::add_fault), which the channel calls.

use super::*;
use crate::rig::{FASTEST, Memory};
use commram::devices::omega_drive_line_2::registers::{BAPS, BAPS_CTRL_BMSTRUCT, DEVICE};
use commram::devices::{bus_site, faults_of_device};

/// Time at which the faults begin. At this time, both nodes are active and the drives are locked.
const AT_US: u64 = 100_003;
/// Duration of the faults that have no count.
const DURATION_US: u64 = 40_000;

/// Each kind of fault with its fields and its number of hits. A drive has one fault until it is reset.
const KINDS: [(&str, &[&str], Option<u32>); 16] = [
    ("lose_frame", &["slot=WRC1"], Some(2)),
    ("delay_frame", &["slot=RDC1", "delay_us=77"], Some(3)),
    ("duplicate_frame", &["id=16#501", "delay_us=20"], Some(2)),
    ("lose_sync", &[], Some(2)),
    ("jitter_sync", &["amplitude_us=50"], Some(5)),
    ("slave_off", &["slave=2"], None),
    ("slave_late", &["slave=1", "delay_us=700"], Some(2)),
    ("slave_busy", &["slave=1"], Some(3)),
    ("slave_error", &["slave=1", "error=16#FFFA"], Some(2)),
    ("wrong_offset", &["slave=0"], Some(2)),
    ("bus_off", &["plc=b", "node=SLAVE"], Some(2)),
    ("overrun", &["plc=a", "node=MASTER"], Some(4)),
    ("drive_fault", &["slave=2", "error=17"], Some(1)),
    ("baps_drive_fault", &["plc=a", "error=18"], Some(1)),
    ("baps_silent", &["plc=a"], Some(3)),
    ("baps_slow", &["plc=a", "delay_us=700"], Some(2)),
];

/// Way in which a fault is added to the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FaultEntry {
    PlantFile,
    Running,
}

/// Returns the fault as words of the command line and as a text of a plant file.
fn spellings(rate: Rate, kind: &str, fields: &[&str], end: &str) -> (FaultSpec, String) {
    let fields = fields.iter().map(|field| rate.kind.named(field));
    let words: Vec<String> = fields.chain([format!("at_us={AT_US}"), end.to_owned()]).collect();
    let spec = FaultSpec::from_words(fault_kinds(), kind, &words).unwrap();
    let text = format!("[[fault]]\n{}", toml::to_string(&spec).unwrap());
    (spec, text)
}

/// Runs the fault during traffic of every kind, until well after the end of the fault.
fn run(rate: Rate, spec: &FaultSpec, text: &str, door: FaultEntry) -> Rig {
    let in_file = if door == FaultEntry::PlantFile { text } else { "" };
    let mut rig = Rig::of(Memory::Heap, rate, &format!("{DRIVES}{in_file}"));
    if door == FaultEntry::Running {
        let fault = spec.resolve(fault_kinds(), &rig.plant.names()).unwrap();
        rig.plant.add_fault(fault).unwrap();
    }
    start(&mut rig);
    for interval in 0.. {
        if rig.plant.now() > AT_US + 2 * DURATION_US {
            break;
        }
        traffic(&mut rig, interval);
    }
    rig
}

/// Enters work for one interval: for every frame and register that a fault can disturb.
fn traffic(rig: &mut Rig, interval: u64) {
    rig.master.b_CTRLREG_WRC1.store(0x05);
    if parameter(rig, DRIVE).0 & 0x01 == 0 {
        enter_parameter(rig, DRIVE, 0x03, 1000, 0);
    }
    // Parameter jobs have priority, so the transfers of blocks need intervals without a parameter job.
    rig.master.b_SL_NR_PARAMETER.store(if interval.is_multiple_of(2) { DRIVE as u8 } else { 31 });
    if block(rig).0 & 0x01 == 0 {
        enter_block(rig, 0x05, 0x1000, 6);
    }
    if rig.slave.w_CANsync_STATUS.load() & 0x80 != 0 {
        rig.slave.w_CPU_CONTROL.store(0x00C0);
    }
    serve_block(rig, 1);
    if !rig.rate.kind.is_omega() {
        return;
    }
    // The drive is not configured, so it refuses the command; a refusal is an answer, too.
    rig.plant.devices()[0].segment().view::<BAPS_CTRL_BMSTRUCT>(BAPS).unwrap().b_COMMAND.store(0x01);
}

#[test]
fn every_fault_kind_works_through_every_interface_and_ends_by_count_and_by_time() {
    let (at_bus, at_plc) = (bus_site("cansync", 0).faults, faults_of_device(&DEVICE));
    let known = fault_kinds().iter().filter(|kind| at_bus.contains(kind) || at_plc.contains(kind));
    assert!(KINDS.iter().map(|(kind, ..)| *kind).eq(known.map(|kind| kind.name())));
    let has = |rate: Rate, kind: &str| rate.kind.is_omega() || !kind.starts_with("baps_");
    let all = FASTEST.into_iter().flat_map(|rate| KINDS.map(|kind| (rate, kind)));
    for (rate, (kind, fields, hits)) in all.filter(|(rate, (kind, ..))| has(*rate, kind)) {
        let by_count = hits.map(|hits| (format!("count={hits}"), Some(hits)));
        for (end, hits) in by_count.into_iter().chain([(format!("duration_us={DURATION_US}"), None)]) {
            let what = format!("{kind} {end}, {rate:?}");
            let (spec, text) = spellings(rate, kind, fields, &end);
            let rig = run(rate, &spec, &text, FaultEntry::Running);
            assert_eq!(rig.plant.faults().count(), 0, "{what} is over");
            let mut news = news(&rig);
            // Records whose counts still run follow all other records, so the news are sorted by time.
            news.sort_by_key(|(time, _, news)| (*time, *news == News::Over));
            let [(0, 1, News::Added), ref hit @ .., (over, 1, News::Over)] = news[..] else {
                panic!("{what}: {news:?}")
            };
            assert!(hit.iter().all(|(_, id, news)| *id == 1 && matches!(news, News::Hit(_))), "{news:?}");
            let times = || hit.iter().map(|(time, ..)| *time);
            assert!(times().all(|time| time >= AT_US), "{what} waits for its time: {news:?}");
            match hits {
                Some(hits) => {
                    assert_eq!((hit.len() as u32, times().next_back()), (hits, Some(over)), "{what}")
                }
                None => {
                    assert_eq!(over, AT_US + DURATION_US, "{what}");
                    assert!(times().all(|time| time < over), "{what}: {news:?}");
                    assert_eq!(hit.is_empty(), kind == "slave_off", "{what}: {news:?}");
                }
            }
            let from_file = run(rate, &spec, &text, FaultEntry::PlantFile);
            assert_eq!(from_file.plant.journal().hash(), rig.plant.journal().hash(), "{what}, plant file");
        }
    }
}
