//! The boards of the PLCs: switches, supply, displays, events.

use super::Bench;
use crate::devices;
use crate::devices::ModuleFront;
use crate::layout::FrontWord;
use crate::memory::header::{BoardAssignment, BoardSetting, BoardState, BoardWords, InitialFlagResult};
use crate::script::{ScenarioError, Value};

/// Maximum time for the answer of a board to a request, in microseconds of emulated time.
const PATIENCE_US: u64 = 100_000;

impl Bench {
    /// Returns the displays and switch positions of the board of a PLC, as numbers and as words. Words are present only
    /// for elements that the device has. `""` means the only PLC.
    ///
    /// # Errors
    /// There is no such PLC.
    pub fn board(&mut self, plc: &str) -> Result<(BoardState, BoardWords), ScenarioError> {
        let plc = self.only_plc(plc)?;
        let state = self.board_of(plc)?;
        Ok((state, state.words(devices::board_of(self.names.device(plc)))))
    }

    /// Returns the displays and switch positions of the modules of a modular PLC, by the names of their ports. `None`
    /// if the PLC is not modular. `""` means the only PLC.
    ///
    /// # Errors
    /// There is no such PLC.
    pub fn modules(&mut self, plc: &str) -> Result<Option<Vec<(&'static str, ModuleFront)>>, ScenarioError> {
        let plc = self.only_plc(plc)?;
        let ram = self.ram_of(plc)?;
        Ok(devices::modules(ram.header(), self.names.device(plc)))
    }

    /// Returns the front panel elements that are specific to the device of a PLC, with their values. `""` means the
    /// only PLC.
    ///
    /// # Errors
    /// There is no such PLC.
    pub fn front(&mut self, plc: &str) -> Result<Vec<(&'static FrontWord, u32)>, ScenarioError> {
        let plc = self.only_plc(plc)?;
        let ram = self.ram_of(plc)?;
        Ok(ram.header().front_words(self.names.device(plc)).collect())
    }

    /// Sets switches. `words` has the notation of `commram board set`: `dip=5 switch=stop`, `line2:power=off`,
    /// `start=cold`, `maxx:slotH.dip=7`. All settings are made at the present emulated time, in their order.
    ///
    /// # Errors
    /// There is no such PLC or setting, or a value is invalid. Then no setting is changed.
    pub fn set_board(&mut self, words: &str) -> Result<(), ScenarioError> {
        let setting = |word| {
            let word = BoardAssignment::parse(word)?;
            let plc = self.plc(word.plc, word.text)?;
            Ok((plc, word.at(self.names.device(plc))?))
        };
        let settings = words.split_whitespace().map(setting).collect::<Result<Vec<_>, ScenarioError>>()?;
        if settings.is_empty() {
            return Err(ScenarioError::argument(words, "write NAME=VALUE, for example dip=5"));
        }
        for (plc, setting) in settings {
            self.turn(plc, setting)?;
        }
        Ok(())
    }

    /// Presses RESET of a PLC and releases it; the switch is then at STOP. `""` is the only PLC.
    ///
    /// # Errors
    /// There is no such PLC.
    pub fn reset(&mut self, plc: &str) -> Result<(), ScenarioError> {
        let plc = self.only_plc(plc)?;
        self.turn(plc, BoardSetting::Reset)
    }

    /// Switches the supply of a PLC off and on; `""` is the only PLC.
    ///
    /// # Errors
    /// There is no such PLC.
    pub fn power_cycle(&mut self, plc: &str) -> Result<(), ScenarioError> {
        let plc = self.only_plc(plc)?;
        self.turn(plc, BoardSetting::PowerCycle)
    }

    /// Sets the initial value of a retain flag, which every cold start writes into the flag. The declaration in a PLC
    /// program has the same effect. `flag` is for example `%MD10000000` or `line2:%MW10000004`. The default initial
    /// value is 0.
    ///
    /// # Errors
    /// The text is not the address of a retain flag, the PLC does not have this flag, or the value does not fit.
    pub fn initial_flag(&mut self, flag: &str, value: impl Into<Value>) -> Result<(), ScenarioError> {
        let register = self.whole_register(flag)?;
        let (address, bits) = (register.place.address(), value.into().bits(&register.place)?);
        let retain = self.names.device(register.spot.plc).retain;
        let Some(retain) = retain.filter(|retain| retain.area.contains(address.offset())) else {
            return Err(ScenarioError::argument(flag, "write the address of retain flags, %MD10000000"));
        };
        let ram = self.ram_of(register.spot.plc)?;
        let slot = &ram.header().initial_flag;
        let request = slot.ask(address.offset() - retain.area.first, address.width().bytes(), bits);
        ram.header().submit_request();
        self.answer_boards()?;
        // With a real-time clock, the firmware needs some time to see the request.
        let deadline = self.now()?.saturating_add(PATIENCE_US);
        while slot.outcome(request).is_none() && self.pass(deadline)? {}
        match slot.outcome(request) {
            Some(result) if result == InitialFlagResult::Done.code() => Ok(()),
            Some(_) => Err(ScenarioError::argument(flag, "the PLC has no such retain flag")),
            None => Err(ScenarioError::argument(
                flag,
                "the board does not answer; it has no supply or is held in RESET",
            )),
        }
    }

    /// Returns the number of occurrences of an event of a PLC since the start of the instance. An event is counted only while it is
    /// enabled. The overview page of the device has the numbers of the events. `""` means the only PLC.
    ///
    /// # Errors
    /// There is no such PLC or event.
    pub fn event_count(&mut self, plc: &str, event: usize) -> Result<u32, ScenarioError> {
        let ram = self.ram(plc)?;
        let slot = ram
            .header()
            .events
            .get(event)
            .ok_or_else(|| ScenarioError::argument(&event.to_string(), "event numbers are 0 to 12"))?;
        Ok(slot.bell.rings())
    }

    /// Returns the number of pulses of a trigger of a PLC since the start of the instance. Triggers are 1, 2, and 3, the trigger
    /// controller; `OPT_INIT` routes them. `""` is the only PLC.
    ///
    /// # Errors
    /// There is no such PLC or trigger.
    pub fn trigger_count(&mut self, plc: &str, trigger: usize) -> Result<u32, ScenarioError> {
        let ram = self.ram(plc)?;
        let slot = trigger.checked_sub(1).and_then(|index| ram.header().triggers.get(index));
        let slot = slot.ok_or_else(|| {
            let right = "triggers are 1, 2, and 3 for the trigger controller";
            ScenarioError::argument(&trigger.to_string(), right)
        })?;
        Ok(slot.bell.rings())
    }
}
