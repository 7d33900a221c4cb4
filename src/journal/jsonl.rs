//! One JSON object per line, for programs. `docs/journal.md` describes the fields; new versions may add fields
//! and kinds, and count `v` up when they change one.

use super::names::{self, Context};
use super::text::{missed_frame, refusal};
use super::{Command, Event, FaultNews, Format, Names, Origin, Record, Source};
use crate::devices::cansync::bus::codec;
use crate::fault::{self, Target};
use crate::layout::RegisterRef;
use serde::Serialize;

/// Version of the format, in every line.
const VERSION: u8 = 1;

/// Writes records as JSON Lines.
pub struct Jsonl {
    context: Context,
}

impl Jsonl {
    /// A writer with these names.
    pub fn new(names: Names) -> Self {
        Jsonl { context: Context::new(names) }
    }
}

#[derive(Serialize)]
struct Line {
    v: u8,
    seq: Option<u64>,
    time_us: u64,
    #[serde(flatten)]
    repeated: Option<Repeated>,
    kind: &'static str,
    #[serde(flatten)]
    place: Place,
    #[serde(flatten)]
    what: What,
    #[serde(skip_serializing_if = "Option::is_none")]
    latency_us: Option<u32>,
}

#[derive(Serialize)]
struct Repeated {
    count: u32,
    period_us: u32,
    first_us: u64,
}

#[derive(Serialize)]
struct Gap {
    v: u8,
    kind: &'static str,
    lost: u64,
}

/// What it happened to.
#[derive(Serialize)]
#[serde(untagged)]
enum Place {
    Bus { bus: String },
    Plc { plc: String },
    Node { plc: String, node: u8 },
}

/// The fields that belong to one kind each.
#[derive(Serialize)]
#[serde(untagged)]
enum What {
    Sync {},
    Frame {
        id: u16,
        data: String,
        text: String,
    },
    State {
        from: u16,
        to: u16,
        text: String,
    },
    Handshake {
        register: Option<String>,
        address: String,
        request: u16,
        answer: u16,
    },
    Register {
        register: Option<String>,
        address: String,
        from: u32,
        to: u32,
        #[serde(skip_serializing_if = "Option::is_none")]
        text: Option<String>,
    },
    Missed {
        frame: String,
    },
    Ignored {
        command: u16,
        why: &'static str,
    },
    InitRefused {
        reason: u8,
        text: String,
    },
    SlaveStatus {
        slave: u8,
        status: u8,
        text: String,
    },
    BaudRateMismatch {
        node_kbit_s: u16,
        bus_kbit_s: u16,
    },
    ChannelWrite {
        register: Option<String>,
        address: String,
        width: u8,
        value: u32,
        #[serde(skip_serializing_if = "Option::is_none")]
        text: Option<String>,
    },
    Board {
        what: &'static str,
        text: String,
    },
    Force {
        register: Option<String>,
        address: String,
        width: u8,
        value: u32,
    },
    Unforce {
        register: Option<String>,
        address: String,
    },
    Fault {
        fault: u16,
        what: &'static str,
        #[serde(skip_serializing_if = "Option::is_none")]
        slave: Option<u8>,
        news: &'static str,
        #[serde(skip_serializing_if = "Option::is_none")]
        id: Option<i32>,
        #[serde(skip_serializing_if = "Option::is_none")]
        shift_us: Option<i32>,
    },
    Finding {
        rule: &'static str,
        severity: &'static str,
        register: Option<String>,
        address: String,
        value: u32,
        #[serde(skip_serializing_if = "Option::is_none")]
        late_us: Option<u32>,
        text: &'static str,
    },
}

/// Name of the news, and what a hit concerns.
fn fault_news(kind: fault::Kind, news: FaultNews) -> (&'static str, Option<i32>, Option<i32>) {
    match news {
        FaultNews::Added => ("added", None, None),
        FaultNews::Over => ("over", None, None),
        FaultNews::Cleared => ("cleared", None, None),
        FaultNews::Hit(detail) => match kind {
            kind if kind.hits_speak_for_themselves() => ("hit", None, None),
            fault::Kind::JitterSync => ("hit", None, Some(detail)),
            _ => ("hit", Some(detail), None),
        },
    }
}

impl Jsonl {
    fn place(&self, source: Source) -> Place {
        let names = &self.context.names;
        match source {
            Source::Bus(index) => Place::Bus { bus: names.bus(index).into_owned() },
            Source::Plc(index) => Place::Plc { plc: names.plc(index).into_owned() },
            Source::Node(Origin { plc, node }) => Place::Node { plc: names.plc(plc).into_owned(), node },
        }
    }

    fn what(&mut self, record: &Record) -> What {
        let context = &mut self.context;
        match record.event {
            Event::SyncEdge { .. } => What::Sync {},
            Event::Frame { frame, .. } => What::Frame {
                id: frame.id(),
                data: frame.data().iter().map(|byte| format!("{byte:02X}")).collect(),
                text: codec::decode(&frame).map_or_else(|error| error.to_string(), |it| it.to_string()),
            },
            Event::State { origin, from, to } => {
                let text = decode(context.of_node(origin, "w_OPTION_STATUS"), to.into());
                What::State { from, to, text }
            }
            Event::Handshake { origin, offset, request, answer } => {
                let (register, address) = named(&context.whole(origin.plc, offset));
                What::Handshake { register, address, request, answer }
            }
            Event::Register { origin, offset, from, to } => {
                let place = context.whole(origin.plc, offset);
                let (register, address) = named(&place);
                What::Register { register, address, from, to, text: place.meaning(to) }
            }
            Event::Missed { what, .. } => What::Missed { frame: missed_frame(what) },
            Event::CommandIgnored { value, why, .. } => {
                let why = match why {
                    Command::Unknown => "unknown",
                    Command::NotNow => "not_now",
                    Command::LeftBehind => "left_behind",
                };
                What::Ignored { command: value, why }
            }
            Event::InitRefused { reason, .. } => What::InitRefused { reason, text: refusal(reason) },
            Event::SlaveStatus { origin, slave, status } => {
                let text = decode(context.of_node(origin, &format!("a_STAT_SL[{slave}]")), status.into());
                What::SlaveStatus { slave, status, text }
            }
            Event::BaudRateMismatch { node_kbit_s, bus_kbit_s, .. } => {
                What::BaudRateMismatch { node_kbit_s, bus_kbit_s }
            }
            Event::ChannelWrite { plc, offset, width, value } => {
                let place = context.accessed(plc, offset, width);
                let (register, address) = named(&place);
                What::ChannelWrite { register, address, width, value, text: place.meaning(value) }
            }
            Event::Board { what, .. } => What::Board { what: what.name(), text: what.text() },
            Event::Force { plc, offset, width, value } => {
                let (register, address) = named(&context.accessed(plc, offset, width));
                What::Force { register, address, width, value }
            }
            Event::Unforce { plc, offset } => {
                let (register, address) = named(&context.whole(plc, offset));
                What::Unforce { register, address }
            }
            Event::Fault { id: fault, kind, target, news } => {
                let slave = match target {
                    Target::Slave { slave, .. } => Some(slave),
                    Target::Bus(_) | Target::Node { .. } => None,
                };
                let (news, id, shift_us) = fault_news(kind, news);
                What::Fault { fault, what: kind.name(), slave, news, id, shift_us }
            }
            Event::Finding(finding) => What::Finding {
                rule: finding.rule.id(),
                severity: finding.rule.severity().name(),
                register: finding.name(),
                address: finding.address().to_string(),
                value: finding.value,
                late_us: Some(finding.late_us).filter(|late| *late > 0),
                text: finding.rule.text(),
            },
        }
    }
}

/// Name and address.
fn named(place: &names::Place) -> (Option<String>, String) {
    (place.register.map(|register| register.name()), place.address.to_string())
}

fn decode(register: Option<RegisterRef>, value: u32) -> String {
    register.map(|register| register.decode(value)).unwrap_or_default()
}

impl Format for Jsonl {
    fn record(&mut self, record: &Record, out: &mut String) {
        self.context.observe(record);
        let repeated = (record.count > 1).then(|| Repeated {
            count: record.count,
            period_us: record.period_us,
            first_us: record.first_us(),
        });
        let line = Line {
            v: VERSION,
            seq: (!record.is_pending()).then_some(record.seq),
            time_us: record.time_us,
            repeated,
            kind: record.event.kind().name(),
            place: self.place(record.event.source()),
            what: self.what(record),
            latency_us: record.latency_us,
        };
        write(&line, out);
    }

    fn skip(&mut self, record: &Record) {
        self.context.observe(record);
    }

    fn gap(&mut self, lost: u64, out: &mut String) -> bool {
        self.context.gap();
        write(&Gap { v: VERSION, kind: "gap", lost }, out);
        true
    }
}

fn write(line: &impl Serialize, out: &mut String) {
    // Numbers and strings under fixed names: there is nothing that could not be written.
    out.push_str(&serde_json::to_string(line).unwrap_or_default());
    out.push('\n');
}
