//! A device of another crate: sends the values of its program on a CAN bus, and stores received values in registers.

use commram::can::{Filter, Frame, Payload, StandardId};
use commram::devices::can_bus::{self, CanDevice, CanPort, Controller};
use commram::devices::{Context, Emulation, Registered};
use commram::journal::{EventCodec, EventText, Fields, Reader};
use commram::layout::{DeviceLayout, RegisterPhase};
use commram::memory::{Header, MemoryError, Segment, View};

#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/gate.rs"));
}
use registers::{FRONT_PASSED, GATE_IN, GATE_OUT, IN, OUT};

commram::event_kinds! {
    /// A value was received.
    Passed = 200, "passed", Rare, at origin { value: u16, }
}

impl EventText for Passed {
    fn text(&self, _: &mut Reader) -> String {
        format!("{} has passed the gate", self.value)
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("value", self.value)
    }
}

commram::rules! {
    NOTHING: 200, "gate-nothing", Warning, "p. 4", "The value to be sent is 0. Store a value before 16#05.";
}

/// The entry in the registry.
pub static GATE: Registered = Registered {
    emulation: Emulation { records: &[Passed::KIND], rules: ALL, ..Emulation::of(can_bus::read::<Gate>) },
    ..Registered::new(&registers::DEVICE)
};

/// The firmware.
pub struct Gate(View<GATE_IN>, View<GATE_OUT>, View<Header>);
commram::snapshot_fields!(Gate { built: 0, 1, 2 });
impl CanDevice for Gate {
    const LAYOUT: &'static DeviceLayout = &registers::DEVICE;

    fn new(segment: &Segment) -> Result<Self, MemoryError> {
        Ok(Gate(segment.view(IN)?, segment.view(OUT)?, segment.header()?))
    }
}

impl CanPort for Gate {
    fn power_on(&mut self, _: &mut Context, controller: &mut Controller, _: u8) {
        controller.set_filters(StandardId::new(0x123).map(Filter::exactly));
    }

    fn look(&mut self, ctx: &mut Context, controller: &mut Controller) {
        if self.1.w_SEND.load() != 0x05 {
            return;
        }
        let value = self.1.w_VALUE.load();
        if value == 0 {
            ctx.find(&NOTHING, RegisterPhase::ALWAYS, std::mem::offset_of!(GATE_OUT, w_VALUE), 0);
        }
        let frame = Frame::standard(0x123, Payload::from_words([value, 0, 0, 0], 1));
        if controller.send(frame).is_ok() && self.1.w_SEND.compare_exchange(0x05, 0x04).is_ok() {
            ctx.answered(std::mem::offset_of!(GATE_OUT, w_SEND), 0x05, 0x04);
        }
    }

    fn received(&mut self, ctx: &mut Context, _: &mut Controller, frame: &Frame) {
        let Some(value) = frame.payload().word(0) else { return };
        self.0.w_VALUE.store(value);
        self.2.front[FRONT_PASSED].increment();
        ctx.report(Passed { origin: ctx.origin, value });
    }
}
