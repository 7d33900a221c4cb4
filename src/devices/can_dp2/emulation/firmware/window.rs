//! The Communication Window. It executes one order at a time. A changed loop counter marks a new order (p.
//! 38-49).

use super::modules::WINDOW;
use crate::can::{ExtendedId, Frame, Id, Payload, StandardId};
use embedded_can::Frame as _;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Size of the FIFO in frames (p. 43).
const FIFO: usize = 255;

/// Value instead of an identifier while no frame is received (p. 41).
const NOTHING: u8 = 0xEE;

/// The bit of byte 2 that marks an identifier of 29 bits, as in the comment of a module (D-383).
const EXTENDED: u8 = 0x20;

/// Numbers of the commands of the window (p. 42).
mod command {
    pub(in crate::devices::can_dp2::emulation) const SEND: u8 = 1;
    pub(in crate::devices::can_dp2::emulation) const RECEIVE: u8 = 3;
    pub(in crate::devices::can_dp2::emulation) const ENABLE: u8 = 4;
    pub(in crate::devices::can_dp2::emulation) const DISABLE: u8 = 5;
    pub(in crate::devices::can_dp2::emulation) const REQUEST: u8 = 6;
    pub(in crate::devices::can_dp2::emulation) const ENABLE_AND_REQUEST: u8 = 7;
    pub(in crate::devices::can_dp2::emulation) const SYNC_TIME: u8 = 20;
}

/// Effect of an order on the gateway.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices::can_dp2::emulation) enum Order {
    /// The order has no further effect.
    Nothing,
    /// The gateway sends this frame on CAN.
    Send(Frame),
    /// Sets the SYNC time in ms (p. 42-44).
    SyncTime(u16),
}

/// The Communication Window of the gateway: a module through which the DP master sends and receives single frames.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) struct Window {
    #[serde(with = "crate::can::kept")]
    enabled: Vec<Id>,
    fifo: VecDeque<Frame>,
    /// Loop counter of the last order.
    counter: u8,
    /// True if command 3 waits for a frame.
    is_reading: bool,
    /// Octets that the DP master reads.
    shown: [u8; WINDOW],
    /// A frame that the window shows, but the DP master has not read yet: no data exchange has taken place
    /// since then.
    unread: Option<Frame>,
}

/// Returns the identifier in the first four bytes, low word first (p. 40).
fn identifier(bytes: [u8; 4]) -> Option<Id> {
    let [high, low, top, upper] = bytes;
    let number = u32::from_be_bytes([top & !EXTENDED, upper, high, low]);
    match (top & EXTENDED != 0, u16::try_from(number).ok().and_then(StandardId::new)) {
        (false, Some(id)) => Some(id.into()),
        _ => ExtendedId::new(number).map(Id::from),
    }
}

impl Window {
    /// Returns the enabled identifiers.
    pub(in crate::devices::can_dp2::emulation) fn enabled(&self) -> &[Id] {
        &self.enabled
    }

    /// Returns the number of waiting frames.
    pub(in crate::devices::can_dp2::emulation) fn waiting(&self) -> usize {
        self.fifo.len()
    }

    /// Returns the octets that the DP master reads.
    pub(in crate::devices::can_dp2::emulation) fn shown(&self) -> &[u8; WINDOW] {
        &self.shown
    }

    /// Queues a frame with an enabled identifier; returns `false` if the FIFO is full.
    pub(in crate::devices::can_dp2::emulation) fn received(&mut self, frame: Frame) -> bool {
        if self.fifo.len() >= FIFO {
            return false;
        }
        self.fifo.push_back(frame);
        self.show_next();
        true
    }

    /// Shows the next frame if command 3 waits for one.
    fn show_next(&mut self) {
        if !self.is_reading {
            return;
        }
        let Some(frame) = self.fifo.pop_front() else { return };
        self.is_reading = false;
        let [top, upper, high, low] = match frame.id() {
            Id::Standard(id) => u32::from(id.as_raw()).to_be_bytes(),
            Id::Extended(id) => id.as_raw().to_be_bytes(),
        };
        self.shown[..4].copy_from_slice(&[high, low, top, upper]);
        let data = frame.payload();
        self.shown[4..12].fill(0);
        self.shown[4..].iter_mut().zip(data.data()).for_each(|(to, from)| *to = *from);
        self.shown[12] = data.data().len() as u8;
        self.unread = Some(frame);
    }

    /// Handles the window that the DP master has written. A changed loop counter marks a new order (p. 42, 45-46;
    /// D-382).
    pub(in crate::devices::can_dp2::emulation) fn written(&mut self, window: &[u8; WINDOW]) -> Order {
        let &[id0, id1, id2, id3, d0, d1, d2, d3, d4, d5, d6, d7, length, counter, sub_command, command] =
            window;
        let unread = self.unread.take();
        if counter == self.counter {
            return Order::Nothing;
        }
        self.counter = counter;
        // The new order overwrites the window. Without this step, an unread frame would be lost (p. 43).
        unread.into_iter().for_each(|frame| self.fifo.push_front(frame));
        self.is_reading = false;
        self.shown = [0; WINDOW];
        (self.shown[0], self.shown[1]) = (NOTHING, NOTHING);
        (self.shown[13], self.shown[14]) = (counter, sub_command);
        let id = identifier([id0, id1, id2, id3]);
        let data = [d0, d1, d2, d3, d4, d5, d6, d7];
        let length = usize::from(length.min(8));
        let order = match (command, id) {
            (command::SEND, Some(id)) => Payload::new(&data[..length])
                .map_or(Order::Nothing, |payload| Order::Send(Frame::new(id, payload))),
            (command::RECEIVE, _) => {
                self.is_reading = true;
                Order::Nothing
            }
            (command::ENABLE, Some(id)) => {
                self.enable(id);
                Order::Nothing
            }
            (command::DISABLE, Some(id)) => {
                self.enabled.retain(|other| *other != id);
                Order::Nothing
            }
            (command::REQUEST, Some(id)) if self.enabled.contains(&id) => request(id, length),
            (command::ENABLE_AND_REQUEST, Some(id)) => {
                self.enable(id);
                request(id, length)
            }
            (command::SYNC_TIME, _) => Order::SyncTime(u16::from_be_bytes([d0, d1])),
            _ => Order::Nothing,
        };
        self.show_next();
        // The answer to this data exchange carries the frame, so the DP master reads it.
        self.unread = None;
        order
    }

    fn enable(&mut self, id: Id) {
        if !self.enabled.contains(&id) {
            self.enabled.push(id);
        }
    }
}

fn request(id: Id, length: usize) -> Order {
    Frame::remote(id, length).map_or(Order::Nothing, Order::Send)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(id: [u8; 4], data: [u8; 8], length: u8, counter: u8, command: u8) -> [u8; WINDOW] {
        let mut window = [0; WINDOW];
        window[..4].copy_from_slice(&id);
        window[4..12].copy_from_slice(&data);
        (window[12], window[13], window[15]) = (length, counter, command);
        window
    }

    fn frame(id: u16, data: &[u8]) -> Frame {
        Frame::standard(id, Payload::new(data).unwrap())
    }

    /// The examples of p. 46-49.
    #[test]
    fn examples_of_the_manual() {
        let mut window = Window::default();
        let sends = order([0, 0x12, 0, 0], [0, 1, 2, 3, 4, 5, 6, 7], 8, 1, 1);
        assert_eq!(window.written(&sends), Order::Send(frame(0x12, &[0, 1, 2, 3, 4, 5, 6, 7])));
        assert_eq!(window.shown()[13], 1);
        // If the counter has not changed, the window contains no new order.
        assert_eq!(window.written(&sends), Order::Nothing);

        let id = [0x01, 0x23, 0, 0];
        assert_eq!(window.written(&order(id, [0; 8], 0, 2, 4)), Order::Nothing);
        assert_eq!((window.enabled().len(), window.shown()[13]), (1, 2));
        window.written(&order(id, [0; 8], 0, 3, 3));
        assert_eq!((window.shown()[..2].to_vec(), window.shown()[13]), (vec![0xEE, 0xEE], 3));
        assert!(window.received(frame(0x123, &[0xAA, 0xBB, 0xCC, 0xDD, 0xEE, 0xFF, 0, 0x11])));
        let read = [0x01, 0x23, 0, 0, 0xAA, 0xBB, 0xCC, 0xDD, 0xEE, 0xFF, 0, 0x11, 8, 3, 0, 0];
        assert_eq!(window.shown(), &read);
        window.written(&order(id, [0; 8], 0, 4, 5));
        assert!(window.enabled().is_empty());
    }

    #[test]
    fn each_read_order_returns_one_frame() {
        let mut window = Window::default();
        for number in 0..300_u16 {
            assert_eq!(window.received(frame(number, &[])), number < 255);
        }
        assert_eq!(window.waiting(), 255);
        for number in 0..255_u16 {
            window.written(&order([0; 4], [0; 8], 0, window.counter.wrapping_add(1), 3));
            assert_eq!(window.shown()[..2], number.to_be_bytes());
        }
        window.written(&order([0; 4], [0; 8], 0, window.counter.wrapping_add(1), 3));
        assert_eq!(window.shown()[..2], [0xEE, 0xEE]);
    }

    /// Manual p. 43: no frame is lost if the PLC reads frames faster than they arrive, even if it gives other
    /// orders between the reads.
    #[test]
    fn an_unread_frame_is_not_lost() {
        let mut window = Window::default();
        let reads = |counter| order([0; 4], [0; 8], 0, counter, 3);
        window.written(&reads(1));
        assert!(window.received(frame(0x181, &[1])) && window.received(frame(0x181, &[2])));
        assert_eq!((window.shown()[4], window.waiting()), (1, 1));
        window.written(&order([0; 4], [0; 8], 0, 2, 0));
        assert_eq!((window.shown()[0], window.waiting()), (0xEE, 2), "the first frame is unread");
        window.written(&reads(3));
        assert_eq!((window.shown()[4], window.waiting()), (1, 1));
        window.written(&reads(4));
        assert_eq!((window.shown()[4], window.waiting()), (2, 0), "this frame came with an answer");
        // The next data exchange contains no new order, but returns the frame.
        window.written(&reads(5));
        assert!(window.received(frame(0x181, &[3])));
        window.written(&reads(5));
        window.written(&reads(6));
        assert_eq!((window.shown()[0], window.waiting()), (0xEE, 0));
    }

    #[test]
    fn requests_and_sync_times() {
        let mut window = Window::default();
        let id = [0x01, 0x23, 0, 0];
        let remote = Order::Send(Frame::remote(StandardId::new(0x123).unwrap(), 2).unwrap());
        assert_eq!(window.written(&order(id, [0; 8], 2, 1, 6)), Order::Nothing, "not enabled");
        assert_eq!(window.written(&order(id, [0; 8], 2, 2, 7)), remote);
        assert_eq!(window.written(&order(id, [0; 8], 2, 3, 6)), remote);
        let time = order([0; 4], [2, 0, 0, 0, 0, 0, 0, 0], 0, 4, 20);
        assert_eq!(window.written(&time), Order::SyncTime(512));
        assert_eq!((window.written(&order(id, [0; 8], 2, 5, 11)), window.shown()[13]), (Order::Nothing, 5));
    }

    #[test]
    fn identifiers_of_29_bits() {
        let of = |bytes| match identifier(bytes) {
            Some(Id::Extended(id)) => Some((true, id.as_raw())),
            Some(Id::Standard(id)) => Some((false, id.as_raw().into())),
            None => None,
        };
        assert_eq!(of([0x56, 0x78, 0x12, 0x34]), Some((true, 0x1234_5678)));
        assert_eq!(of([0x01, 0x23, 0x20, 0]), Some((true, 0x123)));
        assert_eq!(of([0x08, 0, 0, 0]), Some((true, 0x800)));
        assert_eq!((of([7, 0xFF, 0, 0]), of([0, 0, 0x40, 0])), (Some((false, 0x7FF)), None));
    }
}
