//! Signing in: the page exchanges the token for the key of a session, and sends the key in the header of each request. A cookie
//! would not do: a browser sends it to all ports of the host, and other users of the machine can have servers there.

use super::App;
use super::problem::Problem;
use super::router::{body_within, json_response};
use super::secret::Secret;
use crate::cli::error::CliError;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::json;
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Maximum number of browsers that are signed in; one more signs out the oldest.
const MAX_SESSIONS: usize = 64;

/// Maximum size of the body with the token, in bytes. It is small, because any client can send this request.
const MAX_TOKEN_BODY: usize = 1 << 10;

/// The keys of all browsers that are signed in, the oldest first.
#[derive(Default)]
pub(super) struct Sessions(Mutex<VecDeque<Secret>>);

impl Sessions {
    /// Signs a browser in, and returns its key.
    ///
    /// # Errors
    /// The kernel has no random numbers.
    pub(super) fn open(&self) -> io::Result<String> {
        let key = Secret::random()?;
        let digits = key.digits().to_owned();
        let mut keys = self.keys();
        if keys.len() >= MAX_SESSIONS {
            keys.pop_front();
        }
        keys.push_back(key);
        Ok(digits)
    }

    /// True if a browser with this key is signed in.
    pub(super) fn contains(&self, key: &str) -> bool {
        self.keys().iter().any(|known| known.is(key.as_bytes()))
    }

    /// Signs the browser with this key out.
    pub(super) fn close(&self, key: &str) {
        self.keys().retain(|known| !known.is(key.as_bytes()));
    }

    fn keys(&self) -> MutexGuard<'_, VecDeque<Secret>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Path of the session in the HTTP interface.
pub(super) const PATH: &str = "/api/v1/session";

/// Confirms that the client is signed in. The requests of other clients are refused before this function is called.
pub(super) async fn check(State(app): State<Arc<App>>) -> Response {
    json_response(&json!({"read_only": app.read_only}))
}

/// Returns the key of a new session if the token is correct.
///
/// # Errors
/// The body is not an object with the token, or the kernel cannot provide random numbers.
pub(super) async fn open(State(app): State<Arc<App>>, request: Request<Body>) -> Result<Response, Problem> {
    let fields = body_within(request, MAX_TOKEN_BODY).await?;
    let token = fields.get("token").and_then(|token| token.as_str()).unwrap_or_default();
    if !app.guard.token.is(token.as_bytes()) {
        let detail =
            "this is not the token of this server; its address, as `commram web` printed it, has the token";
        return Err(Problem::new(StatusCode::UNAUTHORIZED, "unauthorized", detail));
    }
    let key = app.guard.sessions.open().map_err(|reason| CliError::Process { reason })?;
    Ok(json_response(&json!({ "key": key })))
}

/// Signs a browser out: invalidates its key.
pub(super) async fn close(State(app): State<Arc<App>>, headers: HeaderMap) -> Response {
    app.guard.sessions.close(bearer(&headers).unwrap_or_default());
    StatusCode::NO_CONTENT.into_response()
}

/// Returns the token or the key of a request.
pub(super) fn bearer(headers: &HeaderMap) -> Option<&str> {
    let text = headers.get(header::AUTHORIZATION)?.to_str().ok()?;
    let (scheme, secret) = text.split_at_checked("bearer ".len())?;
    scheme.eq_ignore_ascii_case("bearer ").then_some(secret)
}
