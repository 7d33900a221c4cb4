//! Errors as problem documents (RFC 9457).

use crate::channel::ClientError;
use crate::cli::error::CliError;
use crate::cli::exit::Exit;
use crate::request::{Code, Refused};
use axum::body::Body;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value, json};

/// Media type of a problem document.
const MEDIA_TYPE: HeaderValue = HeaderValue::from_static("application/problem+json");
/// First part of the types of problems.
const TYPE: &str = "urn:commram:problem:";

/// An error, as a client of the HTTP interface receives it.
#[derive(Clone, Debug)]
pub(super) struct Problem {
    status: StatusCode,
    /// Last part of the problem's type.
    kind: &'static str,
    title: &'static str,
    detail: String,
    /// Further members of the document.
    members: Map<String, Value>,
    /// True if the emulator has ended, so that its connection is useless.
    is_gone: bool,
}

impl Problem {
    /// Creates a problem of the request itself; no emulator has received the request.
    pub(super) fn new(status: StatusCode, kind: &'static str, detail: impl Into<String>) -> Self {
        let title = status.canonical_reason().unwrap_or("error");
        Self { status, kind, title, detail: detail.into(), members: Map::new(), is_gone: false }
    }

    /// Returns an invalid request.
    pub(super) fn wrong_use(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "wrong-use", detail).with("exit_code", Exit::WrongUse.code())
    }

    /// Creates a problem because the server does not have the requested object.
    pub(super) fn not_found(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, "not-found", detail)
    }

    /// Creates a problem because the request would exceed a limit of the server.
    pub(super) fn too_many(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::SERVICE_UNAVAILABLE, "too-many", detail)
            .with("exit_code", Exit::NotThere.code())
    }

    /// Adds a member to the problem.
    pub(super) fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.members.insert(name.to_owned(), value.into());
        self
    }

    /// Names the element of a list to which the problem belongs: its index, from 0.
    pub(super) fn in_list(mut self, what: &str, index: usize) -> Self {
        self.detail = format!("{what} {index}: {}", self.detail);
        self.with("index", index)
    }

    /// Returns the emulator refused an operation.
    pub(super) fn refused(refused: &Refused) -> Self {
        let error = CliError::Client(ClientError::Refused(refused.clone()));
        let mut problem = Self::of(&error, "refused").with("code", refused.code.0);
        if let Some(waited) = refused.waited {
            problem = problem.with("waited", json!(waited));
        }
        problem
    }

    /// Code of the refusal, if the emulator has refused the operation.
    pub(super) fn code(&self) -> Option<Code> {
        let code = self.members.get("code").and_then(Value::as_u64);
        code.and_then(|code| u16::try_from(code).ok()).map(Code)
    }

    /// Formats the problem document as JSON text.
    pub(super) fn text(&self) -> String {
        let mut members = self.members.clone();
        members.insert("type".to_owned(), format!("{TYPE}{}", self.kind).into());
        members.insert("title".to_owned(), self.title.into());
        members.insert("status".to_owned(), self.status.as_u16().into());
        members.insert("detail".to_owned(), self.detail.clone().into());
        Value::Object(members).to_string()
    }

    /// True if the emulator has ended.
    pub(super) fn is_gone(&self) -> bool {
        self.is_gone
    }

    /// Returns the explanation for users.
    #[cfg(test)]
    pub(super) fn detail(&self) -> &str {
        &self.detail
    }

    fn of(error: &CliError, kind: &'static str) -> Self {
        let code = error.exit_code();
        let exit = Exit::ALL.into_iter().find(|exit| exit.code() == code).unwrap_or(Exit::Failed);
        let (status, title) = match exit {
            Exit::WrongUse => (StatusCode::BAD_REQUEST, "wrong use"),
            Exit::NotThere => (StatusCode::SERVICE_UNAVAILABLE, "the emulator does not answer"),
            _ => (StatusCode::CONFLICT, "the plant is in another state"),
        };
        let is_late = matches!(error, CliError::Busy { .. } | CliError::Client(ClientError::Timeout { .. }));
        let lacks_resource = matches!(error, CliError::Client(ClientError::Refused(refused)) if refused.code == Code::NO_RESOURCE);
        let title = if lacks_resource { "the system refuses a resource" } else { title };
        Self {
            status,
            kind,
            title,
            detail: error.to_string(),
            members: Map::new(),
            is_gone: exit == Exit::NotThere && !is_late && !lacks_resource,
        }
        .with("exit_code", code)
    }
}

impl From<CliError> for Problem {
    fn from(error: CliError) -> Self {
        match &error {
            CliError::Client(ClientError::Refused(refused)) => Self::refused(refused),
            CliError::NotRunning { .. } => {
                Self { status: StatusCode::NOT_FOUND, ..Self::of(&error, "not-running") }
            }
            _ => {
                let kind = match error.exit_code() {
                    2 => "wrong-use",
                    3 => "not-there",
                    _ => "failed",
                };
                Self::of(&error, kind)
            }
        }
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let allowed = self.members.get("allow").and_then(Value::as_str);
        let allowed = allowed.and_then(|it| HeaderValue::from_str(it).ok());
        let mut response = Response::new(Body::from(self.text()));
        *response.status_mut() = self.status;
        response.headers_mut().insert(header::CONTENT_TYPE, MEDIA_TYPE);
        if let Some(allowed) = allowed {
            response.headers_mut().insert(header::ALLOW, allowed);
        }
        if self.status == StatusCode::UNAUTHORIZED {
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(code: Code) -> Problem {
        Problem::refused(&Refused::new(code, "node2.w_X: text"))
    }

    #[test]
    fn the_status_follows_the_exit_code() {
        assert_eq!(problem(Code::UNMAPPED).status, StatusCode::BAD_REQUEST);
        assert_eq!(problem(Code::CLOCK_IS_REAL_TIME).status, StatusCode::CONFLICT);
        let ending = problem(Code::SHUTTING_DOWN);
        assert_eq!((ending.status, ending.is_gone()), (StatusCode::SERVICE_UNAVAILABLE, true));
        let full = problem(Code::NO_RESOURCE);
        assert_eq!((full.status, full.is_gone()), (StatusCode::SERVICE_UNAVAILABLE, false));
        let unknown = CliError::NotRunning { instance: "x".into(), running: String::new() };
        assert_eq!(Problem::from(unknown).status, StatusCode::NOT_FOUND);
    }
}
