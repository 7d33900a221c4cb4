//! A soft-PLC for @title@: writes registers of PLC `@plc@` in the shared memory, and waits for the answer of the firmware.
//!
//!     commram with plant.toml -- cargo run

use commram::devices::attach;
use commram::layout::DeviceFit;
use commram::layout::place::NamedLocation;
use commram::memory::AttachMode;
use std::error::Error;
use std::time::Duration;

/// Longest wait for an answer, in real time.
const PATIENCE: Duration = Duration::from_secs(10);

fn main() -> Result<(), Box<dyn Error>> {
    let instance = std::env::var("COMMRAM_INSTANCE").unwrap_or_else(|_| "default".to_owned());
    let (ram, layout) = attach(&instance, "@plc@", AttachMode::ReadWrite)?;
    let device = DeviceFit::unknown(layout);
    let register = |name| NamedLocation::parse(&device, name);
    for (name, value) in [@writes_rust@] {
        let written = register(name)?;
        ram.segment().store(written.offset(), written.width(), value)?;
    }
    // The bell makes the firmware poll at once, instead of in its next processor cycle.
    ram.ring()?;
    let answer = register("@answer@")?;
    let value = ram.wait_register(answer.offset(), answer.width(), PATIENCE, |value| value == @answered@)?;
    println!("@answer@ = {value:#06x}");
    Ok(())
}
