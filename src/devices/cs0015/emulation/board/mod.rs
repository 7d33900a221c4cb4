//! The board of a CS0015 except its CAN interface: supply, inputs, outputs, display, RS 232 and memory.

pub(super) mod command;
pub(super) mod eeprom;
pub(super) mod events;
pub(super) mod fast_inputs;
pub(super) mod hardware;
pub(super) mod interrupt;
pub(super) mod lcd;
pub(super) mod peripherals;
pub(super) mod pwm;
pub(super) mod retained;
pub(super) mod serial;
pub(super) mod slow_inputs;
pub(super) mod watch;
