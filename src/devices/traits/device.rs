//! Interface between a plant and a device: an image with its firmware, and the ports that connect the device to buses.

use crate::devices::{
    AddressWrites, Context, DevicePorts, DeviceView, Drives, Events, Faulty, FileChanges, Front,
    NovramContents, OptionCard, OptionSlots, World, faults_of_device,
};
use crate::fault::FaultKind;
use crate::memory::Width;
use crate::memory::header::BoardState;
use crate::snapshot_fields::SnapshotFields;
use core::any::Any;

/// A device of a plant. The bus of a port runs the firmware of the port. The plant passes events of the device to its
/// ports, and events of the ports to the device. Features that only some devices have are optional methods: parts for
/// the ports, events, a drive, NOVRAM, faults. A device with only a supply in its front panel can use
/// [`Plain`](crate::devices::Plain).
pub trait Device: DeviceView + Front + Any + Send + SnapshotFields {
    /// Called at power-on and at the end of a reset, before the ports start.
    fn start(&mut self, ctx: &mut Context);

    /// Called at power-off and at a reset, before the ports stop.
    fn stop(&mut self, ctx: &mut Context);

    /// True if a client has turned a switch, made a request, or written a register that the firmware answers
    /// immediately. Used for busy polling.
    fn has_changed(&self) -> bool {
        self.front_has_changed()
    }

    /// Runs a processor cycle: polls the registers that belong to no port.
    fn processor_cycle(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// True if the device is quiescent: the last poll and processor cycle changed nothing, and the next ones will
    /// change nothing until a register is written or another event occurs, for example [`Device::due`]. The plant then
    /// skips the next polls and cycles. When in doubt, returns false.
    fn is_quiescent(&self) -> bool {
        false
    }

    /// True if the device needs its next processor cycle even if no register is written and its front panel stays
    /// unchanged. If false, the plant may skip cycles when it advances over several at once.
    fn needs_each_cycle(&self) -> bool {
        false
    }

    /// True if a poll of the front panel and a processor cycle would change nothing, at any time, with the present
    /// register contents, independent of their writer. When in doubt, returns false.
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

    /// Interrupt events of the device, if it has any.
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

    /// NOVRAM of the device, if it has any.
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

    /// Kinds of faults that the device or its ports can have.
    fn fault_kinds(&self) -> &'static [&'static FaultKind] {
        faults_of_device(self.layout())
    }

    /// Returns the part that takes over changed files of the device, if it is described by files that may change.
    fn file_changes(&mut self) -> Option<&mut dyn FileChanges> {
        None
    }

    /// Returns the slots of the device for option cards, if it has any.
    fn option_slots(&mut self) -> Option<&mut dyn OptionSlots> {
        None
    }

    /// Returns the part that exchanges pulses with a controller, if the device can be an option card.
    fn option_card(&mut self) -> Option<&mut dyn OptionCard> {
        None
    }

    /// Returns the part that applies faults of the device itself; `None` if the device can have no faults.
    fn faults(&mut self) -> Option<&mut dyn Faulty> {
        None
    }
}

impl dyn Device {
    /// Returns the state of the front panel.
    pub fn board(&self) -> BoardState {
        BoardState::of(self.header())
    }

    /// True if memory exists for an access in the right area. The device may have fewer retain flags than the area has
    /// room for.
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

    /// Returns the device as a `T`, if it has that type.
    pub fn as_a<T: Device>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }
}
