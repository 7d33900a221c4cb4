//! Register maps, devices and object dictionaries of an instance.

use super::{Fields, Shown, named};
use crate::cli::error::CliError;
use crate::cli::map::entries_of;
use crate::cli::map::entry::{self, Entry};
use crate::cli::web::link::Connection;
use crate::cli::web::problem::Problem;
use crate::devices;
use crate::identity::DeviceIndex;
use crate::layout::{
    Area, DeviceFit, DeviceLayout, Fit, FrontWord, Owner, Provenance, RegisterRef, ValueMeaning, Width,
};
use serde::Serialize;
use serde_json::{Value, json};

/// An entry of the map with its position in the image, for operations.
#[derive(Serialize)]
struct PlacedEntry {
    #[serde(flatten)]
    entry: Entry,
    /// Number of the PLC.
    plc: DeviceIndex,
    /// Offset in the image of the register, or of the first element of an array, in bytes.
    offset: u32,
    width: Width,
    /// Dimensions of an array: for each, the number of elements and the distance between elements in bytes.
    dims: Vec<[u32; 2]>,
}

impl PlacedEntry {
    fn new(plc: DeviceIndex, register: &RegisterRef) -> Self {
        let dims = register.register.dims.iter().map(|dim| [u32::from(dim.count), dim.stride]).collect();
        let width = Width::of(register.ty());
        Self { entry: entry::of_array(register), plc, offset: register.offset(), width, dims }
    }

    /// Creates the entry of an area of plain RAM.
    fn plain(plc: DeviceIndex, area: &'static Area, entry: Entry) -> Self {
        Self { entry, plc, offset: area.first, width: Width::Byte, dims: vec![[area.bytes, 1]] }
    }
}

/// Returns the PLC that the field `plc` names. Without the field, the only PLC of the instance.
fn plc_of(connection: &Connection, fields: &Fields<'_>, what: &str) -> Result<DeviceIndex, Problem> {
    connection.session.plc(fields.text("plc"), what).map_err(|error| match error {
        CliError::WhichPlc { instance, plcs, .. } => {
            let detail =
                format!("instance '{instance}' has several PLCs ({plcs}); the field `plc` names one");
            Problem::wrong_use(detail).with("field", "plc")
        }
        other => other.into(),
    })
}

/// Returns all registers of a PLC, or those of a block, an array or a pattern.
pub(super) fn show(connection: &mut Connection, fields: &Fields<'_>) -> Result<Shown, Problem> {
    let what = fields.text("what").unwrap_or_default();
    let plc = plc_of(connection, fields, what)?;
    let fitted = connection.session.fitted(plc);
    if !what.is_empty() {
        return named("entries", entries_of(&fitted, what)?.0);
    }
    let areas = fitted.device().named_areas().filter(|area| fitted.area(area) != Fit::Empty);
    let entries = areas.flat_map(|area| of_area(plc, &fitted, area));
    let is_full = fields.is_on("full")?;
    let entries: Vec<_> = entries.filter(|placed| is_full || !placed.entry.reserved).collect();
    named("entries", entries)
}

fn of_area(plc: DeviceIndex, fitted: &DeviceFit, area: &'static Area) -> Vec<PlacedEntry> {
    if area.structures.is_empty() {
        let entries = entry::of_area(fitted, area).into_iter();
        return entries.map(|entry| PlacedEntry::plain(plc, area, entry)).collect();
    }
    entry::firsts(fitted, area).iter().map(|register| PlacedEntry::new(plc, register)).collect()
}

/// Returns the devices of all PLCs.
pub(super) fn devices(connection: &mut Connection, _: &Fields<'_>) -> Result<Shown, Problem> {
    let session = &connection.session;
    let device = |(plc, name): (DeviceIndex, &String)| {
        let fitted = session.fitted(plc);
        let device = fitted.device();
        let ports = device.ports.iter().map(|port| {
            json!({"port": port.name, "number": port.number, "bus": port.medium, "area": port.area.name})
        });
        json!({
            "plc": name, "number": plc, "device": device.name, "title": device.title,
            "board": devices::board_of(device),
            "ports": ports.collect::<Vec<_>>(),
            "front": device.front.iter().map(|word| front_word(device, word)).collect::<Vec<_>>(),
            "objects": device.objects.len(),
        })
    };
    named("devices", DeviceIndex::enumerate(session.plcs()).map(device).collect::<Vec<_>>())
}

fn front_word(device: &'static DeviceLayout, word: &FrontWord) -> Value {
    let values = word.meaning.map_or(&[][..], |meaning| meaning.values).iter().map(|value| {
        let ValueMeaning { first, last, text, source, .. } = value;
        json!({"first": first, "last": last, "text": text, "provenance": source.to_string()})
    });
    let register =
        device.register(&format!("{}.{}", device.front_area.map_or("", |area| area.name), word.name));
    let name_from = register.map_or(Provenance::Manual, |register| register.register.name_from);
    json!({
        "name": word.name, "name_provenance": name_from.to_string(), "number": word.index(), "switch": word.owner == Owner::Plc, "text": word.is_text,
        "values": values.collect::<Vec<_>>(), "meaning": word.doc, "page": word.page, "provenance": word.source.to_string(),
    })
}

/// Returns the object dictionary of a PLC's device.
pub(super) fn objects(connection: &mut Connection, fields: &Fields<'_>) -> Result<Shown, Problem> {
    let plc = plc_of(connection, fields, "")?;
    let object = |object: &crate::layout::object::Object| {
        json!({
            "index": object.index, "sub": object.sub, "name": object.name, "type": object.ty.map(|ty| ty.name()),
            "access": object.access.name(), "default": object.default.to_string(), "saved": object.saved,
            "page": object.page, "meaning": object.doc, "provenance": object.row_from.to_string(),
            "default_provenance": object.default_from.to_string(),
        })
    };
    named("objects", connection.session.device(plc).objects.iter().map(object).collect::<Vec<_>>())
}
