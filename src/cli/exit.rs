//! Exit codes of all commands. The help and the documentation repeat this list word for word.

use crate::coupling::CouplingError;
use crate::federation::FederationError;
use crate::memory::MemoryError;
use crate::runtime::RuntimeError;
use commram_layoutc::import::ImportError;

/// An exit code. `commram with` returns the exit code of its command instead, once the command has run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Exit {
    /// Everything was done as requested.
    Done = 0,
    /// An expectation failed, or an emulator did not start or end as it should.
    Failed = 1,
    /// The request is not valid.
    WrongUse = 2,
    /// The emulator is missing, or the system refuses a resource.
    NotThere = 3,
    /// The standard output cannot be written; everything else is done.
    NoOutput = 4,
    /// The user has interrupted the command.
    Interrupted = 130,
}

impl Exit {
    pub(crate) const ALL: [Self; 6] =
        [Self::Done, Self::Failed, Self::WrongUse, Self::NotThere, Self::NoOutput, Self::Interrupted];

    pub(crate) const fn code(self) -> u8 {
        self as u8
    }

    pub(crate) const fn meaning(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed => "an expectation failed, or the emulator could not start or end as it should",
            Self::WrongUse => "wrong use",
            Self::NotThere => "the emulator is not running or has gone, or the system refuses a resource",
            Self::NoOutput => "the output cannot be written; everything else is done",
            Self::Interrupted => "ended by Ctrl-C",
        }
    }
}

impl From<Exit> for u8 {
    fn from(exit: Exit) -> Self {
        exit.code()
    }
}

pub(super) fn of_memory(error: &MemoryError) -> Exit {
    match error {
        MemoryError::BadName { .. } => Exit::WrongUse,
        MemoryError::AlreadyRunning { .. } | MemoryError::InstanceTaken { .. } => Exit::Failed,
        _ => Exit::NotThere,
    }
}

pub(super) fn of_runtime(error: &RuntimeError) -> Exit {
    match error {
        RuntimeError::Plant(_)
        | RuntimeError::Speed { .. }
        | RuntimeError::Memory(MemoryError::BadName { .. }) => Exit::WrongUse,
        RuntimeError::Federation(error) => of_federation(error),
        _ => Exit::Failed,
    }
}

fn of_federation(error: &FederationError) -> Exit {
    match error {
        FederationError::OtherCount { .. }
        | FederationError::OtherPlant { .. }
        | FederationError::OtherVersion { .. }
        | FederationError::NobodyLeads
        | FederationError::Coupling(
            CouplingError::File { .. } | CouplingError::Unknown { .. } | CouplingError::Unfit { .. },
        ) => Exit::WrongUse,
        FederationError::Exchange(_) | FederationError::Silent { .. } | FederationError::Coupling(_) => {
            Exit::NotThere
        }
        _ => Exit::Failed,
    }
}

pub(super) fn of_import(error: &ImportError) -> Exit {
    match error {
        ImportError::Layout(_)
        | ImportError::Declaration(_)
        | ImportError::NothingDeclared { .. }
        | ImportError::Called { .. } => Exit::WrongUse,
        _ => Exit::Failed,
    }
}

pub(super) fn of_client(error: &crate::channel::ClientError) -> Exit {
    use crate::channel::ClientError;
    use crate::request::Code;
    match error {
        ClientError::TooManyOperations { .. } => Exit::WrongUse,
        ClientError::Refused(refused) if [Code::SHUTTING_DOWN, Code::NO_RESOURCE].contains(&refused.code) => {
            Exit::NotThere
        }
        ClientError::Refused(refused) if refused.code.is_wrong_use() => Exit::WrongUse,
        ClientError::Refused(_) => Exit::Failed,
        _ => Exit::NotThere,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::error::CliError;

    /// The help is generated from this list; the documentation page must have the same list.
    #[test]
    fn the_documentation_repeats_the_list_of_exit_codes() {
        let page = include_str!("../../docs/reference/command-line.md");
        for exit in Exit::ALL {
            let row = format!("\n| {} | {}", exit.code(), exit.meaning());
            assert!(page.contains(&row), "docs/reference/command-line.md lacks{row}");
        }
    }

    #[test]
    fn errors_have_the_exit_code_of_their_kind() {
        let not_running = CliError::NotRunning { instance: "x".into(), running: String::new() };
        assert_eq!(not_running.exit_code(), 3);
        assert_eq!(CliError::Memory(MemoryError::EmulatorDied { path: "x".into(), pid: 1 }).exit_code(), 3);
        assert_eq!(
            CliError::Memory(MemoryError::InstanceTaken { instance: "x".into(), pid: None }).exit_code(),
            1
        );
        assert_eq!(CliError::Reported.exit_code(), 1);
        assert_eq!(CliError::ReportedWrongUse.exit_code(), 2);
        assert_eq!(CliError::Output { reason: std::io::ErrorKind::StorageFull.into() }.exit_code(), 4);
        assert_eq!(CliError::Interrupted.exit_code(), 130);
        assert_eq!(CliError::Ended(42).exit_code(), 42);
    }

    #[test]
    fn a_refused_request_is_wrong_use_a_failure_or_a_missing_emulator() {
        use crate::channel::ClientError;
        use crate::request::{Code, Refused};
        let code = |code| {
            CliError::Client(ClientError::Refused(Refused { code, text: String::new(), waited: None }))
                .exit_code()
        };
        for state in [Code::NO_SYNC, Code::NOT_SO_FAR, Code::NOT_ALONE, Code::CLOCK_IS_REAL_TIME] {
            assert_eq!(code(state), 1, "{state:?}");
        }
        assert_eq!(code(Code::UNMAPPED), 2);
        assert_eq!(code(Code::SHUTTING_DOWN), 3);
        assert_eq!(code(Code::NO_RESOURCE), 3);
        assert_eq!(
            CliError::Client(ClientError::EmulatorGone { instance: "x".into(), killed: None }).exit_code(),
            3
        );
    }
}
