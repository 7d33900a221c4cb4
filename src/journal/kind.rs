//! The kinds of events: number, name and ring of each.

/// Number of rings.
pub(super) const RINGS: usize = 4;

/// Which ring of the journal keeps an event. Those that come often must not push out those that come rarely.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ring {
    /// Frames.
    Traffic,
    /// SYNC edges and what happens in registers.
    Registers,
    /// Missed deadlines and injected faults.
    Missed,
    /// Everything that is rare in a good run.
    Rare,
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident = $number:literal, $name:literal, $ring:ident;)*) => {
        /// What kind of event it is.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(u8)]
        pub enum Kind {
            $($(#[$doc])* $kind = $number,)*
        }

        impl Kind {
            /// All kinds.
            pub const ALL: &'static [Kind] = &[$(Kind::$kind,)*];

            /// Its name in JSON Lines and on the command line.
            pub const fn name(self) -> &'static str {
                match self { $(Kind::$kind => $name,)* }
            }

            /// The ring that keeps it.
            #[inline]
            pub(super) const fn ring(self) -> Ring {
                match self { $(Kind::$kind => Ring::$ring,)* }
            }

            /// The kind of that number, which is part of the channel's wire format.
            pub(super) const fn from_number(number: u8) -> Option<Kind> {
                match number { $($number => Some(Kind::$kind),)* _ => None }
            }
        }
    };
}

kinds! {
    /// Falling edge of a SYNC signal.
    Sync = 1, "sync", Registers;
    /// A frame on a bus.
    Frame = 2, "frame", Traffic;
    /// A change of `w_OPTION_STATUS`.
    State = 3, "state", Rare;
    /// A handshake register answered by the firmware.
    Handshake = 4, "handshake", Registers;
    /// A missed deadline.
    Missed = 5, "missed", Missed;
    /// A command without effect.
    Ignored = 6, "ignored", Rare;
    /// Refused initialization data.
    InitRefused = 7, "init_refused", Rare;
    /// A change of `a_STAT_SL`.
    SlaveStatus = 8, "slave_status", Rare;
    /// A node and its bus at different baud rates.
    BaudRateMismatch = 9, "baud_rate_mismatch", Rare;
    /// A register written through the channel.
    ChannelWrite = 10, "channel_write", Registers;
    /// A register changed by the firmware that is no handshake.
    Register = 11, "register", Registers;
    /// Something on the board of a PLC.
    Board = 20, "board", Rare;
    /// A register forced.
    Force = 30, "force", Rare;
    /// A forced register let go.
    Unforce = 31, "unforce", Rare;
    /// News of an injected fault.
    Fault = 21, "fault", Missed;
    /// What the access checker has found.
    Finding = 40, "finding", Rare;
}

impl Kind {
    /// The kind of that name.
    pub fn from_name(name: &str) -> Option<Kind> {
        Kind::ALL.iter().copied().find(|kind| kind.name() == name)
    }
}
