//! Option cards of a plant: their registers are placed in the memory of their controllers.

use super::{PlantConfig, PlantError};
use crate::devices::folder::in_slot::{self, CardAt};
use crate::devices::{self, BuildError, CardPlace, DeviceConfig, OptionInterface};
use crate::identity::DeviceIndex;

/// Returns the interface of a card; `Ok(None)` if the slot does not exist or no interface has registers.
///
/// # Errors
/// The slot has no such interface; the error is a line of text.
fn interface_of(
    controller: &dyn DeviceConfig,
    place: &CardPlace<'_>,
) -> Result<Option<OptionInterface>, String> {
    let known = devices::of_hash(controller.layout().layout_hash);
    let all = known.map_or(&[][..], |known| known.emulation.option_interfaces);
    let mut of_slot = all.iter().filter(|it| it.slot == place.slot).copied();
    let Some(number) = place.interface else { return Ok(of_slot.next()) };
    if let Some(found) = of_slot.clone().find(|it| it.number == number) {
        return Ok(Some(found));
    }
    let right: Vec<_> = of_slot.map(|it| it.number.to_string()).collect();
    if right.is_empty() {
        return Ok(None);
    }
    let (name, slot) = (controller.name(), place.slot);
    Err(format!("slot {slot} of '{name}' has no option interface {number}; use {}", right.join(" or ")))
}

/// Returns the error of a card that does not fit into the memory of its controller.
fn refused(card: &str, reason: &str) -> PlantError {
    BuildError::own(card, "card", format!("'{card}': {reason}")).into()
}

impl PlantConfig {
    /// Gives controllers with option cards a layout with the registers of the cards, and the cards a layout without them.
    /// Wrong slots and controllers are left to the checks of the plant.
    ///
    /// # Errors
    /// [`PlantError`]: a card does not fit into the memory of its controller.
    pub(super) fn place_cards(&mut self) -> Result<(), PlantError> {
        let all_cards = self.cards();
        if all_cards.is_empty() {
            return Ok(());
        }
        for at in 0..self.devices.len() {
            let cards = self.cards_of(&*self.devices[at], &all_cards)?;
            if cards.is_empty() {
                continue;
            }
            let Some(controller) = devices::of_hash(self.devices[at].layout().layout_hash) else { continue };
            let places: Vec<CardAt> =
                cards.iter().map(|(interface, card)| (*interface, self.devices[*card].layout())).collect();
            let composed = in_slot::with_cards(controller, &places).map_err(|(index, reason)| {
                let card = cards.get(index).map_or(at, |(_, card)| *card);
                refused(self.devices[card].name(), &reason)
            })?;
            let Some(device) = self.devices[at].with_layout(composed.layout) else { continue };
            for (_, card) in cards {
                let face = in_slot::face_of(self.devices[card].layout())
                    .map_err(|reason| refused(self.devices[card].name(), &reason))?;
                if let Some(device) = self.devices[card].with_layout(face) {
                    self.devices[card] = device;
                }
            }
            self.devices[at] = device;
        }
        Ok(())
    }

    /// Returns the indices of all option cards. A large plant has thousands of controllers, and few cards or none.
    fn cards(&self) -> Vec<usize> {
        let devices = self.devices.iter().enumerate();
        devices.filter(|(_, device)| device.card_place().is_some()).map(|(index, _)| index).collect()
    }

    /// Returns the cards of a controller, out of all cards of the plant, in the order of their interfaces. Each has its
    /// index in the plant. An interface has one card.
    fn cards_of(
        &self,
        controller: &dyn DeviceConfig,
        all_cards: &[usize],
    ) -> Result<Vec<(OptionInterface, usize)>, PlantError> {
        let mut cards: Vec<(OptionInterface, usize)> = Vec::new();
        for &index in all_cards {
            let device = &self.devices[index];
            let Some(place) = device.card_place().filter(|place| place.controller == controller.name())
            else {
                continue;
            };
            let interface = interface_of(controller, &place).map_err(|reason| {
                let name = device.name();
                BuildError::own(name, "interface", format!("'{name}': {reason}"))
            })?;
            let Some(interface) = interface else { continue };
            if cards.iter().all(|(other, _)| *other != interface) {
                cards.push((interface, index));
            }
        }
        cards.sort_by_key(|(interface, _)| interface.first);
        Ok(cards)
    }

    /// Returns the controller of an option card, and its option interface. `None` if the card has its registers in its own
    /// image.
    pub(in crate::plant) fn card_place(
        &self,
        card: &dyn DeviceConfig,
    ) -> Option<(DeviceIndex, OptionInterface)> {
        let place = card.card_place()?;
        let controller = self.devices.iter().position(|device| device.name() == place.controller)?;
        let interface = interface_of(&*self.devices[controller], &place).ok()??;
        Some((DeviceIndex::at(controller), interface))
    }

    /// Returns a line for each controller with registers of option cards, for clients of the instance.
    pub(crate) fn lines_of_controllers(&self) -> Vec<String> {
        let all_cards = self.cards();
        let line = |controller: &dyn DeviceConfig| {
            let cards = self.cards_of(controller, &all_cards).ok()?;
            let folders = cards
                .iter()
                .filter_map(|(interface, card)| Some((interface.number, self.devices[*card].folder()?)));
            (!cards.is_empty()).then(|| in_slot::line(controller.layout().name, folders))
        };
        self.devices.iter().filter_map(|device| line(&**device)).collect()
    }
}
