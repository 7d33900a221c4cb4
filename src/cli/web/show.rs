//! Data for the pages: the same data that commands print with `--format json`.

mod map;
mod words;

use super::App;
use super::link::Connection;
use super::problem::Problem;
use super::router::{Pairs, json_response, pairs, repeated, switch};
use crate::cli::error::CliError;
use crate::cli::peek::{self, ReadTarget};
use crate::cli::session::number_of_bus;
use crate::cli::status::Status;
use crate::cli::view::{Frames, WindowFrames};
use crate::cli::{board, check, find, list, plot, snapshot, time};
use crate::devices;
use crate::fault::{FaultKind, Form};
use crate::identity::BusIndex;
use crate::plant::SnapshotFile;
use crate::plot::Picture;
use crate::request::{MAX_RECORDS, Op, read_journal};
use axum::body::Body;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderValue, header};
use axum::response::Response;
use serde::Serialize;
use serde_json::{Value, json};
use std::sync::Arc;

/// Number of journal records that are searched for frames.
const FRAME_RECORDS: u64 = 4 * MAX_RECORDS as u64;
/// Maximum number of intervals in an answer.
const MAX_INTERVALS: usize = 64;

/// Returns the instances that this server serves.
///
/// # Errors
/// The directory of the images cannot be read.
pub(super) async fn instances(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    let mut entries = list::all()?;
    entries.retain(|entry| app.hub.serves(entry.name()));
    let version = env!("CARGO_PKG_VERSION");
    Ok(json_response(&json!({"instances": entries, "read_only": app.read_only, "version": version})))
}

/// Fields that a query may have several times.
const REPEATABLE: [&str; 8] = ["name", "poke", "force", "unforce", "condition", "board", "fault", "sync"];

/// The content of an answer.
enum Shown {
    Json(Value),
    /// A picture in SVG.
    Svg(Vec<u8>),
}

/// The fields of a query.
struct Fields<'a> {
    what: &'a str,
    pairs: &'a [(String, String)],
}

impl Fields<'_> {
    fn text(&self, name: &str) -> Option<&str> {
        self.pairs.iter().find(|(known, _)| known == name).map(|(_, text)| text.as_str())
    }

    /// Returns a field that may be repeated.
    fn all<'b>(&'b self, name: &'b str) -> impl Iterator<Item = &'b str> {
        self.pairs.iter().filter(move |(known, _)| known == name).map(|(_, text)| text.as_str())
    }

    fn needed(&self, name: &str) -> Result<&str, Problem> {
        let missing = || {
            Problem::wrong_use(format!("{}: the field `{name}` is missing", self.what)).with("field", name)
        };
        self.text(name).ok_or_else(missing)
    }

    fn is_on(&self, name: &str) -> Result<bool, Problem> {
        self.text(name).map_or(Ok(false), |text| switch(self.what, name, text))
    }

    /// Refuses unknown fields, and repeated fields that may occur only once.
    fn check(&self, known: &[&str]) -> Result<(), Problem> {
        let names = self.pairs.iter().map(|(name, _)| name.as_str());
        if let Some(name) = repeated(names.filter(|name| !REPEATABLE.contains(name))) {
            let detail = format!("{}: the field `{name}` occurs twice", self.what);
            return Err(Problem::wrong_use(detail).with("field", name));
        }
        match self.pairs.iter().find(|(name, _)| !known.contains(&name.as_str())) {
            Some((name, _)) => {
                let detail = format!("{}: unknown field `{name}`, known are {}", self.what, known.join(", "));
                Err(Problem::wrong_use(detail).with("field", name.as_str()))
            }
            None => Ok(()),
        }
    }
}

type Show = fn(&mut Connection, &Fields<'_>) -> Result<Shown, Problem>;

/// The data that can be shown: name, fields, description, function of each.
const SHOWN: &[(&str, &[&str], &str, Show)] = &[
    ("status", &[], "The plant, as `commram status` shows it.", status),
    (
        "registers",
        &["name"],
        "Values of registers with their meaning, as `commram peek`. `name` may be repeated.",
        registers,
    ),
    (
        "map",
        &["plc", "what", "full"],
        "The register map of a PLC as `commram map`, with positions in the image.",
        map::show,
    ),
    ("find", &["text", "full"], "Search in the register maps, as `commram find`.", search),
    ("boards", &["plc"], "Front panel, supply and program, as `commram board get`.", boards),
    ("devices", &[], "Devices of the PLCs with their ports, switches and displays.", map::devices),
    ("objects", &["plc"], "Object dictionary of a PLC's device.", map::objects),
    ("frames", &["bus", "count"], "The last intervals of a bus with their frames.", frames),
    ("rules", &[], "Rules of the access checker, as `commram check --rules`.", rules),
    ("fault-kinds", &[], "Kinds of faults with their fields.", fault_kinds),
    (
        "operations",
        &["poke", "force", "unforce", "condition", "board", "fault", "sync"],
        "Operations for words of the command line: `poke=REG=VALUE`, `fault=KIND FIELD=VALUE`. Fields may be repeated.",
        words::show,
    ),
    ("plant", &[], "The plant file; with a stepped clock only.", plant),
    ("plot.svg", &["name", "since", "until"], "Values of registers over time, as `commram plot`.", picture),
];

/// Data that can be shown, for the OpenAPI description: name, fields, text.
pub(super) fn described() -> impl Iterator<Item = (&'static str, &'static [&'static str], &'static str)> {
    SHOWN.iter().map(|(name, fields, text, _)| (*name, *fields, *text))
}

/// Answers a request for data.
///
/// # Errors
/// No data has this name, a field is wrong, or the emulator has ended.
pub(super) async fn answer(
    State(app): State<Arc<App>>,
    Path((instance, what)): Path<(String, String)>,
    query: Result<Query<Pairs>, QueryRejection>,
) -> Result<Response, Problem> {
    let pairs = pairs(query)?;
    let found = SHOWN.iter().find(|(name, ..)| *name == what);
    let unknown = || {
        let names: Vec<_> = SHOWN.iter().map(|(name, ..)| *name).collect();
        Problem::not_found(format!("there is no `{what}` to show, but {}", names.join(", ")))
    };
    let &(what, known, _, show) = found.ok_or_else(unknown)?;
    let links = app.hub.find(&instance)?;
    let shown = links.looks.run(move |connection| {
        let fields = Fields { what, pairs: &pairs };
        fields.check(known)?;
        show(connection, &fields)
    });
    match shown.await.inspect_err(|problem| app.notice(&instance, problem))? {
        Shown::Json(value) => Ok(json_response(&value)),
        Shown::Svg(bytes) => {
            let mut response = Response::new(Body::from(bytes));
            response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("image/svg+xml"));
            Ok(response)
        }
    }
}

/// Returns an object with one field.
fn named(name: &str, value: impl Serialize) -> Result<Shown, Problem> {
    let value = serde_json::to_value(value).map_err(|reason| Problem::wrong_use(reason.to_string()))?;
    Ok(Shown::Json(json!({ name: value })))
}

fn status(connection: &mut Connection, _: &Fields<'_>) -> Result<Shown, Problem> {
    named("status", Status::of(&connection.session)?)
}

fn registers(connection: &mut Connection, fields: &Fields<'_>) -> Result<Shown, Problem> {
    let targets = fields.all("name").map(|name| ReadTarget::find(&connection.session, name));
    let targets = targets.collect::<Result<Vec<_>, CliError>>()?;
    named("registers", peek::read(&connection.session, &targets)?)
}

fn search(connection: &mut Connection, fields: &Fields<'_>) -> Result<Shown, Problem> {
    let fitted = find::distinct(connection.session.all_fitted());
    let words = find::words([fields.needed("text")?]);
    named("entries", find::entries_with(&fitted, &words, fields.is_on("full")?))
}

fn boards(connection: &mut Connection, fields: &Fields<'_>) -> Result<Shown, Problem> {
    named("boards", board::entries(&connection.session, fields.text("plc"))?)
}

fn rules(_: &mut Connection, _: &Fields<'_>) -> Result<Shown, Problem> {
    named("rules", check::rules())
}

fn fault_kinds(connection: &mut Connection, _: &Fields<'_>) -> Result<Shown, Problem> {
    let kinds = devices::emulation::catalogue::fault_kinds_of(&connection.names);
    named("kinds", kinds.into_iter().map(kind_of_fault).collect::<Vec<_>>())
}

fn kind_of_fault(kind: &'static FaultKind) -> Value {
    let fields = kind.usable_fields().map(|field| {
        let (least, most) = field.range();
        let (form, words): (_, &[&str]) = match field.form() {
            Form::Name => ("name", &[]),
            Form::Port => ("port", &[]),
            Form::Word(words) => ("word", words),
            Form::Number { .. } => ("number", &[]),
            Form::Hex { .. } => ("hex", &[]),
            Form::Time { .. } => ("time", &[]),
        };
        json!({
            "name": field.name(), "about": field.about(), "form": form, "words": words,
            "least": least, "most": most, "required": field.is_required(),
        })
    });
    json!({
        "kind": kind.name(), "about": kind.about(), "example": kind.example(), "once": kind.happens_once(),
        "fields": fields.collect::<Vec<_>>(),
    })
}

fn frames(connection: &mut Connection, fields: &Fields<'_>) -> Result<Shown, Problem> {
    let name = fields.needed("bus")?;
    let bus = number_of_bus(connection.session.instance(), &connection.names.buses, name)?;
    let count = fields
        .text("count")
        .map_or(Ok(1), str::parse)
        .ok()
        .filter(|count| (1..=MAX_INTERVALS).contains(count));
    let count = count.ok_or_else(|| {
        Problem::wrong_use(format!("frames: `count` is a number from 1 to {MAX_INTERVALS}"))
    })?;
    named("intervals", latest_frames(connection, bus, count)?)
}

fn latest_frames(
    connection: &Connection,
    bus: BusIndex,
    count: usize,
) -> Result<Vec<WindowFrames>, CliError> {
    let session = &connection.session;
    let end = session.journal_end()?;
    let info = session.info()?;
    let scene = session.ask(Op::Scene)?.scene()?;
    let part = read_journal(end.saturating_sub(FRAME_RECORDS), |op| session.ask(op))?;
    let mut frames = Frames::default();
    frames.take(&part.records, &part.pending, &connection.names, &scene);
    Ok(frames.latest_windows(bus, &info, &scene, count))
}

fn plant(connection: &mut Connection, _: &Fields<'_>) -> Result<Shown, Problem> {
    let bytes = snapshot::take(&connection.session)?;
    let file = SnapshotFile::of_bytes(&bytes).map_err(|reason| Problem::wrong_use(reason.to_string()))?;
    named("plant", file.plant)
}

fn picture(connection: &mut Connection, fields: &Fields<'_>) -> Result<Shown, Problem> {
    let names: Vec<String> = fields.all("name").map(str::to_owned).collect();
    let moment = |name: &str| {
        let wrong = |reason: time::TimeError| Problem::wrong_use(format!("plot.svg: `{name}`: {reason}"));
        fields.text(name).map(time::parse).transpose().map_err(wrong)
    };
    let (since, until) = (moment("since")?.unwrap_or(0), moment("until")?);
    let plot = plot::of_session(&connection.session, &names, since, until)?;
    let bytes = plot.render(Picture::Svg).map_err(|reason| Problem::wrong_use(reason.to_string()))?;
    Ok(Shown::Svg(bytes))
}
