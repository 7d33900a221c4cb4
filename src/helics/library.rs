//! The library of HELICS, loaded when it is needed: nobody else has to have it.
//!
//! Of its C interface only what federates need that send each other bytes; the names are those of its header `helics.h`.

use super::HelicsError;
use core::ffi::{CStr, c_char, c_int, c_void};
use core::mem::ManuallyDrop;
use libloading::{Library, Symbol};
use std::ffi::CString;
use std::path::{Path, PathBuf};

/// The variable that says where the library is.
pub(super) const VARIABLE: &str = "COMMRAM_HELICS";
/// How cores and broker talk. By `tcp` HELICS 3.6.1 loses long commands.
pub(super) const CORE: &str = "zmq";
/// What it is called.
const NAMES: [&str; 2] = ["libhelics.so.3", "libhelics.so"];

/// `HelicsError`.
#[repr(C)]
pub(super) struct Status {
    code: i32,
    message: *const c_char,
}

impl Status {
    /// What went wrong, if anything did.
    pub(super) fn outcome<T>(&self, value: T) -> Result<T, String> {
        if self.code == 0 {
            return Ok(value);
        }
        // SAFETY: the library's text lasts until its next call on this thread, and is copied now.
        let message = unsafe { (!self.message.is_null()).then(|| CStr::from_ptr(self.message)) };
        let message = message.map(|message| message.to_string_lossy().into_owned()).unwrap_or_default();
        Err(format!("{message} (HELICS error {})", self.code))
    }
}

pub(super) type Object = *mut c_void;
type OfInfo = unsafe extern "C" fn(Object, *const c_char, *mut Status);

/// The functions that are called.
pub(super) struct Functions {
    initialize_error: unsafe extern "C" fn() -> Status,
    create_info: unsafe extern "C" fn() -> Object,
    free_info: unsafe extern "C" fn(Object),
    set_core_type: OfInfo,
    set_core_init: OfInfo,
    create_federate: unsafe extern "C" fn(*const c_char, Object, *mut Status) -> Object,
    enter_executing: unsafe extern "C" fn(Object, *mut Status),
    send_command: unsafe extern "C" fn(Object, *const c_char, *const c_char, *mut Status),
    wait_command: unsafe extern "C" fn(Object, *mut Status) -> *const c_char,
    command_source: unsafe extern "C" fn(Object, *mut Status) -> *const c_char,
    disconnect: unsafe extern "C" fn(Object, *mut Status),
    /// It has threads of its own, so it stays where it is.
    _library: ManuallyDrop<Library>,
}

/// A federate of HELICS that has nothing but commands: no time of others waits for it, and it waits for none.
pub(super) struct Federate {
    functions: Functions,
    federate: Object,
}

// SAFETY: HELICS looks federates up by their handles and keeps what it does in queues that several threads may use. What is not
// guarded is where the last command stands: that is of the one thread that waits for commands.
unsafe impl Send for Federate {}
// SAFETY: as above.
unsafe impl Sync for Federate {}

/// Loads the library.
///
/// # Errors
/// It is not there, or lacks something.
pub(super) fn load() -> Result<Functions, HelicsError> {
    load_with(functions)
}

/// As [`load`], for those functions that `functions` finds.
pub(super) fn load_with<T>(
    functions: impl Fn(&Path) -> Result<T, libloading::Error>,
) -> Result<T, HelicsError> {
    let given = std::env::var_os(VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from);
    let candidates: Vec<PathBuf> = match &given {
        Some(path) if path.is_dir() => NAMES.map(|name| path.join(name)).into(),
        Some(path) => vec![path.clone()],
        None => NAMES.map(PathBuf::from).into(),
    };
    let mut reason = String::new();
    for path in candidates {
        match functions(&path) {
            Ok(functions) => return Ok(functions),
            // What stands first is what was meant.
            Err(error) if reason.is_empty() => reason = error.to_string(),
            Err(_) => {}
        }
    }
    Err(HelicsError::NoLibrary { given, reason })
}

fn functions(path: &Path) -> Result<Functions, libloading::Error> {
    // SAFETY: whoever names a library lets it run in this process; what HELICS does when it is loaded is to set up its own
    // tables. The types are those of its header, which all versions 3 have.
    unsafe {
        let library = Library::new(path)?;
        macro_rules! function {
            ($name:literal) => {{
                let symbol: Symbol<'_, _> = library.get($name)?;
                *symbol
            }};
        }
        Ok(Functions {
            initialize_error: function!(b"helicsErrorInitialize\0"),
            create_info: function!(b"helicsCreateFederateInfo\0"),
            free_info: function!(b"helicsFederateInfoFree\0"),
            set_core_type: function!(b"helicsFederateInfoSetCoreTypeFromString\0"),
            set_core_init: function!(b"helicsFederateInfoSetCoreInitString\0"),
            create_federate: function!(b"helicsCreateValueFederate\0"),
            enter_executing: function!(b"helicsFederateEnterExecutingMode\0"),
            send_command: function!(b"helicsFederateSendCommand\0"),
            wait_command: function!(b"helicsFederateWaitCommand\0"),
            command_source: function!(b"helicsFederateGetCommandSource\0"),
            disconnect: function!(b"helicsFederateDisconnect\0"),
            _library: ManuallyDrop::new(library),
        })
    }
}

/// When this process ends, it does so without what the library has to do then: a call of it is under way, for which that would
/// wait.
pub(super) fn end_without_it() {
    #[cfg(target_env = "gnu")]
    {
        unsafe extern "C" {
            fn on_exit(function: extern "C" fn(c_int, Object), argument: Object) -> c_int;
        }
        extern "C" fn end(status: c_int, _: Object) {
            // SAFETY: it ends the process; what Rust has to write is written by then.
            unsafe { libc::_exit(status) }
        }
        // SAFETY: the function is there as long as the process, and needs no argument.
        unsafe { on_exit(end, core::ptr::null_mut()) };
    }
}

/// Text for C; a NUL in it ends it.
pub(super) fn text(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

impl Functions {
    /// Calls a function that reports by its last argument.
    fn checked<T>(&self, call: impl FnOnce(&Self, *mut Status) -> T) -> Result<T, String> {
        // SAFETY: it only fills in a structure.
        let mut status = unsafe { (self.initialize_error)() };
        let value = call(self, &mut status);
        status.outcome(value)
    }
}

impl Federate {
    /// Joins a federation as `name`. Returns when all federates are there that the broker waits for, or when the core gives up.
    ///
    /// # Errors
    /// There is no broker, or somebody has the name.
    pub(super) fn join(functions: Functions, name: &str, init: &str) -> Result<Self, HelicsError> {
        let failed = |reason| HelicsError::NotJoined { reason };
        let (name, core, init) = (text(name), text(CORE), text(init));
        // SAFETY: here and below: the objects are the library's own; texts live through the calls.
        let info = unsafe { (functions.create_info)() };
        let made = (|| {
            // SAFETY: as above.
            functions.checked(|it, status| unsafe { (it.set_core_type)(info, core.as_ptr(), status) })?;
            // SAFETY: as above.
            functions.checked(|it, status| unsafe { (it.set_core_init)(info, init.as_ptr(), status) })?;
            // SAFETY: as above.
            functions.checked(|it, status| unsafe { (it.create_federate)(name.as_ptr(), info, status) })
        })();
        // SAFETY: as above; the federate has taken over what it needs.
        unsafe { (functions.free_info)(info) };
        let federate = made.map_err(failed)?;
        // SAFETY: as above.
        functions.checked(|it, status| unsafe { (it.enter_executing)(federate, status) }).map_err(failed)?;
        Ok(Federate { functions, federate })
    }

    /// Sends a command to a federate; one that is not there does not get it.
    pub(super) fn send(&self, to: &str, command: &str) -> Result<(), String> {
        let (to, command) = (text(to), text(command));
        self.functions.checked(|it, status| {
            // SAFETY: as above.
            unsafe { (it.send_command)(self.federate, to.as_ptr(), command.as_ptr(), status) }
        })
    }

    /// Waits for the next command: who has sent it, and what it says. On one thread only.
    pub(super) fn wait(&self) -> Result<(String, String), String> {
        let functions = &self.functions;
        let copied = |at: *const c_char| {
            // SAFETY: where the command stands is left alone until the next wait, and it is copied now.
            let text = unsafe { (!at.is_null()).then(|| CStr::from_ptr(at)) };
            text.unwrap_or_default().to_string_lossy().into_owned()
        };
        let command = functions.checked(|it, status| {
            // SAFETY: as above.
            copied(unsafe { (it.wait_command)(self.federate, status) })
        })?;
        let source = functions.checked(|it, status| {
            // SAFETY: as above.
            copied(unsafe { (it.command_source)(self.federate, status) })
        })?;
        Ok((source, command))
    }

    /// Leaves the federation. What was sent arrives before.
    pub(super) fn leave(&self) {
        // SAFETY: as above. Whether it succeeds is all the same to who leaves.
        let _ = self.functions.checked(|it, status| unsafe { (it.disconnect)(self.federate, status) });
    }
}
