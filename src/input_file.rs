//! Input files of users: plants, scenarios, dumps, logs.
//!
//! A name can refer to any kind of file. The emulator must not read a device such as `/dev/zero`, because the data
//! never end, and must not wait for a pipe without a writer, because the data never begin. Pipes with a writer, such as
//! a shell's `<(...)`, are read like files.

use rustix::fs::OFlags;
use std::fs::{File, OpenOptions};
use std::io::{Cursor, Error, ErrorKind, Read, Result};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// Maximum length of a dump or log, in bytes. A log of this length contains the frames of five minutes on a CAN bus
/// without idle time.
pub const LONGEST: u64 = 64 << 20;
/// Maximum length of a plant. Sufficient for a plant of 1,000 PLCs with 32 drives each.
pub(crate) const LONGEST_PLANT: u64 = 8 << 20;
/// Maximum length of a script in bytes; each import counts separately. The whole script is compiled before its first
/// line runs. Compiling a longer script could take too long, because the compiler compares each pair of names in a map
/// or of cases in a `switch`.
pub(crate) const LONGEST_SCRIPT: u64 = 64 << 10;

/// Maximum length of a file that describes an exchange with other simulators. Sufficient for 20,000 values with keys.
#[cfg(feature = "channel")]
pub(crate) const LONGEST_EXCHANGE: u64 = 1 << 20;

/// True if the process reads its commands from the standard input, so that it cannot be an input file.
static IS_TAKEN: AtomicBool = AtomicBool::new(false);

/// Refuses the standard input as a file from now on.
#[cfg(feature = "cli")]
pub(crate) fn take_standard_input() {
    IS_TAKEN.store(true, Ordering::Relaxed);
}

/// Reads the text of a file or pipe.
///
/// # Errors
/// The file cannot be read, is neither file nor pipe, is longer than `longest` bytes, or is not UTF-8.
pub fn read(path: &Path, longest: u64) -> Result<String> {
    text(read_bytes(path, longest)?)
}

/// Converts bytes to text.
///
/// # Errors
/// The bytes are not UTF-8.
pub fn text(bytes: Vec<u8>) -> Result<String> {
    String::from_utf8(bytes).map_err(|_| Error::new(ErrorKind::InvalidData, "it is no text in UTF-8"))
}

/// Reads the contents of a file or pipe. `-` means the standard input. Its bytes are kept, so that later calls return
/// them again.
///
/// # Errors
/// The file cannot be read, is neither file nor pipe, or is longer than `longest` bytes.
pub(crate) fn read_bytes(path: &Path, longest: u64) -> Result<Vec<u8>> {
    static STANDARD: OnceLock<Vec<u8>> = OnceLock::new();
    if is_standard(path) && IS_TAKEN.load(Ordering::Relaxed) {
        let what = "the shell reads its commands from the standard input; write the name of a file";
        return Err(Error::new(ErrorKind::InvalidInput, what));
    }
    if is_standard(path)
        && let Some(bytes) = STANDARD.get().filter(|bytes| bytes.len() as u64 <= longest)
    {
        return Ok(bytes.clone());
    }
    let bytes = match is_standard(path) {
        true => read_up_to(longest, std::io::stdin())?.inspect(|bytes| drop(STANDARD.set(bytes.clone()))),
        false => {
            let (file, begin) = open(path)?;
            read_up_to(longest, begin.chain(file))?
        }
    };
    bytes.ok_or_else(|| too_long(format!("it is longer than {}, the limit of such files", size(longest))))
}

/// Formats a number of bytes in the largest unit that needs no fraction.
fn size(bytes: u64) -> String {
    match bytes {
        0 => "0 bytes".to_owned(),
        bytes if bytes.is_multiple_of(1 << 20) => format!("{} MiB", bytes >> 20),
        bytes if bytes.is_multiple_of(1 << 10) => format!("{} KiB", bytes >> 10),
        bytes => format!("{bytes} bytes"),
    }
}

/// True for the name `-`. It means the standard input, or for output files the standard output.
pub(crate) fn is_standard(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Reads the contents of a regular file of any format.
///
/// # Errors
/// The file cannot be read, is not a regular file, or is longer than `longest` bytes.
#[cfg(feature = "cli")]
pub(crate) fn read_regular(path: &Path, longest: u64) -> Result<Vec<u8>> {
    let file = open_without_waiting(path)?;
    let metadata = file.metadata()?;
    if !metadata.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "it is no regular file"));
    }
    // A long file is not read at all.
    let bytes = if metadata.len() > longest { None } else { read_up_to(longest, file)? };
    bytes.ok_or_else(|| too_long(format!("it has more than {longest} bytes")))
}

/// Reads all data; `None` if there are more than `longest` bytes.
pub(crate) fn read_up_to(longest: u64, file: impl Read) -> Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    file.take(longest + 1).read_to_end(&mut bytes)?;
    Ok((bytes.len() as u64 <= longest).then_some(bytes))
}

fn too_long(text: String) -> Error {
    Error::new(ErrorKind::FileTooLarge, text)
}

/// Opens any kind of file for reading. A pipe without a writer appears as empty.
///
/// # Errors
/// The file cannot be opened.
pub(crate) fn open_without_waiting(path: &Path) -> Result<File> {
    open_with(path, OFlags::empty())
}

/// Opens any kind of file like [`open_without_waiting`], but not a link.
///
/// # Errors
/// The file cannot be opened, or is a link.
#[cfg(feature = "cli")]
pub(crate) fn open_no_link(path: &Path) -> Result<File> {
    open_with(path, OFlags::NOFOLLOW)
}

fn open_with(path: &Path, flags: OFlags) -> Result<File> {
    // Without O_NONBLOCK, opening a pipe waits for a writer.
    let flags = (flags | OFlags::NONBLOCK | OFlags::NOCTTY).bits();
    OpenOptions::new().read(true).custom_flags(flags as i32).open(path)
}

/// Opens a file or a pipe. Returns the file, and the bytes that the function has already read from a pipe.
///
/// # Errors
/// The file cannot be opened, is neither file nor pipe, or is an empty pipe without a writer.
fn open(path: &Path) -> Result<(File, Cursor<Vec<u8>>)> {
    let mut file = open_without_waiting(path)?;
    let kind = file.metadata()?.file_type();
    let mut begin = Vec::new();
    if kind.is_fifo() {
        // Only a read can distinguish a pipe without a writer from a pipe with a writer that is still silent.
        let mut first = [0];
        match file.read(&mut first) {
            Ok(0) => {
                let what =
                    "it is an empty pipe, and no program has it open for writing; start the writer first";
                return Err(Error::new(ErrorKind::UnexpectedEof, what));
            }
            Ok(_) => begin.extend_from_slice(&first),
            Err(silent) if silent.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
        rustix::fs::fcntl_setfl(&file, rustix::fs::OFlags::empty())?;
    } else if kind.is_dir() {
        return Err(Error::new(ErrorKind::IsADirectory, "it is a directory; a regular file is needed"));
    } else if !kind.is_file() {
        return Err(Error::new(
            ErrorKind::InvalidInput,
            "it is a device or socket; a regular file is needed",
        ));
    }
    Ok((file, Cursor::new(begin)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn endless_files_are_refused() {
        let message = read(Path::new("/dev/zero"), LONGEST).unwrap_err().to_string();
        assert_eq!(message, "it is a device or socket; a regular file is needed");
        let directory = tempfile::tempdir().unwrap();
        assert!(read(directory.path(), LONGEST).unwrap_err().to_string().starts_with("it is a directory"));
        let long = directory.path().join("long");
        std::fs::write(&long, "12345").unwrap();
        assert_eq!(read(&long, 5).unwrap(), "12345");
        assert_eq!(
            read(&long, 4).unwrap_err().to_string(),
            "it is longer than 4 bytes, the limit of such files"
        );
        assert_eq!([64 << 10, 8 << 20, 1025].map(size), ["64 KiB", "8 MiB", "1025 bytes"]);
    }

    #[test]
    fn a_pipe_is_read_to_its_end_and_needs_a_writer() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("pipe");
        rustix::fs::mknodat(rustix::fs::CWD, &path, rustix::fs::FileType::Fifo, 0o600.into(), 0).unwrap();
        let refused = read(&path, LONGEST).unwrap_err().to_string();
        assert!(refused.contains("no program has it open for writing"), "{refused}");
        // A writer that is still silent counts as a writer.
        let writer = OpenOptions::new().read(true).write(true).open(&path).unwrap();
        let reading = std::thread::spawn({
            let path = path.clone();
            move || read(&path, 4)
        });
        (&writer).write_all(b"12345").unwrap();
        assert!(reading.join().unwrap().unwrap_err().to_string().starts_with("it is longer than 4 bytes"));
        drop(writer);
        let (reader, mut writer) = std::io::pipe().unwrap();
        let reading = std::thread::spawn(move || {
            let name = format!("/proc/self/fd/{}", std::os::fd::AsRawFd::as_raw_fd(&reader));
            read(Path::new(&name), LONGEST).unwrap()
        });
        writer.write_all(b"[[plc]]").unwrap();
        drop(writer);
        assert_eq!(reading.join().unwrap(), "[[plc]]");
    }
}
