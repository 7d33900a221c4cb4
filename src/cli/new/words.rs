//! Replacements for the names in templates: the device, its PLC, and the first exchange in each language.

use super::Device;
use crate::cli::error::CliError;
use crate::export;
use crate::plant::PlantConfig;

/// Names in templates, without their `@`, and the texts that replace them.
pub(super) struct Words(Vec<(&'static str, String)>);

impl Words {
    /// # Errors
    /// The plant of the device is refused.
    pub(super) fn new(device: Device) -> Result<Self, CliError> {
        let layout = device.known.layout;
        let plant = PlantConfig::parse("the template", device.plant)?;
        let plc = plant.devices.iter().find(|it| it.layout().name == layout.name);
        let plc = plc.map_or("", |it| it.name()).to_owned();
        let prefix = if plant.devices.len() > 1 { format!("{plc}:") } else { String::new() };
        let (answer, value) = device.exchange.answer;
        let expression = |name: &str| export::register_expression(layout, name).unwrap_or_default();
        let lines = |line: &dyn Fn(&str, u32) -> String| {
            device.exchange.writes.iter().map(|(name, value)| line(name, *value)).collect::<Vec<_>>()
        };
        Ok(Words(vec![
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("device", layout.name.to_owned()),
            ("title", layout.title.to_owned()),
            (
                "writes_rhai",
                lines(&|name, value| format!("poke(\"{prefix}{name}\", {value:#06x});")).join("\n"),
            ),
            (
                "writes_python",
                lines(&|name, value| format!("    commram.poke(\"{prefix}{name}\", {value:#06x})"))
                    .join("\n"),
            ),
            (
                "writes_c",
                lines(&|name, value| format!("    COMMRAM_STORE({}, {value:#06x});", expression(name)))
                    .join("\n"),
            ),
            ("writes_rust", lines(&|name, value| format!("(\"{name}\", {value:#06x})")).join(", ")),
            ("answer_c", expression(answer)),
            ("answer", answer.to_owned()),
            ("answered", format!("{value:#06x}")),
            ("wrong", format!("{:#06x}", value + 1)),
            ("within", device.exchange.within.to_owned()),
            ("prefix", prefix),
            ("plc", plc),
        ]))
    }

    /// Returns the text with all names replaced.
    pub(super) fn replaced(&self, text: &str) -> String {
        self.0.iter().fold(text.to_owned(), |text, (name, word)| text.replace(&format!("@{name}@"), word))
    }
}
