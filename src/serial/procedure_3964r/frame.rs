//! The characters of a block.

/// Requests the connection.
pub const STX: u8 = 0x02;
/// Ends a block, after [`DLE`].
pub const ETX: u8 = 0x03;
/// Grants the connection, acknowledges a block, and precedes 16#10 and [`ETX`] in a block.
pub const DLE: u8 = 0x10;
/// Refuses a connection or a block.
pub const NAK: u8 = 0x15;

/// Returns the characters of a block after the connection: its octets with doubled 16#10, `DLE`, `ETX`, and `BCC` if
/// `check_sum` is true.
#[must_use]
pub fn frame(block: &[u8], check_sum: bool) -> Vec<u8> {
    let mut characters = Vec::with_capacity(block.len() + 3);
    for &octet in block {
        characters.push(octet);
        if octet == DLE {
            characters.push(DLE);
        }
    }
    characters.extend([DLE, ETX]);
    if check_sum {
        let sum = characters.iter().fold(0, |sum, character| sum ^ character);
        characters.push(sum);
    }
    characters
}
