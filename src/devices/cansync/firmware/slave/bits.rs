//! Bits that a slave's parameter and up-/download jobs have in common, the same in control and status
//! register (manual 5.00005.03a p. 189, 191).

/// Bit 0: set by the firmware when a job arrives, cleared by the application when it is done with it.
pub(super) const ACTIVE: u8 = 1 << 0;
/// Bit 5: set by the application together with an error number.
pub(super) const ERROR: u8 = 1 << 5;
/// Bit 6: the answer has not been sent yet.
pub(super) const BUSY: u8 = 1 << 6;
/// Bit 7: the application has seen that the master changed the job.
pub(super) const RESET: u8 = 1 << 7;
