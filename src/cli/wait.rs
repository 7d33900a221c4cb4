//! `commram wait`: wait for registers.

use super::Instance;
use super::complete;
use super::device::NameChecks;
use super::error::CliError;
use super::place::NamedLocation;
use super::session::{Read, Session, Snapshot};
use super::time;
use crate::layout::{Condition, ConditionError};
use crate::request::{MAX_CONDITIONS, Op};

/// Wait until registers have the given values.
///
/// With several conditions, all must be true at the same moment; with --any one of them is enough. In stepped mode
/// the command advances the emulated time event by event, and stops at the moment of the match.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram wait node2.w_OPTION_STATUS==16#0043 --within 10ms
  commram wait node2.w_OPTION_STATUS==master-active node2.w_CPU_CONTROL.7==0
  commram wait 'node2.a_STAT_SL[1]&2==2' --within 2s
  commram wait 'node2.a_RD_VALUE[1][0] < -1000' 'node2.w_OPTION_STATUS != 16#80' --any
  commram wait %MX3.200004.2==1

Exit code 1 if the conditions do not become true in time; the message shows the values of the registers.")]
pub(crate) struct Args {
    /// REG==VALUE, or REG&MASK==VALUE to compare only some bits; also !=, <, <=, >, >=
    #[arg(add = complete::conditions(), value_name = "CONDITION", required = true)]
    conditions: Vec<String>,
    /// One of the conditions is enough
    #[arg(long)]
    any: bool,
    /// Longest wait in emulated time
    #[arg(long, value_name = "TIME", default_value = "1s", value_parser = super::step::advance_time)]
    within: u64,
    #[command(flatten)]
    instance: Instance,
}

/// A condition that did not become true in time, or not at the same moment as the other conditions.
#[derive(Debug)]
pub(crate) struct UnmetCondition {
    /// Name and address of the register.
    pub place: String,
    /// The condition without the register.
    pub wanted: String,
    /// The value of the register at the end, with its meaning.
    pub found: String,
    /// True if this condition was true at the end.
    pub holds: bool,
}

/// Parses a condition. `place` finds its register.
fn parse(text: &str, place: impl Fn(&str) -> Result<NamedLocation, CliError>) -> Result<Condition, CliError> {
    Condition::parse(text, place).map_err(|error| match error {
        ConditionError::Register(error) => error,
        ConditionError::Value(error) => error.into(),
        ConditionError::Notation { text, right } => CliError::Argument { text, right: right.to_owned() },
    })
}

/// Checks the arguments as far as possible without an instance.
fn check(args: &Args) -> Result<(), CliError> {
    let checks = NameChecks::new(&args.instance);
    args.conditions.iter().try_for_each(|text| parse(text, |name| checks.place(name)).map(drop))
}

/// Converts these conditions to operations for an instance.
///
/// # Errors
/// A text is not a condition, or the instance does not have its register.
pub(crate) fn conditions_of(session: &Session, texts: &[String]) -> Result<Vec<Op>, CliError> {
    let parsed = texts.iter().map(|text| parse(text, |name| session.place(name)));
    parsed.map(|condition| op_of(session, &condition?)).collect()
}

/// Converts one condition to an operation.
fn op_of(session: &Session, condition: &Condition) -> Result<Op, CliError> {
    let Condition { place, test, .. } = condition;
    let (offset, width) = (place.offset(), place.width());
    Ok(Op::Condition { plc: session.plc_of(place)?, offset, width, test: *test })
}

/// Waits. Prints the registers with a true condition.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    use super::output;
    use super::peek::{self, ReadTarget, RegisterReading};
    use crate::channel::ClientError;
    use crate::request::{Refused, Waited};

    check(args)?;
    let session = Session::open(&args.instance, args.within)?;
    let conditions = args.conditions.iter().map(|text| parse(text, |name| session.place(name)));
    let conditions = conditions.collect::<Result<Vec<_>, _>>()?;
    let ops = conditions.iter().map(|condition| op_of(&session, condition));
    let mut ops = ops.collect::<Result<Vec<_>, CliError>>()?;
    let within_us = args.within;
    ops.push(Op::WaitFor { any: args.any, within_us });
    let wanted =
        conditions.iter().map(|it| Ok(ReadTarget::One(session.plc_of(&it.place)?, it.place.clone())));
    let wanted = wanted.collect::<Result<Vec<_>, CliError>>()?;
    let targets: Vec<_> = wanted.iter().collect();
    let waits = ops.len();
    // The same request reads the registers at the moment of the match. With too many conditions, the emulator refuses
    // the wait.
    if conditions.len() <= MAX_CONDITIONS {
        ops.extend(Read::ops(&peek::reads(&targets)));
    }
    let outcome = session.request(&ops);
    let holds = |held: u32, bit: usize| held >> bit & 1 != 0;
    match outcome {
        Ok(mut replies) => {
            let snapshot = Snapshot::of(replies.split_off(waits.min(replies.len())))?;
            let Waited { time_us, value: held } =
                replies.pop().ok_or(crate::request::WrongReply)?.waited()?;
            let holdings = peek::readings(&session, &targets, &snapshot);
            let holdings: Vec<_> = holdings.into_iter().flatten().collect();
            let line = |(bit, holding): (usize, &RegisterReading)| {
                let line = peek::line(holding);
                holds(held, bit).then(|| format!("{}  at {}\n", line.trim_end(), time::seconds(time_us)))
            };
            output::print(&holdings.iter().enumerate().filter_map(line).collect::<String>())
        }
        Err(CliError::Client(ClientError::Refused(Refused {
            waited: Some(Waited { time_us, value: held }),
            ..
        }))) => {
            let holdings = peek::read(&session, &wanted)?;
            let unmet =
                conditions.into_iter().zip(holdings).enumerate().map(|(bit, (condition, holding))| {
                    let RegisterReading { register, address, hex, meaning, .. } = holding;
                    let place =
                        if register == address { register } else { format!("{register} ({address})") };
                    let found = format!("{hex}, {meaning}");
                    UnmetCondition { place, wanted: condition.wanted, found, holds: holds(held, bit) }
                });
            let mut unmet: Vec<_> = unmet.collect();
            Err(match unmet.pop() {
                Some(unmet_one) if unmet.is_empty() => {
                    CliError::NotMet { unmet: unmet_one, within_us, time_us }
                }
                last => {
                    unmet.extend(last);
                    CliError::NoneMet { conditions: unmet, any: args.any, within_us, time_us }
                }
            })
        }
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::super::device::of_any_device;
    use super::*;

    #[test]
    fn a_condition_knows_its_register() {
        let condition = parse("line2:node2.w_OPTION_STATUS==master-active", of_any_device).unwrap();
        assert_eq!((condition.place.plc.as_deref(), condition.test.value), (Some("line2"), 0x80));
    }

    #[test]
    fn mistakes_are_explained() {
        let message = |text| parse(text, of_any_device).err().unwrap().to_string();
        assert!(message("node2.w_OPTION_STATUS=1").contains("write REG==VALUE"));
        assert!(message("node2.w_OPTION_STAT==1").contains("did you mean w_OPTION_STATUS?"));
        assert!(message("node2.*STATUS*==1").contains("can mean several registers"));
    }
}
