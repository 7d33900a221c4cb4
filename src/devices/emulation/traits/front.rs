//! The front panel of a device: supply, RESET, switches and requests of the header page.

use crate::devices::Context;
use crate::memory::header::BoardSetting;

/// Change of the supply or of RESET of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// The supply is switched off.
    Off,
    /// The supply is switched on.
    On,
    /// RESET is pressed and held.
    HoldReset,
    /// RESET is released. The switch is then at STOP.
    ReleaseReset,
}

/// Result of a poll of a device's front panel: the action that the plant must take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrontAction {
    /// The setting needs no action.
    Nothing,
    /// A switch was turned or a request was answered. Timers may have changed.
    Answered,
    /// RESET is held: the device stops.
    Held,
    /// The supply has failed, with or without RESET. The device and all parts with the same supply stop.
    Off,
    /// Power-on, or RESET was released: the device restarts.
    Up,
}

/// The front panel of a device: supply, RESET and switches.
pub trait Front {
    /// Turns a switch in the header page or makes a request there, as a client does. The next poll handles
    /// it. Returns `false` if the device has no such switch.
    fn turn(&self, setting: BoardSetting) -> bool;

    /// Returns the reason why the device would refuse this setting now, because of its switches or its state.
    /// `None` if the device would accept the setting.
    fn refusal(&self, setting: BoardSetting) -> Option<&'static str> {
        let _ = setting;
        None
    }

    /// Switches supply or RESET, as a user does at the switch.
    fn set_power(&mut self, power: Power) -> FrontAction;

    /// Polls switches and requests of the front panel once.
    fn look(&mut self, ctx: &mut Context) -> FrontAction;

    /// True if a client has turned a switch or made a request since the last poll.
    fn front_has_changed(&self) -> bool;

    /// True if the device has power and is not held in RESET.
    fn is_up(&self) -> bool;

    /// Called when the supply has failed. Parts that run even while RESET is active stop only now.
    fn supply_failed(&mut self) {}
}
