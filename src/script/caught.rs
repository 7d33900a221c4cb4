//! Errors of verbs in the form in which scripts catch them.

use super::ScenarioError;
use rhai::{Dynamic, Engine, EvalAltResult, INT};
use std::rc::Rc;

/// The value of `err` in `catch (err)` after an error of a verb. If the script throws this value again, the original
/// error is kept.
#[derive(Clone)]
pub(super) struct Caught(pub Rc<ScenarioError>);

impl Caught {
    /// Converts the error to a value that the script can catch.
    pub(super) fn thrown(error: ScenarioError) -> Box<EvalAltResult> {
        EvalAltResult::ErrorRuntime(Dynamic::from(Self(Rc::new(error))), rhai::Position::NONE).into()
    }

    /// Returns the error in one line.
    pub(super) fn message(&self) -> String {
        match &*self.0 {
            ScenarioError::Failed(failure) => failure.what.clone(),
            other => other.to_string(),
        }
    }

    /// Returns the kind of the failure; `wrong_use` if it is not a failure.
    fn kind(&self) -> &'static str {
        self.0.failure_kind().map_or("wrong_use", |kind| kind.name())
    }

    /// Returns a property of a failure; `()` (the unit value of scripts) for errors that do not have the property.
    fn of_failure<T: Into<Dynamic>>(&self, get: impl FnOnce(&super::Failure) -> Option<T>) -> Dynamic {
        match &*self.0 {
            ScenarioError::Failed(failure) => get(failure).map_or(Dynamic::UNIT, Into::into),
            _ => Dynamic::UNIT,
        }
    }
}

/// Gives scripts access to the fields of errors.
pub(super) fn register(engine: &mut Engine) {
    engine
        .register_type_with_name::<Caught>("Error")
        .register_fn("to_string", |error: &mut Caught| error.message())
        .register_fn("to_debug", |error: &mut Caught| error.message())
        .register_get("message", |error: &mut Caught| error.message())
        .register_get("kind", |error: &mut Caught| error.kind())
        .register_get("register", |error: &mut Caught| error.of_failure(|it| it.register.clone()))
        .register_get("address", |error: &mut Caught| error.of_failure(|it| it.address.clone()))
        .register_get("expected", |error: &mut Caught| error.of_failure(|it| Some(it.numbers?.expected)))
        .register_get("actual", |error: &mut Caught| error.of_failure(|it| Some(it.numbers?.actual)))
        .register_get("section", |error: &mut Caught| error.of_failure(|it| it.section.clone()))
        .register_get("time", |error: &mut Caught| {
            error.of_failure(|it| Some(INT::try_from(it.time_us).unwrap_or(INT::MAX)))
        });
}
