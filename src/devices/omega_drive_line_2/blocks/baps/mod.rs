//! The BAPS function blocks (manual 5.00005.03a chapter 6.2, p. 85-120).
//!
//! The manual's blocks have no input for the BAPS. Here the BAPS is connected to `_BASE`, as for all other
//! blocks (decision D-215).

mod init;
mod par;
mod pd_comm;
mod pd_comm24;
mod pd_control;
mod sd_control;
mod service_data;

pub use init::BAPS_INIT;
pub use par::{BAPS_PAR_READ, BAPS_PAR_WRITE};
pub use pd_comm::{BAPS_PD_COMM2, BAPS_PD_COMM8};
pub use pd_comm24::BAPS_PD_COMM24;
pub use pd_control::BAPS_PD_CONTROL;
pub use sd_control::BAPS_SD_CONTROL;
pub use service_data::BAPS_BMSTRUCT;

/// Value of `us_HW_TYPE` for the only existing hardware. With any other value a block does nothing (decision
/// D-215).
const OMEGA_DRIVE_LINE_II: u8 = 0;
