//! A HELICS federate that exchanges values and messages, as other simulators do (a combination federate).

use super::library::{Functions, Object, text};
use crate::coupling::{Endpoint, Publication, Subscription};
use crate::fmi::{Value, VariableType};
use core::ffi::{CStr, c_int};
use serde::Deserialize;

/// Values of HELICS: `HELICS_DATA_TYPE_DOUBLE`, `_INT`, `_BOOLEAN`.
const DOUBLE: c_int = 1;
const INT: c_int = 2;
const BOOLEAN: c_int = 7;
/// Values of HELICS: `HELICS_FLAG_UNINTERRUPTIBLE`, `HELICS_FLAG_WAIT_FOR_CURRENT_TIME_UPDATE`.
const UNINTERRUPTIBLE: c_int = 1;
const WAIT_FOR_CURRENT_TIME_UPDATE: c_int = 10;
/// Value of HELICS: `HELICS_HANDLE_OPTION_CONNECTION_REQUIRED`.
const CONNECTION_REQUIRED: c_int = 397;
/// Value of HELICS: `HELICS_PROPERTY_TIME_DELTA`.
const TIME_DELTA: c_int = 137;
/// `HELICS_PROPERTY_INT_LOG_LEVEL`, `HELICS_LOG_LEVEL_NO_PRINT`. With this property and value, the library reports
/// problems as errors and does not print them.
const LOG_LEVEL: c_int = 271;
const NO_PRINT: c_int = -4;
/// Shortest time between two grants, in seconds.
const SHORTEST: f64 = 1e-9;
/// Latest time of HELICS, in seconds.
const LATEST: f64 = 9_223_372_036.0;

/// States of federates that have left the federation.
const GONE: [&str; 2] = ["disconnected", "error"];

/// A federate that the broker knows.
pub(super) struct KnownFederate {
    pub(super) name: String,
    /// True if the federate has disconnected or failed.
    pub(super) has_left: bool,
}

/// A federate with values and messages. It must stay on the thread that created it.
pub(super) struct ValueFederate {
    functions: Functions,
    federate: Object,
    name: String,
    publications: Vec<Object>,
    /// Publication that shows other federates if this federate takes part. It is needed because HELICS does not report
    /// federates that leave.
    runs: Option<Object>,
    inputs: Vec<Object>,
    endpoints: Vec<Object>,
}

impl ValueFederate {
    /// Creates the federate.
    ///
    /// # Errors
    /// There is no broker, or the name is in use.
    pub(super) fn create(functions: Functions, name: &str, init: &str) -> Result<Self, String> {
        // SAFETY: here and below: the objects are the library's own and are used on this thread only; texts and bytes
        // live through the calls.
        let set_up = |info| unsafe {
            functions.checked(|it, status| (it.set_time)(info, TIME_DELTA, SHORTEST, status))?;
            functions.checked(|it, status| (it.set_integer)(info, LOG_LEVEL, NO_PRINT, status))?;
            for flag in [UNINTERRUPTIBLE, WAIT_FOR_CURRENT_TIME_UPDATE] {
                functions.checked(|it, status| (it.set_flag)(info, flag, 1, status))?;
            }
            Ok(())
        };
        let federate = functions.create(functions.create_combination, (name, init), set_up)?;
        let (publications, inputs, endpoints) = Default::default();
        Ok(ValueFederate {
            federate,
            name: name.to_owned(),
            functions,
            publications,
            runs: None,
            inputs,
            endpoints,
        })
    }

    /// Registers the publications, the subscriptions and the endpoints.
    pub(super) fn register(
        &mut self,
        publications: &[Publication],
        subscriptions: &[Subscription],
        endpoints: &[Endpoint],
    ) -> Result<(), String> {
        let ValueFederate { functions, federate, .. } = self;
        let federate = *federate;
        let publication = |key: &str, ty, unit: &str| {
            let (key, unit) = (text(key), text(unit));
            functions.checked(|it, status| {
                // SAFETY: as above.
                unsafe { (it.register_publication)(federate, key.as_ptr(), ty, unit.as_ptr(), status) }
            })
        };
        for Publication { key, kind, unit, .. } in publications {
            let ty = match kind {
                VariableType::F64 => DOUBLE,
                VariableType::Bool => BOOLEAN,
                _ => INT,
            };
            self.publications.push(publication(key, ty, unit)?);
        }
        self.runs = Some(publication(&format!("{}/runs", self.name), BOOLEAN, "")?);
        for Subscription { name, key, unit, .. } in subscriptions {
            // The name makes messages of HELICS understandable.
            let name = text(&format!("{name} from {key}"));
            let (key, unit) = (text(key), text(unit));
            // SAFETY: as above.
            unsafe {
                let input = functions.checked(|it, status| {
                    (it.register_input)(federate, name.as_ptr(), DOUBLE, unit.as_ptr(), status)
                })?;
                functions.checked(|it, status| (it.add_target)(input, key.as_ptr(), status))?;
                functions.checked(|it, status| (it.set_input)(input, CONNECTION_REQUIRED, 1, status))?;
                self.inputs.push(input);
            }
        }
        for Endpoint { name, .. } in endpoints {
            let (name, none) = (text(name), text(""));
            self.endpoints.push(functions.checked(|it, status| {
                // SAFETY: as above.
                unsafe { (it.register_endpoint)(federate, name.as_ptr(), none.as_ptr(), status) }
            })?);
        }
        Ok(())
    }

    /// Waits until all federates that the broker expects have joined. Values that a federate publishes after this call
    /// are valid at time 0.
    pub(super) fn enter_initializing(&self) -> Result<(), String> {
        // SAFETY: as above.
        self.functions.checked(|it, status| unsafe { (it.enter_initializing)(self.federate, status) })?;
        self.say_runs(true)
    }

    fn say_runs(&self, runs: bool) -> Result<(), String> {
        self.runs.map_or(Ok(()), |it| self.publish_to(it, Value::Boolean(runs)))
    }

    /// Starts the time of the federation.
    pub(super) fn enter_executing(&self) -> Result<(), String> {
        // SAFETY: as above.
        self.functions.checked(|it, status| unsafe { (it.enter_executing)(self.federate, status) })
    }

    /// Waits until the federation reaches a time in microseconds.
    pub(super) fn go_to(&self, time_us: u64) -> Result<(), String> {
        let time = time_us as f64 * 1e-6;
        // SAFETY: as above.
        let granted =
            self.functions.checked(|it, status| unsafe { (it.request_time)(self.federate, time, status) })?;
        if granted >= LATEST { Err("the federation has ended".to_owned()) } else { Ok(()) }
    }

    /// Returns the federates that the broker knows; `None` if HELICS gives no answer.
    pub(super) fn federates(&self) -> Option<Vec<KnownFederate>> {
        #[derive(Deserialize)]
        struct Answer {
            federates: Vec<Entry>,
        }
        #[derive(Deserialize)]
        struct Entry {
            attributes: Attributes,
            state: String,
        }
        #[derive(Deserialize)]
        struct Attributes {
            name: String,
        }
        let (root, what) = (text("root"), text("current_state"));
        // SAFETY: as above; the answer lasts until the query is freed, and is copied before.
        let answer = unsafe {
            let query = (self.functions.create_query)(root.as_ptr(), what.as_ptr());
            let answer =
                self.functions.checked(|it, status| (it.execute_query)(query, self.federate, status));
            let answer = answer.ok().filter(|answer| !answer.is_null());
            let copy = answer.map(|answer| CStr::from_ptr(answer).to_string_lossy().into_owned());
            (self.functions.free_query)(query);
            copy
        };
        let answer: Answer = serde_json::from_str(&answer?).ok()?;
        let known = |it: Entry| KnownFederate {
            name: it.attributes.name,
            has_left: GONE.contains(&it.state.as_str()),
        };
        Some(answer.federates.into_iter().map(known).collect())
    }

    pub(super) fn publish(&self, place: usize, value: Value) -> Result<(), String> {
        self.publications.get(place).map_or(Ok(()), |it| self.publish_to(*it, value))
    }

    fn publish_to(&self, it: Object, value: Value) -> Result<(), String> {
        // SAFETY: as above.
        self.functions.checked(|functions, status| unsafe {
            match value {
                Value::Integer(value) => (functions.publish_integer)(it, value, status),
                Value::Float(value) => (functions.publish_double)(it, value, status),
                Value::Boolean(value) => (functions.publish_boolean)(it, value.into(), status),
            }
        })
    }

    /// Returns types of the publications that this federate subscribes to.
    pub(super) fn types(&self) -> Vec<String> {
        let of = |input: &Object| {
            // SAFETY: as above; the text belongs to the input and lives as long as the input.
            let ty = unsafe { (self.functions.type_of)(*input) };
            if ty.is_null() {
                return String::new();
            }
            // SAFETY: as above; the text is copied at once.
            unsafe { CStr::from_ptr(ty) }.to_string_lossy().into_owned()
        };
        self.inputs.iter().map(of).collect()
    }

    /// Returns the values that were published since the last call, with their indices.
    pub(super) fn values(&self) -> Result<Vec<(usize, f64)>, String> {
        let mut found = Vec::new();
        for (place, input) in self.inputs.iter().copied().enumerate() {
            // SAFETY: as above.
            if unsafe { (self.functions.is_updated)(input) } != 0 {
                // SAFETY: as above.
                let value = self.functions.checked(|it, status| unsafe { (it.get_double)(input, status) })?;
                found.push((place, value));
            }
        }
        Ok(found)
    }

    /// Returns the messages that have arrived, with the indices of their endpoints.
    pub(super) fn messages(&self) -> Vec<(usize, Vec<u8>)> {
        let mut found = Vec::new();
        let Functions { has_message, get_message, bytes_of, count_of, free_message, .. } = self.functions;
        for (place, endpoint) in self.endpoints.iter().copied().enumerate() {
            // SAFETY: as above; the message owns the bytes and has their correct count; they are copied before it is
            // freed.
            unsafe {
                while has_message(endpoint) != 0 {
                    let message = get_message(endpoint);
                    let (bytes, count) = (bytes_of(message).cast::<u8>(), count_of(message));
                    if !bytes.is_null() {
                        let count = usize::try_from(count).unwrap_or_default();
                        found.push((place, core::slice::from_raw_parts(bytes, count).to_vec()));
                    }
                    free_message(message);
                }
            }
        }
        found
    }

    /// Sends a text to an endpoint of another federate.
    pub(super) fn send(&self, place: usize, to: &str, line: &str) -> Result<(), String> {
        let Some(endpoint) = self.endpoints.get(place).copied() else { return Ok(()) };
        let to = text(to);
        let count = c_int::try_from(line.len()).map_err(|_| "a message is too long".to_owned())?;
        self.functions.checked(|it, status| {
            // SAFETY: as above.
            unsafe { (it.send)(endpoint, line.as_ptr().cast(), count, to.as_ptr(), status) }
        })
    }

    /// Publishes the end of this federate, and leaves the federation.
    pub(super) fn leave(self) {
        let _ = self.say_runs(false);
        // SAFETY: as above. A leaving federate ignores the result.
        let _ = self.functions.checked(|it, status| unsafe { (it.disconnect)(self.federate, status) });
    }
}
