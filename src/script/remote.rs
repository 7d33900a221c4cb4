//! A running instance, through its channel.

use super::backend::{Backend, BackendError, Spot, Waited};
use crate::channel::op::MAX_RECORDS;
use crate::channel::{ChannelError, Client, ClientError, Op, Reply};
use crate::check::Entry;
use crate::fault::Fault;
use crate::journal::{Names, Record};
use crate::layout::omega_drive_line_2::LAYOUT_HASH;
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{AttachMode, ClockMode, Image, Segment};
use crate::plant::Forced;
use core::num::NonZeroU16;
use std::time::Duration;

/// Emulated time between two looks where the channel has no wait of its own.
const LOOK_US: u64 = 100;
/// Pause between two looks at a clock that runs by itself.
const PAUSE: Duration = Duration::from_micros(500);

/// A connection to an instance.
pub(super) struct Remote {
    client: Client,
    instance: String,
    names: Names,
    stepped: bool,
}

impl Remote {
    /// Takes over a connection.
    ///
    /// # Errors
    /// The instance does not answer.
    pub fn new(client: Client) -> Result<Self, ClientError> {
        let info = client.info()?;
        let names = Names { plcs: info.plcs, buses: info.buses };
        let stepped = info.clock_mode == ClockMode::Stepped;
        Ok(Self { client, instance: info.name, names, stepped })
    }

    fn ask(&self, op: Op) -> Result<Reply, ClientError> {
        match self.client.request(&[op])?.pop() {
            Some(Reply::Error(refused)) => Err(refused.into()),
            Some(reply) => Ok(reply),
            None => Err(self.wrong_reply()),
        }
    }

    fn wrong_reply(&self) -> ClientError {
        ClientError::WrongReply { instance: self.instance.clone() }
    }

    fn advanced(&self, op: Op) -> Result<u64, BackendError> {
        match self.ask(op)? {
            Reply::Advanced { time_us } => Ok(time_us),
            _ => Err(self.wrong_reply().into()),
        }
    }

    fn records(&self, from: u64, max: u32) -> Result<(Vec<Record>, u64), ClientError> {
        match self.ask(Op::Journal { from, max })? {
            Reply::Journal { records, end } => Ok((records, end)),
            _ => Err(self.wrong_reply()),
        }
    }
}

/// A fault was refused, or something else went wrong.
fn refused(error: ClientError) -> BackendError {
    match error {
        ClientError::Refused(ChannelError::Fault(refusal)) => BackendError::Fault(refusal),
        other => other.into(),
    }
}

impl Backend for Remote {
    fn names(&self) -> &Names {
        &self.names
    }

    fn now(&mut self) -> Result<u64, BackendError> {
        Ok(self.client.info()?.time_us)
    }

    fn load(&mut self, spot: Spot) -> Result<u32, BackendError> {
        Ok(self.client.peek(spot.plc, spot.offset, spot.width)?)
    }

    fn store(&mut self, spot: Spot, value: u32) -> Result<(), BackendError> {
        Ok(self.client.poke(spot.plc, spot.offset, spot.width, value)?)
    }

    fn compare_exchange(
        &mut self,
        spot: Spot,
        current: u32,
        new: u32,
    ) -> Result<Result<u32, u32>, BackendError> {
        let Spot { plc, offset, width } = spot;
        match self.ask(Op::CompareExchange { plc, offset, width, current, new })? {
            Reply::Exchanged { ok, found } => Ok(if ok { Ok(found) } else { Err(found) }),
            _ => Err(self.wrong_reply().into()),
        }
    }

    fn read_range(&mut self, plc: u16, offset: u32, len: u32) -> Result<Vec<u8>, BackendError> {
        Ok(self.client.read_range(plc, offset, len)?)
    }

    fn advance(&mut self, us: u64) -> Result<u64, BackendError> {
        self.advanced(Op::Advance { us })
    }

    fn advance_to_sync(&mut self, plc: u16, node: u8) -> Result<u64, BackendError> {
        self.advanced(Op::AdvanceToSync { plc, node })
    }

    fn advance_a_little(&mut self, deadline: u64) -> Result<u64, BackendError> {
        if self.stepped {
            let now = self.now()?;
            return self.advance(deadline.saturating_sub(now).min(LOOK_US));
        }
        // The clock of the instance runs by itself.
        std::thread::sleep(PAUSE);
        self.now()
    }

    fn wait(&mut self, spot: Spot, mask: u32, value: u32, within_us: u64) -> Result<Waited, BackendError> {
        let Spot { plc, offset, width } = spot;
        match self.ask(Op::Wait { plc, offset, width, mask, value, within_us }) {
            Ok(Reply::Waited { value, .. }) => Ok(Waited { matched: true, value }),
            Err(ClientError::Refused(ChannelError::WaitTimedOut { last, .. })) => {
                Ok(Waited { matched: false, value: last })
            }
            Ok(_) => Err(self.wrong_reply().into()),
            Err(error) => Err(error.into()),
        }
    }

    fn force(&mut self, spot: Spot, value: u32) -> Result<(), BackendError> {
        let Spot { plc, offset, width } = spot;
        match self.ask(Op::Force { plc, offset, width, value })? {
            Reply::Written => Ok(()),
            _ => Err(self.wrong_reply().into()),
        }
    }

    fn unforce(&mut self, spot: Spot) -> Result<(), BackendError> {
        let Spot { plc, offset, width } = spot;
        match self.ask(Op::Unforce { plc, offset, width }) {
            Ok(Reply::Written) => Ok(()),
            Ok(_) => Err(self.wrong_reply().into()),
            Err(ClientError::Refused(ChannelError::NotForced { address })) => {
                Err(BackendError::NotForced { address })
            }
            Err(error) => Err(error.into()),
        }
    }

    fn forces(&mut self) -> Result<Vec<Forced>, BackendError> {
        match self.ask(Op::Forces)? {
            Reply::Forces(forces) => Ok(forces),
            _ => Err(self.wrong_reply().into()),
        }
    }

    fn add_fault(&mut self, fault: Fault) -> Result<u16, BackendError> {
        match self.ask(Op::FaultAdd { fault }) {
            Ok(Reply::FaultAdded { id }) => Ok(id),
            Ok(_) => Err(self.wrong_reply().into()),
            Err(error) => Err(refused(error)),
        }
    }

    fn clear_faults(&mut self, id: Option<NonZeroU16>) -> Result<(), BackendError> {
        match self.ask(Op::FaultClear { id }) {
            Ok(Reply::FaultsCleared { .. }) => Ok(()),
            Ok(_) => Err(self.wrong_reply().into()),
            Err(error) => Err(refused(error)),
        }
    }

    fn board(&mut self, plc: u16) -> Result<BoardState, BackendError> {
        match self.ask(Op::Board { plc })? {
            Reply::Board(state) => Ok(state),
            _ => Err(self.wrong_reply().into()),
        }
    }

    fn set_board(&mut self, plc: u16, setting: BoardSetting) -> Result<(), BackendError> {
        match self.ask(Op::SetBoard { plc, setting })? {
            Reply::Written => Ok(()),
            _ => Err(self.wrong_reply().into()),
        }
    }

    fn findings(&mut self) -> Result<Vec<Entry>, BackendError> {
        match self.ask(Op::Findings)? {
            Reply::Findings(entries) => Ok(entries),
            _ => Err(self.wrong_reply().into()),
        }
    }

    fn clear_findings(&mut self) -> Result<(), BackendError> {
        self.ask(Op::ClearFindings).map(drop).map_err(BackendError::from)
    }

    fn segment(&mut self, plc: u16) -> Result<Segment, BackendError> {
        let name = self.names.plcs.get(usize::from(plc)).map_or("", String::as_str);
        let attached = Image::attach(&self.instance, name, AttachMode::ReadWrite, Some(LAYOUT_HASH))?;
        Ok(attached.segment().clone())
    }

    fn journal_end(&mut self) -> Result<u64, BackendError> {
        // From a number that no record has yet, only the end comes.
        Ok(self.records(u64::MAX, 0)?.1)
    }

    fn journal(&mut self, from: u64) -> Result<(Vec<Record>, u64), BackendError> {
        let (mut all, mut next) = (Vec::new(), from);
        loop {
            let (records, end) = self.records(next, MAX_RECORDS)?;
            let complete = records.last().is_none_or(|last| last.is_pending() || last.seq + 1 >= end);
            next = records.iter().rfind(|record| !record.is_pending()).map_or(end, |last| last.seq + 1);
            all.extend(records);
            if complete {
                return Ok((all, end));
            }
        }
    }
}
