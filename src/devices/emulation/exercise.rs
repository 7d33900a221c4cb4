//! Exercises for `commram soak`: a plant, and the correct actions of a program that uses the device.

use core::ops::RangeInclusive;

/// An exercise: a scenario with a middle part that is generated at random.
///
/// The [`script`](Exercise::script) of the exercise defines a function for each [`Move`], and two more
/// functions: `start()` brings a plant from power-on to the state in which moves are possible. `recover()`
/// brings it to this state from any other state. These functions may use `pass(us)`, which advances the clock
/// in the slices of the run. They may also use the names of the exercise's [setting](Exercise::settings).
#[derive(Debug)]
pub struct Exercise {
    /// Name of the exercise, unique among all exercises.
    pub name: &'static str,
    /// Text of the plant file. In it, `${NAME}` is replaced by the value that the setting has for this name.
    pub plant: &'static str,
    /// Alternative settings, each a list of names and values. A run uses one of the settings. Values are written as in
    /// a script.
    pub settings: &'static [&'static [(&'static str, &'static str)]],
    /// Functions in the language of scenarios.
    pub script: &'static str,
    /// The correct actions of the program.
    pub moves: &'static [Move],
    /// Actions that a program must not take.
    pub wrongs: &'static [Wrong],
    /// Rules with warnings that even a correct program can cause.
    pub allowed: &'static [&'static str],
}

/// Actions of a program. They start and end in a state in which all moves are possible. So moves can be made
/// in any order, repeated, and omitted.
#[derive(Debug)]
pub struct Move {
    /// Name of the function. Its first parameter is true if there are no faults and no stray stores. Every
    /// step must then succeed as the manual specifies.
    pub name: &'static str,
    /// Ranges of the other parameters of the function.
    pub parameters: &'static [RangeInclusive<i64>],
    /// Frequency of the move, relative to other moves.
    pub weight: u32,
}

impl Move {
    /// Returns a move with the usual weight.
    #[must_use]
    pub const fn new(name: &'static str, parameters: &'static [RangeInclusive<i64>]) -> Self {
        Move { name, parameters, weight: 1 }
    }

    /// Returns a copy of the move that is chosen `weight` times as often as a usual move.
    #[must_use]
    pub const fn often(self, weight: u32) -> Self {
        Move { weight, ..self }
    }
}

/// A wrong action of a program, taken in active operation.
#[derive(Debug)]
pub struct Wrong {
    /// Lines of a scenario.
    pub script: &'static str,
    /// The rule that must report the action.
    pub rule: &'static str,
}
