//! Kinds of faults that a device in a folder declares: `[[fault]]` in its `handshakes.toml` (D-827).

use super::own_records::{LONGEST_NAME, LONGEST_TEXT};
use crate::devices::fault_kinds;
use crate::fault::{
    DECLARED_BITS, Declaration, Effect, Fault, FaultKind, Faults, Field, Form, MOST_DECLARED, Owner, Values,
};
use crate::snapshot_fields;
use core::mem;
use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

/// Maximum number of kinds of a device.
pub(super) const MOST_KINDS: usize = MOST_DECLARED;
/// Maximum number of fields of a kind.
const MOST_FIELDS: usize = 4;

/// Words of `commram fault` and of scenarios beside the names of faults.
const WORDS_OF_COMMANDS: [&str; 4] = ["add", "list", "clear", "required"];

/// A kind of fault.
#[derive(Clone, Debug)]
pub(crate) struct OwnFault {
    pub(crate) name: String,
    /// Description of the fault.
    pub(crate) text: String,
    pub(crate) fields: Vec<OwnField>,
    /// Pages of the manual.
    #[cfg_attr(not(feature = "cli"), expect(dead_code, reason = "only commands show it"))]
    pub(crate) page: String,
    /// Line of the declaration.
    pub(super) line: usize,
}

/// A field of a kind of fault. Its value is a number.
#[derive(Clone, Debug)]
pub(crate) struct OwnField {
    pub(crate) name: String,
    /// Description of the field.
    pub(crate) text: String,
    /// Smallest value.
    pub(crate) from: u32,
    /// Largest value.
    pub(crate) to: u32,
    /// Value of the field if a fault does not set it; `None` if each fault must set it.
    pub(crate) default: Option<u32>,
}

impl OwnFault {
    /// Checks names, texts and ranges.
    ///
    /// # Errors
    /// Description of the error, and of the right form.
    pub(super) fn check(&self) -> Result<(), String> {
        let names = [&self.name].into_iter().chain(self.fields.iter().map(|field| &field.name));
        for name in names {
            let is_part =
                |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '_';
            let begins = name.starts_with(|letter: char| letter.is_ascii_lowercase());
            if !begins || name.len() > LONGEST_NAME || !name.chars().all(is_part) {
                return Err(format!(
                    "`{name}` is no name of a fault or a field; a name has lower-case letters, digits and `_`, at most {LONGEST_NAME}"
                ));
            }
        }
        if WORDS_OF_COMMANDS.contains(&self.name.as_str()) {
            return Err(format!("`{}` is a word of commands about faults; choose another name", self.name));
        }
        let described = [(&self.name, &self.text)].into_iter();
        let mut described = described.chain(self.fields.iter().map(|field| (&field.name, &field.text)));
        if let Some((name, _)) = described.find(|(_, text)| text.trim().is_empty()) {
            return Err(format!("`{name}` has an empty text; the text describes the fault or the field"));
        }
        let texts = [&self.text].into_iter().chain(self.fields.iter().map(|field| &field.text));
        if let Some(text) = texts.into_iter().find(|text| text.len() > LONGEST_TEXT) {
            return Err(format!("the text has {} bytes; it has at most {LONGEST_TEXT}", text.len()));
        }
        if fault_kinds().iter().any(|kind| kind.name() == self.name) {
            return Err(format!("commram has a fault `{}`; choose another name", self.name));
        }
        if self.fields.len() > MOST_FIELDS {
            return Err(format!("{} fields; a fault has at most {MOST_FIELDS}", self.fields.len()));
        }
        for (index, field) in self.fields.iter().enumerate() {
            field.check()?;
            if self.fields[..index].iter().any(|other| other.name == field.name) {
                return Err(format!("the field `{}` occurs twice", field.name));
            }
        }
        let bits: u32 = self.fields.iter().map(|field| u32::BITS - field.to.leading_zeros()).sum();
        match bits <= DECLARED_BITS {
            true => Ok(()),
            false => Err(format!("the largest values have {bits} bits; they have at most {DECLARED_BITS}")),
        }
    }

    /// Returns the kind in the form of the list of faults. It is never freed.
    fn kind(&self, index: u8, device: &'static str, declarations: u64) -> &'static FaultKind {
        let id = self.id(index, device);
        let fields = self.fields.iter().map(OwnField::field).collect::<Vec<_>>().leak();
        let declaration = Declaration { device, id };
        let (name, text) = (leaked(&self.name), leaked(&self.text));
        let effect = |fault: &Fault| {
            let (number, values) = (fault.kind().number(), fault.values());
            Effect::new(OwnEffect { number, values })
        };
        Box::leak(Box::new(FaultKind::declared(index, declaration, declarations, name, text, fields, effect)))
    }

    /// Hash of everything except page and line.
    fn id(&self, index: u8, device: &str) -> u32 {
        let Self { name, text, fields, page: _, line: _ } = self;
        let all = format!("{device:?} {index} {name:?} {text:?} {fields:?}");
        XxHash3_64::oneshot(all.as_bytes()) as u32
    }
}

impl OwnField {
    fn check(&self) -> Result<(), String> {
        let Self { name, from, to, default, .. } = self;
        let taken = FaultKind::COMMON.into_iter().map(Field::name);
        let taken = taken.chain(["for_us", "us", "plc", "device", "kind", "required"]);
        if taken.into_iter().any(|other| other == name || other.trim_end_matches("_us") == name) {
            return Err(format!("each fault has a field `{name}`; choose another name"));
        }
        if from > to {
            return Err(format!("`{name}` is {from} to {to}; `from` is at most `to`"));
        }
        match default.filter(|default| !(from..=to).contains(&default)) {
            Some(default) => Err(format!("`{name}` has the default {default}; it is {from} to {to}")),
            None => Ok(()),
        }
    }

    fn field(&self) -> Field {
        let form = Form::Number { least: self.from.into(), most: self.to.into() };
        let field = Field::new(leaked(&self.name), form, leaked(&self.text));
        match self.default {
            Some(default) => field.default(default),
            None => field.required(leaked(&format!("give {}, {} to {}", self.name, self.from, self.to))),
        }
    }
}

fn leaked(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

/// The declarations that this process has read, with their hashes. Equal declarations are stored once. They
/// are never freed.
pub(super) struct Declarations(Vec<(u64, &'static [&'static FaultKind])>);

impl Declarations {
    pub(super) const fn new() -> Self {
        Declarations(Vec::new())
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns the kinds of faults of a device with this name and these declarations.
    pub(super) fn kinds(&mut self, device: &str, faults: &[OwnFault]) -> &'static [&'static FaultKind] {
        if faults.is_empty() {
            return &[];
        }
        let numbered = || (0_u8..).zip(faults);
        let ids: Vec<u8> =
            numbered().flat_map(|(index, fault)| fault.id(index, device).to_le_bytes()).collect();
        // 0 means that a device declares nothing.
        let hash = XxHash3_64::oneshot(&ids).max(1);
        if let Some((_, known)) = self.0.iter().find(|(known, _)| *known == hash) {
            return known;
        }
        let device = leaked(device);
        let kinds: Vec<_> = numbered().map(|(index, fault)| fault.kind(index, device, hash)).collect();
        let kinds: &'static [&'static FaultKind] = kinds.leak();
        self.0.push((hash, kinds));
        kinds
    }

    /// Returns all kinds in the order of reading.
    pub(super) fn all(&self) -> Vec<&'static FaultKind> {
        self.0.iter().flat_map(|(_, kinds)| kinds.iter().copied()).collect()
    }
}

/// Effect of a fault: the number of its kind, and its values.
struct OwnEffect {
    number: u8,
    values: Values,
}

/// A fault that acts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct ActiveFault {
    /// Number of the fault in the plant.
    id: u16,
    /// Number of its kind.
    number: u8,
    values: Values,
}

/// Begin or end of a fault.
#[cfg_attr(not(feature = "script"), expect(dead_code, reason = "only scripts are notified"))]
pub(super) struct FaultChange {
    pub(super) kind: &'static FaultKind,
    pub(super) values: Values,
    /// True if the fault begins.
    pub(super) is_on: bool,
}

/// The declared faults of a running device. When they change, the parts of the firmware are notified at the
/// next action of the device, at the same emulated time.
pub(super) struct OwnFaults {
    kinds: &'static [&'static FaultKind],
    /// The faults of which the firmware was notified.
    notified: Vec<ActiveFault>,
    /// The faults that act.
    active: Vec<ActiveFault>,
    /// Time of the last change in microseconds.
    changed: u64,
}

snapshot_fields!(OwnFaults { values: notified, active, changed; built: kinds });

impl OwnFaults {
    pub(super) fn new(kinds: &'static [&'static FaultKind]) -> Self {
        OwnFaults { kinds, notified: Vec::new(), active: Vec::new(), changed: 0 }
    }

    pub(super) fn kinds(&self) -> &'static [&'static FaultKind] {
        self.kinds
    }

    /// Takes over the faults of the plant that act on the device `owner` at `now`.
    pub(super) fn changed(&mut self, now: u64, faults: &Faults, owner: Owner) {
        let acting = faults.acting_numbered::<OwnEffect>(owner);
        let acting = acting.map(|(id, OwnEffect { number, values })| ActiveFault {
            id,
            number: *number,
            values: *values,
        });
        let acting = acting.collect();
        if self.active != acting {
            (self.active, self.changed) = (acting, now);
        }
    }

    /// Forgets all notifications: the firmware starts again.
    pub(super) fn restart(&mut self) {
        self.notified.clear();
    }

    /// Returns the time at which the firmware must be notified; `u64::MAX` if nothing has changed.
    pub(super) fn next_time(&self) -> u64 {
        if self.notified == self.active { u64::MAX } else { self.changed }
    }

    /// Returns the changes since the last call. Faults that end come before faults that begin.
    pub(super) fn take_changes(&mut self) -> Vec<FaultChange> {
        if self.notified == self.active {
            return Vec::new();
        }
        let before = mem::replace(&mut self.notified, self.active.clone());
        let ends = before.iter().filter(|fault| !self.active.contains(fault));
        let begins = self.active.iter().filter(|fault| !before.contains(fault));
        let ends = ends.map(|fault| (fault, false));
        let changes = ends.chain(begins.map(|fault| (fault, true)));
        let changes = changes.filter_map(|(fault, is_on)| {
            let kind = self.kinds.iter().copied().find(|kind| kind.number() == fault.number)?;
            Some(FaultChange { kind, values: fault.values, is_on })
        });
        changes.collect()
    }

    /// Returns the kinds of which at least one fault acts: bit n is declaration n of the folder.
    pub(super) fn mask(&self) -> u16 {
        let is_acting = |kind: &&FaultKind| self.notified.iter().any(|fault| fault.number == kind.number());
        (0..).zip(self.kinds).filter(|(_, kind)| is_acting(kind)).fold(0, |mask, (bit, _)| mask | 1 << bit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::{Draft, Target, is_declared};
    use crate::identity::DeviceIndex;
    use crate::journal::Journal;

    fn field(name: &str, from: u32, to: u32, default: Option<u32>) -> OwnField {
        OwnField { name: name.into(), text: "x".into(), from, to, default }
    }

    fn fault(name: &str) -> OwnFault {
        let fields = vec![field("input", 0, 7, None), field("value", 1, 5, Some(2))];
        OwnFault { name: name.into(), text: "x".into(), fields, page: "1".into(), line: 1 }
    }

    #[test]
    fn declarations_have_limits() {
        let refused = |change: &dyn Fn(&mut OwnFault)| {
            let mut wrong = fault("stuck");
            change(&mut wrong);
            wrong.check().unwrap_err()
        };
        assert_eq!(fault("stuck").check(), Ok(()));
        assert!(refused(&|it| it.name = "Stuck".into()).contains("lower-case letters"));
        assert!(refused(&|it| it.name = "lose_frame".into()).contains("commram has a fault `lose_frame`"));
        assert!(refused(&|it| it.name = "required".into()).contains("is a word of commands"));
        assert!(refused(&|it| it.text = " ".into()).contains("`stuck` has an empty text"));
        assert!(refused(&|it| it.fields[1].text.clear()).contains("`value` has an empty text"));
        assert!(refused(&|it| it.text = "x".repeat(81)).contains("at most 80"));
        assert!(refused(&|it| it.fields[0].name = "value".into()).contains("`value` occurs twice"));
        assert!(refused(&|it| it.fields[0].name = "plc".into()).contains("each fault has a field `plc`"));
        assert!(refused(&|it| it.fields[0].name = "duration".into()).contains("a field `duration`"));
        assert!(refused(&|it| it.fields[0].from = 8).contains("`from` is at most `to`"));
        assert!(refused(&|it| it.fields[1].default = Some(6)).contains("default 6; it is 1 to 5"));
        assert!(refused(&|it| it.fields = vec![field("a", 0, u32::MAX, None); 5]).contains("at most 4"));
        let wide = |it: &mut OwnFault| {
            it.fields = vec![field("a", 0, u32::MAX, None), field("b", 0, u32::MAX, None)];
        };
        assert!(refused(&wide).contains("64 bits; they have at most 56"));
    }

    #[test]
    fn the_same_declaration_is_stored_once() {
        let mut all = Declarations::new();
        let first = all.kinds("card", &[fault("stuck"), fault("lost")]);
        assert!(core::ptr::eq(first, all.kinds("card", &[fault("stuck"), fault("lost")])));
        let other = all.kinds("other", &[fault("stuck")]);
        assert!(first[0] != other[0] && first[0].number() == other[0].number());
        assert!(all.all().iter().all(|kind| is_declared(kind.number())) && all.len() == 2);
        // Folders of one device name with other declarations keep their own kinds, also where a declaration is equal.
        let version = all.kinds("card", &[fault("stuck"), fault("gone")]);
        assert!(version[0] == first[0] && !core::ptr::eq(version[0], first[0]));
        let [old, new] = [first, version].map(FaultKind::declarations_of);
        assert!(old != new && ![old, new].contains(&0));
    }

    #[test]
    fn the_firmware_is_notified_of_each_begin_and_end() {
        let kinds = Declarations::new().kinds("card", &[fault("stuck"), fault("lost")]);
        let (mut own, mut faults, mut journal) = (OwnFaults::new(kinds), Faults::default(), Journal::new(10));
        let owner = Owner::Device(DeviceIndex(0));
        let add = |index: usize, input: u64, journal: &mut Journal, faults: &mut Faults| {
            let mut draft = Draft::new(kinds[index], Target::Device(DeviceIndex(0)));
            draft.values[0] = Some(input);
            let id = faults.add(5, draft.check().unwrap(), owner, journal).unwrap();
            faults.advance(5, journal);
            id
        };
        let first = add(0, 3, &mut journal, &mut faults);
        add(1, 4, &mut journal, &mut faults);
        own.changed(5, &faults, owner);
        assert_eq!((own.next_time(), own.mask()), (5, 0));
        let report_of = |own: &mut OwnFaults| -> Vec<_> {
            let changes = own.take_changes().into_iter();
            changes.map(|it| (it.kind.name(), it.values[0], it.values[1], it.is_on)).collect()
        };
        assert_eq!(
            report_of(&mut own),
            [("stuck", Some(3), Some(2), true), ("lost", Some(4), Some(2), true)]
        );
        assert_eq!((own.next_time(), own.mask(), report_of(&mut own)), (u64::MAX, 0b11, vec![]));
        faults.clear(9, first, &mut journal).unwrap();
        own.changed(9, &faults, owner);
        assert_eq!(report_of(&mut own), [("stuck", Some(3), Some(2), false)]);
        // After power-on, the firmware is notified of all faults that act.
        own.restart();
        assert_eq!(report_of(&mut own), [("lost", Some(4), Some(2), true)]);
        assert_eq!(own.mask(), 0b10);
    }
}
