//! The content of the screen, independent of the terminal.

use super::actions::Pane;
use super::drives::Drives;
use super::frames::Frames;
use super::link::{LinkCommand, LinkReport};
use super::list::List;
use super::pins::Pins;
use super::poll::{DeviceFront, MemoryLocation, PollData, Query};
use super::prompt::{BoardSwitch, Prompt};
use super::tree::{Row, Tree};
use crate::identity::DeviceIndex;
use crate::journal::{Entry, Names};
use crate::layout::place::status_of;
use crate::layout::{Area, NamedLocation, RegisterPhase, RegisterRef};
use crate::plant::Forced;
use crate::request::{BusScene, BusState, InstanceInfo};
use ratatui::layout::Rect;
use std::collections::HashMap;
use std::sync::LazyLock;

/// State of the connection to the emulator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Connection {
    /// No reply has arrived yet.
    Connecting,
    /// The emulator runs and answers.
    Live,
    /// The emulator advances the clock for another client.
    Busy,
    /// The emulator is not running, with the reason.
    Absent(String),
}

/// The target of a click.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ClickTarget {
    /// A click shows this pane.
    Tab(Pane),
    /// Selects a line of this list. The clickable area begins with the first visible line of the list.
    List(ListId),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ListId {
    Tree,
    Pins,
    Changes,
    Frames,
    Board,
    Drives,
    Findings,
    Plant,
}

/// A message to the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Message {
    pub text: String,
    /// True for an error.
    pub is_bad: bool,
}

/// All data for the screen.
pub(super) struct Model {
    pub instance: String,
    pub read_only: bool,
    pub connection: Connection,
    pub info: Option<InstanceInfo>,
    pub pane: Pane,
    /// True if the screen had room for two panes when it was last drawn.
    pub is_wide: bool,
    /// True if the keys control the list of pinned registers, false if they control the tree.
    pub on_pins: bool,
    pub tree: Tree,
    pub pins: Pins,
    values: HashMap<MemoryLocation, u32>,
    forces: Vec<Forced>,
    pub faces: Vec<DeviceFront>,
    pub findings: Vec<Entry>,
    pub finding: List,
    pub scene: Vec<BusScene>,
    pub frames: Frames,
    pub drives: Drives,
    pub buses: Vec<BusState>,
    pub plant: List,
    pub board: List,
    /// The switch in each line of the pane of front panels, as last drawn.
    pub knobs: Vec<Option<BoardSwitch>>,
    pub prompt: Option<Prompt>,
    pub message: Option<Message>,
    pub help: bool,
    /// Clickable areas of the screen, as last drawn.
    pub hot: Vec<(Rect, ClickTarget)>,
    /// Commands that wait to be sent to the link thread.
    pub orders: Vec<LinkCommand>,
    pub quits: bool,
    /// True if Ctrl-C was pressed.
    pub is_interrupted: bool,
    /// Last input of the prompt for a step. The next prompt offers this text.
    pub step: String,
    pub until: String,
}

impl Model {
    /// Creates a model that has no data of the instance yet.
    pub(super) fn new(instance: &str, read_only: bool) -> Self {
        Self {
            instance: instance.to_owned(),
            read_only,
            connection: Connection::Connecting,
            info: None,
            pane: Pane::Registers,
            is_wide: false,
            on_pins: false,
            tree: Tree::default(),
            pins: Pins::default(),
            values: HashMap::new(),
            forces: Vec::new(),
            faces: Vec::new(),
            findings: Vec::new(),
            finding: List::default(),
            scene: Vec::new(),
            frames: Frames::default(),
            drives: Drives::default(),
            buses: Vec::new(),
            plant: List::default(),
            board: List::default(),
            knobs: Vec::new(),
            prompt: None,
            message: None,
            help: false,
            hot: Vec::new(),
            orders: Vec::new(),
            quits: false,
            is_interrupted: false,
            step: "1ms".to_owned(),
            until: String::new(),
        }
    }

    /// Takes a report of the link thread.
    pub(super) fn take(&mut self, news: LinkReport) {
        match news {
            LinkReport::Data(seen) => self.see(*seen),
            LinkReport::Busy => self.connection = Connection::Busy,
            LinkReport::Absent(why) => self.connection = Connection::Absent(why),
            LinkReport::Progress(text) | LinkReport::Done(text) => self.show_message(text),
            LinkReport::Failed(why) => self.complain(why),
        }
    }

    /// Shows a message in the last line.
    pub(super) fn show_message(&mut self, text: impl Into<String>) {
        self.message = Some(Message { text: text.into(), is_bad: false });
    }

    /// Shows an error message.
    pub(super) fn complain(&mut self, text: impl Into<String>) {
        self.message = Some(Message { text: text.into(), is_bad: true });
    }

    fn see(&mut self, seen: PollData) {
        let PollData {
            info,
            forces,
            values,
            changes,
            lost,
            recorded,
            records,
            pending,
            faces,
            findings,
            scene,
            drives,
            buses,
        } = seen;
        let is_same = |old: &InstanceInfo| (old.pid, old.generation) == (info.pid, info.generation);
        match &self.info {
            Some(old) if is_same(old) => {
                if info.time_us < old.time_us {
                    self.pins.go_back(info.time_us);
                    self.frames.go_back(info.time_us);
                }
            }
            Some(_) => self.begin_anew(&info),
            None => self.tree = Tree::of(info.names.clone()),
        }
        let now_us = info.time_us;
        self.scene = scene.unwrap_or_else(|| core::mem::take(&mut self.scene));
        if let Some(drives) = drives {
            self.drives.take(drives, now_us);
        }
        self.frames.take(&records, &pending, &info.names, &self.scene);
        self.connection = Connection::Live;
        self.info = Some(info);
        self.forces = forces;
        self.values.extend(values);
        self.pins.take(&changes, &recorded, now_us);
        self.pins.lost += lost;
        self.faces = faces.unwrap_or_default();
        self.findings = findings.unwrap_or_default();
        if let Some(buses) = buses {
            self.buses = buses;
        }
        let phases = self.tree.open_blocks().filter_map(|(plc, area)| {
            let status = MemoryLocation::register(plc, &status_of(area)?);
            Some((plc, area.first, area.phase(Some(*self.values.get(&status)?))))
        });
        let phases = phases.collect();
        self.tree.set_phases(phases);
    }

    /// Resets the data, because another emulator has replaced the previous one.
    fn begin_anew(&mut self, info: &InstanceInfo) {
        let old = self.names().clone();
        self.tree = Tree::of(info.names.clone());
        self.values.clear();
        self.buses.clear();
        self.frames = Frames::default();
        self.drives = Drives::default();
        self.pins.forget();
        let was_pinned: Vec<_> = self.pins.all.drain(..).map(|pin| (pin.plc, pin.place)).collect();
        for (plc, place) in was_pinned {
            let name = old.plcs.get(plc.index());
            let number = info.names.plcs.iter().position(|known| Some(known) == name);
            let Some(number) = number.map(DeviceIndex::at) else { continue };
            if let Ok(place) = NamedLocation::parse(&info.names.fitted(number), place.text()) {
                self.pins.toggle(number, place);
            }
        }
        self.show_message("another emulator of this name has started");
    }

    /// Returns the panes on the screen: the active pane and, on a wide screen, the changes or the registers beside it.
    pub(super) fn shown(&self) -> (Pane, Option<Pane>) {
        match self.pane {
            pane if !self.is_wide => (pane, None),
            Pane::Changes => (Pane::Registers, Some(Pane::Changes)),
            pane => (pane, Some(Pane::Changes)),
        }
    }

    /// Returns the data that the visible panes need.
    pub(super) fn query(&self) -> Query {
        let mut registers: Vec<MemoryLocation> = self.pins.all.iter().map(|pin| pin.location()).collect();
        let places = self.pins.all.iter().filter_map(|pin| Some((pin.plc, pin.place.status()?)));
        registers.extend(places.map(|(plc, status)| MemoryLocation::register(plc, &status)));
        let (pane, other) = self.shown();
        match pane {
            Pane::Registers => {
                registers.extend(
                    self.tree
                        .seen()
                        .iter()
                        .filter_map(Row::register)
                        .map(|(plc, register)| MemoryLocation::register(plc, register)),
                );
                let found = self.tree.seen().iter().filter_map(Row::register);
                let found = found.filter_map(|(plc, register)| Some((plc, status_of(register.area)?)));
                let open = self.tree.open_blocks().filter_map(|(plc, area)| Some((plc, status_of(area)?)));
                registers
                    .extend(found.chain(open).map(|(plc, status)| MemoryLocation::register(plc, &status)));
            }
            Pane::Plant => {
                let states = self.ports().map(|(plc, status)| MemoryLocation::register(plc, &status));
                registers.extend(states);
            }
            Pane::Changes | Pane::Frames | Pane::Board | Pane::Drives | Pane::Findings => {}
        }
        registers.sort_unstable();
        registers.dedup();
        Query {
            registers,
            follow: self.pins.all.iter().map(|pin| pin.location()).collect(),
            fronts: matches!(self.pane, Pane::Plant | Pane::Board),
            findings: self.pane == Pane::Findings,
            scene: matches!(self.pane, Pane::Plant | Pane::Frames | Pane::Drives),
            buses: self.pane == Pane::Plant,
            journal: self.pane == Pane::Frames,
            recorded: (pane == Pane::Changes || other == Some(Pane::Changes)) && self.pins.all.is_empty(),
        }
    }

    /// Returns the status registers of all ports, each with the index of its PLC.
    fn ports(&self) -> impl Iterator<Item = (DeviceIndex, RegisterRef)> {
        let devices = self.info.iter().flat_map(|info| DeviceIndex::enumerate(&info.names.devices));
        devices.flat_map(|(plc, fitted)| {
            fitted.device().ports.iter().filter_map(move |port| Some((plc, status_of(port.area)?)))
        })
    }

    /// Returns names of PLCs and buses.
    pub(super) fn names(&self) -> &Names {
        static NOT_YET: LazyLock<Names> = LazyLock::new(Names::default);
        self.info.as_ref().map_or(&NOT_YET, |info| &info.names)
    }

    pub(super) fn now_us(&self) -> u64 {
        self.info.as_ref().map_or(0, |info| info.time_us)
    }

    /// True with a stepped clock.
    pub(super) fn is_stepped(&self) -> bool {
        self.info.as_ref().is_some_and(|info| info.is_stepped)
    }

    /// Returns the value of a register, if it was read.
    pub(super) fn value(&self, location: MemoryLocation) -> Option<u32> {
        self.values.get(&location).copied()
    }

    pub(super) fn is_forced(&self, location: MemoryLocation) -> bool {
        self.forces.iter().any(|forced| (forced.plc, forced.offset) == (location.plc, location.offset))
    }

    /// Returns the overlaid structure that the area currently contains, derived from the value of the status register.
    pub(super) fn live(&self, plc: DeviceIndex, area: &'static Area) -> RegisterPhase {
        let status = status_of(area);
        area.phase(status.and_then(|status| self.value(MemoryLocation::register(plc, &status))))
    }

    /// Returns the chosen register and its PLC.
    pub(super) fn chosen(&self) -> Option<(DeviceIndex, NamedLocation)> {
        match self.pane {
            Pane::Registers if self.on_pins => {
                let pin = self.pins.all.get(self.pins.list.chosen)?;
                Some((pin.plc, pin.place.clone()))
            }
            Pane::Registers => {
                let (plc, register) = self.tree.chosen()?.register()?;
                let fitted = self.info.as_ref()?.names.fitted(plc);
                Some((plc, NamedLocation::parse(&fitted, &register.name()).ok()?))
            }
            Pane::Changes => {
                let change = self.pins.shown().get(self.pins.history.chosen)?;
                let pin = self
                    .pins
                    .all
                    .iter()
                    .find(|pin| pin.plc == change.what.plc && pin.place.offset() == change.what.offset)?;
                Some((pin.plc, pin.place.clone()))
            }
            Pane::Plant | Pane::Frames | Pane::Board | Pane::Drives | Pane::Findings => None,
        }
    }

    /// Returns the list that the keys control, and its number of lines.
    pub(super) fn list(&mut self) -> (&mut List, usize) {
        let which = match self.pane {
            Pane::Registers if self.on_pins => ListId::Pins,
            Pane::Registers => ListId::Tree,
            Pane::Changes => ListId::Changes,
            Pane::Frames => ListId::Frames,
            Pane::Board => ListId::Board,
            Pane::Drives => ListId::Drives,
            Pane::Findings => ListId::Findings,
            Pane::Plant => ListId::Plant,
        };
        self.list_of(which)
    }

    /// Returns a list and its number of lines.
    pub(super) fn list_of(&mut self, which: ListId) -> (&mut List, usize) {
        match which {
            ListId::Tree => {
                let len = self.tree.rows().len();
                (&mut self.tree.list, len)
            }
            ListId::Pins => (&mut self.pins.list, self.pins.all.len()),
            ListId::Changes => {
                let len = self.pins.shown().len();
                (&mut self.pins.history, len)
            }
            // The number of frames depends on the window, which only the drawing code computes.
            ListId::Frames => (&mut self.frames.list, usize::MAX),
            ListId::Board => (&mut self.board, self.knobs.len()),
            ListId::Drives => (&mut self.drives.list, self.drives.all.len()),
            ListId::Findings => (&mut self.finding, self.findings.len()),
            ListId::Plant => (&mut self.plant, usize::MAX),
        }
    }
}
