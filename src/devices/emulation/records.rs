//! Journal records about the board of a device: its front panel, its supply, its program and its events.

use crate::event_kinds;
use crate::identity::PortNumber;
use crate::journal::{EventCodec, EventKind, EventText, Fields, Origin, Packer, Part, Reader, Unpacker};
use crate::memory::header::{InterruptResult, OptInitResult, Project, RunSwitch, SeatState, Start};
use std::borrow::Cow;
use std::net::Ipv4Addr;

/// All kinds of records that every device can have.
pub static KINDS: &[&EventKind] = &[OnBoard::KIND];

event_kinds! {
    /// Something happened on the board of a PLC.
    OnBoard = 20, "board", Rare, at plc {
        /// The event at the board.
        what: BoardEvent,
    }
}

impl EventText for OnBoard {
    fn text(&self, reader: &mut Reader) -> String {
        let port = |node| reader.names.port(Origin { plc: self.plc, node });
        self.what.text(port)
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        Fields::new().with("what", self.what.name()).with("text", self.text(reader))
    }
}

impl Part for BoardEvent {
    fn put(self, packer: &mut Packer) {
        let (what, numbers) = self.words();
        what.put(packer);
        numbers.put(packer);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        BoardEvent::from_words(u8::take(unpacker)?, u64::take(unpacker)?)
    }
}

/// An event on a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoardEvent {
    /// Power-on, or RESET was released. All registers have their start values.
    Up {
        /// Number at the DIP switches of the device itself. `None` if it has no such switches; its modules
        /// may still have some.
        dip: Option<u8>,
    },
    /// The supply was switched off, or RESET is held.
    Down,
    /// The RUN/STOP/RESET switch was turned.
    Switch {
        /// New position of the switch.
        to: RunSwitch,
    },
    /// The board requests a start or stop of the PLC program.
    Start {
        /// Kind of the start.
        kind: Start,
    },
    /// A project was loaded, or the loaded project was deleted.
    Project {
        /// Project that the board has loaded.
        project: Project,
    },
    /// A requested start is not possible: the switch is not at RUN, no program is loaded, or the kind of
    /// start does not exist.
    StartRefused {
        /// Number of the requested start.
        code: u8,
    },
    /// A program has called `INTR_SET`.
    Interrupt {
        /// Number of the event.
        event: u8,
        /// Value of the input `i_PAR1`.
        factor: i16,
        /// Value of the input `x_EN`.
        enable: bool,
        /// Result of the request.
        result: InterruptResult,
    },
    /// A program has called `OPT_INIT`.
    Triggers {
        /// Modes of trigger 1, trigger 2 and trigger controller.
        modes: [u8; 3],
        /// Result of the request.
        result: OptInitResult,
    },
    /// Another station on the bus of a port already has the number at the DIP switches, so no station can address the
    /// port.
    NumberTaken {
        /// Number of the port.
        port: PortNumber,
        /// The slave number that another station already has.
        number: u8,
    },
    /// A task has requested to take part in lockstep, or has stopped taking part.
    Lockstep {
        /// Event number of the task.
        event: u8,
        /// New state of the seat.
        state: SeatState,
    },
    /// An IP address was stored by writing `d_IP_CONFIG`.
    AddressStored {
        /// Value of the register `d_IP_CONFIG`.
        config: u32,
        /// Address in the register `a_IP_ADDRESS`.
        address: Ipv4Addr,
    },
    /// An IP address was refused because it would end in 0 or 255; the previous configuration was restored.
    AddressRefused {
        /// Value of the register `d_IP_CONFIG`.
        config: u32,
        /// Address in the register `a_IP_ADDRESS`.
        address: Ipv4Addr,
    },
    /// With the present DIP number, the stored address is not allowed. So the board has no address.
    NoAddress {
        /// Value of the register `d_IP_CONFIG`.
        config: u32,
        /// Address in the register `a_IP_ADDRESS`.
        address: Ipv4Addr,
    },
}

/// Number that the journal stores in [`BoardEvent::Up`] if a device has no DIP switches.
const NO_DIP: u64 = 1 << 8;

impl BoardEvent {
    /// Returns the number of the event's kind, and the values of the event as one number.
    fn words(&self) -> (u8, u64) {
        let address_words =
            |config: u32, address: Ipv4Addr| u64::from(config) << 32 | u64::from(address.to_bits());
        let byte = |value: u8, place: u32| u64::from(value) << (8 * place);
        match *self {
            BoardEvent::Up { dip } => (1, dip.map_or(NO_DIP, u64::from)),
            BoardEvent::Down => (2, 0),
            BoardEvent::Switch { to } => (3, to.code().into()),
            BoardEvent::Start { kind } => (4, kind.code().into()),
            BoardEvent::StartRefused { code } => (5, code.into()),
            BoardEvent::Interrupt { event, factor, enable, result } => {
                let flags = byte(event, 0) | byte(enable.into(), 1) | byte(result.code() as u8, 2);
                (6, flags | u64::from(factor as u16) << 32)
            }
            BoardEvent::Triggers { modes: [one, two, controller], result } => {
                (7, byte(one, 0) | byte(two, 1) | byte(controller, 2) | byte(result.code() as u8, 3))
            }
            BoardEvent::NumberTaken { port, number } => (8, byte(number, 0) | byte(port.0, 1)),
            BoardEvent::Lockstep { event, state } => (9, byte(event, 0) | byte(state.code() as u8, 1)),
            BoardEvent::AddressStored { config, address } => (10, address_words(config, address)),
            BoardEvent::AddressRefused { config, address } => (11, address_words(config, address)),
            BoardEvent::NoAddress { config, address } => (12, address_words(config, address)),
            BoardEvent::Project { project } => (13, project.code().into()),
        }
    }

    /// Converts the numbers back to an event; `None` if no event has these numbers. The check is not
    /// complete: some invalid numbers are accepted.
    fn from_words(what: u8, numbers: u64) -> Option<Self> {
        let [first, second, third, fourth, ..] = numbers.to_le_bytes();
        let code = u32::from(first);
        let (config, address) = ((numbers >> 32) as u32, Ipv4Addr::from_bits(numbers as u32));
        Some(match what {
            1 => BoardEvent::Up { dip: (numbers != NO_DIP).then_some(first) },
            2 => BoardEvent::Down,
            3 => BoardEvent::Switch { to: RunSwitch::from_code(code)? },
            4 => BoardEvent::Start { kind: Start::from_code(code)? },
            5 => BoardEvent::StartRefused { code: first },
            6 => BoardEvent::Interrupt {
                event: first,
                factor: (numbers >> 32) as u16 as i16,
                enable: second != 0,
                result: InterruptResult::from_code(third.into())?,
            },
            7 => BoardEvent::Triggers {
                modes: [first, second, third],
                result: OptInitResult::from_code(fourth.into())?,
            },
            8 => BoardEvent::NumberTaken { port: PortNumber(second), number: first },
            9 => BoardEvent::Lockstep { event: first, state: SeatState::from_code(second.into())? },
            10 => BoardEvent::AddressStored { config, address },
            11 => BoardEvent::AddressRefused { config, address },
            12 => BoardEvent::NoAddress { config, address },
            13 => BoardEvent::Project { project: Project::from_code(code)? },
            _ => return None,
        })
    }

    /// Returns the name of the record in JSON Lines.
    pub fn name(&self) -> &'static str {
        match self {
            BoardEvent::Up { .. } => "up",
            BoardEvent::Down => "down",
            BoardEvent::Switch { .. } => "switch",
            BoardEvent::Start { .. } => "start",
            BoardEvent::Project { .. } => "project",
            BoardEvent::StartRefused { .. } => "start_refused",
            BoardEvent::Interrupt { .. } => "intr_set",
            BoardEvent::Triggers { .. } => "opt_init",
            BoardEvent::NumberTaken { .. } => "number_taken",
            BoardEvent::Lockstep { .. } => "lockstep",
            BoardEvent::AddressStored { .. } => "address_stored",
            BoardEvent::AddressRefused { .. } => "address_refused",
            BoardEvent::NoAddress { .. } => "no_address",
        }
    }

    /// Describes the event in words; `port_name` returns the name of a port.
    fn text<'a>(&self, port_name: impl Fn(PortNumber) -> Cow<'a, str>) -> String {
        match *self {
            BoardEvent::Up { dip: Some(dip) } => format!("on, DIP number {dip}"),
            BoardEvent::Up { dip: None } => "on".to_owned(),
            BoardEvent::Down => "off, or held in RESET".to_owned(),
            BoardEvent::Switch { to } => format!("switch at {}", format!("{to:?}").to_uppercase()),
            BoardEvent::Start { kind: Start::Stop } => "program is to stop".to_owned(),
            BoardEvent::Start { kind } => format!("program is to start, {} start", lower(kind)),
            BoardEvent::Project { project: Project::None } => "project deleted".to_owned(),
            BoardEvent::Project { project: Project::Boot } => "boot project loaded".to_owned(),
            BoardEvent::Project { project: Project::Sent } => "project sent".to_owned(),
            BoardEvent::StartRefused { code } => {
                let kind = Start::from_code(code.into()).map_or_else(|| format!("number {code}"), lower);
                format!("start refused ({kind}): it needs a program and the switch at RUN")
            }
            BoardEvent::Interrupt { event, factor, enable, result } => {
                let what = if enable { "enabled" } else { "disabled" };
                let factor = match event {
                    0 | 2 if enable => format!(" every {} us", i32::from(factor) * 50),
                    _ => String::new(),
                };
                match why_not(result) {
                    None => format!("event {event} {what}{factor}"),
                    Some(why) => format!("event {event} not {what}: {why}"),
                }
            }
            BoardEvent::Triggers { modes: [one, two, controller], result } => {
                let modes =
                    format!("trigger 1 mode {one}, trigger 2 mode {two}, controller mode {controller}");
                let why = match result {
                    OptInitResult::Done => return format!("OPT_INIT: {modes}"),
                    OptInitResult::AlreadyRun => "it may be run once only",
                    OptInitResult::BadTrigger => "a mode is reserved",
                    OptInitResult::BadTimer => "a timer's inputs are out of range",
                    OptInitResult::NoTriggers => "the device has no triggers and no board timers",
                };
                format!("OPT_INIT refused ({modes}): {why}")
            }
            BoardEvent::NumberTaken { port, number } => {
                let port = port_name(port);
                format!(
                    "slave number {number} already belongs to another station, no station can address {port}"
                )
            }
            BoardEvent::Lockstep { event, state } => {
                let what = match state {
                    SeatState::Free => "has left",
                    SeatState::Asking | SeatState::Deciding => "wants to join",
                    SeatState::Seated => "has joined",
                    SeatState::Refused => "may not join",
                    SeatState::Lost => "was given up, its process died or took too long",
                };
                format!("lockstep: the task of event {event} {what}")
            }
            BoardEvent::AddressStored { config, address } => {
                format!("IP address {address} stored, d_IP_CONFIG 16#{config:08X}")
            }
            BoardEvent::AddressRefused { config, address } => format!(
                "IP address {address}, d_IP_CONFIG 16#{config:08X}, refused: a device's address must not end in \
                 0 or 255; the old configuration stays"
            ),
            BoardEvent::NoAddress { config, address } => format!(
                "no IP address: {address}, d_IP_CONFIG 16#{config:08X}, ends in 0 or 255 with this DIP number"
            ),
        }
    }
}

fn lower(kind: Start) -> String {
    format!("{kind:?}").to_lowercase()
}

fn why_not(result: InterruptResult) -> Option<&'static str> {
    match result {
        InterruptResult::Done => None,
        InterruptResult::NoSuchEvent => Some("there is no such event"),
        InterruptResult::Excluded => Some("the event that excludes it is enabled"),
        InterruptResult::BadFactor => Some("i_PAR1 must be 1 to 32767"),
    }
}
