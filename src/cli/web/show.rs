//! Data for the pages: what the commands print with `--format json`.

use super::App;
use super::problem::Problem;
use super::router::json_response;
use crate::cli::list;
use axum::extract::State;
use axum::response::Response;
use serde_json::json;
use std::sync::Arc;

/// The instances that this server serves.
pub(super) async fn instances(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    let mut entries = list::all()?;
    entries.retain(|entry| app.hub.serves(entry.name()));
    let version = env!("CARGO_PKG_VERSION");
    Ok(json_response(&json!({"instances": entries, "read_only": app.read_only, "version": version})))
}
