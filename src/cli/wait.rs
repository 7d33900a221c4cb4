//! `commram wait`: wait for a register.

use super::Instance;
use super::device::of_any_device_but_told_by;
use super::error::CliError;
use super::place::Place;
use super::time;

/// Wait until a register holds a value.
///
/// In stepped mode the emulated time passes meanwhile, event by event, and stands still again at the moment
/// of the match.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram wait 'node2.w_OPTION_STATUS==16#0043' --within 10ms
  commram wait 'node2.a_STAT_SL[1]&2==2' --within 2s
  commram wait %MX3.200004.2==1

Exit code 1 if the register does not hold the value in time; the message says what it held.")]
pub(crate) struct Args {
    /// REG==VALUE, or REG&MASK==VALUE if only some bits count
    #[arg(value_name = "CONDITION")]
    condition: String,
    /// Longest wait in emulated time
    #[arg(long, value_name = "TIME", default_value = "1s", value_parser = time::parse)]
    within: u64,
    #[command(flatten)]
    instance: Instance,
}

struct Condition {
    place: Place,
    /// The bits that count.
    mask: u32,
    value: u32,
    /// As given behind the register, for messages.
    wanted: String,
}

/// The condition, with the register that `place` looks up.
fn parse(text: &str, place: impl Fn(&str) -> Result<Place, CliError>) -> Result<Condition, CliError> {
    let wrong = |right: &str| CliError::Argument { text: text.to_owned(), right: right.to_owned() };
    let example = "write REG==VALUE or REG&MASK==VALUE, for example node2.w_OPTION_STATUS==16#0043";
    let (left, value) = text.split_once("==").ok_or_else(|| wrong(example))?;
    let (register, mask) = match left.split_once('&') {
        Some((register, mask)) => (register, Some(mask)),
        None => (left, None),
    };
    let place = place(register.trim())?;
    let given = place.parse_value(value)?;
    let (mask, value, wanted) = match (place.bit(), mask) {
        (Some(_), Some(_)) => return Err(wrong("a single bit needs no mask")),
        (Some(bit), None) => (1 << bit, given << bit, given.to_string()),
        (None, Some(mask)) => {
            let mask = place.parse_value(mask)?;
            (mask, given, format!("{} under mask {}", shown(&place, given), shown(&place, mask)))
        }
        (None, None) => (place.width().max_value(), given, shown(&place, given)),
    };
    if value & !mask != 0 {
        return Err(wrong("the value has bits outside the mask, so this can never be"));
    }
    Ok(Condition { place, mask, value, wanted })
}

fn shown(place: &Place, value: u32) -> String {
    place.format(crate::layout::Live::Cyclic, value)
}

/// Waits and prints the register.
#[cfg(feature = "channel")]
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    use super::session::{Read, Session};
    use super::{output, peek, place::live_by};
    use crate::channel::ClientError;
    use crate::layout::Live;
    use crate::request::{Op, Refused, Waited};

    parse(&args.condition, of_any_device_but_told_by(&args.instance))?;
    let session = Session::open(&args.instance, args.within)?;
    let Condition { place, mask, value, wanted } = parse(&args.condition, |name| session.place(name))?;
    let (plc, offset, width) = (session.plc_of(&place)?, place.offset(), place.width());
    let within_us = args.within;
    let wait = Op::Wait { plc, offset, width, mask, value, within_us };
    let outcome = session.ask(wait);
    // What the value means depends on which of two overlaid structures is live.
    let live = match place.status() {
        Some(status) => {
            let snapshot = session.read(&[Read::register(plc, &status)])?;
            live_by(snapshot.data.first().map_or(0, |bytes| peek::number(bytes)))
        }
        None => Live::Cyclic,
    };
    match outcome {
        Ok(reply) => {
            let Waited { time_us, value } = reply.waited()?;
            let holding = peek::holding(&session, &place, plc, live, value, time_us);
            output::print(&format!("{}  at {}\n", peek::line(&holding).trim_end(), time::seconds(time_us)))
        }
        Err(CliError::Client(ClientError::Refused(Refused {
            waited: Some(Waited { time_us, value: last }),
            ..
        }))) => {
            let label = session.prefix(plc) + &place.label(live);
            let found = format!("{}, {}", place.format(live, last), place.meaning(live, last));
            Err(CliError::NotMet { place: label, wanted, within_us, time_us, found })
        }
        Err(error) => Err(error),
    }
}

/// Checks the arguments and says that there is no channel.
#[cfg(not(feature = "channel"))]
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    parse(&args.condition, of_any_device_but_told_by(&args.instance))?;
    Err(CliError::NoChannel { command: "wait" })
}

#[cfg(test)]
mod tests {
    use super::super::device::of_any_device;
    use super::*;

    #[test]
    fn conditions() {
        let parsed =
            |text| parse(text, of_any_device).map(|condition| (condition.mask, condition.value)).unwrap();
        assert_eq!(parsed("node2.w_OPTION_STATUS==16#0043"), (0xFFFF, 0x43));
        assert_eq!(parsed("node2.w_OPTION_STATUS & 16#80 == 16#80"), (0x80, 0x80));
        assert_eq!(parsed("%MX3.200004.2==1"), (4, 4));
        assert_eq!(parsed("%MX3.200004.2==0"), (4, 0));
        assert_eq!(parsed("node2.a_RD_BMARRAY[1][0]==-1"), (0xFFFF_FFFF, 0xFFFF_FFFF));
    }

    #[test]
    fn mistakes_are_explained() {
        let message = |text| parse(text, of_any_device).err().unwrap().to_string();
        assert!(message("node2.w_OPTION_STATUS=1").contains("write REG==VALUE"));
        assert!(message("node2.w_OPTION_STATUS&1==2").contains("can never be"));
        assert!(message("%MX3.200004.2&1==1").contains("needs no mask"));
        assert!(message("node2.w_OPTION_STATUS===1").contains("is no number"));
    }
}
