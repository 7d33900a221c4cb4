//! JSON forms of fields of operations, for types that do not implement serde themselves.

use crate::can::Frame;
use crate::devices;
use crate::fault::{Draft, Fault, FaultKind, Limit, Target};
use crate::journal::Keep;
use crate::layout::{Compare, Test};
use crate::memory::header::BoardSetting;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

#[derive(Serialize, Deserialize)]
#[serde(remote = "Keep", rename_all = "snake_case")]
pub(super) enum KeepForm {
    InJournal,
    ForOnlookers,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Compare", rename_all = "snake_case")]
enum CompareForm {
    Equal,
    NotEqual,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Test", deny_unknown_fields)]
pub(super) struct TestForm {
    mask: u32,
    #[serde(with = "CompareForm")]
    compare: Compare,
    is_signed: bool,
    value: u32,
}

/// Declares a module for serde (`with = ".."`) that serializes a type as another type, its form. The form must
/// implement `From` for a reference to the type, and a conversion back to the type that refuses invalid forms.
macro_rules! sent_as {
    ($($module:ident: $type:ty => $form:ty, $what:literal;)+) => {$(
        pub(super) mod $module {
            use super::*;
            use serde::{Deserializer, Serializer, de::Error};

            pub(in crate::request) fn serialize<S: Serializer>(it: &$type, to: S) -> Result<S::Ok, S::Error> {
                <$form>::from(it).serialize(to)
            }

            pub(in crate::request) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<$type, D::Error> {
                let form = <$form>::deserialize(from)?;
                form.read().ok_or_else(|| D::Error::custom(concat!("this is no ", $what)))
            }
        }
    )+};
}

sent_as! {
    fault: Fault => FaultForm, "fault that its kind allows";
    frame: Option<Frame> => FrameForm, "frame of CAN";
    setting: BoardSetting => SettingForm, "setting of a board";
}

/// A setting of a board as its two numbers in the wire format.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SettingForm {
    which: u32,
    value: u32,
}

impl From<&BoardSetting> for SettingForm {
    fn from(setting: &BoardSetting) -> Self {
        let (which, value) = setting.numbers();
        SettingForm { which, value }
    }
}

impl SettingForm {
    fn read(self) -> Option<BoardSetting> {
        BoardSetting::from_numbers(self.which, self.value)
            .filter(|it| it.numbers() == (self.which, self.value))
    }
}

/// A frame as its numbers: the identifier with the marks of SocketCAN, the length, the data with the first byte lowest.
#[derive(Serialize, Deserialize)]
struct FrameForm(Option<(u32, u8, u64)>);

impl From<&Option<Frame>> for FrameForm {
    fn from(frame: &Option<Frame>) -> Self {
        FrameForm(frame.as_ref().map(Frame::numbers))
    }
}

impl FrameForm {
    fn read(self) -> Option<Option<Frame>> {
        let Some(numbers) = self.0 else { return Some(None) };
        let frame = Frame::of_numbers(numbers.0, numbers.1, numbers.2)?;
        (frame.numbers() == numbers).then_some(Some(frame))
    }
}

/// A fault by the names of its kind and fields, and the numbers of its place.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FaultForm {
    kind: String,
    /// Name of the device in a folder that declares the kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    device: Option<String>,
    /// Number of the declaration. Several folders, or versions of a folder, may declare a kind of this name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    declaration: Option<u32>,
    index: u16,
    number: u8,
    values: BTreeMap<String, u64>,
    at_us: u64,
    limit: Limit,
}

impl From<&Fault> for FaultForm {
    fn from(fault: &Fault) -> Self {
        let (index, number) = fault.target().numbers();
        let fields = fault.kind().fields().iter().zip(fault.values());
        let values = fields.filter_map(|(field, value)| Some((field.name().to_owned(), value?.into())));
        let kind = fault.kind().name().to_owned();
        FaultForm {
            kind,
            device: fault.kind().declaration().map(|declaration| declaration.device.to_owned()),
            declaration: fault.kind().declaration().map(|declaration| declaration.id),
            index,
            number,
            values: values.collect(),
            at_us: fault.at_us(),
            limit: fault.limit(),
        }
    }
}

impl FaultForm {
    fn read(mut self) -> Option<Fault> {
        let is_it = |kind: &&&'static FaultKind| {
            let declaration = kind.declaration();
            let device = declaration.map(|declaration| declaration.device);
            let is_meant = self.declaration.is_none_or(|id| declaration.is_some_and(|it| it.id == id));
            kind.name() == self.kind && device == self.device.as_deref() && is_meant
        };
        // Without the number of the declaration, the kind that was declared last belongs to the present version.
        let kinds = devices::emulation::catalogue::known_fault_kinds();
        let kind = kinds.iter().rev().find(is_it)?;
        let mut draft = Draft::new(kind, Target::of_numbers(kind.place(), self.index, self.number));
        for (value, field) in draft.values.iter_mut().zip(kind.fields()) {
            *value = self.values.remove(field.name());
        }
        draft.at_us = self.at_us;
        match self.limit {
            Limit::UntilCleared => {}
            Limit::Count(hits) => draft.count = Some(hits.into()),
            Limit::Duration(us) => draft.duration_us = Some(us.into()),
        }
        let fault = draft.check().ok()?;
        (self.values.is_empty() && fault.target().numbers() == (self.index, self.number)).then_some(fault)
    }
}
