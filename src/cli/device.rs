//! `--device`: which device, where no emulator says so.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use commram::devices;
use commram::layout::Device;

/// The device whose registers are meant.
#[derive(clap::Args)]
pub struct DeviceArg {
    /// The device
    #[arg(long = "device", value_name = "DEVICE", value_parser = known(), default_value = devices::DEVICES[0].layout.name)]
    pub device: &'static Device,
}

/// Takes the names of the registry, and offers them for completion.
fn known() -> impl TypedValueParser<Value = &'static Device> {
    let names =
        devices::DEVICES.iter().map(|known| PossibleValue::new(known.layout.name).help(known.layout.title));
    PossibleValuesParser::new(names)
        .try_map(|name| devices::find(&name).map(|known| known.layout).ok_or("no device of this name"))
}
