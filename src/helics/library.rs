//! The HELICS library. It is loaded on demand, so that users without HELICS need not install it.
//!
//! Declares only the functions that are called, with the names of the header `helics.h`.

use super::HelicsError;
use core::ffi::{CStr, c_char, c_int, c_void};
use core::mem::ManuallyDrop;
use libloading::{Library, Symbol};
use std::ffi::CString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Environment variable with the path of the library.
pub(super) const VARIABLE: &str = "COMMRAM_HELICS";
/// Transport between cores and broker. With `tcp`, HELICS 3.6.1 loses long commands.
const CORE: &str = "zmq";
/// File names of the library.
const NAMES: [&str; 2] = ["libhelics.so.3", "libhelics.so"];

/// Error object of HELICS, `HelicsError`.
#[repr(C)]
pub(super) struct Status {
    code: i32,
    message: *const c_char,
}

impl Status {
    /// Returns `value`, or the error that the library reported.
    fn outcome<T>(&self, value: T) -> Result<T, String> {
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
/// True if this process has loaded the library.
static IS_LOADED: AtomicBool = AtomicBool::new(false);

type Set<T> = unsafe extern "C" fn(Object, T, *mut Status);
type Do = unsafe extern "C" fn(Object, *mut Status);
type Name = *const c_char;
/// Creates a federate with a name from a federate info object.
type Constructor = unsafe extern "C" fn(Name, Object, *mut Status) -> Object;

macro_rules! functions {
    ($($name:ident: $ty:ty = $symbol:literal,)*) => {
        /// The functions that are called.
        pub(super) struct Functions {
            $(pub(super) $name: $ty,)*
            /// The library has threads, so it is never unloaded.
            _library: ManuallyDrop<Library>,
        }

        fn functions(path: &Path) -> Result<Functions, libloading::Error> {
            // SAFETY: naming a library permits it to run in this process; on loading, HELICS only sets up its
            // tables. The types are those of its header, which all versions 3 have.
            unsafe {
                let library = Library::new(path)?;
                $(let $name: $ty = {
                    let symbol: Symbol<'_, $ty> = library.get($symbol)?;
                    *symbol
                };)*
                Ok(Functions { $($name,)* _library: ManuallyDrop::new(library) })
            }
        }
    };
}

functions! {
    initialize_error: unsafe extern "C" fn() -> Status = b"helicsErrorInitialize\0",
    create_info: unsafe extern "C" fn() -> Object = b"helicsCreateFederateInfo\0",
    free_info: unsafe extern "C" fn(Object) = b"helicsFederateInfoFree\0",
    set_core_type: Set<Name> = b"helicsFederateInfoSetCoreTypeFromString\0",
    set_core_init: Set<Name> = b"helicsFederateInfoSetCoreInitString\0",
    set_time: unsafe extern "C" fn(Object, c_int, f64, *mut Status) = b"helicsFederateInfoSetTimeProperty\0",
    set_integer: unsafe extern "C" fn(Object, c_int, c_int, *mut Status) = b"helicsFederateInfoSetIntegerProperty\0",
    set_flag: unsafe extern "C" fn(Object, c_int, c_int, *mut Status) = b"helicsFederateInfoSetFlagOption\0",
    create_combination: Constructor = b"helicsCreateCombinationFederate\0",
    create_plain: Constructor = b"helicsCreateValueFederate\0",
    register_publication: unsafe extern "C" fn(Object, Name, c_int, Name, *mut Status) -> Object = b"helicsFederateRegisterGlobalPublication\0",
    register_input: unsafe extern "C" fn(Object, Name, c_int, Name, *mut Status) -> Object = b"helicsFederateRegisterInput\0",
    add_target: Set<Name> = b"helicsInputAddTarget\0",
    set_input: unsafe extern "C" fn(Object, c_int, c_int, *mut Status) = b"helicsInputSetOption\0",
    register_endpoint: unsafe extern "C" fn(Object, Name, Name, *mut Status) -> Object = b"helicsFederateRegisterGlobalEndpoint\0",
    enter_initializing: Do = b"helicsFederateEnterInitializingMode\0",
    enter_executing: Do = b"helicsFederateEnterExecutingMode\0",
    request_time: unsafe extern "C" fn(Object, f64, *mut Status) -> f64 = b"helicsFederateRequestTime\0",
    publish_integer: Set<i64> = b"helicsPublicationPublishInteger\0",
    publish_double: Set<f64> = b"helicsPublicationPublishDouble\0",
    publish_boolean: Set<c_int> = b"helicsPublicationPublishBoolean\0",
    type_of: unsafe extern "C" fn(Object) -> Name = b"helicsInputGetPublicationType\0",
    is_updated: unsafe extern "C" fn(Object) -> c_int = b"helicsInputIsUpdated\0",
    get_double: unsafe extern "C" fn(Object, *mut Status) -> f64 = b"helicsInputGetDouble\0",
    send: unsafe extern "C" fn(Object, *const c_void, c_int, Name, *mut Status) = b"helicsEndpointSendBytesTo\0",
    has_message: unsafe extern "C" fn(Object) -> c_int = b"helicsEndpointHasMessage\0",
    get_message: unsafe extern "C" fn(Object) -> Object = b"helicsEndpointGetMessage\0",
    bytes_of: unsafe extern "C" fn(Object) -> *const c_void = b"helicsMessageGetBytesPointer\0",
    count_of: unsafe extern "C" fn(Object) -> c_int = b"helicsMessageGetByteCount\0",
    free_message: unsafe extern "C" fn(Object) = b"helicsMessageFree\0",
    create_query: unsafe extern "C" fn(Name, Name) -> Object = b"helicsCreateQuery\0",
    execute_query: unsafe extern "C" fn(Object, Object, *mut Status) -> Name = b"helicsQueryExecute\0",
    free_query: unsafe extern "C" fn(Object) = b"helicsQueryFree\0",
    send_command: unsafe extern "C" fn(Object, Name, Name, *mut Status) = b"helicsFederateSendCommand\0",
    wait_command: unsafe extern "C" fn(Object, *mut Status) -> Name = b"helicsFederateWaitCommand\0",
    command_source: unsafe extern "C" fn(Object, *mut Status) -> Name = b"helicsFederateGetCommandSource\0",
    disconnect: Do = b"helicsFederateDisconnect\0",
}

/// Loads the library.
///
/// # Errors
/// The library or one of the functions is missing.
pub(super) fn load() -> Result<Functions, HelicsError> {
    let given = std::env::var_os(VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from);
    let candidates: Vec<PathBuf> = match &given {
        Some(path) if path.is_dir() => NAMES.map(|name| path.join(name)).into(),
        Some(path) => vec![path.clone()],
        None => NAMES.map(PathBuf::from).into(),
    };
    let mut reason = String::new();
    for path in candidates {
        match functions(&path) {
            Ok(functions) => {
                IS_LOADED.store(true, Ordering::Release);
                return Ok(functions);
            }
            // The first path is the preferred one, so the message has the error of this path only.
            Err(error) if reason.is_empty() => reason = error.to_string(),
            Err(_) => {}
        }
    }
    Err(HelicsError::NoLibrary { given, reason })
}

/// Ends this process with an exit code if the library was loaded. A thread may still be in a call of the library, for
/// example while the federate joins. The exit handlers of the library would wait for this call, or free its objects, so
/// they do not run.
pub fn end_process_if_loaded(code: u8) {
    if IS_LOADED.load(Ordering::Acquire) {
        // An error was reported by the write before, or there is no reader.
        let _ = std::io::stdout().flush();
        // SAFETY: the call ends the process; the output is written.
        unsafe { libc::_exit(code.into()) }
    }
}

/// Converts a text for C; it ends at the first NUL.
pub(super) fn text(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

impl Functions {
    /// Calls a function that reports errors in its last argument.
    pub(super) fn checked<T>(&self, call: impl FnOnce(&Self, *mut Status) -> T) -> Result<T, String> {
        // SAFETY: the function only fills in a structure.
        let mut status = unsafe { (self.initialize_error)() };
        let value = call(self, &mut status);
        status.outcome(value)
    }

    /// Creates a federate called `name` with `constructor`, on a core started with `init`; `set_up` configures the
    /// federate info.
    ///
    /// # Errors
    /// There is no broker, or the name is in use.
    pub(super) fn create(
        &self,
        constructor: Constructor,
        (name, init): (&str, &str),
        set_up: impl FnOnce(Object) -> Result<(), String>,
    ) -> Result<Object, String> {
        let (name, core, init) = (text(name), text(CORE), text(init));
        // SAFETY: here and below: the objects are the library's own; texts live through the calls.
        let info = unsafe { (self.create_info)() };
        let made = (|| {
            // SAFETY: as above.
            self.checked(|it, status| unsafe { (it.set_core_type)(info, core.as_ptr(), status) })?;
            // SAFETY: as above.
            self.checked(|it, status| unsafe { (it.set_core_init)(info, init.as_ptr(), status) })?;
            set_up(info)?;
            // SAFETY: as above.
            self.checked(|_, status| unsafe { constructor(name.as_ptr(), info, status) })
        })();
        // SAFETY: as above; the federate has taken over what it needs.
        unsafe { (self.free_info)(info) };
        made
    }
}
