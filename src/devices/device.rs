//! Interface between a plant and a device: an image with its firmware, and the ports that connect the device to media.

use super::{Context, DriveDetails, Events, ParameterRefusal, Shaft, World};
use crate::fault::{Effect, Faults, Hit, Target};
use crate::journal::Journal;
use crate::layout::{self, DeviceFit};
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{Header, Segment, Width};
use crate::snapshot_fields::SnapshotFields;
use core::any::Any;

/// Cause that switches a device off or on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// Supply off.
    Off,
    /// Supply on.
    On,
    /// RESET held.
    HoldReset,
    /// RESET is released; the switch is then at STOP.
    ReleaseReset,
}

/// Result of polling a device's front: the action that the plant must take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// No action.
    Nothing,
    /// A switch was turned or a request answered; timers may have changed.
    Answered,
    /// RESET is held: the device stops.
    Held,
    /// The supply failed, with or without RESET: the device stops, and all parts with the same supply.
    Off,
    /// Power-on, or RESET was released: the device restarts.
    Up,
}

/// A device of a plant. Its ports are firmware of the medium that they belong to. The plant passes events of the device
/// to its ports, and events of the ports to the device. A device implements only the methods that it needs; a device
/// that has only a supply in its front is a [`Plain`](super::Plain) one.
pub trait Device: Any + Send + SnapshotFields {
    /// Its name in the plant.
    fn name(&self) -> &str;

    /// Its image.
    fn segment(&self) -> &Segment;

    /// Its registers.
    fn layout(&self) -> &'static layout::DeviceLayout;

    /// Returns the ports of the device as it is equipped: the modules of a modular device decide about them.
    fn fitted(&self) -> DeviceFit {
        DeviceFit::unknown(self.layout())
    }

    /// Whether `port` is a drive of its medium without registers in the device. Faults name it by its number on the
    /// medium.
    fn is_drive(&self, port: u8) -> bool {
        let _ = port;
        false
    }

    /// `port` is plugged in at a medium with this bit rate in bit/s; 0 if the medium has none. Called once, before the first start.
    fn plugged_in(&mut self, port: u8, bit_s: u32) {
        let _ = (port, bit_s);
    }

    /// The header page of its image.
    fn header(&self) -> &Header;

    /// State of the front.
    fn board(&self) -> BoardState {
        BoardState::of(self.header())
    }

    /// Turns a switch in the header page or enters a request, as a client does; the next poll sees it. Returns `false`
    /// if there is no such switch.
    fn turn(&self, setting: BoardSetting) -> bool;

    /// Why the device would not carry out this setting now: a command that its switches or its state do not allow. `None`: it
    /// would.
    fn refusal(&self, setting: BoardSetting) -> Option<&'static str> {
        let _ = setting;
        None
    }

    /// Switches supply or RESET, as a user does at the switch.
    fn set_power(&mut self, power: Power) -> Look;

    /// Polls switches and requests of the front once.
    fn look(&mut self, ctx: &mut Context) -> Look;

    /// Whether it has power and is not held in RESET.
    fn is_up(&self) -> bool;

    /// Power-on or end of a reset, before the ports follow.
    fn start(&mut self, ctx: &mut Context);

    /// Power-off or reset, before the ports follow.
    fn stop(&mut self, ctx: &mut Context);

    /// The supply has failed; called for the parts that run while RESET is active.
    fn supply_failed(&mut self) {}

    /// The number on its medium that `port` has from now on: that of the switches at the last start.
    fn address(&self, port: u8) -> u8 {
        let _ = port;
        0
    }

    /// Another station has the number of `port`, so the port is not connected.
    fn address_taken(&mut self, ctx: &mut Context, port: u8) {
        let _ = (ctx, port);
    }

    /// Called when `port` starts or stops taking part in the traffic of its medium.
    fn port_joined(&mut self, port: u8, takes_part: bool) {
        let _ = (port, takes_part);
    }

    /// Called after the firmware of `port` has polled its registers in a processor cycle at `now`. `last_frame` is the
    /// time of the last frame that the port sent or received since it joined, if the medium records that time.
    fn port_looked(&mut self, port: u8, last_frame: Option<u64>, now: u64) {
        let _ = (port, last_frame, now);
    }

    /// The ports with a SYNC signal that is passed on to another port of the device if the firmware there enables it:
    /// from, to.
    fn sync_ways(&self) -> &[(u8, u8)] {
        &[]
    }

    /// An edge of the SYNC signal at `port`; called after all other parts have seen it.
    fn sync_edge(&mut self, port: u8, now: u64) {
        let _ = (port, now);
    }

    /// Whether a client has turned a switch, put in a request or written a register that the firmware answers at once.
    /// For busy polling.
    fn has_changed(&self) -> bool {
        self.front_has_changed()
    }

    /// Whether a client has turned a switch or put in a request.
    fn front_has_changed(&self) -> bool;

    /// The processor cycle: polls the registers that belong to no port.
    fn processor_cycle(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// Whether the device is quiescent: the last poll and processor cycle found nothing to do, and the next ones will
    /// change nothing until a register is written or another event occurs, for example [`Device::due`]. The plant then
    /// skips them. When in doubt, returns false.
    fn is_quiescent(&self) -> bool {
        false
    }

    /// Whether polling the front and the registers and a processor cycle would change nothing now, at any time, for any
    /// origin of the present register contents. When in doubt, returns false.
    fn poll_changes_nothing(&self) -> bool {
        false
    }

    /// Next time at which the device itself has something to do; `u64::MAX` if there is none.
    fn next_time(&self) -> u64 {
        u64::MAX
    }

    /// Handles the event at `world.now`.
    fn due(&mut self, world: &mut World) {
        let _ = world;
    }

    /// Called when the set of active faults of the device has changed.
    fn faults_changed(&mut self, faults: &Faults) {
        let _ = faults;
    }

    /// Called when a fault of the device itself is active, at its begin or in a processor cycle: returns a hit if the
    /// fault fires by itself. Faults that fire on an action of the device are found during the action
    /// ([`World::faults`]).
    fn fire(&mut self, now: u64, target: Target, effect: &Effect) -> Option<Hit> {
        let _ = (now, target, effect);
        None
    }

    /// The drive that contains the device, if there is such a drive, with all its details.
    fn drive(&self) -> Option<DriveDetails> {
        None
    }

    /// Sets a parameter of that drive, as a user does at the drive itself.
    ///
    /// # Errors
    /// [`ParameterRefusal`].
    fn set_parameter(
        &mut self,
        number: u16,
        value: i64,
        now: u64,
        journal: &mut Journal,
    ) -> Result<(), ParameterRefusal> {
        let _ = (number, value, now, journal);
        Err(ParameterRefusal::NotThere)
    }

    /// Demanded and actual motion of the motor of that drive.
    fn shaft(&self) -> Option<Shaft> {
        None
    }

    /// Sets the speed of the motor of that drive independently of the drive's demand; `None`: the motor follows the
    /// drive.
    fn turn_shaft(&mut self, speed: Option<i32>, now: u64) {
        let _ = (speed, now);
    }

    /// Interrupt level of an event: a task of a higher level interrupts a task of a lower level. `None`: there is no
    /// such event.
    fn event_level(&self, event: usize) -> Option<u8> {
        let _ = event;
        None
    }

    /// Its interrupt events, if it has any.
    fn events(&mut self) -> Option<&mut Events> {
        None
    }

    /// Whether an access in the right area meets existing memory: the device may have fewer retain flags than fit.
    fn has(&self, offset: u32, width: Width) -> bool {
        let Some(retain) = self.layout().retain.filter(|retain| retain.area.contains(offset)) else {
            return true;
        };
        let bytes = self.header().retain_size.load();
        u64::from(offset) + u64::from(width.bytes()) <= u64::from(retain.area.first) + u64::from(bytes)
    }

    /// A client has written `bytes` bytes at `offset` by address.
    fn named(&self, offset: u32, bytes: u32) {
        let _ = (offset, bytes);
    }

    /// Whether the firmware answers a write at `offset` at once if it came through the channel, even if the value is
    /// unchanged.
    fn answers_write(&self, offset: u32) -> bool {
        let _ = offset;
        false
    }

    /// Handles a write that was announced by `named`.
    fn written(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// Contents of the NOVRAM, and a number that changes with them; empty if the device has none.
    fn novram(&self) -> (&[u8], u32) {
        (&[], 0)
    }

    /// Stores the contents of the NOVRAM registers, as at power-off.
    fn keep_novram(&mut self) {}

    /// The emulated time, for the header page.
    fn show_time(&self, now: u64) {
        self.header().virtual_time_us.store(now);
    }
}
