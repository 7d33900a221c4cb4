//! `commram run --federate` and `--exchange`: one plant on several hosts, and co-simulation with other simulators.

use super::error::CliError;
use crate::coupling::{Coupling, CouplingConfig};
use crate::door::DoorSpec;
use crate::federation::{Exchange, FederateConfig, FederationError, MOST, NoExchange};
use crate::helics::{BrokerAddress, HelicsConfig, HelicsExchange, HelicsSimulators};
use crate::plant::Plant;
use crate::runtime::{Clock, Emulator};
use crate::time;
use std::path::PathBuf;
use std::time::Duration;

/// How this emulator shares its plant with other processes.
#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("helics").args(["federate", "exchange"]).multiple(true)))]
pub(crate) struct FederateArgs {
    /// Share the plant with other emulators by HELICS: number of this emulator, from 0, and number of emulators,
    /// for example 0/2
    #[arg(long, value_name = "N/COUNT", value_parser = number)]
    federate: Option<(u8, u8)>,
    /// Exchange values and frames with other simulators by HELICS, as described in this file (docs/guide/helics.md)
    #[arg(add = super::complete::files(&["toml"]), long, value_name = "FILE.toml")]
    exchange: Option<PathBuf>,
    /// Follow the time of the other federates and simulators, without waiting for clients of this emulator
    #[arg(long = "follow-others", alias = "follow", requires = "helics")]
    follow: bool,
    /// Address of the HELICS broker: tcp://HOST:PORT
    #[arg(long, value_name = "ADDRESS", requires = "helics", default_value = "tcp://127.0.0.1:23404")]
    broker: BrokerAddress,
    /// Name of the federation, if the broker has several
    #[arg(long, value_name = "NAME", requires = "helics", default_value = "commram")]
    federation: String,
    /// Longest silence of another federate, a simulator or the broker, in real time
    #[arg(long, value_name = "TIME", requires = "helics", default_value = "30s", value_parser = limit)]
    limit: Duration,
}

fn number(text: &str) -> Result<(u8, u8), String> {
    let parts = text.split_once('/').and_then(|(own, count)| Some((own.parse().ok()?, count.parse().ok()?)));
    let right = |&(own, count): &(u8, u8)| own < count && (1..=MOST).contains(&count);
    parts.filter(right).ok_or_else(|| {
        format!("write a number from 0, a slash and the number of federates, at most {MOST}: 0/2 and 1/2")
    })
}

fn limit(text: &str) -> Result<Duration, String> {
    let us = time::parse(text).map_err(|error| error.to_string())?;
    let limit = Duration::from_micros(us);
    if (Duration::from_secs(2)..=Duration::from_secs(86_400)).contains(&limit) {
        Ok(limit)
    } else {
        Err("write a time from 2s to 24h".to_owned())
    }
}

impl FederateArgs {
    /// Refuses options that are not possible on several hosts.
    ///
    /// # Errors
    /// The error contains the option and its correct form.
    pub(crate) fn check(&self, clock: Clock, keeps_novram: bool) -> Result<(), CliError> {
        let refuse = |text: &str, right: &str| {
            Err(CliError::Argument { text: text.to_owned(), right: right.to_owned() })
        };
        match (self.federate, &self.exchange) {
            (None, None) => Ok(()),
            (Some((_, 1)), None) => {
                refuse("--federate", "there must be at least two federates, or one with --exchange")
            }
            (Some((1.., _)), Some(_)) => refuse("--exchange", "only federate 0 can have an exchange"),
            (federate, _) if !clock.is_stepped() => refuse(
                if federate.is_some() { "--federate" } else { "--exchange" },
                "federates share one stepped clock; add --clock stepped",
            ),
            _ if keeps_novram => refuse(
                "--novram",
                "all federates need the same initial state: no NOVRAM directory, or all --from the same snapshot",
            ),
            _ => Ok(()),
        }
    }

    /// Refuses a plant with doors if the emulator shares its plant. Each door is given with the name of its bus.
    ///
    /// # Errors
    /// The emulator shares its plant; the error names the first door.
    pub(crate) fn check_doors<'a>(
        &self,
        mut doors: impl Iterator<Item = (&'a str, DoorSpec)>,
    ) -> Result<(), CliError> {
        match doors.next().filter(|_| self.is_federate()) {
            None => Ok(()),
            Some((bus, door)) => Err(CliError::Argument {
                text: format!("door {door} to bus {bus}"),
                right: "a federate cannot have doors: their guests would be on one host only".to_owned(),
            }),
        }
    }

    /// True if a file describes an exchange with other simulators.
    pub(crate) fn has_exchange(&self) -> bool {
        self.exchange.is_some()
    }

    /// True if the emulator shares its plant.
    pub(crate) fn is_federate(&self) -> bool {
        self.federate.is_some() || self.exchange.is_some()
    }

    /// Joins the federation, if the emulator shares its plant.
    ///
    /// # Errors
    /// The HELICS library is missing, or the plant has doors.
    pub(crate) fn join(&self, emulator: &mut Emulator) -> Result<(), CliError> {
        if !self.is_federate() {
            return Ok(());
        }
        self.check_doors(emulator.doors().into_iter())?;
        let (own, count) = self.federate.unwrap_or((0, 1));
        let place = HelicsConfig {
            federation: self.federation.clone(),
            own,
            count,
            broker: self.broker.clone(),
            limit: self.limit,
        };
        let coupling = self.coupling(emulator.plant())?;
        let exchange: Box<dyn Exchange> = match count {
            1 => Box::new(NoExchange),
            _ => Box::new(HelicsExchange::join(place.clone(), emulator.waker())?),
        };
        let exchange_us = coupling.as_ref().map(Coupling::period_us);
        emulator.join(
            FederateConfig { own, count, follows: self.follow, limit: self.limit, exchange_us },
            exchange,
        )?;
        if let Some(mut coupling) = coupling {
            let (interface, first) = (coupling.interface().clone(), coupling.first(emulator.plant()));
            let simulators = HelicsSimulators::join(place, interface, first, emulator.waker())?;
            coupling.connect(Box::new(simulators));
            emulator.couple(coupling);
        }
        Ok(())
    }

    /// Reads the description of the exchange with other simulators, and finds its names in the plant.
    ///
    /// # Errors
    /// The file cannot be read, has an error, or contains names that the plant does not have.
    pub(crate) fn coupling(&self, plant: &Plant) -> Result<Option<Coupling>, CliError> {
        let Some(path) = &self.exchange else { return Ok(None) };
        let coupling = CouplingConfig::load(path)
            .and_then(|config| Coupling::new(&config, plant, self.limit))
            .map_err(FederationError::from);
        Ok(Some(coupling.map_err(crate::runtime::RuntimeError::from)?))
    }
}
