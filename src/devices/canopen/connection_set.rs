//! Identifiers of a node, by the predefined connection set.

use crate::can::Id;

/// True if the node with this node-ID, 1 to 127, sends frames with this identifier, by the predefined connection set
/// (CiA 301): emergency message, transmitted PDOs 1 to 4, SDO answer, error control.
#[must_use]
pub fn node_sends(node: u8, id: Id) -> bool {
    let Id::Standard(id) = id else { return false };
    let raw = id.as_raw();
    raw & 0x7F == u16::from(node)
        && matches!(raw & 0x780, 0x080 | 0x180 | 0x280 | 0x380 | 0x480 | 0x580 | 0x700)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::StandardId;

    #[test]
    fn a_node_sends_the_identifiers_of_its_connection_set() {
        let sent = (0..=0x7FF_u16).filter(|raw| node_sends(5, StandardId::new(*raw).unwrap().into()));
        assert_eq!(sent.collect::<Vec<_>>(), [0x085, 0x185, 0x285, 0x385, 0x485, 0x585, 0x705]);
    }
}
