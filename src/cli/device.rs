//! The device of a command that works without an emulator.

use super::Instance;
use super::error::CliError;
use super::place::NamedLocation;
use super::session::Session;
use crate::devices::folder;
use crate::devices::{self, Registered};
use crate::layout::{DeviceFit, DeviceLayout, Fit, LayoutError, Role};
use crate::memory::MemoryError;
use crate::plant::PlantConfig;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::ErrorKind;
use clap::{Arg, Command};
use std::cell::OnceCell;
use std::ffi::OsStr;
use std::path::Path;

#[derive(clap::Args)]
pub(crate) struct DeviceArg {
    /// Type of the device, its folder, or a device of a plant: PLANT.toml:NAME
    #[arg(long = "device", value_name = "DEVICE", value_parser = known(), default_value = devices::default().layout.name)]
    device: ChosenDevice,
}

impl DeviceArg {
    /// Returns the register map of the device.
    pub(crate) fn layout(&self) -> &'static DeviceLayout {
        self.device.layout
    }

    /// Returns the path of the device's folder, or the plant file with the device's name, as the user has written it. `None` for
    /// a device of the program.
    pub(crate) fn folder(&self) -> Option<&str> {
        self.device.folder.as_deref()
    }
}

/// A device, and the path of its folder or its place in a plant file, as the user has written it.
#[derive(Clone)]
struct ChosenDevice {
    layout: &'static DeviceLayout,
    folder: Option<String>,
}

/// Accepts the names of the registered devices and offers them for completion, and paths of folders with a device.
fn known() -> DeviceParser {
    DeviceParser
}

/// Parser of the name of a device, or of the path of a folder.
#[derive(Clone)]
struct DeviceParser;

impl DeviceParser {
    fn names() -> PossibleValuesParser {
        let names = devices::all().iter();
        PossibleValuesParser::new(
            names.map(|known| PossibleValue::new(known.layout.name).help(known.layout.title)),
        )
    }
}

impl TypedValueParser for DeviceParser {
    type Value = ChosenDevice;

    fn parse_ref(&self, cmd: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<Self::Value, clap::Error> {
        let path = |name: &str| match folder::is_path(name) {
            true => Some(name.to_owned()),
            false => {
                devices::find(name).is_none().then(|| folder::search(name))??.to_str().map(str::to_owned)
            }
        };
        if let Some((plant, name)) = value.to_str().and_then(in_plant) {
            let refused = |reason| cmd.clone().error(ErrorKind::ValueValidation, reason);
            return device_of_plant(plant, name).map_err(refused);
        }
        let folder = value.to_str().and_then(path);
        let read = |path: String| {
            let dir = folder::find(Path::new(""), &path)?;
            Ok::<_, folder::FolderError>((path, folder::load(&dir)?))
        };
        let folder = folder.map(read);
        match folder {
            Some(Ok((path, folder))) => {
                Ok(ChosenDevice { layout: folder.registered.layout, folder: Some(path) })
            }
            Some(Err(reason)) => Err(cmd.clone().error(ErrorKind::ValueValidation, reason)),
            None => {
                let chosen = |known: &Registered| ChosenDevice { layout: known.layout, folder: None };
                let names = Self::names()
                    .try_map(move |name| devices::find(&name).map(chosen).ok_or("no device of this name"));
                names.parse_ref(cmd, arg, value)
            }
        }
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let names = Self::names();
        let values: Vec<_> = names.possible_values()?.collect();
        Some(Box::new(values.into_iter()))
    }
}

/// Returns the register map of the device that the value of `--device` names; `None` if there is no such device.
pub(super) fn named(name: &str) -> Option<&'static DeviceLayout> {
    let device = DeviceParser.parse_ref(&Command::new(""), None, OsStr::new(name));
    device.ok().map(|device| device.layout)
}

/// Splits a value such as `plant.toml:line` into a plant file and the name of a device.
fn in_plant(value: &str) -> Option<(&str, &str)> {
    value.rsplit_once(':').filter(|(plant, _)| plant.ends_with(".toml"))
}

/// Returns a device as it is in a plant: a PLC has the registers of its option cards.
fn device_of_plant(file: &str, name: &str) -> Result<ChosenDevice, String> {
    let plant = PlantConfig::load(Path::new(file)).map_err(|error| error.to_string())?;
    match plant.device(name) {
        Some(device) => Ok(ChosenDevice { layout: device.layout(), folder: Some(format!("{file}:{name}")) }),
        None => {
            let known: Vec<_> = plant.devices.iter().map(|device| device.name()).collect();
            Err(format!("{file} has no device '{name}'; its devices: {}", known.join(", ")))
        }
    }
}

/// Looks up a name or an address on all devices, with any options. If this fails, no instance can have such a register.
///
/// # Errors
/// The error of the device that matches best: the device that has such an area or such addresses.
/// [`CliError::NoDeviceHas`] if no device has such addresses.
pub(crate) fn on_any_device<T>(
    look_up: impl Fn(&DeviceFit) -> Result<T, LayoutError>,
) -> Result<T, CliError> {
    let mut refusals = Vec::new();
    for known in devices::all() {
        match on_any_fit(known.layout, &look_up) {
            Ok(found) => return Ok(found),
            Err(refusal) => refusals.push(refusal),
        }
    }
    match refusals.into_iter().min_by_key(distance) {
        Some(LayoutError::NoSpace { text, .. } | LayoutError::BadAddress { text, .. }) => {
            let known = addresses_like(&text);
            Err(CliError::NoDeviceHas { text, known })
        }
        Some(refusal) => Err(refusal.into()),
        None => Ok(look_up(&DeviceFit::unknown(&DeviceLayout::UNKNOWN))?),
    }
}

/// Distance if the device has neither the area nor the name.
const UNKNOWN: u8 = 2;

/// True if no device of the program has the area or the addresses of a name. A device in a folder may have them, and
/// only the instance knows its folders.
fn may_be_of_folder(refusal: &CliError) -> bool {
    match refusal {
        CliError::NoDeviceHas { .. } => true,
        CliError::Layout(LayoutError::NoMatch { .. } | LayoutError::UnknownPort { .. }) => true,
        CliError::Layout(refusal) => distance(refusal) == UNKNOWN,
        _ => false,
    }
}

/// Returns the distance between a name or address and this device, derived from the error of the device. A smaller
/// number means that the user more probably means this device.
fn distance(refusal: &LayoutError) -> u8 {
    match refusal {
        LayoutError::UnknownArea { .. } | LayoutError::UnknownName { .. } => UNKNOWN,
        LayoutError::BadAddress { .. } | LayoutError::NoSpace { .. } => 1,
        _ => 0,
    }
}

/// Lists, for each device, the ranges of its addresses that begin with the same letter as `text`. If no device has such
/// addresses, lists all ranges.
fn addresses_like(text: &str) -> String {
    let letter =
        text.strip_prefix('%').and_then(|rest| rest.chars().next()).map(|it| it.to_ascii_uppercase());
    let of = |device: &DeviceLayout, is_wanted: &dyn Fn(char) -> bool| {
        let spaces: Vec<_> =
            device.spaces.iter().filter(|it| is_wanted(it.letter)).map(ToString::to_string).collect();
        (!spaces.is_empty()).then(|| format!("{} has {}", device.title, spaces.join(", ")))
    };
    let devices = |is_wanted: &dyn Fn(char) -> bool| {
        devices::all().iter().filter_map(|known| of(known.layout, is_wanted)).collect::<Vec<_>>().join("; ")
    };
    let alike = devices(&|it| Some(it) == letter);
    if alike.is_empty() { devices(&|_| true) } else { alike }
}

/// Does the same as [`on_any_device`] for a single device. If the result depends on the role of a port, tries all
/// roles, and accepts the first one that has the register.
fn on_any_fit<T>(
    device: &'static DeviceLayout,
    look_up: impl Fn(&DeviceFit) -> Result<T, LayoutError>,
) -> Result<T, LayoutError> {
    let unknown = DeviceFit::unknown(device);
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

/// Parses a register or address of any device. [`Session::place`] later resolves it for an instance.
///
/// # Errors
/// Returns the errors of [`on_any_device`].
pub(crate) fn of_any_device(text: &str) -> Result<NamedLocation, CliError> {
    on_any_device(|fitted| NamedLocation::parse(fitted, text))
}

/// Checks names and addresses before a command connects to its instance. If no device of the program has one, asks the
/// instance, if it runs: only the instance has the types and options of its PLCs. Connects once for all names.
pub(crate) struct NameChecks<'a> {
    instance: &'a Instance,
    session: OnceCell<Session>,
}

impl<'a> NameChecks<'a> {
    pub(crate) fn new(instance: &'a Instance) -> Self {
        Self { instance, session: OnceCell::new() }
    }

    /// Parses a register or address.
    ///
    /// # Errors
    /// Returns the errors of [`of_any_device`] and [`NameChecks::answer`].
    pub(crate) fn place(&self, text: &str) -> Result<NamedLocation, CliError> {
        of_any_device(text).or_else(|refusal| {
            let place = |fitted: &DeviceFit| NamedLocation::parse(fitted, text);
            self.answer(refusal, |session| session.place(text), place)
        })
    }

    /// If `refusal` concerns a name or an address and the instance runs, returns the result of `ask`. `look_up` makes the
    /// same search on one device. The function calls `look_up` if the instance has several PLCs and the user has not
    /// named a PLC.
    ///
    /// # Errors
    /// The error of `ask`. If the instance cannot be read: `refusal`; or the reason, if a device in a folder may have the
    /// name.
    pub(crate) fn answer<T>(
        &self,
        refusal: CliError,
        ask: impl Fn(&Session) -> Result<T, CliError>,
        look_up: impl Fn(&DeviceFit) -> Result<T, LayoutError>,
    ) -> Result<T, CliError> {
        if !matches!(refusal, CliError::Layout(_) | CliError::NoDeviceHas { .. }) {
            return Err(refusal);
        }
        let session = match self.session.get() {
            Some(session) => session,
            None => {
                let opened = self.open(refusal)?;
                self.session.get_or_init(|| opened)
            }
        };
        ask(session).map_err(|failure| match failure {
            // If all PLCs report the same mistake, it is shown instead of the message that the PLC is missing.
            CliError::WhichPlc { .. } => match common_refusal(session.all_fitted(), look_up) {
                Some(common) => common.into(),
                None => failure,
            },
            _ => failure,
        })
    }

    /// Opens the instance for a name that no device of the program has, for the reason `refusal`.
    fn open(&self, refusal: CliError) -> Result<Session, CliError> {
        let is_open = may_be_of_folder(&refusal);
        // A mistake in a name of a known device is reported at once, even if the instance is just starting.
        let waiting = if is_open { self.instance.clone() } else { Instance::running(self.instance.name()) };
        match Session::open_for_reading(&waiting) {
            Ok(session) => Ok(session),
            Err(unreadable) if is_open => Err(unreadable),
            // The name may be right, but this user cannot read the folder or the instance.
            Err(
                lost @ CliError::Memory(
                    MemoryError::LostFolder { .. }
                    | MemoryError::ForeignOwner { .. }
                    | MemoryError::ForeignDirectory { .. },
                ),
            ) => Err(lost),
            Err(_) => Err(refusal),
        }
    }
}

/// Returns the error that `devices` have in common for the name or address that `look_up` searches: `None` if a device
/// accepts it, or if the errors differ. Devices that have neither its area nor its address range are not compared.
fn common_refusal<T>(
    devices: &[DeviceFit],
    look_up: impl Fn(&DeviceFit) -> Result<T, LayoutError>,
) -> Option<LayoutError> {
    let mut close: Vec<LayoutError> = Vec::new();
    for fitted in devices {
        let refusal = look_up(fitted).err()?;
        if distance(&refusal) < UNKNOWN {
            close.push(refusal);
        }
    }
    let common = close.pop()?;
    close.iter().all(|other| other.to_string() == common.to_string()).then_some(common)
}
