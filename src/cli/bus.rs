//! `commram bus`: the buses of an instance, their doors (interfaces for other programs), and logs of their frames.

mod log;

use super::Instance;
use super::error::CliError;
use super::table::FormatArg;
use crate::door::DoorSpec;
use clap::{Args as ClapArgs, Subcommand};

/// List the buses, open doors (interfaces for other programs), play and compare logs.
///
/// A program that connects to a door is a station on the bus: it receives all frames and sends its own.
/// docs/reference/can.md describes each kind of door and how python-can connects; docs/devices/can-dp2/overview.md
/// does the same for PROFIBUS.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram bus list
  commram bus open open slcan-tcp:127.0.0.1:0
  commram bus close open
  commram bus play open.log
  commram bus compare open.log")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    List(List),
    Open(Open),
    Close(Close),
    Play(log::Play),
    Compare(log::Compare),
}

/// List the buses, their doors and the guests connected to them.
///
/// `seat`: the guest takes part in emulated time; a stepped clock waits for it. `dropped` counts the frames that a
/// guest did not read in time, `refused` the frames of the guest that the bus did not accept. `sent_away` counts the
/// guests that were rejected because the list of guests was full or no file descriptor was free. `stations` are the
/// stations on a PROFIBUS with their addresses and states, and the stations on CAN that have counted errors, with
/// transmit and receive errors. `other_rates` are the stations that are set to another rate, in kbit/s, and receive
/// nothing; while a bus waits for its master, its rate is the one in the plant file.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram bus list
  commram bus list --format json")]
struct List {
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

/// Open a door to a bus and print its name.
///
/// Doors are `slcan-tcp:127.0.0.1:0` (SLCAN over TCP; port 0 selects any free port) and `slcan-pty` (SLCAN over a
/// pseudo-terminal), on a PROFIBUS `profibus-tcp:127.0.0.1:0` (telegrams over TCP) and `profibus-pty` (octets over a
/// pseudo-terminal, as a serial adapter has them). Any user of this machine can connect to a TCP port; other machines
/// can connect only to a door named `slcan-tcp-anybody:ADDRESS:PORT` or `profibus-tcp-anybody:ADDRESS:PORT`.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram bus open open slcan-tcp:127.0.0.1:0
  commram bus open open slcan-pty
  commram bus open dp profibus-tcp:127.0.0.1:0
  commram bus open dp profibus-pty")]
struct Open {
    /// Name of the bus
    #[arg(add = super::complete::buses())]
    bus: String,
    /// The door
    door: DoorSpec,
    #[command(flatten)]
    instance: Instance,
}

/// Close doors to a bus and disconnect their guests.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram bus close open slcan-tcp:127.0.0.1:40001
  commram bus close open                              all doors of the bus")]
struct Close {
    /// Name of the bus
    #[arg(add = super::complete::buses())]
    bus: String,
    /// Door to close, as `list` prints it; if omitted, all doors of the bus
    door: Option<DoorSpec>,
    #[command(flatten)]
    instance: Instance,
}

/// Lists buses, opens or closes doors, plays or compares logs.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::List(args) => by_channel::list(args.format.format, &args.instance),
        Command::Open(args) => by_channel::open(&args.bus, args.door, &args.instance),
        Command::Close(args) => by_channel::close(&args.bus, args.door, &args.instance),
        Command::Play(args) => log::play(args),
        Command::Compare(args) => log::compare(args),
    }
}

mod by_channel {
    use super::super::session::{Session, number_of_bus};
    use super::super::table::{self, Format, Row};
    use super::super::{Instance, error::CliError, output};
    use crate::door::DoorSpec;
    use crate::identity::BusIndex;
    use crate::request::json::buses::{BusEntry, GuestEntry, Rate, StrangerEntry};
    use crate::request::{Op, Station};

    impl StrangerEntry {
        fn text(&self) -> String {
            format!("{} ({})", self.name, self.kbit_s.text())
        }
    }

    impl Rate {
        pub(crate) fn text(self) -> String {
            match self {
                Rate::Whole(kbit_s) => kbit_s.to_string(),
                Rate::Broken(kbit_s) => kbit_s.to_string(),
            }
        }
    }

    impl GuestEntry {
        fn text(&self) -> String {
            let mut text = format!("guest{}", self.guest);
            if self.seat {
                text += " (seat)";
            }
            for (count, what) in [(self.dropped, "dropped"), (self.refused, "refused")] {
                if count > 0 {
                    text += &format!(" ({count} {what})");
                }
            }
            text
        }
    }

    /// Returns the text of a station that has an address, such as `gw:dp (5, data_exchange)`, or of a station with
    /// errors, such as `panel:can (bus_off, 256+0)`. `None` for all other stations.
    fn noteworthy(station: &Station) -> Option<String> {
        let Station { name, address, state, transmit_errors, receive_errors } = station;
        if let Some(address) = address {
            return Some(format!("{name} ({address}, {state})"));
        }
        let has_some = *transmit_errors > 0 || *receive_errors > 0;
        has_some.then(|| format!("{name} ({state}, {transmit_errors}+{receive_errors})"))
    }

    impl Row for BusEntry {
        const COLUMNS: &'static [&'static str] =
            &["bus", "kind", "kbit_s", "doors", "guests", "stations", "other_rates"];

        fn cells(&self) -> Vec<String> {
            let listed = |texts: Vec<String>| if texts.is_empty() { "-".to_owned() } else { texts.join(" ") };
            let sent_away = Some(self.sent_away).filter(|count| *count > 0);
            let guests = self.guests.iter().map(GuestEntry::text);
            let guests = guests.chain(sent_away.map(|count| format!("({count} sent away)")));
            vec![
                self.bus.clone(),
                self.kind.clone(),
                self.kbit_s.text(),
                listed(self.doors.clone()),
                listed(guests.collect()),
                listed(self.stations.iter().filter_map(noteworthy).collect()),
                listed(self.other_rates.iter().map(StrangerEntry::text).collect()),
            ]
        }
    }

    pub(super) fn list(format: Format, instance: &Instance) -> Result<(), CliError> {
        let session = Session::open(instance, 0)?;
        let entries: Vec<_> = session.ask(Op::Buses)?.buses()?.iter().map(BusEntry::from).collect();
        table::print(format, &entries, |entries| match entries {
            [] => "the plant has no bus\n".to_owned(),
            entries => table::aligned(entries),
        })
    }

    /// Returns the number of the bus with this name.
    fn number(session: &Session, bus: &str, instance: &Instance) -> Result<BusIndex, CliError> {
        let buses = session.ask(Op::Info)?.info()?.names.buses;
        number_of_bus(instance.name(), &buses, bus)
    }

    pub(super) fn open(bus: &str, door: DoorSpec, instance: &Instance) -> Result<(), CliError> {
        let session = Session::open(instance, 0)?;
        let bus = number(&session, bus, instance)?;
        let door = session.ask(Op::DoorOpen { bus, door })?.door_opened()?;
        output::print(&format!("{door}\n"))
    }

    pub(super) fn close(bus: &str, door: Option<DoorSpec>, instance: &Instance) -> Result<(), CliError> {
        let session = Session::open(instance, 0)?;
        let bus = number(&session, bus, instance)?;
        session.ask(Op::DoorClose { bus, door })?.doors_closed().map(drop).map_err(CliError::from)
    }
}
