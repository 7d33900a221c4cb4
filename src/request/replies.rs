//! The table of replies.
//!
//! An entry has the reply's variant in `Reply`, its number, its name and its content: one value, or fields. The type of
//! a field defines its place in the wire format (`channel/wire/content.rs`); fields in the data of a reply follow each
//! other in the order of the table. A macro gets the table by `replies!(macro_name)`.

/// Passes the table of replies to the macro `$then`.
macro_rules! replies {
    ($then:ident) => {
        $then! {
            /// Value of a register.
            Value = 1, value (value: u32),
            /// The register was written.
            Written = 2, written,
            /// The comparison was made.
            Exchanged = 3, exchanged {
                /// True if the register held the expected value and was written.
                ok: bool,
                /// Value of the register before the operation.
                found: u32,
            },
            /// The bytes of a range.
            Bytes = 4, bytes (bytes: Vec<u8>),
            /// The register got the awaited value.
            Waited = 5, waited (waited: Waited),
            /// Emulated time now, in microseconds.
            Time = 6, time (time_us: u64),
            /// A part of the journal.
            Journal = 10, journal {
                /// History of the records.
                turn: HistoryId,
                /// The number that the next record will have.
                end: u64,
                /// Records in the order of their numbers. If they reach the end, the records that are still being
                /// counted follow ([`Record::is_pending`]).
                records: Vec<Record>,
            },
            /// Changes of registers that are followed.
            Changes = 71, changes {
                /// History of the changes.
                turn: HistoryId,
                /// The number that the next change will have.
                end: u64,
                /// Changes in the order of their numbers.
                changes: Vec<Change>,
            },
            /// The forced registers, in the order of PLCs and addresses.
            Forces = 30, forces (forces: Vec<Forced>),
            /// The fault was added.
            FaultAdded = 20, fault_added {
                /// Number of the fault in the instance.
                id: u16,
            },
            /// The pending and active faults, in the order in which they were added.
            Faults = 21, faults (faults: Vec<FaultStatus>),
            /// Faults were cleared.
            FaultsCleared = 22, faults_cleared {
                /// Number of faults.
                count: u16,
            },
            /// A PLC's board.
            Board = 40, board (board: BoardState),
            /// Findings of the access checker, in the order of the first findings.
            Findings = 50, findings (entries: Vec<Entry>),
            /// The findings were cleared.
            Cleared = 51, cleared,
            /// The buses, in the order of their numbers.
            Buses = 60, buses (buses: Vec<BusState>),
            /// The drives: first the drives on buses, in the order of the plant file, then the drives that are built
            /// into devices.
            Drives = 80, drives (drives: Vec<DriveEntry>),
            /// All details of a drive.
            Drive = 81, drive (drive: Box<DriveDetails>),
            /// Present activity of the buses, in the order of their numbers.
            Scene = 85, scene (buses: Vec<BusScene>),
            /// A door is open.
            DoorOpened = 61, door_opened (door: DoorSpec),
            /// Doors were closed.
            DoorsClosed = 62, doors_closed {
                /// Number of doors.
                count: u16,
            },
            /// Description of the instance.
            Info = 7, info (info: Box<InstanceInfo>),
            /// The emulator is going to end.
            Stopping = 8, stopping,
            /// The operation was refused; the following operations were not executed.
            Error = 9, error (refused: Refused),
        }
    };
}

pub(crate) use replies;
