//! The lines of a scenario, each with its time.

use super::{Action, Connection, Expectation};
use crate::identity::DeviceIndex;
use crate::layout::{Compare, NamedLocation, Test, Width, format_value};
use crate::plain_text::is_interpreted;
use crate::request::{Class, MAX_ADVANCE_US, Op};
use serde_json::Value;
use std::fmt::Write as _;

/// A line of the scenario.
pub(super) struct Line {
    text: String,
    begin_us: u64,
    end_us: u64,
    /// True if the line advances the clock to its end time by itself.
    advances: bool,
}

/// Formats a text as a string literal of Rhai.
pub(super) fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for sign in text.chars() {
        match sign {
            '"' | '\\' => quoted.extend(['\\', sign]),
            '\n' => quoted += "\\n",
            '\r' => quoted += "\\r",
            '\t' => quoted += "\\t",
            sign if is_interpreted(sign) => {
                // Writing to a string cannot fail.
                let _ = write!(quoted, "\\u{:04x}", u32::from(sign));
            }
            sign => quoted.push(sign),
        }
    }
    quoted + "\""
}

/// Returns all lines, with a step before each line that begins later than the end of the previous one. Consecutive steps
/// become one step.
pub(super) fn text(lines: &[Line]) -> String {
    let mut text = String::new();
    // Time of the recorded plant, and time that the lines in `text` reach.
    let (mut now, mut reached) = (0, 0);
    for line in lines {
        let was_earlier = line.begin_us < now;
        now = now.max(line.begin_us);
        if !line.text.is_empty() {
            step(&mut text, reached, now);
            reached = now;
            if was_earlier {
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "// The next line was recorded at {} us, before the end of the previous one.",
                    line.begin_us
                );
            }
            text += &line.text;
            text.push('\n');
            if line.advances {
                reached = reached.max(line.end_us);
            }
        }
        now = now.max(line.end_us);
    }
    step(&mut text, reached, now);
    text
}

/// Adds steps from one time to a later one, if it is later.
fn step(text: &mut String, mut now: u64, until: u64) {
    while until > now {
        let us = (until - now).min(MAX_ADVANCE_US);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "step(\"{us}us\");");
        now += us;
    }
}

/// A condition that a wait uses later in the request.
pub(super) struct Condition {
    /// The register as a string literal.
    name: String,
    width: Width,
    test: Test,
}

impl Condition {
    /// Returns the mask of the condition, if the mask does not select all bits.
    fn mask(&self) -> Option<u32> {
        (self.test.mask != self.width.max_value()).then_some(self.test.mask)
    }

    /// Formats the condition as an expression of Rhai. Returns `None` for a signed part of a register.
    fn expression(&self) -> Option<String> {
        let Test { compare, is_signed, value, .. } = self.test;
        let sign = match compare {
            Compare::Equal => "==",
            Compare::NotEqual => "!=",
            Compare::Less => "<",
            Compare::LessOrEqual => "<=",
            Compare::Greater => ">",
            Compare::GreaterOrEqual => ">=",
        };
        let shift = 32 - 8 * self.width.bytes();
        let signed = i64::from(((value << shift) as i32) >> shift);
        let value = if is_signed { signed } else { i64::from(value) };
        match self.mask() {
            None => Some(format!("peek({}) {sign} {value}", self.name)),
            Some(mask) => (!is_signed).then(|| format!("(peek({}) & {mask}) {sign} {value}", self.name)),
        }
    }
}

/// Returns the verb that waits for these conditions. `None` if there is no such verb; the scenario then waits for the
/// recorded duration.
fn wait_for(conditions: &[Condition], any: bool, within_us: u64) -> Option<String> {
    if let [one] = conditions
        && one.test.compare == Compare::Equal
    {
        let (name, value) = (&one.name, one.test.value);
        return Some(match one.mask() {
            None => format!("wait({name}, {value}, \"{within_us}us\");"),
            Some(mask) => format!("wait_bits({name}, {mask}, {value}, \"{within_us}us\");"),
        });
    }
    let all = conditions.iter().map(Condition::expression).collect::<Option<Vec<_>>>()?;
    let joined = all.join(if any { " || " } else { " && " });
    (!all.is_empty()).then(|| format!("wait_until(|| {joined}, \"{within_us}us\");"))
}

/// Adds the lines of an action. `conditions` contains the conditions of earlier actions that no wait and no return to
/// the past has used yet.
///
/// # Errors
/// A scenario cannot repeat the action; the error is the reason.
pub(super) fn add(
    lines: &mut Vec<Line>,
    conditions: &mut Vec<Condition>,
    connection: &Connection,
    action: &Action,
) -> Result<(), String> {
    let begin_us = action.time_us;
    let end_us = action.end_us.unwrap_or(begin_us);
    let goes_back =
        matches!(&action.operation, Some(Op::Back { .. } | Op::BackUntil { .. } | Op::BackToStart { .. }));
    if end_us < begin_us && !goes_back {
        return Err(format!("it ends at {end_us} us, before its begin at {begin_us} us"));
    }
    let now_us = lines.last().map_or(0, |line| line.end_us);
    if [begin_us.saturating_sub(now_us), end_us.saturating_sub(begin_us)]
        .iter()
        .any(|us| *us > MAX_ADVANCE_US)
    {
        return Err(format!(
            "a step of a scenario has at most {MAX_ADVANCE_US} us, and more pass before its end"
        ));
    }
    let mut push = |text: String, advances: bool| lines.push(Line { text, begin_us, end_us, advances });
    match (&action.operation, &action.expect, &action.section) {
        (None, None, Some(section)) => push(format!("section({});", quoted(section)), false),
        (None, Some(expectation), None) => push(expected(connection, expectation)?, false),
        (Some(op @ (Op::Back { .. } | Op::BackUntil { .. })), None, None) => {
            if matches!(op, Op::BackUntil { .. }) {
                conditions.clear();
            }
            go_back(lines, end_us);
        }
        (Some(Op::BackToStart { .. }), None, None) => lines.clear(),
        (Some(op), None, None) if op.class() == Class::Travels => {
            return Err(
                "only `back`, `back_until` and `back_to_start` can be recorded of the ways back".to_owned()
            );
        }
        (Some(op), None, None) => {
            let is_known = action.end_us.is_some() || op.class() != Class::Advances;
            let verb = match op {
                Op::Condition { plc, offset, width, test } => {
                    let (name, _) =
                        register_of(connection, action.register.as_deref(), *plc, *offset, *width)?;
                    conditions.push(Condition { name: quoted(&name), width: *width, test: *test });
                    Verb::Nothing
                }
                Op::WaitFor { any, within_us } => {
                    let conditions = core::mem::take(conditions);
                    wait_for(&conditions, *any, *within_us).map_or(Verb::Step, Verb::Advance)
                }
                Op::AdvanceToEvent { .. } if is_known && end_us == begin_us => {
                    // The events of this moment happen in the scenario too, when its clock advances. Only a write between
                    // here and there has another place among them.
                    Verb::Call(
                        "// `advance_to_event` handled the events of this moment here. The next line that advances the \
                         clock handles them."
                            .to_owned(),
                    )
                }
                op => verb(connection, op, action.register.as_deref())?,
            };
            if !is_known && !matches!(verb, Verb::Nothing) {
                return Err("`end_us` is missing: the emulated time after it".to_owned());
            }
            match verb {
                Verb::Nothing => {}
                Verb::Call(text) => push(text, false),
                Verb::Advance(text) => push(text, true),
                Verb::Step => push(String::new(), false),
            }
        }
        _ => return Err("it needs exactly one of `operation`, `expect` and `section`".to_owned()),
    }
    Ok(())
}

/// Removes the actions after the time `to_us`, because the plant has gone back to it.
fn go_back(lines: &mut Vec<Line>, to_us: u64) {
    lines.retain(|line| line.begin_us <= to_us);
    for line in lines.iter_mut().filter(|line| line.end_us > to_us) {
        // The wait ended only in the history before the plant went back. In the present history only time passes.
        line.text.clear();
        (line.end_us, line.advances) = (to_us, false);
    }
    lines.push(Line { text: String::new(), begin_us: to_us, end_us: to_us, advances: false });
}

fn expected(connection: &Connection, expectation: &Expectation) -> Result<String, String> {
    match expectation {
        Expectation::Findings { no_findings: true } => Ok("expect_no_findings();".to_owned()),
        Expectation::Findings { no_findings: false } => Err("`no_findings` can only be true".to_owned()),
        Expectation::Register { register, value } => {
            let place = connection.session.place(register).map_err(|error| error.to_string())?;
            connection.session.plc_of(&place).map_err(|error| error.to_string())?;
            let value = match value {
                Value::String(text) => {
                    place.parse_value(text).map_err(|error| error.to_string())?;
                    quoted(text)
                }
                Value::Number(number) if number.is_i64() => number.to_string(),
                Value::Bool(value) => value.to_string(),
                other => return Err(format!("{other} is no value: write a text, an integer, true or false")),
            };
            Ok(format!("expect({}, {value});", quoted(register)))
        }
    }
}

/// How a scenario repeats an operation.
enum Verb {
    /// Nothing to repeat: the operation changes nothing, or concerns something outside the plant.
    Nothing,
    Call(String),
    /// A verb that advances the clock.
    Advance(String),
    /// The clock advances, but scenarios have no verb for this operation.
    Step,
}

fn verb(connection: &Connection, op: &Op, register: Option<&str>) -> Result<Verb, String> {
    let name = |plc, offset, width| {
        register_of(connection, register, plc, offset, width).map(|(name, _)| quoted(&name))
    };
    let value = |plc, offset, width, value| {
        let (_, place) = register_of(connection, register, plc, offset, width)?;
        Ok::<_, String>(quoted(&format_value(place.ty(place.last_phase()), value)))
    };
    Ok(Verb::Call(match *op {
        Op::Poke { plc, offset, width, value: bits } => {
            format!("poke({}, {});", name(plc, offset, width)?, value(plc, offset, width, bits)?)
        }
        Op::CompareExchange { plc, offset, width, current, new } => {
            let (current, new) = (value(plc, offset, width, current)?, value(plc, offset, width, new)?);
            format!("compare_exchange({}, {current}, {new});", name(plc, offset, width)?)
        }
        Op::Force { plc, offset, width, value: bits } => {
            format!("force({}, {});", name(plc, offset, width)?, value(plc, offset, width, bits)?)
        }
        Op::Unforce { plc, offset, width } => format!("unforce({});", name(plc, offset, width)?),
        Op::FaultAdd { fault } => format!("fault({});", quoted(&fault.text(&connection.names))),
        Op::FaultClear { id: Some(id) } => format!("clear_fault({id});"),
        Op::FaultClear { id: None } => "clear_faults();".to_owned(),
        Op::ClearFindings => "clear_findings();".to_owned(),
        Op::SetBoard { plc, setting } => board(connection, plc, setting)?,
        Op::BusSend { bus, frame: Some(frame) } => send(&connection.names.bus(bus), frame)?,
        Op::BusSend { frame: None, .. } => {
            return Err("scenarios have no verb for taking part in a bus without a frame".to_owned());
        }
        Op::Wait { plc, offset, width, mask, value: bits, within_us } => {
            let is_whole = mask == width.max_value();
            let name = name(plc, offset, width)?;
            return Ok(Verb::Advance(match is_whole {
                true => format!("wait({name}, {}, \"{within_us}us\");", value(plc, offset, width, bits)?),
                false => format!("wait_bits({name}, {mask}, {bits}, \"{within_us}us\");"),
            }));
        }
        Op::AdvanceToSync { plc, node } => {
            let port = connection.session.device(plc).port_numbered(node).ok_or("there is no such port")?;
            let prefix = connection.session.prefix(plc);
            return Ok(Verb::Advance(format!(
                "step_to_sync({});",
                quoted(&format!("{prefix}{}", port.name))
            )));
        }
        Op::SetParameter { .. } => return Err("scenarios have no verb for parameters of a drive".to_owned()),
        ref other => match other.class() {
            Class::Advances => return Ok(Verb::Step),
            Class::Stores | Class::Acts => match other {
                Op::Follow { .. } => return Ok(Verb::Nothing),
                _ => return Err("scenarios have no verb for it".to_owned()),
            },
            Class::Looks | Class::Manages | Class::Travels | Class::Ends => return Ok(Verb::Nothing),
        },
    }))
}

/// Returns the name of a register, with the PLC if the instance has several. Returns the given name if it denotes the
/// same register.
fn register_of(
    connection: &Connection,
    given: Option<&str>,
    plc: DeviceIndex,
    offset: u32,
    width: Width,
) -> Result<(String, NamedLocation), String> {
    let session = &connection.session;
    if let Some(given) = given {
        let place = session.place(given).map_err(|error| error.to_string())?;
        let of = session.plc_of(&place).map_err(|error| error.to_string())?;
        if (of, place.offset(), place.width()) == (plc, offset, width) && place.bit().is_none() {
            return Ok((given.to_owned(), place));
        }
        return Err(format!("`{given}` is not the register of the operation"));
    }
    let fitted = session.fitted(plc);
    let address = fitted.device().at(width, offset).to_string();
    let place = NamedLocation::parse(&fitted, &address).map_err(|error| error.to_string())?;
    let name = place.name(place.last_phase());
    Ok((session.prefix(plc) + &name, place))
}

fn board(
    connection: &Connection,
    plc: DeviceIndex,
    setting: crate::memory::header::BoardSetting,
) -> Result<String, String> {
    use crate::memory::header::BoardSetting;

    let session = &connection.session;
    let name = session.plcs().get(plc.index()).map_or("", String::as_str);
    Ok(match setting {
        BoardSetting::Reset => format!("reset({});", quoted(name)),
        BoardSetting::PowerCycle => format!("power_cycle({});", quoted(name)),
        setting => {
            let word = setting.word(session.device(plc)).ok_or("the device has no such switch")?;
            format!("set_board({});", quoted(&format!("{name}:{word}")))
        }
    })
}

/// Formats the line that sends a frame from a separate station.
fn send(bus: &str, frame: crate::can::Frame) -> Result<String, String> {
    let (id, length, data) = frame.numbers();
    let extended = if id >> 31 == 1 { ", extended" } else { "" };
    let number = id & 0x1FFF_FFFF;
    if id >> 30 & 1 == 1 {
        return match length {
            0 => Ok(format!("rtr({}, 0x{number:X}{extended});", quoted(bus))),
            _ => Err(format!("scenarios send remote frames of length 0; this frame has length {length}")),
        };
    }
    let bytes = data.to_le_bytes();
    let bytes: Vec<_> = bytes.iter().take(length.into()).map(|byte| format!("{byte:02X}")).collect();
    Ok(format!("send_frame({}, 0x{number:X}, {}{extended});", quoted(bus), quoted(&bytes.join(" "))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(text: &str, begin_us: u64, end_us: u64, advances: bool) -> Line {
        Line { text: text.to_owned(), begin_us, end_us, advances }
    }

    #[test]
    fn steps_fill_the_time_between_lines() {
        let lines = [
            line("a();", 0, 0, false),
            line("wait();", 1000, 2500, true),
            line("", 2500, 3000, false),
            line("b();", 4000, 4000, false),
        ];
        assert_eq!(text(&lines), "a();\nstep(\"1000us\");\nwait();\nstep(\"1500us\");\nb();\n");
    }

    #[test]
    fn going_back_removes_what_came_later() {
        let mut lines = vec![
            line("a();", 0, 0, false),
            line("wait();", 500, 2500, true),
            line("b();", 3000, 3000, false),
        ];
        go_back(&mut lines, 1000);
        assert_eq!(text(&lines), "a();\nstep(\"1000us\");\n");
    }

    #[test]
    fn texts_are_quoted_for_rhai() {
        assert_eq!(quoted("a\"b\\c\nd\u{1b}"), "\"a\\\"b\\\\c\\nd\\u001b\"");
    }
}
