//! Plots of registers.

use super::Bench;
use crate::devices;
use crate::journal::{Selection, Waves, Window};
use crate::plot::{Plot, Row, address_of};
use crate::request::Op;
use crate::script::ScenarioError;
use crate::time::short;

/// Maximum number of registers in a plot.
const MOST: usize = 64;

impl Bench {
    /// Returns the values of these registers from time `from_us` (microseconds) to now, as far as the journal has them.
    /// For recorded registers ([`Bench::record`]) it has every change.
    ///
    /// # Errors
    /// There is no such register, there are more than 64, or `from_us` is later than now.
    pub fn plot(&mut self, registers: &[&str], from_us: u64) -> Result<Plot, ScenarioError> {
        if registers.len() > MOST {
            let right = format!("a plot has at most {MOST} registers");
            return Err(ScenarioError::argument(&format!("{} registers", registers.len()), &right));
        }
        let found = registers.iter().map(|text| self.find(text)).collect::<Result<Vec<_>, _>>()?;
        let (records, _) = self.records(0)?;
        let to_us = self.now()?;
        if from_us > to_us {
            let right = format!("the plot ends now, at {}; choose an earlier begin", short(to_us));
            return Err(ScenarioError::argument(&format!("since {}", short(from_us)), &right));
        }
        let window = Window::of_picture(from_us, to_us);
        let names = self.names.clone();
        let waves = Waves::within(window, &records, &Selection::default(), names, devices::catalogue());
        let mut rows = Vec::with_capacity(found.len());
        for register in &found {
            let address = address_of(register.place());
            let past = waves.register(register.plc(), address.offset(), address.width());
            let row = Row::of(register.name(register.place().last_phase()), register.place(), &past);
            let held = self.load(register.spot)?;
            let (plc, offset) = (register.plc(), address_of(register.place()).offset());
            let is_recorded = self.ask(Op::IsRecorded { plc, offset })?.value()? == 1;
            rows.push(
                row.or_holds(&register.place().format(register.place().last_phase(), held), is_recorded),
            );
        }
        Ok(Plot::new(from_us, to_us, waves.edges(), rows))
    }
}
