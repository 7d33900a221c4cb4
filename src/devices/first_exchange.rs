//! First exchange of a program with a device: what `commram new` writes as a scenario, as a test and as a program.

/// A handshake with a device in the plant of its template ([`Emulation::template`](super::Emulation)), from the start of
/// the emulator on. Registers have no PLC in front.
#[derive(Clone, Copy, Debug)]
pub struct FirstExchange {
    /// Registers that the program writes, in this order, with their values.
    pub writes: &'static [(&'static str, u32)],
    /// Register in which the firmware answers, and its answer.
    pub answer: (&'static str, u32),
    /// Longest emulated time until the answer, in the form of scenarios: `1ms`.
    pub within: &'static str,
}
