//! First exchange of a program with a device. `commram new` writes it as a scenario, as a test and as a program.

/// A handshake with a device. It takes place directly after an emulator has started with the device's
/// template plant ([`Emulation::template`](super::Emulation)). Names of registers do not contain the PLC.
#[derive(Clone, Copy, Debug)]
pub struct FirstExchange {
    /// Registers that the program writes, in this order, with their values.
    pub writes: &'static [(&'static str, u32)],
    /// Register in which the firmware answers, and the answer.
    pub answer: (&'static str, u32),
    /// Longest emulated time until the answer, in the notation of scenarios: `1ms`.
    pub within: &'static str,
}
