//! Recorded actions as a scenario for `commram test`.

mod lines;

use super::link::Connection;
use super::problem::Problem;
use super::router::{body_of, json_response};
use super::{App, operations};
use crate::cli::snapshot;
use crate::input_file::LONGEST_SCRIPT;
use crate::plant::{PlantConfig, SnapshotFile};
use crate::request::{Code, Op};
use axum::extract::{Path, Request, State};
use axum::response::Response;
use lines::Line;
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;

/// Maximum number of recorded actions.
const MAX_ACTIONS: usize = 10_000;

/// Actions recorded by a client.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Recording {
    /// The plant file that the scenario names. Without it, the scenario contains the plant itself.
    plant: Option<String>,
    /// A comment for the first line of the scenario.
    #[serde(default)]
    name: String,
    /// The actions in the order in which they were done.
    actions: Vec<Action<Value>>,
}

/// An action of a user, recorded for a scenario.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Action<Operation = Op> {
    /// Emulated time of its start, in microseconds.
    time_us: u64,
    /// Emulated time of its end in microseconds, if the action advanced the clock or went back.
    end_us: Option<u64>,
    /// The recorded operation; in a request its JSON form, see [`operations::of_form`].
    operation: Option<Operation>,
    /// Name of the operation's register, if it differs from the name that the register has in the last phase of its
    /// overlaid structures.
    register: Option<String>,
    /// An expectation that the scenario checks.
    expect: Option<Expectation>,
    /// Title of a part of the scenario, which begins with this action.
    section: Option<String>,
}

impl Action<Value> {
    /// Builds the operation from its JSON form.
    ///
    /// # Errors
    /// The form is not that of an operation.
    fn parse(self) -> Result<Action, Problem> {
        let Action { time_us, end_us, operation, register, expect, section } = self;
        let operation = operation.map(operations::of_form).transpose()?;
        Ok(Action { time_us, end_us, operation, register, expect, section })
    }
}

/// An expectation on a register, or on the access checker.
#[derive(Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum Expectation {
    Register { register: String, value: Value },
    Findings { no_findings: bool },
}

/// Turns recorded actions into a scenario.
///
/// # Errors
/// A scenario cannot repeat an action (the problem contains the `index` of the action), or the scenario is too long.
pub(super) async fn answer(
    State(app): State<Arc<App>>,
    Path(instance): Path<String>,
    request: Request,
) -> Result<Response, Problem> {
    let form = Value::Object(body_of(request).await?);
    let mut recording: Recording = serde_json::from_value(form)
        .map_err(|reason| Problem::wrong_use(format!("this is no recording: {reason}")))?;
    if recording.actions.len() > MAX_ACTIONS {
        return Err(Problem::wrong_use(format!("a recording has at most {MAX_ACTIONS} actions")));
    }
    let actions = core::mem::take(&mut recording.actions).into_iter().enumerate();
    let actions = actions
        .map(|(index, action)| action.parse().map_err(|problem| problem.in_list("action", index)))
        .collect::<Result<Vec<_>, _>>()?;
    let links = app.hub.find(&instance)?;
    // The plant is read from a snapshot; taking a snapshot changes nothing in the plant.
    let text = links.acts.run(move |connection| scenario(connection, &recording, &actions)).await;
    let text = text.inspect_err(|problem| app.notice(&instance, problem))?;
    Ok(json_response(&json!({ "scenario": text })))
}

fn scenario(
    connection: &mut Connection,
    recording: &Recording,
    actions: &[Action],
) -> Result<String, Problem> {
    let (mut lines, mut conditions): (Vec<Line>, Vec<_>) = (Vec::new(), Vec::new());
    for (index, action) in actions.iter().enumerate() {
        let added = lines::add(&mut lines, &mut conditions, connection, action);
        added.map_err(|right| {
            Problem::wrong_use(format!("action {index} cannot be recorded: {right}")).with("index", index)
        })?;
    }
    let mut text = String::new();
    if !recording.name.is_empty() {
        text += &format!("// {}\n", recording.name.replace(['\n', '\r'], " "));
    }
    text += &plant(connection, recording)?;
    text += &lines::text(&lines);
    if text.len() as u64 > LONGEST_SCRIPT {
        return Err(Problem::wrong_use(format!(
            "the scenario would have {} bytes, and `commram test` reads at most {LONGEST_SCRIPT}; record fewer actions, \
             or name the plant file in `plant`",
            text.len()
        )));
    }
    Ok(text)
}

/// Returns the line that builds the plant. The built-in plant needs no line.
fn plant(connection: &Connection, recording: &Recording) -> Result<String, Problem> {
    if let Some(file) = &recording.plant {
        return Ok(format!("plant({});\n", lines::quoted(file)));
    }
    let bytes = snapshot::take(&connection.session).map_err(|error| {
        let problem = Problem::from(error);
        match problem.code() == Some(Code::CLOCK_IS_REAL_TIME) {
            true => Problem::wrong_use(
                "the plant of an instance in real time is not known; name its plant file in `plant`",
            )
            .with("field", "plant"),
            false => problem,
        }
    })?;
    let wrong =
        |reason: &dyn std::fmt::Display| Problem::wrong_use(format!("the plant cannot be read: {reason}"));
    let file = SnapshotFile::of_bytes(&bytes).map_err(|reason| wrong(&reason))?;
    if PlantConfig::built_in().is_ok_and(|built_in| **built_in.text() == *file.plant) {
        return Ok(String::new());
    }
    Ok(format!("plant({});\n", lines::quoted(&file.plant)))
}
