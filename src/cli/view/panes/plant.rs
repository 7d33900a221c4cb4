//! The current state of the plant: PLCs with their ports, buses with their stations.

use super::titled;
use crate::cli::view::drives::ChartedDrive;
use crate::cli::view::model::{ClickTarget, ListId, Model};
use crate::cli::view::poll::MemoryLocation;
use crate::cli::view::style::{Theme, padded};
use crate::devices;
use crate::identity::DeviceIndex;
use crate::layout::place::status_of;
use crate::layout::{Fit, Port, shown_text};
use crate::request::{BusScene, BusState};
use crate::time;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

/// Width of the column with the names.
const NAMES: usize = 18;

pub(super) fn draw(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let inner = titled(frame, " plant ".to_owned(), theme.head(), area);
    let mut all = Vec::new();
    for (plc, name) in DeviceIndex::enumerate(&model.names().plcs) {
        plc_lines(model, plc, name, theme, &mut all);
    }
    for (number, bus) in model.scene.iter().enumerate() {
        let own = |shown: &&ChartedDrive| shown.entry.bus.as_deref() == Some(bus.name.as_str());
        let drives: Vec<_> = model.drives.all.iter().filter(own).collect();
        bus_lines(bus, &drives, model.buses.get(number), theme, &mut all);
    }
    // This pane has no selected line: the keys scroll its text.
    let most = all.len().saturating_sub(usize::from(inner.height));
    model.plant.chosen = model.plant.chosen.min(most);
    model.plant.height = usize::from(inner.height);
    let seen = all.into_iter().skip(model.plant.chosen).collect();
    super::lines(frame, seen, inner);
    model.hot.push((inner, ClickTarget::List(ListId::Plant)));
}

fn plc_lines(model: &Model, plc: DeviceIndex, name: &str, theme: Theme, lines: &mut Vec<Line<'static>>) {
    let fitted = model.names().fitted(plc);
    let device = fitted.device();
    let mut how = String::new();
    if let Some(face) = model.faces.get(plc.index()) {
        let words = face.board.words(devices::board_of(device));
        let display = shown_text(&face.front).or(words.display).filter(|shown| !shown.trim().is_empty());
        let parts = [
            Some(format!("power {}", words.power)),
            words.program.map(|program| format!("program {program}")),
            display.map(|shown| format!("display {shown}")),
        ];
        how = parts.into_iter().flatten().collect::<Vec<_>>().join(", ");
    }
    lines.push(Line::from(vec![
        Span::styled(format!(" {}", padded(name, NAMES)), theme.head()),
        Span::raw(format!(" {}", device.title)),
        Span::styled(format!("  {how}"), theme.good()),
    ]));
    for port in device.ports {
        lines.push(port_line(model, plc, port, fitted.port(port.number), theme));
    }
}

fn port_line(model: &Model, plc: DeviceIndex, port: &'static Port, fit: Fit, theme: Theme) -> Line<'static> {
    let role = match fit {
        Fit::Empty => "empty".to_owned(),
        Fit::Unknown => String::new(),
        Fit::As(role) => role.to_string(),
    };
    let state = status_of(port.area).and_then(|status| {
        let value = model.value(MemoryLocation::register(plc, &status))?;
        Some((status.format_value(value), status.decode(value)))
    });
    let (value, meaning) = state.unwrap_or_default();
    Line::from(vec![
        Span::styled(format!("   {}", padded(port.name, NAMES - 2)), theme.name()),
        Span::raw(format!(" {}", padded(&role, 8))),
        Span::styled(format!("{value} "), theme.value()),
        Span::raw(meaning),
    ])
}

fn bus_lines(
    bus: &BusScene,
    drives: &[&ChartedDrive],
    state: Option<&BusState>,
    theme: Theme,
    lines: &mut Vec<Line<'static>>,
) {
    lines.push(Line::default());
    let interval = bus
        .interval
        .as_ref()
        .map_or(String::new(), |it| format!(", SYNC every {}", time::short(it.us.into())));
    lines.push(Line::from(vec![
        Span::styled(format!(" {}", padded(&bus.name, NAMES)), theme.head()),
        Span::raw(format!(" {} bus at {} kbit/s{interval}", bus.kind, f64::from(bus.bit_s) / 1000.0)),
        Span::styled(format!("  {}", bus.ports.join(", ")), theme.name()),
    ]));
    for shown in drives {
        let drive = &shown.entry.state;
        let sync = if drive.is_synchronized { ", synchronized" } else { "" };
        let fault = if drive.fault == 0 { String::new() } else { format!(", fault {}", drive.fault) };
        let number = drive.number.map_or_else(String::new, |number| format!("slave {number}"));
        lines.push(Line::from(vec![
            Span::styled(format!("   {}", padded(&shown.entry.name, NAMES - 2)), theme.name()),
            Span::raw(format!(" {} {}{sync}", padded(&number, 8), drive.state.replace('_', " "))),
            Span::styled(fault, theme.bad()),
        ]));
    }
    let Some(bus) = state else { return };
    for stranger in &bus.strangers {
        let rate = f64::from(stranger.bit_s) / 1000.0;
        let text = format!("   {} is set to {rate} kbit/s and cannot communicate", stranger.name);
        lines.push(Line::styled(text, theme.bad()));
    }
    for door in &bus.doors {
        let text = format!("   door {}", door.door);
        lines.push(Line::styled(text, theme.dim()));
    }
    for station in &bus.stations {
        let name = Span::styled(format!("   {}", padded(&station.name, NAMES - 2)), theme.name());
        if !station.counts_errors() {
            let address = station.address.map_or_else(String::new, |address| format!("address {address}, "));
            lines.push(Line::from(vec![
                name,
                Span::raw(format!(" {address}{}", station.state.replace('_', " "))),
            ]));
            continue;
        }
        let state = station.state.replace('_', "-");
        let is_good = station.state == "error_active";
        lines.push(Line::from(vec![
            name,
            Span::styled(format!(" {state}"), if is_good { theme.good() } else { theme.bad() }),
            Span::raw(format!(
                ", {} transmit and {} receive errors",
                station.transmit_errors, station.receive_errors
            )),
        ]));
    }
}
