//! Tests a bus at every baud rate with a device that supports all four rates, and a bus with participants at
//! different rates.

use super::schedule::Slot;
use super::{BusConfig, SimBus, Socket, SocketRole};
use crate::devices::bm4_o_can_06::registers::{BAUD_RATES as FOUR, DEVICE};
use crate::devices::cansync::drive::{Drive, DriveConfig};
use crate::devices::cansync::firmware::NodeLocation;
use crate::devices::cansync::frames::{Channel, FrameKind, SyncLock, wire};
use crate::devices::cansync::records::{BaudRateMismatch, DriveBaudRateMismatch, Transmitted};
use crate::devices::cansync::registers::{
    CANsync_INIT_BMSTRUCT as Init, CANsync_MA_CTRL_BMSTRUCT as MasterRegisters,
    CANsync_SL_CTRL_BMSTRUCT as SlaveRegisters,
};
use crate::devices::cansync::{BaudRate, rules};
use crate::devices::omega_drive_line_2::registers::BAUD_RATES as THREE;
use crate::devices::{Bus, BusView, ParticipantId, RateMismatch, World};
use crate::fault::Faults;
use crate::identity::{BusIndex, DeviceIndex};
use crate::journal::{Finding, Journal, Origin};
use crate::memory::{Cell8, Segment, View};

const MASTER: usize = 0;
const SLAVE: usize = 1;
/// Number of the drive, which is requested in frame 1. `NODE` is the number of the slave node, which is
/// requested in frame 2.
const DRIVE: u8 = 1;
const NODE: u8 = 2;

struct Bench {
    bus: SimBus,
    init: [View<Init>; 2],
    master: View<MasterRegisters>,
    slave: View<SlaveRegisters>,
    journal: Journal,
    faults: Faults,
    now: u64,
}

impl Bench {
    /// Returns a bus with a drive at `kbit_s`. The nodes are restarted.
    fn new(kbit_s: u16, master: &'static [BaudRate], slave: &'static [BaudRate]) -> Self {
        let config = format!(
            "name = 'b'\nkbit_s = {kbit_s}\nframe_length = 'variable'\n\
             [[drive]]\nname = 'd'\nslave_number = {DRIVE}\ncard_function = 0\nlock_time_us = 0\n"
        );
        let config: BusConfig = toml::from_str(&config).unwrap();
        let mut bus = SimBus::new(BusIndex(0), &config).unwrap();
        let segment = Segment::heap(DEVICE.segment_size());
        let lock = SyncLock::new(0, None);
        let roles = [SocketRole::Master { has_sync_in: false }, SocketRole::Slave { number: NODE, lock }];
        for (place, (role, rates)) in roles.into_iter().zip([master, slave]).enumerate() {
            let port = &DEVICE.ports[place];
            let (area, origin) = (port.area, Origin { plc: DeviceIndex(0), node: port.number });
            let location = NodeLocation::of(port, rates);
            let socket = Socket { origin, segment: segment.clone(), location, area, role };
            assert_eq!(bus.attach(Box::new(socket)).unwrap(), place);
            assert!(bus.power_on(place, NODE, 0, &mut Journal::default()));
        }
        Bench {
            bus,
            init: [MASTER, SLAVE].map(|place| segment.view(base(place)).unwrap()),
            master: segment.view(base(MASTER)).unwrap(),
            slave: segment.view(base(SLAVE)).unwrap(),
            journal: Journal::default(),
            faults: Faults::default(),
            now: 0,
        }
    }

    /// Returns a bus with a master, a slave node and a drive at this rate. The bus starts now.
    fn started(rate: &BaudRate) -> Self {
        let mut bench = Bench::new(rate.kbit_per_s, &FOUR, &FOUR);
        bench.set_up(SLAVE, rate);
        bench.set_up(MASTER, rate);
        bench
    }

    /// Returns a bus in active operation: all stations are locked, and every frame has one word. An interval begins
    /// now.
    fn active(rate: &BaudRate) -> Self {
        let mut bench = Bench::started(rate);
        bench.run_to(20 * interval_us(rate));
        bench.command(MASTER, 0x0040);
        bench.command(SLAVE, 0x0040);
        bench.master._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(0x01);
        bench.master._CFG_WRC_WORD.b_CFG_WRC2_WORD0.store(0x01);
        bench.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x01);
        bench.slave._CFG_RDC_WORD.b_CFG_RDC2_WORD0.store(0x01);
        bench.run_to(30 * interval_us(rate));
        bench
    }

    /// Brings the master from restart to set-up mode. The master expects only the drive.
    fn set_up(&mut self, place: usize, rate: &BaudRate) {
        self.initialize(place, rate);
        self.command(place, 0x0020);
    }

    fn initialize(&mut self, place: usize, rate: &BaudRate) {
        self.command(place, 0x0000);
        self.command(place, 0x0001);
        let init = &self.init[place];
        init.b_MA_SL_MODE.store(place as u8);
        init.b_BT_0.store(rate.b_BT_0);
        init.b_BT_1.store(rate.b_BT_1);
        init.b_TIME_PATTERN.store(rate.b_TIME_PATTERN);
        init.b_AC.store(0xFF);
        init.b_AM.store(0xFF);
        init.b_OUTPUT_CONTROL.store(0xFA);
        init.b_CLOCK_DIVIDER.store(0x07);
        if place == MASTER {
            init.a_SL_TYP[usize::from(DRIVE)].store(0x01);
        }
        self.command(place, 0x0002);
    }

    fn command(&mut self, place: usize, value: u16) {
        self.init[place].w_CPU_CONTROL.store(value);
        self.bus.processor_cycle(place, self.now, &mut self.journal);
    }

    /// Handles all events up to `time`.
    fn run_to(&mut self, time: u64) {
        while self.bus.next_time() <= time {
            assert!(self.bus.next_time() >= self.now, "all events up to the time are handled");
            self.now = self.bus.next_time();
            let mut edges = Vec::new();
            let Bench { journal, faults, now, .. } = self;
            self.bus.event(&mut World { now: *now, journal, faults, edges: &mut edges });
        }
        self.now = time;
    }

    /// Returns the start time, within its interval, of the last frame of the given kind. `rate` gives the
    /// length of the interval.
    fn last(&self, kind: FrameKind, rate: &BaudRate) -> Option<u32> {
        let mut frames =
            self.journal.records().filter_map(|it| Some((it.time_us, it.event.get::<Transmitted>()?.frame)));
        let (end, frame) = frames.rfind(|(_, frame)| frame.kind() == Some(kind))?;
        let begin = end - u64::from(wire::airtime(&frame, rate.kbit_per_s.into()).delivery_us);
        u32::try_from(begin % interval_us(rate)).ok()
    }

    /// Returns the rate of each node that receives nothing, and the rate of its bus.
    fn rate_mismatches(&self) -> Vec<(u16, u16)> {
        let reports = self.journal.records().filter_map(|it| it.event.get::<BaudRateMismatch>());
        reports.map(|it| (it.node_kbit_s, it.bus_kbit_s)).collect()
    }
}

/// Returns the offset of the registers of the node. The node is in a slot of a b maXX PLC, which supports all
/// rates.
fn base(place: usize) -> u32 {
    DEVICE.ports[place].area.first
}

fn interval_us(rate: &BaudRate) -> u64 {
    u64::from(rate.b_TIME_PATTERN) * 1000
}

/// Manuals 5.02066.01a p. 18, 5.00005.03a p. 125.
#[test]
fn process_data_are_in_the_slots_of_every_rate() {
    for rate in &FOUR {
        let mut bench = Bench::active(rate);
        bench.master.b_CTRLREG_RD_ORDER_RDC1.store(DRIVE);
        bench.master.b_CTRLREG_RD_ORDER_RDC2.store(NODE);
        bench.master.b_CTRLREG_WRC1.store(0x05);
        bench.master.b_CTRLREG_WRC2.store(0x05);
        bench.slave.b_CTRLREG_RD_RDC2.store(0x05);
        bench.run_to(31 * interval_us(rate) - 1);
        for (kind, slot) in [
            (FrameKind::ReferenceValue(Channel::One, DRIVE), rate.t_WRC1),
            (FrameKind::ActualValue(Channel::One, DRIVE), rate.t_RDC1),
            (FrameKind::ReferenceValue(Channel::Two, NODE), rate.t_WRC2),
            (FrameKind::ActualValue(Channel::Two, NODE), rate.t_RDC2),
        ] {
            assert_eq!(bench.last(kind, rate), Some(slot), "{kind:?} of {rate:?}");
        }
        assert_eq!(bench.master.b_STATREG_RDC2.load(), NODE);
        assert_eq!(bench.slave.b_CTRLREG_WRC1.load(), 0x02);
    }
}

/// Manual 5.02066.01a p. 18, 32: the answer comes in the next interval, and the time limit for it depends on
/// the rate.
#[test]
fn the_command_channel_has_the_times_of_every_rate() {
    for rate in &FOUR {
        let mut bench = Bench::started(rate);
        bench.run_to(5 * interval_us(rate) - 1);
        let (job, answer) = (FrameKind::Job(DRIVE), FrameKind::Response(DRIVE));
        assert_eq!(bench.last(job, rate), Some(rate.t_CC), "{rate:?}");
        assert_eq!(bench.last(answer, rate), Some(rate.t_RC), "{rate:?}");
        let mut asked = None;
        while asked.is_none() {
            bench.run_to(bench.bus.next_time());
            asked = bench.bus.schedule.at(Slot::ResponseTimeout);
        }
        assert_eq!(asked, Some(bench.now + u64::from(rate.t_RSPTO)), "{rate:?}");
    }
}

/// The firmware sends values that the program releases before the earliest time of their deadline (answer
/// 16#04). It does not send values that the program releases at the latest time (16#05 stays). Manuals
/// 5.02066.01a p. 54, 86-87, 5.00005.03a p. 153, 181-182; D-351, D-354.
#[test]
fn values_are_in_time_until_the_deadline_of_every_rate() {
    for rate in &FOUR {
        let answer_to_release = |after: u32, control: fn(&Bench) -> &Cell8| {
            let mut bench = Bench::active(rate);
            let start = bench.now;
            bench.run_to(start + u64::from(after));
            control(&bench).store(0x05);
            bench.run_to(start + interval_us(rate) - 1);
            control(&bench).load()
        };
        let wrc1: fn(&Bench) -> &Cell8 = |it| &it.master.b_CTRLREG_WRC1;
        let rdc1: fn(&Bench) -> &Cell8 = |it| &it.slave.b_CTRLREG_RD_RDC1;
        let rdc2: fn(&Bench) -> &Cell8 = |it| &it.slave.b_CTRLREG_RD_RDC2;
        for (deadline, control) in
            [(rate.deadline_WRC, wrc1), (rate.deadline_RDC1, rdc1), (rate.deadline_RDC2, rdc2)]
        {
            assert_eq!(answer_to_release(deadline.earliest - 1, control), 0x04, "{deadline:?} of {rate:?}");
            assert_eq!(answer_to_release(deadline.latest, control), 0x05, "{deadline:?} of {rate:?}");
        }
    }
}

/// Decision D-354: the times in the master's table apply to its slaves as well.
#[test]
fn devices_agree_on_the_times_of_the_rates_that_they_share() {
    let times = |it: &BaudRate| {
        let deadlines =
            [it.deadline_WRC, it.deadline_RDC1, it.deadline_RDC2].map(|it| (it.earliest, it.latest));
        let slots = [it.t_WRC1, it.t_RDC1, it.t_WRC2, it.t_RDC2, it.t_CC, it.t_RC, it.t_RSPTO];
        (it.b_TIME_PATTERN, slots, deadlines)
    };
    for rate in &THREE {
        let other = FOUR.iter().find(|it| it.kbit_per_s == rate.kbit_per_s).unwrap();
        assert_eq!(times(other), times(rate));
    }
    for rate in FOUR.iter().chain(&THREE) {
        let (_, _, [reference, first, _]) = times(rate);
        assert_eq!((reference, reference.0), (first, reference.1), "{rate:?}");
    }
}

/// An Omega Drive-Line II does not support 1000 kbit/s. It receives nothing on a bus at this rate, no matter
/// whether the bus or the slave starts first.
#[test]
fn a_slave_of_another_rate_receives_nothing_and_is_reported() {
    let (fast, [slow, ..]) = (&FOUR[0], &THREE);
    for slave_first in [true, false] {
        let mut bench = Bench::new(1000, &FOUR, &THREE);
        let order = if slave_first { [SLAVE, MASTER] } else { [MASTER, SLAVE] };
        for place in order {
            assert_eq!(bench.rate_mismatches(), []);
            bench.set_up(place, if place == MASTER { fast } else { slow });
        }
        bench.command(MASTER, 0x0040);
        bench.command(SLAVE, 0x0040);
        bench.run_to(20 * interval_us(fast));
        bench.master.b_CTRLREG_WRC1.store(0x05);
        bench.run_to(21 * interval_us(fast));
        assert_eq!(bench.master.b_CTRLREG_WRC1.load(), 0x04);
        assert_eq!(bench.slave.b_CTRLREG_WRC1.load(), 0x00);
        assert_eq!(bench.rate_mismatches(), [(500, 1000)], "slave first: {slave_first}");
        assert_eq!(bench.journal.findings().errors(), [&rules::BUS_BAUD_RATE]);
    }
}

/// D-540; manual 5.01010.01 p. 13: each drive's card has its own setting of the rate.
#[test]
fn a_drive_of_another_rate_receives_nothing_and_is_reported() {
    let [_, fast, slow, ..] = &FOUR;
    let mut bench = Bench::new(slow.kbit_per_s, &FOUR, &FOUR);
    let one: DriveConfig = toml::from_str("name = 'e'\nslave_number = 3\nkbit_s = 500").unwrap();
    let config =
        BusConfig { drives: vec![one, DriveConfig::demo("f", 4)], kbit_s: 250, ..BusConfig::default() };
    let with_own = SimBus::new(BusIndex(0), &config).unwrap();
    assert_eq!(with_own.drives().iter().map(Drive::kbit_s).collect::<Vec<_>>(), [500, 250]);

    bench.set_up(MASTER, fast);
    bench.run_to(20 * interval_us(fast));
    let reports = bench.journal.records().filter_map(|it| it.event.get::<DriveBaudRateMismatch>());
    let reports: Vec<_> = reports.map(|it| (it.bus, it.slave, it.drive_kbit_s, it.bus_kbit_s)).collect();
    assert_eq!(reports, [(BusIndex(0), DRIVE, 250, 500)], "once for each start");
    let found: Vec<_> = bench.journal.findings().iter().map(|entry| entry.last).collect();
    assert_eq!(found, [Finding::at_participant(&rules::DRIVE_BAUD_RATE, BusIndex(0), DRIVE, 250)]);
    assert_eq!(found[0].name(&DEVICE).as_deref(), Some("slave1"));
    assert_eq!((found[0].value_text(&DEVICE), found[0].address(&DEVICE)), ("250".to_owned(), None));
    let stranger = RateMismatch { participant: ParticipantId::Own("d".to_owned()), bit_s: 250_000 };
    assert_eq!((bench.bus.bit_s(), bench.bus.strangers()), (500_000, vec![stranger]));
    assert_eq!(bench.last(FrameKind::Response(DRIVE), fast), None);

    let right = Bench::started(fast);
    assert_eq!((right.bus.strangers(), right.journal.findings().len()), (vec![], 0));
}

#[test]
fn a_node_takes_only_the_rates_of_its_device() {
    let mut bench = Bench::new(1000, &FOUR, &THREE);
    bench.initialize(MASTER, &FOUR[0]);
    assert_eq!(bench.master.w_OPTION_STATUS.load(), 0x0003);
    bench.initialize(SLAVE, &FOUR[0]);
    assert_eq!(bench.slave.w_OPTION_STATUS.load(), 0x0002);
    assert_eq!(bench.journal.findings().errors(), [&rules::INIT_BAUD_RATE]);
}
