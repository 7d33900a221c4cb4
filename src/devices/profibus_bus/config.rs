//! A PROFIBUS segment as the plant file describes it.

use super::{FAMILY, ProfibusBus};
use crate::devices::emulation::settings::keys::plant_keys;
use crate::devices::emulation::settings::refused_at;
use crate::devices::{BuildError, Bus, BusSection};
use crate::door::DoorSpec;
use crate::identity::BusIndex;
use crate::profibus::BusRate;
use serde::Deserialize;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{Error, ValueDeserializer};

/// A PROFIBUS segment of the plant file.
#[derive(Clone, Debug)]
pub(crate) struct ProfibusConfig {
    /// Name, unique among the buses.
    pub name: String,
    /// Bit rate of the PROFIBUS segment.
    pub rate: BusRate,
    /// Factor for the slot time, 1 to 10000 (decision D-358). The line is reserved for an answer during the
    /// slot time.
    pub slot_factor: u32,
    /// Doors to the PROFIBUS segment that are open from the start.
    pub doors: Vec<DoorSpec>,
}

/// Highest slot factor. With it, the slot time is almost a second at 12 Mbit/s.
const MAX_SLOT_FACTOR: u32 = 10_000;
/// Slot factor without the key.
const DEFAULT_SLOT_FACTOR: u32 = 1;
/// Bit rate without the key, in kbit/s.
const DEFAULT_KBIT_S: u32 = 1500;

plant_keys! {
    /// A PROFIBUS segment
    Section, "a PROFIBUS: a table with its settings" {
        /// Bit rate in kbit/s
        kbit_s: Option<Spanned<f64>> = { "enum": rates(), "default": DEFAULT_KBIT_S },
            "1500", rates_text().replace(" 1500,", " 1500 (default),").replace(" or ", ", ");
        /// Factor for the time that the line is reserved for an answer (D-358)
        slot_factor: Option<Spanned<u32>> = {
            "type": "integer", "minimum": 1, "maximum": MAX_SLOT_FACTOR, "default": DEFAULT_SLOT_FACTOR,
        }, "1", format!(
            "{DEFAULT_SLOT_FACTOR} (default) to {MAX_SLOT_FACTOR}: factor for the time that the line is reserved for an answer (D-358)"
        );
        /// Doors for foreign programs that are open from the start
        doors: Option<Vec<DoorSpec>> = {
            "type": "array",
            "items": { "type": "string", "pattern": "^profibus-(pty|tcp(-anybody)?:[0-9.]+:[0-9]+)$" },
        }, r#"["profibus-tcp:127.0.0.1:0"]"#,
            "doors for foreign masters and slaves, see can-dp2.md (default: none)";
    }
}

/// Returns the rates in kbit/s.
fn rates() -> Vec<serde_json::Value> {
    let kbit_s = |rate: BusRate| match rate.bit_s() {
        bit_s if bit_s.is_multiple_of(1000) => (bit_s / 1000).into(),
        bit_s => (f64::from(bit_s) / 1000.0).into(),
    };
    BusRate::ALL.into_iter().map(kbit_s).collect()
}

/// `9.6, 19.2 or 31.25`
fn rates_text() -> String {
    let rates: Vec<_> = rates().iter().map(ToString::to_string).collect();
    let Some((last, others)) = rates.split_last() else { return String::new() };
    format!("{} or {last}", others.join(", "))
}

impl ProfibusConfig {
    /// Returns the JSON Schema of the section.
    pub(crate) fn schema() -> serde_json::Value {
        Section::schema()
    }

    /// Reads a `[[bus]]` section of kind `profibus`.
    pub(crate) fn read(value: ValueDeserializer<'_>) -> Result<Arc<dyn BusSection>, Error> {
        let Section { name, kbit_s, slot_factor, doors } = Section::deserialize(value)?;
        let wanted = kbit_s.as_ref().map_or(DEFAULT_KBIT_S.into(), |kbit_s| *kbit_s.get_ref());
        let rate = rate(wanted).ok_or_else(|| {
            let text = format!("kbit_s of '{name}' is {wanted}; it must be {}", rates_text());
            refused_at(kbit_s.map_or(0..0, |kbit_s| kbit_s.span()), text)
        })?;
        let slot_factor = match slot_factor {
            None => DEFAULT_SLOT_FACTOR,
            Some(factor) if (1..=MAX_SLOT_FACTOR).contains(factor.get_ref()) => *factor.get_ref(),
            Some(factor) => {
                let text = format!(
                    "slot_factor of '{name}' is {}; it must be 1 to {MAX_SLOT_FACTOR}",
                    factor.get_ref()
                );
                return Err(refused_at(factor.span(), text));
            }
        };
        Ok(Arc::new(ProfibusConfig { name, rate, slot_factor, doors: doors.unwrap_or_default() }))
    }
}

/// Returns the PROFIBUS rate of `kbit_s` kbit/s.
fn rate(kbit_s: f64) -> Option<BusRate> {
    // The decimal fraction in the file may have no exact binary value, so a small difference is allowed.
    BusRate::ALL.into_iter().find(|rate| (f64::from(rate.bit_s()) - kbit_s * 1000.0).abs() < 1e-6)
}

impl BusSection for ProfibusConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn doors(&self) -> &[DoorSpec] {
        &self.doors
    }

    /// Switches set the addresses of the ports. They are read at power-on, and users can turn them before
    /// that.
    fn refuses_equal_numbers(&self) -> bool {
        false
    }

    fn build(&self, index: BusIndex) -> Result<Box<dyn Bus>, BuildError> {
        Ok(Box::new(ProfibusBus::new(index, self)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_the_keys() {
        let page = include_str!("../../../docs/reference/plant.md");
        assert!(page.contains(&Section::lines()), "{}", Section::lines());
    }

    #[test]
    fn rates_are_the_rates_of_the_standard() {
        for known in BusRate::ALL {
            assert_eq!(rate(f64::from(known.bit_s()) / 1000.0), Some(known));
        }
        for wrong in [0.0, 125.0, 45.5, -9.6, f64::NAN, f64::INFINITY] {
            assert_eq!(rate(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn wrong_settings_are_refused() {
        let read = |section: &str| {
            let read = ProfibusConfig::read(ValueDeserializer::parse(section).unwrap());
            read.map(|config| config.name().to_owned()).map_err(|error| error.to_string())
        };
        assert_eq!(read("{ name = 'dp' }").as_deref(), Ok("dp"));
        let slow = read("{ name = 'dp', kbit_s = 125 }").unwrap_err();
        assert!(slow.contains("kbit_s of 'dp' is 125; it must be 9.6, 19.2"), "{slow}");
        let slot = read("{ name = 'dp', slot_factor = 10001 }").unwrap_err();
        assert!(slot.contains("slot_factor of 'dp' is 10001; it must be 1 to 10000"), "{slot}");
        let other = read("{ name = 'dp', frame_length = 'fixed' }").unwrap_err();
        assert!(other.contains("unknown field `frame_length`"), "{other}");
    }
}
