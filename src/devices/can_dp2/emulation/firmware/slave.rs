//! The DP slave: parameters, configuration, data exchange, diagnosis (p. 10-21). Where the manual says
//! nothing, the slave follows the DP standard, and a decision names each of these points.

use super::gateway::Gateway;
use super::modules::{CfgFault, Configuration, Module, ModuleFunction};
use super::parameters::{IDENT, Parameters, PrmFault};
use super::ram::Registers;
use crate::devices::can_dp2::emulation::rules;
use crate::devices::can_dp2::registers::values::{bus_state, dp_state, ext_cause, master_address, mst_dsap};
use crate::devices::can_dp2::registers::values::{
    station_status_1 as status_1, station_status_2 as status_2,
};
use crate::devices::can_dp2::registers::{CAN_DP2_CFG, CAN_DP2_MODULE, CFG, OUTPUTS};
use crate::journal::Rule;
use crate::profibus::{
    Answer, BROADCAST, Frame, FunctionCode, MIN_TSDR_BITS, Reaction, Request, Responder, Telegram,
};
use core::mem::offset_of;
use serde::{Deserialize, Serialize};

/// The bit of Global_Control that clears outputs.
const CLEAR_DATA: u8 = 0x02;

/// A change to report to the journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::devices::can_dp2::emulation) enum News {
    /// The state has changed.
    State(u8),
    /// A telegram was refused: octets 8 to 10 of the diagnosis.
    Refused([u8; 3]),
    /// The watchdog has run out.
    Watchdog,
    /// A program has broken a rule. The fields are the rule, the offset of the register in the image, and the
    /// value.
    Found(&'static Rule, u32, u32),
}

#[derive(Serialize, Deserialize)]
pub(in crate::devices::can_dp2::emulation) struct Slave {
    responder: Responder,
    state: u8,
    master: Option<u8>,
    /// True if the master has reserved the slave.
    is_locked: bool,
    parameters: Option<Parameters>,
    configuration: Configuration,
    prm_fault: Option<PrmFault>,
    cfg_fault: Option<CfgFault>,
    /// Time in us at which the watchdog runs out, unless the master sends a request before.
    watchdog_at: Option<u64>,
    /// Time of the last valid telegram, in microseconds.
    heard_at: u64,
    /// True if the slave has announced a diagnosis, and the master has not read it yet.
    has_diagnosis: bool,
    /// Changes that must be reported before the present call of the port ends.
    #[serde(skip)]
    news: Vec<News>,
}

impl Slave {
    /// Creates a slave with this address, which searches for the bit rate.
    pub(in crate::devices::can_dp2::emulation) fn new(address: u8) -> Self {
        Slave {
            responder: Responder::new(address),
            state: dp_state::BAUD_SEARCH,
            master: None,
            is_locked: false,
            parameters: None,
            configuration: Configuration::default(),
            prm_fault: None,
            cfg_fault: None,
            watchdog_at: None,
            heard_at: 0,
            has_diagnosis: false,
            news: vec![News::State(dp_state::BAUD_SEARCH)],
        }
    }

    pub(in crate::devices::can_dp2::emulation) fn state(&self) -> u8 {
        self.state
    }

    pub(in crate::devices::can_dp2::emulation) fn address(&self) -> u8 {
        self.responder.address()
    }

    /// Returns the state in one word.
    pub(in crate::devices::can_dp2::emulation) fn does(&self) -> &'static str {
        match self.state {
            dp_state::BAUD_SEARCH => "baud_search",
            dp_state::BAUD_CONTROL => "baud_control",
            dp_state::WAIT_PRM => "wait_prm",
            dp_state::WAIT_CFG => "wait_cfg",
            _ => "data_exchange",
        }
    }

    /// Returns the changes since the last call.
    pub(in crate::devices::can_dp2::emulation) fn take_news(&mut self) -> Vec<News> {
        core::mem::take(&mut self.news)
    }

    fn enter(&mut self, state: u8) {
        if core::mem::replace(&mut self.state, state) != state {
            self.news.push(News::State(state));
        }
    }

    /// Returns the number of bit times before an answer.
    pub(in crate::devices::can_dp2::emulation) fn tsdr(&self) -> u64 {
        self.parameters.as_ref().map_or(MIN_TSDR_BITS, |parameters| parameters.min_tsdr().max(MIN_TSDR_BITS))
    }

    /// Returns the time at which the watchdog runs out, in us.
    pub(in crate::devices::can_dp2::emulation) fn next_time(&self) -> u64 {
        self.watchdog_at.unwrap_or(u64::MAX)
    }

    /// Checks the watchdog of data exchange.
    pub(in crate::devices::can_dp2::emulation) fn due(
        &mut self,
        now: u64,
        gateway: &mut Gateway,
        registers: &Registers,
    ) {
        if self.watchdog_at.is_none_or(|at| at > now) {
            return;
        }
        let time = self.parameters.as_ref().and_then(Parameters::watchdog_us).unwrap_or(0);
        self.news.push(News::Watchdog);
        self.leave(gateway, registers);
        // The slave searches for the bit rate only if the line was silent, not if other stations were still
        // sending (D-380).
        let is_silent = now.saturating_sub(self.heard_at) >= time;
        self.enter(if is_silent { dp_state::BAUD_SEARCH } else { dp_state::BAUD_CONTROL });
    }

    /// Ends data exchange: sets the outputs to 0. The slave then waits for parameters and configuration
    /// again.
    fn leave(&mut self, gateway: &mut Gateway, registers: &Registers) {
        gateway.end();
        registers.set_outputs(&[]);
        (self.parameters, self.master, self.is_locked) = (None, None, false);
        (self.watchdog_at, self.has_diagnosis) = (None, false);
        self.enter(dp_state::WAIT_PRM);
    }

    /// Handles a telegram; returns the answer, if there is one.
    pub(in crate::devices::can_dp2::emulation) fn heard(
        &mut self,
        telegram: &Telegram,
        now: u64,
        gateway: &mut Gateway,
        registers: &Registers,
    ) -> Option<Telegram> {
        self.heard_at = now;
        // The slave uses the first telegram only to detect the bit rate, and does not answer it (D-380).
        if self.state == dp_state::BAUD_SEARCH {
            self.enter(dp_state::BAUD_CONTROL);
            return None;
        }
        let reaction = self.responder.heard(telegram.clone());
        if reaction != Reaction::Nothing && self.state == dp_state::BAUD_CONTROL && !is_broadcast(telegram) {
            self.enter(dp_state::WAIT_PRM);
        }
        match reaction {
            Reaction::Nothing => None,
            Reaction::Answered(answer) => {
                if let Telegram::Frame(frame) = telegram {
                    self.feed(frame.sa, now);
                }
                Some(answer)
            }
            Reaction::Delivered(frame) => {
                self.feed(frame.sa, now);
                self.control(&frame, now, gateway, registers);
                None
            }
            Reaction::Asked(frame) => {
                let answer = self.asked(&frame, now, gateway, registers);
                self.feed(frame.sa, now);
                Some(self.responder.answer(&frame, answer))
            }
        }
    }

    /// Restarts the watchdog after a request of the master.
    fn feed(&mut self, from: u8, now: u64) {
        if self.master == Some(from) {
            let time = self.parameters.as_ref().and_then(Parameters::watchdog_us);
            self.watchdog_at = time.map(|time| now + time);
        }
    }

    fn refusal(&self, frame: &Frame) -> Telegram {
        self.responder.short(frame.sa, Answer::NotActivated)
    }

    /// Returns the answer with the inputs. Without inputs, the answer is a short acknowledgement. A short
    /// acknowledgement cannot announce a diagnosis, so if a diagnosis waits, the answer is a telegram without
    /// data.
    fn data(&self, frame: &Frame, inputs: Vec<u8>) -> Telegram {
        match (self.has_diagnosis, inputs.is_empty()) {
            (false, true) => Telegram::ShortAck,
            (true, true) => self.responder.short(frame.sa, Answer::High),
            (false, false) => self.responder.data(frame, Answer::Low, inputs),
            (true, false) => self.responder.data(frame, Answer::High, inputs),
        }
    }

    fn asked(&mut self, frame: &Frame, now: u64, gateway: &mut Gateway, registers: &Registers) -> Telegram {
        let is_exchanging = self.state == dp_state::DATA_EXCHANGE;
        // A DP slave does not have the service SDA, which gets an acknowledgement but no data (D-679).
        if matches!(FunctionCode::parse(frame.fc), FunctionCode::Request { request: Request::Sda, .. }) {
            return self.refusal(frame);
        }
        match frame.dsap.unwrap_or(mst_dsap::DATA_EXCHANGE) {
            mst_dsap::DATA_EXCHANGE => self.exchange(frame, now, gateway, registers),
            mst_dsap::SLAVE_DIAG => {
                let diagnosis = self.diagnosis(gateway, frame.sa);
                if self.master == Some(frame.sa) {
                    self.has_diagnosis = false;
                }
                self.responder.data(frame, Answer::Low, diagnosis)
            }
            mst_dsap::SET_PRM => {
                self.set_parameters(frame, gateway, registers);
                Telegram::ShortAck
            }
            mst_dsap::CHK_CFG => {
                // The slave ignores a configuration before valid parameters, or from another master (D-379).
                if self.state >= dp_state::WAIT_CFG && self.master == Some(frame.sa) {
                    self.check_configuration(&frame.data, now, gateway, registers);
                }
                Telegram::ShortAck
            }
            mst_dsap::GET_CFG => self.responder.data(frame, Answer::Low, self.configuration.octets.clone()),
            mst_dsap::RD_INP if is_exchanging => {
                self.responder.data(frame, Answer::Low, registers.inputs(self.configuration.inputs))
            }
            mst_dsap::RD_OUTP if is_exchanging => {
                self.responder.data(frame, Answer::Low, registers.outputs(self.configuration.outputs))
            }
            // The slave refuses Set_Slave_Add (p. 9) and all other services.
            _ => self.refusal(frame),
        }
    }

    fn exchange(
        &mut self,
        frame: &Frame,
        now: u64,
        gateway: &mut Gateway,
        registers: &Registers,
    ) -> Telegram {
        if self.state != dp_state::DATA_EXCHANGE || self.master != Some(frame.sa) {
            return self.refusal(frame);
        }
        match frame.data.len() {
            // Decision D-387: a data exchange without outputs sets all outputs to 0.
            0 => {
                registers.set_outputs(&[]);
                gateway.cleared(now);
            }
            length if length == self.configuration.outputs => {
                registers.set_outputs(&frame.data);
                gateway.exchanged(&frame.data, now);
            }
            length => {
                self.news.push(News::Found(&rules::OUTPUT_LENGTH, OUTPUTS, length as u32));
                self.leave(gateway, registers);
                return self.refusal(frame);
            }
        }
        self.look(gateway);
        self.data(frame, registers.inputs(self.configuration.inputs))
    }

    /// Notes a change on CAN that the diagnosis must show (p. 20, 29).
    pub(in crate::devices::can_dp2::emulation) fn look(&mut self, gateway: &mut Gateway) {
        let wants = self.parameters.as_ref().is_some_and(Parameters::has_can_diagnosis);
        self.has_diagnosis |= gateway.take_news() && wants && self.state == dp_state::DATA_EXCHANGE;
    }

    fn set_parameters(&mut self, frame: &Frame, gateway: &mut Gateway, registers: &Registers) {
        // A reserved slave ignores other masters (D-379).
        if self.is_locked && self.master != Some(frame.sa) {
            return;
        }
        match Parameters::parse(&frame.data) {
            Ok(parameters) if parameters.unlocks() => {
                (self.prm_fault, self.cfg_fault) = (None, None);
                self.leave(gateway, registers);
            }
            Ok(parameters) => {
                (self.prm_fault, self.cfg_fault) = (None, None);
                self.leave(gateway, registers);
                registers.set_parameters(&parameters);
                (self.master, self.is_locked) = (Some(frame.sa), parameters.locks());
                self.parameters = Some(parameters);
                self.enter(dp_state::WAIT_CFG);
            }
            Err(fault) => {
                self.leave(gateway, registers);
                (self.prm_fault, self.cfg_fault) = (Some(fault), None);
                self.news.push(News::Refused(self.own_diagnosis(gateway)));
            }
        }
    }

    fn check_configuration(&mut self, octets: &[u8], now: u64, gateway: &mut Gateway, registers: &Registers) {
        let Some(parameters) = &self.parameters else { return };
        match Configuration::parse(octets, parameters) {
            Ok(configuration) => {
                let sync_ms = configuration.sync_ms;
                // If the master repeats the configuration that is in force, only the SYNC time in its comment
                // has an effect. The SYNC time needs to be set again, because its most recent setting is
                // valid (p. 30; D-381).
                if self.state != dp_state::DATA_EXCHANGE || configuration != self.configuration {
                    registers.set_configuration(&configuration);
                    gateway.begin(parameters, &configuration, now);
                    self.judge(&configuration);
                    (self.cfg_fault, self.configuration) = (None, configuration);
                    self.enter(dp_state::DATA_EXCHANGE);
                }
                sync_ms.into_iter().for_each(|time| gateway.set_sync_time_of_comment(time));
            }
            Err(fault) => {
                gateway.end();
                registers.set_outputs(&[]);
                self.cfg_fault = Some(fault);
                // Decision D-381: LED E shows that the slave waits for another configuration (p. 15).
                self.enter(dp_state::WAIT_CFG);
                self.news.push(News::Refused(self.own_diagnosis(gateway)));
            }
        }
    }

    /// Reports parts of a valid configuration that are probably mistakes (p. 32, 35, 39).
    fn judge(&mut self, configuration: &Configuration) {
        if !configuration.has_output() {
            let at = CFG + offset_of!(CAN_DP2_CFG, output_len) as u32;
            self.news.push(News::Found(&rules::NO_OUTPUT, at, 0));
        }
        let is_frozen =
            |module: &Module| matches!(module.kind, ModuleFunction::Input { is_frozen: true, .. });
        let wrong_window =
            configuration.modules.iter().position(|module| configuration.is_odd_window(module));
        for (rule, found) in [
            (&rules::RX_TWICE, configuration.modules.iter().position(is_frozen)),
            (&rules::WINDOW, wrong_window),
        ] {
            let Some(number) = found else { continue };
            let at = CFG + (offset_of!(CAN_DP2_CFG, module) + number * size_of::<CAN_DP2_MODULE>()) as u32;
            self.news.push(News::Found(rule, at, number as u32));
        }
    }

    /// Handles Global_Control. Only Clear_Data has an effect (p. 10; D-387).
    fn control(&mut self, frame: &Frame, now: u64, gateway: &mut Gateway, registers: &Registers) {
        let &[command, group, ..] = frame.data.as_slice() else { return };
        let Some(parameters) = &self.parameters else { return };
        let is_meant = group == 0 || parameters.octets[6] & group != 0;
        let is_its = frame.dsap == Some(mst_dsap::GLOBAL_CONTROL) && self.master == Some(frame.sa);
        if is_its && is_meant && command & CLEAR_DATA != 0 && self.state == dp_state::DATA_EXCHANGE {
            registers.set_outputs(&[]);
            gateway.cleared(now);
        }
    }

    /// Returns octets 8 to 10 of the diagnosis.
    fn own_diagnosis(&self, gateway: &Gateway) -> [u8; 3] {
        match (self.prm_fault, self.cfg_fault) {
            (Some(fault), _) => [ext_cause::PRM, fault.number, fault.right],
            (None, Some(fault)) => [ext_cause::CFG, fault.module, fault.error as u8],
            (None, None) => gateway.diagnosis(),
        }
    }

    /// Returns the diagnosis for the master with address `for_whom`.
    pub(in crate::devices::can_dp2::emulation) fn diagnosis(
        &self,
        gateway: &Gateway,
        for_whom: u8,
    ) -> Vec<u8> {
        let own = self.own_diagnosis(gateway);
        let of_can = self.parameters.as_ref().is_some_and(Parameters::has_can_diagnosis)
            && self.state == dp_state::DATA_EXCHANGE;
        let is_refusal = self.prm_fault.is_some() || self.cfg_fault.is_some();
        let bit = |so: bool, mask: u8| if so { mask } else { 0 };
        let is_ready = self.state == dp_state::DATA_EXCHANGE;
        let is_others = self.master.is_some_and(|master| master != for_whom);
        let first = bit(!is_ready, status_1::NOT_READY)
            | bit(self.cfg_fault.is_some(), status_1::CFG_FAULT)
            | bit(is_refusal || of_can && own[0] != bus_state::OK, status_1::EXT_DIAG)
            | bit(self.prm_fault.is_some_and(|fault| fault.is_unsupported), status_1::NOT_SUPPORTED)
            | bit(self.prm_fault.is_some(), status_1::PRM_FAULT)
            | bit(is_others, status_1::MASTER_LOCK);
        let has_watchdog = self.parameters.as_ref().is_some_and(|it| it.watchdog_us().is_some());
        let second = status_2::ALWAYS
            | bit(self.parameters.is_none(), status_2::PRM_REQ)
            | bit(has_watchdog, status_2::WD_ON);
        let master = self.master.unwrap_or(master_address::NONE);
        let mut octets = vec![first, second, 0, master, IDENT[0], IDENT[1]];
        if is_refusal || of_can {
            octets.extend([5, 4]);
            octets.extend(own);
        }
        octets
    }

    /// Shows the diagnosis for the present master in the registers.
    pub(in crate::devices::can_dp2::emulation) fn show(&self, gateway: &Gateway, registers: &Registers) {
        let octets = self.diagnosis(gateway, self.master.unwrap_or(BROADCAST));
        let diag = &registers.diag;
        let cells = [
            &diag.station_status_1,
            &diag.station_status_2,
            &diag.station_status_3,
            &diag.master_address,
            &diag.ident_high,
            &diag.ident_low,
            &diag.ext_length,
            &diag.ext_header,
            &diag.ext_cause,
            &diag.ext_number,
            &diag.ext_detail,
        ];
        let padded = octets.iter().copied().chain(core::iter::repeat(0));
        cells.into_iter().zip(padded).for_each(|(cell, octet)| cell.store(octet));
        diag.diag_len.store(octets.len() as u8);
        diag.dp_state.store(self.state);
    }
}

fn is_broadcast(telegram: &Telegram) -> bool {
    matches!(telegram, Telegram::Frame(frame) if frame.da == BROADCAST)
}
