//! Sends frames and telegrams of any content to the nodes of a plant of any device, with any register
//! contents. No plant panics, and each plant still runs after it was switched off and on.

use super::*;
use crate::can::{ExtendedId, Frame, Payload, StandardId};
use crate::devices;
use crate::door::BusMessage;
use crate::identity::{BusIndex, DeviceIndex};
use crate::memory::header::{BoardSetting, Power, RunSwitch};
use crate::memory::{Segment, Width};

/// Returns a telegram of a guest for a bus. Half of these telegrams are of a kind that the bus cannot use and
/// refuses.
fn message_of(head: u8, bytes: &[u8]) -> Option<BusMessage> {
    let [low, high, data @ ..] = bytes else { return None };
    let number = u16::from_le_bytes([*low, *high]);
    if head & 0x08 != 0 {
        return Some(BusMessage::burst(bytes.to_vec()));
    }
    let data = &data[..data.len().min(8)];
    let id = StandardId::new(number & 0x7FF)?;
    let long = ExtendedId::new(u32::from(number) << 8)?;
    Some(BusMessage::Frame(match high >> 6 {
        0 | 1 => Frame::new(id, Payload::new(data)?),
        2 => Frame::remote(id, data.len())?,
        _ => Frame::new(long, Payload::new(data)?),
    }))
}

/// Executes an action, which consists of a byte for its kind, the number of its bytes, and these bytes.
fn act(plant: &mut Plant, head: u8, bytes: &[u8]) {
    match head & 7 {
        0..=3 => {
            let bus = BusIndex::at(usize::from(head >> 4) % plant.named_buses.max(1));
            if let Some(message) = message_of(head, bytes) {
                // A bus refuses frames that it cannot carry, and frames for which its queues are full.
                let _refused = plant.guest_sends(bus, 1, &message);
            }
            plant.advance_to(plant.now() + 1_000);
        }
        4 | 5 => {
            let [low, middle, high, value @ ..] = bytes else { return };
            let plc = usize::from(head >> 4) % plant.devices().len();
            let offset = u32::from_le_bytes([*low, *middle, *high, 0]);
            let value = value.iter().take(4).rev().fold(0, |value, byte| (value << 8) | u32::from(*byte));
            for (width, value) in
                [(Width::Byte, value & 0xFF), (Width::Word, value & 0xFFFF), (Width::Dword, value)]
            {
                // If the offset is that of a register, one of the widths that are tried is the register's
                // width.
                let _unmapped = plant.store(DeviceIndex::at(plc), offset, width, value);
            }
        }
        6 => plant.advance_to(plant.now() + 10_000),
        _ => plant.advance_to(plant.now() + u64::from(head >> 3)),
    }
}

#[test]
fn fuzz_node_frames() {
    let texts: Vec<_> = devices::all().iter().filter_map(|known| known.emulation.template).collect();
    crate::fuzz("node_frames", |bytes| {
        let Some((which, mut rest)) = bytes.split_first() else { return };
        let config = PlantConfig::parse("plant", texts[usize::from(*which) % texts.len()]).unwrap();
        let segment = |_: &str, device| Ok::<_, Box<dyn core::error::Error>>(Segment::of(device));
        let mut plant = Plant::new(&config, segment).unwrap();
        plant.advance_to(3_000);
        for bus in BusIndex::first(plant.named_buses) {
            plant.guest_joins(bus, 1, true);
        }
        // More rounds would make the test too slow.
        for _ in 0..200 {
            let [head, len, following @ ..] = rest else { break };
            let (bytes, following) = following.split_at(usize::from(*len).min(following.len()));
            act(&mut plant, *head, bytes);
            rest = following;
        }
        for plc in 0..plant.devices().len() {
            for setting in [
                BoardSetting::Switch(RunSwitch::Run),
                BoardSetting::Power(Power::On),
                BoardSetting::PowerCycle,
            ] {
                plant.set_board(DeviceIndex::at(plc), setting);
            }
        }
        plant.advance_to(plant.now() + 20_000);
    });
}
