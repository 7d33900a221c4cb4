//! Tests of emulators in this process that share a plant.

use crate::common::unique_name;
use commram::federation::{FederateConfig, NoExchange};
use commram::plant::PlantConfig;
use commram::runtime::{Clock, Emulator, Options};
use std::time::Duration;

/// Only an emulator that was started as a federate can join. The firmware of any other emulator would see a program's
/// request before the other emulators receive it.
#[test]
fn an_emulator_with_a_private_plant_joins_no_federation() {
    let join = |is_federate| {
        let options = Options {
            instance: unique_name(),
            clock: Clock::Stepped,
            busy: false,
            novram: None,
            is_federate,
        };
        let mut emulator = Emulator::start(&PlantConfig::built_in().unwrap(), options).unwrap();
        let limit = Duration::from_secs(30);
        let part = FederateConfig { own: 0, count: 1, follows: false, limit, exchange_us: None };
        emulator.join(part, Box::new(NoExchange)).map_err(|error| error.to_string())
    };
    assert_eq!(join(true), Ok(()));
    assert!(join(false).unwrap_err().contains("set Options::is_federate"));
}
