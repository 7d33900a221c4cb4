//! `commram status`: the current state of the plant.

use super::Instance;
use super::error::CliError;
use super::table::FormatArg;

/// Show the current state of the plant: clock, PLCs, nodes, buses, drives.
///
/// `state` of a node is the state that its firmware reports. `load` is the utilization of the bus in the last 100
/// ms of emulated time, in percent. The findings are listed by `commram check`, the faults by `commram fault list`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram status
  commram status -i test-3 --format json")]
pub(crate) struct Args {
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

pub(crate) use by_channel::{ClockJson, Status};

pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    by_channel::show(args.format.format, &args.instance)
}

mod by_channel {
    use super::super::place::status_of;
    use super::super::session::Session;
    use super::super::table::{self, Format, Row};
    use super::super::{Instance, error::CliError, run, time};
    use crate::devices;
    use crate::identity::DeviceIndex;
    use crate::journal::Severity;
    use crate::layout::{RegisterRef, Width, format_value};
    use crate::plural::plural;
    use crate::request::json::buses::Rate;
    use crate::request::json::drives::DriveLine;
    use crate::request::{BusState, InstanceInfo, Op};
    use serde::Serialize;

    pub(super) fn show(format: Format, instance: &Instance) -> Result<(), CliError> {
        let status = Status::of(&Session::open(instance, 0)?)?;
        table::print(format, &[status], |status| status.iter().map(Status::text).collect())
    }

    /// An instance and its clock.
    #[derive(Serialize)]
    pub(crate) struct ClockJson {
        instance: String,
        clock: &'static str,
        /// Emulated time per real time; `None` with a stepped clock.
        speed: Option<f64>,
        time_us: u64,
        pid: u32,
        version: String,
        /// The task or guest for which the clock waits, if any.
        waits_for: Option<String>,
    }

    impl From<&InstanceInfo> for ClockJson {
        fn from(info: &InstanceInfo) -> Self {
            ClockJson {
                instance: info.name.clone(),
                clock: if info.is_stepped { "stepped" } else { "realtime" },
                speed: (!info.is_stepped).then(|| f64::from(info.speed) / 1000.0),
                time_us: info.time_us,
                pid: info.pid,
                version: info.version.clone(),
                waits_for: info.waits_for.clone(),
            }
        }
    }

    /// The current state of the plant.
    #[derive(Serialize)]
    pub(crate) struct Status {
        #[serde(flatten)]
        clock: ClockJson,
        plcs: Vec<Plc>,
        nodes: Vec<Node>,
        buses: Vec<Bus>,
        drives: Vec<DriveLine>,
        faults: usize,
        forced: usize,
        errors: u64,
        warnings: u64,
    }

    #[derive(Serialize)]
    struct Plc {
        plc: String,
        device: &'static str,
        power: String,
        switch: Option<String>,
        program: Option<String>,
        /// State of the script, if the PLC is a device in a folder with a script.
        #[serde(skip_serializing_if = "Option::is_none")]
        script: Option<String>,
    }

    impl Row for Plc {
        const COLUMNS: &'static [&'static str] = &["plc", "device", "power", "switch", "program"];

        fn cells(&self) -> Vec<String> {
            let or_dash = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".to_owned());
            let device = self.device.to_owned();
            vec![self.plc.clone(), device, self.power.clone(), or_dash(&self.switch), or_dash(&self.program)]
        }
    }

    #[derive(Serialize)]
    struct Node {
        node: String,
        bus: Option<String>,
        /// State that the firmware reports, if the firmware has a register for the state.
        state: Option<u32>,
        text: Option<String>,
        #[serde(skip)]
        shown: String,
    }

    impl Row for Node {
        const COLUMNS: &'static [&'static str] = &["node", "bus", "state"];

        fn cells(&self) -> Vec<String> {
            vec![self.node.clone(), self.bus.clone().unwrap_or_else(|| "-".to_owned()), self.shown.clone()]
        }
    }

    #[derive(Serialize)]
    struct Bus {
        bus: String,
        kind: String,
        kbit_s: Rate,
        load_percent: Option<f64>,
        other_rates: Vec<String>,
    }

    impl Bus {
        fn of(state: &BusState) -> Self {
            let stranger =
                |it: &crate::request::RateMismatch| format!("{} ({})", it.name, Rate::of(it.bit_s).text());
            Bus {
                bus: state.name.clone(),
                kind: state.kind.clone(),
                kbit_s: Rate::of(state.bit_s),
                load_percent: state.load_permille.map(|load| f64::from(load) / 10.0),
                other_rates: state.strangers.iter().map(stranger).collect(),
            }
        }
    }

    impl Row for Bus {
        const COLUMNS: &'static [&'static str] = &["bus", "kind", "kbit_s", "load_percent", "other_rates"];

        fn cells(&self) -> Vec<String> {
            let load = self.load_percent.map_or_else(|| "-".to_owned(), |load| format!("{load:.1}"));
            let others = self.other_rates.join(" ");
            let others = if others.is_empty() { "-".to_owned() } else { others };
            vec![self.bus.clone(), self.kind.clone(), self.kbit_s.text(), load, others]
        }
    }

    impl Status {
        /// Reads all data from the instance in one message, unless a message cannot contain all operations.
        ///
        /// # Errors
        /// The emulator has ended.
        pub(crate) fn of(session: &Session) -> Result<Self, CliError> {
            let ports = ports(session);
            let mut ops = vec![Op::Info, Op::Buses, Op::Drives, Op::FaultList, Op::Forces, Op::Findings];
            ops.extend(DeviceIndex::first(session.plcs().len()).map(|plc| Op::Board { plc }));
            ops.extend(ports.iter().filter_map(Port::peek));
            let mut replies = session.request_in_parts(&ops)?.into_iter();
            let mut next = || replies.next().ok_or(crate::request::WrongReply);
            let info = next()?.info()?;
            let buses = next()?.buses()?;
            let drives = next()?.drives()?;
            let (faults, forced) = (next()?.faults()?.len(), next()?.forces()?.len());
            let found = next()?.findings()?;
            let of_severity =
                |severity| found.iter().filter(|it| it.last.rule.severity() == severity).count() as u64;
            let boards = session.plcs().iter().map(|name| Ok((name, next()?.board()?)));
            let boards = boards.collect::<Result<Vec<_>, CliError>>()?;
            let node = |port: Port| {
                let state = port.status.map(|_| next()?.value()).transpose()?;
                Ok(port.node(state, &buses))
            };
            let nodes = ports.into_iter().map(node).collect::<Result<Vec<_>, CliError>>()?;
            let mut plcs = Vec::new();
            for (number, (name, state)) in DeviceIndex::enumerate(&boards) {
                let device = session.device(number);
                let words = state.words(devices::board_of(device));
                let (plc, device, power) = ((*name).clone(), device.name, words.power);
                let script = script_state(session, number)?;
                plcs.push(Plc { plc, device, power, switch: words.switch, program: words.program, script });
            }
            Ok(Self {
                clock: ClockJson::from(&info),
                plcs,
                nodes,
                buses: buses.iter().map(Bus::of).collect(),
                drives: drives.into_iter().map(DriveLine::from).collect(),
                faults,
                forced,
                errors: of_severity(Severity::Error),
                warnings: of_severity(Severity::Warning),
            })
        }

        fn text(&self) -> String {
            let ClockJson { instance, speed, time_us, pid, version, waits_for, .. } = &self.clock;
            let clock = match *speed {
                None => "stepped".to_owned(),
                Some(speed) => run::real_time_name(speed),
            };
            let waits =
                waits_for.as_ref().map_or_else(String::new, |client| format!(", it waits for {client}"));
            let mut text = format!(
                "instance '{instance}' (process {pid}, commram {version}) at {}, clock {clock}{waits}\n",
                time::seconds(*time_us)
            );
            text += &format!(
                "access checker: {}, {}; {}; {}\n",
                plural(self.errors, "error"),
                plural(self.warnings, "warning"),
                plural(self.faults as u64, "fault"),
                plural(self.forced as u64, "forced register")
            );
            for Plc { plc, .. } in self.plcs.iter().filter(|it| it.script.as_deref() == Some("stopped")) {
                text += &format!("script of {plc}: stopped; `commram check` has the reason\n");
            }
            let tables = [
                (self.plcs.is_empty(), table::aligned(&self.plcs)),
                (self.nodes.is_empty(), table::aligned(&self.nodes)),
                (self.buses.is_empty(), table::aligned(&self.buses)),
                (self.drives.is_empty(), table::aligned(&self.drives)),
            ];
            tables.iter().filter(|(is_empty, _)| !is_empty).for_each(|(_, table)| {
                text += "\n";
                text += table;
            });
            text
        }
    }

    impl Row for Status {
        const COLUMNS: &'static [&'static str] = &[
            "instance", "clock", "time_us", "pid", "plcs", "buses", "drives", "faults", "forced", "errors",
            "warnings",
        ];

        fn cells(&self) -> Vec<String> {
            let names = |names: Vec<&str>| names.join(" ");
            vec![
                self.clock.instance.clone(),
                self.clock.clock.to_owned(),
                self.clock.time_us.to_string(),
                self.clock.pid.to_string(),
                names(self.plcs.iter().map(|it| it.plc.as_str()).collect()),
                names(self.buses.iter().map(|it| it.bus.as_str()).collect()),
                self.drives.len().to_string(),
                self.faults.to_string(),
                self.forced.to_string(),
                self.errors.to_string(),
                self.warnings.to_string(),
            ]
        }
    }

    /// Returns the state of the script, which the front panel of the device shows; `None` if the device has no script.
    fn script_state(session: &Session, plc: DeviceIndex) -> Result<Option<String>, CliError> {
        let front = session.front(plc)?;
        let word = front.into_iter().find(|(word, _)| word.name == devices::folder::SCRIPT_WORD);
        Ok(word.map(|(word, state)| word.called(state).to_string()))
    }

    /// A port of a PLC.
    struct Port {
        /// Name of the port, with the name of the PLC in front.
        name: String,
        /// Register with the state of the firmware, and the PLC that has this register.
        status: Option<(DeviceIndex, RegisterRef)>,
    }

    /// Returns the ports of all PLCs.
    fn ports(session: &Session) -> Vec<Port> {
        let of_plc = |(plc, name): (DeviceIndex, &String)| {
            let port = |port: &crate::layout::Port| Port {
                name: format!("{name}:{}", port.name),
                status: status_of(port.area).map(|register| (plc, register)),
            };
            session.device(plc).ports.iter().map(port).collect::<Vec<_>>()
        };
        DeviceIndex::enumerate(session.plcs()).flat_map(of_plc).collect()
    }

    impl Port {
        /// Returns the operation that reads the state of the firmware.
        fn peek(&self) -> Option<Op> {
            let (plc, register) = self.status?;
            Some(Op::Peek { plc, offset: register.offset(), width: Width::of(register.ty()) })
        }

        /// Returns the node with the state that its firmware reports.
        fn node(self, state: Option<u32>, buses: &[BusState]) -> Node {
            let bus = buses.iter().find(|bus| bus.ports.contains(&self.name)).map(|bus| bus.name.clone());
            let described = self
                .status
                .zip(state)
                .map(|((_, register), value)| (format_value(register.ty(), value), register.decode(value)));
            let shown =
                described.as_ref().map_or_else(|| "-".to_owned(), |(value, text)| format!("{value}  {text}"));
            Node { node: self.name, bus, state, text: described.map(|(_, text)| text), shown }
        }
    }
}
