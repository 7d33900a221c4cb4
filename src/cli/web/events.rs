//! Server-sent events: values, changes, records and states of an instance.
//!
//! One thread for each instance polls the emulator for all readers, and puts the result of each poll, a round, into a
//! ring buffer. A slow reader loses rounds and receives their number. It delays neither the emulator nor
//! other readers.

mod feed;
mod reader;
mod round;

pub(super) use feed::Feed;

use super::App;
use super::problem::Problem;
use super::router::{Pairs, pairs};
use axum::body::{Body, Bytes};
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::Response;
use feed::{Subscription, Wish};
use hyper::body::Frame;
use reader::Reader;
use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{OwnedSemaphorePermit, mpsc};

/// Maximum number of event streams.
pub(super) const MAX_STREAMS: usize = 64;
/// Fields that the query may have: name and description.
pub(super) const FIELDS: [(&str, &str); 11] = [
    (
        "follow",
        "Registers: their values in the event `values`, and every change in the event `changes`. Names separated by commas.",
    ),
    (
        "values",
        "Registers: their values in the event `values`, with the time of the last change, without each change. Names separated by commas.",
    ),
    ("journal", "1 for all new records of the journal, or kinds of records separated by commas."),
    ("clock", "1 for the emulated time."),
    ("boards", "1 for the front panels, whenever one has changed."),
    ("buses", "1 for the buses, whenever one has changed."),
    ("drives", "1 for the drives, whenever one has changed."),
    ("faults", "1 for the faults, whenever one has changed."),
    ("findings", "1 for the findings of the access checker, whenever there is a new one."),
    ("forces", "1 for the forced registers, whenever they have changed."),
    ("scene", "1 for the devices and buses as `commram view` draws them, whenever they have changed."),
];
/// Number of parts of a stream that are buffered for the connection.
const WAITING: usize = 4;
/// Longest wait for the first poll. If the emulator is busy, the stream begins without it.
const FIRST: Duration = Duration::from_secs(5);
/// After this pause the server sends a comment, so that the client sees that the stream is alive.
const ALIVE: Duration = Duration::from_secs(10);

/// Starts a stream of events.
///
/// # Errors
/// The query is not valid, the instance does not exist, or there are too many streams.
pub(super) async fn answer(
    State(app): State<Arc<App>>,
    Path(instance): Path<String>,
    query: Result<Query<Pairs>, QueryRejection>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let pairs = pairs(query)?;
    let permit = Arc::clone(&app.streams).try_acquire_owned();
    let permit =
        permit.map_err(|_| Problem::too_many(format!("there are {MAX_STREAMS} event streams already")))?;
    let session = app.guard.stream_of(&headers);
    let links = app.hub.find(&instance)?;
    let wish = links.looks.run(move |connection| Wish::of_query(connection, &pairs)).await;
    let wish = wish.inspect_err(|problem| app.notice(&instance, problem))?;
    let mut reader = Reader::new(wish.clone());
    let mut subscription = links.feed.subscribe(wish)?;
    let (sender, body) = mpsc::channel(WAITING);
    // When the response has begun, errors can only be sent as events.
    if let Ok(Ok(round)) = tokio::time::timeout(FIRST, subscription.rounds.recv()).await {
        // The buffer is empty, so it has room for the first part.
        let _ = sender.try_send(reader.events(&round).into());
    }
    tokio::spawn(async move {
        tokio::select! {
            () = session.wait() => {}
            () = send(subscription, reader, sender, permit) => {}
        }
    });
    let mut response = Response::new(Body::new(EventBody(body)));
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("text/event-stream"));
    Ok(response)
}

/// Sends events until the reader disconnects or the emulator ends.
async fn send(
    mut subscription: Subscription,
    mut reader: Reader,
    sender: mpsc::Sender<Bytes>,
    _permit: OwnedSemaphorePermit,
) {
    while !reader.is_at_end() {
        let text = tokio::select! {
            () = sender.closed() => return,
            round = tokio::time::timeout(ALIVE, subscription.rounds.recv()) => match round {
                Ok(Ok(round)) => reader.events(&round),
                Ok(Err(RecvError::Lagged(rounds))) => {
                    reader.miss(rounds);
                    continue;
                }
                Ok(Err(RecvError::Closed)) => return,
                Err(_) => ":\n\n".to_owned(),
            },
        };
        // Sending fails if the reader has disconnected.
        if !text.is_empty() && sender.send(text.into()).await.is_err() {
            return;
        }
    }
}

/// The body of the response; each part is sent as soon as it exists.
struct EventBody(mpsc::Receiver<Bytes>);

impl hyper::body::Body for EventBody {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        self.get_mut().0.poll_recv(context).map(|part| part.map(|part| Ok(Frame::data(part))))
    }
}
