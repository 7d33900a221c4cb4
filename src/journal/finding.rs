//! A single finding: rule, location, value.

use super::catalogue::Catalogue;
use super::event::Source;
use super::fields::Fields;
use super::findings::LONGEST_NOTE;
use super::kind::EventText;
use super::reader::Reader;
use super::rule::Rule;
use crate::event_kinds;
use crate::identity::{BusIndex, DeviceIndex};
use crate::layout::{Address, DeviceFit, RegType, RegisterPhase, RegisterRef, Width, format_value};
use crate::memory::{HEADER_SIZE, header};
use crate::plain_text::without_interpreted;

/// Returns the text of a note as the journal keeps it.
pub(super) fn note(text: &str) -> String {
    let text = &text[..text.floor_char_boundary(LONGEST_NOTE)];
    without_interpreted(text)
}

/// Base of participants' numbers in findings on a bus. A participant's number is added to this base, so that the sum
/// differs from all numbers of guests.
const PARTICIPANTS: u32 = 0x100;

/// A rule was broken at a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Rule that was violated.
    pub rule: &'static Rule,
    /// Index of the device in the plant; or index of a bus, see [`Finding::at_bus`].
    pub plc: DeviceIndex,
    /// Offset of the register in the device's RAM; on a bus the number of the guest, or 256 plus the number of the
    /// participant.
    pub offset: u32,
    /// Phase of the device. It selects the structure of the register if structures overlay each other.
    pub live: RegisterPhase,
    /// Value that was written.
    pub value: u32,
    /// Lateness in microseconds; 0 for rules without a deadline.
    pub late_us: u32,
}

event_kinds! {
    /// A finding as an event of the journal: with the number of its rule.
    Found = 40, "finding", Rare, at plc {
        /// Number of the rule.
        rule: u8,
        /// Offset of the register in the device's RAM.
        offset: u32,
        /// Phase of the device. It selects the structure of the register if structures overlay each other.
        live: RegisterPhase,
        /// Value that was written.
        value: u32,
        /// Lateness in microseconds; 0 for rules without a deadline.
        late_us: u32,
    }
}

impl Found {
    /// Returns the finding; `None` if no rule has this number.
    pub fn finding(&self, catalogue: &Catalogue) -> Option<Finding> {
        let Found { plc, rule, offset, live, value, late_us } = *self;
        Some(Finding { rule: catalogue.rule(rule)?, plc, offset, live, value, late_us })
    }
}

impl From<Finding> for Found {
    #[inline]
    fn from(finding: Finding) -> Self {
        let Finding { rule, plc, offset, live, value, late_us } = finding;
        Found { plc, rule: rule.number(), offset, live, value, late_us }
    }
}

/// Returns the note of the record. Journals may come from unknown authors, so control characters are replaced.
fn note_of(reader: &Reader) -> Option<String> {
    reader.octets().map(|octets| note(&String::from_utf8_lossy(&octets)))
}

impl EventText for Found {
    fn is_known(&self, catalogue: &Catalogue) -> bool {
        catalogue.rule(self.rule).is_some()
    }

    fn text(&self, reader: &mut Reader) -> String {
        let Some(finding) = self.finding(reader.catalogue) else { return String::new() };
        let (fitted, rule) = (reader.names.fitted(self.plc), finding.rule);
        let name = finding.name(fitted).unwrap_or_default();
        let late = if self.late_us > 0 { format!(", {} us late", self.late_us) } else { String::new() };
        let (severity, value) = (rule.severity(), finding.value_text(fitted));
        let address = finding.address(fitted).map_or_else(String::new, |address| format!(" ({address})"));
        let note = note_of(reader).map_or_else(String::new, |note| format!(": {note}"));
        format!("{severity} {rule}: {name}{address} {value}{late}{note}")
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let Some(finding) = self.finding(reader.catalogue) else { return Fields::new() };
        let (fitted, rule) = (reader.names.fitted(self.plc), finding.rule);
        Fields::new()
            .with("rule", rule.id())
            .with("severity", rule.severity().name())
            .with("register", finding.name(fitted))
            .with_any("address", finding.address(fitted).map(|address| address.to_string()))
            .with("value", finding.number(fitted))
            .with_any("late_us", Some(self.late_us).filter(|late| *late > 0))
            .with("text", rule.text())
            .with_any("note", note_of(reader))
    }
}

impl Finding {
    /// Creates the finding that guest number `guest` of bus number `bus` has broken a rule. Such a finding has no
    /// register.
    #[must_use]
    pub const fn at_bus(rule: &'static Rule, bus: BusIndex, guest: u8, value: u32) -> Self {
        let (plc, offset) = (DeviceIndex(Source::BUSES | bus.number()), guest as u32);
        Finding { rule, plc, offset, live: RegisterPhase::ALWAYS, value, late_us: 0 }
    }

    /// Creates the finding that participant `number` of bus number `bus` has broken a rule. Such a finding has no
    /// register. Its value is shown as a decimal number.
    #[must_use]
    pub const fn at_participant(rule: &'static Rule, bus: BusIndex, number: u8, value: u32) -> Self {
        let (plc, offset) = (DeviceIndex(Source::BUSES | bus.number()), PARTICIPANTS | number as u32);
        Finding { rule, plc, offset, live: RegisterPhase::ALWAYS, value, late_us: 0 }
    }

    /// Returns the device or bus of the finding.
    #[must_use]
    pub const fn source(&self) -> Source {
        Source::of_index(self.plc)
    }

    /// Returns the register; `None` if the finding is in the header page, or not at a register.
    #[must_use]
    pub fn register(&self, fitted: impl Into<DeviceFit>) -> Option<RegisterRef> {
        if self.is_at_bus() {
            return None;
        }
        let fitted = fitted.into();
        let found =
            fitted.registers_at(fitted.device().at(Width::Byte, self.offset), Some(self.live)).ok()?;
        found.into_iter().find(|register| register.offset() == self.offset)
    }

    /// Returns the name of the register or of the field in the header page, such as `node2.w_OPTION_STATUS` or
    /// `header.magic`. For a guest or participant, its name: `guest1`, `slave3`.
    #[must_use]
    pub fn name(&self, fitted: impl Into<DeviceFit>) -> Option<String> {
        match self.register(fitted) {
            _ if self.is_at_participant() => Some(format!("slave{}", self.offset ^ PARTICIPANTS)),
            _ if self.is_at_bus() => Some(format!("guest{}", self.offset)),
            Some(register) => Some(register.name()),
            None if self.is_in_header() => {
                Some(format!("header.{}", header::field_at(self.offset as usize)?))
            }
            None => None,
        }
    }

    /// Returns the address at the register's own width: `%MW3.200002`; `None` for a finding on a bus.
    #[must_use]
    pub fn address(&self, fitted: impl Into<DeviceFit>) -> Option<Address> {
        if self.is_at_bus() {
            return None;
        }
        let fitted = fitted.into();
        let byte = || fitted.device().at(Width::Byte, self.offset);
        Some(self.register(fitted).map_or_else(byte, |register| register.address()))
    }

    /// Returns the value in the form of the register: `16#0043`.
    #[must_use]
    pub fn value_text(&self, fitted: impl Into<DeviceFit>) -> String {
        if self.is_at_participant() {
            return self.value.to_string();
        }
        let plain = if self.is_in_header() || self.is_at_bus() { RegType::Dword } else { RegType::Byte };
        format_value(self.register(fitted).map_or(plain, |register| register.ty()), self.value)
    }

    /// Returns the value as a number of the register's type.
    #[must_use]
    pub fn number(&self, fitted: impl Into<DeviceFit>) -> i64 {
        self.register(fitted).map_or(i64::from(self.value), |register| register.ty().number(self.value))
    }

    const fn is_at_participant(&self) -> bool {
        self.is_at_bus() && self.offset & PARTICIPANTS != 0
    }

    const fn is_at_bus(&self) -> bool {
        matches!(self.source(), Source::Bus(_))
    }

    fn is_in_header(&self) -> bool {
        !self.is_at_bus() && (self.offset as usize) < HEADER_SIZE
    }
}
