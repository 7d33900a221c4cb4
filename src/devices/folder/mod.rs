//! Devices without Rust code. A device is a folder with the files of a layout, which the program reads while
//! it runs.
//!
//! A plant names the folder as `kind = "./cards/counter"`. From then on, the device is registered like the
//! devices of commram: its registers have names, owners, meanings and a layout hash. The author of a folder
//! may be unknown. So its files are limited in size and must be in the folder itself.

mod card;
mod config;
mod dp_master;
#[cfg(feature = "cli")]
pub(crate) mod edited;
mod error;
mod files;
mod firmware;
mod handshakes;
pub(crate) mod in_slot;
mod of_card;
mod own_faults;
mod own_records;
mod part;
mod phase;
mod port;
pub mod records;
pub mod rules;
#[cfg_attr(not(feature = "script"), path = "absent.rs")]
mod script;
mod search;
mod source;
mod state_word;
mod tables;
mod texts;

pub(crate) use config::{FolderConfig, OptionSection};
pub use error::FolderError;
pub use handshakes::{MOST_MIRRORED, MOST_ROWS, Row as Handshake};
pub use own_records::OwnRecord;
pub use search::{names_in_search_path, search, search_first, search_path};

#[cfg(feature = "script")]
pub(crate) use self::{files::files_of, script::stack_position};
#[cfg(feature = "cli")]
pub(crate) use self::{
    own_faults::{OwnFault, OwnField},
    script::DEFINITIONS,
    state_word::WORD as SCRIPT_WORD,
};

use dp_master::ProcessImage;
use handshakes::Tables;
use in_slot::InSlots;
use own_faults::Declarations;
#[cfg(not(feature = "cli"))]
use own_faults::OwnFault;
use script::Script;

use super::{Emulation, Registered, can_bus, profibus_bus, registry};
use crate::fault::FaultKind;
use crate::layout::DeviceLayout;
use crate::memory::header::{AREAS, DEVICE_LENGTH, TABLE_NAME_LENGTH};
use crate::memory::{DeviceFolder, InstanceLock};
use crate::plain_text::is_interpreted;
use commram_layoutc::Layout;
use commram_layoutc::model::{Device, FieldType};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use twox_hash::XxHash3_64;

/// Maximum number of registers and arrays of registers in the structures of a folder.
pub const MOST_REGISTERS: usize = 65_536;
/// Largest image of such a device in bytes.
pub const LARGEST_IMAGE: u64 = 16 << 20;
/// Maximum number of different folders that a process reads. Each state of an edited script counts. There is
/// a limit because the tables of folders are never freed.
pub const MOST_FOLDERS: usize = 128;

/// File with the script of a device.
const SCRIPT: &str = "firmware.rhai";

/// A device of a folder.
#[derive(Debug)]
pub struct Folder {
    /// Entry of the device in the registry.
    pub registered: Registered,
    /// Handshakes of the device.
    pub rows: Vec<Handshake>,
    /// Kinds of journal records that the device defines.
    pub records: Vec<OwnRecord>,
    /// Kinds of faults that the device defines, as in its file.
    #[cfg(feature = "cli")]
    pub(crate) faults: Vec<OwnFault>,
    /// The declared kinds of faults in the form of the list of all faults.
    fault_kinds: &'static [&'static FaultKind],
    script: Option<Script>,
    /// The process image that the PROFIBUS port exchanges with its slaves.
    image: Option<ProcessImage>,
    /// Hash of the files. Folders with different files have different numbers.
    fingerprint: u64,
    /// Hash of the files that the device uses: scripts that no other script imports are left out.
    used: u64,
    /// Hash of the handshakes. Folders with different handshakes have different numbers.
    tables: u64,
    /// Names of the files that the device has read. Files with fixed names are left out.
    inputs: BTreeSet<String>,
}

impl Folder {
    /// Returns the names of the hooks in the device's script; empty if the device has no script.
    #[must_use]
    pub fn hooks(&self) -> Vec<String> {
        self.script.as_ref().map(Script::hooks).unwrap_or_default()
    }

    /// Returns the TOML files and scripts in `dir` that the device does not read. `dir` is the folder of the
    /// device.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn unread_files(&self, dir: &Path) -> Result<Vec<String>, FolderError> {
        files::unread(dir, &self.inputs)
    }

    /// True if the device has a script.
    #[must_use]
    pub fn has_script(&self) -> bool {
        self.script.is_some()
    }
}

/// Folders that this process has read, in the order of reading. They are never freed.
struct Loaded {
    /// The tables of layouts, by the fingerprints of their files.
    tables: Vec<(u64, &'static DeviceLayout)>,
    folders: Vec<&'static Folder>,
    /// Devices of running instances. Only their registers were read.
    registers: Vec<&'static Registered>,
    /// Kinds of faults that folders declare.
    faults: Declarations,
    /// Layouts of cards in slots, and of their controllers.
    in_slots: InSlots,
    /// Maximum number of folders, and of tables.
    most: usize,
}

impl Loaded {
    /// Returns the tables of a layout. `fingerprint` is that of its files.
    fn table(&mut self, fingerprint: u64, read: &Layout) -> &'static DeviceLayout {
        if let Some((_, layout)) = self.tables.iter().find(|(known, _)| *known == fingerprint) {
            return layout;
        }
        let layout = tables::of(read);
        self.tables.push((fingerprint, layout));
        layout
    }

    /// Reads the faults that the folder declares, for a client of a running device. If the file is wrong,
    /// these faults remain unknown to the client.
    fn read_faults(&mut self, dir: &Path, layout: &'static DeviceLayout) {
        let path = dir.join(handshakes::FILE);
        let text = commram_layoutc::read_file_of_folder(dir, handshakes::FILE).ok().flatten();
        if let Some(text) = text
            && self.faults.len() < self.most
            && texts::check(&path, &text).is_ok()
            && let Ok(faults) = handshakes::read_faults(&path, &text, layout)
        {
            self.faults.kinds(layout.name, &faults);
        }
    }

    /// Checks that another folder can be read.
    fn has_room(&self, dir: &Path) -> Result<(), FolderError> {
        if self.lengths().into_iter().all(|length| length < self.most) {
            return Ok(());
        }
        Err(FolderError::TooManyFolders { dir: dir.to_owned(), most: self.most })
    }

    /// Returns the numbers that `most` limits for each folder.
    fn lengths(&self) -> [usize; 4] {
        [self.tables.len(), self.folders.len(), self.registers.len(), self.faults.len()]
    }
}

static LOADED: Mutex<Loaded> = Mutex::new(Loaded {
    tables: Vec::new(),
    folders: Vec::new(),
    registers: Vec::new(),
    faults: Declarations::new(),
    in_slots: InSlots::new(),
    most: MOST_FOLDERS,
});

fn loaded() -> MutexGuard<'static, Loaded> {
    LOADED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the kinds of faults that the folders declare, in the order of reading.
pub(super) fn declared_fault_kinds() -> Vec<&'static FaultKind> {
    loaded().faults.all()
}

/// True if `kind` of a plant file, or the name of a device on the command line, is the path of a folder.
#[must_use]
pub fn is_path(kind: &str) -> bool {
    kind.contains('/')
}

/// Reads the device in the folder `dir` and registers it. If several folders have equal files, the device is
/// registered once.
///
/// # Errors
/// [`FolderError`]: a file is wrong (the error names the line), the device exceeds a limit, or its name is
/// already used.
pub fn load(dir: &Path) -> Result<&'static Folder, FolderError> {
    let mut read = commram_layoutc::read_folder(dir)?;
    let mut inputs: BTreeSet<String> = read.inputs.iter().filter_map(|(path, _)| file_name(path)).collect();
    files::check(dir, &inputs)?;
    let handshakes = commram_layoutc::read_file_of_folder(dir, handshakes::FILE)?;
    read.inputs.iter().try_for_each(|(path, text)| texts::check(path, text))?;
    if let Some(text) = &handshakes {
        texts::check(&dir.join(handshakes::FILE), text)?;
    }
    let mut script = Script::read(dir)?;
    if script.is_some() {
        state_word::add(dir, &mut read.device)?;
    }
    // If there is a script, the front panel has one more word, so the layout is different.
    let of_layout = fingerprint(dir, &read, script.iter().map(|_| (SCRIPT, "")));
    let of_handshakes = handshakes.clone().map(|text| (handshakes::FILE.to_owned(), text));
    let others: Vec<_> =
        of_handshakes.into_iter().chain(script.iter().flat_map(Script::files).cloned()).collect();
    let hash_of = |is_counted: &dyn Fn(&str) -> bool| {
        let counted = others.iter().filter(|(name, _)| is_counted(name));
        fingerprint(dir, &read, counted.map(|(name, text)| (name.as_str(), text.as_str())))
    };
    let fingerprint = hash_of(&|_| true);
    let mut loaded = loaded();
    if let Some(known) = loaded.folders.iter().find(|known| known.fingerprint == fingerprint) {
        return Ok(known);
    }
    check_limits(dir, &read)?;
    check_names(dir, &read)?;
    loaded.has_room(dir)?;
    let layout = loaded.table(of_layout, &read);
    let tables = XxHash3_64::oneshot(handshakes.as_deref().unwrap_or_default().as_bytes());
    let Tables { rows, records, faults, image } = match handshakes {
        Some(text) => handshakes::read(&dir.join(handshakes::FILE), &text, layout)?,
        None => Tables::default(),
    };
    if let Some(script) = &mut script {
        inputs.extend(script.check(dir, layout, &records)?);
    }
    let used = hash_of(&|name| files::FIXED.contains(&name) || inputs.contains(name));
    check_fault_hook(dir, script.as_ref(), &rows, &faults)?;
    check_image(dir, layout, image.is_some())?;
    let fault_kinds = loaded.faults.kinds(layout.name, &faults);
    let exercises = script::read_exercise(dir, layout)?;
    let emulation = Emulation { exercises: Vec::leak(Vec::from_iter(exercises)), ..Emulation::NONE };
    let registered = Registered { emulation, ..Registered::new(layout) };
    let folder = Folder {
        registered,
        rows,
        records,
        #[cfg(feature = "cli")]
        faults,
        fault_kinds,
        script,
        image,
        fingerprint,
        used,
        tables,
        inputs,
    };
    let folder: &'static Folder = Box::leak(Box::new(folder));
    loaded.folders.push(folder);
    Ok(folder)
}

/// Checks that each declared fault has an effect, and that a script with a hook for faults has declared
/// faults.
fn check_fault_hook(
    dir: &Path,
    script: Option<&Script>,
    rows: &[Handshake],
    faults: &[OwnFault],
) -> Result<(), FolderError> {
    if script.is_some_and(|script| script.hooks().iter().any(|hook| hook == "fault")) {
        if faults.is_empty() {
            let what = format!("the hook fault has no effect: {} declares no [[fault]]", handshakes::FILE);
            return Err(FolderError::Script { path: dir.join(SCRIPT), line: 1, what });
        }
        return Ok(());
    }
    let is_used = |index| rows.iter().any(|row| row.unless_fault() == Some(index));
    match faults.iter().enumerate().find(|(index, _)| !is_used(*index)) {
        None => Ok(()),
        Some((_, OwnFault { name, line, .. })) => {
            let what = format!(
                "the fault `{name}` has no effect: no table has unless_fault = \"{name}\", and {SCRIPT} has no hook fault(name, on, fields)"
            );
            Err(FolderError::Table { path: dir.join(handshakes::FILE), line: *line, what })
        }
    }
}

/// Checks that a device with a PROFIBUS port has a process image.
fn check_image(dir: &Path, layout: &DeviceLayout, has_image: bool) -> Result<(), FolderError> {
    match layout.ports.iter().find(|port| port.medium == profibus_bus::FAMILY) {
        Some(port) if !has_image => {
            let what = format!("the port `{}` needs a table [process_image]", port.name);
            Err(FolderError::Table { path: dir.join(handshakes::FILE), line: 1, what })
        }
        _ => Ok(()),
    }
}

fn file_name(path: &Path) -> Option<String> {
    Some(path.file_name()?.to_str()?.to_owned())
}

/// Returns the text of a plant file with the device in the folder `dir` as its only device. If the device has
/// a CAN port, the plant also has a bus `can` at 125 kbit/s for the port (D-813).
#[must_use]
pub fn plant_alone(dir: &Path, layout: &DeviceLayout) -> String {
    let (name, kind) = (toml::Value::from(layout.name), toml::Value::from(dir.display().to_string()));
    let device = format!("[[device]]\nname = {name}\nkind = {kind}\n");
    match layout.ports.iter().find(|port| port.medium == can_bus::FAMILY) {
        None => device,
        Some(_) => {
            format!("{device}bus = \"can\"\n\n[[bus]]\nname = \"can\"\nkind = \"can\"\nkbit_s = 125\n")
        }
    }
}

/// Checks that no other device has the device's name or layout hash.
fn check_names(dir: &Path, read: &Layout) -> Result<(), FolderError> {
    let taken = |what, other: &Registered| {
        let (dir, name) = (dir.to_owned(), read.device.name.clone());
        Err(FolderError::Taken { dir, what, name, other: other.layout.name })
    };
    if let Some(other) = registry::find(&read.device.name) {
        return taken("the name", other);
    }
    match registry::all().iter().find(|known| known.layout.layout_hash == read.layout_hash) {
        Some(other) => taken("the layout hash", other),
        None => Ok(()),
    }
}

/// Returns the device of a folder with this layout hash. Folders may have equal addresses and differ only in
/// other facts; then the last one that was read is returned.
pub(super) fn of_hash(hash: u64) -> Option<&'static Registered> {
    let loaded = loaded();
    let folders = loaded.folders.iter().rev().map(|folder| &folder.registered);
    let registers = loaded.registers.iter().rev().copied();
    let mut registered = folders.chain(registers).chain(loaded.in_slots.registered());
    registered.find(|known| known.layout.layout_hash == hash)
}

/// Reads the registers of the device in the folder, and the faults that the folder declares. A client
/// of a running device needs only these. So it does not matter if the handshakes or the script are wrong or
/// missing.
///
/// # Errors
/// Like [`load`], for the files with registers.
fn load_registers(folder: &DeviceFolder) -> Result<&'static Registered, FolderError> {
    // The device keeps its script while the file is missing. A new script has no effect.
    let DeviceFolder { path: dir, has_script } = folder;
    let mut read = commram_layoutc::read_folder(dir)?;
    read.inputs.iter().try_for_each(|(path, text)| texts::check(path, text))?;
    if *has_script {
        state_word::add(dir, &mut read.device)?;
    }
    let of_layout = fingerprint(dir, &read, has_script.then_some((SCRIPT, "")).into_iter());
    let mut loaded = loaded();
    let known = loaded.tables.iter().find(|(known, _)| *known == of_layout).map(|(_, layout)| *layout);
    let is_of = |layout: &DeviceLayout| known.is_some_and(|known| core::ptr::eq(layout, known));
    let folders = loaded.folders.iter().map(|folder| &folder.registered);
    let known = folders.chain(loaded.registers.iter().copied()).find(|it| is_of(it.layout));
    if let Some(known) = known {
        loaded.read_faults(dir, known.layout);
        return Ok(known);
    }
    check_limits(dir, &read)?;
    check_names(dir, &read)?;
    loaded.has_room(dir)?;
    let layout = loaded.table(of_layout, &read);
    let registered: &'static Registered = Box::leak(Box::new(Registered::new(layout)));
    loaded.registers.push(registered);
    loaded.read_faults(dir, layout);
    Ok(registered)
}

/// Reads the registers in the device folders of a running instance, so that this process also knows the names
/// of these registers. A folder that cannot be read is left out. An image of its device is then refused,
/// because its layout hash is unknown.
pub(super) fn load_of_instance(instance: &str) {
    let folders = InstanceLock::device_folders(instance);
    for folder in &folders {
        let _ = load_registers(folder);
    }
    for line in InstanceLock::controllers(instance) {
        let _ = in_slot::read_line(&line, &folders);
    }
}

/// Returns the reason why no folder of an instance has the registers of an image. The result has a text for
/// each folder.
pub(super) fn differences(instance: &str) -> String {
    let difference = |folder: DeviceFolder| match load_registers(&folder) {
        Err(reason) => reason.to_string(),
        Ok(_) => format!(
            "in {} a register has another name, type or address, or the device another name",
            folder.path.display()
        ),
    };
    InstanceLock::device_folders(instance).into_iter().map(difference).collect::<Vec<_>>().join("; ")
}

/// Finds the folder at `path`, which is relative to `base`. Returns an absolute path without symbolic links.
///
/// # Errors
/// There is no such folder, or its path is not a text of one line.
pub fn find(base: &Path, path: &str) -> Result<PathBuf, FolderError> {
    let path = base.join(path);
    let found = path.canonicalize().map_err(|reason| FolderError::Missing { dir: path.clone(), reason })?;
    match found.to_str() {
        Some(text) if !text.contains(is_interpreted) => Ok(found),
        _ => Err(FolderError::BadPath { dir: path }),
    }
}

/// Returns the hash of the names and texts of the layout's files, and of other files.
fn fingerprint<'a>(dir: &Path, read: &'a Layout, others: impl Iterator<Item = (&'a str, &'a str)>) -> u64 {
    let mut all = Vec::new();
    let inputs = read.inputs.iter().map(|(path, text)| {
        (path.strip_prefix(dir).unwrap_or(path).as_os_str().as_encoded_bytes(), text.as_str())
    });
    let others = others.map(|(name, text)| (name.as_bytes(), text));
    for (name, text) in inputs.chain(others) {
        for part in [name, text.as_bytes()] {
            all.extend_from_slice(&(part.len() as u64).to_le_bytes());
            all.extend_from_slice(part);
        }
    }
    XxHash3_64::oneshot(&all)
}

/// Checks the limits that apply to a device of a folder in addition to the limits of every layout.
fn check_limits(dir: &Path, read: &Layout) -> Result<(), FolderError> {
    let device = &read.device;
    let too_much = |what, count, most| Err(FolderError::TooMuch { dir: dir.to_owned(), what, count, most });
    let registers = registers_of(device);
    if registers > MOST_REGISTERS {
        return too_much("registers", registers as u64, MOST_REGISTERS as u64);
    }
    let spaces = device.spaces.iter().map(|space| u64::from(space.offset) + u64::from(space.bytes));
    let image = spaces.max().unwrap_or_default();
    if image > LARGEST_IMAGE {
        return too_much("bytes of its image", image, LARGEST_IMAGE);
    }
    // The retain flags count as an additional area.
    let areas = device.areas.len() + usize::from(device.retain.is_some());
    if areas >= AREAS {
        return too_much("areas", areas as u64, AREAS as u64 - 1);
    }
    let longest = |what, name: &str, most: usize| match name.len() < most {
        true => Ok(()),
        false => {
            let name = name.to_owned();
            Err(FolderError::LongName { dir: dir.to_owned(), what, name, most: most - 1 })
        }
    };
    longest("the device", &device.name, DEVICE_LENGTH)?;
    device.areas.iter().try_for_each(|area| longest("an area", &area.name, TABLE_NAME_LENGTH))
}

/// Counts the registers of all structures. The registers of a sub-structure count once for each field with
/// this sub-structure as its type.
fn registers_of(device: &Device) -> usize {
    let fields = device.structures.iter().flat_map(|structure| &structure.fields);
    let counts = fields.map(|field| match field.kind {
        FieldType::Sub(index) => device.substructures.get(index).map_or(0, |sub| sub.fields.len()),
        _ => 1,
    });
    counts.fold(0, usize::saturating_add)
}
