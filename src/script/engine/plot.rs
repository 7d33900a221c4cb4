//! The verb for plots.

use super::arguments::{names, number};
use super::{Stage, Verbs};
use crate::script::ScenarioError;
use rhai::{Array, INT};

impl Verbs {
    pub(super) fn plots(&mut self) {
        self.on("plot", |stage| {
            move |file: &str, registers: Array| stage.with(|stage| stage.plot(file, &registers, None))
        });
        self.on("plot", |stage| {
            move |file: &str, registers: Array, since: INT| {
                stage.with(|stage| stage.plot(file, &registers, Some(number(since, "time")?)))
            }
        });
    }
}

#[cfg(feature = "studio")]
impl Stage {
    /// Draws registers into a file beside the scenario, and for the report.
    fn plot(&mut self, file: &str, registers: &Array, since: Option<u64>) -> Result<(), ScenarioError> {
        use crate::output_file;
        use crate::plot::Picture;
        use crate::script::PlotFile;
        use std::path::{Component, Path};

        /// Maximum number of plots in a report. The next constant is the maximum size of all plots together.
        const MOST: usize = 256;
        const LARGEST: usize = 8 << 20;

        let wrong = |error: &dyn core::fmt::Display| ScenarioError::argument(file, &error.to_string());
        let parts: Vec<_> = Path::new(file).components().collect();
        if !matches!(parts.as_slice(), [Component::Normal(_)]) {
            return Err(wrong(&"a plot is written beside the scenario, so its name has no directories"));
        }
        let picture =
            Picture::of(file.as_ref()).map_err(|_| wrong(&"the name of a plot ends in .svg or .png"))?;
        let registers = names(registers, "register")?;
        let registers: Vec<_> = registers.iter().map(String::as_str).collect();
        let started_us = self.bench()?.started_us();
        let plot = self.bench()?.plot(&registers, since.unwrap_or(started_us))?;
        let sections = self.steps.iter().filter_map(|step| Some((step.from_us, step.name.clone()?)));
        let plot = plot.with_sections(sections);
        let bytes = plot.render(picture).map_err(|error| wrong(&error))?;
        let svg = plot.svg().map_err(|error| wrong(&error))?;
        let size: usize = self.plots.iter().map(|plot| plot.svg.len()).sum();
        if self.plots.len() == MOST || size + svg.len() > LARGEST {
            let right = format!("a scenario draws at most {MOST} plots, of {} MiB together", LARGEST >> 20);
            return Err(wrong(&right));
        }
        output_file::replace(&self.directory.join(file), &bytes).map_err(|error| wrong(&error))?;
        self.plots.push(PlotFile { name: file.to_owned(), svg });
        Ok(())
    }
}

#[cfg(not(feature = "studio"))]
impl Stage {
    /// Refuses the verb: this build has no plots.
    fn plot(&mut self, file: &str, registers: &Array, _: Option<u64>) -> Result<(), ScenarioError> {
        names(registers, "register")?;
        Err(ScenarioError::argument(file, "this commram was built without plots (feature `studio`)"))
    }
}
