//! What a plant knows of a device: an image with firmware behind it, and ports that media end at.

use super::{Context, DriveDetails, Events, ParameterRefusal, Shaft, World};
use crate::fault::{Effect, Faults, Hit, Target};
use crate::journal::Journal;
use crate::layout::{self, DeviceFit};
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{Header, Segment, Width};
use crate::snapshot_fields::SnapshotFields;
use core::any::Any;

/// What takes a device down or brings it up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// Supply off.
    Off,
    /// Supply on.
    On,
    /// RESET held.
    HoldReset,
    /// RESET released; the switch then stands at STOP.
    ReleaseReset,
}

/// What a look at a device's front asks of the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Nothing.
    Nothing,
    /// A switch was turned or a request answered; timers may run otherwise than before.
    Answered,
    /// RESET is held: the device stops.
    Held,
    /// The supply failed, be RESET held or not: the device stops, and what shares its supply.
    Off,
    /// Power-on, or RESET was released: the device starts anew.
    Up,
}

/// A device of a plant. Its ports are firmware of the medium that they belong to; the plant tells the device what of
/// them concerns it, and the ports what of it concerns them. What a device does not have, it does not implement; one with
/// nothing in front but its supply is a [`Plain`](super::Plain) one.
pub trait Device: Any + Send + SnapshotFields {
    /// Its name in the plant.
    fn name(&self) -> &str;

    /// Its image.
    fn segment(&self) -> &Segment;

    /// Its registers.
    fn layout(&self) -> &'static layout::Device;

    /// What its ports are, as it is fitted: of a modular device it is the modules that decide.
    fn fitted(&self) -> DeviceFit {
        DeviceFit::unknown(self.layout())
    }

    /// Whether `port` is a drive of its medium, of which the device has no registers. Faults name it by its number on the medium.
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

    /// Its front as it stands.
    fn board(&self) -> BoardState {
        BoardState::of(self.header())
    }

    /// Turns a switch in the header page or puts in a request, as a client does; the next look sees it. `false`: there is
    /// no such switch.
    fn turn(&self, setting: BoardSetting) -> bool;

    /// Why the device would not carry out this setting now: a command that its switches or its state do not allow. `None`: it
    /// would.
    fn refusal(&self, setting: BoardSetting) -> Option<&'static str> {
        let _ = setting;
        None
    }

    /// Switches supply or RESET, as if somebody had turned the switch.
    fn set_power(&mut self, power: Power) -> Look;

    /// One look at switches and requests of the front.
    fn look(&mut self, ctx: &mut Context) -> Look;

    /// Whether it has power and is not held in RESET.
    fn is_up(&self) -> bool;

    /// Power-on or end of a reset, before the ports follow.
    fn start(&mut self, ctx: &mut Context);

    /// Power-off or reset, before the ports follow.
    fn stop(&mut self, ctx: &mut Context);

    /// The supply is gone, for what goes on while RESET is held.
    fn supply_failed(&mut self) {}

    /// The number on its medium that `port` has from now on: that of the switches at the last start.
    fn address(&self, port: u8) -> u8 {
        let _ = port;
        0
    }

    /// Somebody else has the number of `port`, which is therefore not connected.
    fn address_taken(&mut self, ctx: &mut Context, port: u8) {
        let _ = (ctx, port);
    }

    /// Whether `port` takes part in the traffic of its medium; told when it changes.
    fn port_joined(&mut self, port: u8, takes_part: bool) {
        let _ = (port, takes_part);
    }

    /// The firmware of `port` has looked at its registers in a processor cycle at `now`; `last_frame` is when the port last sent or
    /// received a frame since it takes part, where its medium tells.
    fn port_looked(&mut self, port: u8, last_frame: Option<u64>, now: u64) {
        let _ = (port, last_frame, now);
    }

    /// The ports whose SYNC signal goes on to another port of the device, if the firmware there wants it: from, to.
    fn sync_ways(&self) -> &[(u8, u8)] {
        &[]
    }

    /// An edge of the SYNC signal at `port`, when everything else has seen it.
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

    /// The processor cycle: looks at the registers that are no port's.
    fn processor_cycle(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// Whether it rests: a look at front and registers and a processor cycle have just found what there was, and as long as
    /// nobody writes, those that follow will find nothing to do, whatever time it is, and show nothing else, until something
    /// else happens, be it [`Device::due`]. The plant then leaves them out. Whoever is not sure does not rest.
    fn is_quiescent(&self) -> bool {
        false
    }

    /// Whether a look at front and registers and a processor cycle find nothing to do, whatever time it is, as everything
    /// stands now, whoever has written it. Whoever is not sure does not look in vain.
    fn poll_changes_nothing(&self) -> bool {
        false
    }

    /// When the next of its own times is due; `u64::MAX` if none is.
    fn next_time(&self) -> u64 {
        u64::MAX
    }

    /// Handles what is due at `world.now`.
    fn due(&mut self, world: &mut World) {
        let _ = world;
    }

    /// Which of the faults that the device lets act do so has changed.
    fn faults_changed(&mut self, faults: &Faults) {
        let _ = faults;
    }

    /// A fault acts that the device has itself: does it hit by itself, at its begin or in a processor cycle? What hits when the
    /// device does something it finds out then ([`World::faults`]).
    fn fire(&mut self, now: u64, target: Target, effect: &Effect) -> Option<Hit> {
        let _ = (now, target, effect);
        None
    }

    /// The drive that it is built into, if it is, with all that is to be seen of it.
    fn drive(&self) -> Option<DriveDetails> {
        None
    }

    /// Sets a parameter of that drive, as somebody does who stands in front of it.
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

    /// What the motor of that drive is to do, and does.
    fn shaft(&self) -> Option<Shaft> {
        None
    }

    /// The motor of that drive turns with this speed, whatever the drive demands of it; `None`: it does what the drive
    /// demands.
    fn turn_shaft(&mut self, speed: Option<i32>, now: u64) {
        let _ = (speed, now);
    }

    /// Interrupt level of an event: a task of a higher one interrupts one of a lower one. `None`: there is no such event.
    fn event_level(&self, event: usize) -> Option<u8> {
        let _ = event;
        None
    }

    /// Its interrupt events, if it has any.
    fn events(&mut self) -> Option<&mut Events> {
        None
    }

    /// Whether an access in the right area meets something that this device has: it may have fewer retain flags than fit.
    fn has(&self, offset: u32, width: Width) -> bool {
        let Some(retain) = self.layout().retain.filter(|retain| retain.area.contains(offset)) else {
            return true;
        };
        let bytes = self.header().retain_size.load();
        u64::from(offset) + u64::from(width.bytes()) <= u64::from(retain.area.first) + u64::from(bytes)
    }

    /// `bytes` bytes at `offset` were written by somebody who named the place.
    fn named(&self, offset: u32, bytes: u32) {
        let _ = (offset, bytes);
    }

    /// Whether the firmware answers a write at `offset` at once if it came through the channel, where also an unchanged
    /// value is seen.
    fn answers_write(&self, offset: u32) -> bool {
        let _ = offset;
        false
    }

    /// Such a write.
    fn written(&mut self, ctx: &mut Context) {
        let _ = ctx;
    }

    /// What its NOVRAM holds, and a number that changes with it; empty if it has none.
    fn novram(&self) -> (&[u8], u32) {
        (&[], 0)
    }

    /// What stands in the NOVRAM registers counts as stored, as at power-off.
    fn keep_novram(&mut self) {}

    /// The emulated time, for the header page.
    fn show_time(&self, now: u64) {
        self.header().virtual_time_us.store(now);
    }
}
