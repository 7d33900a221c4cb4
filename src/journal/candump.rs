//! The log format of `candump -L`, which can-utils (`log2asc`, `canplayer`) and Wireshark read:
//! `(0000000002.001234) drives 583#7900210000000000`. Only frames; times are emulated time since power-on.

use super::{Format, Names, Record, Source};
use std::fmt::Write;

/// Longest name of a network interface under Linux; readers need not take longer ones.
const LONGEST_NAME: usize = 15;

/// Writes frames as `candump -L` does.
pub struct Candump {
    buses: Vec<String>,
}

impl Candump {
    /// A writer with these names. A bus whose name is longer than the 15 characters of an interface name is called
    /// by its number: `bus0`.
    pub fn new(names: &Names) -> Self {
        let buses = names.buses.iter().enumerate();
        let interface = |(index, name): (usize, &String)| {
            if name.len() <= LONGEST_NAME { name.clone() } else { number(index, &names.buses) }
        };
        Candump { buses: buses.map(interface).collect() }
    }
}

/// A name made of the bus's number that no other bus has.
fn number(index: usize, others: &[String]) -> String {
    let mut name = format!("bus{index}");
    while others.contains(&name) {
        name.push('_');
    }
    name
}

impl Format for Candump {
    fn record(&mut self, record: &Record, out: &mut String) {
        let (Some(frame), Source::Bus(bus)) = (record.event.candump(), record.event.source()) else { return };
        let (seconds, us) = (record.time_us / 1_000_000, record.time_us % 1_000_000);
        let bus = self.buses.get(usize::from(bus)).map_or("can", String::as_str);
        // Writing to a String cannot fail.
        let _ = write!(out, "({seconds:010}.{us:06}) {bus} {frame}");
        out.push('\n');
    }

    fn skip(&mut self, _: &Record) {}

    /// The format has no place for it.
    fn gap(&mut self, _: u64, _: &mut String) -> bool {
        false
    }
}
