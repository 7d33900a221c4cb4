//! Frames that a device sends as master of the network (p. 52-85).

use super::Node;
use crate::can::Frame;
use crate::devices::canopen::nmt::Command;
use crate::devices::canopen::sdo::Data;
use embedded_can::StandardId;

/// First identifier of requests to SDO servers, from the predefined connection set (p. 38).
const SDO_REQUEST: u16 = 0x600;

impl Node {
    /// Sends a frame to `node`; the identifiers of its kind begin at `first`.
    pub(crate) fn send_to(&mut self, first: u16, node: u8, data: &[u8]) {
        if let Some(id) = StandardId::new(first + u16::from(node)) {
            self.send(id, data);
        }
    }

    /// Sends an SDO to the server of `node`.
    pub(crate) fn send_sdo(&mut self, node: u8, request: Data) {
        self.send_to(SDO_REQUEST, node, &request);
    }

    /// Sends a remote frame.
    pub(crate) fn ask(&mut self, id: u16) {
        self.out.extend(StandardId::new(id).and_then(|id| Frame::remote(id, 1)));
    }

    /// Sends a network management command to `node`, or to all nodes if it is 0.
    pub(crate) fn send_command(&mut self, command: Command, node: u8) {
        self.send(StandardId::ZERO, &[command.code(), node]);
    }

    /// Sends a SYNC object. The device also evaluates this object itself. Returns `false` if SYNC has no
    /// identifier.
    pub(crate) fn send_sync(&mut self, now: u64) -> bool {
        let Some(id) = self.identifiers.sync else { return false };
        self.send(id, &[]);
        self.sync_has_come(now);
        true
    }

    /// Sets whether the node receives all frames, as a master must, or only the frames for this node.
    pub(crate) fn set_open(&mut self, is_open: bool) {
        self.is_open = is_open;
        self.has_moved = true;
    }
}
