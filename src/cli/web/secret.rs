//! The token and the keys of sessions. Both are random and are compared in constant time; the token is stored in a
//! file that only its owner can read.

use crate::cli::error::CliError;
use crate::input_file;
use crate::memory::private::PrivateDir;
use crate::memory::{EmulatorProcess, MemoryError};
use rustix::rand::{GetRandomFlags, getrandom};
use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use subtle::ConstantTimeEq;

/// Length of a secret in bytes.
const BYTES: usize = 32;
/// Length of a file with a token: two digits for each byte, and the end of the line.
const LENGTH_OF_FILE: u64 = 2 * BYTES as u64 + 1;

/// A secret of 256 random bits, as hexadecimal digits. The type has no `Debug`, so that no message can contain a
/// secret.
pub(super) struct Secret(String);

impl Secret {
    /// Creates a secret.
    ///
    /// # Errors
    /// The kernel cannot provide random numbers.
    pub(super) fn random() -> io::Result<Self> {
        let mut bytes = [0; BYTES];
        let mut filled = 0;
        while let Some(rest) = bytes.get_mut(filled..).filter(|rest| !rest.is_empty()) {
            filled += getrandom(rest, GetRandomFlags::empty())?;
        }
        let mut digits = String::with_capacity(2 * BYTES);
        for byte in bytes {
            // Writing to a string cannot fail.
            let _ = write!(digits, "{byte:02x}");
        }
        Ok(Self(digits))
    }

    /// Compares a text with the secret in a time that depends only on the length of `text`.
    pub(super) fn is(&self, text: &[u8]) -> bool {
        self.0.as_bytes().ct_eq(text).into()
    }

    /// Returns the hexadecimal digits.
    pub(super) fn digits(&self) -> &str {
        &self.0
    }
}

/// The file with the token. Dropping this value removes the file, unless another process has replaced it.
pub(super) struct TokenFile {
    path: PathBuf,
    file: File,
    /// The directory for tokens, if the file is in it.
    directory: Option<PrivateDir>,
}

impl TokenFile {
    /// Writes the token to a new file of mode 0600.
    ///
    /// # Errors
    /// The file exists already, or cannot be written.
    pub(super) fn write(path: &Path, token: &Secret) -> Result<Self, CliError> {
        let failed = |reason| CliError::File { path: path.to_owned(), reason };
        let mut options = OpenOptions::new();
        let mut file = options.write(true).create_new(true).mode(0o600).open(path).map_err(failed)?;
        // The lock protects the file from cleanup, which removes neither locked files nor empty ones: the server that
        // creates an empty file is still writing it.
        file.lock().map_err(failed)?;
        let this = Self { path: path.to_owned(), file: file.try_clone().map_err(failed)?, directory: None };
        file.write_all(format!("{}\n", token.digits()).as_bytes()).map_err(failed)?;
        Ok(this)
    }

    /// Writes the token to the file that the user has named. Replaces the token of a killed server there, but nothing else.
    ///
    /// # Errors
    /// The file exists and is not that of a killed server, or cannot be written.
    pub(super) fn named(path: &Path, token: &Secret) -> Result<Self, CliError> {
        match Self::write(path, token) {
            Err(CliError::File { reason, .. }) if reason.kind() == io::ErrorKind::AlreadyExists => {}
            written => return written,
        }
        // The lock is held until the file is removed, so another server does not do the same.
        let left = left_token(path).ok_or_else(|| CliError::TokenFileTaken { path: path.to_owned() })?;
        std::fs::remove_file(path).map_err(|reason| CliError::File { path: path.to_owned(), reason })?;
        drop(left);
        Self::write(path, token)
    }

    /// Writes the token to the file `name` in the user's directory for tokens. Removes the files of killed
    /// servers there.
    ///
    /// # Errors
    /// The directory does not belong to this user, or the file cannot be written.
    pub(super) fn usual(name: &str, token: &Secret) -> Result<Self, CliError> {
        remove_left_files().map_err(|error| match error {
            CliError::Memory(error) => not_kept(error),
            other => other,
        })?;
        let path = directory();
        refuse_runtime_of_others(&path)?;
        let directory = PrivateDir::create(&path).map_err(not_kept)?;
        // The name of the file contains the port. Two servers can use the same port at different addresses, so the
        // second server needs another name.
        let mut names =
            std::iter::once(name.to_owned()).chain((2..).map(|number| format!("{name}-{number}")));
        loop {
            let name = names.next().unwrap_or_default();
            match Self::write(&path.join(name), token) {
                Err(CliError::File { reason, .. }) if reason.kind() == io::ErrorKind::AlreadyExists => {}
                written => {
                    let mut file = written?;
                    file.directory = Some(directory);
                    return Ok(file);
                }
            }
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for TokenFile {
    fn drop(&mut self) {
        let own = self.file.metadata().ok().map(|own| (own.dev(), own.ino()));
        let named = self.path.symlink_metadata().ok().map(|named| (named.dev(), named.ino()));
        if own.is_some() && own == named {
            let _ = std::fs::remove_file(&self.path);
        }
        if let Some(directory) = &self.directory {
            directory.remove_if_empty();
        }
    }
}

/// Returns the name of the token's file for the server of an instance. If there are several servers, the names of further
/// files begin with this name and a hyphen.
pub(super) fn file_name(instance: &str, port: u16) -> String {
    format!("{instance}-{port}")
}

/// True if the name is that of a file for servers of an instance at a port.
fn is_file_of(name: &str, instance: &str, port: u16) -> bool {
    let is_number = |text: &str| text.bytes().all(|digit| digit.is_ascii_digit());
    let rest = name.strip_prefix(&file_name(instance, port));
    rest.is_some_and(|rest| rest.is_empty() || rest.strip_prefix('-').is_some_and(is_number))
}

/// Returns the processes that serve an instance at a port, at any address, with a token file in the directory for tokens.
/// Errors are ignored: servers that cannot be found are left out.
pub(super) fn servers_of(instance: &str, port: u16) -> Vec<EmulatorProcess> {
    let path = directory();
    let (Ok(Some(directory)), Ok(entries)) = (PrivateDir::open(&path), std::fs::read_dir(&path)) else {
        return Vec::new();
    };
    let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let holder = |name: String| {
        let file = directory.find_file(&name).ok()??;
        EmulatorProcess::holding_lock(&file).ok()?
    };
    names.filter(|name| is_file_of(name, instance, port)).filter_map(holder).collect()
}

/// Opens the file at `path` if it contains the token of a killed server of this user, and nothing else. The file is locked.
fn left_token(path: &Path) -> Option<File> {
    let mut file = input_file::open_no_link(path).ok()?;
    let found = file.metadata().ok()?;
    let is_own = found.is_file() && found.uid() == rustix::process::geteuid().as_raw();
    if !is_own || found.len() != LENGTH_OF_FILE {
        return None;
    }
    file.try_lock().ok()?;
    let mut text = String::new();
    file.read_to_string(&mut text).ok()?;
    let is_token = text.trim_end().bytes().all(|digit| matches!(digit, b'0'..=b'9' | b'a'..=b'f'));
    let named = path.symlink_metadata().ok()?;
    (is_token && (named.dev(), named.ino()) == (found.dev(), found.ino())).then_some(file)
}

/// Removes the token files of killed servers.
///
/// # Errors
/// The directory for tokens does not belong to this user, or cannot be read.
pub(crate) fn remove_left_files() -> Result<(), CliError> {
    let path = directory();
    let directory = match PrivateDir::open(&path) {
        Ok(Some(directory)) => directory,
        // A directory of another user contains no file of this user.
        Ok(None) | Err(MemoryError::ForeignDirectory { .. }) => return Ok(()),
        Err(error) => return Err(error.into()),
    };
    let failed = |reason| CliError::File { path: path.clone(), reason };
    for entry in std::fs::read_dir(&path).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name();
        let Some(name) = name.to_str() else { continue };
        let Some(file) = directory.find_file(name)? else { continue };
        let is_written = file.metadata().is_ok_and(|it| it.is_file() && it.len() > 0);
        if is_written && file.try_lock().is_ok() && directory.names(name, &file) {
            directory.remove(name);
        }
    }
    directory.remove_if_empty();
    Ok(())
}

/// Refuses a directory for tokens in a directory of another user, who could exchange it. `XDG_RUNTIME_DIR` may be that of
/// another user after `su` or `sudo`.
fn refuse_runtime_of_others(directory: &Path) -> Result<(), CliError> {
    let Some(runtime) = directory.parent() else { return Ok(()) };
    let Ok(found) = runtime.metadata() else { return Ok(()) };
    let owner = found.uid();
    if owner == 0 || owner == rustix::process::geteuid().as_raw() {
        return Ok(());
    }
    Err(CliError::TokenDirectory { reason: format!("{} belongs to user {owner}", runtime.display()) })
}

/// Returns the error for a directory for tokens that cannot be used.
fn not_kept(error: MemoryError) -> CliError {
    let reason = match error {
        MemoryError::ForeignDirectory { path, owner, .. } => {
            format!("{} belongs to user {owner}", path.display())
        }
        other => other.to_string(),
    };
    CliError::TokenDirectory { reason }
}

/// Returns the directory for tokens: the one of the session manager, otherwise a directory of this user in the file
/// system of the images.
fn directory() -> PathBuf {
    let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|path| path.is_absolute());
    match runtime {
        Some(runtime) => runtime.join("commram"),
        None => {
            let user = rustix::process::geteuid().as_raw();
            Path::new(crate::memory::names::IMAGE_DIRECTORY).join(format!("commram-web-{user}"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn secrets_differ_and_match_only_themselves() {
        let [one, other] = [(); 2].map(|()| Secret::random().unwrap());
        assert_eq!(one.digits().len(), 64);
        assert!(one.is(one.digits().as_bytes()));
        assert!(!one.is(other.digits().as_bytes()) && !one.is(b"") && !one.is(&[b'0'; 65]));
    }

    #[test]
    fn the_files_of_other_ports_and_instances_are_others() {
        let is_it = |name| is_file_of(name, "press-1", 8080);
        assert!(is_it("press-1-8080") && is_it("press-1-8080-2"));
        for other in
            ["press-1-80801", "press-1-808", "press-8080", "press-1-8080-a", "press-11-8080", "+all-8080"]
        {
            assert!(!is_it(other), "{other}");
        }
    }

    #[test]
    fn the_file_is_for_its_owner_and_goes_with_the_server() {
        let place = tempfile::tempdir().unwrap();
        let (path, token) = (place.path().join("token"), Secret::random().unwrap());
        let file = TokenFile::write(&path, &token).unwrap();
        assert_eq!(path.metadata().unwrap().mode() & 0o7777, 0o600);
        assert_eq!(std::fs::read_to_string(&path).unwrap().trim(), token.digits());
        assert!(TokenFile::write(&path, &token).is_err(), "an existing file is not overwritten");
        let other = File::open(&path).unwrap();
        assert!(other.try_lock().is_err(), "other servers see that this one lives");
        assert!(TokenFile::named(&path, &token).is_err(), "the server lives");
        drop((file, other));
        assert!(!path.exists());
    }

    #[test]
    fn only_the_file_of_a_killed_server_is_replaced() {
        let place = tempfile::tempdir().unwrap();
        let (path, token) = (place.path().join("token"), Secret::random().unwrap());
        std::fs::write(&path, format!("{}\n", Secret::random().unwrap().digits())).unwrap();
        let file = TokenFile::named(&path, &token).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap().trim(), token.digits());
        drop(file);
        let others = ["", "text\n", &"x".repeat(65)].map(str::to_owned);
        for text in others {
            std::fs::write(&path, &text).unwrap();
            let Err(CliError::TokenFileTaken { .. }) = TokenFile::named(&path, &token) else {
                panic!("{text}")
            };
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
    }
}
