//! The blocks of all PLCs with their registers. The lines open and close like a tree. During a search they are the
//! result of the search.

use super::list::List;
use crate::cli::find;
use crate::cli::map::entry;
use crate::identity::DeviceIndex;
use crate::journal::Names;
use crate::layout::place::is_live;
use crate::layout::{
    Area, AreaOrRegisters, DeviceFit, Fit, RegisterPhase, RegisterRef, plc_prefix, split_plc,
};
use std::collections::HashSet;

/// A line of the tree of blocks and registers.
#[derive(Clone, Debug)]
pub(super) enum Row {
    /// A PLC, if the instance has several.
    Plc(DeviceIndex),
    /// A block (area) of a device.
    Block(DeviceIndex, &'static Area),
    /// An array of registers, given by its first element.
    Array(DeviceIndex, RegisterRef),
    /// A register of a device.
    Register(DeviceIndex, RegisterRef),
}

/// Key of an open line: the PLC, the first byte of its block, the name of its array.
type BranchKey = (DeviceIndex, Option<u32>, Option<&'static str>);

/// For each open block with overlaid structures: the PLC, the block, and the structure that it contains now.
type RegisterPhases = Vec<(DeviceIndex, u32, RegisterPhase)>;

/// The lines of the tree.
#[derive(Default)]
pub(super) struct Tree {
    /// Position of the selection.
    pub list: List,
    /// Text of the search; `None` if no search is active.
    pub sought: Option<String>,
    names: Names,
    open: HashSet<BranchKey>,
    phases: RegisterPhases,
    rows: Vec<Row>,
    /// All registers with their descriptions, each array once. The index is created at the first search.
    index: Vec<(DeviceIndex, RegisterRef, entry::Entry)>,
}

impl Row {
    /// Returns the PLC of the line.
    pub(super) fn plc(&self) -> DeviceIndex {
        match self {
            Row::Plc(plc) | Row::Block(plc, _) | Row::Array(plc, _) | Row::Register(plc, _) => *plc,
        }
    }

    /// Returns the register of the line, if it is one.
    pub(super) fn register(&self) -> Option<(DeviceIndex, &RegisterRef)> {
        match self {
            Row::Register(plc, register) => Some((*plc, register)),
            _ => None,
        }
    }

    fn branch(&self) -> Option<BranchKey> {
        match self {
            Row::Plc(plc) => Some((*plc, None, None)),
            Row::Block(plc, area) => Some((*plc, Some(area.first), None)),
            Row::Array(plc, first) => Some((*plc, Some(first.area.first), Some(first.register.name))),
            Row::Register(..) => None,
        }
    }

    fn same(&self, other: &Row) -> bool {
        match (self, other) {
            (Row::Register(plc, one), Row::Register(other_plc, other)) => plc == other_plc && one == other,
            _ => self.branch().is_some() && self.branch() == other.branch(),
        }
    }
}

impl Tree {
    /// Returns the tree of a plant.
    pub(super) fn of(names: Names) -> Self {
        let mut tree = Self { names, ..Self::default() };
        if tree.names.plcs.len() == 1 {
            tree.open.insert((DeviceIndex(0), None, None));
        }
        tree.rebuild();
        tree
    }

    pub(super) fn rows(&self) -> &[Row] {
        &self.rows
    }

    pub(super) fn chosen(&self) -> Option<&Row> {
        self.rows.get(self.list.chosen)
    }

    /// Returns the visible lines.
    pub(super) fn seen(&self) -> &[Row] {
        self.rows.get(self.list.seen(self.rows.len())).unwrap_or_default()
    }

    /// Returns the open blocks with the numbers of their PLCs.
    pub(super) fn open_blocks(&self) -> impl Iterator<Item = (DeviceIndex, &'static Area)> {
        self.rows.iter().filter_map(|row| match row {
            Row::Block(plc, area) if self.is_open(row) => Some((*plc, *area)),
            _ => None,
        })
    }

    /// True if a line is open.
    pub(super) fn is_open(&self, row: &Row) -> bool {
        row.branch().is_some_and(|branch| self.open.contains(&branch))
    }

    /// Returns the number of levels by which a line is indented.
    pub(super) fn depth(&self, row: &Row) -> usize {
        if self.sought.is_some() {
            return 0;
        }
        let plcs = usize::from(self.names.plcs.len() > 1);
        match row {
            Row::Plc(_) => 0,
            Row::Block(..) => plcs,
            Row::Array(..) => plcs + 1,
            Row::Register(_, register) => plcs + 1 + usize::from(is_element(register)),
        }
    }

    /// Returns the text of a line in the tree.
    pub(super) fn label(&self, row: &Row) -> String {
        let prefix = |plc| plc_prefix(&self.names.plcs, plc);
        let is_found = self.sought.is_some();
        match row {
            Row::Plc(plc) => self.names.plcs.get(plc.index()).cloned().unwrap_or_default(),
            Row::Block(plc, area) if is_found => prefix(*plc) + area.name,
            Row::Block(_, area) => area.name.to_owned(),
            Row::Array(plc, first) if is_found => {
                format!("{}{}.{}", prefix(*plc), first.front(), first.register.pattern())
            }
            Row::Array(_, first) => first.register.pattern(),
            Row::Register(plc, register) if is_found => format!("{}{register}", prefix(*plc)),
            Row::Register(_, register) => register.path(),
        }
    }

    /// Opens or closes the selected line; `None` toggles it. A request to close a line that is not open closes its
    /// parent.
    pub(super) fn open(&mut self, open: Option<bool>) {
        let Some(row) = self.chosen().cloned() else { return };
        let branch = match (row.branch(), open) {
            (Some(branch), Some(true) | None) => branch,
            (Some(branch), Some(false)) if self.open.contains(&branch) => branch,
            (_, Some(false)) => {
                let Some(parent) = self.parent(&row) else { return };
                self.list.chosen = parent;
                return;
            }
            _ => return,
        };
        let is_open = self.open.contains(&branch);
        if open.unwrap_or(!is_open) {
            self.open.insert(branch);
        } else {
            self.open.remove(&branch);
        }
        self.rebuild();
    }

    fn parent(&self, row: &Row) -> Option<usize> {
        let depth = self.depth(row);
        let above = self.rows.get(..self.list.chosen)?;
        above.iter().rposition(|other| self.depth(other) < depth)
    }

    /// Sets the search text.
    pub(super) fn seek(&mut self, text: Option<String>) {
        let was_chosen = self.chosen().cloned();
        let ends = text.is_none();
        self.sought = text;
        if let Some(row) = was_chosen.filter(|_| ends) {
            self.reveal(&row);
        }
        self.rebuild();
        if !ends {
            self.list = List { height: self.list.height, ..List::default() };
        }
    }

    /// Opens the parents of a line.
    fn reveal(&mut self, row: &Row) {
        let plc = row.plc();
        self.open.insert((plc, None, None));
        if let Row::Array(_, register) | Row::Register(_, register) = row {
            self.open.insert((plc, Some(register.area.first), None));
            if is_element(register) && matches!(row, Row::Register(..)) {
                self.open.insert((plc, Some(register.area.first), Some(register.register.name)));
            }
        }
    }

    /// Sets which of the overlaid structures each block contains now.
    pub(super) fn set_phases(&mut self, phases: RegisterPhases) {
        if phases != self.phases {
            self.phases = phases;
            self.rebuild();
        }
    }

    /// Rebuilds the lines and keeps the selection.
    fn rebuild(&mut self) {
        let chosen = self.chosen().cloned();
        self.rows = match self.sought.clone() {
            Some(text) => self.found(&text),
            None => self.all(),
        };
        let place = chosen.and_then(|chosen| self.rows.iter().position(|row| row.same(&chosen)));
        let line = place.unwrap_or(self.list.chosen);
        self.list.choose(line, self.rows.len());
    }

    fn plcs(&self) -> Vec<(DeviceIndex, DeviceFit)> {
        DeviceIndex::first(self.names.plcs.len()).map(|plc| (plc, self.names.fitted(plc))).collect()
    }

    fn all(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        for (plc, fitted) in self.plcs() {
            if self.names.plcs.len() > 1 {
                rows.push(Row::Plc(plc));
            }
            if !self.open.contains(&(plc, None, None)) {
                continue;
            }
            for area in blocks(&fitted) {
                rows.push(Row::Block(plc, area));
                if self.open.contains(&(plc, Some(area.first), None)) {
                    self.add_registers(&mut rows, plc, &fitted, area);
                }
            }
        }
        rows
    }

    fn add_registers(&self, rows: &mut Vec<Row>, plc: DeviceIndex, fitted: &DeviceFit, area: &'static Area) {
        let live = self.phases.iter().find(|(of, first, _)| (*of, *first) == (plc, area.first));
        let live = live.map_or(area.phase(None), |(.., live)| *live);
        let firsts = entry::firsts(fitted, area);
        for first in firsts.iter().filter(|first| !first.register.reserved && is_live(first, live)) {
            if !is_element(first) {
                rows.push(Row::Register(plc, *first));
                continue;
            }
            let array = Row::Array(plc, *first);
            let is_open = self.is_open(&array);
            rows.push(array);
            if is_open {
                rows.extend(elements(plc, first));
            }
        }
    }

    /// Returns the result of a search: registers that match a name, pattern, index or address. If there are none,
    /// returns registers with the words in their descriptions.
    fn found(&mut self, text: &str) -> Vec<Row> {
        let text = text.trim();
        if text.is_empty() {
            return self.all();
        }
        if text.contains(['[', '*', '%']) {
            return self.named(text);
        }
        if self.index.is_empty() {
            for (plc, fitted) in self.plcs() {
                let firsts = blocks(&fitted).flat_map(|area| entry::firsts(&fitted, area));
                let firsts = firsts.filter(|first| !first.register.reserved);
                self.index.extend(firsts.map(|first| (plc, first, entry::of_array(&first))));
            }
        }
        let (plc, text) = split_plc(text);
        let wanted = plc.and_then(|plc| self.names.plcs.iter().position(|name| name == plc));
        let words: Vec<_> = text.split_whitespace().map(find::folded).collect();
        let meant = |number: DeviceIndex| plc.is_none() || wanted == Some(number.index());
        let meant = self.index.iter().filter(|(plc, ..)| meant(*plc));
        let ranked = meant.filter_map(|(plc, first, entry)| Some((find::rank(entry, &words)?, *plc, *first)));
        let mut found: Vec<_> = ranked.collect();
        found.sort_by_key(|(rank, ..)| *rank);
        let row = |(_, plc, first): (u8, DeviceIndex, RegisterRef)| match is_element(&first) {
            false => vec![Row::Register(plc, first)],
            true => {
                let array = Row::Array(plc, first);
                let elements = match self.is_open(&array) {
                    true => elements(plc, &first),
                    false => Vec::new(),
                };
                [array].into_iter().chain(elements).collect()
            }
        };
        found.into_iter().flat_map(row).collect()
    }

    fn named(&self, text: &str) -> Vec<Row> {
        let (plc, name) = split_plc(text);
        let is_meant = |number: &DeviceIndex| {
            plc.is_none_or(|plc| self.names.plcs.get(number.index()).is_some_and(|it| it == plc))
        };
        let mut rows = Vec::new();
        for (plc, fitted) in self.plcs().into_iter().filter(|(number, _)| is_meant(number)) {
            let registers = if name.starts_with('%') {
                let address = fitted.device().address(name);
                let mut found =
                    address.and_then(|address| fitted.registers_at(address, None)).unwrap_or_default();
                // The overlaid structures have some registers in common, which are listed once.
                let mut labels = HashSet::new();
                found.retain(|register| labels.insert(register.to_string()));
                found
            } else {
                match fitted.area_or_registers(name) {
                    Ok(AreaOrRegisters::Registers(registers)) => registers,
                    Ok(AreaOrRegisters::Area(area)) => {
                        rows.push(Row::Block(plc, area));
                        Vec::new()
                    }
                    Err(_) => Vec::new(),
                }
            };
            rows.extend(registers.into_iter().map(|register| Row::Register(plc, register)));
        }
        rows
    }
}

/// True if the register is an element of an array.
fn is_element(register: &RegisterRef) -> bool {
    register.register.dims.iter().map(|dim| usize::from(dim.count)).product::<usize>() > 1
}

/// Returns the elements of an array, without reserved ones.
fn elements(plc: DeviceIndex, first: &RegisterRef) -> Vec<Row> {
    let all = first.area.registers_of(first.placed).map(|it| RegisterRef { role: first.role, ..it });
    let own = all.filter(|it| core::ptr::eq(it.register, first.register) && !it.is_reserved());
    own.map(|register| Row::Register(plc, register)).collect()
}

/// Returns the blocks that have registers, with the options of this device.
fn blocks(fitted: &DeviceFit) -> impl Iterator<Item = &'static Area> + use<> {
    let fitted = *fitted;
    let areas = fitted.device().named_areas();
    areas.filter(move |area| fitted.area(area) != Fit::Empty && fitted.placed(area).next().is_some())
}
