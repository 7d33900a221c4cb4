//! The table of operations.
//!
//! An entry has the operation's variant in `Op`, its number, its name, its class, its reply and its fields. A field has
//! a type and the columns of the wire format that contain it. If the type allows larger values than the operation, the
//! field also has the largest value and the code of the refusal. A macro gets the table by `ops!(macro_name)`:
//!
//! - `op.rs` declares `Op` with it, its JSON form (`{"advance":{"us":1000}}`, `"forces"`), and the check of the ranges,
//! - `exec.rs` calls the function of the same name for each operation,
//! - `channel/wire.rs` converts operations to the wire format and back,
//! - a test beside it writes the table of `docs/reference/channel.md`.
//!
//! A number is never used again for another operation.

/// Passes the table of operations to the macro `$then`.
macro_rules! ops {
    ($then:ident) => {
        $then! {
            /// Reads a register.
            Peek = 1, peek, Looks -> Value {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Byte offset of the register.
                offset: u32 => offset,
                /// Width of the register.
                width: Width => width,
            },
            /// Writes a register. A forced register keeps its value.
            Poke = 2, poke, Stores -> Written {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Byte offset of the register.
                offset: u32 => offset,
                /// Width of the register.
                width: Width => width,
                /// The value; must fit the width.
                value: u32 => value,
            },
            /// Writes `new` if the register holds `current`, and if it is not forced to another value.
            CompareExchange = 3, compare_exchange, Stores -> Exchanged {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Byte offset of the register.
                offset: u32 => offset,
                /// Width of the register.
                width: Width => width,
                /// The value expected in the register; must fit the width.
                current: u32 => second,
                /// The value to write; must fit the width.
                new: u32 => value,
            },
            /// Copies bytes. Each register is from one moment; different registers may be from different moments.
            ReadRange = 4, read_range, Looks -> Bytes {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Byte offset of the first byte.
                offset: u32 => offset,
                /// Number of bytes.
                len: u32 [..=MAX_RANGE, RANGE_TOO_LONG] => value,
            },
            /// Waits until `register AND mask = value`. In stepped mode it advances the clock, event by event. If this
            /// does not happen in time, the wait is refused with code 10 and the last value.
            Wait = 5, wait, Advances -> Waited {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Byte offset of the register.
                offset: u32 => offset,
                /// Width of the register.
                width: Width => width,
                /// The bits that count; must fit the width.
                mask: u32 => second,
                /// Awaited value of the bits in the mask; bits outside the mask must be 0.
                value: u32 => value,
                /// Longest wait in emulated microseconds.
                within_us: u64 [..=MAX_ADVANCE_US, ADVANCE_TOO_LONG] => time_us,
            },
            /// Adds a condition for the next `wait_for` or `back_until` of the request, at most 32.
            Condition = 13, condition, Advances -> Written {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Byte offset of the register.
                offset: u32 => offset,
                /// Width of the register.
                width: Width => width,
                /// Condition for the register; mask and value must fit the width.
                #[serde(with = "TestForm")]
                test: Test => node second value,
            },
            /// Waits until all preceding conditions of the request hold at the same moment, or any of them. In stepped
            /// mode it advances the clock, event by event. Bit n of the replied value is set if condition n (from 0)
            /// holds. If this does not happen in time, the wait is refused with code 10 and the same value.
            WaitFor = 14, wait_for, Advances -> Waited {
                /// True if a single condition is sufficient.
                any: bool => value,
                /// Longest wait in emulated microseconds.
                within_us: u64 [..=MAX_ADVANCE_US, ADVANCE_TOO_LONG] => time_us,
            },
            /// Advances the clock; stepped mode only.
            Advance = 6, advance, Advances -> Time {
                /// Duration in microseconds.
                us: u64 [..=MAX_ADVANCE_US, ADVANCE_TOO_LONG] => time_us,
            },
            /// Advances the clock to the next SYNC of the bus at a port; stepped mode only.
            AdvanceToSync = 7, advance_to_sync, Advances -> Time {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Number of the port of that PLC.
                node: PortNumber => node,
            },
            /// Advances the clock to the next moment at which the emulator has something to do; stepped mode only.
            /// Events of the present time are handled now, and no time passes.
            AdvanceToEvent = 11, advance_to_event, Advances -> Time {
                /// Maximum advance, in microseconds.
                within_us: u64 [..=MAX_ADVANCE_US, ADVANCE_TOO_LONG] => time_us,
            },
            /// Changes the speed of a real-time clock, at the present emulated time, or pauses it. Does not influence
            /// the plant. The reply is the time from which the speed applies.
            SetSpeed = 15, set_speed, Manages -> Time {
                /// Emulated time per real time x 1000: 1000 is real time, 0 a pause.
                permille: u32 [..=MAX_SPEED, SPEED_TOO_HIGH] => value,
            },
            /// Reads the journal from record number `from` on.
            Journal = 10, journal, Looks -> Journal {
                /// Number of the first wanted record. Records that are no longer kept are omitted.
                from: u64 => time_us,
                /// Maximum number of records; a reply never has more than 1024.
                max: u32 => value,
            },
            /// Records all changes from now on of the registers in a range. Does not influence the plant.
            Follow = 70, follow, Acts -> Written {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Byte offset of the first byte.
                offset: u32 => offset,
                /// Number of bytes.
                len: u32 [..=MAX_RANGE, RANGE_TOO_LONG] => value,
                /// Destination of the changes.
                #[serde(with = "KeepForm")]
                keep: Keep => node,
            },
            /// Returns 1 if all changes of a register are recorded in the journal, else 0.
            IsRecorded = 86, is_recorded, Looks -> Value {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Byte offset of the register.
                offset: u32 => offset,
            },
            /// Reads the changes of registers followed with `for_onlookers`, from number `from` on. The emulator stops
            /// collecting these changes if it gets no such request for ten seconds of real time.
            Changes = 71, changes, Looks -> Changes {
                /// Number of the first wanted change. Changes that are no longer kept are omitted.
                from: u64 => time_us,
                /// Maximum number of changes; a reply never has more than 1024.
                max: u32 => value,
            },
            /// Forces a register: it keeps the value, even if firmware or PLC write another value.
            Force = 30, force, Acts -> Written {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Byte offset of the register.
                offset: u32 => offset,
                /// Width of the register.
                width: Width => width,
                /// The forced value; must fit the width.
                value: u32 => value,
            },
            /// Releases a forced register.
            Unforce = 31, unforce, Acts -> Written {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// Byte offset of the register.
                offset: u32 => offset,
                /// Width of the register.
                width: Width => width,
            },
            /// Returns the forced registers.
            Forces = 32, forces, Looks -> Forces,
            /// Adds a fault.
            FaultAdd = 20, fault_add, Acts -> FaultAdded {
                /// The fault.
                #[serde(with = "forms::fault")]
                fault: Fault => plc width node offset value second reserved time_us,
            },
            /// Lists the faults that wait or act.
            FaultList = 21, fault_list, Looks -> Faults,
            /// Clears a fault, or all of them.
            FaultClear = 22, fault_clear, Acts -> FaultsCleared {
                /// Number of the fault, from 1 on. Without a number all faults are cleared; the wire format has 0 then.
                id: Option<NonZeroU16> => value,
            },
            /// Returns 1 if the fault with this number has taken effect, even if it has ended, else 0.
            FaultHasActed = 23, fault_has_acted, Looks -> Value {
                /// Number of the fault.
                id: u16 => plc,
            },
            /// Reads a PLC's board.
            Board = 40, board, Looks -> Board {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
            },
            /// Changes a setting of a PLC's board, at the present emulated time. A start that is not possible is
            /// refused.
            SetBoard = 41, set_board, Acts -> Written {
                /// Number of the PLC.
                plc: DeviceIndex => plc,
                /// The setting.
                #[serde(with = "forms::setting")]
                setting: BoardSetting => offset value,
            },
            /// Returns the findings of the access checker.
            Findings = 50, findings, Looks -> Findings,
            /// Clears the findings of the access checker.
            ClearFindings = 51, clear_findings, Acts -> Cleared,
            /// Returns the buses with their doors, guests and stations.
            Buses = 60, buses, Looks -> Buses,
            /// Returns the drives and their states.
            Drives = 80, drives, Looks -> Drives,
            /// Returns all details of a drive.
            Drive = 81, drive, Looks -> Drive {
                /// Position in the answer to `drives`, from 0.
                drive: u16 => plc,
            },
            /// Sets a parameter of a drive, as an operator does at the drive itself.
            SetParameter = 82, set_parameter, Acts -> Written {
                /// Position in the answer to `drives`, from 0.
                drive: u16 => plc,
                /// Number of the parameter.
                number: u16 => node,
                /// New value of the parameter.
                value: i64 => time_us,
            },
            /// Returns the present activity of the buses: their intervals and ports.
            Scene = 85, scene, Looks -> Scene,
            /// Opens a door to a bus.
            DoorOpen = 61, door_open, Manages -> DoorOpened {
                /// Number of the bus.
                bus: BusIndex => plc,
                /// The door.
                door: DoorSpec => width node value,
            },
            /// Closes doors to a bus; their guests leave.
            DoorClose = 62, door_close, Manages -> DoorsClosed {
                /// Number of the bus.
                bus: BusIndex => plc,
                /// The door, with its real port or number; `None` closes all doors of the bus.
                door: Option<DoorSpec> => width node value,
            },
            /// Takes part in a bus from now on, and sends a frame if one is given.
            BusSend = 63, bus_send, Acts -> Written {
                /// Number of the bus.
                bus: BusIndex => plc,
                /// The frame.
                #[serde(with = "forms::frame")]
                frame: Option<Frame> => width node offset time_us,
            },
            /// Takes part in a PROFIBUS from now on, and sends a telegram. A telegram of more than 16 octets is sent by
            /// several operations of one request, in the order of its octets.
            TelegramSend = 64, telegram_send, Acts -> Written {
                /// Number of the bus.
                bus: BusIndex => plc,
                /// True if these are the last octets: the telegram is then sent.
                is_last: bool => width,
                /// The octets.
                part: FilePart => node value second time_us,
            },
            /// Keeps a snapshot of the plant, and returns its number; stepped mode only, like all operations on
            /// snapshots.
            Save = 72, save, Manages -> Value,
            /// Forgets a snapshot.
            Forget = 73, forget, Manages -> Written {
                /// Number of the snapshot.
                number: u32 => value,
            },
            /// Reads a part of a snapshot as a file, at most 65536 bytes; fewer at the end.
            ReadSaved = 74, read_saved, Manages -> Bytes {
                /// Number of the snapshot.
                number: u32 => value,
                /// The first byte of the part.
                from: u32 => offset,
            },
            /// Sends a part of a snapshot file of the client to the emulator. Parts follow in the order of the bytes;
            /// byte 0 begins a new file.
            BringSaved = 75, bring_saved, Manages -> Written {
                /// The first byte of the part.
                at: u32 => offset,
                /// The bytes.
                part: FilePart => node value second time_us,
            },
            /// Restores the snapshot in the file that the client has sent.
            Restore = 76, restore, Travels -> Time {
                /// True: go back even if an outside participant cannot go back with the plant.
                detached: bool => node,
            },
            /// Restores a kept snapshot.
            BackTo = 77, back_to, Travels -> Time {
                /// Number of the snapshot.
                number: u32 => value,
                /// True: go back even if an outside participant cannot go back with the plant.
                detached: bool => node,
            },
            /// Goes back in time.
            Back = 78, back, Travels -> Time {
                /// Duration in microseconds.
                us: u64 => time_us,
                /// True: go back even if an outside participant cannot go back with the plant.
                detached: bool => node,
            },
            /// Goes back to the last moment before now at which the preceding conditions became true. The reply is the
            /// same as for `wait_for`.
            BackUntil = 79, back_until, Travels -> Waited {
                /// A single condition is sufficient.
                any: bool => value,
                /// True: go back even if an outside participant cannot go back with the plant.
                detached: bool => node,
            },
            /// Goes back to the start of the plant, or to the snapshot with which it has begun, before the first action
            /// of a client. (`back` to the same time keeps the actions that clients made at that time.)
            BackToStart = 87, back_to_start, Travels -> Time {
                /// True: go back even if an outside participant cannot go back with the plant.
                detached: bool => node,
            },
            /// Returns the emulated time.
            Time = 12, time, Looks -> Time,
            /// Returns the description of the instance.
            Info = 8, info, Looks -> Info,
            /// Asks the emulator to end.
            Stop = 9, stop, Ends -> Stopping,
        }
    };
}

pub(crate) use ops;
