//! Values of variables, and the motors that an external model turns.

use super::variables::{Quantity, ShaftValue};
use crate::plant::Plant;
use core::f64::consts::TAU;
use serde::{Deserialize, Serialize};

/// Number of increments of a drive's angle in a revolution (decision D-162).
const REVOLUTION: f64 = 4_294_967_296.0;

/// A value of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A value of any integer type.
    Integer(i64),
    /// A value of type `Float64`.
    Float(f64),
    /// A value of type `Boolean`.
    Boolean(bool),
}

/// For each drive, true if a model turns its motor, and the speed in rad/s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Shafts(Vec<(bool, f64)>);

impl Shafts {
    /// Creates a value in which no model turns a motor.
    pub(crate) fn of(plant: &Plant) -> Self {
        Shafts(vec![(false, 0.0); plant.drives().len()])
    }

    /// Returns the number of drives.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn are_finite(&self) -> bool {
        self.0.iter().all(|shaft| shaft.1.is_finite())
    }

    /// Sets whether a model turns the motor of this drive.
    pub(crate) fn set_modelled(&mut self, drive: usize, is_modelled: bool) {
        if let Some(shaft) = self.0.get_mut(drive) {
            shaft.0 = is_modelled;
        }
    }

    /// Sets the speed at which the model turns this drive, in rad/s. It must be finite.
    pub(crate) fn set_speed(&mut self, drive: usize, speed: f64) {
        if let Some(shaft) = self.0.get_mut(drive) {
            shaft.1 = speed;
        }
    }

    /// Returns the drives with a motor that a model turns, each with its speed in the unit of the plant.
    pub(crate) fn turned(&self) -> impl Iterator<Item = (usize, i32)> {
        let all = self.0.iter().enumerate();
        all.filter(|(_, shaft)| shaft.0).map(|(drive, (_, speed))| {
            let increments = speed * REVOLUTION / TAU / 1000.0;
            // The conversion saturates.
            (drive, increments.round() as i32)
        })
    }

    /// Returns the value of a variable except time.
    pub(crate) fn value(&self, plant: &Plant, quantity: Quantity) -> Value {
        match quantity {
            Quantity::Time => Value::Float(plant.now() as f64 * 1e-6),
            Quantity::Register { plc, offset, width, ty, .. } => {
                // The load does not fail, because the layout has a register at this place.
                Value::Integer(ty.number(plant.load(plc, offset, width).unwrap_or_default()))
            }
            Quantity::Shaft { drive, value } => self.at_shaft(plant, drive, value),
        }
    }

    fn at_shaft(&self, plant: &Plant, drive: usize, value: ShaftValue) -> Value {
        let speed = |increments: i32| Value::Float(f64::from(increments) * 1000.0 * TAU / REVOLUTION);
        let of_model = self.0.get(drive).copied().unwrap_or_default();
        let Some(shaft) = plant.shaft(drive) else { return Value::Float(0.0) };
        match value {
            ShaftValue::Reference => {
                let state = plant.drive(drive).map(|details| details.state);
                speed(state.map_or(0, |state| state.speed_reference))
            }
            ShaftValue::Demand => speed(shaft.demand),
            ShaftValue::IsFed => Value::Boolean(shaft.is_fed),
            ShaftValue::Actual => speed(shaft.speed),
            ShaftValue::Angle => Value::Float(f64::from(shaft.angle) * TAU / REVOLUTION),
            ShaftValue::IsModelled => Value::Boolean(of_model.0),
            ShaftValue::Modelled => Value::Float(of_model.1),
        }
    }
}
