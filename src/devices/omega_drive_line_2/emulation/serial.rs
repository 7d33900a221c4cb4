//! The RS485 port (manual 5.00005.03a p. 18, 24-26): a UART with a ring of characters for each direction (decision
//! D-855).
//!
//! The counters of a ring are the numbers of all characters since the start of the device, modulo 65536. The firmware
//! counts its own characters in memory of its own, so a program that overwrites a counter does not lead it astray.

use super::plc::SERIAL;
use crate::devices::omega_drive_line_2::registers::values::{
    serial_control, serial_parity, serial_received, serial_resistors, serial_status, serial_transmitted,
};
use crate::devices::omega_drive_line_2::registers::{DEVICE, SERIAL as AREA, SERIAL_BMSTRUCT};
use crate::devices::serial_bus::records::{SerialOverrun, SerialSetup, SetupNews};
use crate::devices::serial_bus::{FAMILY, LineState, PortSetup, SerialPort, SerialSocket, rules};
use crate::devices::{BuildError, Context, Plug};
use crate::identity::DeviceIndex;
use crate::journal::{Origin, Rule};
use crate::layout::RegisterPhase;
use crate::memory::{Segment, View};
use crate::serial::{CharacterError, CharacterFormat, Parity, Received, Signal, Wires};
use crate::snapshot_fields;
use core::mem::offset_of;

/// Number of characters in a ring.
const RING: u16 = 256;

/// Returns the element of a ring for character number `number`.
fn element(number: u16) -> usize {
    usize::from(number % RING)
}

/// The registers that the firmware polls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
struct Polled {
    is_on: bool,
    tx_head: u16,
}

/// The firmware of the port.
pub(super) struct Serial {
    registers: View<SERIAL_BMSTRUCT>,
    /// Registers at the last poll.
    polled: Polled,
    setup: Option<PortSetup>,
    /// Number of characters that the port has taken from `a_TX`.
    sent: u16,
    /// Number of characters that the port has put into `a_RX`.
    received: u16,
    /// Bits of `w_STATUS`.
    status: u16,
    /// True if characters were lost since the last character in `a_RX`.
    has_lost: bool,
}

snapshot_fields!(Serial {
    values: polled, setup, sent, received, status, has_lost;
    built: registers
});

impl Serial {
    /// Returns the port of a device, which is connected to `bus`.
    ///
    /// # Errors
    /// The image is too small for the registers, or is read-only.
    pub(super) fn plug(
        device: DeviceIndex,
        segment: &Segment,
        bus: Option<&str>,
    ) -> Result<Plug, BuildError> {
        let port = Box::new(Serial {
            registers: segment.view(AREA)?,
            polled: Polled::default(),
            setup: None,
            sent: 0,
            received: 0,
            status: 0,
            has_lost: false,
        });
        let origin = Origin { plc: device, node: SERIAL };
        let socket = SerialSocket { origin, segment: segment.clone(), layout: &DEVICE, port };
        Ok(Plug { number: SERIAL, family: FAMILY, bus: bus.map(str::to_owned), socket: Box::new(socket) })
    }

    /// Reads the registers that the firmware polls.
    fn poll(&self) -> Polled {
        let is_on = self.registers.w_CONTROL.load() & serial_control::ON != 0;
        Polled { is_on, tx_head: self.registers.u_TX_HEAD.load() }
    }

    /// Returns the settings in the registers, if the port has such settings.
    fn settings(&self) -> Option<PortSetup> {
        let registers = &*self.registers;
        let parity = match registers.b_PARITY.load() {
            serial_parity::NONE => Parity::None,
            serial_parity::ODD => Parity::Odd,
            serial_parity::EVEN => Parity::Even,
            _ => return None,
        };
        let (baud_rate, data_bits) = (registers.u_BAUD_RATE.load().into(), registers.us_DATA_BITS.load());
        let format = CharacterFormat::new(baud_rate, data_bits, parity, registers.us_STOP_BITS.load())?;
        let resistors = registers.b_RESISTORS.load();
        Some(PortSetup {
            format,
            wires: Wires::of_count(registers.us_WIRES.load())?,
            has_pull: resistors & serial_resistors::PULL != 0,
            is_terminated: resistors & serial_resistors::TERMINATION != 0,
        })
    }

    /// Takes over the settings, because bit 0 of `w_CONTROL` was set.
    fn switch_on(&mut self, ctx: &mut Context) {
        self.setup = self.settings();
        if self.setup.is_some() {
            self.status = serial_status::READY;
            self.report(ctx, SetupNews::Ready);
        } else {
            self.status = serial_status::REFUSED;
            let baud_rate = self.registers.u_BAUD_RATE.load();
            find(ctx, &rules::SERIAL_SETTINGS, offset_of!(SERIAL_BMSTRUCT, u_BAUD_RATE), baud_rate.into());
            self.report(ctx, SetupNews::Refused);
        }
        self.has_lost = false;
    }

    fn switch_off(&mut self, ctx: &mut Context) {
        self.status = 0;
        if self.setup.take().is_some() {
            self.report(ctx, SetupNews::Off);
        }
    }

    fn report(&self, ctx: &mut Context, state: SetupNews) {
        let registers = &*self.registers;
        let format = [
            registers.us_DATA_BITS.load(),
            registers.b_PARITY.load(),
            registers.us_STOP_BITS.load(),
            registers.us_WIRES.load(),
        ];
        ctx.report(SerialSetup {
            origin: ctx.origin,
            state,
            baud_rate: registers.u_BAUD_RATE.load().into(),
            format: u32::from_le_bytes(format),
            resistors: registers.b_RESISTORS.load(),
        });
    }

    /// Number of characters in `a_TX` that the port has not taken yet.
    fn waiting(&self) -> u16 {
        self.polled.tx_head.wrapping_sub(self.sent)
    }

    /// Shows the counters after the characters that they count.
    fn show(&self) {
        let registers = &*self.registers;
        registers.u_TX_TAIL.store(self.sent);
        registers.u_RX_HEAD.store(self.received);
        registers.w_STATUS.store(self.status);
    }
}

/// Reports a broken rule at a register of the structure.
fn find(ctx: &mut Context, rule: &'static Rule, offset: usize, value: u32) {
    ctx.find(rule, RegisterPhase::ALWAYS, offset, value);
}

impl SerialPort for Serial {
    fn power_off(&mut self) {
        self.registers.reset_from(0);
        (self.polled, self.setup) = (Polled::default(), None);
        (self.sent, self.received, self.status, self.has_lost) = (0, 0, 0, false);
    }

    fn look(&mut self, ctx: &mut Context) {
        let polled = self.poll();
        let was_on = core::mem::replace(&mut self.polled, polled).is_on;
        if was_on != self.polled.is_on {
            if was_on { self.switch_off(ctx) } else { self.switch_on(ctx) }
        }
        if self.waiting() > RING {
            let at = offset_of!(SERIAL_BMSTRUCT, u_TX_HEAD);
            find(ctx, &rules::SERIAL_RING, at, self.polled.tx_head.into());
            self.sent = self.polled.tx_head;
        }
        self.show();
    }

    fn has_changed(&self) -> bool {
        self.poll() != self.polled
    }

    fn setup(&self) -> Option<PortSetup> {
        self.setup
    }

    fn has_to_send(&self) -> bool {
        self.setup.is_some() && self.waiting() > 0
    }

    fn take_to_send(&mut self) -> Option<Signal> {
        if !self.has_to_send() {
            return None;
        }
        let character = self.registers.a_TX[element(self.sent)].load();
        self.sent = self.sent.wrapping_add(1);
        self.status |= serial_status::SENDING;
        self.show();
        Some(if character & serial_transmitted::BREAK != 0 {
            Signal::Break
        } else {
            let [octet, _] = character.to_le_bytes();
            Signal::Octet(octet)
        })
    }

    fn judge_line(&mut self, ctx: &mut Context, line: &LineState) {
        let Some(setup) = self.setup else { return };
        if setup.format != line.format {
            let value = setup.format.baud_rate().into();
            find(ctx, &rules::SERIAL_FORMAT, offset_of!(SERIAL_BMSTRUCT, u_BAUD_RATE), value);
        }
        if setup.wires != line.wires {
            let value = setup.wires.count().into();
            find(ctx, &rules::SERIAL_WIRES, offset_of!(SERIAL_BMSTRUCT, us_WIRES), value);
        }
        let resistors = self.registers.b_RESISTORS.load().into();
        let at = offset_of!(SERIAL_BMSTRUCT, b_RESISTORS);
        if line.terminators != 2 {
            find(ctx, &rules::SERIAL_TERMINATION, at, resistors);
        }
        // On four wires the transmitters are always active, so the line has a potential without the resistors.
        if line.pulls > 2 || line.pulls == 0 && line.wires == Wires::Two {
            find(ctx, &rules::SERIAL_PULL, at, resistors);
        }
    }

    fn sent(&mut self, ctx: &mut Context, has_collided: bool) {
        if has_collided {
            let at = offset_of!(SERIAL_BMSTRUCT, u_TX_HEAD);
            find(ctx, &rules::SERIAL_COLLISION, at, self.sent.into());
        }
        // The firmware looks for the next character as soon as a character has ended, not only when it polls.
        self.polled.tx_head = self.registers.u_TX_HEAD.load();
        if !self.has_to_send() {
            self.status &= !serial_status::SENDING;
        }
        self.show();
    }

    fn received(&mut self, ctx: &mut Context, received: Received) {
        let tail = self.registers.u_RX_TAIL.load();
        let unread = self.received.wrapping_sub(tail);
        if unread >= RING {
            if unread > RING {
                find(ctx, &rules::SERIAL_RING, offset_of!(SERIAL_BMSTRUCT, u_RX_TAIL), tail.into());
            }
            self.status |= serial_status::OVERRUN;
            self.has_lost = true;
            self.show();
            ctx.report(SerialOverrun { origin: ctx.origin });
            return;
        }
        let error = match received.error {
            None => 0,
            Some(CharacterError::Break) => serial_received::BREAK,
            Some(CharacterError::Framing) => serial_received::FRAMING,
            Some(CharacterError::Parity) => serial_received::PARITY,
            Some(CharacterError::Overrun) => serial_received::OVERRUN,
        };
        let lost = if core::mem::take(&mut self.has_lost) { serial_received::OVERRUN } else { 0 };
        self.registers.a_RX[element(self.received)].store(u16::from(received.octet) | error | lost);
        self.received = self.received.wrapping_add(1);
        self.show();
    }
}
