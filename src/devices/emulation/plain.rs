//! A device with only a supply in its front panel. This module has all parts that an ordinary device needs,
//! except the firmware.

use super::catalogue::faults_of_device;
use super::program::Starts;
use super::supply::Supply;
use super::{
    AddressWrites, Context, Device, DevicePorts, DeviceView, Events, Faulty, FileChanges, Front, FrontAction,
    NovramContents, OptionCard, Power, World,
};
use crate::fault::{Effect, FaultKind, Faults, Hit, Owner, Target};
use crate::identity::DeviceIndex;
use crate::layout;
use crate::layout::place::is_live;
use crate::layout::{Area, DeviceFit};
use crate::memory::header::{BoardSetting, Start};
use crate::memory::{FirmwareHeader, Header, MemoryError, Segment};
use crate::snapshot_fields;
use crate::snapshot_fields::SnapshotFields;

/// The firmware of a [`Plain`] device, except the firmware of its ports. `()` is for a device without such
/// firmware.
pub trait Firmware: SnapshotFields + Send + 'static {
    /// Called at power-on and at the end of a reset.
    fn start(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// Called at power-off and at a reset.
    fn stop(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// Called when the board has requested a start or stop of the program of a client.
    fn ordered(&mut self, ctx: &mut Context, order: Start) {
        let _ = (ctx, order);
    }

    /// Runs a processor cycle: polls the registers that do not belong to a port.
    fn look(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// See [`Device::is_quiescent`].
    fn is_quiescent(&self) -> bool {
        false
    }

    /// See [`Device::needs_each_cycle`].
    fn needs_each_cycle(&self) -> bool {
        false
    }

    /// Returns the time of the next event of the firmware; `u64::MAX` if there is none.
    fn next_time(&self) -> u64 {
        u64::MAX
    }

    /// Handles the event at `ctx.now`.
    fn due(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// Returns the area with registers that keep their values at power-on and reset. NOVRAM stores the first
    /// structure of this area.
    fn kept(&self) -> Option<&'static Area> {
        None
    }

    /// Returns the contents of NOVRAM, and a number that changes with the contents. The contents are empty if
    /// the device has no NOVRAM.
    fn novram(&self) -> (&[u8], u32) {
        (&[], 0)
    }

    /// Stores the contents of the NOVRAM registers.
    fn keep(&mut self) {}

    /// Called at the start of a fault of the device itself, and in each processor cycle while the fault is
    /// active. If the fault fires, returns the hit.
    fn fire(&mut self, now: u64, effect: &Effect) -> Option<Hit> {
        let _ = (now, effect);
        None
    }

    /// Called when the set of active faults of `owner` has changed.
    fn faults_changed(&mut self, now: u64, faults: &Faults, owner: Owner) {
        let _ = (now, faults, owner);
    }

    /// Kinds of faults that the device itself declares. `None` if the registration of the device names them.
    fn fault_kinds(&self) -> Option<&'static [&'static FaultKind]> {
        None
    }

    /// See [`Front::refusal`].
    fn refusal(&self, setting: BoardSetting) -> Option<&'static str> {
        let _ = setting;
        None
    }

    /// True if the device gets power while its supply is switched on. Called at each poll.
    fn is_fed(&self) -> bool {
        true
    }

    /// See [`DeviceView::event_level`].
    fn event_level(&self, event: usize) -> Option<u8> {
        let _ = event;
        None
    }

    /// Events of the device; `None` if it has no events.
    fn events(&mut self) -> Option<&mut Events> {
        None
    }

    /// True if the firmware answers requests of `INTR_SET`. Otherwise the device refuses them.
    fn answers_interrupts(&mut self) -> bool {
        self.events().is_some()
    }

    /// Returns the same value as [`Device::file_changes`] of the device.
    fn file_changes(&mut self) -> Option<&mut dyn FileChanges> {
        None
    }

    /// Returns the same value as [`Device::option_card`] of the device.
    fn option_card(&mut self) -> Option<&mut dyn OptionCard> {
        None
    }

    /// Returns the same value as [`Device::address_writes`] of the device.
    fn address_writes(&mut self) -> Option<&mut dyn AddressWrites> {
        None
    }

    /// Same as [`Device::ports`].
    fn ports(&mut self) -> Option<&mut dyn DevicePorts> {
        None
    }

    /// True if the firmware starts and stops a program of the device itself. If false, the program of a
    /// client runs while the device is up.
    fn starts_program(&self) -> bool {
        false
    }
}

impl Firmware for () {
    fn is_quiescent(&self) -> bool {
        true
    }
}

/// A device with registers, ports and a supply that can be switched off and on. At power-on and at a reset
/// its registers get their reset values. Retain flags do not change, if the layout has any. The device has no
/// switches and no events. The program of a client runs while the device is up.
pub struct Plain<F> {
    index: DeviceIndex,
    name: String,
    layout: &'static layout::DeviceLayout,
    segment: Segment,
    face: FirmwareHeader,
    /// Firmware of the device.
    pub firmware: F,
    supply: Supply,
    starts: Starts,
}

snapshot_fields!(where [F: Firmware] Plain<F> { parts: firmware, supply, starts; built: index, name, layout, segment, face });

impl<F: Firmware> Plain<F> {
    /// Creates device number `index` of the plant with the name `name`, on this image.
    ///
    /// # Errors
    /// [`MemoryError`]: the image is too small or read-only.
    pub fn new(
        index: DeviceIndex,
        name: &str,
        layout: &'static layout::DeviceLayout,
        segment: Segment,
        firmware: F,
    ) -> Result<Self, MemoryError> {
        let face = segment.firmware_header()?;
        face.retain_size.store(layout.retain.map_or(0, |retain| retain.default_bytes));
        let (supply, starts) = (Supply::new(&face), Starts::new(&face));
        let name = name.to_owned();
        let it = Plain { index, name, layout, segment, face, firmware, supply, starts };
        it.reset_registers()?;
        Ok(it)
    }

    fn note_order(&mut self, ctx: &mut Context, order: Start) {
        if let Some(events) = self.firmware.events() {
            events.note_order();
        }
        self.firmware.ordered(ctx, order);
    }

    /// True if the power of the supply has failed or returned since the last poll. No client causes this, so only a
    /// processor cycle handles it.
    fn feed_has_changed(&self) -> bool {
        self.supply.is_fed() != self.firmware.is_fed()
    }

    /// Sets every register to its value after power-on.
    fn reset_registers(&self) -> Result<(), MemoryError> {
        let fitted = DeviceFit::unknown(self.layout);
        let kept = self.firmware.kept().map(|area| area.name);
        let areas = self.layout.areas.iter().filter(|area| kept != Some(area.name));
        let registers = |is_valid: bool| {
            let registers = areas.clone().flat_map(|area| fitted.used_registers(area));
            registers.filter(move |register| is_live(register, register.area.first_phase()) == is_valid)
        };
        // Structures may overlay each other: the registers that are valid at power-on are written last.
        registers(false).chain(registers(true)).try_for_each(|register| {
            self.segment.store(register.offset(), register.address().width(), register.reset())
        })
    }
}

impl<F: Firmware> DeviceView for Plain<F> {
    fn name(&self) -> &str {
        &self.name
    }

    fn segment(&self) -> &Segment {
        &self.segment
    }

    fn layout(&self) -> &'static layout::DeviceLayout {
        self.layout
    }

    fn header(&self) -> &Header {
        &self.face
    }

    fn event_level(&self, event: usize) -> Option<u8> {
        self.firmware.event_level(event)
    }

    fn fault_kinds(&self) -> &'static [&'static FaultKind] {
        self.firmware.fault_kinds().unwrap_or_else(|| faults_of_device(self.layout))
    }
}

impl<F: Firmware> Front for Plain<F> {
    fn turn(&self, setting: BoardSetting) -> bool {
        let BoardSetting::Power(power) = setting else { return false };
        self.face.put(|page| &page.program.power, power.code());
        true
    }

    fn refusal(&self, setting: BoardSetting) -> Option<&'static str> {
        self.firmware.refusal(setting)
    }

    fn set_power(&mut self, power: Power) -> FrontAction {
        self.supply.set(&self.face, power)
    }

    fn look(&mut self, ctx: &mut Context) -> FrontAction {
        if !self.front_has_changed() && !self.feed_has_changed() {
            return FrontAction::Nothing;
        }
        let look = self.supply.feed(&self.face, self.firmware.is_fed());
        let has_interrupts = self.firmware.answers_interrupts();
        if self.firmware.starts_program() {
            self.starts.look_at_requests(ctx, &self.face, has_interrupts);
        } else {
            let is_up = look == FrontAction::Nothing && self.supply.is_up();
            if let Some(order) = self.starts.look(ctx, &self.face, is_up, has_interrupts) {
                self.note_order(ctx, order);
            }
        }
        if look == FrontAction::Nothing { FrontAction::Answered } else { look }
    }

    fn front_has_changed(&self) -> bool {
        let has_changed = match self.firmware.starts_program() {
            true => Starts::has_requests,
            false => Starts::has_changed,
        };
        self.supply.has_changed(&self.face) || has_changed(&self.starts, &self.face)
    }

    fn is_up(&self) -> bool {
        self.supply.is_up()
    }
}

impl<F: Firmware> Device for Plain<F> {
    fn start(&mut self, ctx: &mut Context) {
        self.supply.start(ctx, &self.face);
        // The registers were accessible when the device was built, so this cannot fail.
        let _ = self.reset_registers();
        self.firmware.start(ctx);
        if !self.firmware.starts_program()
            && let Some(order) = self.starts.start(ctx, &self.face)
        {
            self.note_order(ctx, order);
        }
    }

    fn stop(&mut self, ctx: &mut Context) {
        self.firmware.stop(ctx);
        self.supply.stop(ctx);
    }

    fn processor_cycle(&mut self, ctx: &mut Context) {
        self.firmware.look(ctx);
    }

    fn is_quiescent(&self) -> bool {
        self.firmware.is_quiescent() && !self.front_has_changed() && !self.feed_has_changed()
    }

    fn needs_each_cycle(&self) -> bool {
        self.supply.is_up() && self.firmware.needs_each_cycle() || self.feed_has_changed()
    }

    fn events(&mut self) -> Option<&mut Events> {
        self.firmware.events()
    }

    fn next_time(&self) -> u64 {
        if self.supply.is_up() { self.firmware.next_time() } else { u64::MAX }
    }

    fn due(&mut self, world: &mut World) {
        let origin = crate::journal::Origin::of_device(self.index);
        self.firmware.due(&mut world.context(origin, 0));
    }

    fn novram(&self) -> Option<&dyn NovramContents> {
        Some(self)
    }

    fn novram_mut(&mut self) -> Option<&mut dyn NovramContents> {
        Some(self)
    }

    fn file_changes(&mut self) -> Option<&mut dyn FileChanges> {
        self.firmware.file_changes()
    }

    fn option_card(&mut self) -> Option<&mut dyn OptionCard> {
        self.firmware.option_card()
    }

    fn address_writes(&mut self) -> Option<&mut dyn AddressWrites> {
        self.firmware.address_writes()
    }

    fn ports(&mut self) -> Option<&mut dyn DevicePorts> {
        self.firmware.ports()
    }

    fn faults(&mut self) -> Option<&mut dyn Faulty> {
        Some(self)
    }
}

impl<F: Firmware> NovramContents for Plain<F> {
    fn contents(&self) -> (&[u8], u32) {
        self.firmware.novram()
    }

    fn store(&mut self) {
        self.firmware.keep();
    }
}

impl<F: Firmware> Faulty for Plain<F> {
    fn fire(&mut self, now: u64, _: Target, effect: &Effect) -> Option<Hit> {
        self.firmware.fire(now, effect)
    }

    fn faults_changed(&mut self, now: u64, faults: &Faults) {
        self.firmware.faults_changed(now, faults, Owner::Device(self.index));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The default of each function is the value that [`Firmware`] documents.
    #[test]
    fn firmware_defaults_are_empty() {
        let mut none = ();
        assert!(!none.answers_interrupts());
        assert!(none.kept().is_none() && none.events().is_none() && none.is_fed() && none.is_quiescent());
        let kept = (none.next_time(), none.novram(), (0..16).find_map(|event| none.event_level(event)));
        assert_eq!(kept, (u64::MAX, (&[][..], 0), None));
        assert_eq!(none.refusal(BoardSetting::Reset), None);
        assert!(none.file_changes().is_none() && none.option_card().is_none() && none.ports().is_none());
    }
}
