//! The paths of the HTTP interface.

use super::App;
use super::distinct::Distinct;
use super::problem::Problem;
use super::{assets, events, guard, openapi, operations, scenario, session, show};
use axum::RequestExt as _;
use axum::Router;
use axum::body::{Body, Bytes, HttpBody as _, to_bytes};
use axum::extract::rejection::QueryRejection;
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get, post};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;

/// Maximum size of the body of a request, in bytes.
const MAX_BODY: usize = 1 << 20;
/// Maximum time to receive a body.
const BODY_TIME: Duration = Duration::from_secs(10);

/// Fields of a query string, in their original order.
pub(super) type Pairs = Vec<(String, String)>;

/// Returns the router with all paths of the server.
pub(super) fn router(app: Arc<App>) -> Router {
    Router::new()
        .route(session::PATH, get(session::check).post(session::open).delete(session::close))
        .route("/api/v1/openapi.json", get(openapi::answer))
        .route("/api/v1/instances", get(show::instances))
        .route("/api/v1/instances/{instance}/request", post(request))
        .route("/api/v1/instances/{instance}/events", get(events::answer))
        .route("/api/v1/instances/{instance}/show/{what}", get(show::answer))
        .route("/api/v1/instances/{instance}/scenario", post(scenario::answer))
        .route("/api/v1/instances/{instance}/{operation}", any(operation))
        .fallback(asset)
        .method_not_allowed_fallback(wrong_method)
        .layer(from_fn_with_state(Arc::clone(&app), check))
        .with_state(app)
}

async fn check(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let has_transfer_encoding = request.headers().contains_key(header::TRANSFER_ENCODING);
    let mut has_unread_body = request.body().size_hint().exact() != Some(0);
    let received = match app.guard.check(&request) {
        // Without a token, only a short body is read, by the handler.
        Ok(()) if request.uri().path() == session::PATH => Ok(request),
        Ok(()) => receive(request).await.inspect(|_| has_unread_body = false),
        Err(problem) => Err(problem),
    };
    let mut response = match received {
        Ok(request) => next.run(request).await,
        Err(problem) => problem.into_response(),
    };
    if is_plain_error(&response) {
        response = plain_problem(response).await.into_response();
    }
    // The rest of an unread body would be the begin of the next request, so the connection ends (RFC 9112, 9.6). A
    // request with Transfer-Encoding may also have had a Content-Length, which hyper removes. A proxy that divides the
    // requests by the length must not send another request on this connection (RFC 9112, 6.1).
    if has_transfer_encoding || has_unread_body && !response.status().is_success() {
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    guard::protect(response.headers_mut());
    response
}

/// Receives the body of a request, so that the connection can be used again even if a handler does not use the body.
///
/// # Errors
/// The body is too large, arrives too slowly, or is malformed.
async fn receive(request: Request) -> Result<Request, Problem> {
    let (head, body) = request.into_parts();
    let bytes = bytes_within(Request::new(body), MAX_BODY).await?;
    Ok(Request::from_parts(head, Body::from(bytes)))
}

/// True if axum itself produced the error, for example for a path that is not UTF-8.
fn is_plain_error(response: &Response) -> bool {
    let kind = response.headers().get(header::CONTENT_TYPE).map(HeaderValue::as_bytes).unwrap_or_default();
    (response.status().is_client_error() || response.status().is_server_error())
        && kind.starts_with(b"text/plain")
}

async fn plain_problem(response: Response) -> Problem {
    let status = response.status();
    let text = to_bytes(response.into_body(), MAX_BODY).await.unwrap_or_default();
    Problem::new(status, "wrong-use", String::from_utf8_lossy(&text))
}

async fn asset(request: Request) -> Result<Response, Problem> {
    if request.uri().path().starts_with("/api/") {
        return Err(Problem::not_found(format!("there is no path {}", request.uri().path())));
    }
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return Err(needs(&Method::GET));
    }
    Ok(assets::answer(request.uri().path(), request.headers()))
}

/// The path does not support this method.
async fn wrong_method(request: Request) -> Problem {
    let detail = format!("{} does not know the method {}", request.uri().path(), request.method());
    Problem::new(StatusCode::METHOD_NOT_ALLOWED, "method", detail)
}

fn needs(method: &Method) -> Problem {
    let detail = format!("this path needs the method {method}");
    Problem::new(StatusCode::METHOD_NOT_ALLOWED, "method", detail).with("allow", method.as_str())
}

/// Handles an operation of the table. Its fields are in the query, or in the body of a POST.
async fn operation(
    State(app): State<Arc<App>>,
    Path((instance, name)): Path<(String, String)>,
    query: Result<Query<Pairs>, QueryRejection>,
    request: Request,
) -> Result<Response, Problem> {
    let found = operations::find(&name);
    let operation = found.ok_or_else(|| Problem::not_found(format!("there is no operation `{name}`")))?;
    let method = operations::method(operation);
    let is_right = *request.method() == method || method == Method::GET && request.method() == Method::HEAD;
    if !is_right {
        return Err(needs(&method));
    }
    let session = app.guard.session_of(request.headers());
    let fields = match method {
        Method::GET => operations::fields_of_query(operation, pairs(query)?)?,
        _ => body_of(request).await?,
    };
    let op = operations::with_fields(operation, fields)?;
    app.check_writes(&op)?;
    let links = app.hub.find(&instance)?;
    let reply = operations::execute(&links, session, op)
        .await
        .inspect_err(|problem| app.notice(&instance, problem))?;
    Ok(json_response(&reply))
}

/// Handles several operations as one request.
async fn request(
    State(app): State<Arc<App>>,
    Path(instance): Path<String>,
    request: Request,
) -> Result<Response, Problem> {
    let session = app.guard.session_of(request.headers());
    let mut fields = body_of(request).await?;
    let form = fields.remove("operations").unwrap_or_default();
    let Value::Array(forms) = form else {
        return Err(Problem::wrong_use(format!("`operations` is {form}, not a list of operations")));
    };
    let ops = forms.into_iter().enumerate().map(|(index, form)| {
        operations::of_form(form).map_err(|problem| problem.in_list("operation", index))
    });
    let ops: Vec<_> = ops.collect::<Result<_, _>>()?;
    ops.iter().try_for_each(|op| app.check_writes(op))?;
    let links = app.hub.find(&instance)?;
    let replies = operations::execute_all(&links, session, ops)
        .await
        .inspect_err(|problem| app.notice(&instance, problem))?;
    Ok(json_response(&json!({ "replies": replies })))
}

/// True if the text of a query field switches it on. A field without a text is on.
pub(super) fn is_on(text: &str) -> bool {
    matches!(text, "" | "1" | "true")
}

/// Parses a field that is only a switch. `what` is the name of the request, for the error.
///
/// # Errors
/// The text is neither on nor off.
pub(super) fn switch(what: &str, field: &str, text: &str) -> Result<bool, Problem> {
    if is_on(text) || matches!(text, "0" | "false") {
        return Ok(is_on(text));
    }
    Err(Problem::wrong_use(format!("{what}: field `{field}` is `{text}`, not 1 or 0")).with("field", field))
}

/// Returns the first name that occurs twice.
pub(super) fn repeated<'a>(mut names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let mut seen = HashSet::new();
    names.find(|name| !seen.insert(*name))
}

/// Returns the fields of a query string.
///
/// # Errors
/// The query string is malformed.
pub(super) fn pairs(query: Result<Query<Pairs>, QueryRejection>) -> Result<Pairs, Problem> {
    query.map(|Query(pairs)| pairs).map_err(|reason| Problem::wrong_use(reason.to_string()))
}

/// Returns the JSON object in the body of a request. A missing body counts as an empty object.
///
/// # Errors
/// The body is too large, arrives too slowly, or is not a JSON object.
pub(super) async fn body_of(request: Request) -> Result<Map<String, Value>, Problem> {
    body_within(request, MAX_BODY).await
}

/// Reads the body like [`body_of`], but with a limit of `max` bytes.
///
/// # Errors
/// Returns the errors of [`body_of`].
pub(super) async fn body_within(request: Request, max: usize) -> Result<Map<String, Value>, Problem> {
    let bytes = bytes_within(request, max).await?;
    if bytes.is_empty() {
        return Ok(Map::new());
    }
    json_of(&bytes)
}

/// Receives at most `max` bytes of a body.
async fn bytes_within(mut request: Request, max: usize) -> Result<Bytes, Problem> {
    let too_large = || {
        Problem::new(
            StatusCode::PAYLOAD_TOO_LARGE,
            "too-large",
            format!("the body has more than {max} bytes"),
        )
    };
    if request.body().size_hint().lower() > max as u64 {
        return Err(too_large());
    }
    DefaultBodyLimit::max(max).apply(&mut request);
    let read = tokio::time::timeout(BODY_TIME, request.extract::<Bytes, _>());
    let late = |_| Problem::new(StatusCode::REQUEST_TIMEOUT, "slow", "the body did not arrive in time");
    read.await.map_err(late)?.map_err(|rejection| match rejection.status() {
        StatusCode::PAYLOAD_TOO_LARGE => too_large(),
        _ => Problem::wrong_use("the body was cut off, or its chunks are malformed"),
    })
}

/// Parses a text in JSON as an object in which no name occurs twice.
fn json_of(bytes: &[u8]) -> Result<Map<String, Value>, Problem> {
    let wrong =
        |reason: serde_json::Error| Problem::wrong_use(format!("the body is no JSON object: {reason}"));
    match serde_json::from_slice(bytes).map_err(wrong)? {
        Distinct(Value::Object(map)) => Ok(map),
        Distinct(other) => Err(Problem::wrong_use(format!("the body is no JSON object: {other}"))),
    }
}

/// Creates a response with a value in JSON.
pub(super) fn json_response(value: &impl Serialize) -> Response {
    match serde_json::to_string(value) {
        Ok(text) => json_text(text),
        Err(reason) => Problem::wrong_use(reason.to_string()).into_response(),
    }
}

/// Creates a response from a text in JSON.
pub(super) fn json_text(text: String) -> Response {
    let mut response = Response::new(Body::from(text));
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
    response
}
