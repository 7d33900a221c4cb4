//! Writes messages of the library to the standard error output: ` WARN the text key=value`. The threads of an emulator
//! write such messages. If the output is not read, a thread waits only briefly; the message is then lost, and this
//! module counts lost messages.

use super::output;
use crate::plural::plural;
use core::fmt::{Debug, Write};
use core::sync::atomic::{AtomicUsize, Ordering};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::backtrace::{Backtrace, BacktraceStatus};
use std::io;
use std::os::fd::AsFd;
use std::{panic, thread};
use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing::span::{Attributes, Id, Record};
use tracing::subscriber::set_global_default;
use tracing::{Event, Level, Metadata, Subscriber};

/// Longest wait for a full output, in nanoseconds. After a lost message the threads do not wait until the output accepts a
/// message again.
const PATIENCE_NS: i64 = 20_000_000;
/// Number of bytes that an output accepts without blocking if it reports that it is ready: `PIPE_BUF` of Linux.
const PART: usize = 4096;

/// From now on prints warnings and errors, all messages with `--verbose`, and the messages of panics. A panic in a damaged
/// channel does not end the process.
pub(super) fn to_stderr() {
    let most = if output::is_verbose() { Level::DEBUG } else { Level::WARN };
    // An error is ignored: it occurs only if the process has already set another subscriber.
    let _ = set_global_default(Log { most });
    panic::set_hook(Box::new(|info| {
        let thread = thread::current();
        let name = thread.name().unwrap_or("<unnamed>");
        let mut text = format!("\nthread '{name}' {info}\n");
        let trace = Backtrace::capture();
        if trace.status() == BacktraceStatus::Captured {
            // A String takes any text.
            let _ = write!(text, "{trace}");
        }
        write_counting(&io::stderr(), &text, &LOST);
    }));
}

/// Number of messages that were lost since the standard error output last accepted a message.
static LOST: AtomicUsize = AtomicUsize::new(0);

/// Prints events. This program does not use spans.
struct Log {
    most: Level,
}

impl Subscriber for Log {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.level() <= &self.most
    }

    fn max_level_hint(&self) -> Option<LevelFilter> {
        Some(self.most.into())
    }

    fn event(&self, event: &Event<'_>) {
        let mut line = Line::default();
        event.record(&mut line);
        let text = format!("{:>5} {}{}\n", event.metadata().level().as_str(), line.message, line.fields);
        write_counting(&io::stderr(), &text, &LOST);
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

/// Writes a message, preceded by the number of lost messages. Write errors are ignored.
fn write_counting(output: &impl AsFd, text: &str, lost: &AtomicUsize) {
    let before = lost.load(Ordering::Relaxed);
    let patience_ns = if before == 0 { PATIENCE_NS } else { 0 };
    let whole = match before {
        0 => text.to_owned(),
        _ => format!(
            " WARN {} lost before this one: the output was not read\n{text}",
            plural(before as u64, "message")
        ),
    };
    let mut parts = whole.as_bytes().chunks(PART);
    // Writes without the lock of the standard error output, because a blocked thread may hold the lock.
    let is_written = parts.all(|part| takes(output, patience_ns) && rustix::io::write(output, part).is_ok());
    match is_written {
        true => lost.fetch_sub(before, Ordering::Relaxed),
        false => lost.fetch_add(1, Ordering::Relaxed),
    };
}

/// True if a write to the output does not block.
fn takes(output: &impl AsFd, patience_ns: i64) -> bool {
    let patience = Timespec { tv_sec: 0, tv_nsec: patience_ns };
    let mut polled = [PollFd::new(output, PollFlags::OUT)];
    // `poll` also reports a closed output as ready. The write to it fails, and the error is ignored.
    rustix::io::retry_on_intr(|| poll(&mut polled, Some(&patience))).is_ok_and(|ready| ready > 0)
}

/// The parts of a line.
#[derive(Default)]
struct Line {
    message: String,
    fields: String,
}

impl Visit for Line {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        // Writing to a String cannot fail.
        let _ = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name => write!(self.fields, " {name}={value:?}"),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_its_level_its_text_and_its_fields() {
        let (mut line, reason) = (Line::default(), io::Error::from(io::ErrorKind::NotFound));
        let callsite = tracing::callsite::Identifier(&CALLSITE);
        let fields = tracing::field::FieldSet::new(&["reason", "message"], callsite);
        let (reason_field, message) = (fields.field("reason").unwrap(), fields.field("message").unwrap());
        line.record_debug(&reason_field, &tracing::field::display(&reason));
        line.record_debug(&message, &format_args!("the text"));
        assert_eq!((line.message.as_str(), line.fields.as_str()), ("the text", " reason=entity not found"));
    }

    #[test]
    fn an_output_without_a_reader_loses_messages_and_blocks_nothing() {
        let (mut reader, writer) = std::io::pipe().unwrap();
        let lost = AtomicUsize::new(0);
        let write = |text: &str| write_counting(&writer, text, &lost);
        // A pipe has room for 65,536 bytes. A message that does not fit as a whole is lost.
        (0..100).for_each(|_| write(&("x".repeat(1023) + "\n")));
        let mut read = [0; 65_536];
        let count = io::Read::read(&mut reader, &mut read).unwrap();
        let taken = count / 1024;
        assert!((60..=64).contains(&taken), "{taken}");
        write("after\n");
        let count = io::Read::read(&mut reader, &mut read).unwrap();
        let expected =
            format!(" WARN {} messages lost before this one: the output was not read\nafter\n", 100 - taken);
        assert_eq!(core::str::from_utf8(&read[..count]).unwrap(), expected);
        write("next\n");
        let count = io::Read::read(&mut reader, &mut read).unwrap();
        assert_eq!(&read[..count], b"next\n");
    }

    /// A callsite that is only needed to build names of fields.
    struct NoCallsite;
    static CALLSITE: NoCallsite = NoCallsite;

    impl tracing::Callsite for NoCallsite {
        fn set_interest(&self, _: tracing::subscriber::Interest) {}

        fn metadata(&self) -> &Metadata<'_> {
            unreachable!("no test asks for it")
        }
    }
}
