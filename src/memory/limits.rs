//! Limits of a process (`ulimit`): checks whether they suffice, and texts that name the limit that caused an error.

#[cfg(feature = "cli")]
pub(crate) mod of_command;
#[cfg(feature = "emulator")]
pub(crate) mod space;

use super::process::read_kernel_file;
use rustix::io::Errno;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Path of a file that every process can open.
const NOTHING: &str = "/dev/null";
/// Directory in which the system lists the open files of this process.
const OPEN_FILES: &str = "/proc/self/fd";

/// Returns the text about the limit that explains a system error, to append to a message; empty if no limit explains
/// it.
pub(crate) fn named(reason: &io::Error) -> String {
    match Errno::from_io_error(reason) {
        Some(Errno::MFILE) => getrlimit(Resource::Nofile).current.map_or_else(String::new, |most| {
            format!("; this process may have {most} open files (`ulimit -n`)")
        }),
        Some(Errno::FBIG) => describe_file_limit(),
        Some(Errno::NOMEM) => describe_space_limit(),
        Some(Errno::AGAIN) => describe_limit_of_start(),
        _ => String::new(),
    }
}

/// Largest memory of the start of a thread or a process, in bytes: the stack of a scenario, and the same again for the
/// memory that other threads have freed since the error.
const OF_A_START: u64 = 32 << 20;

/// Returns a text like [`named`], for a thread or a process that could not be started. The system reports the same error
/// for too many threads, and for a stack without memory.
fn describe_limit_of_start() -> String {
    let of_threads = describe_thread_limit();
    if of_threads.is_empty() || MEMORIES.iter().any(|memory| memory.is_nearly_full(OF_A_START)) {
        return describe_space_limit();
    }
    of_threads
}

/// Kernel file with the sizes of this process's memory.
const STATUS: &str = "/proc/self/status";

/// A kind of memory of this process that can be limited.
struct Memory {
    resource: Resource,
    /// Begin of the line of [`STATUS`] with its size.
    line: &'static str,
    what: &'static str,
    /// Option of `ulimit`.
    option: &'static str,
}

const DATA: Memory = Memory { resource: Resource::Data, line: "VmData:", what: "data", option: "-d" };
const ADDRESS_SPACE: Memory =
    Memory { resource: Resource::As, line: "VmSize:", what: "address space", option: "-v" };
const MEMORIES: [Memory; 2] = [DATA, ADDRESS_SPACE];

impl Memory {
    fn limit(&self) -> Option<u64> {
        getrlimit(self.resource).current
    }

    /// Returns the number of bytes in use, or 0 if it cannot be read.
    fn used(&self) -> u64 {
        let status = read_kernel_file(STATUS).unwrap_or_default();
        let size = status.lines().find_map(|line| line.strip_prefix(self.line));
        let kib = size.and_then(|size| size.trim().strip_suffix("kB")?.trim().parse().ok());
        kib.unwrap_or(0_u64).saturating_mul(1024)
    }

    /// True if the limit leaves less than `needed` bytes.
    fn is_nearly_full(&self, needed: u64) -> bool {
        self.limit().is_some_and(|most| most < self.used().saturating_add(needed))
    }
}

/// Returns a text like [`named`], for an error that a lack of memory may have caused. It is empty unless the address
/// space or the data segment is limited.
pub(crate) fn describe_space_limit() -> String {
    let named = |memory: Memory| {
        memory.limit().map_or_else(String::new, |most| {
            format!(
                "; this process may have {} KiB of {} (`ulimit {}`)",
                most / 1024,
                memory.what,
                memory.option
            )
        })
    };
    named(ADDRESS_SPACE) + &named(DATA)
}

/// Directory with the control groups of the system.
const CONTROL_GROUPS: &str = "/sys/fs/cgroup";
/// File with the control groups of this process.
const OWN_CONTROL_GROUPS: &str = "/proc/self/cgroup";
/// Number of processes and threads below its limit from which a control group explains an error: other threads may have
/// ended since the error.
const NEAR: u64 = 8;

/// Returns a text like [`named`], for an error that a limit of processes and threads may have caused: of a control group
/// that is nearly full, otherwise of the user.
fn describe_thread_limit() -> String {
    let groups = fs::read_to_string(OWN_CONTROL_GROUPS).unwrap_or_default();
    if let Some((group, most)) = full_control_group(Path::new(CONTROL_GROUPS), &groups) {
        let group = group.display();
        return format!("; the control group {group} may have {most} processes and threads (`pids.max`)");
    }
    getrlimit(Resource::Nproc).current.map_or_else(String::new, |most| {
        format!("; this user may have {most} processes and threads (`ulimit -u`)")
    })
}

/// Returns the directory and the limit of the first control group that is nearly full: one of `groups`, the lines of
/// [`OWN_CONTROL_GROUPS`], or one above it.
fn full_control_group(root: &Path, groups: &str) -> Option<(PathBuf, u64)> {
    let number = |path: PathBuf| fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    groups.lines().find_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next()?, parts.next()?);
        let root = match controllers {
            "" => root.to_owned(),
            _ => root.join(controllers.split(',').find(|controller| *controller == "pids")?),
        };
        let own = root.join(path.trim_start_matches('/'));
        own.ancestors().take_while(|group| group.starts_with(&root)).find_map(|group| {
            let (most, present) = (number(group.join("pids.max"))?, number(group.join("pids.current"))?);
            (most.saturating_sub(present) <= NEAR).then(|| (group.to_owned(), most))
        })
    })
}

/// Returns a text like [`named`], for an error that a limit of file sizes may have caused. It is empty if there is no
/// such limit.
pub(crate) fn describe_file_limit() -> String {
    getrlimit(Resource::Fsize).current.map_or_else(String::new, |most| {
        format!("; this process may write files of {} KiB (`ulimit -f`)", most / 1024)
    })
}

/// Makes sure that this process can open `more` files in addition to the open ones; raises its soft limit if necessary,
/// and up to `wished` if possible.
///
/// # Errors
/// The largest number of files, if it is less than needed.
pub(crate) fn allow_files(more: u64, wished: u64) -> Result<(), FileLimit> {
    // The listing itself uses one descriptor.
    let open = match fs::read_dir(OPEN_FILES) {
        Ok(files) => files.count().saturating_sub(1) as u64,
        // Without /proc, the number of open descriptors is estimated by opening a file: its descriptor is the lowest
        // free number. If the file cannot be opened, all descriptors are in use.
        Err(_) => fs::File::open(NOTHING).map_or(u64::MAX, |file| u64::from(file.as_raw_fd().unsigned_abs())),
    };
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let open = open.min(current.unwrap_or(u64::MAX));
    let (needed, wished) = (open.saturating_add(more), open.saturating_add(wished.max(more)));
    if current.is_none_or(|current| current >= wished) {
        return Ok(());
    }
    let raised = maximum.map_or(wished, |most| most.min(wished));
    let most = match setrlimit(Resource::Nofile, Rlimit { current: Some(raised), maximum }) {
        Ok(()) => raised,
        Err(_) => current.unwrap_or(raised),
    };
    if most < needed { Err(FileLimit { needed, most }) } else { Ok(()) }
}

/// A too low limit of open files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FileLimit {
    /// Number of open files that the process needs.
    pub(crate) needed: u64,
    /// Number of open files that the process may have.
    pub(crate) most: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_errors_explained_by_a_limit_name_it() {
        let of = |errno: Errno| named(&errno.into());
        let most = getrlimit(Resource::Nofile).current.unwrap();
        assert_eq!(of(Errno::MFILE), format!("; this process may have {most} open files (`ulimit -n`)"));
        assert_eq!(of(Errno::NOENT), "");
        assert_eq!(of(Errno::FBIG).is_empty(), getrlimit(Resource::Fsize).current.is_none());
        let has_limit = !describe_space_limit().is_empty() || getrlimit(Resource::Nproc).current.is_some();
        assert_eq!(of(Errno::AGAIN).is_empty(), !has_limit);
        assert_eq!(of(Errno::NOMEM), describe_space_limit());
        assert!(DATA.used() > 0 && ADDRESS_SPACE.used() > DATA.used());
    }

    #[test]
    fn a_nearly_full_control_group_is_found() {
        let directory = tempfile::tempdir().unwrap();
        let root = directory.path();
        let group = |path: &str, most: &str, present: u64| {
            fs::create_dir_all(root.join(path)).unwrap();
            fs::write(root.join(path).join("pids.max"), format!("{most}\n")).unwrap();
            fs::write(root.join(path).join("pids.current"), format!("{present}\n")).unwrap();
        };
        group("pids/a/b", "max", 5);
        group("pids/a", "100", 93);
        group("c/d", "20", 3);
        let found = |groups| full_control_group(root, groups);
        // Version 1, a group above the own one.
        assert_eq!(found("9:name=systemd:/\n8:cpu,pids:/a/b\n0::/\n"), Some((root.join("pids/a"), 100)));
        assert_eq!(found("8:cpu:/a\n"), None);
        // Version 2.
        assert_eq!(found("0::/c/d\n"), None);
        group("c/d", "10", 3);
        assert_eq!(found("0::/c/d\n"), Some((root.join("c/d"), 10)));
        assert_eq!((found("0::/nowhere\n"), found("nonsense\n"), found("")), (None, None, None));
    }

    #[test]
    fn too_many_files_are_refused_with_the_numbers() {
        assert_eq!(allow_files(1, 2), Ok(()));
        let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
        if let Some(most) = maximum {
            let refused = allow_files(most, most).unwrap_err();
            assert!(refused.needed > most && refused.most == most, "{refused:?}");
        }
        setrlimit(Resource::Nofile, Rlimit { current, maximum }).unwrap();
    }
}
