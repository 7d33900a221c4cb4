//! The requests of readers, and the thread that polls an instance for all of them.

use super::round::{Counts, Poller, Round};
use crate::cli::dump::Blocks;
use crate::cli::error::CliError;
use crate::cli::pause::last_words;
use crate::cli::peek::ReadTarget;
use crate::cli::web::link::{self, Connection};
use crate::cli::web::problem::Problem;
use crate::cli::web::router::{is_on, repeated, switch};
use crate::cli::web::strand;
use crate::devices;
use crate::identity::DeviceIndex;
use crate::journal::Changed;
use crate::request::Op;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::broadcast;

/// Real time between two polls.
const INTERVAL: Duration = Duration::from_millis(33);
/// Number of rounds that are kept. A reader that falls further behind loses rounds.
const KEPT: usize = 16;
/// Maximum number of followed names for each reader, and of the registers that they name.
const MAX_FOLLOWED: usize = 256;

/// A state of the instance, as an operation replies it or as a command prints it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum StateKind {
    Boards,
    Buses,
    Drives,
    Faults,
    Findings,
    Forces,
    Scene,
}

impl StateKind {
    const ALL: [Self; 7] =
        [Self::Boards, Self::Buses, Self::Drives, Self::Faults, Self::Findings, Self::Forces, Self::Scene];

    /// Returns the name of the state, as a field of the query and as an event.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Boards => "boards",
            Self::Buses => "buses",
            Self::Drives => "drives",
            Self::Faults => "faults",
            Self::Findings => "findings",
            Self::Forces => "forces",
            Self::Scene => "scene",
        }
    }

    /// Returns the operation that returns the state. `None` for the front panels of the boards, which need several
    /// operations.
    pub(super) fn op(self) -> Option<Op> {
        Some(match self {
            Self::Boards => return None,
            Self::Buses => Op::Buses,
            Self::Drives => Op::Drives,
            Self::Faults => Op::FaultList,
            Self::Findings => Op::Findings,
            Self::Forces => Op::Forces,
            Self::Scene => Op::Scene,
        })
    }
}

/// Registers that a reader follows under one name.
pub(super) struct Followed {
    /// The name as the reader wrote it.
    pub text: String,
    pub target: ReadTarget,
    /// Memory ranges of the registers: index of the PLC, first byte in the image, number of bytes.
    pub stretches: Vec<(DeviceIndex, u32, u32)>,
}

/// Data that a reader requests.
#[derive(Clone, Default)]
pub(super) struct Wish {
    /// Registers whose values and changes the reader gets.
    pub followed: Vec<Arc<Followed>>,
    /// Registers whose values the reader gets, but not each change.
    pub shown: Vec<Arc<Followed>>,
    pub states: BTreeSet<StateKind>,
    pub clock: bool,
    /// Kinds of journal records. An empty set means all kinds, `None` means no records.
    pub journal: Option<BTreeSet<String>>,
}

impl Wish {
    /// Parses a query. Requests the emulator to record the changes of the followed registers.
    ///
    /// # Errors
    /// The query contains a field twice, an unknown field or register, or follows too many registers.
    pub(super) fn of_query(connection: &mut Connection, query: &[(String, String)]) -> Result<Self, Problem> {
        if let Some(name) = repeated(query.iter().map(|(name, _)| name.as_str())) {
            return Err(
                Problem::wrong_use(format!("events: field `{name}` occurs twice")).with("field", name)
            );
        }
        let mut wish = Self::default();
        for (name, text) in query {
            let is_on = is_on(text);
            let switched = || switch("events", name, text);
            let state = StateKind::ALL.into_iter().find(|state| state.name() == name);
            match (name.as_str(), state) {
                ("follow", _) => wish.followed.extend(named(connection, "follow", text)?),
                ("values", _) => wish.shown.extend(named(connection, "values", text)?),
                ("journal", _) if text != "0" && text != "false" => {
                    let kinds = if is_on { Vec::new() } else { parts(name, text)? };
                    let kinds = kinds.into_iter().map(known_kind).collect::<Result<_, _>>()?;
                    wish.journal = Some(kinds);
                }
                ("journal", _) => wish.journal = None,
                ("clock", _) => wish.clock = switched()?,
                (_, Some(state)) if switched()? => drop(wish.states.insert(state)),
                (_, Some(state)) => drop(wish.states.remove(&state)),
                _ => {
                    return Err(Problem::wrong_use(format!("events: unknown field `{name}`"))
                        .with("field", name.as_str()));
                }
            }
        }
        wish.check_count()?;
        follow(connection, &wish)?;
        Ok(wish)
    }

    fn check_count(&self) -> Result<(), Problem> {
        let (names, count) = self
            .registers()
            .fold((0, 0), |(names, count), register| (names + 1, count + register.stretches.len()));
        if count.max(names) > MAX_FOLLOWED {
            return Err(Problem::wrong_use(format!(
                "events: at most {MAX_FOLLOWED} registers can be followed"
            )));
        }
        Ok(())
    }

    /// Returns the registers whose values the reader gets. A name in both lists occurs twice.
    pub(super) fn registers(&self) -> impl Iterator<Item = &Arc<Followed>> {
        self.followed.iter().chain(&self.shown)
    }

    /// True if the reader gets each change of at least one byte of the changed register.
    pub(super) fn follows(&self, what: &Changed) -> bool {
        self.followed.iter().flat_map(|followed| &followed.stretches).any(|it| overlaps(what, it))
    }
}

/// True if at least one byte of the changed register is in the memory range.
pub(super) fn overlaps(what: &Changed, &(plc, first, len): &(DeviceIndex, u32, u32)) -> bool {
    plc == what.plc && first < what.offset + what.how.width.bytes() && what.offset < first + len
}

/// Finds the registers of a list of names.
///
/// # Errors
/// The list has an empty name, or a name of no register.
fn named(connection: &Connection, field: &str, names: &str) -> Result<Vec<Arc<Followed>>, Problem> {
    let find = |text: &str| {
        let target = ReadTarget::find(&connection.session, text)?;
        let stretches = target.stretches();
        Ok(Arc::new(Followed { text: text.to_owned(), target, stretches }))
    };
    parts(field, names)?.into_iter().map(find).collect()
}

/// Splits a list at its commas; an empty text is an empty list.
///
/// # Errors
/// A part of the list is empty.
fn parts<'a>(field: &str, text: &'a str) -> Result<Vec<&'a str>, Problem> {
    let parts: Vec<_> = text.split(',').filter(|_| !text.is_empty()).collect();
    if parts.iter().all(|part| !part.trim().is_empty()) {
        return Ok(parts);
    }
    let detail =
        format!("events: `{field}={text}` has an empty name; write names separated by single commas");
    Err(Problem::wrong_use(detail).with("field", field))
}

/// Checks that a kind of journal record has this name.
fn known_kind(name: &str) -> Result<String, Problem> {
    let kinds = &devices::catalogue().kinds;
    if kinds.iter().any(|kind| kind.name() == name) {
        return Ok(name.to_owned());
    }
    let known: Vec<_> = kinds.iter().map(|kind| kind.name()).collect();
    let text = format!("events: there is no kind of record `{name}`, only {}", known.join(", "));
    Err(Problem::wrong_use(text).with("field", "journal"))
}

/// Requests the emulator to record the changes of the registers.
///
/// # Errors
/// The emulator refuses the request, or has ended.
pub(super) fn follow(connection: &Connection, wish: &Wish) -> Result<(), CliError> {
    let stretches: Vec<_> =
        wish.registers().flat_map(|followed| followed.stretches.iter().copied()).collect();
    Blocks::follow_stretches(&connection.session, &stretches)
}

/// The events of an instance, for any number of readers.
pub(in crate::cli::web) struct Feed(Arc<Shared>);

struct Shared {
    instance: String,
    state: Mutex<State>,
}

struct State {
    /// Data that each reader wants, by the number of the reader.
    wishes: BTreeMap<u64, Wish>,
    /// Number of the next reader.
    next: u64,
    /// Channel to which the thread sends its rounds; `None` if no thread runs.
    rounds: Option<broadcast::Sender<Arc<Round>>>,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Events for one reader. Dropping this value unsubscribes the reader.
pub(super) struct Subscription {
    pub rounds: broadcast::Receiver<Arc<Round>>,
    number: u64,
    shared: Arc<Shared>,
}

impl Drop for Subscription {
    fn drop(&mut self) {
        self.shared.state().wishes.remove(&self.number);
    }
}

impl Feed {
    pub(in crate::cli::web) fn new(instance: &str) -> Self {
        let state = Mutex::new(State { wishes: BTreeMap::new(), next: 0, rounds: None });
        Self(Arc::new(Shared { instance: instance.to_owned(), state }))
    }

    /// Adds a reader. The first reader starts the thread.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub(super) fn subscribe(&self, wish: Wish) -> Result<Subscription, Problem> {
        let mut state = self.0.state();
        let rounds = match &state.rounds {
            Some(sender) => sender.subscribe(),
            None => {
                let (sender, rounds) = broadcast::channel(KEPT);
                let (shared, thread) =
                    (Arc::clone(&self.0), std::thread::Builder::new().name("web-feed".to_owned()));
                let own = sender.clone();
                let work = move || {
                    let (stopped, last) = (Arc::clone(&shared), own.clone());
                    strand::at_the_end(move || {
                        link::abandon();
                        // The next reader starts another thread.
                        stopped.state().rounds = None;
                        let reason = link::broken(&stopped.instance).to_string();
                        drop(last.send(Arc::new(Round::end(reason, false, Counts::default()))));
                    });
                    poll(&shared, &own);
                };
                let started = thread.spawn(work);
                started.map_err(|reason| CliError::Process { reason })?;
                state.rounds = Some(sender);
                rounds
            }
        };
        let number = state.next;
        state.next += 1;
        state.wishes.insert(number, wish);
        Ok(Subscription { rounds, number, shared: Arc::clone(&self.0) })
    }
}

/// Combines the wishes of all readers; `None` if all readers have disconnected, so that the thread ends.
fn wishes(shared: &Shared) -> Option<Wish> {
    let mut state = shared.state();
    if state.wishes.is_empty() {
        state.rounds = None;
        return None;
    }
    let mut all = Wish::default();
    for wish in state.wishes.values() {
        add_new(&mut all.followed, &wish.followed);
        add_new(&mut all.shown, &wish.shown);
        all.states.extend(&wish.states);
        if wish.journal.is_some() {
            all.journal = Some(BTreeSet::new());
        }
    }
    Some(all)
}

/// Adds the registers whose names are not in the list.
fn add_new(list: &mut Vec<Arc<Followed>>, more: &[Arc<Followed>]) {
    for followed in more {
        if list.iter().all(|known| known.text != followed.text) {
            list.push(Arc::clone(followed));
        }
    }
}

/// Polls until all readers have disconnected, or the emulator has ended.
fn poll(shared: &Shared, rounds: &broadcast::Sender<Arc<Round>>) {
    let mut poller = None;
    while let Some(wish) = wishes(shared) {
        let start = Instant::now();
        let polled = match &mut poller {
            Some(poller) => Poller::poll(poller, &wish),
            None => strand::guarded(|| {
                let connection = Connection::open(&shared.instance)?;
                Poller::new(connection)
            })
            .and_then(|new| poller.insert(new).poll(&wish)),
        };
        match polled {
            // Sending fails without a reader; the loop then ends at its next repetition.
            Ok(Some(round)) => drop(rounds.send(Arc::new(round))),
            // The emulator is busy with another client, so there is no round this time.
            Ok(None) => {}
            Err(error) => {
                // The next reader starts another thread.
                shared.state().rounds = None;
                let rest = poller.as_mut().and_then(Poller::take_rest);
                if let Some(rest) = rest {
                    drop(rounds.send(Arc::new(rest)));
                }
                let (reason, is_complete) = (error.to_string(), last_words(&error).is_some());
                let sent = poller.as_ref().map_or_else(Counts::default, Poller::sent);
                drop(rounds.send(Arc::new(Round::end(reason, is_complete, sent))));
                break;
            }
        }
        std::thread::sleep(INTERVAL.saturating_sub(start.elapsed()));
    }
    if let Some(poller) = poller {
        strand::guarded(|| poller.close());
    }
}
