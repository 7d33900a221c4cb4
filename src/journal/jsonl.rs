//! One JSON object per line, for programs. `docs/journal.md` describes the fields; new versions may add fields
//! and kinds, and count `v` up when they change one.

use super::names::{Context, Place};
use super::text::{missed_frame, refusal};
use super::{Command, Event, Format, Names, Record};
use crate::bus::codec;
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
    #[serde(flatten)]
    what: What,
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

#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum What {
    Sync {
        bus: String,
    },
    Frame {
        bus: String,
        id: u16,
        data: String,
        text: String,
    },
    State {
        plc: String,
        node: u8,
        from: u16,
        to: u16,
        text: String,
    },
    Handshake {
        plc: String,
        node: u8,
        register: Option<String>,
        address: String,
        request: u16,
        answer: u16,
        #[serde(skip_serializing_if = "Option::is_none")]
        latency_us: Option<u32>,
    },
    Missed {
        plc: String,
        node: u8,
        frame: String,
    },
    Ignored {
        plc: String,
        node: u8,
        command: u16,
        why: &'static str,
    },
    InitRefused {
        plc: String,
        node: u8,
        reason: u8,
        text: String,
    },
    SlaveStatus {
        plc: String,
        node: u8,
        slave: u8,
        status: u8,
        text: String,
    },
    BaudRateMismatch {
        plc: String,
        node: u8,
        node_kbit_s: u16,
        bus_kbit_s: u16,
    },
    ChannelWrite {
        plc: String,
        register: Option<String>,
        address: String,
        width: u8,
        value: u32,
        #[serde(skip_serializing_if = "Option::is_none")]
        text: Option<String>,
    },
}

impl Jsonl {
    fn what(&mut self, record: &Record) -> What {
        let context = &mut self.context;
        let bus = |index| context.names.bus(index).into_owned();
        let plc = |index| context.names.plc(index).into_owned();
        match record.event {
            Event::SyncEdge { bus: index } => What::Sync { bus: bus(index) },
            Event::Frame { bus: index, frame } => What::Frame {
                bus: bus(index),
                id: frame.id(),
                data: frame.data().iter().map(|byte| format!("{byte:02X}")).collect(),
                text: codec::decode(&frame).map_or_else(|error| error.to_string(), |it| it.to_string()),
            },
            Event::State { origin, from, to } => {
                let text = decode(context.of_node(origin, "w_OPTION_STATUS"), to.into());
                What::State { plc: plc(origin.plc), node: origin.node, from, to, text }
            }
            Event::Handshake { origin, offset, request, answer } => {
                let (plc, node, latency_us) = (plc(origin.plc), origin.node, record.latency_us);
                let (register, address) = named(&context.handshake(origin.plc, offset));
                What::Handshake { plc, node, register, address, request, answer, latency_us }
            }
            Event::Missed { origin, what } => {
                What::Missed { plc: plc(origin.plc), node: origin.node, frame: missed_frame(what) }
            }
            Event::CommandIgnored { origin, value, why } => {
                let why = match why {
                    Command::Unknown => "unknown",
                    Command::NotNow => "not_now",
                };
                What::Ignored { plc: plc(origin.plc), node: origin.node, command: value, why }
            }
            Event::InitRefused { origin, reason } => {
                What::InitRefused { plc: plc(origin.plc), node: origin.node, reason, text: refusal(reason) }
            }
            Event::SlaveStatus { origin, slave, status } => {
                let text = decode(context.of_node(origin, &format!("a_STAT_SL[{slave}]")), status.into());
                What::SlaveStatus { plc: plc(origin.plc), node: origin.node, slave, status, text }
            }
            Event::BaudRateMismatch { origin, node_kbit_s, bus_kbit_s } => {
                What::BaudRateMismatch { plc: plc(origin.plc), node: origin.node, node_kbit_s, bus_kbit_s }
            }
            Event::ChannelWrite { plc: index, offset, width, value } => {
                let plc = plc(index);
                let place = context.accessed(index, offset, width);
                let (register, address) = named(&place);
                let text = place.meaning(value);
                What::ChannelWrite { plc, register, address, width, value, text }
            }
        }
    }
}

/// Name and address.
fn named(place: &Place) -> (Option<String>, String) {
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
        let seq = (!record.is_pending()).then_some(record.seq);
        write(&Line { v: VERSION, seq, time_us: record.time_us, repeated, what: self.what(record) }, out);
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
