//! A DP master without a stack: a program writes registers, and the master sends the request to the slave.
//! Only one request can run at a time.

use super::ram::fill;
use crate::devices::Context;
use crate::devices::can_dp2::emulation::rules;
use crate::devices::can_dp2::registers::values::{mst_control, mst_dsap, mst_result, mst_status};
use crate::devices::can_dp2::registers::{CAN_DP2_MST, FRONT_ADDRESS, MST};
use crate::devices::profibus_bus::{Presence, ProfibusPort, Station};
use crate::layout::RegisterPhase;
use crate::memory::{Header, MemoryError, Segment, View};
use crate::profibus::{Answer, BROADCAST, Frame, FunctionCode, Request, Telegram};
use crate::snapshot_fields;
use core::mem::offset_of;
use serde::{Deserialize, Serialize};

/// The service access point of a DP master.
const MASTER_SAP: u8 = 62;

/// Maximum number of transmissions of a request.
const TRIES: u8 = 2;

/// Maximum number of octets of a request.
const OCTETS: usize = 244;

/// A request in progress.
#[derive(Serialize, Deserialize)]
struct Pending {
    frame: Frame,
    /// Number of times that the request has been sent.
    tries: u8,
    /// True if the request is on the line, or the answer is expected.
    is_sent: bool,
}

pub(in crate::devices::can_dp2::emulation) struct Master {
    registers: View<CAN_DP2_MST>,
    header: View<Header>,
    pending: Option<Pending>,
    /// Frame count bit of the last request. `None` if the next request counts as the first request to the
    /// slave.
    fcb: Option<bool>,
    /// Address of the last request; `None` if there was no request since power-on.
    last_address: Option<u8>,
}

snapshot_fields!(Master { values: pending, fcb, last_address; built: registers, header });

impl Master {
    pub(in crate::devices::can_dp2::emulation) fn new(segment: &Segment) -> Result<Self, MemoryError> {
        let (registers, header) = (segment.view(MST)?, segment.header()?);
        Ok(Master { registers, header, pending: None, fcb: None, last_address: None })
    }

    /// Returns the request in the registers; `None` if they contain no valid request.
    fn request(&self) -> Option<Frame> {
        let registers = &self.registers;
        let (sa, dsap) = (registers.mst_address.load(), registers.mst_dsap.load());
        let length = usize::from(registers.mst_request_len.load());
        let known = matches!(dsap, mst_dsap::SET_SLAVE_ADD..=mst_dsap::CHK_CFG | mst_dsap::FDL_STATUS..);
        if sa > 126 || length > OCTETS || !known {
            return None;
        }
        let data = registers.mst_request.iter().take(length).map(|cell| cell.load()).collect();
        let slave = self.header.front[FRONT_ADDRESS].load() as u8;
        let (fcb, fcv) = (self.fcb.is_none_or(|last| !last), self.fcb.is_some());
        let (request, da) = match dsap {
            mst_dsap::FDL_STATUS => (Request::FdlStatus, slave),
            mst_dsap::GLOBAL_CONTROL => (Request::Sdn, BROADCAST),
            _ => (Request::Srd, slave),
        };
        let counts = request == Request::Srd;
        let is_high = counts || request == Request::Sdn;
        let fc = FunctionCode::Request { request, fcb: counts && fcb, fcv: counts && fcv, is_high };
        let (dsap, ssap) = match dsap {
            mst_dsap::FDL_STATUS | mst_dsap::DATA_EXCHANGE => (None, None),
            sap => (Some(sap), Some(MASTER_SAP)),
        };
        let data = if request == Request::FdlStatus { Vec::new() } else { data };
        Some(Frame { da, sa, fc: fc.octet(), dsap, ssap, data })
    }

    fn finish(&mut self, ctx: &mut Context, station: &mut Station, result: u8, reply: &[u8]) {
        station.set_alarm(None);
        station.withdraw();
        if let Some(Pending { frame, .. }) = self.pending.take() {
            let of = |frame: &Frame| (frame.sa, frame.dsap, frame.data.clone());
            if self.request().is_none_or(|now| of(&now) != of(&frame)) {
                let dsap = self.registers.mst_dsap.load();
                ctx.find(
                    &rules::REQUEST_CHANGED,
                    RegisterPhase::ALWAYS,
                    offset_of!(CAN_DP2_MST, mst_dsap),
                    dsap.into(),
                );
            }
            // If the slave has answered this request, the frame count bit lets it distinguish the next
            // request from a repetition. If it has not answered, the slave takes the next request for the
            // first one.
            if let FunctionCode::Request { fcb, request: Request::Srd, .. } = FunctionCode::parse(frame.fc) {
                self.fcb = (result != mst_result::NO_ANSWER).then_some(fcb);
            }
            let is_data = matches!(result, mst_result::DATA | mst_result::DATA_AND_DIAGNOSIS);
            if frame.dsap == Some(mst_dsap::SLAVE_DIAG) && is_data {
                fill(&self.registers.mst_diag, reply);
                self.registers.mst_diag_len.store(reply.len().min(16) as u8);
            }
        }
        let registers = &self.registers;
        registers.mst_reply_len.store(reply.len() as u8);
        fill(&registers.mst_reply, reply);
        registers.mst_result.store(result);
        registers.mst_status.store(mst_status::IDLE);
        let at = offset_of!(CAN_DP2_MST, mst_control);
        match registers.mst_control.compare_exchange(mst_control::SEND, mst_control::DONE) {
            Ok(_) => ctx.answered(at, mst_control::SEND, mst_control::DONE),
            Err(other) => ctx.find(&rules::CONTROL_TAKEN, RegisterPhase::ALWAYS, at, other.into()),
        }
    }
}

impl ProfibusPort for Master {
    fn power_on(&mut self, _: &mut Context, station: &mut Station) {
        (self.pending, self.fcb, self.last_address) = (None, None, None);
        station.set_alarm(None);
    }

    fn power_off(&mut self) {
        self.pending = None;
    }

    /// No other station sees this master on the PROFIBUS segment, because the master answers no requests. So
    /// several gateways of a segment may have masters with the same address.
    fn presence(&self) -> Option<Presence> {
        let address = self.registers.mst_address.load();
        Some(Presence { address, does: "master", answers: false })
    }

    fn look(&mut self, ctx: &mut Context, station: &mut Station) {
        if !self.has_changed() {
            return;
        }
        self.registers.mst_result.store(mst_result::NONE);
        match self.request() {
            None => {
                let dsap = self.registers.mst_dsap.load();
                ctx.find(
                    &rules::REQUEST,
                    RegisterPhase::ALWAYS,
                    offset_of!(CAN_DP2_MST, mst_dsap),
                    dsap.into(),
                );
                self.finish(ctx, station, mst_result::BAD_REQUEST, &[]);
            }
            Some(frame) => {
                station.request(&Telegram::Frame(frame.clone()));
                self.last_address = Some(frame.sa);
                self.pending = Some(Pending { frame, tries: 1, is_sent: false });
                self.registers.mst_status.store(mst_status::WAITING_FOR_LINE);
            }
        }
    }

    fn has_changed(&self) -> bool {
        self.pending.is_none() && self.registers.mst_control.load() == mst_control::SEND
    }

    fn sent(&mut self, ctx: &mut Context, station: &mut Station) {
        let Some(pending) = &mut self.pending else { return };
        pending.is_sent = true;
        self.registers.mst_status.store(mst_status::SENDING);
        if pending.frame.da == BROADCAST {
            return self.finish(ctx, station, mst_result::SENT, &[]);
        }
        station.set_alarm(Some(station.now() + station.slot_bits() + Telegram::bits(255 + 11)));
    }

    fn heard(&mut self, ctx: &mut Context, station: &mut Station, telegram: &Telegram) {
        // The telegram is a request from the address of this master, so another master has the same address
        // (D-721).
        if let Telegram::Frame(frame) = telegram
            && self.last_address == Some(frame.sa)
            && !FunctionCode::is_answer(frame.fc)
        {
            let at = offset_of!(CAN_DP2_MST, mst_address);
            ctx.find(&rules::MASTER_ADDRESS, RegisterPhase::ALWAYS, at, frame.sa.into());
        }
        let Some(pending) = self.pending.as_ref().filter(|pending| pending.is_sent) else { return };
        let (result, data) = match telegram {
            Telegram::ShortAck => (mst_result::RECEIPT, Vec::new()),
            Telegram::Frame(frame) if frame.da == pending.frame.sa && frame.sa == pending.frame.da => {
                match FunctionCode::parse(frame.fc) {
                    FunctionCode::Answer(Answer::Ok) => (mst_result::STATUS, Vec::new()),
                    FunctionCode::Answer(Answer::NotActivated) => (mst_result::NOT_ACTIVATED, Vec::new()),
                    FunctionCode::Answer(Answer::Low) => (mst_result::DATA, frame.data.clone()),
                    FunctionCode::Answer(Answer::High) => {
                        (mst_result::DATA_AND_DIAGNOSIS, frame.data.clone())
                    }
                    _ => (mst_result::OTHER, Vec::new()),
                }
            }
            _ => return,
        };
        self.finish(ctx, station, result, &data);
    }

    /// The time for the answer is over.
    fn alarm(&mut self, ctx: &mut Context, station: &mut Station) {
        match &mut self.pending {
            Some(pending) if pending.tries < TRIES => {
                (pending.tries, pending.is_sent) = (pending.tries + 1, false);
                station.request(&Telegram::Frame(pending.frame.clone()));
            }
            Some(_) => self.finish(ctx, station, mst_result::NO_ANSWER, &[]),
            None => {}
        }
    }
}
