//! Reading the journal to its end, and on from there.

use super::{Args, FormatArg, wrong_reply};
use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::session::Session;
use crate::cli::time;
use commram::channel::op::MAX_RECORDS;
use commram::channel::{ChannelError, ClientError, Op, Reply};
use commram::journal::candump::Candump;
use commram::journal::jsonl::Jsonl;
use commram::journal::text::Text;
use commram::journal::{Format, Names, Printer, Record, Selection};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::collections::VecDeque;
use std::io;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Real time between two looks at the journal.
const INTERVAL: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// Prints what there is, and what comes if asked for.
pub fn print(args: &Args, session: &Session, selection: Selection, names: Names) -> Result<(), CliError> {
    let format: Box<dyn Format> = match args.format {
        FormatArg::Text => Box::new(Text::new(names)),
        FormatArg::Jsonl => Box::new(Jsonl::new(names)),
        FormatArg::Candump => Box::new(Candump::new(&names)),
    };
    let mut trace = Trace {
        args,
        session,
        printer: Printer::new(format, selection, args.from),
        out: Out { lines: VecDeque::new(), keep: args.last },
        counting: Vec::new(),
    };
    if !args.follow {
        trace.read()?;
        return trace.end();
    }
    let mut pause = Pause::new()?;
    loop {
        match trace.read() {
            Ok(()) => trace.out.release()?,
            // Another client lets much time pass; a stepped emulator answers when it has.
            Err(CliError::Client(ClientError::Timeout { .. })) => {}
            Err(CliError::Client(
                ClientError::EmulatorGone { .. } | ClientError::Refused(ChannelError::ShuttingDown),
            )) => {
                output::note(&format!("instance '{}' has ended", args.instance.name));
                return trace.end();
            }
            Err(error) => return Err(error),
        }
        match pause.wait()? {
            Wake::Time => {}
            Wake::Signal => return trace.end(),
            Wake::NobodyReads => return Err(CliError::BrokenPipe),
        }
    }
}

struct Trace<'a> {
    args: &'a Args,
    session: &'a Session,
    printer: Printer,
    out: Out,
    /// What was still being counted at the last look.
    counting: Vec<Record>,
}

impl Trace<'_> {
    /// Reads up to the end of the journal and prints it.
    fn read(&mut self) -> Result<(), CliError> {
        loop {
            let from = self.printer.next();
            let reply = self.session.request(&[Op::Journal { from, max: MAX_RECORDS }])?.pop();
            let Some(Reply::Journal { records, end }) = reply else { return Err(wrong_reply(self.args)) };
            self.counting.clear();
            self.printer.begin_part();
            for record in records {
                if record.is_pending() {
                    self.counting.push(record);
                } else {
                    self.print(&record);
                }
            }
            if self.out.keep.is_none() {
                self.out.flush()?;
            }
            if self.printer.next() >= end {
                return Ok(());
            }
            // Without progress there would be no end.
            if self.printer.next() == from {
                return Err(wrong_reply(self.args));
            }
        }
    }

    fn print(&mut self, record: &Record) {
        let mut line = String::new();
        let untold = self.printer.print(record, &mut line);
        if untold > 0 {
            output::note(&format!("{untold} records lost before {}", time::seconds(record.time_us)));
        }
        self.out.push(line);
    }

    /// What is still being counted has no line yet.
    fn end(mut self) -> Result<(), CliError> {
        for record in std::mem::take(&mut self.counting) {
            self.print(&record);
        }
        self.out.flush()
    }
}

/// Lines to be printed.
struct Out {
    lines: VecDeque<String>,
    /// So many of the last ones are wanted.
    keep: Option<usize>,
}

impl Out {
    fn push(&mut self, line: String) {
        // A record that the format has no line for.
        if line.is_empty() {
            return;
        }
        self.lines.push_back(line);
        if self.keep.is_some_and(|keep| self.lines.len() > keep) {
            self.lines.pop_front();
        }
    }

    /// Prints what is there; from here on every line is wanted.
    fn release(&mut self) -> Result<(), CliError> {
        self.keep = None;
        self.flush()
    }

    fn flush(&mut self) -> Result<(), CliError> {
        if self.lines.is_empty() {
            return Ok(());
        }
        let text: String = self.lines.drain(..).collect();
        output::print(&text)
    }
}

/// Why a pause is over.
enum Wake {
    Time,
    Signal,
    NobodyReads,
}

/// Pauses that end early when there is no more to do.
struct Pause {
    /// A signal writes a byte to its other end.
    signals: UnixStream,
}

impl Pause {
    /// From here on the first signal ends a pause, the second one the process.
    fn new() -> Result<Self, CliError> {
        Self::on_signals().map_err(|reason| CliError::Signals { reason })
    }

    fn on_signals() -> io::Result<Self> {
        let (signals, sender) = UnixStream::pair()?;
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            let again = Arc::new(AtomicBool::new(false));
            signal_hook::flag::register_conditional_default(signal, Arc::clone(&again))?;
            signal_hook::flag::register(signal, again)?;
            signal_hook::low_level::pipe::register(signal, sender.try_clone()?)?;
        }
        Ok(Self { signals })
    }

    fn wait(&mut self) -> Result<Wake, CliError> {
        let out = io::stdout();
        // Nothing is asked of the output: that its reader has gone is always told.
        let mut files = [PollFd::new(&self.signals, PollFlags::IN), PollFd::new(&out, PollFlags::empty())];
        match poll(&mut files, Some(&INTERVAL)) {
            // The signal has written its byte, which the next call finds.
            Err(Errno::INTR) | Ok(0) => Ok(Wake::Time),
            Err(reason) => Err(CliError::Output { reason: reason.into() }),
            Ok(_) if !files[0].revents().is_empty() => Ok(Wake::Signal),
            Ok(_) => Ok(Wake::NobodyReads),
        }
    }
}
