//! Handshake requests that were written through the channel and are not answered yet.

use crate::identity::DeviceIndex;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};

/// Maximum number of stored requests. A node cannot have more unanswered requests.
const PLACES: usize = 64;

#[derive(Clone, Copy, Serialize, Deserialize)]
struct Request {
    plc: DeviceIndex,
    offset: u32,
    value: u32,
    time_us: u64,
}

impl Request {
    fn latency(&self, time_us: u64) -> Option<u32> {
        u32::try_from(time_us.checked_sub(self.time_us)?).ok()
    }
}

/// The last writes through the channel, for the time from request to answer.
pub(super) struct Requests {
    places: [Option<Request>; PLACES],
    open: u32,
}

impl SnapshotFields for Requests {
    fn save(&self, to: &mut Saving) {
        let Self { places, open: _ } = self;
        to.value(&places.iter().flatten().collect::<Vec<_>>());
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        *self = Self::new();
        for Request { plc, offset, value, time_us } in from.value::<Vec<_>>()? {
            self.written(time_us, plc, offset, value);
        }
        Ok(())
    }
}

impl Requests {
    pub(crate) fn new() -> Self {
        Requests { places: [None; PLACES], open: 0 }
    }

    fn place(&mut self, plc: DeviceIndex, offset: u32) -> &mut Option<Request> {
        &mut self.places[(offset as usize ^ plc.index() << 3) % PLACES]
    }

    /// Records that a register was written.
    pub(crate) fn written(&mut self, time_us: u64, plc: DeviceIndex, offset: u32, value: u32) {
        let before = self.place(plc, offset).replace(Request { plc, offset, value, time_us });
        self.open += u32::from(before.is_none());
    }

    /// Ends a request with its answer. Returns the time since the request, if the time of the request is known. If
    /// later answers belong to this request, too, `pending_value` is the present value of the register.
    #[inline]
    pub(crate) fn answered(
        &mut self,
        time_us: u64,
        plc: DeviceIndex,
        offset: u32,
        request: u32,
        pending_value: Option<u32>,
    ) -> Option<u32> {
        let made = self.take(plc, offset)?;
        if made.value != request {
            return None;
        }
        if let Some(now) = pending_value {
            self.written(made.time_us, plc, offset, now);
        }
        made.latency(time_us)
    }

    /// Ends a command with a change of state; returns the time since the last command in the register at `offset`, if
    /// that is known. `shown` is the new state if the register of the commands shows it. Then a command with this value
    /// has changed the state without an answer, and does not end.
    pub(crate) fn commanded(
        &mut self,
        time_us: u64,
        plc: DeviceIndex,
        offset: u32,
        shown: Option<u32>,
    ) -> Option<u32> {
        let made = self.take(plc, offset)?;
        if shown == Some(made.value) {
            self.written(made.time_us, plc, offset, made.value);
            return None;
        }
        made.latency(time_us)
    }

    /// Removes and returns the request in the register at `offset`.
    #[inline]
    fn take(&mut self, plc: DeviceIndex, offset: u32) -> Option<Request> {
        if self.open == 0 {
            return None;
        }
        let request = self.place(plc, offset).take_if(|it| (it.plc, it.offset) == (plc, offset))?;
        self.open -= 1;
        Some(request)
    }
}
