//! `commram poke`: write registers.

use super::Instance;
use super::complete;
use super::device::NameChecks;
use super::error::CliError;
use super::place::NamedLocation;
use super::session::Session;
use super::writes::RegisterWrite;
use crate::request::{MAX_OPS, Op, Reply, WrongReply};

/// Write registers.
///
/// All writes go to the emulator in one message and are done in the given order, without interruption. Values are
/// decimal (67, for signed types also -5), hexadecimal (16#43, 0x43), octal (8#103), binary (2#100_0011), or the
/// names that `commram map REG` shows (restart, start-synchronous). A register that only the firmware writes can be
/// written too, as in the real RAM. A note says so: the firmware does not read it, and the value remains until the
/// firmware next writes the register. A single bit is written with its register: the other bits keep their values.
/// A forced register keeps its value, and a note says so.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram poke node2.w_CPU_CONTROL=16#0001
  commram poke node2.w_CPU_CONTROL=handshake
  commram poke 'node2.w_CPU_CONTROL := 16#0001;'
  commram poke 'node2.a_WR_VALUE[0]=-1000' node2.b_CTRLREG_WRC1=16#05
  commram poke %MW3.200000=0x20
  commram poke %MX3.200000.5=1 node2.w_CPU_CONTROL.6=FALSE
  commram poke line2:node2.w_CPU_CONTROL=0")]
pub(crate) struct Args {
    /// Registers by name or address, and their new values
    #[arg(add = complete::writes(), value_name = "REG=VALUE", required = true)]
    writes: Vec<String>,
    #[command(flatten)]
    instance: Instance,
}

/// Checks registers and their new values before the command connects to the instance.
///
/// # Errors
/// The notation, a register or a value is wrong.
pub(crate) fn check(instance: &Instance, writes: &[String]) -> Result<(), CliError> {
    let checks = NameChecks::new(instance);
    writes.iter().try_for_each(|text| parse(text, |name| checks.place(name)).map(drop))
}

/// Parses a register, which `place` looks up, and its new value.
///
/// # Errors
/// The notation, the register or the value is wrong.
pub(crate) fn parse(
    text: &str,
    place: impl Fn(&str) -> Result<NamedLocation, CliError>,
) -> Result<(NamedLocation, u32), CliError> {
    let wrong = |right: &str| CliError::Argument { text: text.to_owned(), right: right.to_owned() };
    let example = "write REG=VALUE, for example node2.w_CPU_CONTROL=16#0001";
    let (register, value) = text.split_once('=').ok_or_else(|| wrong(example))?;
    if value.starts_with('=') {
        return Err(wrong("write one `=`; `commram wait` uses comparisons"));
    }
    // Accepts the notation of Structured Text, with or without the final `;`.
    let register = register.trim_end();
    let register = register.strip_suffix(':').unwrap_or(register);
    let value = value.trim_end();
    let value = value.strip_suffix(';').unwrap_or(value);
    let place = place(register.trim())?;
    let value = place.parse_value(value)?;
    Ok((place, value))
}

/// Writes the registers that the arguments name.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    check(&args.instance, &args.writes)?;
    let session = Session::open(&args.instance, 0)?;
    let parse = |text: &String| parse(text, |name| session.place(name));
    let writes = args.writes.iter().map(parse).collect::<Result<Vec<_>, _>>()?;
    let stores = RegisterWrite::of(&session, &writes)?;
    let mut ops: Vec<_> = stores.iter().map(RegisterWrite::store).collect();
    // The request with the writes also reads the registers that the notes need, which saves a second request.
    let statuses =
        writes.iter().map(|(place, _)| peek_status(&session, place)).collect::<Result<Vec<_>, _>>()?;
    ops.extend(statuses.iter().flatten());
    ops.push(Op::Forces);
    // A request has a maximum number of operations. If there are very many writes, some of the reads follow in further
    // requests.
    let (first, rest) = ops.split_at(ops.len().min(MAX_OPS.max(writes.len())));
    let mut replies = session.request(first)?;
    replies.extend(session.request_in_parts(rest)?);
    let forces = replies.pop().ok_or(WrongReply)?.forces()?;
    writes.iter().for_each(|(place, _)| note_if_not_whole(place));
    let mut replies = replies.into_iter();
    for (store, reply) in stores.iter().zip(replies.by_ref()) {
        store.complete(&session, reply)?;
    }
    for (((place, _), status), store) in writes.iter().zip(statuses).zip(&stores) {
        let status = status.and_then(|_| replies.next()).map(Reply::value).transpose()?;
        match forces.iter().any(|forced| store.is_to(forced)) {
            true => note_forced(place, status),
            false => note_if_firmwares(place, status),
        }
    }
    Ok(())
}

/// Returns the operation that reads the status register of overlaid structures at `place`. `None` if the registers at
/// `place` are not overlaid.
fn peek_status(session: &Session, place: &NamedLocation) -> Result<Option<Op>, CliError> {
    let Some(status) = place.status() else { return Ok(None) };
    let address = status.address();
    Ok(Some(Op::Peek { plc: session.plc_of(place)?, offset: address.offset(), width: address.width() }))
}

/// Prints a note that the register is forced.
fn note_forced(place: &NamedLocation, status: Option<u32>) {
    let name = place.label(place.phase(status));
    super::output::note(&format!("{name} is forced and keeps its value; `commram unforce` releases it"));
}

/// Prints a note if only the firmware writes the register.
fn note_if_firmwares(place: &NamedLocation, status: Option<u32>) {
    use crate::layout::Owner;

    let live = place.phase(status);
    let owner = place.owner(live).or_else(|| place.bit_in().map(|(register, _)| register.owner()));
    if owner == Some(Owner::Firmware) {
        let place = place.label(live);
        super::output::note(&format!(
            "only the firmware writes {place}: the value was written and remains until the firmware writes the register \
             again"
        ));
    }
}

/// Prints a note if the write does not cover exactly one register.
fn note_if_not_whole(place: &NamedLocation) {
    if place.bit().is_none() && !place.is_whole() {
        let (address, what) = (place.address(), place.meaning(place.last_phase(), 0));
        super::output::note(&format!("{address} is not a whole register: {what}; the value was written"));
    }
}

#[cfg(test)]
mod tests {
    use super::super::device::of_any_device;
    use super::*;

    #[test]
    fn a_write_is_a_register_and_a_value() {
        let (place, value) = parse("line2:node2.w_CPU_CONTROL=16#0020", of_any_device).unwrap();
        assert_eq!((place.plc.as_deref(), place.offset(), value), (Some("line2"), 200_000, 0x20));
    }

    #[test]
    fn structured_text_and_names_of_values_are_understood() {
        let value = |text| parse(text, of_any_device).unwrap().1;
        assert_eq!(value("node2.w_CPU_CONTROL := 16#20;"), 0x20);
        assert_eq!(value("line2:node2.w_CPU_CONTROL:=16#20"), 0x20);
        assert_eq!(value("node2.w_CPU_CONTROL=start-synchronous"), 0x20);
    }

    #[test]
    fn mistakes_are_explained() {
        let message = |text| parse(text, of_any_device).err().unwrap().to_string();
        assert_eq!(
            message("node2.w_CPU_CONTROL"),
            "`node2.w_CPU_CONTROL`: write REG=VALUE, for example node2.w_CPU_CONTROL=16#0001"
        );
        assert!(message("node2.w_CPU_CONTROL==1").contains("`commram wait`"));
        assert!(message("%MX3.200000.1=2").contains("is no value of a single bit"));
        assert!(message("node2.w_CPU_CONTRL=1").contains("w_CPU_CONTROL"));
        assert!(message("node2.w_CPU_CONTROL=").contains("is no number"));
    }
}
