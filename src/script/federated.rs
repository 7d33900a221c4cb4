//! Tests the promise of federates: a scenario on several hosts gives the same journal as in one process. In these tests
//! the hosts are plants in this process that exchange messages through memory.

use super::ScenarioError;
use super::carrier::Carrier;
use super::local::Local;
use crate::federation::{Exchange, FederateConfig, Federation};
use crate::identity::DeviceIndex;
use crate::memory::Segment;
use crate::memory::header::ABI_VERSION;
use crate::plant::{Plant, PlantConfig};
use crate::request::{Execution, Host, InstanceInfo, Op, Refused, Reply, Travel};
use core::cell::Cell;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

thread_local! {
    /// For scenarios on this thread: the number of federates of their plant, and the number of the federate that runs
    /// the scenario.
    static FEDERATES: Cell<(u8, u8)> = const { Cell::new((1, 0)) };
}

/// Returns the plant of a scenario.
pub(super) fn carrier(config: &PlantConfig) -> Result<Box<dyn Carrier>, ScenarioError> {
    match FEDERATES.get() {
        (1, _) => Ok(Box::new(Local::new(config)?)),
        (count, own) => Ok(Box::new(Federated::new(config, count, own, |_, _| Box::new(|| {}))?)),
    }
}

/// For each federate, the messages that were sent to it and that it has not received yet.
type Letters = Arc<Mutex<Vec<VecDeque<(u8, Vec<u8>)>>>>;

/// A program of this host that runs while the clock of this host advances, or while another federate has its turn.
type Program = Box<dyn FnMut() + Send>;

struct ByMemory {
    /// Index of this federate.
    own: usize,
    letters: Letters,
    program: Program,
}

impl Exchange for ByMemory {
    fn send(&mut self, message: &[u8]) -> Result<(), String> {
        for (to, letters) in self.letters.lock().unwrap().iter_mut().enumerate() {
            if to != self.own {
                letters.push_back((self.own as u8, message.to_vec()));
            }
        }
        (self.program)();
        Ok(())
    }

    fn receive(&mut self) -> Result<Option<(u8, Vec<u8>)>, String> {
        (self.program)();
        Ok(self.letters.lock().unwrap()[self.own].pop_front())
    }

    fn leave(&mut self, _: &[u8]) {}
}

struct Federate {
    plant: Plant,
    travel: Travel,
    federation: Option<Federation>,
}

impl Federate {
    fn no_watchers(&self) -> Vec<u16> {
        vec![0; self.plant.devices().len()]
    }

    /// Receives the pending messages. Returns true if this federate has the turn after these messages.
    fn look(&mut self) -> bool {
        let mut federation = self.federation.take().unwrap();
        federation.look(self).unwrap();
        let is_own_turn = federation.is_own_turn();
        self.federation = Some(federation);
        is_own_turn
    }

    fn end_turn(&mut self, target: Option<u64>) {
        let watched = self.no_watchers();
        let Federate { plant, federation, .. } = self;
        let federation = federation.as_mut().unwrap();
        federation.look_at_boards(plant);
        federation.end_turn(plant, target, target.unwrap_or(u64::MAX), watched).unwrap();
    }
}

impl Host for Federate {
    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    fn plant_and_travel(&mut self) -> (&mut Plant, &mut Travel) {
        (&mut self.plant, &mut self.travel)
    }

    fn is_stepped(&self) -> bool {
        true
    }

    fn permit(&mut self, op: &Op) -> Result<(), Refused> {
        let Federate { plant, federation, .. } = self;
        federation.as_mut().map_or(Ok(()), |federation| federation.permit(plant, op))
    }

    fn begin_request(&mut self) {}

    fn next_event(&self) -> u64 {
        self.plant.next_event()
    }

    fn next_change(&self) -> u64 {
        self.plant.next_change()
    }

    fn advance_to(&mut self, t: u64) -> bool {
        let federation = self.federation.as_mut().unwrap();
        if federation.is_own_turn() && !federation.has_reached(t) {
            self.end_turn(Some(t));
            return false;
        }
        self.federation.as_ref().unwrap().is_own_turn()
    }

    fn info(&self) -> InstanceInfo {
        InstanceInfo {
            name: "federate".to_owned(),
            is_stepped: true,
            speed: 0,
            time_us: self.plant.now(),
            generation: 1,
            pid: std::process::id(),
            abi_version: ABI_VERSION,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            waits_for: None,
            names: self.plant.names(),
        }
    }

    fn request_stop(&mut self, _by: Option<u32>) {}

    fn should_stop(&self) -> bool {
        false
    }
}

struct Federated {
    all: Vec<Federate>,
    /// Index of the federate of the scenario.
    own: usize,
}

impl Federated {
    /// Creates a plant that `count` federates run. The scenario runs at federate `own`. `program` creates a program for
    /// each federate.
    fn new(
        config: &PlantConfig,
        count: u8,
        own: u8,
        program: impl Fn(u8, &Plant) -> Program,
    ) -> Result<Self, ScenarioError> {
        let letters: Letters = Arc::new(Mutex::new(vec![VecDeque::new(); count.into()]));
        let federate = |number: u8| {
            let plant = Plant::new(config, |_, device| {
                Ok::<_, ScenarioError>(Segment::of(device).with_request_page())
            })?;
            let exchange = ByMemory {
                own: number.into(),
                letters: Arc::clone(&letters),
                program: program(number, &plant),
            };
            let limit = Duration::from_secs(60);
            let part =
                FederateConfig { own: number, count, follows: number != own, limit, exchange_us: None };
            let federation = Federation::join(part, &plant, Box::new(exchange)).unwrap();
            Ok(Federate { plant, travel: Travel::new(0), federation: Some(federation) })
        };
        let all = (0..count).map(federate).collect::<Result<_, ScenarioError>>()?;
        Ok(Federated { all, own: own.into() })
    }

    /// Ends the turns of the other federates until the federate of the scenario has the turn.
    fn others(&mut self) {
        while !self.all[self.own].look() {
            for (number, federate) in self.all.iter_mut().enumerate() {
                if number != self.own && federate.look() {
                    federate.end_turn(None);
                }
            }
        }
    }
}

impl Carrier for Federated {
    fn ask(&mut self, op: Op) -> Result<Reply, ScenarioError> {
        let mut execution = Execution::default();
        loop {
            self.others();
            if let Some(reply) = execution.run(&mut self.all[self.own], &op)? {
                return Ok(reply);
            }
        }
    }

    fn segment(&mut self, plc: DeviceIndex) -> Result<Segment, ScenarioError> {
        Ok(self.all[self.own].plant.devices()[plc.index()].segment().clone())
    }

    fn journal_hash(&self) -> Option<u64> {
        Some(self.all[self.own].plant.journal().hash())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::script::soak::{Round, RoundKind, exercises};
    use crate::script::{Limits, run_file};

    /// Hash of the journal after a scenario. `federates` is the number of federates, and the number of the federate
    /// that runs the scenario.
    fn hash(text: &str, federates: (u8, u8)) -> Option<u64> {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("round.rhai");
        std::fs::write(&file, text).unwrap();
        FEDERATES.set(federates);
        let report = run_file(&file, None, Limits::default(), |_| {});
        FEDERATES.set((1, 0));
        report.journal_hash
    }

    /// Returns a program at federate `number`. After each answer of the board of PLC 0, the program sends the request
    /// for another event. It never does so in the turn of its own federate. It collects the results.
    fn asks(number: u8, plant: &Plant, answers: &Arc<Mutex<Vec<u32>>>) -> Program {
        let image = plant.devices()[0].segment().clone();
        let event = [5, 12][usize::from(number)];
        let (answers, mut pending) = (Arc::clone(answers), None);
        Box::new(move || {
            let header = image.header().unwrap();
            let slot = &header.interrupts[event];
            match pending.and_then(|request| slot.outcome(request)) {
                Some(outcome) => answers.lock().unwrap().push(outcome),
                None if pending.is_some() => return,
                None => {}
            }
            let is_set = answers.lock().unwrap().len().is_multiple_of(2);
            pending = Some(slot.ask(0, is_set));
            header.submit_request();
        })
    }

    /// A board answers at the same emulated time on all hosts, and no answer is lost, independent of the time at which
    /// a program asks.
    #[test]
    fn boards_are_asked_at_any_time() {
        let answers = [(); 2].map(|()| Arc::new(Mutex::new(Vec::new())));
        let program = |number: u8, plant: &Plant| asks(number, plant, &answers[usize::from(number)]);
        let mut carrier = Federated::new(&PlantConfig::built_in().unwrap(), 2, 0, program).unwrap();
        for _ in 0..20 {
            carrier.ask(Op::Advance { us: 3_700 }).unwrap();
        }
        carrier.others();
        let [one, other] = [0, 1].map(|number| carrier.all[number].plant.journal());
        assert_eq!(one.hash(), other.hash());
        for (answers, event) in answers.iter().zip([5, 12]) {
            let answers = answers.lock().unwrap();
            assert!(answers.len() >= 10, "event {event}: {answers:?}");
            assert!(answers.iter().all(|outcome| *outcome == 0), "event {event}: {answers:?}");
        }
    }

    /// Runs one round of each exercise, alternately with faults and with stores to any register.
    #[test]
    fn several_hosts_leave_the_journal_of_one() {
        let mut kinds = Vec::new();
        for (number, exercise) in (0_u64..).zip(exercises()) {
            let kind = [RoundKind::Disturbed, RoundKind::Hostile][number as usize % 2];
            let mut rounds = (number * 1000..).map(|seed| Round::draw(seed, &[exercise]).unwrap());
            let round =
                rounds.find(|round| round.kind == kind && (3..=8).contains(&round.moves.len())).unwrap();
            let federates = [(2, 0), (3, 1), (2, 1), (3, 2)][number as usize % 4];
            let text = round.text(false);
            let one = hash(&text, (1, 0));
            assert!(one.is_some());
            assert_eq!(hash(&text, federates), one, "{federates:?}:\n{text}");
            kinds.push(kind.name());
        }
        assert!(kinds.len() > 1, "{kinds:?}");
    }
}
