//! The map `this` of a running script.

use super::data::{Data, Update};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::sync::atomic::{AtomicUsize, Ordering};
use rhai::Dynamic;
use std::collections::HashMap;

/// The map `this` in the form of data. Snapshots contain the data, and the data may move to another thread
/// (D-838).
#[derive(Debug)]
pub(super) struct State {
    data: Data,
    /// Version number of this content. No other content in this process has this number. So a thread can keep
    /// the engine's value for the next call ([`LiveStates`]).
    version: usize,
    /// Weight of the content.
    weight: u64,
}

/// Returns a number that no state has.
fn new_version() -> usize {
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

impl State {
    /// Returns the empty map.
    pub(super) fn empty() -> Self {
        State::new(Data::empty_map())
    }

    fn new(data: Data) -> Self {
        State { weight: data.weight(), data, version: new_version() }
    }

    /// Returns the weight of the map.
    pub(super) fn weight(&self) -> u64 {
        self.weight
    }
}

impl SnapshotFields for State {
    fn save(&self, to: &mut Saving) {
        self.data.save(to);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.version = new_version();
        self.data.restore(from)?;
        self.weight = self.data.weight();
        Ok(())
    }
}

/// Maximum number of values that a thread keeps for a script. There may be several values because several
/// devices can have the same folder, and because a plant can return to the past.
const MOST_KEPT: usize = 64;

/// The engine's values for the states of a script, by their versions. A call with a known state need not
/// create a value.
#[derive(Debug, Default)]
pub(super) struct LiveStates(HashMap<usize, Dynamic>);

impl LiveStates {
    /// Returns the value for a call.
    pub(super) fn take(&mut self, state: &State) -> Dynamic {
        self.0.remove(&state.version).unwrap_or_else(|| state.data.value())
    }

    /// Takes over the value after a call.
    ///
    /// # Errors
    /// The value is not a map, is too large, or cannot be saved. The state is then unchanged.
    pub(super) fn put_back(&mut self, this: Dynamic, state: &mut State) -> Result<(), String> {
        match state.data.take_over(&this) {
            Update::Same => {}
            Update::Changed => state.version = new_version(),
            // The next call creates the value from the data. So the value contains only what data can keep.
            Update::Other => {
                *state = State::new(Data::of_state(&this)?);
                return Ok(());
            }
        }
        if self.0.len() >= MOST_KEPT {
            self.0.clear();
        }
        self.0.insert(state.version, this);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rhai::Map;

    #[test]
    fn values_are_kept_for_the_content_that_they_had() {
        let (mut live, mut state) = (LiveStates::default(), State::empty());
        let number = |value: &Dynamic| value.read_lock::<Map>().and_then(|map| map.get("n")?.as_int().ok());
        let set = |number: i64| Dynamic::from(Map::from([("n".into(), number.into())]));
        live.put_back(set(1), &mut state).unwrap();
        let mut saving = Saving::default();
        state.save(&mut saving);
        live.put_back(set(2), &mut state).unwrap();
        assert_eq!((number(&live.take(&state)), live.0.len()), (Some(2), 0));
        live.put_back(set(3), &mut state).unwrap();
        // A restored state must not get the value of a later state.
        state.restore(&mut Saved::new(saving.bytes())).unwrap();
        assert_eq!(number(&live.take(&state)), Some(1));
        assert!(live.put_back(Dynamic::UNIT, &mut state).unwrap_err().contains("must stay a map"));
        assert_eq!(number(&live.take(&state)), Some(1));
        for number in 0..1000 {
            live.put_back(set(number), &mut state).unwrap();
        }
        assert!(live.0.len() <= MOST_KEPT);
    }
}
