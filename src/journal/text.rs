//! One line per record, for people.

use super::names::Context;
use super::{Command, Event, FaultNews, Format, Missed, Names, Record};
use crate::check::Finding;
use crate::devices::cansync::bus::Frame;
use crate::devices::cansync::bus::codec;
use crate::devices::cansync::firmware::InitFault;
use crate::fault::{self, Target};
use crate::layout::RegisterRef;
use std::fmt::Write;

/// Writes records as lines of text: time, source, what happened.
pub struct Text {
    context: Context,
    /// Width of the column of sources.
    width: usize,
}

impl Text {
    /// A writer with these names.
    pub fn new(names: Names) -> Self {
        let nodes = names.plcs.iter().map(|name| name.len() + ":node1".len());
        let width = nodes.chain(names.buses.iter().map(String::len)).max().unwrap_or(0);
        Text { context: Context::new(names), width }
    }

    fn what(&mut self, event: &Event) -> String {
        match *event {
            Event::SyncEdge { .. } => "SYNC".to_owned(),
            Event::Frame { frame, .. } => frame_text(&frame),
            Event::State { origin, from, to } => {
                let status = self.context.of_node(origin, "w_OPTION_STATUS");
                let before = value(status.as_ref(), from.into());
                format!("{} {before} -> {}", label(status.as_ref()), with_meaning(status.as_ref(), to.into()))
            }
            Event::Handshake { origin, offset, request, answer } => {
                let place = self.context.whole(origin.plc, offset);
                let [request, answer] = [request, answer].map(|value| place.value(value.into()));
                format!("{} {request} -> {answer}", place.label())
            }
            Event::Register { origin, offset, from, to } => {
                let place = self.context.whole(origin.plc, offset);
                let meaning = place.meaning(to).map(|meaning| format!(", {meaning}")).unwrap_or_default();
                format!("{} {} -> {}{meaning}", place.label(), place.value(from), place.value(to))
            }
            Event::Missed { what, .. } => format!("missed: {}", missed_text(what)),
            Event::CommandIgnored { origin, value: command, why } => {
                let control = self.context.of_node(origin, "w_CPU_CONTROL");
                let why = match why {
                    Command::Unknown => "no such command",
                    Command::NotNow => "not possible in this state",
                    Command::LeftBehind => "left behind by clearing bit 7",
                };
                let text = value(control.as_ref(), command.into());
                format!("{} {text} ignored: {why}", label(control.as_ref()))
            }
            Event::InitRefused { reason, .. } => {
                format!("initialization data refused: {}", refusal(reason))
            }
            Event::SlaveStatus { origin, slave, status } => {
                let register = self.context.of_node(origin, &format!("a_STAT_SL[{slave}]"));
                format!("{} {}", label(register.as_ref()), with_meaning(register.as_ref(), status.into()))
            }
            Event::BaudRateMismatch { origin, node_kbit_s, bus_kbit_s } if origin.node == 1 => {
                format!("is set to {node_kbit_s} kbit/s, its bus runs at {bus_kbit_s}: it hears nothing")
            }
            Event::BaudRateMismatch { node_kbit_s, bus_kbit_s, .. } => format!(
                "is set to {node_kbit_s} kbit/s and passes on the SYNC signal of a bus at {bus_kbit_s}: nobody \
                 synchronizes"
            ),
            Event::ChannelWrite { plc, offset, width, value } => {
                let place = self.context.accessed(plc, offset, width);
                let meaning = place.meaning(value).map(|meaning| format!(" ({meaning})")).unwrap_or_default();
                format!("{} := {}{meaning}", place.label(), place.value(value))
            }
            Event::Board { what, .. } => what.text(),
            Event::Force { plc, offset, width, value } => {
                let place = self.context.accessed(plc, offset, width);
                format!("{} forced to {}", place.label(), place.value(value))
            }
            Event::Unforce { plc, offset } => {
                format!("{} no longer forced", self.context.whole(plc, offset).label())
            }
            Event::Fault { id, kind, target, news } => {
                let slave = match target {
                    Target::Slave { slave, .. } => format!(" of slave {slave}"),
                    Target::Bus(_) | Target::Node { .. } => String::new(),
                };
                format!("fault {id}, {}{slave}: {}", kind.name(), news_text(kind, news))
            }
            Event::Finding(finding) => finding_text(&finding),
        }
    }
}

impl Format for Text {
    fn record(&mut self, record: &Record, out: &mut String) {
        self.context.observe(record);
        let (source, what) = (self.context.names.source(record.event.source()), self.what(&record.event));
        let width = self.width;
        // Writing to a String cannot fail.
        let _ = write!(out, "{}  {source:width$}  {what}", seconds(record.time_us));
        if let Some(latency) = record.latency_us {
            let _ = write!(out, ", answered after {latency} us");
        }
        if record.count > 1 {
            let (count, period) = (record.count, record.period_us);
            let _ = write!(
                out,
                ", {count} times every {period} us since {}",
                seconds(record.first_us()).trim_start()
            );
        }
        if record.is_pending() {
            out.push_str(", going on");
        }
        out.push('\n');
    }

    fn skip(&mut self, record: &Record) {
        self.context.observe(record);
    }

    fn gap(&mut self, lost: u64, out: &mut String) -> bool {
        self.context.gap();
        let _ = writeln!(out, "-- {lost} records lost here --");
        true
    }
}

/// `    12.345678 s`
fn seconds(us: u64) -> String {
    format!("{:>6}.{:06} s", us / 1_000_000, us % 1_000_000)
}

fn label(register: Option<&RegisterRef>) -> String {
    register
        .map_or_else(|| "?".to_owned(), |register| format!("{} ({})", register.path(), register.address()))
}

fn value(register: Option<&RegisterRef>, value: u32) -> String {
    register.map_or_else(|| format!("16#{value:04X}"), |register| register.format_value(value))
}

fn with_meaning(register: Option<&RegisterRef>, bits: u32) -> String {
    let meaning = register.map(|register| register.decode(bits)).unwrap_or_default();
    format!("{}, {meaning}", value(register, bits))
}

/// The frame taken apart, or its bytes and why that cannot be done.
pub(crate) fn frame_text(frame: &Frame) -> String {
    match codec::decode(frame) {
        Ok(decoded) => format!("16#{:03X} {decoded}", frame.id()),
        Err(error) => {
            let bytes: String = frame.data().iter().map(|byte| format!(" {byte:02X}")).collect();
            format!("16#{:03X}{bytes}: {error}", frame.id())
        }
    }
}

fn finding_text(finding: &Finding) -> String {
    let Finding { rule, late_us, .. } = *finding;
    let name = finding.name().unwrap_or_default();
    let late = if late_us > 0 { format!(", {late_us} us late") } else { String::new() };
    let (severity, address, value) = (rule.severity(), finding.address(), finding.value_text());
    format!("{severity} {rule}: {name} ({address}) {value}{late}")
}

fn missed_text(missed: Missed) -> String {
    match missed {
        Missed::ReferenceValue(channel) => {
            format!("WRC{channel} is left out in this interval, b_CTRLREG_WRC{channel} was not 16#05 in time")
        }
        Missed::ActualValue(channel) => {
            format!(
                "RDC{channel} is left out in this interval, b_CTRLREG_RD_RDC{channel} was not 16#05 in time"
            )
        }
    }
}

fn news_text(kind: fault::Kind, news: FaultNews) -> String {
    match (news, kind) {
        (FaultNews::Added, _) => "added".to_owned(),
        (FaultNews::Hit(_), kind) if kind.hits_speak_for_themselves() => "hits".to_owned(),
        (FaultNews::Hit(us), fault::Kind::JitterSync) => format!("hits, edge moved by {us:+} us"),
        (FaultNews::Hit(id), _) => format!("hits frame 16#{id:03X}"),
        (FaultNews::Over, _) => "over".to_owned(),
        (FaultNews::Cleared, _) => "cleared".to_owned(),
    }
}

/// Why initialization data were refused.
pub(super) fn refusal(reason: u8) -> String {
    InitFault::from_number(reason).map_or_else(|| format!("reason {reason}"), |fault| fault.to_string())
}

/// What the node missed, as short as on the bus: `WRC1`.
pub(super) fn missed_frame(missed: Missed) -> String {
    match missed {
        Missed::ReferenceValue(channel) => format!("WRC{channel}"),
        Missed::ActualValue(channel) => format!("RDC{channel}"),
    }
}
