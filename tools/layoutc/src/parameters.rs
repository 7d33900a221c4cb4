//! Parameter tables of drives. A table is one TOML file, which is checked and emitted as a Rust table.

use crate::error::{Error, Reason};
use crate::source::{Sources, at};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::ops::RangeInclusive;
use std::path::Path;
use toml::Spanned;

/// Highest parameter number that fits the frames and registers.
const LAST_NUMBER: u16 = 4095;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Table {
    drive: String,
    parameter: Vec<Row>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Row {
    number: Spanned<u16>,
    id: Spanned<String>,
    name: String,
    format: Format,
    min: Option<Spanned<i64>>,
    max: Option<Spanned<i64>>,
    default: Spanned<i64>,
    access: Access,
    unit: String,
    page: Option<String>,
    /// Number of the decision, if no manual names the parameter.
    inferred: Option<String>,
    /// Number of the decision, if the unit has another source than the parameter.
    unit_from: Option<String>,
    /// Number of the decision, if width, limits and default have another source than the parameter.
    values_from: Option<String>,
    #[serde(default)]
    settle_us: u32,
}

#[derive(Deserialize, Clone, Copy, Debug)]
#[serde(rename_all = "snake_case")]
enum Format {
    Word,
    Doubleword,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "snake_case")]
enum Access {
    ReadWrite,
    ReadOnly,
}

impl Format {
    /// Returns the range of values of the format. A negative minimum makes the format signed.
    fn values(self, signed: bool) -> RangeInclusive<i64> {
        match (self, signed) {
            (Format::Word, false) => 0..=u16::MAX.into(),
            (Format::Word, true) => i16::MIN.into()..=i16::MAX.into(),
            (Format::Doubleword, false) => 0..=u32::MAX.into(),
            (Format::Doubleword, true) => i32::MIN.into()..=i32::MAX.into(),
        }
    }

    fn bits(self, value: i64) -> u32 {
        match self {
            Format::Word => u32::from(value as u16),
            Format::Doubleword => value as u32,
        }
    }
}

impl Row {
    fn range(&self) -> RangeInclusive<i64> {
        let min = self.min.as_ref().map(|min| *min.get_ref());
        let values = self.format.values(min.is_some_and(|min| min < 0));
        let max = self.max.as_ref().map(|max| *max.get_ref());
        min.unwrap_or(*values.start())..=max.unwrap_or(*values.end())
    }

    fn check(&self, sources: &Sources, file: usize) -> Result<(), Error> {
        let number = *self.number.get_ref();
        let refuse = |span, reason| Err(sources.error(at(file, span), reason));
        if !(1..=LAST_NUMBER).contains(&number) {
            return refuse(self.number.span(), Reason::ParameterNumber(number));
        }
        let range = self.range();
        let values = self.format.values(*range.start() < 0);
        for (what, limit) in
            [("min", &self.min), ("max", &self.max), ("default", &Some(self.default.clone()))]
        {
            let Some(limit) = limit else { continue };
            if !values.contains(limit.get_ref()) {
                let (value, first, last) = (*limit.get_ref(), *values.start(), *values.end());
                return refuse(limit.span(), Reason::ParameterValue { what, number, value, first, last });
            }
        }
        if !range.contains(self.default.get_ref()) {
            let (first, last) = (*range.start(), *range.end());
            return refuse(self.default.span(), Reason::ParameterDefault { number, first, last });
        }
        match (&self.page, &self.inferred) {
            (Some(_), None) | (None, Some(_)) => Ok(()),
            _ => refuse(self.number.span(), Reason::ParameterSource(number)),
        }
    }

    fn emit(&self, out: &mut String) {
        let (number, range) = (self.number.get_ref(), self.range());
        let inferred = |decision: &String| format!("Provenance::Inferred({decision:?})");
        let page = self.page.as_deref().unwrap_or_default();
        let source =
            self.inferred.as_ref().map_or_else(|| format!("Provenance::Documented({page:?})"), inferred);
        let [unit_from, values_from] = [&self.unit_from, &self.values_from]
            .map(|from| from.as_ref().map_or_else(|| source.clone(), inferred));
        let _ = writeln!(
            out,
            "    ParameterRow {{ number: {number}, name: {:?}, format: ParamFormat::{:?}, min: {}, max: {}, \
             default: {}, read_only: {}, unit: {:?}, source: {source}, \
             unit_from: {unit_from}, values_from: {values_from}, settle_us: {} }},",
            self.name,
            self.format,
            range.start(),
            range.end(),
            self.format.bits(*self.default.get_ref()),
            matches!(self.access, Access::ReadOnly),
            self.unit,
            self.settle_us,
        );
    }
}

/// Compiles the parameter table `file` in `dir`: the Rust items `PARAMETERS` and `number`.
///
/// # Errors
/// The error with its place, if the table has one.
pub fn compile(dir: &Path, file: &str) -> Result<String, Error> {
    let mut sources = Sources::new(dir);
    let (file, table): (usize, Table) = sources.parse(file, None)?;
    let mut ids = BTreeSet::new();
    let mut last = 0;
    for row in &table.parameter {
        row.check(&sources, file)?;
        let refuse = |span, reason| Err(sources.error(at(file, span), reason));
        let number = *row.number.get_ref();
        if number <= last {
            return refuse(row.number.span(), Reason::ParameterOrder { number, last });
        }
        last = number;
        let id = row.id.get_ref();
        if !is_id(id) {
            return refuse(row.id.span(), Reason::BadId(id.clone()));
        }
        if !ids.insert(id) {
            return refuse(row.id.span(), Reason::DuplicateName(id.clone()));
        }
    }
    Ok(emit(&table))
}

/// True if `id` can be the name of a constant.
pub(crate) fn is_id(id: &str) -> bool {
    id.starts_with(|first: char| first.is_ascii_uppercase())
        && id.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_')
}

fn emit(table: &Table) -> String {
    let mut out = String::from("// Generated by layoutc from layouts/v-regler; changes belong there.\n\n");
    let _ = writeln!(out, "/// The parameters of the {}, in the order of their numbers.", table.drive);
    let _ = writeln!(out, "pub static PARAMETERS: [ParameterRow; {}] = [", table.parameter.len());
    for row in &table.parameter {
        row.emit(&mut out);
    }
    out.push_str("];\n\n/// Numbers of the parameters.\npub mod number {\n");
    for row in &table.parameter {
        let _ = writeln!(out, "    /// {}.", row.name);
        let _ = writeln!(out, "    pub const {}: u16 = {};", row.id.get_ref(), row.number.get_ref());
    }
    out.push_str("}\n");
    out
}
