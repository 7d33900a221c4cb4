//! A fault as people write it: with names, in the fields of a plant file.

use super::kind::{Field, Kind};
use super::{
    Effect, Fault, FaultError, FrameEffect, FrameSlot, Frames, Limit, MAX_DELAY_US, MAX_DURATION_US,
    MAX_JITTER_US, MAX_SLOWNESS_US, NodeEffect, OffsetAt, Refusal, SlaveEffect, SyncEffect,
};
use crate::devices::cansync::bus::codec::updown::MAX_OFFSET;
use crate::devices::omega_drive_line_2::records::BAPS_NODE;
use crate::journal::Names;
use core::fmt;
use serde::{Deserialize, Serialize};

/// A `[[fault]]` of a plant file, and the arguments of `commram fault add`. `docs/faults.md` describes the
/// fields of each kind.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct FaultSpec {
    /// Name of the kind.
    pub kind: String,
    /// Name of the bus; may be left out if there is just one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bus: Option<String>,
    /// Name of the PLC; may be left out if there is just one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plc: Option<String>,
    /// CANsync node, 1 or 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub node: Option<u64>,
    /// Slave number, 0 to 31.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slave: Option<u64>,
    /// WRC1, RDC1, WRC2, RDC2, CC or RC.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slot: Option<String>,
    /// Identifier, 0 to 16#7FF.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<u64>,
    /// The bits of the identifier that count; all if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mask: Option<u64>,
    /// Delay in emulated microseconds; `us` means the same.
    #[serde(alias = "us", skip_serializing_if = "Option::is_none")]
    pub delay_us: Option<u64>,
    /// Jitter in microseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude_us: Option<u64>,
    /// Error number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<u64>,
    /// Offset of a block in bytes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<u64>,
    /// Begin in emulated microseconds since power-on; at once if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_us: Option<u64>,
    /// Number of hits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<u64>,
    /// Duration in emulated microseconds; `for_us` means the same.
    #[serde(alias = "for_us", skip_serializing_if = "Option::is_none")]
    pub duration_us: Option<u64>,
}

impl FaultSpec {
    /// The fault this describes in an installation with these names.
    ///
    /// # Errors
    /// [`FaultError`] names the field and what would be right. Whether the slave or node is there only the
    /// installation can tell: [`Fault::check`].
    pub fn resolve(&self, names: &Names) -> Result<Fault, FaultError> {
        let kind =
            Kind::from_name(&self.kind).ok_or_else(|| FaultError::UnknownKind { kind: self.kind.clone() })?;
        let reader = Reader { spec: self, kind, names };
        reader.refuse_foreign_fields()?;
        let fault =
            Fault { effect: reader.effect()?, at_us: self.at_us.unwrap_or(0), limit: reader.limit()? };
        fault.check_numbers().map_err(|refusal| FaultError::Refused { kind, refusal })?;
        Ok(fault)
    }

    /// The description of a fault.
    pub fn of(fault: &Fault, names: &Names) -> Self {
        let mut spec = FaultSpec { kind: fault.kind().name().to_owned(), ..FaultSpec::default() };
        spec.at_us = (fault.at_us > 0).then_some(fault.at_us);
        match fault.limit {
            Limit::UntilCleared => {}
            Limit::Count(count) => spec.count = Some(count.into()),
            Limit::Duration(us) => spec.duration_us = Some(us.into()),
        }
        match fault.effect {
            Effect::Frame { bus, frames, what } => {
                spec.bus = Some(names.bus(bus).into_owned());
                spec.slot = frames.slot.map(|slot| slot.name().to_owned());
                if frames.mask != 0 {
                    spec.id = Some(frames.id.into());
                    spec.mask = (frames.mask != Frames::MAX_ID).then_some(frames.mask.into());
                }
                spec.delay_us = match what {
                    FrameEffect::Lose | FrameEffect::Duplicate(0) => None,
                    FrameEffect::Delay(us) | FrameEffect::Duplicate(us) => Some(us.into()),
                };
            }
            Effect::Sync { bus, what } => {
                spec.bus = Some(names.bus(bus).into_owned());
                if let SyncEffect::Jitter(us) = what {
                    spec.amplitude_us = Some(us.into());
                }
            }
            Effect::Slave { bus, slave, what } => {
                spec.bus = Some(names.bus(bus).into_owned());
                spec.slave = Some(slave.into());
                match what {
                    SlaveEffect::Off | SlaveEffect::Busy => {}
                    SlaveEffect::Late(us) => spec.delay_us = Some(us.into()),
                    SlaveEffect::Error(number) | SlaveEffect::Trip(number) => {
                        spec.error = Some(number.into());
                    }
                    SlaveEffect::WrongOffset { at, offset } => {
                        let slot = match at {
                            OffsetAt::Job => FrameSlot::Cc,
                            OffsetAt::Answer => FrameSlot::Rc,
                        };
                        spec.slot = Some(slot.name().to_owned());
                        spec.offset = offset.map(u64::from);
                    }
                }
            }
            Effect::Node { plc, node, what: NodeEffect::BusOff | NodeEffect::Overrun } => {
                spec.plc = Some(names.plc(plc).into_owned());
                spec.node = Some(node.into());
            }
            Effect::Node { plc, what, .. } => {
                spec.plc = Some(names.plc(plc).into_owned());
                match what {
                    NodeEffect::Trip(number) => spec.error = Some(number.into()),
                    NodeEffect::Slow(us) => spec.delay_us = Some(us.into()),
                    NodeEffect::BusOff | NodeEffect::Overrun | NodeEffect::Silent => {}
                }
            }
        }
        spec
    }

    /// Sets a field that holds a number; fields that hold a name stay as they are.
    pub fn set_value(&mut self, field: Field, value: u64) {
        let place = match field {
            Field::Bus | Field::Plc | Field::Slot => return,
            Field::Node => &mut self.node,
            Field::Slave => &mut self.slave,
            Field::Id => &mut self.id,
            Field::Mask => &mut self.mask,
            Field::DelayUs => &mut self.delay_us,
            Field::AmplitudeUs => &mut self.amplitude_us,
            Field::Error => &mut self.error,
            Field::Offset => &mut self.offset,
            Field::AtUs => &mut self.at_us,
            Field::Count => &mut self.count,
            Field::DurationUs => &mut self.duration_us,
        };
        *place = Some(value);
    }

    fn value(&self, field: Field) -> Option<u64> {
        match field {
            Field::Bus | Field::Plc | Field::Slot => None,
            Field::Node => self.node,
            Field::Slave => self.slave,
            Field::Id => self.id,
            Field::Mask => self.mask,
            Field::DelayUs => self.delay_us,
            Field::AmplitudeUs => self.amplitude_us,
            Field::Error => self.error,
            Field::Offset => self.offset,
            Field::AtUs => self.at_us,
            Field::Count => self.count,
            Field::DurationUs => self.duration_us,
        }
    }

    fn text(&self, field: Field) -> Option<&str> {
        match field {
            Field::Bus => self.bus.as_deref(),
            Field::Plc => self.plc.as_deref(),
            Field::Slot => self.slot.as_deref(),
            _ => None,
        }
    }
}

/// `lose_frame bus=drives slot=WRC1 id=16#101 count=3`
impl fmt::Display for FaultSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.kind)?;
        for field in Field::ALL {
            match (self.text(field), self.value(field)) {
                (Some(text), _) => write!(f, " {field}={text}")?,
                (_, Some(value)) if field == Field::Error => write!(f, " {field}=16#{value:04X}")?,
                (_, Some(value)) if field.is_hexadecimal() => write!(f, " {field}=16#{value:03X}")?,
                (_, Some(value)) => write!(f, " {field}={value}")?,
                (None, None) => {}
            }
        }
        Ok(())
    }
}

/// A description while it is read.
struct Reader<'a> {
    spec: &'a FaultSpec,
    kind: Kind,
    names: &'a Names,
}

impl Reader<'_> {
    fn refuse_foreign_fields(&self) -> Result<(), FaultError> {
        let given = |field: &Field| self.spec.text(*field).is_some() || self.spec.value(*field).is_some();
        let common = [Field::AtUs, Field::Count, Field::DurationUs];
        let foreign = |field: &Field| !self.kind.fields().contains(field) && !common.contains(field);
        match Field::ALL.into_iter().find(|field| given(field) && foreign(field)) {
            Some(field) => Err(FaultError::NotForKind { kind: self.kind, field }),
            None => Ok(()),
        }
    }

    fn effect(&self) -> Result<Effect, FaultError> {
        let frame = |what| Ok(Effect::Frame { bus: self.bus()?, frames: self.frames()?, what });
        let sync = |what| Ok(Effect::Sync { bus: self.bus()?, what });
        let slave = |what| {
            let slave = self.required(Field::Slave, 0, 31, "give the slave number, 0 to 31")?;
            Ok(Effect::Slave { bus: self.bus()?, slave, what })
        };
        let node = |what| {
            let node = self.required(Field::Node, 1, 2, "give 1 (slave) or 2 (master)")?;
            Ok(Effect::Node { plc: self.plc()?, node, what })
        };
        let baps = |what| Ok(Effect::Node { plc: self.plc()?, node: BAPS_NODE, what });
        let in_us = "give it in microseconds";
        let delay = || self.required(Field::DelayUs, 1, MAX_DELAY_US.into(), in_us);
        let fault_number = || self.required(Field::Error, 1, 0xFFFF, "give the fault number, 1 to 16#FFFF");
        match self.kind {
            Kind::LoseFrame => frame(FrameEffect::Lose),
            Kind::DelayFrame => frame(FrameEffect::Delay(delay()?)),
            Kind::DuplicateFrame => {
                let gap = self.optional(Field::DelayUs, 0, MAX_DELAY_US.into())?;
                frame(FrameEffect::Duplicate(gap.unwrap_or(0)))
            }
            Kind::LoseSync => sync(SyncEffect::Lose),
            Kind::JitterSync => {
                let most = MAX_JITTER_US.into();
                sync(SyncEffect::Jitter(self.required(Field::AmplitudeUs, 1, most, in_us)?))
            }
            Kind::SlaveOff => slave(SlaveEffect::Off),
            Kind::SlaveLate => slave(SlaveEffect::Late(delay()?)),
            Kind::SlaveBusy => slave(SlaveEffect::Busy),
            Kind::SlaveError => {
                let right = "give the error number, for example 16#FFFB";
                slave(SlaveEffect::Error(self.required(Field::Error, 0, 0xFFFF, right)?))
            }
            Kind::WrongOffset => {
                let at = match self.slot()? {
                    Some(FrameSlot::Cc) => OffsetAt::Job,
                    _ => OffsetAt::Answer,
                };
                let offset = self.optional(Field::Offset, 0, MAX_OFFSET.into())?;
                slave(SlaveEffect::WrongOffset { at, offset })
            }
            Kind::BusOff => node(NodeEffect::BusOff),
            Kind::Overrun => node(NodeEffect::Overrun),
            Kind::DriveFault => slave(SlaveEffect::Trip(fault_number()?)),
            Kind::BapsDriveFault => baps(NodeEffect::Trip(fault_number()?)),
            Kind::BapsSilent => baps(NodeEffect::Silent),
            Kind::BapsSlow => {
                let most = MAX_SLOWNESS_US.into();
                baps(NodeEffect::Slow(self.required(Field::DelayUs, 1, most, in_us)?))
            }
        }
    }

    fn frames(&self) -> Result<Frames, FaultError> {
        let most = Frames::MAX_ID.into();
        let id = self.optional(Field::Id, 0, most)?;
        let mask = self.optional(Field::Mask, 0, most)?;
        let slot = self.slot()?;
        match (id, mask) {
            (Some(id), mask) => Ok(Frames { id, mask: mask.unwrap_or(Frames::MAX_ID), slot }),
            (None, None) => Ok(Frames { slot, ..Frames::ALL }),
            (None, Some(_)) => {
                Err(self.missing(Field::Id, "a mask needs the identifier it is compared with".to_owned()))
            }
        }
    }

    fn slot(&self) -> Result<Option<FrameSlot>, FaultError> {
        let Some(name) = &self.spec.slot else { return Ok(None) };
        let known = self.kind.slots().iter().copied().find(|slot| slot.name().eq_ignore_ascii_case(name));
        known.map(Some).ok_or_else(|| FaultError::Slot { kind: self.kind, slot: name.clone() })
    }

    fn limit(&self) -> Result<Limit, FaultError> {
        let count = self.optional(Field::Count, 1, u32::MAX.into())?;
        let duration = self.optional(Field::DurationUs, 1, MAX_DURATION_US.into())?;
        match (count, duration) {
            (None, None) if self.kind.happens_once() => Ok(Limit::Count(1)),
            (None, None) => Ok(Limit::UntilCleared),
            (Some(count), None) => Ok(Limit::Count(count)),
            (None, Some(us)) => Ok(Limit::Duration(us)),
            (Some(_), Some(_)) => Err(FaultError::TwoLimits { kind: self.kind }),
        }
    }

    fn bus(&self) -> Result<u16, FaultError> {
        let known = &self.names.buses;
        match &self.spec.bus {
            Some(bus) => index(known, bus).ok_or_else(|| FaultError::UnknownBus {
                kind: self.kind,
                bus: bus.clone(),
                known: joined(known),
            }),
            None => self.only(Field::Bus, known),
        }
    }

    fn plc(&self) -> Result<u16, FaultError> {
        let known = &self.names.plcs;
        match &self.spec.plc {
            Some(plc) => index(known, plc).ok_or_else(|| FaultError::UnknownPlc {
                kind: self.kind,
                plc: plc.clone(),
                known: joined(known),
            }),
            None => self.only(Field::Plc, known),
        }
    }

    /// What a left out name means: the only one there is.
    fn only(&self, field: Field, known: &[String]) -> Result<u16, FaultError> {
        match known {
            [_] => Ok(0),
            known => Err(self.missing(field, format!("give one of: {}", joined(known)))),
        }
    }

    fn missing(&self, field: Field, right: String) -> FaultError {
        FaultError::Missing { kind: self.kind, field, right }
    }

    fn required<T: TryFrom<u64>>(
        &self,
        field: Field,
        least: u64,
        most: u64,
        right: &str,
    ) -> Result<T, FaultError> {
        self.optional(field, least, most)?.ok_or_else(|| self.missing(field, right.to_owned()))
    }

    fn optional<T: TryFrom<u64>>(
        &self,
        field: Field,
        least: u64,
        most: u64,
    ) -> Result<Option<T>, FaultError> {
        let Some(value) = self.spec.value(field) else { return Ok(None) };
        let refusal = Refusal::Range { field, value, least, most };
        match T::try_from(value) {
            Ok(number) if (least..=most).contains(&value) => Ok(Some(number)),
            _ => Err(FaultError::Refused { kind: self.kind, refusal }),
        }
    }
}

fn index(names: &[String], name: &str) -> Option<u16> {
    names.iter().position(|known| known == name).and_then(|index| u16::try_from(index).ok())
}

fn joined(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
