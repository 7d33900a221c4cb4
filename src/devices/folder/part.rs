//! Parts of the firmware of a device in a folder: its script, and its tables of handshakes.

use super::card::Card;
use super::own_faults::FaultChange;
use super::script::Script;
use crate::devices::Context;
use crate::memory::header::Start;
use crate::snapshot_fields::SnapshotFields;

/// A part of the firmware. All parts share the registers.
pub(super) trait Part: SnapshotFields + Send {
    /// Called at power-on. The registers have their reset values.
    fn start(&mut self, ctx: &mut Context, card: &mut Card);

    /// Called when the device is powered off.
    fn stop(&mut self, ctx: &mut Context, card: &mut Card) {
        let _ = (ctx, card);
    }

    /// Runs a processor cycle.
    fn look(&mut self, ctx: &mut Context, card: &mut Card);

    /// True if the last poll changed nothing, and further polls will change nothing until a register is
    /// written.
    fn is_quiescent(&self) -> bool;

    /// Returns the time of the next action; `u64::MAX` if there is none.
    fn next_time(&self) -> u64;

    /// Carries out the actions that are due at `ctx.now`.
    fn due(&mut self, ctx: &mut Context, card: &mut Card);

    /// Called at a trigger pulse from the controller of an option card.
    fn trigger(&mut self, ctx: &mut Context, card: &mut Card) {
        let _ = (ctx, card);
    }

    /// Called at an edge of the SYNC signal of the controller's network.
    fn sync_edge(&mut self, ctx: &mut Context, card: &mut Card) {
        let _ = (ctx, card);
    }

    /// Called when a fault that the device declares begins or ends, and after power-on for each fault that acts.
    fn fault(&mut self, ctx: &mut Context, card: &mut Card, change: &FaultChange) {
        let _ = (ctx, card, change);
    }

    /// Called when the script of the device has changed.
    fn take_over(&mut self, ctx: &mut Context, card: &mut Card, script: &'static Script) {
        let _ = (ctx, card, script);
    }

    /// Called when the board has requested a start or stop of the program.
    fn ordered(&mut self, ctx: &mut Context, card: &mut Card, order: Start) {
        let _ = (ctx, card, order);
    }
}
