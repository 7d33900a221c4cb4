//! `commram find`: search in the register map, without an emulator.

use super::device::DeviceArg;
use super::error::CliError;
use super::given;
use super::map::entry::{self, Entry};
use super::session::Session;
use super::table::{self, FormatArg};
use super::{Instance, instance_name};
use crate::layout::{DeviceFit, Fit, did_you_mean};

/// Find registers by name, meaning, values, bits or address.
///
/// With several words, an entry must contain all of them anywhere. Case is ignored. Matches in the name come first.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram find status
  commram find SYNC time
  commram find \"bus-off\"
  commram find control --format json
  commram find status -i press-1

Exit code 1 if no register is found.")]
pub(crate) struct Args {
    /// Words to find
    #[arg(value_name = "TEXT", required = true, value_parser = given::text("write words to find, for example cpu control"))]
    text: Vec<String>,
    /// Also registers that the manual reserves
    #[arg(long = "full", alias = "all")]
    all: bool,
    #[command(flatten)]
    device: DeviceArg,
    /// Search the PLCs of this instance with their options
    #[arg(add = super::complete::instances(), short, long, value_name = "NAME", value_parser = instance_name, conflicts_with = "device")]
    instance: Option<String>,
    #[command(flatten)]
    format: FormatArg,
}

pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let devices = match &args.instance {
        None => vec![DeviceFit::unknown(args.device.layout())],
        Some(instance) => distinct(Session::open_for_reading(&Instance::starting(instance))?.all_fitted()),
    };
    let words = words(args.text.iter().map(String::as_str));
    let found = entries_with(&devices, &words, args.all);
    if found.is_empty() {
        let searched = devices.iter().flat_map(entries).filter(|entry| args.all || !entry.reserved);
        let names: Vec<_> = searched.map(|entry| entry.name).collect();
        // The suggestions compare names without area and indices, because users rarely misspell these.
        let bare = |name: &String| {
            let name = name.split('[').next().unwrap_or_default();
            name.split_once('.').map_or(name, |(_, register)| register).to_owned()
        };
        let names: Vec<_> = names.iter().map(bare).collect();
        let text = args.text.join(" ");
        let hint = did_you_mean(&text, names.iter().map(String::as_str));
        let device = devices.first().map_or("", |fitted| fitted.device().title);
        return Err(CliError::NotFound { text, device, hint });
    }
    table::print(args.format.format, &found, |found| text(found, &words))
}

/// Returns the devices without repetitions.
pub(crate) fn distinct(devices: &[DeviceFit]) -> Vec<DeviceFit> {
    let mut all = Vec::new();
    for fitted in devices {
        if !all.contains(fitted) {
            all.push(*fitted);
        }
    }
    all
}

/// Returns the words to search for, in lower case, with blanks in place of hyphens and underscores.
pub(crate) fn words<'a>(texts: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    texts.into_iter().flat_map(str::split_whitespace).map(folded).collect()
}

/// Returns the entries that contain all words, the best match first. `all`: includes reserved registers.
pub(crate) fn entries_with(devices: &[DeviceFit], words: &[String], all: bool) -> Vec<Entry> {
    let candidates = devices.iter().flat_map(entries).filter(|entry| all || !entry.reserved);
    let mut found: Vec<_> = candidates.filter_map(|entry| Some((rank(&entry, words)?, entry))).collect();
    // Entries of equal rank stay in the order of the register map.
    found.sort_by_key(|(rank, _)| *rank);
    found.into_iter().map(|(_, entry)| entry).collect()
}

fn entries(fitted: &DeviceFit) -> impl Iterator<Item = Entry> + use<> {
    let fitted = *fitted;
    let areas = fitted.device().named_areas().filter(move |area| fitted.area(area) != Fit::Empty);
    areas.flat_map(move |area| entry::of_area(&fitted, area))
}

/// Converts to lower case, and replaces hyphens and underscores by blanks.
pub(crate) fn folded(text: &str) -> String {
    text.to_lowercase().replace(['-', '_'], " ")
}

/// Rank of the match; a smaller rank is better. The ranks are: all words in the name; in name and meaning; in values
/// and bits too. `None` if a word is missing.
pub(crate) fn rank(entry: &Entry, words: &[String]) -> Option<u8> {
    let name = folded(&format!("{} {} {} {}", entry.name, entry.address, entry.structure, entry.variable));
    let meaning = format!("{name} {}", folded(entry.meaning));
    let all = format!(
        "{meaning} {}",
        folded(&values_and_bits(entry).map(|(what, text)| what + " " + &text + " ").collect::<String>())
    );
    let texts = [name, meaning, all];
    let holds_all = |text: &String| words.iter().all(|word| text.contains(word.as_str()));
    texts.iter().position(holds_all).map(|rank| rank as u8)
}

/// Returns texts of values and bits, each with its meaning and the source of the meaning.
fn values_and_bits(entry: &Entry) -> impl Iterator<Item = (String, String)> {
    let values = entry.values.iter().map(|value| (value.hex.clone(), value.described()));
    let bits = entry.bits.iter().map(|bit| {
        let which = if bit.first == bit.last {
            format!("bit {}", bit.first)
        } else {
            format!("bits {}-{}", bit.first, bit.last)
        };
        (format!("{which} {}", bit.name), bit.described())
    });
    values.chain(bits)
}

/// Returns one line per register, with the values and bits that match.
fn text(found: &[Entry], words: &[String]) -> String {
    let line = |entry: &Entry| {
        let Entry { name, address, ty, owner, provenance, meaning, .. } = entry;
        [name, address, ty, owner, provenance.short(), *meaning].map(str::to_owned).to_vec()
    };
    let lines = table::rows(&found.iter().map(line).collect::<Vec<_>>());
    let mut text = String::new();
    for (entry, line) in found.iter().zip(&lines) {
        text.push_str(line);
        text.push('\n');
        let hit = |(what, meaning): &(String, String)| {
            let both = folded(&format!("{what} {meaning}"));
            words.iter().any(|word| both.contains(word.as_str()))
        };
        for (what, meaning) in values_and_bits(entry).filter(hit) {
            text.push_str(&format!("    {what}  {meaning}\n"));
        }
    }
    text
}
