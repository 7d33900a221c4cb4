//! Boards in a plant: events from the SYNC signal, reset and power of one PLC while the others continue.

use crate::rig::bring_up::{Mode, Node, Stage, bring_up_in};
use crate::rig::{BOTH, Memory, OMEGA_RATES, Rig, plant_of};
use commram::devices::cansync::records::SyncEdge;
use commram::devices::omega_drive_line_2::Plc;
use commram::devices::omega_drive_line_2::registers::*;
use commram::devices::records::{BoardEvent, OnBoard};
use commram::identity::{DeviceIndex, PortNumber};
use commram::memory::header::{InterruptResult, OptInitResult};
use commram::plant::{Plant, Power};

const A: usize = 0;
const B: usize = 1;
const SYNC: usize = 12;

/// Enables an event in the header page of a PLC, as `INTR_SET` does.
fn set_event(plant: &mut Plant, plc: usize, event: usize, factor: i16) {
    let header = plant.devices()[plc].segment().header().unwrap();
    let request = header.interrupts[event].ask(factor, true);
    header.submit_request();
    assert!(plant.look_at_boards());
    assert_eq!(header.interrupts[event].outcome(request), Some(InterruptResult::Done.code()));
}

/// Returns the count of an event, and the time of the last one.
fn event(plant: &Plant, plc: usize, event: usize) -> (u32, u64) {
    let header = plant.devices()[plc].segment().header().unwrap();
    (header.events[event].bell.rings(), header.events[event].time_us.load())
}

fn edges(rig: &Rig) -> Vec<u64> {
    let journal = rig.plant.journal();
    let mut times: Vec<u64> = journal
        .records()
        .chain(journal.pending())
        .filter(|record| record.event.is::<SyncEdge>())
        .flat_map(|record| record.times())
        .collect();
    times.sort_unstable();
    times
}

#[test]
fn every_sync_edge_is_one_event_however_the_time_passes() {
    for memory in BOTH {
        for step in [1, 37, 1000, 2000, 123_457] {
            let mut rig = Rig::new(memory, OMEGA_RATES[0]);
            rig.set_up();
            set_event(&mut rig.plant, A, SYNC, 0);
            set_event(&mut rig.plant, B, SYNC, 0);
            let start = rig.plant.now();
            let end = start + 60_000;
            while rig.plant.now() < end {
                rig.plant.advance_to((rig.plant.now() + step).min(end));
            }
            let edges: Vec<u64> = edges(&rig).into_iter().filter(|time| *time > start).collect();
            assert_eq!(edges.len(), 30);
            for plc in [A, B] {
                assert_eq!(event(&rig.plant, plc, SYNC), (30, *edges.last().unwrap()), "steps of {step} us");
            }
        }
    }
}

#[test]
fn a_watched_event_stops_the_time_at_each_edge() {
    let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[0]);
    rig.set_up();
    set_event(&mut rig.plant, B, SYNC, 0);
    rig.plant.watch(DeviceIndex::at(B), 1 << SYNC);
    let start = rig.plant.now();
    let mut stops = Vec::new();
    while rig.plant.advance_until(start + 10_000) {
        stops.push(rig.plant.now());
        assert_eq!(event(&rig.plant, B, SYNC), (stops.len() as u32, rig.plant.now()));
    }
    assert_eq!((stops.len(), rig.plant.now()), (5, start + 10_000));
    rig.plant.watch(DeviceIndex::at(B), 0);
    assert!(!rig.plant.advance_until(start + 20_000));
    assert_eq!(event(&rig.plant, B, SYNC).0, 10);
}

/// A plant that stops at events has the same journal as a plant that does not stop.
#[test]
fn a_watched_run_is_the_same_run() {
    let run = |watch: u16| {
        let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[0]);
        rig.activate();
        set_event(&mut rig.plant, A, SYNC, 0);
        set_event(&mut rig.plant, A, 0, 7);
        rig.plant.watch(DeviceIndex::at(A), watch);
        let end = rig.plant.now() + 50_000;
        while rig.plant.advance_until(end) {}
        (rig.plant.journal().hash(), event(&rig.plant, A, SYNC), event(&rig.plant, A, 0))
    };
    assert_eq!(run(0), run(1 << SYNC | 1));
}

/// Node 1 is a slave on the upper bus. Node 2 is the master of the lower bus and passes on the SYNC signal. Each edge
/// is one event.
#[test]
fn a_forwarded_edge_is_one_event() {
    let text = "[[plc]]\nname='a'\nnode2='upper'\n[[plc]]\nname='b'\ndip=3\nnode1='upper'\nnode2='lower'\n\
                [[bus]]\nname='upper'\n[[bus]]\nname='lower'\n";
    let mut plant = plant_of(text);
    let nodes = [(A, NODE2, Mode::Master), (B, NODE1, Mode::Slave), (B, NODE2, Mode::SyncIn)]
        .map(|(plc, base, mode)| Node::at(plant.devices()[plc].segment(), base, OMEGA_RATES[0].timing, mode));
    bring_up_in(&mut plant, &nodes.each_ref(), ..=Stage::WaitingForStart);
    set_event(&mut plant, B, SYNC, 0);
    bring_up_in(&mut plant, &nodes.each_ref(), Stage::SetUp..=Stage::SetUp);
    let edges = |plant: &Plant| {
        let header = plant.devices()[B].segment().header().unwrap();
        [0, 1].map(|port: usize| header.sync_counter[port].load())
    };
    let before = (event(&plant, B, SYNC).0, edges(&plant));
    assert!(before.0 > 0);
    plant.advance_to(plant.now() + 20_000);
    let after = edges(&plant);
    assert_eq!(after.map(|count| count - before.1[0]), [10, 10], "both buses have edges");
    assert_eq!(event(&plant, B, SYNC).0 - before.0, 10);
}

#[test]
fn the_trigger_controller_follows_the_sync_signal() {
    let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[1]);
    rig.set_up();
    let header = rig.plant.devices()[A].segment().header().unwrap();
    header.opt_init.triggers.iter().zip([3, 0, 1]).for_each(|(cell, mode)| cell.store(mode));
    let request = header.opt_init.ask();
    header.submit_request();
    rig.step(40_000);
    assert_eq!(header.opt_init.outcome(request), Some(OptInitResult::Done.code()));
    let pulses = header.triggers.each_ref().map(|slot| slot.bell.rings());
    let edge = *edges(&rig).last().unwrap();
    assert_eq!(pulses, [10, 0, 10]);
    assert_eq!(header.triggers[2].time_us.load(), edge);
}

#[test]
fn a_reset_slave_leaves_the_bus_to_the_others() {
    for how in [[Power::HoldReset, Power::ReleaseReset], [Power::Off, Power::On]] {
        let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[0]);
        rig.activate();
        set_event(&mut rig.plant, A, SYNC, 0);
        set_event(&mut rig.plant, B, SYNC, 0);
        rig.plant.set_power(DeviceIndex::at(B), how[0]);
        assert_eq!(rig.slave.w_OPTION_STATUS.load(), 0x0001);
        let before = (event(&rig.plant, A, SYNC).0, event(&rig.plant, B, SYNC).0);
        rig.step(20_000);
        assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x0080, "the master goes on");
        assert_eq!((event(&rig.plant, A, SYNC).0, event(&rig.plant, B, SYNC).0), (before.0 + 10, before.1));
        rig.slave.w_CPU_CONTROL.store(0x0001);
        rig.step(1_000);
        assert_eq!(rig.slave.w_OPTION_STATUS.load(), 0x0001, "the node does not answer");
        rig.plant.set_power(DeviceIndex::at(B), how[1]);
        assert_eq!(rig.slave.w_CPU_CONTROL.load(), 0x0000, "start values");
        rig.initialize_slave();
        rig.slave.w_CPU_CONTROL.store(0x0020);
        rig.step(1_000);
        assert_eq!(rig.slave.w_OPTION_STATUS.load(), 0x0013, "it comes up again");
    }
}

#[test]
fn a_reset_master_stops_its_bus() {
    let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[0]);
    rig.activate();
    rig.plant.set_power(DeviceIndex::at(A), Power::HoldReset);
    assert_eq!(rig.plant.next_sync(DeviceIndex::at(A), PortNumber(2)), None);
    let edges_before = edges(&rig).len();
    rig.step(20_000);
    assert_eq!(edges(&rig).len(), edges_before);
    assert_eq!(rig.slave.w_OPTION_STATUS.load(), 0x0020, "the other PLC goes on");
    rig.plant.set_power(DeviceIndex::at(A), Power::ReleaseReset);
    rig.initialize_master();
    rig.master.w_CPU_CONTROL.store(0x0020);
    rig.step(10_000);
    assert!(edges(&rig).len() > edges_before);
}

#[test]
fn dip_switches_count_after_the_reset() {
    let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[0]);
    rig.plant.devices()[B].segment().header().unwrap().board.dip.store(2);
    rig.step(10_000);
    assert_eq!((rig.plant.devices()[B].as_a::<Plc>().unwrap().dip(), rig.slave.w_OMEGA_NR.load()), (0, 0));
    rig.plant.set_power(DeviceIndex::at(B), Power::HoldReset);
    rig.plant.set_power(DeviceIndex::at(B), Power::ReleaseReset);
    assert_eq!((rig.plant.devices()[B].as_a::<Plc>().unwrap().dip(), rig.slave.w_OMEGA_NR.load()), (2, 2));
    // The master finds the slave under its new number.
    rig.set_up();
    rig.step(100_000);
    let answering: Vec<_> = (0..4).filter(|n| rig.master.a_STAT_SL[*n].load() & 1 != 0).collect();
    assert_eq!(answering, [2]);
}

#[test]
fn a_number_that_is_taken_leaves_the_node_alone() {
    let mut rig = Rig::of(Memory::Heap, OMEGA_RATES[0], "[[bus.drive]]\nname = 'd'\nslave_number = 2\n");
    rig.plant.devices()[B].segment().header().unwrap().board.dip.store(2);
    rig.plant.set_power(DeviceIndex::at(B), Power::Off);
    rig.plant.set_power(DeviceIndex::at(B), Power::On);
    let taken =
        OnBoard { plc: DeviceIndex::at(B), what: BoardEvent::NumberTaken { port: PortNumber(1), number: 2 } }
            .into();
    assert!(rig.records().any(|record| record.event == taken));
    rig.expect_errors(&[&commram::devices::cansync::rules::NUMBER_TAKEN]);
    // The number is still taken at the next power-on, so the checker reports it again (5.00005.03a p. 22).
    rig.plant.set_power(DeviceIndex::at(B), Power::Off);
    rig.plant.set_power(DeviceIndex::at(B), Power::On);
    assert_eq!(rig.records().filter(|record| record.event == taken).count(), 2);
    // Turns the switch back to a free number.
    rig.plant.devices()[B].segment().header().unwrap().board.dip.store(1);
    rig.plant.set_power(DeviceIndex::at(B), Power::Off);
    rig.plant.set_power(DeviceIndex::at(B), Power::On);
    rig.set_up();
    rig.step(100_000);
    let answering: Vec<_> = (0..4).filter(|n| rig.master.a_STAT_SL[*n].load() & 1 != 0).collect();
    assert_eq!(answering, [1, 2], "the node and the drive");
}

/// 5.00005.03a p. 22 only requires that the numbers differ. A number is free after its station has got another number.
/// A node without power loses its number to a node that is switched on (D-184).
#[test]
fn a_number_is_free_when_its_station_has_moved_or_is_off() {
    const C: usize = 2;
    let rate = OMEGA_RATES[0];
    let text = rate.plant("") + &rate.kind.plc("c", 3, Some("line"), None);
    let mut rig = Rig::of_plant(Memory::Heap, rate, &text);
    rig.expect_errors(&[&commram::devices::cansync::rules::NUMBER_TAKEN]);
    let turn = |rig: &mut Rig, plc: usize, dip: u32| {
        rig.plant.devices()[plc].segment().header().unwrap().board.dip.store(dip);
        rig.plant.set_power(DeviceIndex::at(plc), Power::Off);
        rig.plant.set_power(DeviceIndex::at(plc), Power::On);
    };
    let taken = |rig: &Rig| {
        let is_taken = |record: &commram::journal::Record| {
            record.event.get::<OnBoard>().is_some_and(|it| matches!(it.what, BoardEvent::NumberTaken { .. }))
        };
        rig.records().filter(is_taken).count()
    };
    turn(&mut rig, B, 3);
    assert_eq!(taken(&rig), 1);
    // The second station gets a new number; the switches of the first station stay unchanged.
    turn(&mut rig, C, 1);
    turn(&mut rig, B, 3);
    assert_eq!(taken(&rig), 1);
    rig.set_up();
    rig.step(100_000);
    let answering =
        |rig: &Rig| (0..4).filter(|n| rig.master.a_STAT_SL[*n].load() & 1 != 0).collect::<Vec<_>>();
    assert_eq!(answering(&rig), [3]);
    // A node that is off has no number; when it is switched on, it counts as the newcomer.
    rig.plant.set_power(DeviceIndex::at(B), Power::Off);
    turn(&mut rig, C, 3);
    assert_eq!(taken(&rig), 1);
    rig.plant.set_power(DeviceIndex::at(B), Power::On);
    assert_eq!(taken(&rig), 2);
}

/// A client turns the switch in the header page; the firmware sees it at its next poll.
#[test]
fn the_switch_in_the_header_page_works_without_a_ring() {
    let mut rig = Rig::new(Memory::Mapped, OMEGA_RATES[0]);
    rig.activate();
    let header = rig.plant.devices()[A].segment().header().unwrap();
    header.board.switch.store(2);
    rig.step(500);
    assert_eq!((rig.master.w_OPTION_STATUS.load(), header.board.display.load()), (0x0001, 0));
    header.board.switch.store(1);
    rig.step(500);
    assert_eq!((header.program.restarts.load(), header.board.display.load()), (2, u32::from('0')));
}

/// docs/reference/attach.md has a table of the requests and the devices: each device answers each request, most of them
/// while the time is stopped.
#[test]
fn every_device_answers_every_request_to_its_board() {
    let folder = concat!("kind = '", env!("CARGO_MANIFEST_DIR"), "/tools/devices/netx-dpm'");
    let buses =
        "[[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n[[bus]]\nname = 'dp'\nkind = 'profibus'\n";
    // Each device, and the events that `INTR_SET` enables; `None` if some of them exclude each other.
    for (device, events) in [
        ("kind = 'omega-drive-line-2'".to_owned(), None),
        ("kind = 'bm4-plc'".to_owned(), Some(1 << 11)),
        ("kind = 'cs0015'\nbus = 'open'".to_owned(), Some(0)),
        ("kind = 'cr201x'\nbus = 'open'\nnode_id = 9\nmodule = 'cr2011'".to_owned(), Some(0)),
        ("kind = 'can-dp2'\nprofibus = 'dp'\ncan = 'open'".to_owned(), Some(0)),
        (folder.to_owned(), Some(0xFFFF)),
    ] {
        let mut plant = plant_of(&format!("[[device]]\nname = 'a'\n{device}\n{buses}"));
        plant.advance_to(1_000);
        let segment = plant.devices()[0].segment().clone();
        let header = segment.header().unwrap();
        let interrupts: Vec<u32> = header.interrupts.iter().map(|slot| slot.ask(1, true)).collect();
        let (opt_init, flag) = (header.opt_init.ask(), header.initial_flag.ask(0, 1, 7));
        header.project_request.store(1);
        header.program.start_request.store(1);
        header.submit_request();
        assert!(plant.look_at_boards(), "{device}");
        let answers = || {
            let slots = header.interrupts.iter().zip(&interrupts);
            slots.map(|(slot, request)| slot.outcome(*request)).collect::<Vec<_>>()
        };
        assert_eq!(answers().contains(&None), events == Some(0xFFFF), "{device}");
        assert_eq!(header.program.start_request.load() != 0, device.contains("cs0015"), "{device}");
        let is_omega = events.is_none();
        assert_eq!(header.opt_init.outcome(opt_init), Some(if is_omega { 0 } else { 4 }), "{device}");
        assert_eq!(header.initial_flag.outcome(flag), Some(u32::from(!is_omega)), "{device}");
        assert_eq!(header.project_request.load(), 0, "{device}");
        plant.advance_to(10_000);
        assert_eq!(header.program.start_request.load(), 0, "{device}");
        assert!(!answers().contains(&None), "{device}");
        if let Some(events) = events {
            let expected: Vec<_> = (0..16).map(|event| Some(!events >> event & 1)).collect();
            assert_eq!(answers(), expected, "{device}");
        }
        // A power-on discards a request that has no answer yet.
        plant.set_power(DeviceIndex(0), Power::Off);
        header.interrupts[11].ask(1, false);
        header.submit_request();
        plant.advance_to(20_000);
        plant.set_power(DeviceIndex(0), Power::On);
        plant.advance_to(30_000);
        let slot = &header.interrupts[11];
        assert_eq!(slot.request.load(), slot.answer.load(), "{device}");
    }
}
