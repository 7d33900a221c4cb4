//! Operations on the instance and the boards of its devices.

use super::{Work, plc_name};
use crate::identity::DeviceIndex;
use crate::memory::header::BoardSetting;
use crate::request::register::{device_of, known_plc};
use crate::request::{Code, Refused, Reply};

impl Work<'_> {
    pub(super) fn board(&mut self, plc: DeviceIndex) -> Result<Reply, Refused> {
        let plc = known_plc(self.host, plc)?;
        let device = self.host.plant().devices().get(plc.index());
        Ok(Reply::Board(device.map(|device| device.board()).unwrap_or_default()))
    }

    pub(super) fn set_board(&mut self, plc: DeviceIndex, setting: BoardSetting) -> Result<Reply, Refused> {
        let host = &mut *self.host;
        let number = known_plc(host, plc)?;
        let device = host.plant().devices().get(number.index());
        if let Some(why) = device.and_then(|device| device.refusal(setting)) {
            return Err(Refused::setting(plc_name(host, plc), device_of(host, number), setting, why));
        }
        if !host.plant_mut().set_board(number, setting) {
            return Err(Refused::no_such_switch(plc_name(host, plc), device_of(host, number), setting));
        }
        let takes_starts =
            || host.plant().devices().get(number.index()).is_some_and(|device| device.board().takes_starts());
        if !matches!(setting, BoardSetting::Start(_)) || takes_starts() {
            return Ok(Reply::Written);
        }
        let text = format_args!(
            "PLC '{}': a start or stop needs a loaded program, the switch at RUN and the supply on",
            plc_name(host, plc)
        );
        Err(Refused::new(Code::START_REFUSED, text))
    }

    pub(super) fn info(&mut self) -> Result<Reply, Refused> {
        Ok(Reply::Info(Box::new(self.host.info())))
    }

    pub(super) fn stop(&mut self) -> Result<Reply, Refused> {
        self.host.request_stop(self.execution.process);
        Ok(Reply::Stopping)
    }
}
