//! Passes the input of other simulators to the plant, or refuses it.

use super::conversion::convert;
use super::{Coupling, Subscription};
use crate::fmi::{Quantity, ShaftValue, Value};
use crate::journal::candump;
use crate::layout::Owner;
use crate::request::{Execution, Host, Op};
use core::fmt::Display;

/// Counts the refused values or frames of one input.
#[derive(Default)]
pub(super) struct Refusals(pub(super) u64);

impl Refusals {
    /// Counts a refusal and logs the first, the tenth, the hundredth, ...
    fn note(&mut self, what: impl Display, why: impl Display) {
        self.0 += 1;
        if self.0 == 10_u64.pow(self.0.ilog10()) {
            let times = if self.0 == 1 { "time" } else { "times" };
            tracing::warn!("{what}: {why}; it was refused ({} {times} so far)", self.0);
        }
    }
}

impl Coupling {
    pub(super) fn take_value(&mut self, host: &mut dyn Host, place: usize, value: f64) {
        let Some(subscription) = self.interface.subscriptions.get(place) else { return };
        let has_switch = |of: usize| {
            let all = self.interface.subscriptions.iter();
            let mut switches = all.filter_map(|it| match it.quantity {
                Quantity::Shaft { drive, value: ShaftValue::IsModelled } => Some(drive),
                _ => None,
            });
            switches.any(|drive| drive == of)
        };
        let outcome = match (subscription.quantity, convert(subscription.kind, value)) {
            (_, Err(why)) => Err(why),
            (Quantity::Register { plc, offset, width, ty, owner }, Ok(Value::Integer(value))) => {
                let bits = value as u32 & ty.mask();
                // A register that already has the value is not written, as for the inputs of a unit of FMI
                // (decision D-535).
                if owner == Owner::Both || host.plant().load(plc, offset, width) != Ok(bits) {
                    enter(host, &Op::Poke { plc, offset, width, value: bits })
                } else {
                    Ok(())
                }
            }
            (Quantity::Shaft { drive, value: ShaftValue::IsModelled }, Ok(Value::Boolean(is_modelled))) => {
                self.shafts.set_modelled(drive, is_modelled);
                Ok(())
            }
            (Quantity::Shaft { drive, .. }, Ok(Value::Float(speed))) => {
                if !has_switch(drive) {
                    self.shafts.set_modelled(drive, true);
                }
                self.shafts.set_speed(drive, speed);
                Ok(())
            }
            // Does not occur, because the kind determines the type of the value.
            _ => Ok(()),
        };
        if let Err(why) = outcome {
            let Subscription { name, key, .. } = subscription;
            self.refused_values[place].note(format_args!("{name} from '{key}'"), why);
        }
    }

    pub(super) fn take_frame(&mut self, host: &mut dyn Host, place: usize, text: &[u8]) {
        let Some(endpoint) = self.interface.endpoints.get(place) else { return };
        let text = String::from_utf8_lossy(text);
        // The text may be a complete line of a log. Its last word is the frame; the other words are ignored.
        let word = text.split_whitespace().next_back().unwrap_or_default();
        let frame = candump::frame(word);
        let frame =
            frame.map_err(|right| format!("{:?}: {right}", text.chars().take(80).collect::<String>()));
        let outcome =
            frame.and_then(|frame| enter(host, &Op::BusSend { bus: endpoint.bus, frame: Some(frame) }));
        if let Err(why) = outcome {
            self.refused_frames[place].note(format_args!("a frame for {}", endpoint.bus_name), why);
        }
    }
}

/// Executes an operation as if a client had requested it.
fn enter(host: &mut dyn Host, op: &Op) -> Result<(), String> {
    match Execution::default().run(host, op) {
        Ok(_) => Ok(()),
        Err(refused) => Err(refused.text),
    }
}
