use super::*;
use crate::devices::catalogue;
use crate::devices::omega_drive_line_2::registers::{DEVICE, SEGMENT_END};
use crate::identity::{DeviceIndex, PortNumber};
use crate::journal::{Found, Journal, Origin};
use std::net::Ipv4Addr as Ip;

struct Rig {
    ethernet: Ethernet,
    segment: Segment,
    journal: Journal,
}

impl Rig {
    fn new(dip: u8) -> Self {
        Self::on(&Segment::heap(SEGMENT_END), dip)
    }

    /// Power-on with the NOVRAM that `segment` holds.
    fn on(segment: &Segment, dip: u8) -> Self {
        let ethernet = Ethernet::new(segment, 100).unwrap();
        let mut rig = Rig { ethernet, segment: segment.clone(), journal: Journal::default() };
        let mut ctx = context(&mut rig.journal);
        rig.ethernet.power_on(&mut ctx, dip);
        rig
    }

    fn look(&mut self) {
        self.ethernet.look(&mut context(&mut self.journal));
    }

    fn write_address(&self, address: Ip, mask: Ip) {
        let config = &self.ethernet.config;
        config.a_IP_ADDRESS.iter().zip(address.octets()).for_each(|(cell, byte)| cell.store(byte));
        config.a_IP_MASK.iter().zip(mask.octets()).for_each(|(cell, byte)| cell.store(byte));
    }

    /// Executes the sequence of the manual (p. 78): writes first the address, then the mask, then
    /// `d_IP_CONFIG`.
    fn store(&mut self, config: u32, address: Ip, mask: Ip) {
        self.write_address(address, mask);
        self.ethernet.config.d_IP_CONFIG.store(config);
        self.look();
    }

    fn address(&self) -> (Ip, Ip) {
        let shown = &self.ethernet.diagnose;
        let read = |cells: &[crate::memory::Cell8; 4]| Ip::from(cells.each_ref().map(|cell| cell.load()));
        (read(&shown.a_IP_ADDRESS), read(&shown.a_IP_MASK))
    }

    fn status(&self) -> u16 {
        self.ethernet.diagnose.w_STATUS.load()
    }

    fn events(&self) -> Vec<BoardEvent> {
        self.journal.records().filter_map(|record| Some(record.event.get::<OnBoard>()?.what)).collect()
    }
}

fn context(journal: &mut Journal) -> Context<'_> {
    Context { now: 0, journal, origin: Origin { plc: DeviceIndex(0), node: PortNumber(1) }, base: 0 }
}

const EXAMPLE: Ip = Ip::new(192, 168, 75, 190);
const MASK: Ip = Ip::new(255, 255, 255, 0);
const OTHER_MASK: Ip = Ip::new(255, 255, 240, 0);

/// The examples of p. 79-80. For any other value of `d_IP_CONFIG`, the address at delivery is used.
#[test]
fn addresses_are_those_of_the_manual() {
    let last =
        |dip: u8| [(0, 190), (1, 191), (30, 220), (31, 221)].into_iter().find(|it| it.0 == dip).unwrap().1;
    for dip in [0, 1, 30, 31] {
        let plus = Ip::new(192, 168, 75, last(dip));
        assert_eq!(effective(ip_config::PLUS_DIP, EXAMPLE, MASK, dip), Some((plus, MASK)));
        assert_eq!(effective(ip_config::FIXED, EXAMPLE, OTHER_MASK, dip), Some((EXAMPLE, OTHER_MASK)));
        for config in [0, 1, 0x1234_5601, 0x1234_5677, 0x1234_5679, u32::MAX] {
            let delivery = Ip::new(192, 168, 1, 1 + dip);
            assert_eq!(effective(config, EXAMPLE, OTHER_MASK, dip), Some((delivery, MASK)), "{config:08X}");
        }
    }
}

/// Manual p. 79-80: x.y.z.0 and x.y.z.255 are not addresses of devices. 224 + 31 is 255, so it is not allowed
/// either.
#[test]
fn ends_0_and_255_are_not_allowed() {
    let at = |last: u8| Ip::new(10, 0, 0, last);
    for (config, last, dip, allowed) in [
        (ip_config::FIXED, 0, 5, false),
        (ip_config::FIXED, 255, 0, false),
        (ip_config::FIXED, 1, 31, true),
        (ip_config::FIXED, 254, 31, true),
        (ip_config::PLUS_DIP, 224, 31, false),
        (ip_config::PLUS_DIP, 224, 30, true),
        (ip_config::PLUS_DIP, 223, 31, true),
        (ip_config::PLUS_DIP, 0, 0, false),
        (ip_config::PLUS_DIP, 0, 1, true),
        (ip_config::PLUS_DIP, 255, 0, false),
        (ip_config::PLUS_DIP, 250, 31, false),
    ] {
        assert_eq!(effective(config, at(last), MASK, dip).is_some(), allowed, "{config:08X} {last} + {dip}");
    }
}

#[test]
fn writing_d_ip_config_stores_and_nothing_else_does() {
    let mut rig = Rig::new(3);
    assert_eq!(rig.address(), (Ip::new(192, 168, 1, 4), MASK));
    let before = rig.ethernet.stored().1;
    rig.write_address(EXAMPLE, OTHER_MASK);
    rig.look();
    assert_eq!(rig.ethernet.stored(), (&[0; 16], before), "only written, not stored");
    rig.store(ip_config::FIXED, EXAMPLE, OTHER_MASK);
    assert_eq!(rig.address(), (EXAMPLE, OTHER_MASK));
    assert_ne!(rig.ethernet.stored().1, before);
    assert_eq!(rig.ethernet.stored().0[..8], [0x78, 0x56, 0x34, 0x12, 192, 168, 75, 190]);
    assert_eq!(rig.events(), [BoardEvent::AddressStored { config: ip_config::FIXED, address: EXAMPLE }]);
    // The program writes unchanged values, so there is no change to store.
    rig.store(ip_config::FIXED, EXAMPLE, OTHER_MASK);
    assert_eq!(rig.events().len(), 1);
}

#[test]
fn a_refused_address_leaves_the_old_configuration() {
    let mut rig = Rig::new(31);
    rig.store(ip_config::FIXED, EXAMPLE, MASK);
    let before = *rig.ethernet.stored().0;
    for (config, last) in [(ip_config::PLUS_DIP, 224), (ip_config::PLUS_DIP, 255)] {
        rig.store(config, Ip::new(10, 1, 2, last), OTHER_MASK);
        assert_eq!(rig.ethernet.stored().0, &before);
        assert_eq!(rig.ethernet.registers(), before, "the registers show the old address again");
        assert_eq!(rig.address(), (EXAMPLE, MASK));
        assert_eq!(rig.status() & ethernet_status::REFUSED, ethernet_status::REFUSED);
        let refused = BoardEvent::AddressRefused { config, address: Ip::new(10, 1, 2, last) };
        assert_eq!(rig.events().last(), Some(&refused));
        let finding = rig.journal.records().next_back().unwrap().event;
        let finding = finding.get::<Found>().and_then(|found| found.finding(catalogue())).unwrap();
        assert_eq!((finding.rule, finding.value), (&rules::IP_ADDRESS, last.into()));
        assert_eq!(finding.name(&DEVICE).as_deref(), Some("ethernet_config.a_IP_ADDRESS[3]"));
    }
    rig.store(ip_config::PLUS_DIP, Ip::new(10, 1, 2, 1), OTHER_MASK);
    assert_eq!((rig.address().0, rig.status() & ethernet_status::REFUSED), (Ip::new(10, 1, 2, 32), 0));
}

#[test]
fn the_dip_number_counts_from_the_next_reset_on() {
    let mut rig = Rig::new(1);
    rig.store(ip_config::PLUS_DIP, EXAMPLE, MASK);
    assert_eq!(rig.address().0, Ip::new(192, 168, 75, 191));
    rig.ethernet.power_off();
    assert_eq!((rig.address().0, rig.status()), (Ip::UNSPECIFIED, 0));
    let mut rig = Rig::on(&rig.segment, 31);
    assert_eq!(rig.address().0, Ip::new(192, 168, 75, 221));
    assert_eq!(rig.ethernet.diagnose.w_DIP_NR.load(), 31);
    rig.look();
    assert_eq!(rig.events(), [], "as before");
}

#[test]
fn a_dip_number_can_make_the_address_invalid() {
    let mut rig = Rig::new(30);
    rig.store(ip_config::PLUS_DIP, Ip::new(10, 0, 0, 224), MASK);
    let stored = *rig.ethernet.stored().0;
    let rig = Rig::on(&rig.segment, 31);
    assert_eq!((rig.address().0, rig.status() & ethernet_status::ADDRESS), (Ip::UNSPECIFIED, 0));
    assert_eq!(rig.ethernet.stored().0, &stored, "and keeps its configuration");
    let address = Ip::new(10, 0, 0, 224);
    assert_eq!(rig.events(), [BoardEvent::NoAddress { config: ip_config::PLUS_DIP, address }]);
}

/// Manual p. 81: the setting takes effect without a write to `d_IP_CONFIG`, and does not depend on the
/// address.
#[test]
fn routers_are_used_unless_they_are_forbidden() {
    let mut rig = Rig::new(0);
    let generation = rig.ethernet.stored().1;
    assert_eq!(
        rig.status(),
        ethernet_status::LINK | ethernet_status::ADDRESS | ethernet_status::ROUTERS,
        "delivery state"
    );
    for (router, used) in
        [(router::NO_ROUTERS, false), (router::NO_ROUTERS + 1, true), (router::NO_ROUTERS, false), (0, true)]
    {
        rig.ethernet.config.d_ROUTER.store(router);
        rig.look();
        assert_eq!(rig.status() & ethernet_status::ROUTERS != 0, used, "{router:08X}");
    }
    assert_eq!(rig.ethernet.stored().1, generation + 4, "each is kept");
    assert_eq!(rig.events(), []);
}

#[test]
fn without_a_link_there_is_still_an_address() {
    let segment = Segment::heap(SEGMENT_END);
    let mut ethernet = Ethernet::new(&segment, 0).unwrap();
    let mut journal = Journal::default();
    ethernet.power_on(&mut context(&mut journal), 0);
    assert_eq!(ethernet.diagnose.w_STATUS.load(), ethernet_status::ADDRESS | ethernet_status::ROUTERS);
    assert_eq!(ethernet.diagnose.w_SPEED.load(), 0);
}
