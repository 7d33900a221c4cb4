//! Verbs that interfere with the plant: forced registers and faults.

use super::ask::Spot;
use super::register::Register;
use super::{Bench, Required, RequiredState};
use crate::devices;
use crate::fault::{FaultSpec, FaultStatus, Refusal, in_installation};
use crate::plant::Forced;
use crate::request::{Code, Op, Refused};
use crate::script::{ScenarioError, ScriptLocation, Value};
use core::num::NonZeroU16;
use core::panic::Location;

impl Bench {
    /// Forces a register: it keeps the value until [`Bench::unforce`], even if firmware or PLC write it.
    ///
    /// # Errors
    /// There is no such register, it cannot hold the value, or too many registers are forced.
    pub fn force(&mut self, register: &str, value: impl Into<Value>) -> Result<(), ScenarioError> {
        let register = self.find(register)?;
        let value = value.into().bits(&register.place)?;
        let Spot { plc, offset, width } = register.written_spot();
        // Forcing a single bit forces the whole register; the other bits keep their present values (D-105).
        let value = match register.place.bit_access() {
            None => value,
            Some(bit) => bit.set(self.load(register.written_spot())?, value),
        };
        Ok(self.ask(Op::Force { plc, offset, width, value })?.written()?)
    }

    /// Releases a forced register. The register keeps its value until the next write.
    ///
    /// # Errors
    /// There is no such register, or it is not forced.
    pub fn unforce(&mut self, text: &str) -> Result<(), ScenarioError> {
        let Spot { plc, offset, width } = self.find(text)?.written_spot();
        match self.ask(Op::Unforce { plc, offset, width }) {
            Err(ScenarioError::Refused(refused)) if refused.code == Code::NOT_FORCED => {
                Err(ScenarioError::argument(text, &refused.text))
            }
            reply => Ok(reply?.written()?),
        }
    }

    /// Adds a fault and returns its number. `words` has the notation of `commram fault add`:
    /// `lose_frame slot=WRC1 count=3`. A fault with the word `required` must take effect:
    /// [`Bench::expect_required_faults`].
    ///
    /// # Errors
    /// There is no such kind of fault, a field is wrong, or the plant does not have the target.
    pub fn fault(&mut self, words: &str) -> Result<u16, ScenarioError> {
        self.fault_at(words, None)
    }

    /// Adds a fault like [`Bench::fault`]. `place` is the line of the script that adds the fault.
    pub(in crate::script) fn fault_at(
        &mut self,
        words: &str,
        place: Option<ScriptLocation>,
    ) -> Result<u16, ScenarioError> {
        let text = words;
        let mut words = words.split_whitespace();
        let kind = words.next().unwrap_or_default();
        let kinds = in_installation(&devices::emulation::catalogue::known_fault_kinds(), &self.names);
        let spec = FaultSpec::from_words(&kinds, kind, &words.collect::<Vec<_>>())?;
        let fault = spec.resolve(&kinds, &self.names)?;
        let number = self.ask(Op::FaultAdd { fault })?.fault_added()?;
        if spec.required {
            self.required.push(Required::new(number, text.to_owned(), place));
        }
        Ok(number)
    }

    /// Stores the line of a script that has chosen the plant: failures of the plant's required faults refer to this
    /// line.
    pub(in crate::script) fn plant_is_of(&mut self, place: &ScriptLocation) {
        self.required.iter_mut().for_each(|it| it.place = Some(place.clone()));
    }

    /// Returns the number of faults that must take effect.
    pub(in crate::script) fn required_faults(&self) -> usize {
        self.required.len()
    }

    /// Expects that each `required` fault of this bench and of its plant file has taken effect. Scenario scripts end
    /// with this check.
    ///
    /// # Errors
    /// A required fault has not taken effect.
    #[track_caller]
    pub fn expect_required_faults(&mut self) -> Result<(), ScenarioError> {
        let at = Location::caller();
        self.note_required_faults()?;
        let Some(missed) = self.required.iter().find(|it| it.state != RequiredState::HasActed) else {
            return Ok(());
        };
        let Required { number, text, place, .. } = missed;
        let (what, place) = (format!("fault {number} has not taken effect: {text}"), place.clone());
        let mut failure = self.failure(what, at)?;
        failure.location = place.or(failure.location);
        failure.expected = Some("a hit, as the fault is required".to_owned());
        failure.actual = Some("none".to_owned());
        Err(failure.into())
    }

    /// Notes which required faults have taken effect. This is called before the plant forgets faults.
    pub(super) fn note_required_faults(&mut self) -> Result<(), ScenarioError> {
        for index in 0..self.required.len() {
            let Required { number: id, state, .. } = self.required[index];
            if state == RequiredState::Known && self.ask(Op::FaultHasActed { id })?.value()? == 1 {
                self.required[index].state = RequiredState::HasActed;
            }
        }
        Ok(())
    }

    /// Notes which required faults the plant does not have after a return to an earlier moment.
    pub(super) fn forget_required_faults(&mut self) -> Result<(), ScenarioError> {
        if self.required.iter().all(|it| it.state != RequiredState::Known) {
            return Ok(());
        }
        let there = self.faults()?;
        let is_gone = |it: &&mut Required| there.iter().all(|fault| fault.id != it.number);
        let known = self.required.iter_mut().filter(|it| it.state == RequiredState::Known);
        known.filter(is_gone).for_each(|it| it.state = RequiredState::Gone);
        Ok(())
    }

    /// Returns the faults that wait or act, in the order in which they were added.
    ///
    /// # Errors
    /// The emulator of the instance has ended.
    pub fn faults(&mut self) -> Result<Vec<FaultStatus>, ScenarioError> {
        Ok(self.ask(Op::FaultList)?.faults()?)
    }

    /// Clears the fault with this number. Effects that it already had remain.
    ///
    /// # Errors
    /// There is no such fault. The fault may have ended.
    pub fn clear_fault(&mut self, number: u16) -> Result<(), ScenarioError> {
        let id = NonZeroU16::new(number).ok_or(Refused::from(Refusal::UnknownFault { id: number }))?;
        self.note_required_faults()?;
        self.ask(Op::FaultClear { id: Some(id) })?.faults_cleared()?;
        Ok(())
    }

    /// Clears all faults.
    ///
    /// # Errors
    /// The emulator of the instance has ended.
    pub fn clear_faults(&mut self) -> Result<(), ScenarioError> {
        self.note_required_faults()?;
        self.ask(Op::FaultClear { id: None })?.faults_cleared()?;
        Ok(())
    }

    pub(super) fn is_forced(&mut self, register: &Register) -> Result<bool, ScenarioError> {
        let Spot { plc, offset, .. } = register.spot;
        // Only whole registers are forced, and a single bit may be in any byte of its register.
        let is_there =
            |it: &Forced| it.plc == plc && (it.offset..it.offset + it.width.bytes()).contains(&offset);
        Ok(self.forces()?.iter().any(is_there))
    }
}
