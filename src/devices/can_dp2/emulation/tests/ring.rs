//! Two foreign DP masters pass a token to each other. They are on the PROFIBUS segment with the gateway and a
//! foreign slave. The masters and the foreign slave use `profirust` as programs at the door of the segment.
//! These programs receive each telegram at its end, and send their own telegrams as soon as the line is free.

use super::*;
use crate::devices::can_dp2::registers::values::dp_state;
use crate::door::{BusMessage, Guest};
use crate::identity::BusIndex;
use crate::profibus::{Burst, BusRate, Telegram};
use profirust::Baudrate;
use profirust::dp::{DpMaster, Peripheral, PeripheralHandle, PeripheralOptions};
use profirust::fdl::{FdlActiveStation, ParametersBuilder};
use profirust::phy::ProfibusPhy;
use profirust::time::Instant;

/// Addresses of the gateway and of the foreign slave.
const GATEWAY: u8 = 5;
const SLAVE: u8 = 9;

/// The connection of a program to a door.
struct Door {
    number: u8,
    receiver: Arc<Guest>,
}

impl Door {
    fn come(bench: &mut Bench, number: u8) -> Self {
        let receiver = Guest::of_a_test(BusIndex(0), number);
        assert!(bench.buses[0].guests().unwrap().guest_joins(number, bench.now));
        bench.buses[0].guests().unwrap().guest_hears(number, Some(receiver.clone()));
        Door { number, receiver }
    }

    fn send(&self, bench: &mut Bench, octets: Vec<u8>) {
        let now = bench.now;
        assert_eq!(
            bench.buses[0].guests().unwrap().guest_sends(
                self.number,
                &BusMessage::burst(octets),
                now,
                &mut bench.journal
            ),
            Ok(())
        );
    }

    fn hear(&self) -> Option<Burst> {
        match self.receiver.hears()? {
            BusMessage::Burst(burst) => Some(burst),
            BusMessage::Frame(frame) => panic!("{frame:?}"),
        }
    }
}

/// A serial line. The door is its other end.
struct Phy {
    rate: BusRate,
    heard: Vec<u8>,
    to_say: Option<Vec<u8>>,
    /// Time in microseconds until which the octets of the program are on the line.
    busy_until: u64,
}

fn us(now: Instant) -> u64 {
    u64::try_from(now.total_micros()).unwrap()
}

impl ProfibusPhy for Phy {
    fn poll_transmission(&mut self, now: Instant) -> bool {
        self.to_say.is_some() || us(now) < self.busy_until
    }

    fn transmit_data<F, R>(&mut self, now: Instant, f: F) -> R
    where
        F: FnOnce(&mut [u8]) -> (usize, R),
    {
        let mut buffer = vec![0; 256];
        let (length, result) = f(&mut buffer);
        if length > 0 {
            buffer.truncate(length);
            self.busy_until = us(now) + self.rate.us_at(Telegram::bits(length));
            self.to_say = Some(buffer);
        }
        result
    }

    fn receive_data<F, R>(&mut self, _: Instant, f: F) -> R
    where
        F: FnOnce(&[u8]) -> (usize, R),
    {
        let (taken, result) = f(&self.heard);
        self.heard.drain(..taken);
        result
    }
}

/// A master with one slave.
struct Master {
    door: Door,
    phy: Phy,
    fdl: FdlActiveStation,
    dp: DpMaster<'static>,
    slave: PeripheralHandle,
}

impl Master {
    fn new(
        bench: &mut Bench,
        rate: Baudrate,
        address: u8,
        slot_bits: u16,
        slave: Peripheral<'static>,
    ) -> Self {
        let mut dp = DpMaster::new(vec![]);
        let slave = dp.add(slave);
        let parameters = ParametersBuilder::new(address, rate)
            .slot_bits(slot_bits)
            .highest_station_address(4)
            .gap_wait_rotations(1)
            .build_verified(&dp);
        let mut fdl = FdlActiveStation::new(parameters);
        fdl.set_online();
        dp.enter_operate();
        let rate = BusRate::new(rate.to_rate().try_into().unwrap()).unwrap();
        let phy = Phy { rate, heard: Vec::new(), to_say: None, busy_until: 0 };
        Master { door: Door::come(bench, address), phy, fdl, dp, slave }
    }

    fn step(&mut self, bench: &mut Bench) {
        while let Some(burst) = self.door.hear() {
            self.phy.heard.extend(burst.octets);
        }
        let now = Instant::from_micros(i64::try_from(bench.now).unwrap());
        self.fdl.poll(now, &mut self.phy, &mut self.dp);
        if let Some(octets) = self.phy.to_say.take() {
            self.door.send(bench, octets);
        }
    }

    fn peripheral(&mut self) -> &mut Peripheral<'static> {
        self.dp.get_mut(self.slave)
    }
}

/// A program that acts as a slave: it acknowledges requests and sends back its outputs plus one.
struct Slave {
    door: Door,
    /// Bits that pass before its answer, in addition to the shortest T_SDR.
    lag: u64,
    /// Time and octets of the next answer.
    answer: Option<(u64, Vec<u8>)>,
}

impl Slave {
    fn reply(burst: &Burst) -> Option<Vec<u8>> {
        let Ok(Telegram::Frame(asked)) = Telegram::parse(&burst.octets) else { return None };
        if asked.da != SLAVE || asked.fc & 0x40 == 0 {
            return None;
        }
        let data = match (asked.fc & 0x0F, asked.dsap) {
            (0x09, _) => {
                return Telegram::parse(&[0x10, asked.sa, SLAVE, 0, asked.sa + SLAVE, 0x16])
                    .ok()?
                    .octets()
                    .ok();
            }
            (_, Some(60)) => vec![0, 0x04, 0, asked.sa, 0x12, 0x34],
            (_, Some(61 | 62)) => return Some(vec![0xE5]),
            (_, None) => asked.data.iter().map(|octet| octet.wrapping_add(1)).collect(),
            _ => return None,
        };
        let (da, fc, dsap, ssap) = (asked.sa, 0x08, asked.ssap, asked.dsap);
        Telegram::Frame(crate::profibus::Frame { da, sa: SLAVE, fc, dsap, ssap, data }).octets().ok()
    }

    fn step(&mut self, bench: &mut Bench, rate: BusRate) {
        while let Some(burst) = self.door.hear() {
            self.answer = Self::reply(&burst).map(|octets| (bench.now + rate.us_at(self.lag), octets));
        }
        if let Some((_, octets)) = self.answer.take_if(|(at, _)| *at <= bench.now) {
            self.door.send(bench, octets);
        }
    }
}

/// Runs the ring until both masters exchange data. The foreign slave answers after `lag` bits.
fn exchanges(rate: Baudrate, factor: u32, slot_bits: u16, lag: u64) {
    let bit_s = u32::try_from(rate.to_rate()).unwrap();
    let kbit_s = f64::from(bit_s) / 1000.0;
    let mut bench = Bench::with_segment(GATEWAY, &format!("kbit_s = {kbit_s:?}, slot_factor = {factor}"));
    let options = |ident_number, user, config| PeripheralOptions {
        ident_number,
        max_tsdr: 60,
        user_parameters: Some(user),
        config: Some(config),
        ..PeripheralOptions::default()
    };
    let slave = |address, options| {
        Peripheral::new(address, options, vec![0; 2], vec![0; 2]).with_diag_buffer(vec![0; 16])
    };
    let gateway = slave(GATEWAY, options(0x04A4, &[0, 6, 0, 1, 0, 0, 0, 0, 0][..], &CFG[..]));
    let foreign = slave(SLAVE, options(0x1234, &[0][..], &[0x21, 0x11][..]));
    let mut masters = [
        Master::new(&mut bench, rate, 2, slot_bits, gateway),
        Master::new(&mut bench, rate, 3, slot_bits, foreign),
    ];
    let mut slave = Slave { door: Door::come(&mut bench, SLAVE), lag, answer: None };
    let rate = BusRate::new(bit_s).unwrap();
    let step = (1_000_000 / u64::from(bit_s)).max(1);
    masters[0].peripheral().pi_q_mut().copy_from_slice(&[0x12, 0x34]);
    masters[1].peripheral().pi_q_mut().copy_from_slice(&[0x56, 0x78]);
    for _ in 0..400_000 {
        bench.run(step);
        masters.iter_mut().for_each(|master| master.step(&mut bench));
        slave.step(&mut bench, rate);
        let are_in_ring = masters.iter().all(|master| master.fdl.is_in_ring());
        let is_through = bench.registers.outputs(2) == [0x12, 0x34]
            && masters[1].peripheral().pi_i() == [0x57, 0x79]
            && masters.iter_mut().all(|master| master.peripheral().is_running());
        if are_in_ring && is_through {
            assert_eq!(bench.registers.diag.dp_state.load(), dp_state::DATA_EXCHANGE);
            assert_eq!(bench.journal.findings().len(), 0);
            return;
        }
    }
    let rings: Vec<bool> = masters.iter().map(|master| master.fdl.is_in_ring()).collect();
    panic!("no data exchange at {rate:?}, factor {factor}, lag {lag}: in the ring {rings:?}");
}

/// Returns the usual slot time of a rate.
const fn usual(rate: Baudrate) -> u16 {
    match rate {
        Baudrate::B12000000 | Baudrate::B6000000 | Baudrate::B3000000 => 1000,
        _ => 400,
    }
}

#[test]
fn two_foreign_masters_share_a_slow_segment() {
    use Baudrate::{B9600, B19200, B31250, B45450, B93750, B187500};
    for rate in [B9600, B19200, B31250, B45450, B93750, B187500] {
        for factor in [1, 20, 200] {
            exchanges(rate, factor, usual(rate), 0);
        }
    }
}

#[test]
fn two_foreign_masters_share_a_fast_segment() {
    use Baudrate::{B500000, B1500000, B3000000, B6000000, B12000000};
    for rate in [B500000, B1500000, B3000000, B6000000, B12000000] {
        for factor in [1, 20, 200] {
            exchanges(rate, factor, usual(rate), 0);
        }
    }
}

/// A program that takes longer than the usual slot time needs a factor for the slot time. The masters must
/// use the longer slot time, too.
#[test]
fn a_slow_foreign_slave_answers_within_a_longer_slot() {
    exchanges(Baudrate::B500000, 20, 200 * 20, 200 * 10);
}
