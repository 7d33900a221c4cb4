//! Tests a CS0015 on a bus with a test master. The tests check the behaviour that the manual describes, to
//! the microsecond.

mod can_errors;
mod can_jobs;
mod errors;
mod frames;
mod hardware;
mod io_slaves;
mod jobs;
mod master;
mod master_jobs;
mod pdos;
mod peripherals;
mod sdo;
mod settings;
mod states;

use super::config::Cs0015Config;
use super::ram::Registers;
use crate::can::{Frame, Payload};
use crate::devices::cs0015::registers::{DEVICE, FRONT_PROGRAM, FRONT_S1, FRONT_STAT, FRONT_STATE};
use crate::devices::samples::master::{Wires, bus_with, cycle};
use crate::devices::{Bus, Context, Device, FrontAction, Power, fault_kinds};
use crate::fault::{FaultSpec, Faults, Owner};
use crate::identity::DeviceIndex;
use crate::journal::{Journal, Names, Origin};
use crate::layout::DeviceFit;
use crate::memory::Segment;
use embedded_can::{Frame as _, Id, StandardId};
use std::sync::{Arc, Mutex};
use toml::de::ValueDeserializer;

const MS: u64 = 1000;

/// A bus of 125 kbit/s with a CS0015 and a master at it.
struct Bench {
    bus: Box<dyn Bus>,
    device: Box<dyn Device>,
    registers: Registers,
    segment: Segment,
    wires: Arc<Mutex<Wires>>,
    journal: Journal,
    faults: Faults,
    now: u64,
}

impl Bench {
    /// Returns a controller that has just been powered on. In the plant file it has these keys in addition to
    /// its name.
    fn new(keys: &str) -> Self {
        let text = format!("{{ name = 'panel'{}{keys} }}", if keys.is_empty() { "" } else { ", " });
        let config = Cs0015Config::read(ValueDeserializer::parse(&text).unwrap()).unwrap();
        let segment = Segment::of(&DEVICE);
        let (device, plugs) = config.build(DeviceIndex(0), segment.clone()).unwrap();
        let (bus, wires) = bus_with(plugs);
        let registers = Registers::new(&segment).unwrap();
        let (journal, faults) = (Journal::default(), Faults::default());
        let mut bench = Bench { bus, device, registers, segment, wires, journal, faults, now: 0 };
        bench.bus.power_on(1, 0, 0, &mut bench.journal);
        bench.power_on();
        bench
    }

    /// Returns a controller after its reset and the first cycles of its program.
    fn running(keys: &str) -> Self {
        let mut bench = Bench::new(keys);
        bench.run(250 * MS);
        bench.heard();
        bench
    }

    /// Returns a running controller in Operational.
    fn operational(keys: &str) -> Self {
        let mut bench = Bench::running(keys);
        bench.send(0, &[1, 0]);
        bench.run(5 * MS);
        assert_eq!(bench.stat(), "green 2 Hz");
        bench
    }

    fn power_on(&mut self) {
        self.device.set_power(Power::On);
        self.start();
    }

    fn start(&mut self) {
        let origin = Origin::of_device(DeviceIndex(0));
        self.device.start(&mut Context { now: self.now, journal: &mut self.journal, origin, base: 0 });
        self.bus.power_on(0, 0, self.now, &mut self.journal);
    }

    fn stop(&mut self) {
        let origin = Origin::of_device(DeviceIndex(0));
        self.device.stop(&mut Context { now: self.now, journal: &mut self.journal, origin, base: 0 });
        self.bus.power_off(0, self.now, &mut self.journal);
    }

    /// Switches the supply off and on.
    fn power_cycle(&mut self) {
        self.device.set_power(Power::Off);
        self.stop();
        assert_eq!((self.state(), self.stat()), ("off".to_owned(), "dark".to_owned()));
        self.run(10 * MS);
        self.power_on();
        self.run(250 * MS);
        self.heard();
    }

    /// Adds a fault of the device. The words are those of `commram fault add`. Returns the number of the
    /// fault.
    fn fault(&mut self, kind: &str, words: &[&str]) -> u16 {
        let names = Names {
            plcs: vec!["panel".to_owned()],
            buses: vec!["open".to_owned()],
            devices: vec![DeviceFit::unknown(&DEVICE)],
        };
        let words: Vec<_> = words.iter().copied().chain(["plc=panel"]).collect();
        let spec = FaultSpec::from_words(fault_kinds(), kind, &words).unwrap();
        let fault = spec.resolve(fault_kinds(), &names).unwrap();
        let id = self.faults.add(self.now, fault, Owner::Device(DeviceIndex(0)), &mut self.journal).unwrap();
        self.run(MS);
        id
    }

    fn clear_fault(&mut self, id: u16) {
        self.faults.clear(self.now, id, &mut self.journal).unwrap();
        self.device.faults().unwrap().faults_changed(self.now, &self.faults);
        self.run(MS);
    }

    /// Does what a plant does in a processor cycle: applies faults, and restarts a device that was switched
    /// off or on.
    fn look_at_faults(&mut self) {
        let Bench { faults, device, journal, now, .. } = self;
        if faults.next_time() <= *now {
            faults.advance(*now, journal);
            device.faults().unwrap().faults_changed(*now, faults);
        }
        faults.fire_all(*now, journal, |_, target, effect| device.faults()?.fire(*now, target, effect));
        let origin = Origin::of_device(DeviceIndex(0));
        match device.look(&mut Context { now: *now, journal, origin, base: 0 }) {
            FrontAction::Off => self.stop(),
            FrontAction::Up => self.start(),
            _ => {}
        }
    }

    /// Advances the clock by `us` microseconds, with a processor cycle every 500 us.
    fn run(&mut self, us: u64) {
        let end = self.now + us;
        while self.now < end {
            self.look_at_faults();
            let origin = Origin::of_device(DeviceIndex(0));
            let ctx = &mut Context { now: self.now, journal: &mut self.journal, origin, base: 0 };
            self.device.processor_cycle(ctx);
            let until = (self.now + 500).min(end);
            cycle(&mut *self.bus, self.now, until, &mut self.journal, &mut self.faults);
            self.now = until;
        }
    }

    /// Sends a frame from the master.
    fn send(&mut self, id: u16, data: &[u8]) {
        let frame = Frame::standard(id, Payload::new(data).unwrap());
        self.wires.lock().unwrap().to_send.push(frame);
    }

    /// Sends a remote frame from the master.
    fn ask(&mut self, id: u16) {
        let frame = Frame::remote(StandardId::new(id).unwrap(), 1).unwrap();
        self.wires.lock().unwrap().to_send.push(frame);
    }

    /// Returns the frames that the master has received since the last call: identifiers and data.
    fn heard(&mut self) -> Vec<(u16, Vec<u8>)> {
        self.heard_when().into_iter().map(|(_, id, data)| (id, data)).collect()
    }

    /// Like `heard`, with times.
    fn heard_when(&mut self) -> Vec<(u64, u16, Vec<u8>)> {
        self.wires.lock().unwrap().take_heard()
    }

    /// Sends a frame and returns the frames heard within 5 ms.
    fn exchange(&mut self, id: u16, data: &[u8]) -> Vec<(u16, Vec<u8>)> {
        self.send(id, data);
        self.run(5 * MS);
        self.heard()
    }

    fn front(&self, word: usize) -> String {
        let word = DEVICE.front.iter().find(|known| known.index() == word).unwrap();
        word.called(self.registers.shown(word.index()).load())
    }

    fn state(&self) -> String {
        self.front(FRONT_STATE)
    }

    fn stat(&self) -> String {
        self.front(FRONT_STAT)
    }

    /// Sets a switch or a command at the front panel.
    fn set(&mut self, word: usize, value: u32) {
        self.registers.shown(word).store(value);
        self.run(MS);
    }

    /// Gives a command of the programming system, with S1 at UNLOCK.
    fn command(&mut self, command: u32) {
        self.set(FRONT_S1, 1);
        self.set(FRONT_PROGRAM, command);
        assert_eq!(self.registers.shown(FRONT_PROGRAM).load(), 0, "it is answered");
    }

    /// Gives an order with data, at this place of the job block.
    fn order_with(&self, place: usize, function: u16, arguments: &[u32], data: &[u8]) {
        let jobs = &self.registers.jobs;
        jobs.a_LENGTH[place].store(data.len() as u16);
        jobs.a_DATA[place].iter().zip(data).for_each(|(cell, byte)| cell.store(*byte));
        self.order(place, function, arguments);
    }

    /// Gives an order with the present data.
    fn order(&self, place: usize, function: u16, arguments: &[u32]) {
        let jobs = &self.registers.jobs;
        jobs.a_FUNCTION[place].store(function);
        jobs.a_ARGUMENT[place].iter().zip(arguments).for_each(|(cell, value)| cell.store(*value));
        jobs.a_ORDER[place].store(jobs.d_ORDERS.update(|orders| orders.wrapping_add(1)));
        jobs.a_CONTROL[place].store(5);
    }

    /// Gives an order and waits for the answer; returns the error and the results.
    fn job(&mut self, function: u16, arguments: &[u32]) -> (u8, Vec<u32>) {
        self.order(0, function, arguments);
        self.run(MS);
        let jobs = &self.registers.jobs;
        assert_eq!(jobs.a_CONTROL[0].load(), 4, "it is answered");
        (jobs.a_ERROR[0].load(), jobs.a_RESULT[0].iter().map(|cell| cell.load()).collect())
    }

    /// Returns the first result of an order.
    fn result(&mut self, function: u16, arguments: &[u32]) -> u32 {
        let (error, results) = self.job(function, arguments);
        assert_eq!(error, 0);
        results[0]
    }

    /// Returns the data of the last answer at the first place.
    fn answer_data(&self) -> Vec<u8> {
        let jobs = &self.registers.jobs;
        jobs.a_DATA[0].iter().take(jobs.a_LENGTH[0].load().into()).map(|cell| cell.load()).collect()
    }

    /// True if the order at this place of the job block has been answered.
    fn is_answered(&self, place: usize) -> bool {
        self.registers.jobs.a_CONTROL[place].load() == 4
    }
}
