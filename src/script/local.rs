//! A plant in this process, on heap memory, with a stepped clock.

use super::ScenarioError;
use super::carrier::Carrier;
use crate::identity::DeviceIndex;
use crate::memory::Segment;
use crate::memory::header::ABI_VERSION;
use crate::plant::{Plant, PlantConfig};
use crate::request::{Execution, Host, InstanceInfo, Op, Reply, Travel};

/// A plant in this process.
pub(super) struct Local {
    plant: Plant,
    /// History of the plant, which here only keeps the snapshots of the script.
    travel: Travel,
    is_stopping: bool,
}

impl Local {
    /// Builds the plant and powers it on.
    ///
    /// # Errors
    /// The plant is refused.
    pub(crate) fn new(config: &PlantConfig) -> Result<Self, ScenarioError> {
        let plant = Plant::new(config, |_plc, device| Ok::<_, ScenarioError>(Segment::of(device)))?;
        Ok(Self { plant, travel: Travel::new(0), is_stopping: false })
    }
}

impl Carrier for Local {
    fn ask(&mut self, op: Op) -> Result<Reply, ScenarioError> {
        self.begin_request();
        let mut execution = Execution::default();
        loop {
            // This plant has no other clients, so an operation never waits or pauses.
            if let Some(reply) = execution.run(self, &op)? {
                return Ok(reply);
            }
        }
    }

    fn segment(&mut self, plc: DeviceIndex) -> Result<Segment, ScenarioError> {
        let known = self.plant.devices().get(plc.index()).map(|device| device.segment().clone());
        known.ok_or_else(|| ScenarioError::Unknown {
            what: "PLC",
            name: plc.to_string(),
            known: self.plant.names().plcs.join(", "),
        })
    }

    fn journal_hash(&self) -> Option<u64> {
        Some(self.plant.journal().hash())
    }
}

impl Host for Local {
    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    fn plant_and_travel(&mut self) -> (&mut Plant, &mut Travel) {
        (&mut self.plant, &mut self.travel)
    }

    fn is_stepped(&self) -> bool {
        true
    }

    fn begin_request(&mut self) {
        self.plant.look_at_boards();
    }

    fn next_event(&self) -> u64 {
        self.plant.next_event()
    }

    fn next_change(&self) -> u64 {
        self.plant.next_change()
    }

    fn advance_to(&mut self, t: u64) -> bool {
        self.plant.advance_to(t);
        true
    }

    fn info(&self) -> InstanceInfo {
        InstanceInfo {
            name: "scenario".to_owned(),
            is_stepped: true,
            speed: 0,
            time_us: self.plant.now(),
            generation: 1,
            pid: std::process::id(),
            abi_version: ABI_VERSION,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            waits_for: None,
            names: self.plant.names(),
        }
    }

    fn request_stop(&mut self, _by: Option<u32>) {
        self.is_stopping = true;
    }

    fn should_stop(&self) -> bool {
        self.is_stopping
    }
}
