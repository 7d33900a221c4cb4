//! Requests of handshakes that came through the channel, until they are answered.

/// Requests remembered; more than a client can have under way in one node.
const PLACES: usize = 64;

#[derive(Clone, Copy)]
struct Request {
    plc: u16,
    offset: u32,
    value: u32,
    time_us: u64,
}

/// The last writes through the channel, for the time from request to answer.
pub(super) struct Requests {
    places: [Option<Request>; PLACES],
    open: u32,
}

impl Requests {
    pub fn new() -> Self {
        Requests { places: [None; PLACES], open: 0 }
    }

    fn place(&mut self, plc: u16, offset: u32) -> &mut Option<Request> {
        &mut self.places[(offset as usize ^ usize::from(plc) << 3) % PLACES]
    }

    /// A register was written.
    pub fn written(&mut self, time_us: u64, plc: u16, offset: u32, value: u32) {
        let before = self.place(plc, offset).replace(Request { plc, offset, value, time_us });
        self.open += u32::from(before.is_none());
    }

    /// A request was answered; returns the time since it was made, if that is known.
    #[inline]
    pub fn answered(&mut self, time_us: u64, plc: u16, offset: u32, value: u16) -> Option<u32> {
        if self.open == 0 {
            return None;
        }
        let place = self.place(plc, offset);
        let request = place.filter(|request| (request.plc, request.offset) == (plc, offset))?;
        *place = None;
        self.open -= 1;
        let latency = time_us.checked_sub(request.time_us)?;
        if request.value == u32::from(value) { u32::try_from(latency).ok() } else { None }
    }
}
