//! Interface between a plant and a device. A device consists of an image with its firmware, and of ports that
//! connect it to buses.

use crate::devices::{
    AddressWrites, Context, DevicePorts, DeviceView, Drives, Events, Faulty, FileChanges, Front,
    NovramContents, OptionCard, OptionSlots, World,
};
use crate::memory::Width;
use crate::memory::header::BoardState;
use crate::snapshot_fields::SnapshotFields;
use core::any::Any;

/// A device of a plant. The bus of a port runs the firmware of the port. The plant passes events of the
/// device to its ports, and events of the ports to the device. Functions for features that only some devices
/// have return `None` by default: parts for the ports, events, a drive, NOVRAM, faults. A device with only a
/// supply in its front panel can use [`Plain`](crate::devices::Plain).
pub trait Device: DeviceView + Front + Any + Send + SnapshotFields {
    /// Called at power-on and at the end of a reset, before the ports start.
    fn start(&mut self, ctx: &mut Context);

    /// Called at power-off and at a reset, before the ports stop.
    fn stop(&mut self, ctx: &mut Context);

    /// True if a client has turned a switch, made a request, or written a register that the firmware answers
    /// immediately. The emulator uses this function for busy polling, which has no pause between two polls.
    fn has_changed(&self) -> bool {
        self.front_has_changed()
    }

    /// Runs a processor cycle: polls the registers that do not belong to a port.
    fn processor_cycle(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// True if the device is quiescent. This means that the last poll and processor cycle changed nothing,
    /// and further ones will change nothing until a register is written or another event occurs, for example
    /// [`Device::due`]. The plant then skips polls and cycles. When in doubt, returns false.
    fn is_quiescent(&self) -> bool {
        false
    }

    /// True if the device needs its next processor cycle even if no register is written and its front panel
    /// does not change. If false, the plant may skip cycles when it advances over several cycles at once.
    fn needs_each_cycle(&self) -> bool {
        false
    }

    /// True if a poll of the front panel and a processor cycle would change nothing with the present register
    /// contents. This must be true at any time, no matter who has written the registers. When in doubt,
    /// returns false.
    fn poll_changes_nothing(&self) -> bool {
        false
    }

    /// Returns the time of the next event of the device itself; `u64::MAX` if there is none.
    fn next_time(&self) -> u64 {
        u64::MAX
    }

    /// Handles the event at `world.now`.
    fn due(&mut self, world: &mut World) {
        let _ = world;
    }

    /// Returns the interrupt events of the device; `None` if it has no events.
    fn events(&mut self) -> Option<&mut Events> {
        None
    }

    /// Returns the part of the device that takes part in events of its ports, if it has such a part.
    fn ports(&mut self) -> Option<&mut dyn DevicePorts> {
        None
    }

    /// Returns the drive that contains the device, if there is such a drive. The list then has only this drive.
    fn drives(&self) -> Option<&dyn Drives> {
        None
    }

    /// Returns the same as [`Device::drives`], mutable. It is used to change the drive.
    fn drives_mut(&mut self) -> Option<&mut dyn Drives> {
        None
    }

    /// Returns the NOVRAM of the device; `None` if it has no NOVRAM.
    fn novram(&self) -> Option<&dyn NovramContents> {
        None
    }

    /// Returns the same as [`Device::novram`], mutable. It is used to store the registers.
    fn novram_mut(&mut self) -> Option<&mut dyn NovramContents> {
        None
    }

    /// Returns the part that answers writes by address, if the device has such a part.
    fn address_writes(&mut self) -> Option<&mut dyn AddressWrites> {
        None
    }

    /// Returns the part that takes over changed files of the device. `None` if the device is not described by
    /// files that may change.
    fn file_changes(&mut self) -> Option<&mut dyn FileChanges> {
        None
    }

    /// Returns the slots of the device for option cards; `None` if it has no slots.
    fn option_slots(&mut self) -> Option<&mut dyn OptionSlots> {
        None
    }

    /// Returns the part that exchanges pulses with a controller. `None` if the device cannot be an option
    /// card.
    fn option_card(&mut self) -> Option<&mut dyn OptionCard> {
        None
    }

    /// Returns the part that applies the faults of the device itself. `None` if the device can have no
    /// faults.
    fn faults(&mut self) -> Option<&mut dyn Faulty> {
        None
    }
}

impl dyn Device {
    /// Returns the state of the front panel.
    pub fn board(&self) -> BoardState {
        BoardState::of(self.header())
    }

    /// True if memory exists for an access in an existing area. The area of retain flags may be larger than
    /// the number of retain flags that the device has.
    pub fn has(&self, offset: u32, width: Width) -> bool {
        let Some(retain) = self.layout().retain.filter(|retain| retain.area.contains(offset)) else {
            return true;
        };
        let bytes = self.header().retain_size.load();
        u64::from(offset) + u64::from(width.bytes()) <= u64::from(retain.area.first) + u64::from(bytes)
    }

    /// Stores the emulated time in the header page.
    pub fn show_time(&self, now: u64) {
        self.header().virtual_time_us.store(now);
    }

    /// Returns the device as a `T`; `None` if it has another type.
    pub fn as_a<T: Device>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }
}
