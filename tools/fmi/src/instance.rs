//! An instance.

use super::border::{LogMessage, Refused, Status};
use commram::fmi::{MARK, Resources, Unit};
use core::ffi::{CStr, c_char, c_void};
use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Life cycle of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    /// The instance was created or reset.
    Instantiated,
    /// The instance is being initialized.
    Initializing,
    /// The instance is between two steps.
    Stepping,
    /// The instance was terminated.
    Ended,
    /// An internal error has occurred; the instance cannot be used any more.
    Broken,
}

/// Category of errors, which are always reported.
const ERRORS: &CStr = c"logStatusError";
/// Category of the access checker's findings.
const FINDINGS: &CStr = c"findings";

/// The function of the importer that receives messages.
#[derive(Clone, Copy)]
pub(crate) struct Log {
    environment: *mut c_void,
    callback: LogMessage,
}

impl Log {
    pub(crate) fn new(environment: *mut c_void, callback: LogMessage) -> Self {
        Self { environment, callback }
    }

    /// Reports an error.
    pub(crate) fn error(self, status: Status, text: &str) {
        self.report(status, ERRORS, text);
    }

    fn report(self, status: Status, category: &CStr, text: &str) {
        let Some(callback) = self.callback else { return };
        let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
        // SAFETY: the creator of the instance guarantees the callback and its argument for the whole life of the
        // instance. The texts are valid during the call.
        unsafe { callback(self.environment, status, category.as_ptr(), text.as_ptr()) }
    }
}

/// Contents of an instance.
pub(crate) struct Inner {
    pub unit: Unit,
    pub mode: Mode,
    resources: Resources,
    log: Log,
    /// True if the access checker's findings are reported.
    reports_findings: bool,
}

impl Inner {
    /// Makes an instance; an error is reported to the log callback.
    pub(crate) fn make(
        token: *const c_char,
        resources: *const c_char,
        is_logging: bool,
        environment: *mut c_void,
        callback: LogMessage,
    ) -> Option<Box<Self>> {
        let log = Log::new(environment, callback);
        let make = || {
            let resources =
                Resources::of_directory(Path::new(text(resources, "the path of the resources")?))?;
            let unit = Unit::new(&resources)?;
            let (given, right) = (text(token, "the token")?, unit.token());
            if given != right {
                return Err(Refused(format!(
                    "the archive's description is of another plant or version than its shared object ({MARK} \
                     {right}, the description has {given}); `commram export fmu` renews it"
                )));
            }
            Ok(Box::new(Self {
                unit,
                mode: Mode::Instantiated,
                resources,
                log,
                reports_findings: is_logging,
            }))
        };
        match catch_unwind(AssertUnwindSafe(make)) {
            Ok(Ok(made)) => Some(made),
            Ok(Err(Refused(text))) => {
                log.error(Status::Error, &text);
                None
            }
            Err(_) => {
                log.error(Status::Fatal, "internal error of commram");
                None
            }
        }
    }

    /// Returns to the state after instantiation.
    pub(crate) fn reset(&mut self) -> Result<(), Refused> {
        self.unit = Unit::new(&self.resources)?;
        self.mode = Mode::Instantiated;
        Ok(())
    }

    /// Changes to another mode, from one of `from`.
    pub(crate) fn change_mode(&mut self, from: &[Mode], to: Mode, function: &str) -> Result<(), Refused> {
        self.is_in(from, function)?;
        self.mode = to;
        Ok(())
    }

    /// True if `function` may be called now.
    pub(crate) fn is_in(&self, modes: &[Mode], function: &str) -> Result<(), Refused> {
        if modes.contains(&self.mode) {
            return Ok(());
        }
        let state = match self.mode {
            Mode::Instantiated => "before initialization",
            Mode::Initializing => "in initialization mode",
            Mode::Stepping => "in step mode",
            Mode::Ended | Mode::Broken => "after the end",
        };
        Err(Refused(format!("{function} cannot be called {state}")))
    }

    /// Sets the categories of messages that the log callback receives. No category means all.
    pub(crate) fn listen(&mut self, is_on: bool, categories: &[*const c_char]) -> Result<(), Refused> {
        let mut findings = categories.is_empty();
        for category in categories {
            let category = text(*category, "a category")?;
            let known = [ERRORS, FINDINGS].map(|known| known.to_str().unwrap_or_default());
            if !known.contains(&category) {
                let known = known.join(", ");
                return Err(Refused(format!(
                    "there is no log category '{category}'; the categories are: {known}"
                )));
            }
            findings |= FINDINGS.to_str() == Ok(category);
        }
        if findings {
            self.reports_findings = is_on;
        }
        Ok(())
    }

    /// Reports the findings of the access checker.
    pub(crate) fn report_findings(&mut self) {
        if self.reports_findings {
            for line in self.unit.take_findings() {
                self.log.report(Status::Warning, FINDINGS, &line);
            }
        }
    }

    pub(crate) fn log(&self, status: Status, text: &str) {
        self.log.error(status, text);
    }

    pub(crate) fn is_broken(&self) -> bool {
        self.mode == Mode::Broken
    }

    pub(crate) fn mark_broken(&mut self) {
        self.mode = Mode::Broken;
    }
}

/// Reads a text argument.
fn text<'a>(text: *const c_char, what: &str) -> Result<&'a str, Refused> {
    if text.is_null() {
        return Err(Refused(format!("{what} is a null pointer")));
    }
    // SAFETY: the pointer is not null. The standard requires that the text ends with a zero and is valid during the
    // call.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map_err(|_| Refused(format!("{what} is no text in UTF-8")))
}
