//! Coupling with other simulators by HELICS: a federate with the exchanged values and buses.
//!
//! The calls of the library block, so one thread makes them. At each exchange it waits for the values that the others
//! publish at exactly this time, in any order of arrival (decision D-576).

use super::combination::ValueFederate;
use super::library::{self, Functions};
use super::{HelicsConfig, HelicsError, Joining};
use crate::coupling::{Interface, PlantOutput, SimulatorOutput, Simulators};
use std::sync::mpsc::{self, Receiver, Sender, TryRecvError};
use std::thread::Builder;
use std::time::Duration;

/// Time by which the HELICS core gives up a wait earlier than the emulator does.
const SOONER: Duration = Duration::from_secs(1);
/// Types of publications that the plant can subscribe to.
const TAKEN: [&str; 4] = ["double", "int64", "int", "bool"];

/// The emulator's side of the connection.
///
/// A process that has used it should end by [`end_process_if_loaded`](super::end_process_if_loaded).
pub struct HelicsSimulators {
    /// Sends the values and frames of the plant to the thread of HELICS.
    given: Option<Sender<PlantOutput>>,
    /// Receives the values and frames of the simulators from the thread of HELICS.
    taken: Receiver<Result<SimulatorOutput, String>>,
    /// Receives a message when the thread has left the federation.
    has_left: Receiver<()>,
    joining: Joining,
}

impl HelicsSimulators {
    /// Starts to join. `first` is published before the clock starts. `wake` is called whenever there is input to take.
    ///
    /// # Errors
    /// There is no library. A missing broker is reported later.
    pub fn join(
        place: HelicsConfig,
        interface: Interface,
        first: PlantOutput,
        wake: impl Fn() + Send + 'static,
    ) -> Result<Self, HelicsError> {
        let functions = library::load()?;
        let (give, given) = mpsc::channel();
        let (outputs, taken) = mpsc::channel();
        let (left, has_left) = mpsc::channel();
        let joining = Joining::of(&place);
        let joined = joining.clone();
        let run = move || {
            let queues = (&given, &outputs);
            if let Err(reason) = talk(functions, &place, &joined, &interface, first, queues, &wake) {
                // If the emulator has ended, the reason is not needed.
                let _ = outputs.send(Err(reason));
                wake();
            }
            drop(left);
        };
        Builder::new().name("simulators".to_owned()).spawn(run).map_err(HelicsError::Thread)?;
        Ok(HelicsSimulators { given: Some(give), taken, has_left, joining })
    }
}

impl Simulators for HelicsSimulators {
    fn give(&mut self, given: PlantOutput) {
        // A thread that has ended has queued its reason, and the emulator takes it next.
        let _ = self.given.as_ref().map(|thread| thread.send(given));
    }

    fn take(&mut self) -> Result<Option<SimulatorOutput>, String> {
        match self.taken.try_recv() {
            Ok(taken) => taken.map(Some),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err("the thread of HELICS has ended".to_owned()),
        }
    }

    fn missing(&self) -> Option<String> {
        self.joining.missing()
    }

    fn leave(&mut self) {
        self.given = None;
        // No message is ever sent on this channel. The channel closes when the thread ends.
        let _ = self.has_left.recv_timeout(self.joining.farewell());
    }
}

/// Body of the thread.
fn talk(
    functions: Functions,
    place: &HelicsConfig,
    joining: &Joining,
    interface: &Interface,
    first: PlantOutput,
    (given, outputs): (&Receiver<PlantOutput>, &Sender<Result<SimulatorOutput, String>>),
    wake: &impl Fn(),
) -> Result<(), String> {
    let Interface { name, publications, subscriptions, endpoints } = interface;
    // The emulator waits for a longer time than the core, because only the core can report the reason.
    let init = HelicsConfig { limit: place.limit.saturating_sub(SOONER), ..place.clone() }.of_core();
    let not_joined = |reason| HelicsError::of_joining(name, reason).to_string();
    let mut federate = ValueFederate::create(functions, name, &init).map_err(not_joined)?;
    federate.register(publications, subscriptions, endpoints).map_err(not_joined)?;
    federate.enter_initializing().map_err(not_joined)?;
    publish(&federate, interface, &first)?;
    federate.enter_executing().map_err(not_joined)?;
    joining.set_done();
    for (subscription, ty) in subscriptions.iter().zip(federate.types()) {
        if !TAKEN.contains(&ty.as_str()) {
            return Err(format!(
                "'{}' is published as {ty}; {} takes double, int and bool",
                subscription.key, subscription.name
            ));
        }
    }
    let mut had_company = false;
    loop {
        let (values, frames) = (federate.values()?, federate.messages());
        let is_idle = values.is_empty() && frames.is_empty();
        had_company |= !is_idle;
        let have_gone = is_idle && place.is_alone(&federate, name, &mut had_company);
        let sent = outputs.send(Ok(SimulatorOutput { values, frames, have_gone }));
        wake();
        // An error here means that the emulator has ended.
        let Some(given) = sent.ok().and_then(|()| given.recv().ok()) else { break };
        publish(&federate, interface, &given)?;
        federate.go_to(given.next_us)?;
    }
    federate.leave();
    Ok(())
}

impl HelicsConfig {
    /// True if all federates except the hosts of the plant have disconnected. False if there has been no other
    /// simulator since the start.
    fn is_alone(&self, federate: &ValueFederate, plant: &str, had_company: &mut bool) -> bool {
        let Some(federates) = federate.federates() else { return false };
        let is_own = |name: &str| name == plant || (0..self.count).any(|host| *name == self.name_of(host));
        let mut others = federates.iter().filter(|it| !is_own(&it.name)).peekable();
        *had_company |= others.peek().is_some();
        *had_company && others.all(|it| it.has_left)
    }
}

fn publish(federate: &ValueFederate, interface: &Interface, given: &PlantOutput) -> Result<(), String> {
    given.values.iter().try_for_each(|(place, value)| federate.publish(*place, *value))?;
    for (place, line) in &given.frames {
        for to in interface.endpoints.get(*place).map_or(&[][..], |endpoint| &endpoint.to) {
            federate.send(*place, to, line)?;
        }
    }
    Ok(())
}
