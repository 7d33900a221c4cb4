//! What the commands of the program need of a stage: the debugger, and reports with sections.

use super::Stage;
use crate::devices::folder;
use crate::plant::PlantConfig;
use crate::script::{Bench, ScenarioError};

impl Stage {
    /// Passes each section with its emulated time in microseconds to `receive`.
    pub(crate) fn on_section(&mut self, receive: impl FnMut(&str, u64) + 'static) {
        self.on_section = Some(Box::new(receive));
    }

    /// Notes whether the script calls `plant`.
    pub(in crate::script) fn set_calls_plant(&mut self, calls_plant: bool) {
        self.calls_plant = calls_plant;
    }

    /// Emulated time in microseconds; 0 before the first verb.
    pub(in crate::script) fn now_us(&mut self) -> u64 {
        self.bench.as_mut().and_then(|bench| bench.now().ok()).unwrap_or(0)
    }

    /// The plant for a debugger. Before the first verb this is a preview: the first verb uses the same plant, unless it
    /// is the verb `plant`, which replaces it.
    ///
    /// # Errors
    /// The plant is refused, or the verb `plant` of the script has not run.
    pub(in crate::script) fn bench_of_debugger(&mut self) -> Result<&mut Bench, ScenarioError> {
        if self.bench.is_none() && self.calls_plant {
            let right = "this verb has not run, so the scenario has no registers yet";
            return Err(ScenarioError::argument("plant", right));
        }
        self.is_preview |= self.bench.is_none();
        self.existing_or_new()
    }

    /// Sets the plant for a script that does not call `plant`. Reports call this plant `name`.
    pub(crate) fn set_unnamed(&mut self, name: &str, plant: Result<PlantConfig, String>) {
        name.clone_into(&mut self.plant_name);
        let devices = plant.as_ref().map_or(&[][..], |plant| &plant.devices[..]);
        self.plant_files
            .extend(devices.iter().filter_map(|device| device.folder()).flat_map(folder::files_of));
        self.unnamed = Some(plant);
    }
}
