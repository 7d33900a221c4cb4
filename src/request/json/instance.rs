//! The description of an instance in JSON.

use super::InJson;
use crate::identity::DeviceIndex;
use crate::journal::Names;
use crate::request::InstanceInfo;
use serde::Serialize;

#[derive(Serialize)]
struct InstanceJson<'a> {
    name: &'a str,
    is_stepped: bool,
    speed: u32,
    time_us: u64,
    generation: u32,
    pid: u32,
    abi_version: u32,
    version: &'a str,
    waits_for: Option<&'a str>,
    plcs: Vec<PlcJson<'a>>,
    buses: &'a [String],
}

#[derive(Serialize)]
struct PlcJson<'a> {
    plc: &'a str,
    /// Name of the PLC's device.
    device: &'static str,
}

impl InJson for Box<InstanceInfo> {
    fn form(&self, _: &Names) -> impl Serialize {
        let Names { plcs, buses, .. } = &self.names;
        let plc = |(number, plc)| PlcJson { plc, device: self.names.device(number).name };
        InstanceJson {
            name: &self.name,
            is_stepped: self.is_stepped,
            speed: self.speed,
            time_us: self.time_us,
            generation: self.generation,
            pid: self.pid,
            abi_version: self.abi_version,
            version: &self.version,
            waits_for: self.waits_for.as_deref(),
            plcs: DeviceIndex::enumerate(plcs.iter().map(String::as_str)).map(plc).collect(),
            buses,
        }
    }
}
