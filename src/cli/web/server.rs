//! Accepts connections and serves them until the end.

use super::App;
use super::connections::{Connections, OpenConnection, max_open};
use super::problem::Problem;
use super::router::router;
use crate::cli::error::CliError;
use axum::Router;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::net::TcpListener as StdListener;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};

/// Maximum time to receive the head of a request. Also the longest pause between two requests of a connection.
const HEAD_TIME: Duration = Duration::from_secs(30);
/// If the client acknowledges no sent data for this time, in milliseconds, the connection is closed.
const UNREAD_MS: u32 = 30_000;
/// Number of bytes that the system buffers for a connection until the client receives them.
const SEND_BUFFER: usize = 256 << 10;
/// Maximum size of the head of a request, in bytes.
const MAX_HEAD: usize = 16 << 10;
/// Response to a client that begins with HTTP/2.
const NOT_HTTP_1: &[u8] = b"HTTP/1.1 400 Bad Request\r\nconnection: close\r\ncontent-length: 0\r\n\r\n";
/// Maximum number of headers of a request.
const MAX_HEADERS: usize = 64;
/// Pause after an error of `accept`, which occurs when all file descriptors are in use.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);
/// Maximum number of connections that receive a refusal at the same time; further ones are closed without an answer.
const MAX_REFUSALS: usize = 32;
/// Maximum time for sending a refusal.
const REFUSAL_TIME: Duration = Duration::from_secs(1);
/// Time in which connections can send their last data when the server ends.
const LAST_WORDS: Duration = Duration::from_millis(300);

/// Serves until `end` becomes true.
///
/// # Errors
/// The operating system refuses the operation.
pub(super) fn serve(
    app: Arc<App>,
    listener: StdListener,
    mut end: watch::Receiver<bool>,
) -> Result<(), CliError> {
    let failed = |reason| CliError::Process { reason };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    runtime.block_on(async {
        let listener = TcpListener::from_std(listener).map_err(failed)?;
        let router = router(app);
        tokio::select! {
            () = accept(&listener, &router) => {}
            // An error means that the sender was dropped; this also ends the server.
            _ = end.wait_for(|ends| *ends) => {}
        }
        // The server of the next emulator can take the port at once.
        drop(listener);
        tokio::time::sleep(LAST_WORDS).await;
        Ok::<(), CliError>(())
    })?;
    // Threads that wait for an emulator do not block the end of the server: they end with the process.
    runtime.shutdown_background();
    Ok(())
}

async fn accept(listener: &TcpListener, router: &Router) {
    let connections = Connections::new(max_open());
    let refusals = Arc::new(Semaphore::new(MAX_REFUSALS));
    loop {
        match listener.accept().await {
            Ok((stream, _)) => {
                if let Some(connection) = connections.enter() {
                    tokio::spawn(converse(stream, connection, router.clone()));
                } else if let Ok(permit) = Arc::clone(&refusals).try_acquire_owned() {
                    tokio::spawn(refuse(stream, permit));
                }
            }
            Err(_) => tokio::time::sleep(ACCEPT_PAUSE).await,
        }
    }
}

/// Sends a refusal on a connection for which there is no room.
async fn refuse(stream: TcpStream, _permit: OwnedSemaphorePermit) {
    let problem = Problem::too_many("all connections of this server are in use by clients with a token");
    let body = problem.text();
    let response = format!(
        "HTTP/1.1 503 Service Unavailable\r\ncontent-type: application/problem+json\r\ncontent-length: {}\r\n\
         cache-control: no-store\r\nconnection: close\r\n\r\n{body}",
        body.len()
    );
    let _ = tokio::time::timeout(REFUSAL_TIME, stream.readable()).await;
    send_last(&stream, response.as_bytes());
}

/// Sends the only response on a connection. First reads what the client has sent: if a connection with unread data is
/// closed, the system discards the response.
fn send_last(stream: &TcpStream, response: &[u8]) {
    let _ = stream.try_read(&mut [0; MAX_HEAD]);
    // The buffer of a new connection is empty, so it takes the whole response.
    let _ = stream.try_write(response);
    let _ = rustix::net::shutdown(stream, rustix::net::Shutdown::Write);
}

/// Serves a connection until the client or the server closes it.
async fn converse(stream: TcpStream, connection: OpenConnection, router: Router) {
    // Errors are ignored: without these options a connection only stays open longer, uses more memory, or answers
    // later.
    let _ = rustix::net::sockopt::set_tcp_user_timeout(&stream, UNREAD_MS);
    let _ = rustix::net::sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER);
    let _ = stream.set_nodelay(true);
    let peer = Arc::clone(&connection.peer);
    let handler = TowerToHyperService::new(router);
    let service = service_fn(move |mut request: hyper::Request<Incoming>| {
        request.extensions_mut().insert(Arc::clone(&peer));
        handler.call(request)
    });
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(MAX_HEAD)
        .max_headers(MAX_HEADERS);
    let mut served = http.serve_connection(TokioIo::new(stream), service);
    let outcome = tokio::select! {
        // The client has closed the connection, or does not speak HTTP.
        outcome = &mut served => outcome,
        () = connection.peer.closed() => return,
    };
    // For the begin of HTTP/2, and only for it, hyper closes the connection without a response.
    if outcome.is_err_and(|error| error.is_parse_version_h2()) {
        send_last(served.into_parts().io.inner(), NOT_HTTP_1);
    }
}
