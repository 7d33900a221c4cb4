//! `commram run --federate`: one plant over several hosts.

use super::error::CliError;
use crate::federation::{MOST, Part};
use crate::helics::{ByHelics, Place};
use crate::runtime::{Clock, Emulator};
use crate::time;
use std::time::Duration;

/// How this emulator shares its plant with others.
#[derive(clap::Args)]
pub(crate) struct FederateArgs {
    /// Share the plant with other emulators by HELICS: this one's number, from 0, and how many there are, such as 0/2
    #[arg(long, value_name = "N/COUNT", value_parser = number)]
    federate: Option<(u8, u8)>,
    /// Let time pass as the other federates want, and wait for no client of this one
    #[arg(long, requires = "federate")]
    follow: bool,
    /// Where the HELICS broker is
    #[arg(long, value_name = "ADDRESS", requires = "federate", default_value = "tcp://127.0.0.1:23404")]
    broker: String,
    /// What the federation is called, if the broker has several
    #[arg(long, value_name = "NAME", requires = "federate", default_value = "commram")]
    federation: String,
    /// How long another federate or the broker may not be heard of, in real time
    #[arg(long, value_name = "TIME", requires = "federate", default_value = "30s", value_parser = limit)]
    limit: Duration,
}

fn number(text: &str) -> Result<(u8, u8), String> {
    let parts = text.split_once('/').and_then(|(own, count)| Some((own.parse().ok()?, count.parse().ok()?)));
    let right = |&(own, count): &(u8, u8)| own < count && (2..=MOST).contains(&count);
    parts.filter(right).ok_or_else(|| {
        format!(
            "it is a number from 0 on, a slash and how many federates there are, 2 to {MOST}: 0/2 and 1/2"
        )
    })
}

fn limit(text: &str) -> Result<Duration, String> {
    let us = time::parse(text).map_err(|error| error.to_string())?;
    let limit = Duration::from_micros(us);
    if (Duration::from_secs(2)..=Duration::from_secs(86_400)).contains(&limit) {
        Ok(limit)
    } else {
        Err("it is 2s to 24h".to_owned())
    }
}

impl FederateArgs {
    /// Refuses what several hosts cannot have.
    ///
    /// # Errors
    /// What, and what would be right.
    pub(crate) fn check(&self, clock: Clock, keeps_novram: bool) -> Result<(), CliError> {
        let refuse = |text: &str, right: &str| {
            Err(CliError::Argument { text: text.to_owned(), right: right.to_owned() })
        };
        match self.federate {
            None => Ok(()),
            Some(_) if !clock.is_stepped() => {
                refuse("--federate", "federates have one clock, a stepped one; add --clock stepped")
            }
            Some(_) if keeps_novram => refuse(
                "--novram",
                "federates begin alike: without NOVRAM of their own, or all --from one snapshot",
            ),
            Some(_) => Ok(()),
        }
    }

    /// Lets the emulator join, if it is to share its plant.
    ///
    /// # Errors
    /// There is no library of HELICS, or the plant has doors.
    pub(crate) fn join(&self, emulator: &mut Emulator) -> Result<(), CliError> {
        let Some((own, count)) = self.federate else { return Ok(()) };
        if let Some((bus, door)) = emulator.doors().first() {
            return Err(CliError::Argument {
                text: format!("door {door} to bus {bus}"),
                right: "a federate has no doors: their guests would be on one host only".to_owned(),
            });
        }
        let place = Place {
            federation: self.federation.clone(),
            own,
            count,
            broker: self.broker.clone(),
            limit: self.limit,
        };
        let exchange = ByHelics::join(place, emulator.waker())?;
        let part = Part { own, count, follows: self.follow, limit: self.limit };
        Ok(emulator.join(part, Box::new(exchange))?)
    }
}
