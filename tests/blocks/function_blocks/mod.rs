//! The function blocks that only the Omega Drive-Line II has, against the live firmware, and the documentation of all blocks.

mod baps;
mod baps_faults;
mod baps_inputs;
mod board;
mod documented;
mod service_data;
mod tasks;
