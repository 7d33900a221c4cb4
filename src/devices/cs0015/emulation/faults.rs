//! Fault kinds of a CS0015: the conditions that its operating system checks (p. 18-19, 44).

use crate::fault::{self, Fault, FaultKind, Field, Form, TargetKind};

/// Number of outputs of the device.
pub(super) const OUTPUTS: u8 = 16;

/// Effect of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    /// A short circuit at this output, 0 to 15.
    ShortCircuit(u8),
    /// A broken wire at this output, 0 to 15.
    WireBreak(u8),
    /// A fault of the supply.
    Supply(SupplyFault),
    /// A temperature above 85 degrees.
    Hot,
    /// An error in the memory.
    Memory,
    /// An error after which the device cannot continue.
    Fatal,
    /// The CAN controller cannot be initialised.
    NoCan,
    /// The program does not reach the end of a cycle.
    Hang,
}

/// Fault of the supply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SupplyFault {
    /// The voltage is too low or too high.
    Voltage,
    /// The supply is off.
    Gone,
}

/// Names of the faults of the supply; a fault stores the index.
const WRONG: &[&str] = &["under", "over", "drop"];

const OUTPUT: Field =
    Field::new("output", Form::Number { least: 0, most: OUTPUTS as u64 - 1 }, "Number of the output")
        .required("give the number of the output, 0 to 15");

fn output(fault: &Fault) -> u8 {
    fault.value(OUTPUT.name()).unwrap_or(0) as u8
}

static SHORT_CIRCUIT: FaultKind = FaultKind::new(
    40,
    "short_circuit",
    TargetKind::Device,
    "An output of a CS0015 has a short circuit and switches itself off",
    |fault| fault::Effect::new(Effect::ShortCircuit(output(fault))),
)
.with(const { &[OUTPUT] })
.without_hits()
.shown("output=3 duration=2s");

static WIRE_BREAK: FaultKind = FaultKind::new(
    41,
    "wire_break",
    TargetKind::Device,
    "Nothing is connected to an output of a CS0015 any more",
    |fault| fault::Effect::new(Effect::WireBreak(output(fault))),
)
.with(const { &[OUTPUT] })
.without_hits()
.shown("output=3 duration=2s");

static SUPPLY: FaultKind = FaultKind::new(
    42,
    "supply",
    TargetKind::Device,
    "The supply of a CS0015 is too low, too high or gone",
    |fault| {
        let wrong = if fault.value("what") == Some(2) { SupplyFault::Gone } else { SupplyFault::Voltage };
        fault::Effect::new(Effect::Supply(wrong))
    },
)
.with(
    const {
        &[Field::new("what", Form::Word(WRONG), "Too low, too high, or gone")
            .required("give under, over or drop")]
    },
)
.without_hits()
.shown("what=drop duration=100ms");

static TEMPERATURE: FaultKind =
    FaultKind::new(43, "temperature", TargetKind::Device, "A CS0015 is warmer than 85 degrees", |_| {
        fault::Effect::new(Effect::Hot)
    })
    .without_hits()
    .shown("duration=10s");

static MEMORY: FaultKind =
    FaultKind::new(44, "memory", TargetKind::Device, "A CS0015 finds an error in its memory", |_| {
        fault::Effect::new(Effect::Memory)
    })
    .once()
    .shown("at=2s");

static FATAL: FaultKind = FaultKind::new(
    45,
    "fatal",
    TargetKind::Device,
    "A CS0015 finds an error after which it cannot continue",
    |_| fault::Effect::new(Effect::Fatal),
)
.once()
.shown("at=2s");

static CAN_INIT: FaultKind = FaultKind::new(
    46,
    "can_init",
    TargetKind::Device,
    "The CAN controller of a CS0015 cannot be initialised: after a reset or CAN_RESTART it is not at its bus",
    |_| fault::Effect::new(Effect::NoCan),
)
.without_hits()
.shown("duration=10s");

static HANG: FaultKind = FaultKind::new(
    63,
    "hang",
    TargetKind::Device,
    "The program of a CS0015 does not end its cycle: after 200 ms the watchdog resets the device",
    |_| fault::Effect::new(Effect::Hang),
)
.without_hits()
.shown("duration=1s");

/// All kinds of faults of the device.
pub(crate) static KINDS: &[&FaultKind] =
    &[&SHORT_CIRCUIT, &WIRE_BREAK, &SUPPLY, &TEMPERATURE, &MEMORY, &FATAL, &CAN_INIT, &HANG];
