//! Writes decoders in Lua for the dissector of Wireshark. They decode the frames and telegrams of buses, with
//! the same texts as `commram trace`. Their tables are generated from the layouts.

use crate::devices::can_dp2::registers::descriptor::MEANING_MST_DSAP;
use crate::devices::cansync::frames::FrameKind;
use crate::devices::cansync::frames::codec::parameter::VALUE_ELEMENT;
use crate::devices::cansync::registers::descriptor::{MEANING_PAR_ERROR, MEANING_UPDOWN_ERROR};
use crate::devices::cansync::registers::values::action_command;
use crate::layout::Meaning;
use crate::profibus::{Answer, FunctionCode, Request};
use std::fmt::Write;

/// Returns the decoders of all kinds of buses: statements in Lua that fill a table `decoders`.
#[must_use]
pub fn dissectors() -> String {
    let mut text = include_str!("dissectors/can.lua").to_owned();
    let _ = write!(
        text,
        "\nlocal ACTION, VALUE_ELEMENT = 0x{:03X}, {VALUE_ELEMENT}\nlocal CONTROL_WORD, SYNC_MODE = {}, {}\n{}{}{}",
        FrameKind::Action.id(),
        action_command::CONTROL_WORD,
        action_command::SYNC_MODE,
        table("PARAMETER_ERRORS", texts(&MEANING_PAR_ERROR)),
        table("UP_DOWNLOAD_ERRORS", texts(&MEANING_UPDOWN_ERROR)),
        include_str!("dissectors/cansync.lua")
    );
    let codes = (0..=u8::MAX).filter_map(|octet| Some((octet.into(), octet.into(), code(octet)?)));
    let _ = write!(
        text,
        "\n{}{}{}",
        table("CODES", codes),
        table("SERVICES", texts(&MEANING_MST_DSAP)),
        include_str!("dissectors/profibus.lua")
    );
    text
}

/// Returns ranges of values, each with its text.
fn texts(meaning: &'static Meaning) -> impl Iterator<Item = (u32, u32, String)> {
    meaning.values.iter().map(|value| (value.first, value.last, value.text.to_owned()))
}

fn table(name: &str, rows: impl Iterator<Item = (u32, u32, String)>) -> String {
    let rows = rows.map(|(first, last, text)| format!("    {{ {first}, {last}, {text:?} }},\n"));
    format!("local {name} = {{\n{}}}\n", rows.collect::<String>())
}

/// Returns the meaning of a function code; `None` if slaves and masters do not use it.
fn code(octet: u8) -> Option<String> {
    let text = match FunctionCode::parse(octet) {
        FunctionCode::Request { request, fcb, fcv, is_high } => {
            let name = match request {
                Request::Sdn => "SDN",
                Request::Srd => "SRD",
                Request::Sda => "SDA",
                Request::FdlStatus => "FDL status",
            };
            let priority = if is_high { ", high priority" } else { "" };
            let count = if fcv { if fcb { ", FCB 1" } else { ", FCB 0" } } else { "" };
            format!("{name} request{priority}{count}")
        }
        FunctionCode::Answer(Answer::Ok) => "answer: receipt or status".to_owned(),
        FunctionCode::Answer(Answer::Low) => "answer with data".to_owned(),
        FunctionCode::Answer(Answer::High) => "answer with data, diagnosis pending".to_owned(),
        FunctionCode::Answer(Answer::NotActivated) => "answer: service not activated".to_owned(),
        FunctionCode::Other(_) => return None,
    };
    Some(text)
}
