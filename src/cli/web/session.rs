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
use tokio::sync::watch;

/// Maximum number of keys that have opened an event stream, and of other keys. Programs that sign in again and again
/// without signing out therefore sign out no page.
const MAX_SESSIONS: usize = super::events::MAX_STREAMS;

/// Maximum size of the body with the token, in bytes. It is small, because any client can send this request.
const MAX_TOKEN_BODY: usize = 1 << 10;

/// The keys of all clients that are signed in; the key that was used last is the last one.
#[derive(Default)]
pub(super) struct Sessions(Mutex<VecDeque<Session>>);

struct Session {
    key: Secret,
    /// True if the key has opened an event stream.
    has_streamed: bool,
    /// Each open event stream has a receiver. The streams end when this sender is dropped.
    streams: watch::Sender<()>,
}

/// The end of the session that has opened an event stream. It never comes for a stream with the token.
pub(super) struct SessionEnd(Option<watch::Receiver<()>>);

impl SessionEnd {
    /// The end for a stream with the token.
    pub(super) const NEVER: Self = Self(None);

    /// Waits until the session ends.
    pub(super) async fn wait(self) {
        match self.0 {
            // An error means that the sender was dropped.
            Some(mut session) => while session.changed().await.is_ok() {},
            None => std::future::pending().await,
        }
    }
}

impl Sessions {
    /// Signs a client in, and returns its key. If there are too many keys without an event stream, the one that has
    /// been unused for the longest time is signed out.
    ///
    /// # Errors
    /// The kernel has no random numbers.
    pub(super) fn open(&self) -> io::Result<String> {
        let key = Secret::random()?;
        let digits = key.digits().to_owned();
        let mut sessions = self.sessions();
        make_room(&mut sessions, false);
        sessions.push_back(Session { key, has_streamed: false, streams: watch::Sender::new(()) });
        Ok(digits)
    }

    /// True if a client with this key is signed in. The key is then the one that was used last.
    pub(super) fn contains(&self, key: &str) -> bool {
        let mut sessions = self.sessions();
        let session = take(&mut sessions, key);
        let is_known = session.is_some();
        sessions.extend(session);
        is_known
    }

    /// Notes an event stream of this key, and returns the end of the session. If too many keys have opened streams, the
    /// one that has been unused for the longest time is signed out, but none with an open stream.
    pub(super) fn stream(&self, key: &str) -> SessionEnd {
        let mut sessions = self.sessions();
        let Some(mut session) = take(&mut sessions, key) else {
            // The sender is dropped: the session has ended already.
            return SessionEnd(Some(watch::channel(()).1));
        };
        make_room(&mut sessions, true);
        session.has_streamed = true;
        let end = SessionEnd(Some(session.streams.subscribe()));
        sessions.push_back(session);
        end
    }

    /// Signs the client with this key out, and ends its event streams.
    pub(super) fn close(&self, key: &str) {
        take(&mut self.sessions(), key);
    }

    fn sessions(&self) -> MutexGuard<'_, VecDeque<Session>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Removes and returns the session of a key.
fn take(sessions: &mut VecDeque<Session>, key: &str) -> Option<Session> {
    let place = sessions.iter().position(|session| session.key.is(key.as_bytes()))?;
    sessions.remove(place)
}

/// Makes room for one more session. Sessions that have opened an event stream, and those that have not, have separate
/// limits.
fn make_room(sessions: &mut VecDeque<Session>, has_streamed: bool) {
    let is_same = |session: &&Session| session.has_streamed == has_streamed;
    if sessions.iter().filter(is_same).count() >= MAX_SESSIONS {
        let is_unused = |session: &Session| is_same(&session) && session.streams.receiver_count() == 0;
        let unused = sessions.iter().position(is_unused);
        unused.and_then(|place| sessions.remove(place));
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

/// Signs a client out: invalidates its key and ends its event streams.
pub(super) async fn close(State(app): State<Arc<App>>, headers: HeaderMap) -> Response {
    let session = app.guard.session_of(&headers);
    if !session.is_empty() {
        app.guard.sessions.close(&session);
        app.hub.drop_files_of(&session);
    }
    StatusCode::NO_CONTENT.into_response()
}

/// Returns the token or the key of a request.
pub(super) fn bearer(headers: &HeaderMap) -> Option<&str> {
    let text = headers.get(header::AUTHORIZATION)?.to_str().ok()?;
    let (scheme, secret) = text.split_at_checked("bearer ".len())?;
    scheme.eq_ignore_ascii_case("bearer ").then_some(secret)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// True if the session has ended.
    fn has_ended(end: &SessionEnd) -> bool {
        end.0.as_ref().is_some_and(|session| session.has_changed().is_err())
    }

    #[test]
    fn signing_in_again_and_again_signs_out_no_page() {
        let sessions = Sessions::default();
        let [page, hidden, used, unused] = [(); 4].map(|()| sessions.open().unwrap());
        let stream = sessions.stream(&page);
        drop(sessions.stream(&hidden));
        for _ in 0..100 {
            assert!(sessions.contains(&used));
            sessions.open().unwrap();
        }
        assert!(!sessions.contains(&unused) && sessions.contains(&page) && sessions.contains(&hidden));
        assert!(!has_ended(&stream));
        assert_eq!(sessions.sessions().len(), MAX_SESSIONS + 2);
    }

    #[test]
    fn keys_with_an_open_stream_stay() {
        let sessions = Sessions::default();
        let [page, hidden] = [(); 2].map(|()| sessions.open().unwrap());
        let stream = sessions.stream(&page);
        drop(sessions.stream(&hidden));
        for _ in 0..100 {
            drop(sessions.stream(&sessions.open().unwrap()));
        }
        assert!(!has_ended(&stream) && sessions.contains(&page) && !sessions.contains(&hidden));
        assert_eq!(sessions.sessions().len(), MAX_SESSIONS);
    }

    #[test]
    fn the_streams_of_a_key_end_with_it() {
        let sessions = Sessions::default();
        let [one, other] = [(); 2].map(|()| sessions.open().unwrap());
        let ends = [&one, &one, &other].map(|key| sessions.stream(key));
        sessions.close(&one);
        assert_eq!(ends.each_ref().map(has_ended), [true, true, false]);
        assert!(has_ended(&sessions.stream(&one)), "the key is signed out");
    }
}
