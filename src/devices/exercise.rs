//! What `commram soak` puts a device through: a plant, and what a program that uses the device rightly does with it.

use core::ops::RangeInclusive;

/// An exercise: a scenario whose middle is drawn by lot.
///
/// Its [`script`](Exercise::script) defines, beside a function for each [`Move`], `start()`, which brings a plant at power-on to where moves
/// can be made, and `recover()`, which does that after whatever has happened. Each may use `pass(us)`, which lets time pass in the slices of
/// the run, and the names of its [setting](Exercise::settings).
#[derive(Debug)]
pub struct Exercise {
    /// Its name, unique among all.
    pub name: &'static str,
    /// The plant file. `${NAME}` stands for what the setting has under this name.
    pub plant: &'static str,
    /// Of these one is taken: names and what they stand for, as a script would write it.
    pub settings: &'static [&'static [(&'static str, &'static str)]],
    /// Functions in the language of scenarios.
    pub script: &'static str,
    /// What the program does.
    pub moves: &'static [Move],
    /// What a program must not do.
    pub wrongs: &'static [Wrong],
    /// Rules of warnings that its right program may meet.
    pub allowed: &'static [&'static str],
}

/// Something that a program does, from a state in which anything can be done to such a state again: moves can be made in any
/// order, repeated and left out.
#[derive(Debug)]
pub struct Move {
    /// The function. Its first parameter tells whether nothing is disturbed, so that everything must go as the manual says.
    pub name: &'static str,
    /// What its other parameters can be.
    pub parameters: &'static [RangeInclusive<i64>],
    /// How often it is made, compared with others.
    pub weight: u32,
}

impl Move {
    /// A move that is made as often as others.
    #[must_use]
    pub const fn new(name: &'static str, parameters: &'static [RangeInclusive<i64>]) -> Self {
        Move { name, parameters, weight: 1 }
    }

    /// The same, made so many times as often.
    #[must_use]
    pub const fn often(self, weight: u32) -> Self {
        Move { weight, ..self }
    }
}

/// Something that a program does wrongly, in active operation.
#[derive(Debug)]
pub struct Wrong {
    /// Lines of a scenario.
    pub script: &'static str,
    /// The rule that must find it.
    pub rule: &'static str,
}
