//! Errors of the emulated RAM.

use super::{Address, HEADER_SIZE, State, header::EVENT_SLOTS, limits, names::IMAGE_DIRECTORY, room};
use rustix::io::Errno;
use std::{io, path::PathBuf, time::Duration};

/// The reason why an access or an image file was refused. The message names the fault, its place, and what would be
/// right.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MemoryError {
    /// The address does not suit the width.
    #[error("{address}: {}", .address.width().alignment_rule())]
    Misaligned {
        /// Address and width of the access; the address is not divisible by the width.
        address: Address,
    },
    /// The access ends after the last byte of the memory segment.
    #[error("{address} is after the last one, byte {}", end - 1)]
    OutOfRange {
        /// Address and width of the access after the end of the image.
        address: Address,
        /// Offset of the first byte after the memory segment.
        end: usize,
    },
    /// The access touches the header page, which belongs to the attach contract and holds no registers.
    #[error("{address} is in the header page; registers begin at byte {}", HEADER_SIZE)]
    InHeader {
        /// Address and width of the access to the header page.
        address: Address,
    },
    /// A block (typed view or copy) does not fit into the memory segment.
    #[error("byte {offset} of the image: {size} bytes from there end after the last one, byte {}", end - 1)]
    BlockOutOfRange {
        /// First byte of the block.
        offset: u32,
        /// Length of the access in bytes.
        size: usize,
        /// Offset of the first byte after the permitted range.
        end: usize,
    },
    /// A typed view at an address its widest register does not allow.
    #[error("byte {offset} of the image: a view of {type_name} needs an address divisible by {align}")]
    BlockMisaligned {
        /// First byte of the block.
        offset: u32,
        /// Alignment of the type's widest register.
        align: usize,
        /// The Rust type of the view.
        type_name: &'static str,
    },
    /// The value has more bits than the register.
    #[error("{address}: 16#{value:X} does not fit, a {} holds at most 16#{:X}", .address.width(), .address.width().max_value())]
    ValueTooWide {
        /// Address and width of the register.
        address: Address,
        /// Value, too large for the register.
        value: u32,
    },
    /// A partial access outside the register that it names.
    #[error("{part} is not a part of the register there: {register}")]
    NotWithin {
        /// Address of the whole register.
        register: Address,
        /// The access of which the given access should have been a part.
        part: Address,
    },
    /// A write or a writable view on an image that was attached for reading.
    #[error(
        "byte {offset} of the image: it is attached read-only; attach it for reading and writing instead"
    )]
    ReadOnly {
        /// First byte of the access.
        offset: u32,
    },
    /// The name of an instance or a PLC breaks the rules.
    #[error("{what} name {name:?}: use 1 to 31 characters of A-Z a-z 0-9 _ -")]
    BadName {
        /// Kind of the name: `instance` or `PLC`.
        what: &'static str,
        /// Name that breaks the rules.
        name: String,
    },
    /// Another emulator holds the image.
    #[error(
        "instance '{instance}' is already running{}, it serves the image of PLC '{plc}'; stop it first or choose another \
            instance name", process(*.pid)
    )]
    AlreadyRunning {
        /// Name of the running instance.
        instance: String,
        /// Name of the PLC with the image; the other emulator serves it.
        plc: String,
        /// Process id of the emulator that uses the file, if the id is known.
        pid: Option<u32>,
    },
    /// The file system has no memory for an image.
    #[error("{}: no room for an image of {} KiB, {} has {free_kib} KiB left; enlarge it (`mount -o remount,size=...`, \
             in Docker `--shm-size`) or end another instance", .path.display(), needed.div_ceil(1024), IMAGE_DIRECTORY)]
    NoRoom {
        /// Path of the image that cannot be created.
        path: PathBuf,
        /// Length of the image in bytes.
        needed: usize,
        /// Free memory in the file system of the image, in KiB.
        free_kib: u64,
    },
    /// The machine has no memory for all images of a plant.
    #[error(
        "instance '{instance}': no room for {count} images of {needed_kib} KiB together, {free_kib} KiB of memory are left in {}; \
             make the plant smaller, enlarge it (`mount -o remount,size=...`, in Docker `--shm-size`) or end \
             another instance",
        IMAGE_DIRECTORY
    )]
    NoRoomForAll {
        /// Name of the instance that should start.
        instance: String,
        /// Number of images of the plant.
        count: usize,
        /// Memory that the images still need, in KiB.
        needed_kib: u64,
        /// Available memory of the machine, in KiB.
        free_kib: u64,
    },
    /// Another emulator has the instance, or a process is removing the files of a killed one.
    #[error("instance '{instance}' is already running{}; stop it first or choose another instance name", process(*.pid))]
    InstanceTaken {
        /// Name of the running instance.
        instance: String,
        /// Process id of the emulator that has it, if known.
        pid: Option<u32>,
    },
    /// There is no image of this name.
    #[error("{} does not exist, no emulator with this name runs; start it with `commram run -i \
        {instance}`", .path.display())]
    NotThere {
        /// Name of the instance that does not run.
        instance: String,
        /// Path of the image that does not exist.
        path: PathBuf,
    },
    /// The path is a symbolic link, which could lead anywhere.
    #[error("{} is a symbolic link; it is left alone, remove it yourself", .path.display())]
    Symlink {
        /// Path of the symbolic link.
        path: PathBuf,
    },
    /// The path is a directory, a pipe or the like.
    #[error("{} is no regular file; it is left alone, remove it yourself", .path.display())]
    NotAFile {
        /// Path that should be a regular file.
        path: PathBuf,
    },
    /// The file is one of another instance: a hard link, a copy, or renamed.
    #[error("{} is a file of instance '{owner}' (a hard link, a copy, or renamed) and is left alone; \
        remove this name, or rename it back", .path.display())]
    OtherInstance {
        /// Path of the file.
        path: PathBuf,
        /// Name of the instance to which the file belongs.
        owner: String,
    },
    /// The file, or another kind of entry with this name, belongs to another user.
    #[error("{} belongs to user {owner}, not to user {user}; an image is used by its owner only: choose another instance \
        name, or ask user {owner} or root to remove it", .path.display())]
    ForeignOwner {
        /// Path of the image that belongs to another user.
        path: PathBuf,
        /// User id of the file's owner.
        owner: u32,
        /// User id of this process.
        user: u32,
    },
    /// The instance's directory, or another kind of entry with its name, belongs to another user.
    #[error("{} belongs to user {owner}, not to user {user}, and that user has taken this instance name; choose \
        another one, or ask user {owner} or root to remove it", .path.display())]
    ForeignDirectory {
        /// Path of the file that belongs to another user.
        path: PathBuf,
        /// User id of the directory's owner.
        owner: u32,
        /// User id of this process.
        user: u32,
    },
    /// Other users can write to the instance's directory.
    #[error("{} can be written by other users (mode {mode:o}), and its content is not reliable; remove it \
        yourself", .path.display())]
    OpenDirectory {
        /// Path of the directory that other users can write.
        path: PathBuf,
        /// Permission bits of the directory.
        mode: u32,
    },
    /// An entry of another kind has the name of the instance's directory.
    #[error("{} is no directory; it is left alone, remove it yourself", .path.display())]
    NotADirectory {
        /// Path that should be a directory.
        path: PathBuf,
    },
    /// The file is not an image: it does not begin with the magic.
    #[error("{} is no commram image (it begins with 16#{found:016X}); it is left alone, remove it yourself", .path.display())]
    WrongMagic {
        /// Path of the file, which is not an image.
        path: PathBuf,
        /// First eight bytes of the file, as a little-endian number.
        found: u64,
    },
    /// The image follows another version of the attach contract.
    #[error("{} has ABI version {found}, this program knows {expected}; use programs of one commram version", .path.display())]
    OtherAbi {
        /// Path of the image that has another ABI version.
        path: PathBuf,
        /// ABI version of the image.
        found: u32,
        /// Version that this program uses.
        expected: u32,
    },
    /// An emulator of another build was killed, and its image still exists. Clients may still map this image with the
    /// register map of that build.
    #[error("{} was left by a commram with register map 16#{found:016X}, this one (version {}) was built with \
             16#{expected:016X}; remove it with `commram stop --clean -i {instance}`",
             .path.display(), env!("CARGO_PKG_VERSION"))]
    LeftByOther {
        /// Path of the image that has another register map.
        path: PathBuf,
        /// Name of the instance to which the image belongs.
        instance: String,
        /// The hash in the image.
        found: u64,
        /// Hash of this program's register map.
        expected: u64,
    },
    /// The image has another register map than the program expects.
    #[error("{} holds {device} with register map 16#{found:016X}, this program is made for 16#{expected:016X}; \
             rebuild it against this emulator's layout", .path.display())]
    OtherLayout {
        /// Path of the image that has another register map.
        path: PathBuf,
        /// Name of the emulated device.
        device: String,
        /// Layout hash in the header page of the image.
        found: u64,
        /// Hash that the caller expects.
        expected: u64,
    },
    /// The folder that describes the device cannot be read any more, or its registers have changed.
    #[error("{} holds {device}, whose registers are described by a folder, which is gone or has changed since the emulator \
             started: {changes}; restore the folder, or start the instance again", .path.display())]
    LostFolder {
        /// Path of the image of the device.
        path: PathBuf,
        /// Name of the emulated device.
        device: String,
        /// The error or the change of each folder of the instance.
        changes: String,
    },
    /// The file ends before the memory segment does.
    #[error("{} is {size} bytes long, an image has {}; it is damaged, restart the emulator", .path.display(), expected)]
    TooShort {
        /// Path of the image that has the wrong length.
        path: PathBuf,
        /// Length of the file in bytes.
        size: u64,
        /// The length according to its header page.
        expected: u32,
    },
    /// The emulator runs, but does not answer yet or no longer answers.
    #[error("{} is not ready, its emulator is {}; try again when it is ready", .path.display(), state_name(*.state))]
    NotReady {
        /// Path of the image, which is not ready yet or has no emulator any more.
        path: PathBuf,
        /// State of the emulator; `None` for a number without meaning.
        state: Option<State>,
    },
    /// The emulator of the image was killed.
    #[error("{}: the emulator (process {pid}) has died; restart it, or attach read-only to read its last \
        values", .path.display())]
    EmulatorDied {
        /// Path of the image; its emulator has died.
        path: PathBuf,
        /// The process that has ended.
        pid: u32,
    },
    /// The emulator has ended normally while this client was attached.
    #[error("{}: the emulator has stopped; attach again when it runs", .path.display())]
    EmulatorStopped {
        /// Path of the image; its emulator has stopped.
        path: PathBuf,
    },
    /// Another emulator has taken the image over while this client was attached; all registers are
    /// reset.
    #[error("{}: the emulator was restarted (generation {found} instead of {attached}) and all registers are reset; attach again", .path.display())]
    EmulatorRestarted {
        /// Path of the image; its emulator was restarted.
        path: PathBuf,
        /// Generation at the time of attaching.
        attached: u32,
        /// Generation that the image has now.
        found: u32,
    },
    /// A register did not get the awaited value in time.
    #[error("{address} still holds 16#{last:0digits$X} after {timeout:?}", digits = 2 * .address.width().bytes() as usize)]
    RegisterTimeout {
        /// Address of the register that the program polled.
        address: Address,
        /// Value of the register at the end of the wait.
        last: u32,
        /// Length of the wait, in real time.
        timeout: Duration,
    },
    /// A condition was not met in time.
    #[error("{what} did not happen within {timeout:?}")]
    Timeout {
        /// Description of the awaited condition.
        what: String,
        /// Length of the wait, in real time.
        timeout: Duration,
    },
    /// There is no event of this number.
    #[error("event {number}: events have the numbers 0 to {}", EVENT_SLOTS - 1)]
    NoSuchEvent {
        /// Refused number; no event has it.
        number: usize,
    },
    /// Too many tasks take part in lockstep.
    #[error("all {seats} places for tasks in lockstep are taken")]
    NoSeat {
        /// Number of seats of the image, all taken.
        seats: usize,
    },
    /// A task may not take part in lockstep.
    #[error(
        "the task of event {event} cannot take part in lockstep: the clock must be stepped, and the event one of 0, 2, 4, 5, 6, 8, 11, 12"
    )]
    LockstepRefused {
        /// Number of the event that starts the task.
        event: usize,
    },
    /// The emulator has continued without a task.
    #[error(
        "the emulator has given up the task of event {event}, because its turn took longer than its patience; \
            join again"
    )]
    LockstepLost {
        /// Number of the event that starts the task.
        event: usize,
    },
    /// The operating system refused.
    #[error("{}: cannot {doing}: {reason}{}{}", .path.display(), limits::named(.reason), room::named(.path, .reason))]
    System {
        /// Path of the file or directory.
        path: PathBuf,
        /// The operation that failed, for example "open".
        doing: &'static str,
        /// Error of the operating system.
        reason: io::Error,
    },
}

impl MemoryError {
    /// True if the operating system or a limit of this process refused a resource. A file that could not be opened may
    /// still exist.
    pub(super) fn is_shortage(&self) -> bool {
        let Self::System { reason, .. } = self else { return false };
        matches!(Errno::from_io_error(reason), Some(Errno::MFILE | Errno::NFILE | Errno::NOMEM))
    }
}

fn process(pid: Option<u32>) -> String {
    pid.map_or_else(String::new, |pid| format!(" (process {pid})"))
}

fn state_name(state: Option<State>) -> &'static str {
    match state {
        Some(State::Starting) => "starting",
        Some(State::Ready) => "ready",
        Some(State::Stopping) => "stopping",
        Some(State::Stopped | State::Unsaved) => "stopped",
        None => "in an unknown state",
    }
}
