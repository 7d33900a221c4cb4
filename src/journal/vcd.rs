//! Value change dumps (IEEE 1364), which GTKWave, Surfer and other viewers of waveforms read. Times are emulated
//! microseconds since power-on. A signal without a value yet is unknown (`x`).

use super::waves::{Change, Content, Shape, Step, Waves};
use std::io;
use vcd::{IdCode, SimulationCommand, TimescaleUnit, Value, VarType, Writer};

/// Writes waveforms as a value change dump.
///
/// # Errors
/// Returns the errors of `out`.
pub fn write(waves: &Waves, out: impl io::Write) -> io::Result<()> {
    let mut writer = Writer::new(out);
    writer.version(concat!("commram ", env!("CARGO_PKG_VERSION")))?;
    writer.timescale(1, TimescaleUnit::US)?;
    let codes = define(waves, &mut writer)?;
    writer.enddefinitions()?;
    writer.timestamp(waves.changes.first().map_or(0, |first| first.time_us))?;
    writer.begin(SimulationCommand::Dumpvars)?;
    for (code, signal) in codes.iter().zip(&waves.signals) {
        match signal.shape {
            Shape::Bits(width) => {
                writer.change_vector(*code, std::iter::repeat_n(Value::X, width as usize))?
            }
            Shape::Text => writer.change_string(*code, "")?,
            Shape::Event => {}
        }
    }
    writer.end()?;
    let mut now = None;
    for Change { time_us, signal, content } in &waves.changes {
        let Some(code) = codes.get(*signal) else { continue };
        if now != Some(*time_us) {
            writer.timestamp(*time_us)?;
            now = Some(*time_us);
        }
        match content {
            Content::Bits { width, value, known } => {
                writer.change_vector(*code, bits(*width, *value, *known))?;
            }
            Content::Text(text) => writer.change_string(*code, text)?,
            Content::Event => writer.change_scalar(*code, Value::V1)?,
        }
    }
    writer.flush()
}

/// Declares the signals, scope by scope; the codes are in the order of their numbers.
fn define(waves: &Waves, writer: &mut Writer<impl io::Write>) -> io::Result<Vec<IdCode>> {
    let mut codes = vec![IdCode::FIRST; waves.signals.len()];
    for step in waves.outline() {
        match step {
            Step::Into(scope) => writer.add_module(scope)?,
            Step::Out => writer.upscope()?,
            Step::Signal(number, name) => {
                let (kind, width) = match waves.signals[number].shape {
                    Shape::Bits(width) => (VarType::Reg, width),
                    Shape::Text => (VarType::String, 1),
                    Shape::Event => (VarType::Event, 1),
                };
                codes[number] = writer.add_var(kind, width, name, None)?;
            }
        }
    }
    Ok(codes)
}

/// The highest bit first.
fn bits(width: u32, value: u64, known: u64) -> impl Iterator<Item = Value> {
    let bit = move |bit: u32| match known >> bit & 1 {
        0 => Value::X,
        _ => (value >> bit & 1 == 1).into(),
    };
    (0..width).rev().map(bit)
}
