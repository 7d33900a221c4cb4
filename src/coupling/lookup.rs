//! Looks up the names of the file in a plant.

use super::{CouplingConfig, CouplingError, ValueEntry};
use crate::fmi::{Causality, Quantity, Variable, VariableFinder, VariableType};
use crate::identity::BusIndex;
use crate::plant::Plant;
use std::collections::{BTreeSet, HashMap};

/// All values and frames that the plant exchanges with other simulators.
#[derive(Clone, Debug)]
pub struct Interface {
    /// Name of the plant among the simulators.
    pub name: String,
    /// Values that the plant publishes.
    pub publications: Vec<Publication>,
    /// Values that the plant subscribes to.
    pub subscriptions: Vec<Subscription>,
    /// Buses of the plant that exchange frames.
    pub endpoints: Vec<Endpoint>,
}

/// A value that the plant publishes.
#[derive(Clone, Debug)]
pub struct Publication {
    /// Name of the value among the simulators.
    pub key: String,
    /// Type of the value.
    pub kind: VariableType,
    /// Unit of the value; empty if it has none.
    pub unit: &'static str,
    pub(super) quantity: Quantity,
}

/// A value that the plant subscribes to.
#[derive(Clone, Debug)]
pub struct Subscription {
    /// Name of the value in the plant.
    pub name: String,
    /// Name of the value among the simulators.
    pub key: String,
    /// Type of the value.
    pub kind: VariableType,
    /// Unit of the value; empty if it has none.
    pub unit: &'static str,
    pub(super) quantity: Quantity,
}

/// A bus that exchanges frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Endpoint {
    /// Name of the endpoint among the simulators.
    pub name: String,
    /// Name of the bus in the plant.
    pub bus_name: String,
    /// Endpoints that receive the frames.
    pub to: Vec<String>,
    pub(super) bus: BusIndex,
}

impl Interface {
    pub(super) fn of(config: &CouplingConfig, plant: &Plant) -> Result<Self, CouplingError> {
        let CouplingConfig { name, publish, subscribe, buses, .. } = config;
        let mut finder = VariableFinder::of(plant);
        let mut publications = Vec::new();
        for it in publish {
            let found = look_up(&mut finder, it)?;
            if it.key.is_some() && found.len() > 1 {
                let why = "several values cannot have one key; leave it out, or name one of them".to_owned();
                return Err(CouplingError::Unfit { name: it.value.clone(), why });
            }
            publications.extend(found.into_iter().map(|found| {
                let Variable { name: value, kind, unit, quantity, .. } = found;
                let key = it.key.clone().unwrap_or_else(|| format!("{name}/{value}"));
                Publication { key, kind, unit, quantity }
            }));
        }
        let mut subscriptions = Vec::new();
        for it in subscribe {
            subscriptions.push(subscription(&mut finder, name, it)?);
        }
        let known: Vec<&str> = plant.bus_names().collect();
        let numbers: HashMap<&str, usize> =
            known.iter().enumerate().map(|(bus, name)| (*name, bus)).collect();
        let mut endpoints = Vec::new();
        for it in buses {
            let bus = numbers.get(&*it.name).copied().ok_or_else(|| CouplingError::Unfit {
                name: it.name.clone(),
                why: format!("there is no such bus; the buses are: {}", known.join(", ")),
            })?;
            let bus = BusIndex::at(bus);
            if !plant.is_can(bus) {
                let kind = plant.buses().get(bus.index()).map_or("", |bus| bus.family());
                let can = known.iter().enumerate().filter(|(index, _)| plant.is_can(BusIndex::at(*index)));
                let can: Vec<&str> = can.map(|(_, name)| *name).collect();
                let can = if can.is_empty() { "none".to_owned() } else { can.join(", ") };
                let why = format!(
                    "it is a bus of the kind {kind}; frames are exchanged with buses of the kind can: {can}"
                );
                return Err(CouplingError::Unfit { name: it.name.clone(), why });
            }
            let endpoint = it.endpoint.clone().unwrap_or_else(|| format!("{name}/{}", it.name));
            let (bus_name, to) = (it.name.clone(), it.to.clone());
            endpoints.push(Endpoint { name: endpoint, bus_name, to, bus });
        }
        let all = publications.iter().map(|it| &it.key).chain(endpoints.iter().map(|it| &it.name));
        let mut keys = BTreeSet::new();
        if let Some(twice) = all.clone().find(|key| !keys.insert(*key)) {
            let why = "the plant publishes this twice; give each a separate key".to_owned();
            return Err(CouplingError::Unfit { name: twice.clone(), why });
        }
        let mut taken = BTreeSet::new();
        if let Some(twice) = subscriptions.iter().find(|it| !taken.insert(&it.name)) {
            let why = "it has two subscriptions; remove one of them".to_owned();
            return Err(CouplingError::Unfit { name: twice.name.clone(), why });
        }
        Ok(Interface { name: name.clone(), publications, subscriptions, endpoints })
    }
}

fn look_up(finder: &mut VariableFinder<'_>, it: &ValueEntry) -> Result<Vec<Variable>, CouplingError> {
    finder.find(&it.value).map_err(|why| CouplingError::Unknown { name: it.value.clone(), why })
}

fn subscription(
    finder: &mut VariableFinder<'_>,
    plant_name: &str,
    it: &ValueEntry,
) -> Result<Subscription, CouplingError> {
    let unfit = |why: &str| CouplingError::Unfit { name: it.value.clone(), why: why.to_owned() };
    let mut found = look_up(finder, it)?;
    let (Some(one), true) = (found.pop(), found.is_empty()) else {
        return Err(unfit("it names several values; subscribe to each with a separate key"));
    };
    if !matches!(one.causality, Causality::Input | Causality::Parameter) {
        return Err(unfit(
            "the plant publishes it and cannot subscribe to it; only registers that a PLC's program writes can \
                be subscribed to",
        ));
    }
    let key = it.key.clone().unwrap_or_else(|| format!("{plant_name}/{}", one.name));
    let Variable { name, kind, unit, quantity, .. } = one;
    Ok(Subscription { name, key, kind, unit, quantity })
}
