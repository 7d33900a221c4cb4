//! Times, repetitions and limits of a partner.

/// The partner that gives way if both request the connection at the same time. The partners have different priorities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Priority {
    /// The partner gives way, and sends its block afterwards.
    Low,
    /// The partner keeps its request.
    High,
}

/// Settings of a partner. Times are in microseconds. The defaults are those of the CP 341 manual.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Priority in a conflict.
    pub priority: Priority,
    /// Time of a character on the line, from its start bit to its stop bit.
    pub character_time: u64,
    /// True for 3964R, with `BCC`; false for 3964.
    pub check_sum: bool,
    /// Longest time between two characters of a block (ZVZ).
    pub character_delay: u64,
    /// Longest time from `STX` or the end of the block to the answer (QVZ).
    pub acknowledgement_delay: u64,
    /// Longest time from `NAK` to the repetition of a block.
    pub block_wait: u64,
    /// Time during which a request waits for a free buffer.
    pub buffer_wait: u64,
    /// Number of requests for a connection, 1 to 255.
    pub connection_attempts: u8,
    /// Number of transmissions of a block, 1 to 255.
    pub transmission_attempts: u8,
    /// Number of octets of the longest block.
    pub longest_block: usize,
    /// Number of received blocks that wait for [`next_event`](super::Procedure::next_event), at least 1.
    pub receive_buffers: usize,
}

impl Settings {
    /// Returns the defaults of 3964R. `character_time` is the time of a character, in microseconds.
    #[must_use]
    pub const fn new(priority: Priority, character_time: u64) -> Self {
        Settings {
            priority,
            character_time,
            check_sum: true,
            character_delay: 220_000,
            acknowledgement_delay: 2_000_000,
            block_wait: 4_000_000,
            buffer_wait: 400_000,
            connection_attempts: 6,
            transmission_attempts: 6,
            longest_block: 1024,
            receive_buffers: 1,
        }
    }

    /// Returns the defaults of 3964, the procedure without check sum.
    #[must_use]
    pub const fn without_check_sum(priority: Priority, character_time: u64) -> Self {
        Settings {
            check_sum: false,
            acknowledgement_delay: 550_000,
            ..Settings::new(priority, character_time)
        }
    }
}
