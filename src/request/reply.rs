//! The replies, as the table in `replies.rs` declares them.

use super::replies::replies;
use super::{JournalPart, Refused};
use crate::can::ErrorState;
use crate::devices::{DriveDetails, DriveState, Interval};
use crate::door::{DoorSpec, DoorState};
use crate::fault::FaultStatus;
use crate::journal::{Change, Entry, HistoryId, Names, Record};
use crate::memory::header::BoardState;
use crate::plant::Forced;
use serde::{Deserialize, Serialize};

/// Declares [`Reply`].
macro_rules! declare {
    ($(
        $(#[$doc:meta])*
        $reply:ident = $number:literal, $name:ident
        $(($one:ident: $type:ty))?
        $({$(
            $(#[$field_doc:meta])*
            $field:ident: $field_type:ty
        ),+ $(,)?})?
    ),+ $(,)?) => {
        /// The answer to an operation.
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub enum Reply {
            $(
                $(#[$doc])*
                $reply $(($type))? $({ $($(#[$field_doc])* $field: $field_type,)+ })?,
            )+
            /// An earlier operation of the request was refused.
            NotExecuted,
        }
    };
}

replies!(declare);

/// A drive of the plant.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DriveEntry {
    /// Name of the drive: `winder`; or `line:drive` for the drive that contains PLC `line`.
    pub name: String,
    /// Bus of the drive, if it is on a bus.
    pub bus: Option<String>,
    /// State of the drive.
    pub state: DriveState,
}

/// Present activity of a bus.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BusScene {
    /// Name of the bus.
    pub name: String,
    /// Kind of the bus, as in the plant file.
    pub kind: String,
    /// Present bit rate of the bus, in bit/s.
    pub bit_s: u32,
    /// The interval that repeats on the bus; `None` while no interval repeats.
    pub interval: Option<Interval>,
    /// The ports of PLCs that are connected to the bus: `line:node2`.
    pub ports: Vec<String>,
}

/// Description of a bus.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BusState {
    /// Name of the bus.
    pub name: String,
    /// Kind of the bus, as in the plant file.
    pub kind: String,
    /// Present bit rate of the bus, in bit/s.
    pub bit_s: u32,
    /// Load of the bus in the last 100 ms of emulated time, in thousandths, according to the records of the journal.
    /// `None` while the frames of this time are unknown: in the first 100 ms after a start from a snapshot.
    pub load_permille: Option<u16>,
    /// The ports that are connected to the bus: `line:node2`.
    pub ports: Vec<String>,
    /// The doors to the bus, in the order in which they were opened.
    pub doors: Vec<DoorState>,
    /// Stations of the bus that have power; only for CAN and PROFIBUS.
    pub stations: Vec<Station>,
    /// Stations that are set to another rate and therefore do not take part.
    pub strangers: Vec<RateMismatch>,
}

/// A station with a rate that differs from the rate of the bus.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RateMismatch {
    /// Device and port, or the drive: `line:node1`, `winder`.
    pub name: String,
    /// Rate of the station, in bit/s.
    pub bit_s: u32,
}

/// A station of a bus.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Station {
    /// Device and port, or the guest: `panel:can`, `guest1`.
    pub name: String,
    /// Address of the station on a PROFIBUS. For a guest, the sender address of its last telegram.
    pub address: Option<u8>,
    /// On a CAN bus, the state of the station's controller: `error_active`, `error_warning`, `error_passive` or
    /// `bus_off`. On a PROFIBUS, the activity of the station: `baud_search`, `baud_control`, `wait_prm`, `wait_cfg`,
    /// `data_exchange`, `master` or `guest`.
    pub state: String,
    /// Transmit error counter of the station; 0 on a PROFIBUS.
    pub transmit_errors: u16,
    /// Receive error counter of the station; 0 on a PROFIBUS.
    pub receive_errors: u16,
}

impl Station {
    /// True on a CAN bus, where the state follows from the error counters.
    #[must_use]
    pub fn counts_errors(&self) -> bool {
        ErrorState::ALL.iter().any(|state| state.name() == self.state)
    }
}

/// Description of an emulator.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InstanceInfo {
    /// Name of the instance.
    pub name: String,
    /// True if the emulated time advances only on request.
    pub is_stepped: bool,
    /// Emulated time per real time x 1000 (1000 is real time); 0 in stepped mode.
    pub speed: u32,
    /// Emulated time since the start, in microseconds.
    pub time_us: u64,
    /// Number of emulators that have used the image, from 1.
    pub generation: u32,
    /// Process id of the emulator.
    pub pid: u32,
    /// Version of the attach contract.
    pub abi_version: u32,
    /// Version of the program, as in `commram --version`.
    pub version: String,
    /// The task in lockstep that has its turn, if the emulated time waits for such a task now.
    pub waits_for: Option<String>,
    /// Names of the PLCs and buses, in the order of their numbers, and the devices of the PLCs.
    #[serde(with = "super::naming")]
    pub names: Names,
}

/// Result of a wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Waited {
    /// Emulated time at the end of the wait, in microseconds.
    pub time_us: u64,
    /// Value of the whole register at that time.
    pub value: u32,
}

/// The reply belongs to another operation than the requested one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reply does not fit the operation; use the same version on both sides")]
pub struct WrongReply;

/// Declares functions that return the content of a reply, if the reply is of the expected kind.
macro_rules! contents {
    ($($(#[$doc:meta])* $name:ident: $pattern:pat => $content:expr, $type:ty;)*) => {
        impl Reply {
            $(
                $(#[$doc])*
                ///
                /// # Errors
                /// The reply is of another kind.
                pub fn $name(self) -> Result<$type, WrongReply> {
                    match self {
                        $pattern => Ok($content),
                        _ => Err(WrongReply),
                    }
                }
            )*
        }
    };
}

contents! {
    /// The value of a register.
    value: Reply::Value(value) => value, u32;
    /// Confirmation that a value was written or set.
    written: Reply::Written => (), ();
    /// Previous value of a register; `Ok` if it was expected and the new value was written.
    exchanged: Reply::Exchanged { ok, found } => if ok { Ok(found) } else { Err(found) }, Result<u32, u32>;
    /// The bytes of a range.
    bytes: Reply::Bytes(bytes) => bytes, Vec<u8>;
    /// Time at which a register had the awaited value, and its whole value.
    waited: Reply::Waited(waited) => waited, Waited;
    /// Emulated time, in microseconds.
    time: Reply::Time(time_us) => time_us, u64;
    /// Records of the journal, and the number of the next record.
    journal: Reply::Journal { records, end, .. } => (records, end), (Vec<Record>, u64);
    /// Changes of registers, and the number of the next change.
    changes: Reply::Changes { changes, end, .. } => (changes, end), (Vec<Change>, u64);
    /// A part of the journal, with the number at which the next part begins.
    journal_part: Reply::Journal { records, end, turn } => JournalPart::new(records, end, turn), JournalPart;
    /// Changes of registers, the number of the next change, and the number of their history.
    turned_changes: Reply::Changes { changes, end, turn } => (changes, end, turn), (Vec<Change>, u64, HistoryId);
    /// The forced registers.
    forces: Reply::Forces(forces) => forces, Vec<Forced>;
    /// The number of a fault that was added.
    fault_added: Reply::FaultAdded { id } => id, u16;
    /// The faults.
    faults: Reply::Faults(faults) => faults, Vec<FaultStatus>;
    /// The drives.
    drives: Reply::Drives(drives) => drives, Vec<DriveEntry>;
    /// All details of a drive.
    drive: Reply::Drive(drive) => *drive, DriveDetails;
    /// Number of cleared faults.
    faults_cleared: Reply::FaultsCleared { count } => count, u16;
    /// A board.
    board: Reply::Board(state) => state, BoardState;
    /// Findings of the checker.
    findings: Reply::Findings(entries) => entries, Vec<Entry>;
    /// Confirmation that the findings were cleared.
    cleared: Reply::Cleared => (), ();
    /// The buses.
    buses: Reply::Buses(buses) => buses, Vec<BusState>;
    /// Present activity of the buses.
    scene: Reply::Scene(buses) => buses, Vec<BusScene>;
    /// A door that was opened, with its real port or number.
    door_opened: Reply::DoorOpened(door) => door, DoorSpec;
    /// Number of closed doors.
    doors_closed: Reply::DoorsClosed { count } => count, u16;
    /// Description of the instance.
    info: Reply::Info(info) => *info, InstanceInfo;
    /// Confirmation that the emulator is going to end.
    stopping: Reply::Stopping => (), ();
}
