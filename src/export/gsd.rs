//! A device description file (GSD) of a PROFIBUS-DP slave, for masters and their tools.

use super::scope::Scope;
use super::text;
use crate::layout::gsd::{Module, Parameter, Texts, Value};
use crate::layout::{Gsd, Provenance, ValueMeaning};
use std::fmt::Write;

/// Numbers of the two lists of texts for single bits. In the first list 1 means yes, in the second list 0 means yes.
const NO_YES: usize = 1;
const YES_NO: usize = 2;

/// Generates the file for a device that is a PROFIBUS-DP slave.
pub(crate) fn generate(scope: &Scope, gsd: &Gsd) -> String {
    let device = scope.device;
    let mut text = String::new();
    let head = [
        format!("; Device description file of the {} (manual {} p. {}).", device.title, device.manual, gsd.page),
        format!("; Made by commram {} with `{}`; do not edit.", text::version(), text::command(scope, "gsd")),
        "; It is not the vendor's file. Each fact that the manual does not state names the decision (D-nn) it follows".to_owned(),
        "; from. The pages decisions.md in docs give the reasons.".to_owned(),
        String::new(),
        "#Profibus_DP".to_owned(),
    ];
    head.iter().for_each(|line| text += &format!("{line}\n"));
    for key in gsd.keys {
        let value = match key.value {
            Value::Number(number) => number.to_string(),
            Value::Text(text) => format!("\"{text}\""),
            Value::Bare(text) => text.to_owned(),
        };
        let _ = writeln!(text, "{}={value}{}", key.name, remark(key.from));
    }
    let _ = writeln!(text, "Max_User_Prm_Data_Len={}\n", gsd.constants.len());
    text += &texts(NO_YES, [(0, "No"), (1, "Yes")]);
    text += &texts(YES_NO, [(0, "Yes"), (1, "No")]);
    for (number, parameter) in (1..).zip(gsd.parameters) {
        text += &definition(number, parameter);
    }
    let constants: Vec<_> = gsd.constants.iter().map(|octet| format!("0x{octet:02X}")).collect();
    let _ = writeln!(text, "Ext_User_Prm_Data_Const(0)={}", constants.join(","));
    for (number, parameter) in (1..).zip(gsd.parameters) {
        let _ = writeln!(text, "Ext_User_Prm_Data_Ref({})={number}", parameter.octet);
    }
    text.push('\n');
    if let Some(octet) = &gsd.diagnosis {
        text += &diagnosis(octet);
    }
    gsd.modules.iter().for_each(|it| text += &module(it));
    text.truncate(text.trim_end().len());
    text + "\n"
}

/// Suffix of a fact: empty, or the decision.
fn remark(from: Provenance) -> String {
    from.decision().map_or_else(String::new, |decision| format!(" ; inferred: {decision}"))
}

fn texts<'a>(number: usize, values: impl IntoIterator<Item = (u32, &'a str)>) -> String {
    let values = values.into_iter().map(|(value, text)| format!("Text({value})=\"{text}\"\n"));
    format!("PrmText={number}\n{}EndPrmText\n\n", values.collect::<String>())
}

/// Returns the texts of a register with a separate text for every value.
fn listed(parameter: &Parameter) -> Option<&'static [ValueMeaning]> {
    let values = parameter.register.meaning?.values;
    (parameter.bit.is_none() && values.iter().all(|value| value.first == value.last)).then_some(values)
}

/// Writes a parameter that users can set. If it has a separate list of texts, this list precedes it.
fn definition(number: usize, parameter: &Parameter) -> String {
    let Parameter { register, octets, name, bit, default, from, to, .. } = parameter;
    let (mut text, mut list) = (String::new(), None);
    let (name, ty) = match bit {
        Some(bit) => {
            let fields = register.meaning.map_or(&[][..], |meaning| meaning.bits);
            let field = fields.iter().find(|field| field.first == bit.at);
            list = Some(if bit.inverted { YES_NO } else { NO_YES });
            (field.map_or(register.name, |field| field.name), format!("Bit({})", bit.at))
        }
        None => (*name, format!("Unsigned{}", octets * 8)),
    };
    if let Some(values) = listed(parameter) {
        list = Some(YES_NO + number);
        text += &texts(YES_NO + number, values.iter().map(|value| (value.first, value.text)));
    }
    let _ = writeln!(
        text,
        "; {} (p. {})\nExtUserPrmData={number} \"{name}\"\n{ty} {default} {from}-{to}",
        register.doc, register.page
    );
    if let Some(list) = list {
        let _ = writeln!(text, "Prm_Text_Ref={list}");
    }
    text + "EndExtUserPrmData\n\n"
}

/// Meanings of the values of an octet of the diagnosis.
fn diagnosis(texts: &Texts) -> String {
    let Texts { register, octet, from } = texts;
    let values = register.meaning.map_or(&[][..], |meaning| meaning.values);
    let values = values.iter().map(|value| format!("Value({})=\"{}\"\n", value.first, value.text));
    format!(
        "; {} (p. {}){}\nUnit_Diag_Area={}-{}\n{}Unit_Diag_Area_End\n\n",
        register.doc,
        register.page,
        remark(*from),
        octet * 8,
        octet * 8 + 7,
        values.collect::<String>()
    )
}

fn module(module: &Module) -> String {
    let octets: Vec<_> = module.octets.iter().map(|octet| format!("0x{octet:02X}")).collect();
    let from = module.from.decision().map_or_else(String::new, |decision| format!("; inferred: {decision}"));
    format!("; p. {}{from}\nModule=\"{}\" {}\nEndModule\n\n", module.page, module.name, octets.join(","))
}
