//! Reference for tests: frames bit by bit, as the standard describes them, and random frames.

use super::{Frame, Payload};
use embedded_can::{ExtendedId, Frame as _, Id, StandardId};
use proptest::prelude::*;

/// Adds `count` bits of `value`, beginning with bit `count - 1`.
fn push(bits: &mut Vec<bool>, value: u32, count: u32) {
    bits.extend((0..count).rev().map(|i| value >> i & 1 != 0));
}

/// Returns the arbitration field, without the start bit.
fn arbitration_field(frame: &Frame) -> Vec<bool> {
    let mut bits = Vec::new();
    match frame.id() {
        Id::Standard(id) => {
            push(&mut bits, id.as_raw().into(), 11);
            bits.extend([frame.is_remote_frame(), false]);
        }
        Id::Extended(id) => {
            push(&mut bits, id.as_raw() >> 18, 11);
            bits.extend([true, true]);
            push(&mut bits, id.as_raw(), 18);
            bits.push(frame.is_remote_frame());
        }
    }
    bits
}

/// Returns the bits from the start bit to the end of the CRC, without stuff bits.
pub(super) fn stuffed_part(frame: &Frame) -> Vec<bool> {
    let mut bits = vec![false];
    bits.extend(arbitration_field(frame));
    bits.extend(vec![false; if frame.is_extended() { 2 } else { 1 }]);
    push(&mut bits, frame.dlc() as u32, 4);
    for &byte in frame.data() {
        push(&mut bits, byte.into(), 8);
    }
    let mut crc = 0u16;
    for &bit in &bits {
        let feedback = bit != (crc & 0x4000 != 0);
        crc = crc << 1 & 0x7FFF;
        if feedback {
            crc ^= 0x4599;
        }
    }
    push(&mut bits, crc.into(), 15);
    bits
}

/// Returns the bits of a frame on the wire, with stuff bits.
fn with_stuff_bits(frame: &Frame) -> Vec<bool> {
    let (mut sent, mut last, mut run) = (Vec::new(), true, 0);
    for bit in stuffed_part(frame) {
        run = if bit == last { run + 1 } else { 1 };
        last = bit;
        sent.push(bit);
        if run == 5 {
            sent.push(!bit);
            last = !bit;
            run = 1;
        }
    }
    sent
}

/// Returns the number of stuff bits.
pub(super) fn stuff_bits(frame: &Frame) -> u32 {
    (with_stuff_bits(frame).len() - stuffed_part(frame).len()) as u32
}

/// Returns the winner if all of these frames begin at once: each station withdraws where it sends a 1 and sees a 0. If
/// several frames have equal arbitration fields, the first of them wins.
pub(super) fn winner(frames: &[Frame]) -> Option<usize> {
    let fields: Vec<_> = frames.iter().map(arbitration_field).collect();
    let mut sending: Vec<_> = (0..frames.len()).collect();
    for place in 0..32 {
        // A standard frame's arbitration field ends with a dominant IDE. From the next bit on, no other frame
        // can win against this frame, so a missing bit counts as dominant.
        let bit = |participant: usize| fields[participant].get(place).copied().unwrap_or(false);
        let wire = sending.iter().all(|&participant| bit(participant));
        sending.retain(|&participant| bit(participant) == wire);
    }
    sending.first().copied()
}

/// Strategy for any identifier. The identifiers often have many bits in common.
pub(super) fn id() -> impl Strategy<Value = Id> + Clone {
    let standard = |id| StandardId::new(id).map(Id::Standard);
    let extended = |id| ExtendedId::new(id).map(Id::Extended);
    prop_oneof![
        (0u16..0x800).prop_filter_map("11 bits", standard),
        (0u32..0x2000_0000).prop_filter_map("29 bits", extended),
        (0x120u16..0x124).prop_filter_map("11 bits", standard),
        ((0x120u32..0x124), 0u32..4)
            .prop_filter_map("29 bits", move |(base, rest)| extended(base << 18 | rest)),
    ]
}

/// Any identifier, of a data or a remote frame.
pub(super) fn arbitration() -> impl Strategy<Value = (Id, bool)> + Clone {
    (id(), any::<bool>())
}

/// Returns random data bytes, or long runs of equal bits.
fn bytes() -> impl Strategy<Value = [u8; 8]> {
    let runs = prop::collection::vec(1u32..9, 64).prop_map(|runs| {
        let (mut data, mut used) = (0u64, 0);
        for (index, run) in runs.into_iter().enumerate() {
            for _ in 0..run.min(64 - used) {
                data = data << 1 | index as u64 & 1;
                used += 1;
            }
        }
        data.to_be_bytes()
    });
    prop_oneof![any::<[u8; 8]>(), runs]
}

/// Any frame.
pub(crate) fn frame() -> impl Strategy<Value = Frame> {
    (arbitration(), bytes(), 0usize..=8).prop_filter_map(
        "a length up to 8",
        |((id, is_remote), bytes, len)| {
            if is_remote {
                Frame::remote(id, len)
            } else {
                Some(Frame::new(id, Payload::from_padded(bytes, len)))
            }
        },
    )
}
