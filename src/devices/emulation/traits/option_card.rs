//! Pulses between a controller and the option cards in its slots.

use crate::devices::Context;

/// Pulses that a controller sends to its option cards at one moment of emulated time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ControllerPulses {
    /// Pulses of trigger 1 and trigger 2.
    pub triggers: [bool; 2],
    /// An edge of the SYNC signal of the network.
    pub sync_net: bool,
}

/// Pulses that an option card sends to its controller at one moment of emulated time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CardPulses {
    /// Interrupt of the card.
    pub interrupt: bool,
    /// SYNC signal of the card.
    pub sync: bool,
}

/// A controller with slots for option cards ([`Device::option_slots`](crate::devices::Device::option_slots)).
/// The plant passes pulses on at the moment at which they occur. So there are no waiting pulses when a
/// snapshot is taken.
pub trait OptionSlots {
    /// Returns the pulses since the last call.
    fn take_pulses(&mut self) -> ControllerPulses;

    /// Handles the pulses of the card in slot `slot`, counted from 1.
    fn card_pulses(&mut self, slot: u8, pulses: CardPulses, now: u64);
}

/// A device that can be the option card of a controller ([`Device::option_card`](crate::devices::Device::option_card)).
pub trait OptionCard {
    /// Returns the pulses since the last call.
    fn take_pulses(&mut self) -> CardPulses;

    /// Handles an edge of the SYNC signal of the controller's network.
    fn sync_edge(&mut self, ctx: &mut Context);

    /// Handles a pulse of the trigger that is connected to the card.
    fn trigger(&mut self, ctx: &mut Context);
}
