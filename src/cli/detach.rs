//! `commram run --detach`: an emulator in the background.
//!
//! This program starts itself again as a child, forwards the output of the child until the child is ready, and exits.
//! The child leaves the terminal and the session. When the child is ready, it closes its outputs, so that readers of
//! the outputs need not wait until the child ends.

use super::demo::Interrupts;
use super::error::CliError;
use super::start::in_thread;
use super::{descriptors, output, parse};
use crate::output_file;
use rustix::fs::Stat;
use rustix::io::Errno;
use rustix::process::{Pid, Signal};
use std::fs::{File, OpenOptions};
use std::io::{self, PipeWriter, Read};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::Duration;

/// Pause between two checks for an interrupt.
const LOOK: Duration = Duration::from_millis(20);

/// Starts this command again in the background. Returns when the new process is ready. `reads_input`: the process reads
/// its plant from the standard input.
///
/// # Errors
/// The child did not become ready. The child has printed the reason, and the error has its exit code.
pub(crate) fn start(instance: &str, reads_input: bool) -> Result<(), CliError> {
    let failed = |reason| CliError::Process { reason };
    let interrupts = Interrupts::catch()?;
    let program = std::env::current_exe().map_err(failed)?;
    let mut command = Command::new(program);
    command.args(["run", "--detached"]).args(parse::arguments_of_command());
    // A line of the shell may name no instance. An argument has priority over the variable.
    command.env(super::instance::VARIABLE, instance);
    let input = if reads_input { Stdio::inherit() } else { Stdio::null() };
    // The threads start before the child, so that no child remains if they cannot be started.
    let (out, stdout) = collect()?;
    let (err, stderr) = collect()?;
    command.stdin(input).stdout(stdout).stderr(stderr);
    let mut child = command.spawn().map_err(failed)?;
    // Closes the ends of the pipes for writing in this process; otherwise the streams have no end.
    drop(command);
    let printed_lines = until_end(&out, &mut child, &interrupts)?;
    let complaint = until_end(&err, &mut child, &interrupts)?;
    output::relay(&complaint);
    if printed_lines.is_empty() {
        let status = child.wait().map_err(failed)?;
        return Err(super::with::ended_early(&format!("the emulator of instance '{instance}'"), status));
    }
    // The two lines below are notes about a successful start, so `--quiet` suppresses them.
    if output::is_quiet() {
        return Ok(());
    }
    let printed_lines = String::from_utf8_lossy(&printed_lines);
    let pid = child.id();
    let continues_text =
        format!("process {pid} continues in the background; end it with `commram stop -i {instance}`");
    let printed = output::print(&format!("{printed_lines}commram: {continues_text}\n"));
    if matches!(printed, Err(CliError::Output { .. })) {
        output::note(&continues_text);
    }
    printed
}

/// Returns a pipe for an output of a child. A thread reads the pipe up to its end and sends the text to the receiver.
///
/// # Errors
/// The operating system cannot create a pipe or start a thread.
fn collect() -> Result<(Receiver<Vec<u8>>, PipeWriter), CliError> {
    let (mut stream, output) = io::pipe().map_err(|reason| CliError::Process { reason })?;
    let (send, receive) = mpsc::channel();
    in_thread(move || {
        let mut text = Vec::new();
        // Bytes that were read before an error are kept.
        let _ = stream.read_to_end(&mut text);
        let _ = send.send(text);
    })?;
    Ok((receive, output))
}

/// Waits for the end of a stream. If the user interrupts the wait, the process gets SIGTERM, which ends its streams.
fn until_end(
    stream: &Receiver<Vec<u8>>,
    child: &mut Child,
    interrupts: &Interrupts,
) -> Result<Vec<u8>, CliError> {
    loop {
        match stream.recv_timeout(LOOK) {
            Ok(text) => return Ok(text),
            Err(RecvTimeoutError::Disconnected) => return Ok(Vec::new()),
            Err(RecvTimeoutError::Timeout) if interrupts.any() => {
                // The child has not been reaped, so the process id is still valid.
                if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
                    let _ = rustix::process::kill_process(pid, Signal::TERM);
                }
                let _ = child.wait();
                return Err(CliError::Interrupted);
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// This process, started in the background.
pub(crate) struct Detached {
    nothing: File,
    log: Option<File>,
    /// Descriptors that the process has inherited besides the standard ones.
    inherited: Vec<RawFd>,
}

impl Detached {
    /// Leaves the terminal and the session. After [`Detached::let_go`], messages go to `log`.
    ///
    /// # Errors
    /// The log cannot be written or is an output of this process, or the operating system refuses the request.
    pub(crate) fn begin(log: Option<&Path>) -> Result<Self, CliError> {
        let inherited = descriptors::inheritable();
        descriptors::keep_from_programs(&inherited);
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |reason: io::Error| CliError::File { path, reason }
        };
        let open = |path: &Path| output_file::open_to_append(path, 0o666).map_err(failed(path));
        let nothing = Path::new("/dev/null");
        let nothing = OpenOptions::new().write(true).open(nothing).map_err(failed(nothing))?;
        if let Some(log) = log {
            refuse_own_output(log)?;
        }
        let this = Self { nothing, log: log.map(open).transpose()?, inherited };
        rustix::process::setsid().map_err(|errno| CliError::Process { reason: errno.into() })?;
        Ok(this)
    }

    /// Closes both outputs, so that a process that reads them until their end can continue. Also closes the inherited
    /// descriptors: a lock of the shell that is held by one of them would last as long as the emulator. Until now the
    /// plant may have been a file `/dev/fd/63`, the output of a command.
    ///
    /// # Errors
    /// The operating system refuses the operation.
    pub(crate) fn let_go(self) -> Result<(), CliError> {
        for descriptor in self.inherited {
            // SAFETY: the descriptor was open before this program opened its first file, and no object of this process
            // owns it.
            drop(unsafe { OwnedFd::from_raw_fd(descriptor) });
        }
        put(&self.nothing, 1)?;
        put(self.log.as_ref().unwrap_or(&self.nothing), 2)
    }
}

/// Refuses a name of an output of this process, for example `/dev/stderr`: the process that started this one reads both
/// outputs until they are closed.
///
/// # Errors
/// The log is an output of this process.
fn refuse_own_output(log: &Path) -> Result<(), CliError> {
    // A file that does not exist cannot be an output of this process, so it is accepted. It is created later.
    let Ok(found) = rustix::fs::stat(log) else { return Ok(()) };
    let is = |output: Result<Stat, Errno>| {
        output.is_ok_and(|output| (output.st_dev, output.st_ino) == (found.st_dev, found.st_ino))
    };
    if !is(rustix::fs::fstat(io::stdout())) && !is(rustix::fs::fstat(io::stderr())) {
        return Ok(());
    }
    let right = "the background process closes its outputs when it is ready; name a file, or start `commram run` \
                 without --detach in the background of the shell";
    Err(CliError::Argument { text: format!("--log {}", log.display()), right: right.to_owned() })
}

/// Redirects an output to a file.
fn put(file: &File, output: i32) -> Result<(), CliError> {
    // SAFETY: a plain system call on open descriptors; no object in this process owns the replaced descriptor.
    match unsafe { libc::dup2(file.as_raw_fd(), output) } {
        -1 => Err(CliError::Process { reason: io::Error::last_os_error() }),
        _ => Ok(()),
    }
}
