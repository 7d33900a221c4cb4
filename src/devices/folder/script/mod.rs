//! `firmware.rhai`: a script that is the firmware of a device in a folder.
//!
//! The script has functions with fixed names, called hooks. The device calls them at certain events. A hook
//! works on the map `this`, which snapshots contain. The author of a script may be unknown. So a script has
//! no access to a clock, a file or another device, and its steps, memory and nesting are limited.
//!
//! An engine for scripts can be used in one thread only, but a plant may move to another thread. So each
//! thread compiles a script once ([`program`]), and the device itself stores only data.

mod budget;
mod check;
mod data;
mod engine;
mod exercise;
mod firmware;
mod frames;
mod functions;
mod imports;
mod mistake;
mod program;
mod state;
mod timers;
mod verb_context;
mod verbs;
mod weight;

pub(crate) use budget::stack_position;

use super::FolderError;
use super::card::written_registers;
use super::files::EXERCISE;
use super::own_records::OwnRecord;
use super::part::Part;
use crate::devices::Exercise;
use crate::layout::DeviceLayout;
use crate::whole_script;
use check::Found;
use firmware::ScriptFirmware;
use mistake::Mistake;
use std::path::Path;
use std::sync::Arc;
use twox_hash::XxHash3_64;

/// File with the hooks.
const MAIN: &str = super::SCRIPT;
/// Maximum number of files that a script consists of.
const MOST_FILES: usize = 16;
/// Maximum number of bytes of text in all files of a script.
const LONGEST_SCRIPT: usize = 256 << 10;
/// Maximum number of registers that the hook `written` watches.
const MOST_WATCHED: usize = 65_536;

/// Name and text of each file of a script, the main file first.
type Files = Arc<[(String, String)]>;

/// Definitions of the verbs, for editors with support for Rhai.
pub(crate) const DEFINITIONS: &str = include_str!("firmware.d.rhai");

/// The script of a folder: all its files, and the hooks that it has.
#[derive(Debug)]
pub(super) struct Script {
    files: Files,
    /// Hash of all texts. A thread uses this number to find the script that it has compiled.
    id: u64,
    hooks: Hooks,
    /// Names of the registers for the hook `written`; `None` if the hook is called for all registers that
    /// programs write.
    written: Option<Vec<String>>,
    /// Weight of the heaviest constant in all files.
    constants: u64,
    /// Kinds of journal records that it writes.
    records: Arc<[OwnRecord]>,
}

/// Hooks that a script has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Hooks {
    power_on: bool,
    power_off: bool,
    poll: bool,
    written: bool,
    board: bool,
    trigger: bool,
    sync_edge: bool,
    frame: bool,
    bus_event: bool,
    fault: bool,
}

impl Hooks {
    /// Names of the hooks, each with its parameters.
    const ALL: [(&'static str, &'static [&'static str]); 10] = [
        ("power_on", &[]),
        ("power_off", &[]),
        ("poll", &[]),
        ("written", &["register", "old", "value"]),
        ("board", &["order"]),
        ("trigger", &[]),
        ("sync_edge", &[]),
        ("frame", &["frame"]),
        ("bus_event", &["event"]),
        ("fault", &["name", "on", "fields"]),
    ];

    /// Hooks of devices with a port.
    const OF_PORT: [&'static str; 2] = ["frame", "bus_event"];

    fn flag(&mut self, name: &str) -> Option<&mut bool> {
        match name {
            "power_on" => Some(&mut self.power_on),
            "power_off" => Some(&mut self.power_off),
            "poll" => Some(&mut self.poll),
            "written" => Some(&mut self.written),
            "board" => Some(&mut self.board),
            "trigger" => Some(&mut self.trigger),
            "sync_edge" => Some(&mut self.sync_edge),
            "frame" => Some(&mut self.frame),
            "bus_event" => Some(&mut self.bus_event),
            "fault" => Some(&mut self.fault),
            _ => None,
        }
    }
}

impl Script {
    /// Reads the script in `dir`: `firmware.rhai` and the other scripts in the directory. Returns `None` if the
    /// directory has no script.
    ///
    /// # Errors
    /// A file is a symbolic link, is too long or is not text, or there are too many files.
    pub(super) fn read(dir: &Path) -> Result<Option<Self>, FolderError> {
        let Some(main) = commram_layoutc::read_file_of_folder(dir, MAIN)? else { return Ok(None) };
        let mut files = vec![(MAIN.to_owned(), main)];
        for name in other_names(dir)? {
            if let Some(text) = commram_layoutc::read_file_of_folder(dir, &name)? {
                files.push((name, text));
            }
        }
        let too_much = |what, count: usize, most: usize| {
            Err(FolderError::TooMuch { dir: dir.to_owned(), what, count: count as u64, most: most as u64 })
        };
        if files.len() > MOST_FILES {
            return too_much("files of its script", files.len(), MOST_FILES);
        }
        // The parser limits each file. All files together must not take longer.
        for (sign, what, most) in whole_script::LIMITED {
            let counts = files.iter().map(|(_, text)| text.matches(sign).count());
            let count = counts.clone().sum();
            if count > most && counts.max() <= Some(most) {
                return too_much(what, count, most);
            }
        }
        let bytes = files.iter().map(|(_, text)| text.len()).sum();
        if bytes > LONGEST_SCRIPT {
            return too_much("bytes of its script", bytes, LONGEST_SCRIPT);
        }
        let all: Vec<u8> =
            files.iter().flat_map(|(name, text)| [name, "\0", text, "\0"]).flat_map(str::bytes).collect();
        Ok(Some(Script {
            id: XxHash3_64::oneshot(&all),
            files: files.into(),
            hooks: Hooks::default(),
            written: None,
            constants: 0,
            records: Arc::default(),
        }))
    }

    /// Returns the script with another text for the file `name`.
    #[cfg(feature = "cli")]
    pub(super) fn with(self, name: &str, text: &str) -> Self {
        let is_it = |known: &str| known == name;
        let files = self.files.iter().map(|(known, old)| {
            let text = if is_it(known) { text } else { old };
            (known.clone(), text.to_owned())
        });
        Script { files: files.collect(), ..self }
    }

    /// Returns the name and text of each file.
    pub(super) fn files(&self) -> &[(String, String)] {
        &self.files
    }

    /// Compiles the script for this layout, and finds its hooks. Returns the names of the files that it imports.
    ///
    /// # Errors
    /// [`FolderError::Script`] with file and line.
    pub(super) fn check(
        &mut self,
        dir: &Path,
        layout: &'static DeviceLayout,
        records: &[OwnRecord],
    ) -> Result<Vec<String>, FolderError> {
        self.records = records.into();
        // A script with other declared records is another script, so its hash includes these records.
        self.id = XxHash3_64::oneshot_with_seed(self.id, format!("{records:?}").as_bytes());
        let Found { hooks, written, imports, constants } = check::check(self, layout).map_err(|mistake| {
            let Mistake { file, line, what } = mistake;
            FolderError::Script { path: dir.join(file), line: line.unwrap_or(1), what }
        })?;
        (self.hooks, self.written, self.constants) = (hooks, written, constants);
        if self.watches() && written_registers(layout, self.written()).nth(MOST_WATCHED).is_some() {
            let what = format!(
                "the hook written has more than {MOST_WATCHED} registers; select registers with a constant: const WRITTEN = [\"card.w_COMMAND\"];"
            );
            return Err(FolderError::Script { path: dir.join(MAIN), line: 1, what });
        }
        Ok(imports)
    }

    /// Returns names of the script's hooks.
    pub(super) fn hooks(&self) -> Vec<String> {
        let mut hooks = self.hooks;
        let has = |(name, _): &(&str, _)| hooks.flag(name).is_some_and(|flag| *flag);
        Hooks::ALL.into_iter().filter(has).map(|(name, _)| name.to_owned()).collect()
    }

    /// True if the script has a hook for writes of programs.
    pub(super) fn watches(&self) -> bool {
        self.hooks.written
    }

    /// Returns the names of the registers for which the script must be notified of writes; `None` for all
    /// registers that programs write.
    pub(super) fn written(&self) -> Option<&[String]> {
        self.written.as_deref()
    }

    /// Returns the firmware of a device with this layout.
    pub(super) fn firmware(&'static self, layout: &'static DeviceLayout) -> Box<dyn Part> {
        Box::new(ScriptFirmware::new(self, layout))
    }
}

/// Reads the exercise of a device with this layout in the folder `dir`. Returns `None` if the folder has no
/// exercise.
///
/// # Errors
/// The file is a symbolic link, is too long or is not a script, or its declarations are wrong.
pub(super) fn read_exercise(
    dir: &Path,
    layout: &'static DeviceLayout,
) -> Result<Option<&'static Exercise>, FolderError> {
    let text = commram_layoutc::read_file_of_folder(dir, EXERCISE)?;
    text.map(|text| exercise::read(dir, layout, &text)).transpose()
}

/// Returns the names of all scripts except the main script, in alphabetical order.
fn other_names(dir: &Path) -> Result<Vec<String>, FolderError> {
    let missing = |reason| FolderError::Missing { dir: dir.to_owned(), reason };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(dir).map_err(missing)? {
        let name = entry.map_err(missing)?.file_name();
        match name.to_str() {
            // The directory `.rhai` has definitions for editors.
            Some(name)
                if name.ends_with(".rhai") && !name.starts_with('.') && name != MAIN && name != EXERCISE =>
            {
                names.push(name.to_owned());
            }
            _ => {}
        }
        // The caller refuses more files.
        if names.len() > MOST_FILES {
            break;
        }
    }
    names.sort();
    Ok(names)
}
