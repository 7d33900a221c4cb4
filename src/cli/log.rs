//! Messages of the library on the standard error output: ` WARN the text key=value`.

use super::output;
use core::fmt::{Debug, Write};
use std::io;
use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing::span::{Attributes, Id, Record};
use tracing::subscriber::set_global_default;
use tracing::{Event, Level, Metadata, Subscriber};

/// Prints warnings and errors from now on, with `--verbose` all messages.
pub(super) fn to_stderr() {
    let most = if output::is_verbose() { Level::DEBUG } else { Level::WARN };
    // It fails only in a process that has set another subscriber.
    let _ = set_global_default(Log { most });
}

/// Prints events. There are no spans in this program.
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
        // Write errors are ignored.
        let _ = io::Write::write_all(&mut io::stderr().lock(), text.as_bytes());
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
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

    /// Required only for the names of fields.
    struct NoCallsite;
    static CALLSITE: NoCallsite = NoCallsite;

    impl tracing::Callsite for NoCallsite {
        fn set_interest(&self, _: tracing::subscriber::Interest) {}

        fn metadata(&self) -> &Metadata<'_> {
            unreachable!("no test asks for it")
        }
    }
}
