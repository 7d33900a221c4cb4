//! Ethernet configuration: the IP address of the board (manual 5.00005.03a p. 75-82).
//!
//! The registers of `ETHERNET_CONFIG_BMSTRUCT` are in NOVRAM, and their contents at power-on are used. Later,
//! a write to `d_IP_CONFIG` (p. 78) stores address and mask, and a write to `d_ROUTER` the router. The firmware detects
//! such a write because the value of the register changes (decision D-191). `ETHERNET_DIAGNOSE_BMSTRUCT` shows the result.

use crate::devices::Context;
use crate::devices::omega_drive_line_2::emulation::rules;
use crate::devices::omega_drive_line_2::registers::values::{ethernet_status, ip_config, router};
use crate::devices::omega_drive_line_2::registers::{
    ETHERNET, ETHERNET_CONFIG, ETHERNET_CONFIG_BMSTRUCT, ETHERNET_CONFIG_BYTES, ETHERNET_DIAGNOSE_BMSTRUCT,
};
use crate::devices::records::{BoardEvent, OnBoard};
use crate::layout::RegisterPhase;
use crate::memory::{MemoryError, Segment, View};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::mem::offset_of;
use std::net::Ipv4Addr;
use zerocopy::{FromBytes, IntoBytes};

/// The base address at delivery, and its mask. The DIP number is added to the address (p. 80).
const DELIVERY: (Ipv4Addr, Ipv4Addr) = (Ipv4Addr::new(192, 168, 1, 1), Ipv4Addr::new(255, 255, 255, 0));

/// Content of `ETHERNET_CONFIG_BMSTRUCT`, byte by byte.
pub(crate) type Stored = [u8; ETHERNET_CONFIG_BYTES];

/// Returns the address and mask for a configuration and the DIP number. `None` if the last byte of the
/// address would be 0, 255 or more, because devices must not have such an address (p. 79-80).
pub(crate) fn effective(
    ip_config: u32,
    address: Ipv4Addr,
    mask: Ipv4Addr,
    dip: u8,
) -> Option<(Ipv4Addr, Ipv4Addr)> {
    let (base, mask, add) = match ip_config {
        ip_config::FIXED => (address, mask, 0),
        ip_config::PLUS_DIP => (address, mask, dip),
        _ => (DELIVERY.0, DELIVERY.1, dip),
    };
    let [a, b, c, d] = base.octets();
    // The base address need not be allowed itself: it can become allowed when the DIP number is added.
    let last = d.checked_add(add).filter(|last| !matches!(last, 0 | 255))?;
    Some((Ipv4Addr::new(a, b, c, last), mask))
}

/// The Ethernet interface of one PLC.
pub(crate) struct Ethernet {
    config: View<ETHERNET_CONFIG_BMSTRUCT>,
    diagnose: View<ETHERNET_DIAGNOSE_BMSTRUCT>,
    /// Speed of the link in Mbit/s; 0 without a link.
    speed: u16,
    dip: u8,
    stored: Stored,
    /// Values of `d_IP_CONFIG` and `d_ROUTER` at the last poll.
    seen: [u32; 2],
    /// Number of changes of `stored`.
    generation: u32,
}

impl SnapshotFields for Ethernet {
    fn save(&self, to: &mut Saving) {
        let Self { config: _, diagnose: _, speed: _, dip, stored, seen, generation: _ } = self;
        to.value(&(dip, stored, seen));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let stored: Stored;
        (self.dip, stored, self.seen) = from.value()?;
        // The change of the number makes the emulator write the NOVRAM file again. The file still has the
        // values from before the restoration.
        self.generation = self.generation.wrapping_add((self.stored != stored).into());
        self.stored = stored;
        Ok(())
    }
}

impl Ethernet {
    /// Returns the interface with a link of `speed` Mbit/s; 0 is no link.
    ///
    /// # Errors
    /// The memory segment is read-only.
    pub(crate) fn new(segment: &Segment, speed: u16) -> Result<Self, MemoryError> {
        Ok(Ethernet {
            config: segment.view(ETHERNET_CONFIG)?,
            diagnose: segment.view(ETHERNET)?,
            speed,
            dip: 0,
            stored: [0; ETHERNET_CONFIG_BYTES],
            seen: [0; 2],
            generation: 0,
        })
    }

    /// Called at power-on or at the end of a reset, when the DIP number has been read. The contents of NOVRAM
    /// take effect.
    pub(crate) fn power_on(&mut self, ctx: &mut Context, dip: u8) {
        self.dip = dip;
        self.keep();
        let valid = self.show(false);
        if !valid {
            self.report(ctx, |config, address| BoardEvent::NoAddress { config, address });
        }
    }

    /// Called at power-off. Stores the registers in NOVRAM, and clears the diagnosis registers of the
    /// interface.
    pub(crate) fn power_off(&mut self) {
        self.keep();
        self.diagnose.reset_from(0);
    }

    /// Stores the contents of the registers in NOVRAM.
    pub(crate) fn keep(&mut self) {
        let now = self.registers();
        if now != self.stored {
            self.stored = now;
            self.generation = self.generation.wrapping_add(1);
        }
        self.seen = self.watched();
    }

    /// Returns the contents of NOVRAM, and a number that changes with them.
    pub(crate) fn stored(&self) -> (&Stored, u32) {
        (&self.stored, self.generation)
    }

    /// True if a poll would change nothing.
    #[inline]
    pub(super) fn poll_changes_nothing(&self) -> bool {
        self.watched() == self.seen
    }

    /// Polls `d_IP_CONFIG` and `d_ROUTER`. A change of one of them takes effect at this poll.
    #[inline]
    pub(crate) fn look(&mut self, ctx: &mut Context) {
        if !self.poll_changes_nothing() {
            self.take(ctx);
        }
    }

    /// Called when `d_IP_CONFIG` or `d_ROUTER` was written. If the address is allowed, stores all values.
    /// Otherwise restores the address and the choice of the address.
    #[cold]
    pub(crate) fn take(&mut self, ctx: &mut Context) {
        let new = self.registers();
        let Some((config, address, mask, _)) = parts(&new) else { return };
        if effective(config, address, mask, self.dip).is_some() {
            let (old_config, ..) = parts(&self.stored).unwrap_or((0, address, mask, 0));
            let address_counts = new.get(..12) != self.stored.get(..12) || config != old_config;
            self.keep();
            self.show(false);
            if address_counts {
                self.report(ctx, |config, address| BoardEvent::AddressStored { config, address });
            }
            return;
        }
        self.report(ctx, |config, address| BoardEvent::AddressRefused { config, address });
        let offset = ETHERNET_CONFIG as usize + offset_of!(ETHERNET_CONFIG_BMSTRUCT, a_IP_ADDRESS) + 3;
        ctx.find(&rules::IP_ADDRESS, RegisterPhase::ALWAYS, offset, address.octets()[3].into());
        self.put_back();
        self.keep();
        self.show(true);
    }

    #[inline]
    fn watched(&self) -> [u32; 2] {
        [self.config.d_IP_CONFIG.load(), self.config.d_ROUTER.load()]
    }

    fn registers(&self) -> Stored {
        let mut bytes = Stored::default();
        // Source and destination are arrays of equal size by definition, so the copy cannot fail.
        let _ = self.config.snapshot().write_to(&mut bytes);
        bytes
    }

    /// Restores the address, the mask and the choice of the address, but not the routers.
    fn put_back(&self) {
        let Some((config, address, mask, _)) = parts(&self.stored) else { return };
        for (cells, bytes) in [(&self.config.a_IP_ADDRESS, address), (&self.config.a_IP_MASK, mask)] {
            cells.iter().zip(bytes.octets()).for_each(|(cell, byte)| cell.store(byte));
        }
        self.config.d_IP_CONFIG.store(config);
    }

    /// Shows the address in use. Returns true if there is a valid address.
    fn show(&self, refused: bool) -> bool {
        let Some((config, address, mask, router)) = parts(&self.stored) else { return false };
        let found = effective(config, address, mask, self.dip);
        let (address, mask) = found.unwrap_or((Ipv4Addr::UNSPECIFIED, Ipv4Addr::UNSPECIFIED));
        let shown = &self.diagnose;
        shown.a_IP_ADDRESS.iter().zip(address.octets()).for_each(|(cell, byte)| cell.store(byte));
        shown.a_IP_MASK.iter().zip(mask.octets()).for_each(|(cell, byte)| cell.store(byte));
        shown.d_IP_CONFIG.store(config);
        shown.w_DIP_NR.store(self.dip.into());
        shown.w_SPEED.store(self.speed);
        let bits = [
            (self.speed != 0, ethernet_status::LINK),
            (found.is_some(), ethernet_status::ADDRESS),
            (router != router::NO_ROUTERS, ethernet_status::ROUTERS),
            (refused, ethernet_status::REFUSED),
        ];
        shown.w_STATUS.store(bits.iter().filter(|(on, _)| *on).fold(0, |word, (_, bit)| word | bit));
        found.is_some()
    }

    /// Reports the contents of the registers.
    fn report(&self, ctx: &mut Context, what: impl FnOnce(u32, Ipv4Addr) -> BoardEvent) {
        if let Some((config, address, ..)) = parts(&self.registers()) {
            let plc = ctx.origin.plc;
            ctx.report(OnBoard { plc, what: what(config, address) });
        }
    }
}

/// Returns the registers `d_IP_CONFIG`, address, mask and `d_ROUTER`. The result is never `None`, because the size is
/// correct.
fn parts(bytes: &Stored) -> Option<(u32, Ipv4Addr, Ipv4Addr, u32)> {
    let (words, _) = <[[u8; 4]; 4]>::read_from_prefix(bytes).ok()?;
    let [config, address, mask, router] = words;
    Some((u32::from_le_bytes(config), address.into(), mask.into(), u32::from_le_bytes(router)))
}

#[cfg(test)]
mod tests;
