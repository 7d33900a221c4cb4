//! Control and status register of a job, at the master and at the slave. The PLC writes both registers, and
//! the firmware shows the progress of the job in both (manual 5.00005.03a p. 165, 167, 189, 191).

use crate::devices::Context;
use crate::journal::Handshake;
use crate::memory::Cell8;

/// The two registers of a job. Their bits have equal meanings. The firmware reads only the control register,
/// and writes both registers.
pub(super) struct JobRegisters<'a> {
    pub(super) control: &'a Cell8,
    pub(super) status: &'a Cell8,
    /// Offset of the control register in the node's area. The journal needs it.
    pub(super) offset: usize,
    /// True for a job of the master. As long as bit 0 of its control register is set, further answers to one
    /// request follow (p. 165, 167).
    pub(super) is_masters: bool,
}

impl JobRegisters<'_> {
    /// Returns the control register. Its value alone determines the state of the job.
    pub(super) fn control(&self) -> u8 {
        self.control.load()
    }

    /// Stores `new` in both registers: first the status register, then the control register.
    pub(super) fn show(&self, ctx: &mut Context, new: u8) {
        self.change(ctx, |_| new);
    }

    /// Changes bits of both registers. Simultaneous writes of the PLC to other bits are not lost.
    pub(super) fn change(&self, ctx: &mut Context, change: impl Fn(u8) -> u8) {
        self.status.update(&change);
        let seen = self.control.update(&change);
        self.report(ctx, seen, change(seen));
    }

    /// Replaces `seen` by `new`: first in the status register, then in the control register. Returns true if
    /// the control register still contained `seen`. Otherwise the PLC has entered another value in the
    /// meantime, and the control register keeps that value.
    pub(super) fn replace(&self, ctx: &mut Context, seen: u8, new: u8) -> bool {
        self.status.store(new);
        match self.control.compare_exchange(seen, new) {
            Ok(_) => {
                self.report(ctx, seen, new);
                true
            }
            Err(entered) => {
                self.status.store(entered);
                false
            }
        }
    }

    fn report(&self, ctx: &mut Context, seen: u8, new: u8) {
        if seen != new {
            let (origin, offset) = (ctx.origin, ctx.at(self.offset));
            let (request, answer) = (u16::from(seen), u16::from(new));
            let more_answers_follow = self.is_masters && answer & 1 != 0;
            ctx.report(Handshake { origin, offset, request, answer, more_answers_follow });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::DeviceIndex;
    use crate::identity::PortNumber;
    use crate::journal::{Journal, Origin};
    use zerocopy::FromZeros;

    #[test]
    fn replace_keeps_a_value_that_the_plc_entered_meanwhile() {
        let (control, status) = (Cell8::new_zeroed(), Cell8::new_zeroed());
        let mut journal = Journal::default();
        let mut ctx = Context {
            now: 7,
            journal: &mut journal,
            origin: Origin { plc: DeviceIndex(0), node: PortNumber(2) },
            base: 0,
        };
        let registers = JobRegisters { control: &control, status: &status, offset: 1, is_masters: true };
        control.store(0x05);
        assert!(registers.replace(&mut ctx, 0x05, 0x0D));
        assert_eq!((control.load(), status.load()), (0x0D, 0x0D));
        control.store(0x03);
        assert!(!registers.replace(&mut ctx, 0x0D, 0x04));
        assert_eq!((control.load(), status.load()), (0x03, 0x03));
        assert!(registers.replace(&mut ctx, 0x03, 0x03));
        assert_eq!(journal.written(), 1, "only a change is an answer");
    }
    #[test]
    fn bits_change_in_each_register_by_themselves() {
        let (control, status) = (Cell8::new_zeroed(), Cell8::new_zeroed());
        let mut journal = Journal::default();
        let mut ctx = Context {
            now: 7,
            journal: &mut journal,
            origin: Origin { plc: DeviceIndex(0), node: PortNumber(1) },
            base: 0,
        };
        let registers = JobRegisters { control: &control, status: &status, offset: 1, is_masters: true };
        registers.show(&mut ctx, 0x45);
        status.store(0x64);
        registers.change(&mut ctx, |value| value & 0xBF);
        assert_eq!((control.load(), status.load()), (0x05, 0x24));
        assert_eq!(journal.written(), 2);
    }
}
