//! Signing in: the page exchanges the token for a cookie that scripts cannot read.

use super::App;
use super::problem::Problem;
use super::router::{body_of, json_response};
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::json;
use std::sync::Arc;

/// Its path.
pub(super) const PATH: &str = "/api/v1/session";

/// Confirms that the client is signed in; other clients do not get here.
pub(super) async fn check(State(app): State<Arc<App>>) -> Response {
    json_response(&json!({"read_only": app.read_only}))
}

/// Sets the cookie for the right token.
///
/// # Errors
/// The body is not an object with the token.
pub(super) async fn open(State(app): State<Arc<App>>, request: Request<Body>) -> Result<Response, Problem> {
    let fields = body_of(request).await?;
    let token = fields.get("token").and_then(|token| token.as_str()).unwrap_or_default();
    if !app.guard.token.is(token.as_bytes()) {
        let detail =
            "this is not the token of this server; its address, as `commram web` printed it, has the token";
        return Err(Problem::new(StatusCode::UNAUTHORIZED, "unauthorized", detail));
    }
    Ok(with_cookie(&format!(
        "{}={}; Path=/; HttpOnly; SameSite=Strict",
        app.guard.cookie,
        app.guard.key.digits()
    )))
}

/// Deletes the cookie.
pub(super) async fn close(State(app): State<Arc<App>>) -> Response {
    with_cookie(&format!("{}=; Path=/; HttpOnly; SameSite=Strict; Max-Age=0", app.guard.cookie))
}

fn with_cookie(cookie: &str) -> Response {
    let mut response = StatusCode::NO_CONTENT.into_response();
    // Names of instances and hexadecimal digits are valid in a header.
    if let Ok(value) = HeaderValue::from_str(cookie) {
        response.headers_mut().insert(header::SET_COOKIE, value);
    }
    response
}
