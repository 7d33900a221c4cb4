//! Baud rates: the interval of each baud rate, and the slot times within the interval.

use crate::layout::Provenance;

/// Baud rate of a CANsync bus, with its interval and slot times. A time with the prefix `t_` is the latest
/// start of a frame in microseconds after the SYNC edge. The layout of each device contains the table of
/// these times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(non_snake_case)]
pub struct BaudRate {
    /// Baud rate in kbit/s.
    pub kbit_per_s: u16,
    /// Code of the baud rate at function block `CANsync_INIT`.
    pub us_BAUDRATE: u8,
    /// Bit timing register 0 of the CAN controller.
    pub b_BT_0: u8,
    /// Bit timing register 1 of the CAN controller.
    pub b_BT_1: u8,
    /// Interval in milliseconds, as in register `b_TIME_PATTERN`.
    pub b_TIME_PATTERN: u8,
    /// Reference value frame 1.
    pub t_WRC1: u32,
    /// Actual value frame 1.
    pub t_RDC1: u32,
    /// Reference value frame 2.
    pub t_WRC2: u32,
    /// Actual value frame 2.
    pub t_RDC2: u32,
    /// Command channel.
    pub t_CC: u32,
    /// Response channel, in the next interval.
    pub t_RC: u32,
    /// Longest time a slave may take to answer, in us.
    pub t_RSPTO: u32,
    /// Deadline of a master's reference values.
    pub deadline_WRC: Deadline,
    /// Deadline of a slave's own actual values for frame 1.
    pub deadline_RDC1: Deadline,
    /// Deadline of a slave's own actual values for frame 2.
    pub deadline_RDC2: Deadline,
    /// Longest bus in metres.
    pub max_bus_m: u16,
}

/// Time at which the firmware begins to build a frame, in microseconds after the start of the event task. The
/// program must release the values before this time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deadline {
    /// Values that are released before this time are in time.
    pub earliest: u32,
    /// Values that are released at this time or later are late. If no other limit applies, `latest` equals
    /// `earliest`.
    pub latest: u32,
    /// Source of the times.
    pub source: Provenance,
}
