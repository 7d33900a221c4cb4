//! Which device, where no emulator says so.

use super::Instance;
use super::error::CliError;
use super::place::Place;
use super::session::Session;
use crate::devices;
use crate::layout::{Device, Fit, Fitted, LayoutError, Role};
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

/// Looks a name up without knowing the device, nor how it is fitted: what this refuses, no instance has.
///
/// # Errors
/// What the device says that has at least such an area, else the default one.
pub(crate) fn on_any_device<T>(look_up: impl Fn(&Fitted) -> Result<T, LayoutError>) -> Result<T, CliError> {
    let mut refusal = None;
    for known in devices::all() {
        match on_any_fit(known.layout, &look_up) {
            Ok(found) => return Ok(found),
            Err(other) => {
                let has_area = |refusal: &LayoutError| {
                    !matches!(refusal, LayoutError::UnknownArea { .. } | LayoutError::UnknownName { .. })
                };
                if refusal.as_ref().is_none_or(|refusal| has_area(&other) && !has_area(refusal)) {
                    refusal = Some(other);
                }
            }
        }
    }
    match refusal {
        Some(refusal) => Err(refusal.into()),
        None => Ok(look_up(&Fitted::unknown(&Device::UNKNOWN))?),
    }
}

/// The same on one device. Where it depends on what a port is, any of it will do.
fn on_any_fit<T>(
    device: &'static Device,
    look_up: impl Fn(&Fitted) -> Result<T, LayoutError>,
) -> Result<T, LayoutError> {
    let unknown = Fitted::unknown(device);
    let refusal = match look_up(&unknown) {
        Err(refusal @ LayoutError::Ambiguous { .. }) => refusal,
        other => return other,
    };
    let roles = [Role::Master, Role::Slave, Role::Peer];
    let fits = roles.into_iter().map(|role| {
        let ports = device.ports.iter().filter(|port| port.roles.contains(&role));
        ports.fold(unknown, |fitted, port| fitted.with(port.number, Fit::As(role)))
    });
    fits.into_iter().find_map(|fitted| look_up(&fitted).ok()).ok_or(refusal)
}

/// The register or address, of whatever device has it; what it is at an instance, [`Session::place`] tells.
///
/// # Errors
/// As [`on_any_device`].
pub(crate) fn of_any_device(text: &str) -> Result<Place, CliError> {
    on_any_device(|fitted| Place::parse(fitted, text))
}

/// The same, before `instance` is asked what it is there. Where no device has such an area, it tells which ones that PLC has,
/// if it runs.
pub(crate) fn of_any_device_but_told_by(instance: &Instance) -> impl Fn(&str) -> Result<Place, CliError> {
    |text| of_any_device(text).or_else(|refusal| told_by(instance, refusal, |session| session.place(text)))
}

/// What `ask` gets from the instance, if it runs and `refusal` is that no device has such an area, or several registers are
/// called so: of a modular PLC perhaps one of them is fitted.
///
/// # Errors
/// What `ask` is refused with, else `refusal`.
pub(crate) fn told_by<T>(
    instance: &Instance,
    refusal: CliError,
    ask: impl Fn(&Session) -> Result<T, CliError>,
) -> Result<T, CliError> {
    use LayoutError::{Ambiguous, NoMatch, UnknownArea, UnknownName, UnknownVariable};
    let may_know = matches!(
        refusal,
        CliError::Layout(
            Ambiguous { .. }
                | NoMatch { .. }
                | UnknownArea { .. }
                | UnknownName { .. }
                | UnknownVariable { .. }
        )
    );
    if !may_know {
        return Err(refusal);
    }
    match Session::open_for_reading(&Instance::running(instance.name())) {
        Ok(session) => ask(&session),
        Err(_) => Err(refusal),
    }
}
