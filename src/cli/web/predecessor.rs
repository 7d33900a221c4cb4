//! The server of an earlier emulator of the same instance, which may still have the port.
//!
//! If an emulator is killed, its server ends a moment later, or not at all if it is suspended. The next emulator can start
//! earlier than that.

use super::secret::servers_of;
use crate::memory::process::read_kernel_file;
use crate::memory::{EmulatorProcess, RunningInstance};
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener};
use std::time::{Duration, Instant};

/// Longest wait for the end of a server.
const PATIENCE: Duration = Duration::from_secs(2);
/// Pause between two attempts to take the port.
const LOOK: Duration = Duration::from_millis(5);

/// Listens at an address. If the server of an earlier emulator of `instance` has the port, waits for its end.
///
/// # Errors
/// The operating system refuses the operation, or another program has the port.
pub(super) fn bind(instance: &str, address: SocketAddr) -> io::Result<TcpListener> {
    let start = Instant::now();
    let mut is_awaited = true;
    loop {
        match TcpListener::bind(address) {
            Err(reason) if reason.kind() == ErrorKind::AddrInUse && is_awaited => {}
            bound => return bound,
        }
        // A server that ends gives up the port before it removes its file. So after the search, the port is tried again.
        is_awaited = end_predecessors(instance, address.port()) && start.elapsed() < PATIENCE;
        if is_awaited {
            std::thread::sleep(LOOK);
        }
    }
}

/// Returns true if a server of an earlier emulator of this instance is going to end. Such a server has a token file for the
/// instance and the port, and is older than the emulator. It ends by itself when its emulator has ended; if it was started by
/// its emulator and is suspended, it is continued.
fn end_predecessors(instance: &str, port: u16) -> bool {
    let Ok(Some(emulator)) = RunningInstance::find(instance) else { return false };
    let Some(emulator) = emulator.process() else { return false };
    let mut is_any = false;
    for server in servers_of(instance, port).iter().filter(|server| server.is_older_than(emulator)) {
        is_any |= match server.is_stopped() {
            true => is_beside_an_emulator(server) && server.resume().is_ok(),
            false => true,
        };
    }
    is_any
}

/// True if an emulator has started this server. The kernel then sends SIGTERM to the server when the emulator ends.
fn is_beside_an_emulator(server: &EmulatorProcess) -> bool {
    let arguments = read_kernel_file(&format!("/proc/{}/cmdline", server.pid())).unwrap_or_default();
    let mut arguments = arguments.split('\0').skip(1);
    arguments.next() == Some("web") && arguments.next() == Some("--parent")
}
