//! A bus as the plant file describes it.

use crate::devices::cansync::bus::FrameLength;
use crate::devices::cansync::drive::DriveConfig;
use serde::Deserialize;

/// A bus of the plant file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusConfig {
    /// Name, unique among the buses.
    pub name: String,
    /// Baud rate that the drives on it are set to: 500, 250 or 125 kbit/s (default 500). The bus itself
    /// runs at the rate that its master is initialized with.
    #[serde(default = "default_kbit_s")]
    pub kbit_s: u16,
    /// Length of its process data frames: `"fixed"` (default) or `"variable"` (decision D-10).
    #[serde(default)]
    pub frame_length: FrameLength,
    /// The drives on it.
    #[serde(rename = "drive", default)]
    pub drives: Vec<DriveConfig>,
}

fn default_kbit_s() -> u16 {
    500
}
