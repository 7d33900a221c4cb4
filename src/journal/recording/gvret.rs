//! Reads files of GVRET and SavvyCAN: a table in CSV, with times in microseconds.
//!
//! A time may be negative. The columns are `Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8`. Older files do not have `Dir`.

use super::{Direction, Entry, Logged};
use crate::can::{ExtendedId, Frame, Id, Payload, StandardId};
use core::num::ParseIntError;

const NO_ROW: &str = "a row of a GVRET file is for example 166064000,0000021A,false,Rx,0,2,FE,36, as its head names the columns";
const FD: &str = "a frame of CAN FD; these buses carry classical CAN only";

/// The columns that the head of a file names.
pub(super) struct Columns {
    /// Number of microseconds that is added to every time. If the clock of a logger was corrected, its times may be
    /// negative (D-826).
    shift_us: u64,
    id: usize,
    extended: usize,
    direction: Option<usize>,
    bus: usize,
    length: usize,
    data: usize,
}

impl Columns {
    /// Returns the columns, if the line is the head of such a file.
    pub(super) fn of_head(line: &str) -> Option<Self> {
        let names: Vec<_> = line.split(',').map(|name| name.trim().to_ascii_lowercase()).collect();
        let find = |name: &str| names.iter().position(|other| other == name);
        let is_one = names.first().is_some_and(|name| name == "time stamp");
        is_one.then_some(())?;
        Some(Columns {
            shift_us: 0,
            id: find("id")?,
            extended: find("extended")?,
            direction: find("dir"),
            bus: find("bus")?,
            length: find("len")?,
            data: find("d1")?,
        })
    }

    /// Shifts all times so that the earliest negative time of the file becomes 0.
    pub(super) fn shifted_for(mut self, text: &str) -> Self {
        let amount = |line: &str| negative(line.split(',').next()?)?.ok();
        self.shift_us = text.lines().filter_map(amount).max().unwrap_or(0);
        self
    }

    /// Returns the shifted time in this cell.
    fn time_us(&self, cell: &str) -> Option<u64> {
        match negative(cell) {
            Some(before) => self.shift_us.checked_sub(before.ok()?),
            None => cell.parse::<u64>().ok()?.checked_add(self.shift_us),
        }
    }

    /// Reads a frame from a row of the file.
    pub(super) fn entry(&self, at: usize, line: &str) -> Result<Entry, &'static str> {
        let cells: Vec<_> = line.split(',').map(str::trim).collect();
        let cell = |column: usize| cells.get(column).copied().ok_or(NO_ROW);
        let time_us = self.time_us(cell(0)?).ok_or(NO_ROW)?;
        let raw = u32::from_str_radix(cell(self.id)?, 16).map_err(|_| NO_ROW)?;
        let id = match cell(self.extended)?.to_ascii_lowercase().as_str() {
            "true" | "1" => ExtendedId::new(raw).map(Id::Extended),
            "false" | "0" => u16::try_from(raw).ok().and_then(StandardId::new).map(Id::Standard),
            _ => return Err(NO_ROW),
        };
        let id = id.ok_or("an identifier goes up to 7FF, or extended up to 1FFFFFFF")?;
        let length: usize = cell(self.length)?.parse().map_err(|_| NO_ROW)?;
        if length > 8 {
            return Ok(Entry::Skipped(FD.to_owned()));
        }
        let byte = |column| u8::from_str_radix(cell(column)?, 16).map_err(|_| NO_ROW);
        let bytes: Vec<u8> = (self.data..self.data + length).map(byte).collect::<Result<_, _>>()?;
        let payload = Payload::new(&bytes).ok_or(NO_ROW)?;
        let direction = match self.direction.map(cell).transpose()?.map(str::to_ascii_lowercase).as_deref() {
            Some("rx") => Some(Direction::Received),
            Some("tx") => Some(Direction::Transmitted),
            _ => None,
        };
        let interface = format!("can{}", cell(self.bus)?);
        Ok(Entry::Frame(Logged { at, time_us, interface, direction, frame: Frame::new(id, payload) }))
    }
}

/// Returns the amount of a negative number.
fn negative(cell: &str) -> Option<Result<u64, ParseIntError>> {
    cell.trim().strip_prefix('-').map(str::parse)
}
