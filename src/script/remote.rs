//! A running instance, through its channel.

use super::backend::{Backend, BackendError, Spot, Waited};
use crate::channel::op::MAX_RECORDS;
use crate::channel::{ChannelError, Client, ClientError, Op, Reply};
use crate::check::Entry;
use crate::devices::omega_drive_line_2::registers::LAYOUT_HASH;
use crate::fault::Fault;
use crate::journal::{Names, Record};
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{Address, AttachMode, ClockMode, Image, Segment};
use crate::plant::{ForceError, Forced};
use core::num::NonZeroU16;
use std::time::Duration;

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

    fn ask(&self, op: Op) -> Result<Reply, BackendError> {
        match self.client.request(&[op])?.pop() {
            Some(Reply::Error(refused)) => Err(self.refused(refused)),
            Some(reply) => Ok(reply),
            None => Err(self.wrong_reply()),
        }
    }

    fn wrong_reply(&self) -> BackendError {
        ClientError::WrongReply { instance: self.instance.clone() }.into()
    }

    fn name(&self, plc: u16) -> String {
        self.names.plcs.get(usize::from(plc)).cloned().unwrap_or_default()
    }

    /// What a plant in this process would say.
    fn refused(&self, error: ChannelError) -> BackendError {
        match error {
            ChannelError::Unmapped { address } => BackendError::Unmapped { address },
            ChannelError::RangeUnmapped { hole, .. } => {
                BackendError::Unmapped { address: Address::byte(hole) }
            }
            ChannelError::NoSync { plc, node } => BackendError::NoSync { plc: self.name(plc), node },
            ChannelError::NotForced { address } => BackendError::NotForced { address },
            ChannelError::StartRefused { plc } => BackendError::StartRefused { plc: self.name(plc) },
            ChannelError::Fault(refusal) => BackendError::Fault(refusal),
            other => ClientError::from(other).into(),
        }
    }

    fn written(&self, op: Op) -> Result<(), BackendError> {
        match self.ask(op)? {
            Reply::Written => Ok(()),
            _ => Err(self.wrong_reply()),
        }
    }

    fn advanced(&self, op: Op) -> Result<u64, BackendError> {
        match self.ask(op)? {
            Reply::Advanced { time_us } => Ok(time_us),
            _ => Err(self.wrong_reply()),
        }
    }

    fn records(&self, from: u64, max: u32) -> Result<(Vec<Record>, u64), BackendError> {
        match self.ask(Op::Journal { from, max })? {
            Reply::Journal { records, end } => Ok((records, end)),
            _ => Err(self.wrong_reply()),
        }
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
        let Spot { plc, offset, width } = spot;
        match self.ask(Op::Peek { plc, offset, width })? {
            Reply::Value(value) => Ok(value),
            _ => Err(self.wrong_reply()),
        }
    }

    fn store(&mut self, spot: Spot, value: u32) -> Result<(), BackendError> {
        let Spot { plc, offset, width } = spot;
        self.written(Op::Poke { plc, offset, width, value })
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
            _ => Err(self.wrong_reply()),
        }
    }

    fn read_range(&mut self, plc: u16, offset: u32, len: u32) -> Result<Vec<u8>, BackendError> {
        match self.ask(Op::ReadRange { plc, offset, len })? {
            Reply::Bytes(bytes) => Ok(bytes),
            _ => Err(self.wrong_reply()),
        }
    }

    fn advance(&mut self, us: u64) -> Result<u64, BackendError> {
        self.advanced(Op::Advance { us })
    }

    fn advance_to_sync(&mut self, plc: u16, node: u8) -> Result<u64, BackendError> {
        self.advanced(Op::AdvanceToSync { plc, node })
    }

    fn advance_to_event(&mut self, within_us: u64) -> Result<u64, BackendError> {
        if self.stepped {
            return self.advanced(Op::AdvanceToEvent { within_us });
        }
        // The clock of the instance runs by itself.
        std::thread::sleep(PAUSE);
        self.now()
    }

    fn wait(&mut self, spot: Spot, mask: u32, value: u32, within_us: u64) -> Result<Waited, BackendError> {
        let Spot { plc, offset, width } = spot;
        match self.ask(Op::Wait { plc, offset, width, mask, value, within_us }) {
            Ok(Reply::Waited { value, .. }) => Ok(Waited { matched: true, value }),
            Err(BackendError::Client(ClientError::Refused(ChannelError::WaitTimedOut { last, .. }))) => {
                Ok(Waited { matched: false, value: last })
            }
            Ok(_) => Err(self.wrong_reply()),
            Err(error) => Err(error),
        }
    }

    fn force(&mut self, spot: Spot, value: u32) -> Result<(), BackendError> {
        let Spot { plc, offset, width } = spot;
        self.written(Op::Force { plc, offset, width, value }).map_err(|error| match error {
            BackendError::Client(ClientError::Refused(refused)) => match refused {
                ChannelError::TooManyForces { .. } => {
                    BackendError::Force { address: spot.address(), source: ForceError::TooMany }
                }
                ChannelError::NotWhole { asked, right } => BackendError::Force {
                    address: spot.address(),
                    source: ForceError::NotWhole { asked, right },
                },
                other => ClientError::from(other).into(),
            },
            other => other,
        })
    }

    fn unforce(&mut self, spot: Spot) -> Result<(), BackendError> {
        let Spot { plc, offset, width } = spot;
        self.written(Op::Unforce { plc, offset, width })
    }

    fn forces(&mut self) -> Result<Vec<Forced>, BackendError> {
        match self.ask(Op::Forces)? {
            Reply::Forces(forces) => Ok(forces),
            _ => Err(self.wrong_reply()),
        }
    }

    fn add_fault(&mut self, fault: Fault) -> Result<u16, BackendError> {
        match self.ask(Op::FaultAdd { fault })? {
            Reply::FaultAdded { id } => Ok(id),
            _ => Err(self.wrong_reply()),
        }
    }

    fn clear_faults(&mut self, id: Option<NonZeroU16>) -> Result<(), BackendError> {
        match self.ask(Op::FaultClear { id })? {
            Reply::FaultsCleared { .. } => Ok(()),
            _ => Err(self.wrong_reply()),
        }
    }

    fn board(&mut self, plc: u16) -> Result<BoardState, BackendError> {
        match self.ask(Op::Board { plc })? {
            Reply::Board(state) => Ok(state),
            _ => Err(self.wrong_reply()),
        }
    }

    fn set_board(&mut self, plc: u16, setting: BoardSetting) -> Result<(), BackendError> {
        self.written(Op::SetBoard { plc, setting })
    }

    fn answer_boards(&mut self) -> Result<(), BackendError> {
        // With a stepped clock that is done before any request.
        if self.stepped {
            self.ask(Op::Info)?;
        }
        Ok(())
    }

    fn findings(&mut self) -> Result<Vec<Entry>, BackendError> {
        match self.ask(Op::Findings)? {
            Reply::Findings(entries) => Ok(entries),
            _ => Err(self.wrong_reply()),
        }
    }

    fn clear_findings(&mut self) -> Result<(), BackendError> {
        self.ask(Op::ClearFindings).map(drop)
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
