//! A foreign DP master commands the slave. The master is `profirust` on its own simulated line, which checks
//! the time before an answer and passes octets on one by one.

use super::*;
use crate::devices::can_dp2::emulation::firmware::dp_port::DpPort;
use crate::devices::can_dp2::emulation::firmware::gateway::Gateway;
use crate::devices::can_dp2::emulation::firmware::{Shared, lock, share};
use crate::devices::can_dp2::registers::values::{bus_state, dp_state};
use crate::devices::profibus_bus::{ProfibusPort, Station as Line};
use crate::identity::{DeviceIndex, PortNumber};
use crate::profibus::{BusRate, Telegram};
use profirust::dp::{
    DiagnosticFlags, DpMaster, Peripheral, PeripheralEvent, PeripheralHandle, PeripheralOptions,
};
use profirust::fdl::{FdlActiveStation, ParametersBuilder};
use profirust::phy::{ProfibusPhy, SimulatorPhy};
use profirust::time::{Duration, Instant};

/// The user's octets of Set_Prm. They are those of the device description file, but with CAN-Diagnosis on.
const USER: [u8; 9] = [0, 6, 0, 1, 1, 0, 0, 0, 0];

/// The master, the slave and the line between them.
struct Ring {
    fdl: FdlActiveStation,
    dp: DpMaster<'static>,
    handle: PeripheralHandle,
    master_phy: SimulatorPhy,
    slave_phy: SimulatorPhy,
    rate: BusRate,
    slave: DpPort,
    line: Line,
    gateway: Shared,
    registers: Registers,
    journal: Journal,
    answer: Option<(u64, Vec<u8>)>,
    events: Vec<PeripheralEvent>,
    now: u64,
}

impl Ring {
    fn new(rate: profirust::Baudrate, user: &'static [u8], cfg: &'static [u8]) -> Self {
        let bit_s = u32::try_from(rate.to_rate()).unwrap();
        let rate_of_ours = BusRate::new(bit_s).unwrap();
        let options = PeripheralOptions {
            ident_number: 0x04A4,
            max_tsdr: 60,
            user_parameters: Some(user),
            config: Some(cfg),
            ..PeripheralOptions::default()
        };
        let mut dp = DpMaster::new(vec![]);
        let peripheral = Peripheral::new(5, options, vec![0; 2], vec![0; 2]).with_diag_buffer(vec![0; 16]);
        let handle = dp.add(peripheral);
        let parameters = ParametersBuilder::new(2, rate)
            .slot_bits(if bit_s > 1_500_000 { 1000 } else { 400 })
            .highest_station_address(10)
            .watchdog_timeout(Duration::from_millis(500))
            .build_verified(&dp);
        let mut fdl = FdlActiveStation::new(parameters);
        fdl.set_online();
        dp.enter_operate();
        let master_phy = SimulatorPhy::new(rate, "profirust");
        let slave_phy = master_phy.duplicate("gateway");
        let segment = Segment::of(&DEVICE);
        let registers = || Registers::new(&segment).unwrap();
        let gateway = share(Gateway::new(registers()));
        let mut slave = DpPort::new(registers(), gateway.clone());
        let (mut journal, mut line) = (Journal::default(), Line::alone(rate_of_ours));
        registers().shown(FRONT_SWITCHES).store(5);
        let origin = Origin { plc: DeviceIndex(0), node: PortNumber(1) };
        slave.power_on(&mut Context { now: 0, journal: &mut journal, origin, base: 0 }, &mut line);
        Ring {
            fdl,
            dp,
            handle,
            master_phy,
            slave_phy,
            rate: rate_of_ours,
            slave,
            line,
            gateway,
            registers: registers(),
            journal,
            answer: None,
            events: Vec::new(),
            now: 0,
        }
    }

    /// Advances the time by one step. With `is_working`, the master works during this step; otherwise it is
    /// silent.
    fn step(&mut self, is_working: bool) {
        self.now += u64::from(1_000_000 / self.rate.bit_s() / 2).max(1);
        let now = Instant::from_micros(i64::try_from(self.now).unwrap());
        self.master_phy.set_bus_time(now);
        if is_working {
            self.fdl.poll(now, &mut self.master_phy, &mut self.dp);
            self.events.extend(self.dp.take_last_events().peripheral.map(|(_, event)| event));
        }
        if self.slave_phy.poll_transmission(now) {
            return;
        }
        let origin = Origin { plc: DeviceIndex(0), node: PortNumber(1) };
        let ctx = &mut Context { now: self.now, journal: &mut self.journal, origin, base: 0 };
        if self.slave.next_time() <= self.now {
            self.slave.due(ctx, &mut self.line);
        }
        if let Some((at, _)) = &self.answer {
            if self.rate.us_at(*at) <= self.now {
                let octets = self.answer.take().unwrap().1;
                self.slave_phy.transmit_data(now, |buffer| {
                    buffer[..octets.len()].copy_from_slice(&octets);
                    (octets.len(), ())
                });
            }
            return;
        }
        let telegram =
            self.slave_phy.receive_data(now, |octets| match profirust::fdl::Telegram::deserialize(octets) {
                None => (0, None),
                Some(Err(_)) => (octets.len(), None),
                Some(Ok((_, length))) => (length, Some(Telegram::parse(&octets[..length]).unwrap())),
            });
        if let Some(telegram) = telegram {
            // On this line the last octet is available up to half a bit before its end, so the line is
            // advanced by one more bit.
            self.line.at(self.rate.bits_at(self.now) + 1);
            self.slave.heard(ctx, &mut self.line, &telegram);
            self.answer = self.line.intended();
        }
    }

    /// Advances the time until the condition is true.
    fn until(&mut self, what: &str, is_so: impl Fn(&mut Ring) -> bool) {
        for _ in 0..2_000_000 {
            self.step(true);
            if is_so(self) {
                return;
            }
        }
        let state = self.registers.diag.dp_state.load();
        panic!("never: {what}; {:?}, state {state}", self.peripheral().last_diagnostics());
    }

    fn peripheral(&mut self) -> &mut Peripheral<'static> {
        self.dp.get_mut(self.handle)
    }

    /// Returns the module's own diagnosis that the master has read.
    fn own_diagnosis(&mut self) -> Vec<u8> {
        let diagnostics = self.peripheral().last_diagnostics();
        diagnostics.map_or_else(Vec::new, |it| {
            it.extended_diagnostics.raw_diag_buffer().unwrap_or_default().to_vec()
        })
    }

    fn flags(&mut self) -> DiagnosticFlags {
        self.peripheral().last_diagnostics().map_or(DiagnosticFlags::empty(), |it| it.flags)
    }
}

fn exchanges_at(rate: profirust::Baudrate) {
    let mut ring = Ring::new(rate, &USER, &CFG);
    ring.until("data exchange", |ring| ring.peripheral().is_running());
    assert_eq!(ring.registers.diag.dp_state.load(), dp_state::DATA_EXCHANGE);
    ring.peripheral().pi_q_mut().copy_from_slice(&[0x12, 0x34]);
    ring.registers.set_inputs(0, &[0x56, 0x78]);
    ring.until("outputs", |ring| ring.registers.outputs(2) == [0x12, 0x34]);
    ring.until("inputs", |ring| ring.peripheral().pi_i() == [0x56, 0x78]);
    assert_eq!(ring.registers.diag.station_status_2.load(), 0x0C, "with its watchdog");
}

#[test]
fn a_foreign_master_exchanges_data_at_slow_rates() {
    use profirust::Baudrate;
    for rate in [Baudrate::B9600, Baudrate::B19200, Baudrate::B45450, Baudrate::B93750, Baudrate::B187500] {
        exchanges_at(rate);
    }
}

#[test]
fn a_foreign_master_exchanges_data_at_fast_rates() {
    use profirust::Baudrate;
    for rate in
        [Baudrate::B500000, Baudrate::B1500000, Baudrate::B3000000, Baudrate::B6000000, Baudrate::B12000000]
    {
        exchanges_at(rate);
    }
}

#[test]
fn a_foreign_master_sees_wrong_parameters() {
    let mut ring = Ring::new(profirust::Baudrate::B500000, &[0, 14, 0, 1, 1, 0, 0, 0, 0], &CFG);
    ring.until("a diagnosis", |ring| !ring.own_diagnosis().is_empty());
    assert_eq!(ring.own_diagnosis(), [5, 4, 0x3D, 8, 6]);
    assert!(ring.flags().contains(DiagnosticFlags::PARAMETER_FAULT | DiagnosticFlags::EXT_DIAG));
    assert!(!ring.peripheral().is_running());
}

#[test]
fn a_foreign_master_sees_a_wrong_configuration() {
    let mut ring =
        Ring::new(profirust::Baudrate::B500000, &USER, &[0x83, 1, 2, 3, 0, 0x43, 0x41, 2, 0x89, 0]);
    ring.until("a diagnosis", |ring| !ring.own_diagnosis().is_empty());
    assert_eq!(ring.own_diagnosis(), [5, 4, 0x3E, 1, 2]);
    assert!(ring.flags().contains(DiagnosticFlags::CONFIGURATION_FAULT | DiagnosticFlags::EXT_DIAG));
    assert!(!ring.peripheral().is_running());
}

#[test]
fn a_foreign_master_sees_the_state_of_the_can_bus() {
    let mut ring = Ring::new(profirust::Baudrate::B500000, &USER, &CFG);
    ring.until("data exchange", |ring| ring.peripheral().is_running());
    ring.events.clear();
    lock(&ring.gateway).lost_frame();
    lock(&ring.gateway).set_bus(bus_state::ERROR_PASSIVE);
    ring.until("a diagnosis", |ring| ring.own_diagnosis() == [5, 4, 0x80, 1, 0]);
    assert!(ring.events.contains(&PeripheralEvent::Diagnostics));
    assert!(ring.peripheral().is_running());
}

#[test]
fn the_watchdog_notices_a_missing_foreign_master() {
    let mut ring = Ring::new(profirust::Baudrate::B500000, &USER, &CFG);
    ring.until("data exchange", |ring| ring.peripheral().is_running());
    let end = ring.now + 600_000;
    while ring.now < end {
        ring.step(false);
    }
    assert_eq!(ring.registers.diag.dp_state.load(), dp_state::BAUD_SEARCH);
    ring.events.clear();
    ring.until("the watchdog has run out", |ring| {
        ring.registers.diag.dp_state.load() == dp_state::DATA_EXCHANGE
    });
    ring.until("data exchange", |ring| ring.events.contains(&PeripheralEvent::DataExchanged));
}
