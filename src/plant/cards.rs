//! Pulses between controllers and their option cards.

use super::Plant;
use crate::devices::{Context, DeviceConfig};
use crate::identity::DeviceIndex;
use crate::journal::Origin;
use std::sync::Arc;

/// An option card in a slot of a controller.
#[derive(Clone, Copy, Debug)]
pub(super) struct PluggedCard {
    card: DeviceIndex,
    controller: DeviceIndex,
    /// Number of the slot, from 1.
    slot: u8,
    /// Index of the trigger that is connected to the card.
    trigger: usize,
}

/// Returns the option cards of a plant file. The plant file must have been checked.
pub(super) fn plug_in(devices: &[Arc<dyn DeviceConfig>]) -> Arc<[PluggedCard]> {
    let card = |(card, device): (DeviceIndex, &Arc<dyn DeviceConfig>)| {
        let place = device.card_place()?;
        let controller = devices.iter().position(|device| device.name() == place.controller)?;
        let controller = DeviceIndex::at(controller);
        let trigger = usize::from(place.trigger.saturating_sub(1));
        Some(PluggedCard { card, controller, slot: place.slot, trigger })
    };
    DeviceIndex::enumerate(devices).filter_map(card).collect()
}

impl Plant {
    /// Passes on the signals that devices have sent at this moment: pulses between controllers and cards, and
    /// orders for ports. Returns true if there were pulses.
    pub(super) fn pass_signals(&mut self) -> bool {
        let has_passed = self.pass_card_pulses();
        self.pass_orders();
        has_passed
    }

    /// Passes pulses on until no device sends further pulses at this moment. Cards without power get no
    /// pulses. Returns true if there were pulses.
    fn pass_card_pulses(&mut self) -> bool {
        if self.cards.is_empty() {
            return false;
        }
        let cards = Arc::clone(&self.cards);
        let mut has_passed = false;
        // The loop ends even if a card answers each of its own pulses: the script of a card may take a
        // limited number of steps.
        while self.pass_pulses(&cards) {
            has_passed = true;
        }
        has_passed
    }

    /// Passes the waiting pulses once in both directions. Returns true if there were any.
    fn pass_pulses(&mut self, cards: &[PluggedCard]) -> bool {
        let Plant { now, devices, journal, .. } = self;
        let mut has_passed = false;
        for &PluggedCard { card, controller, slot, .. } in cards {
            let pulses = devices[card.index()].option_card().map(|card| card.take_pulses());
            let Some(pulses) = pulses.filter(|pulses| pulses.interrupt || pulses.sync) else { continue };
            has_passed = true;
            let controller = &mut devices[controller.index()];
            if controller.is_up()
                && let Some(slots) = controller.option_slots()
            {
                slots.card_pulses(slot, pulses, *now);
            }
        }
        // All cards of a controller get its pulses. Taking the pulses deletes them, so they are taken once
        // for each controller.
        let mut taken = Vec::new();
        for &PluggedCard { controller, .. } in cards {
            if taken.iter().all(|(known, _)| *known != controller)
                && let Some(slots) = devices[controller.index()].option_slots()
            {
                taken.push((controller, slots.take_pulses()));
            }
        }
        for &PluggedCard { card: index, controller, trigger, .. } in cards {
            let Some((_, pulses)) = taken.iter().find(|(known, _)| *known == controller) else { continue };
            let is_triggered = pulses.triggers.get(trigger).is_some_and(|is_pulsed| *is_pulsed);
            let device = &mut devices[index.index()];
            if !(is_triggered || pulses.sync_net) || !device.is_up() {
                continue;
            }
            let Some(card) = device.option_card() else { continue };
            has_passed = true;
            let mut ctx = Context { now: *now, journal, origin: Origin::of_device(index), base: 0 };
            if pulses.sync_net {
                card.sync_edge(&mut ctx);
            }
            if is_triggered {
                card.trigger(&mut ctx);
            }
        }
        has_passed
    }
}
