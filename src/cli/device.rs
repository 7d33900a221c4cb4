//! Which device, where no emulator says so.

use super::error::CliError;
use super::place::Place;
use crate::devices;
use crate::layout::{Device, LayoutError};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// The device whose registers are meant.
#[derive(clap::Args)]
pub(crate) struct DeviceArg {
    /// The device
    #[arg(long = "device", value_name = "DEVICE", value_parser = known(), default_value = devices::default().layout.name)]
    pub device: &'static Device,
}

/// Takes the names of the registry, and offers them for completion.
fn known() -> impl TypedValueParser<Value = &'static Device> {
    let names =
        devices::all().iter().map(|known| PossibleValue::new(known.layout.name).help(known.layout.title));
    PossibleValuesParser::new(names)
        .try_map(|name| devices::find(&name).map(|known| known.layout).ok_or("no device of this name"))
}

/// Looks a name up without knowing the device: what this refuses, no instance has.
///
/// # Errors
/// What the device says that has at least such an area, else the default one.
pub(crate) fn on_any_device<T>(
    look_up: impl Fn(&'static Device) -> Result<T, LayoutError>,
) -> Result<T, CliError> {
    let mut refusal = match look_up(devices::default().layout) {
        Ok(found) => return Ok(found),
        Err(refusal) => refusal,
    };
    for known in &devices::all()[1..] {
        match look_up(known.layout) {
            Ok(found) => return Ok(found),
            Err(other) => {
                let has_area = |refusal: &LayoutError| !matches!(refusal, LayoutError::UnknownArea { .. });
                if has_area(&other) && !has_area(&refusal) {
                    refusal = other;
                }
            }
        }
    }
    Err(refusal.into())
}

/// The register or address, of whatever device has it; what it is at an instance, [`Session::place`] tells.
///
/// # Errors
/// As [`on_any_device`].
///
/// [`Session::place`]: super::session::Session::place
pub(crate) fn of_any_device(text: &str) -> Result<Place, CliError> {
    on_any_device(|device| Place::parse(device, text))
}
