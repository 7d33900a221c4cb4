//! Guests: foreign programs that take part in a bus as separate stations.

use crate::can::ErrorState;
use crate::door::{BusMessage, Guest};
use crate::event_kinds;
use crate::journal::{EventCodec, EventKind, EventText, Fields, Journal, Packer, Part, Reader, Unpacker};
use std::sync::Arc;

/// All kinds of records about guests.
pub(in crate::devices) static KINDS: &[&EventKind] = &[GuestNews::KIND];

/// Reason why a bus refuses a frame or telegram of a guest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GuestRefusal {
    /// The queue of the guest is full; a later attempt may succeed.
    #[error("the guest has as many frames to send as its controller holds")]
    Full,
    /// The time of the frame is too far in the future. All later frames of the guest would have to wait for
    /// this frame.
    #[error("the time of the guest's telegram lies {seconds} s ahead; it may be 60 s at most")]
    TooFarAhead {
        /// Time from now until the requested time, in emulated seconds.
        seconds: u64,
    },
    /// The guest does not take part, no master runs the bus, or the bus has no frames of that kind.
    #[error("the guest cannot send this frame here")]
    NotHere,
}

/// The guests of a bus ([`Bus::guests`](crate::devices::Bus::guests)). Each guest has a number. Guest 0 acts
/// for requests of clients.
pub trait BusGuests {
    /// Lets a guest take part from now on. Returns false if it already took part.
    fn guest_joins(&mut self, guest: u8, now: u64) -> bool {
        let _ = (guest, now);
        false
    }

    /// Ends a guest's participation. Frames that it has passed to its controller are still sent.
    fn guest_leaves(&mut self, guest: u8, now: u64) {
        let _ = (guest, now);
    }

    /// Called when the guest has disconnected and some of its frames have not been sent. Frames that wait for
    /// a long time would keep the guest's place from other guests. So the bus drops frames for a future time,
    /// and all frames if no station receives them.
    fn guest_has_gone(&mut self, guest: u8, now: u64) {
        let _ = (guest, now);
    }

    /// Returns the error state of a guest's controller, if the bus has error states.
    fn guest_errors(&self, guest: u8) -> ErrorState {
        let _ = guest;
        ErrorState::Active
    }

    /// Sends the traffic of the bus, except the guest's own frames, to `receiver` from now on. With `None`
    /// the guest receives no more traffic. A guest can receive traffic without taking part. Snapshots contain
    /// no receivers.
    fn guest_hears(&mut self, guest: u8, receiver: Option<Arc<Guest>>) {
        let _ = (guest, receiver);
    }

    /// Sends a frame or a telegram of a participating guest.
    ///
    /// # Errors
    /// [`GuestRefusal`].
    fn guest_sends(
        &mut self,
        guest: u8,
        message: &BusMessage,
        now: u64,
        journal: &mut Journal,
    ) -> Result<(), GuestRefusal>;
}

event_kinds! {
    /// A guest starts or stops taking part in a bus.
    GuestNews = 52, "guest", Rare, at bus {
        /// Number of the guest on the bus.
        guest: u8,
        /// Event of the guest.
        news: Attendance,
    }
}

/// Change of a guest's participation in the bus, or of its seat in lockstep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attendance {
    /// The guest takes part from now on.
    TakesPart,
    /// The guest takes part from now on. The clock is stepped, so the bus takes over its frames only at the
    /// next step.
    TakesPartStepped,
    /// The guest has stopped taking part. Its controller may still send frames that the guest has passed to it.
    Left,
    /// The guest has a seat in lockstep. From now on, emulated time waits for the guest.
    Seated,
    /// The guest has given its seat back: it has left the bus or the door.
    SeatBack,
    /// The guest has lost its seat: its turn took too long, and it did not request time.
    SeatLost,
}

impl Attendance {
    const ALL: [Self; 6] = [
        Attendance::TakesPart,
        Attendance::TakesPartStepped,
        Attendance::Left,
        Attendance::Seated,
        Attendance::SeatBack,
        Attendance::SeatLost,
    ];

    fn name(self) -> &'static str {
        match self {
            Attendance::TakesPart => "takes_part",
            Attendance::TakesPartStepped => "takes_part_stepped",
            Attendance::Left => "left",
            Attendance::Seated => "seated",
            Attendance::SeatBack => "seat_back",
            Attendance::SeatLost => "seat_lost",
        }
    }
}

impl Part for Attendance {
    fn put(self, packer: &mut Packer) {
        packer.put(self as u32);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        Attendance::ALL.get(unpacker.take() as usize).copied()
    }
}

impl EventText for GuestNews {
    fn text(&self, _: &mut Reader) -> String {
        let guest = self.guest;
        match self.news {
            Attendance::TakesPart => format!("guest{guest} takes part"),
            Attendance::TakesPartStepped => format!(
                "guest{guest} takes part; the clock is stepped, its frames enter at the beginning of the next step"
            ),
            Attendance::Left => format!("guest{guest} has left"),
            Attendance::Seated => format!("guest{guest} has a seat in lockstep; emulated time waits for it"),
            Attendance::SeatBack => {
                format!("guest{guest} has given its seat back; the emulated time no longer waits for it")
            }
            Attendance::SeatLost => {
                format!("guest{guest} has lost its seat: in its turn it did nothing for too long")
            }
        }
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("guest", self.guest).with("news", self.news.name())
    }
}
