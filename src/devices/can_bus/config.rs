//! A CAN bus as the plant file describes it.

use super::{CanBus, FAMILY};
use crate::can::BitRate;
use crate::devices::emulation::settings::keys::plant_keys;
use crate::devices::emulation::settings::refused_at;
use crate::devices::{BuildError, Bus, BusSection};
use crate::door::DoorSpec;
use crate::identity::BusIndex;
use serde::Deserialize;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{Error, ValueDeserializer};

/// A CAN bus of the plant file.
#[derive(Clone, Debug)]
pub struct CanBusConfig {
    /// Name, unique among the buses.
    pub name: String,
    /// Bit rate, 10 to 1000 kbit/s.
    pub rate: BitRate,
    /// Doors to the bus that are open from the start.
    pub doors: Vec<DoorSpec>,
}

/// Lowest and highest bit rate, in kbit/s.
const KBIT_S: [u32; 2] = [10, 1000];

plant_keys! {
    /// A CAN bus
    Section, "a CAN bus: a table with its settings" {
        /// Bit rate in kbit/s, with at most three decimals
        kbit_s: Spanned<f64> = { "type": "number", "minimum": KBIT_S[0], "maximum": KBIT_S[1] },
            "33.3", format!("{} to {}, with three decimals at most; required", KBIT_S[0], KBIT_S[1]);
        /// Doors for foreign programs that are open from the start
        doors: Option<Vec<DoorSpec>> = {
            "type": "array",
            "items": {
                "type": "string",
                "pattern": "^(slcan-pty(:/dev/pts/[0-9]+)?|slcan-tcp(-anybody)?:[0-9.]+:[0-9]+)$",
            },
        }, r#"["slcan-tcp:127.0.0.1:0"]"#, "doors for foreign programs, see can.md (default: none)";
    }
}

impl CanBusConfig {
    /// Returns the JSON Schema of the section.
    pub(crate) fn schema() -> serde_json::Value {
        Section::schema()
    }

    /// Reads a `[[bus]]` section of kind `can`.
    pub(crate) fn read(value: ValueDeserializer<'_>) -> Result<Arc<dyn BusSection>, Error> {
        let Section { name, kbit_s, doors } = Section::deserialize(value)?;
        let rate = rate(*kbit_s.get_ref()).ok_or_else(|| {
            let text = format!(
                "kbit_s of '{name}' is {}; it must be {} to {}, with three decimals at most",
                kbit_s.get_ref(),
                KBIT_S[0],
                KBIT_S[1]
            );
            refused_at(kbit_s.span(), text)
        })?;
        Ok(Arc::new(CanBusConfig { name, rate, doors: doors.unwrap_or_default() }))
    }
}

/// Returns the bit rate for `kbit_s` if a CAN bus can run at it and it is a whole number of bit/s.
fn rate(kbit_s: f64) -> Option<BitRate> {
    let [least, most] = KBIT_S.map(f64::from);
    if !(least..=most).contains(&kbit_s) {
        return None;
    }
    let bit_s = (kbit_s * 1000.0).round();
    // The decimal fraction in the file may have no exact binary value, so a small difference is allowed.
    ((kbit_s * 1000.0 - bit_s).abs() < 1e-6).then(|| BitRate::new(bit_s as u32)).flatten()
}

impl BusSection for CanBusConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn doors(&self) -> &[DoorSpec] {
        &self.doors
    }

    fn build(&self, index: BusIndex) -> Result<Box<dyn Bus>, BuildError> {
        Ok(Box::new(CanBus::new(index, self)))
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
    fn rates_are_exact_to_the_bit() {
        for (kbit_s, bit_s) in [
            (10.0, 10_000),
            (12.5, 12_500),
            (33.3, 33_300),
            (66.6, 66_600),
            (83.333, 83_333),
            (166.0, 166_000),
            (333.3, 333_300),
            (666.6, 666_600),
            (1000.0, 1_000_000),
        ] {
            assert_eq!(rate(kbit_s).map(BitRate::bit_s), Some(bit_s), "{kbit_s}");
        }
        for wrong in [0.0, 9.999, 1000.001, -125.0, f64::NAN, f64::INFINITY, 33.3333] {
            assert_eq!(rate(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn wrong_settings_are_refused() {
        let refusal = |section: &str| {
            let read = CanBusConfig::read(ValueDeserializer::parse(section).unwrap());
            read.map(|config| config.name().to_owned()).unwrap_err().to_string()
        };
        let right = CanBusConfig::read(ValueDeserializer::parse("{ name = 'open', kbit_s = 125 }").unwrap());
        assert_eq!(right.unwrap().name(), "open");
        let slow = refusal("{ name = 'open', kbit_s = 5 }");
        assert!(slow.contains("kbit_s of 'open' is 5; it must be 10 to 1000"), "{slow}");
        for (section, text) in [
            ("{ name = 'open' }", "missing field `kbit_s`"),
            ("{ name = 'open', kbit_s = 'fast' }", "invalid type"),
            ("{ name = 'open', kbit_s = 125, frame_length = 'fixed' }", "unknown field `frame_length`"),
        ] {
            assert!(refusal(section).contains(text), "{}", refusal(section));
        }
    }
}
