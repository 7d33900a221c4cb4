//! Devices in folders with a script: hooks, limits, snapshots.

use commram::devices::folder;
use commram::fmi::{Resources, Unit, Value, VariableType};
use commram::plant::PlantConfig;
use commram::script::{Bench, Limits, Outcome, run_file};
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

const EXAMPLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices");

const STRUCTURE: &str = "\
name = 'CARD'
name_from = 'manual'
size = 32
page = '1'
doc = 'Registers'
offsets = 'manual'
names = 'manual'
types = 'manual'
owners = 'manual'
resets = 'manual'
register = [
  { offset = 0, name = 'w_COMMAND', type = 'WORD', owner = 'both', doc = 'Command' },
  { offset = 2, name = 'w_DATA', type = 'WORD', owner = 'plc', doc = 'Data' },
  { offset = 4, name = 'i_VALUE', type = 'INT', owner = 'firmware', doc = 'Value' },
  { offset = 6, name = 'w_COUNT', type = 'WORD', owner = 'firmware', doc = 'Count' },
  { offset = 8, name = 'a_IN', type = 'WORD', array = [8], owner = 'plc', doc = 'In' },
  { offset = 24, name = 'a_OUT', type = 'WORD', array = [4], owner = 'firmware', doc = 'Out' },
]
";

/// A folder with a made-up card and this script.
pub(super) struct Card(tempfile::TempDir);

impl Card {
    pub(super) fn new(script: &str) -> Self {
        // A process identifies a device by the hash of its layout, so each card has another name.
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let card = Card(tempfile::tempdir().unwrap());
        let device = format!(
            "name = 'card{number}'\ntitle = 'Card'\nmanual = 'card-1.0'\nnames = 'manual'\nstructures = ['CARD']\n\
             reserved = {{ owner = 'firmware', source = 'manual' }}\n\
             space = [{{ name = 'card', letter = 'M', segment = 3, unit = 'byte', first = 0, offset = 4096, page = '1', doc = 'memory' }}]\n\
             area = [{{ name = 'card', first = 0, page = '1', doc = 'Card', structure = [{{ name = 'CARD', live = 'always' }}] }}]\n"
        );
        card.write("device.toml", &device);
        card.write("CARD.toml", STRUCTURE);
        card.write("firmware.rhai", script);
        card
    }

    /// Does the same as [`Card::new`], for a card with a CAN port.
    pub(super) fn with_port(script: &str) -> Self {
        let card = Self::new(script);
        let device = fs::read_to_string(card.dir().join("device.toml")).unwrap();
        card.write(
            "device.toml",
            &(device + "port = [{ name = 'can', number = 1, medium = 'can', roles = ['peer'] }]\n"),
        );
        card
    }

    pub(super) fn dir(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.dir().join(name), text).unwrap();
    }

    pub(super) fn bench(&self) -> Bench {
        Bench::plant(&format!("[[device]]\nname = 'card'\nkind = '{}'\n", self.dir().display())).unwrap()
    }

    pub(super) fn refused(&self) -> String {
        folder::load(self.dir()).unwrap_err().to_string()
    }
}

/// Returns the lines of the journal, each with its kind.
pub(super) fn journal(bench: &mut Bench) -> Vec<String> {
    let lines = bench.last_entries(1000).unwrap();
    lines.iter().map(|line| format!("{} {}: {}", line.time_us, line.kind, line.text.trim())).collect()
}

/// Runs a script for some time. Returns the line of the journal about its stop.
fn stop_of(script: &str) -> String {
    stop_of_card(&Card::new(script), script)
}

/// Runs the script of a card like [`stop_of`].
fn stop_of_card(card: &Card, script: &str) -> String {
    card.write("firmware.rhai", script);
    let mut bench = card.bench();
    bench.poke("card.w_DATA", 1).unwrap();
    bench.step("20ms").unwrap();
    assert_eq!(bench.peek("front.script").unwrap(), 1, "{script}");
    // The emulator continues, and the next power-on starts the script again.
    bench.poke("card.w_DATA", 0).unwrap();
    bench.step("1s").unwrap();
    let lines = journal(&mut bench);
    let stops: Vec<_> = lines.into_iter().filter(|line| line.contains(" stopped: ")).collect();
    assert_eq!(stops.len(), 1, "{script}: {stops:?}");
    stops[0].clone()
}

#[test]
fn the_examples_pass_their_scenarios() {
    for example in ["mailbox", "encoder"] {
        let dir = Path::new(EXAMPLES).join(example);
        let plant = format!("[[device]]\nname = '{example}'\nkind = '{}'\n", dir.display());
        let bench = Bench::plant(&plant).unwrap();
        let scenario = dir.join("tests").join(example).with_extension("rhai");
        let report = run_file(&scenario, Some(bench), Limits::default(), |_| {});
        assert!(matches!(report.outcome, Outcome::Passed), "{:?}", report.outcome);
        let lines: usize = ["device.toml", "firmware.rhai", "handshakes.toml"]
            .iter()
            .filter_map(|name| fs::read_to_string(dir.join(name)).ok())
            .map(|text| text.lines().count())
            .sum();
        assert!(lines <= 120, "{example}: {lines}");
    }
}

/// The example `encoder` is a card in a slot of a PLC, and handles the trigger, the interrupt and the SYNC signal.
#[test]
fn the_encoder_is_an_option_card() {
    let tests = Path::new(EXAMPLES).join("encoder/tests");
    let report = run_file(&tests.join("option.rhai"), None, Limits::default(), |_| {});
    assert!(matches!(report.outcome, Outcome::Passed), "{:?}", report.outcome);
}

#[test]
fn hooks_are_called_when_they_are_due() {
    let card = Card::new(
        "import \"helper\" as helper;
const LIMIT = 3;
fn power_on() { this.polls = 0; after(\"2ms\", \"later\", [7]); at(\"5ms\", \"later\", [9]); }
fn poll() { if this.polls < global::LIMIT { this.polls += 1; output(\"card.w_COUNT\", this.polls); } }
fn written(register, old, value) {
    journal(`${register} ${old} ${value}`);
    if register == \"card.w_COMMAND\" && !exchange(register, 5, helper::answer()) { journal(\"too late\"); }
}
fn later(number) { write(\"card.i_VALUE\", -number); this.last = cancel(after(1, \"later\", [0])); }
fn power_off() { journal(\"off\"); }
",
    );
    card.write("helper.rhai", "fn answer() { 4 }");
    assert_eq!(folder::load(card.dir()).unwrap().hooks(), ["power_on", "power_off", "poll", "written"]);
    let mut bench = card.bench();
    bench.step("1ms").unwrap();
    bench.poke("card.w_COMMAND", 5).unwrap();
    bench.poke("card.a_IN[3]", 0xFFFF).unwrap();
    bench.step("9ms").unwrap();
    assert_eq!(bench.peek("card.w_COMMAND").unwrap(), 4);
    assert_eq!((bench.peek("card.w_COUNT").unwrap(), bench.peek("card.i_VALUE").unwrap()), (3, -9));
    bench.power_cycle("").unwrap();
    let lines = journal(&mut bench);
    for line in [
        " handshake: ",
        "1500 note: 0.001500 s  card        card.w_COMMAND 0 5",
        "card.a_IN[3] 0 65535",
        "2000 register: ",
        "5000 register: ",
        "10000 note: 0.010000 s  card        off",
    ] {
        assert!(lines.iter().any(|it| it.contains(line)), "{line}: {lines:#?}");
    }
    assert!(!lines.iter().any(|line| line.contains("4 ->") || line.contains("too late")), "{lines:#?}");
}

/// `WRITTEN` selects registers, `copy` moves bytes of any width, and `reset` also clears registers of the program.
#[test]
fn a_script_selects_copies_and_resets_registers() {
    let card = Card::new(
        "const WRITTEN = [\"card.w_COMMAND\", \"card.a_IN[0]\", \"card.a_*[0..0]\"];
fn written(register, old, value) {
    this.calls = if \"calls\" in this { this.calls + 1 } else { 1 };
    write(\"card.w_COUNT\", this.calls);
    if value == 1 { copy(\"card.a_IN[1..4]\", \"card.a_OUT\"); }
    if value == 2 { reset(\"card\"); }
    if value == 3 { copy(\"card.a_OUT[0..1]\", \"card.a_OUT[1..2]\"); }
}
",
    );
    let mut bench = card.bench();
    let out = |bench: &mut Bench| [0, 1, 2, 3].map(|n| bench.peek(&format!("card.a_OUT[{n}]")).unwrap());
    for n in 1..8 {
        bench.poke(&format!("card.a_IN[{n}]"), 0x1100 + n).unwrap();
    }
    bench.step("1ms").unwrap();
    assert_eq!(bench.peek("card.w_COUNT").unwrap(), 0, "no register of WRITTEN");
    bench.poke("card.w_COMMAND", 1).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(out(&mut bench), [0x1101, 0x1102, 0x1103, 0x1104]);
    bench.poke("card.a_IN[0]", 3).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(out(&mut bench), [0x1101, 0x1101, 0x1102, 0x1104], "the blocks overlap");
    assert_eq!(bench.peek("card.w_COUNT").unwrap(), 2, "a register with two names counts once");
    bench.poke("card.w_COMMAND", 2).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(out(&mut bench), [0; 4]);
    for register in ["card.w_COMMAND", "card.a_IN[7]", "card.w_COUNT"] {
        assert_eq!(bench.peek(register).unwrap(), 0, "{register}");
    }
    // Changes that the device itself makes do not count as writes of the program.
    bench.step("5ms").unwrap();
    assert_eq!(bench.peek("card.w_COUNT").unwrap(), 0);
}

/// A snapshot contains the state of the script, its timers and the values that programs have written.
#[test]
fn going_back_restores_the_middle_of_everything() {
    let card = Card::new(
        "fn power_on() { this.log = []; this.map = #{ a: 1.5, b: \"text\" }; }
fn written(register, old, value) { this.log.push(value); after(\"1ms\", \"answer\", [value]); after(\"1ms\", \"count\"); }
fn answer(value) { write(\"card.i_VALUE\", value + this.log.len()); }
fn count() { write(\"card.w_COUNT\", read(\"card.w_COUNT\") + 1); }
",
    );
    let mut bench = card.bench();
    bench.poke("card.w_DATA", 100).unwrap();
    bench.step("600us").unwrap();
    let middle = bench.save().unwrap();
    let mut ends = Vec::new();
    for _ in 0..3 {
        bench.step("300us").unwrap();
        bench.poke("card.w_DATA", 200).unwrap();
        bench.step("5ms").unwrap();
        ends.push((
            bench.peek("card.i_VALUE").unwrap(),
            bench.peek("card.w_COUNT").unwrap(),
            bench.journal_hash(),
        ));
        bench.back_to(middle).unwrap();
        assert_eq!(bench.peek("card.w_COUNT").unwrap(), 0);
    }
    assert_eq!((ends[0].0, ends[0].1), (202, 2));
    assert!(ends.iter().all(|end| end == &ends[0]), "{ends:?}");
}

/// A snapshot also contains the fact that the script was stopped.
#[test]
fn a_stop_is_visible_until_the_next_power_on() {
    let card = Card::new(
        "fn written(register, old, value) {\n    if value == 2 { throw \"broken\"; }\n    write(\"card.w_COUNT\", value);\n}\n",
    );
    let mut bench = card.bench();
    bench.poke("card.w_DATA", 1).unwrap();
    bench.step("1ms").unwrap();
    let before = bench.save().unwrap();
    bench.poke("card.w_DATA", 2).unwrap();
    bench.step("1ms").unwrap();
    assert!(bench.describe("front.script").unwrap().contains("stopped"));
    let stopped = bench.save().unwrap();
    let lines = journal(&mut bench);
    assert!(lines.iter().any(|line| line.ends_with("script stopped: firmware.rhai:2: broken")), "{lines:#?}");
    bench.back_to(before).unwrap();
    bench.poke("card.w_DATA", 3).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!((bench.peek("front.script").unwrap(), bench.peek("card.w_COUNT").unwrap()), (0, 3));
    bench.back_to(stopped).unwrap();
    bench.poke("card.w_DATA", 4).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!((bench.peek("front.script").unwrap(), bench.peek("card.w_COUNT").unwrap()), (1, 1));
    bench.power_cycle("").unwrap();
    bench.poke("card.w_DATA", 5).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!((bench.peek("front.script").unwrap(), bench.peek("card.w_COUNT").unwrap()), (0, 5));
}

/// A rule of the device, with its text, in every place where findings are shown.
#[test]
fn violations_and_stops_are_findings_with_their_text() {
    let card = Card::new(
        "fn written(register, old, value) {
    if value == 9 { throw \"no page for 9\"; }
    violation(register, if value == 1 { \"first rule (p. 1)\" } else { \"second\\u0007rule\" });
}
",
    );
    let mut bench = card.bench();
    for value in [1, 2, 1, 3] {
        bench.poke("card.w_DATA", value).unwrap();
        bench.step("1ms").unwrap();
    }
    let texts = |bench: &mut Bench| -> Vec<_> {
        let found = bench.findings().unwrap();
        found.iter().map(|it| (it.last.rule.id(), it.text().to_owned(), it.count)).collect()
    };
    let own = |text: &str, count| ("own-rule", text.to_owned(), count);
    assert_eq!(texts(&mut bench), [own("first rule (p. 1)", 2), own("second rule", 2)]);
    let lines = journal(&mut bench);
    assert!(lines.iter().any(|line| line.ends_with("16#0001: first rule (p. 1)")), "{lines:#?}");
    // A snapshot has the texts, too.
    let saved = bench.save().unwrap();
    let before = bench.journal_hash();
    bench.poke("card.w_DATA", 9).unwrap();
    bench.step("1ms").unwrap();
    let stop = ("script-stopped", "firmware.rhai:2: no page for 9".to_owned(), 1);
    assert_eq!(texts(&mut bench).last(), Some(&stop));
    let refused = bench.expect_no_findings(&["own-rule"]).unwrap_err().to_string();
    assert!(refused.contains("front.script") && refused.contains("no page for 9"), "{refused}");
    bench.back_to(saved).unwrap();
    assert_eq!((texts(&mut bench).len(), bench.journal_hash()), (2, before));
    assert_eq!(texts(&mut bench)[1], own("second rule", 2));
}

/// A device declares its own records, and its script writes them.
#[test]
fn own_records_are_in_the_journal_with_their_fields() {
    let tables = "[[record]]\nname = 'limit'\ntext = 'the limit is reached'\nfields = ['count', 'is_high']\npage = '1'\n\
                  [[record]]\nname = 'idle'\ntext = 'nothing to do'\npage = '2'\n";
    let card = Card::new(
        "fn written(register, old, value) {
    switch value {
        1 => record(\"limit\", #{ count: -7, is_high: true }),
        2 => record(\"idle\"),
        3 => record(\"limit\", #{ count: 1 }),
        4 => record(\"limit\", #{ count: 1, is_high: 0, other: 1 }),
        5 => record(\"limit\", #{ count: 0x1_0000_0000, is_high: 0 }),
    }
}
",
    );
    card.write("handshakes.toml", tables);
    let folder = folder::load(card.dir()).unwrap();
    assert_eq!(folder.records.iter().map(|it| it.name.as_str()).collect::<Vec<_>>(), ["limit", "idle"]);
    let mut bench = card.bench();
    for value in [1, 2] {
        bench.poke("card.w_DATA", value).unwrap();
        bench.step("1ms").unwrap();
    }
    let lines = journal(&mut bench);
    for line in [
        "device_record: 0.000500 s  card        limit count=-7 is_high=1: the limit is reached",
        "idle: nothing to do",
    ] {
        assert!(lines.iter().any(|it| it.contains(line)), "{line}: {lines:#?}");
    }
    for (value, refused) in
        [(3, "needs its field `is_high`"), (4, "has no field `other`"), (5, "at most 32 bits")]
    {
        bench.power_cycle("").unwrap();
        bench.step("1ms").unwrap();
        bench.poke("card.w_DATA", value).unwrap();
        bench.step("1ms").unwrap();
        let lines = journal(&mut bench);
        assert!(
            lines.iter().any(|it| it.contains(" stopped: ") && it.contains(refused)),
            "{refused}: {lines:#?}"
        );
    }
    let wrong = Card::new("fn poll() {\n  record(\"limits\");\n}");
    wrong.write("handshakes.toml", tables);
    assert!(wrong.refused().contains("firmware.rhai:2: ") && wrong.refused().contains("did you mean limit?"));
    wrong.write("handshakes.toml", &tables.replace("'idle'", "'limit'"));
    assert!(wrong.refused().contains("handshakes.toml:6: another [[record]]"), "{}", wrong.refused());
    wrong.write("handshakes.toml", &tables.replace("'idle'", "'Idle'"));
    assert!(wrong.refused().contains("handshakes.toml:6: `Idle` is no name"), "{}", wrong.refused());
}

const FAULTS: &str = "\
[[fault]]
name = 'flicker'
text = 'The input is disturbed'
fields = [{ name = 'input', text = 'Number of the input', to = 7 }, { name = 'level', text = 'Level', from = 1, to = 9, default = 3 }]
page = '1'

[[fault]]
name = 'lost'
text = 'The card does not answer'
page = '1'

[[answer]]
register = 'card.w_COMMAND'
request = 5
answer = 4
after = '1ms'
unless_fault = 'lost'
page = '1'
source = 'manual'

[[counter]]
register = 'card.w_COUNT'
every = '1ms'
unless_fault = 'lost'
page = '1'
source = 'manual'

[[mirror]]
from = 'card.w_DATA'
to = 'card.i_VALUE'
unless_fault = 'lost'
page = '1'
source = 'manual'
";

const FAULT_HOOK: &str = "\
fn power_on() { this.flicker = 0; }
fn fault(name, on, fields) {
    journal(`${name} ${on} ${fields}`);
    if name == \"flicker\" {
        this.flicker = if on { fields.level } else { 0 };
        output(\"card.a_OUT[0]\", this.flicker);
    }
}
";

/// The register map of a folder has the same rules as that of a device of commram: for writes through the channel and
/// stores in the image, with and without a script.
#[test]
fn the_checker_reports_reserved_registers_bits_and_values() {
    for script in [Some("fn poll() {}"), None] {
        let card = Card::new(script.unwrap_or_default());
        if script.is_none() {
            fs::remove_file(card.dir().join("firmware.rhai")).unwrap();
        }
        let registers = "register = [
  { offset = 0, name = 'b_A', type = 'BYTE', owner = 'plc', meaning = 'bits', doc = 'A' },
  { offset = 1, name = 'b_B', type = 'BYTE', owner = 'both', meaning = 'values', doc = 'B' },
  { offset = 2, name = 'b_C', type = 'BYTE', owner = 'plc', meaning = 'whole', doc = 'C' },
  { offset = 3, name = 'b_D', type = 'BYTE', owner = 'plc', meaning = 'fields', doc = 'D' },
  { offset = 4, name = 'a_E', type = 'BYTE', array = [4], used = [2], owner = 'plc', doc = 'E' },
  { offset = 8, name = 'd_F', type = 'DWORD', reserved = true, doc = 'F' },
  { offset = 12, name = 'w_G', type = 'WORD', owner = 'firmware', doc = 'G' },
  { offset = 14, padding = 18 },
]
";
        let head = STRUCTURE.split("register = [").next().unwrap();
        card.write("CARD.toml", &format!("{head}{registers}"));
        let meaning = |name: &str, text: &str| format!("[[meaning]]\nname = '{name}'\npage = '1'\n{text}\n");
        let bit =
            "{ at = 0, name = 'on', one = 'on' }, { from = 3, to = 7, name = 'reserved', reserved = true }";
        let field = "{ from = 0, to = 1, name = 'mode', value = [{ is = 1, text = 'one' }, { is = 3, reserved = true }] }";
        let meanings = [
            meaning("bits", &format!("bit = [{bit}]")),
            meaning("values", "value = [{ is = 0, text = 'none' }, { from = 5, to = 9, reserved = true }]"),
            meaning("whole", &format!("value = [{{ is = 24, text = 'both' }}]\nbit = [{bit}]")),
            meaning("fields", &format!("bit = [{field}]")),
        ];
        card.write("meanings.toml", &meanings.concat());
        let device = fs::read_to_string(card.dir().join("device.toml")).unwrap();
        card.write(
            "device.toml",
            &device.replace("names = 'manual'", "names = 'manual'\nparts = ['meanings.toml']"),
        );
        let mut bench = card.bench();
        let segment = bench.segment("").unwrap();
        bench.step("1ms").unwrap();
        let right = [("b_A", 1), ("b_B", 1), ("b_C", 24), ("b_D", 1), ("a_E[1]", 1)];
        for (register, value) in right {
            bench.poke(&format!("card.{register}"), value).unwrap();
        }
        bench.step("1ms").unwrap();
        bench.expect_no_findings(&[]).unwrap();
        let expected = [
            "reserved-bit card.b_A",
            "reserved-value card.b_B",
            "reserved-bit card.b_C",
            "reserved-value card.b_D",
            "reserved-register card.a_E[3]",
            "reserved-register card.d_F",
            "owner card.w_G",
        ];
        let wrong = [("b_A", 0, 0xF1), ("b_B", 1, 6), ("b_C", 2, 8), ("b_D", 3, 3), ("a_E[3]", 7, 1)];
        let found = |bench: &mut Bench| {
            let found = bench.findings().unwrap();
            let found: Vec<_> =
                found.iter().map(|it| format!("{} {}", it.last.rule.id(), bench.finding_place(it))).collect();
            bench.clear_findings().unwrap();
            found
        };
        for (offset, value) in
            wrong.map(|(_, offset, value)| (offset, value)).into_iter().chain([(8, 1), (12, 1)])
        {
            segment.store(4096 + offset, commram::memory::Width::Byte, value).unwrap();
        }
        bench.step("1ms").unwrap();
        assert_eq!(found(&mut bench), expected, "{script:?}");
        for (register, _, value) in wrong {
            bench.poke(&format!("card.{register}"), value).unwrap();
        }
        bench.step("1ms").unwrap();
        assert_eq!(found(&mut bench), expected[..5], "{script:?}");
    }
}

/// Two versions of a folder in one plant, and a folder that is edited: each device has the faults of its own version.
#[test]
fn each_version_of_a_folder_has_its_own_faults() {
    let card = Card::new(FAULT_HOOK);
    let version = |field: &str| {
        FAULTS.replace(
            "name = 'level', text = 'Level', from = 1",
            &format!("name = '{field}', text = 'Level', from = 1"),
        )
    };
    card.write("handshakes.toml", &version("level"));
    let other = tempfile::tempdir().unwrap();
    for name in ["device.toml", "CARD.toml", "firmware.rhai"] {
        let text = fs::read_to_string(card.dir().join(name)).unwrap().replace("fields.level", "fields.gap");
        fs::write(other.path().join(name), text).unwrap();
    }
    fs::write(other.path().join("handshakes.toml"), version("gap")).unwrap();
    let device =
        |name: &str, dir: &Path| format!("[[device]]\nname = '{name}'\nkind = '{}'\n", dir.display());
    let (x, y) = (device("x", card.dir()), device("y", other.path()));
    for plant in [x.clone() + &y, y.clone() + &x] {
        let mut bench = Bench::plant(&plant).unwrap();
        bench.fault("flicker plc=x input=1 level=3").unwrap();
        bench.fault("flicker plc=y input=1 gap=4").unwrap();
        bench.step("1ms").unwrap();
        let values = ["x:card.a_OUT[0]", "y:card.a_OUT[0]"].map(|name| bench.peek(name).unwrap());
        assert_eq!(values, [3, 4]);
        let wrong = bench.fault("flicker plc=x input=1 gap=3").unwrap_err().to_string();
        assert!(wrong.contains("gap has no meaning"), "{wrong}");
        let missing = bench.fault("flicker input=1 gap=3").unwrap_err().to_string();
        assert!(missing.contains("plc is missing"), "{missing}");
        let faults = "[[fault]]\nkind = 'flicker'\nplc = 'x'\ninput = 1\nlevel = 3\n\
                      [[fault]]\nkind = 'flicker'\nplc = 'y'\ninput = 1\ngap = 3\n";
        PlantConfig::parse("plant", &(plant + faults)).unwrap().resolved_faults().unwrap();
    }
    // The folder is edited, and then edited back.
    for field in ["depth", "level"] {
        card.write("handshakes.toml", &version(field));
        let script = FAULT_HOOK.replace("fields.level", &format!("fields.{field}"));
        card.write("firmware.rhai", &script);
        let mut bench = Bench::plant(&x).unwrap();
        bench.fault(&format!("flicker input=1 {field}=3")).unwrap();
        let gone = if field == "level" { "depth" } else { "level" };
        assert!(bench.fault(&format!("flicker input=1 {gone}=3")).is_err());
        let faults = format!("[[fault]]\nkind = 'flicker'\ninput = 1\n{field} = 3\n");
        PlantConfig::parse("plant", &(x.clone() + &faults)).unwrap().resolved_faults().unwrap();
    }
}

/// A declared fault calls the hook at its begin and its end, also after power-on and after going back.
#[test]
fn declared_faults_call_the_hook() {
    let card = Card::new(FAULT_HOOK);
    card.write("handshakes.toml", FAULTS);
    let mut bench = card.bench();
    bench.step("1ms").unwrap();
    let number = bench.fault("flicker input=2 level=7 at=3ms").unwrap();
    let text = bench.faults().unwrap()[0].fault.text(bench.names());
    assert_eq!(text, "flicker plc=card input=2 level=7 at_us=3000");
    let early = bench.save().unwrap();
    bench.step("2500us").unwrap();
    assert_eq!(bench.peek("card.a_OUT[0]").unwrap(), 7);
    let acting = bench.save().unwrap();
    bench.clear_fault(number).unwrap();
    bench.step("1us").unwrap();
    assert_eq!(bench.peek("card.a_OUT[0]").unwrap(), 0);
    let lines = journal(&mut bench);
    for line in [
        "fault 1, flicker: added",
        "0.003000 s  card        flicker true #{\"input\": 2, \"level\": 7}",
        "fault 1, flicker: cleared",
        "0.003500 s  card        flicker false #{\"input\": 2, \"level\": 7}",
    ] {
        assert!(lines.iter().any(|it| it.contains(line)), "{line}: {lines:#?}");
    }
    // Goes back to a time at which the fault acts, and then to a time before the fault began.
    bench.back_to(acting).unwrap();
    assert_eq!((bench.peek("card.a_OUT[0]").unwrap(), bench.faults().unwrap().len()), (7, 1));
    bench.step("1ms").unwrap();
    assert_eq!(bench.peek("card.a_OUT[0]").unwrap(), 7);
    // Power-on empties `this` and the registers; the hook is called again, because the fault still acts.
    bench.power_cycle("").unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(bench.peek("card.a_OUT[0]").unwrap(), 7);
    bench.back_to(early).unwrap();
    assert_eq!(bench.peek("card.a_OUT[0]").unwrap(), 0);
    bench.step("2500us").unwrap();
    assert_eq!(bench.peek("card.a_OUT[0]").unwrap(), 7);
    // A duration ends the fault; a field that is left out has its default value.
    bench.clear_fault(number).unwrap();
    bench.fault("flicker input=0 duration=2ms").unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(bench.peek("card.a_OUT[0]").unwrap(), 3);
    bench.step("1ms").unwrap();
    assert_eq!((bench.peek("card.a_OUT[0]").unwrap(), bench.faults().unwrap().len()), (0, 0));
}

/// A table with `unless_fault` does nothing while the fault acts, and continues afterwards.
#[test]
fn a_fault_suspends_the_tables_that_name_it() {
    let card = Card::new(FAULT_HOOK);
    card.write("handshakes.toml", FAULTS);
    let mut bench = card.bench();
    bench.poke("card.w_DATA", 9).unwrap();
    bench.step("10500us").unwrap();
    assert_eq!((bench.peek("card.w_COUNT").unwrap(), bench.peek("card.i_VALUE").unwrap()), (10, 9));
    // The fault begins while the answer is on its way.
    bench.poke("card.w_COMMAND", 5).unwrap();
    bench.step("1ms").unwrap();
    let number = bench.fault("lost").unwrap();
    bench.poke("card.w_DATA", 8).unwrap();
    let lost = bench.save().unwrap();
    for _ in 0..2 {
        bench.step("10ms").unwrap();
        let seen = ["card.w_COMMAND", "card.w_COUNT", "card.i_VALUE"].map(|name| bench.peek(name).unwrap());
        assert_eq!(seen, [5, 11, 9]);
        bench.back_to(lost).unwrap();
    }
    bench.step("10ms").unwrap();
    bench.clear_fault(number).unwrap();
    // The time of the answer begins with the next poll.
    bench.step("1ms").unwrap();
    assert_eq!((bench.peek("card.w_COMMAND").unwrap(), bench.peek("card.i_VALUE").unwrap()), (5, 8));
    bench.step("1ms").unwrap();
    assert_eq!((bench.peek("card.w_COMMAND").unwrap(), bench.peek("card.w_COUNT").unwrap()), (4, 13));
}

#[test]
fn wrong_declared_faults_are_refused() {
    let card = Card::new(FAULT_HOOK);
    card.write("handshakes.toml", FAULTS);
    let mut bench = card.bench();
    let refused = |bench: &mut Bench, words: &str| bench.fault(words).unwrap_err().to_string();
    assert!(
        refused(&mut bench, "flickr").contains("did you mean flicker?"),
        "{}",
        refused(&mut bench, "flickr")
    );
    assert!(
        refused(&mut bench, "flicker").contains("give input, 0 to 7"),
        "{}",
        refused(&mut bench, "flicker")
    );
    let text = refused(&mut bench, "flicker input=8");
    assert!(text.contains("input is 8; it must be 0 to 7"), "{text}");
    let text = refused(&mut bench, "flicker inputs=1");
    assert!(text.contains("did you mean input?"), "{text}");
    let text = refused(&mut bench, "flicker input=1 count=2");
    assert!(text.contains("count has no meaning for flicker"), "{text}");
    // If a plant has two devices of the folder, the description of the fault must name one of them.
    let plant = |name: &str| format!("[[device]]\nname = '{name}'\nkind = '{}'\n", card.dir().display());
    let mut two = Bench::plant(&(plant("one") + &plant("two"))).unwrap();
    let text = refused(&mut two, "lost");
    assert!(text.contains("plc is missing; give one of: one, two"), "{text}");
    two.fault("lost device=two").unwrap();
    two.poke("one:card.w_COMMAND", 5).unwrap();
    two.poke("two:card.w_COMMAND", 5).unwrap();
    two.step("5ms").unwrap();
    let seen = ["one:card.w_COMMAND", "two:card.w_COMMAND"].map(|name| two.peek(name).unwrap());
    assert_eq!(seen, [4, 5]);
    // Tests errors in a plant file, and then errors in the files of a folder.
    let with = |fault: &str| PlantConfig::parse("plant", &format!("{}[[fault]]\n{fault}\n", plant("card")));
    with("kind = 'flicker'\ninput = 1").unwrap().resolved_faults().unwrap();
    let refused = with("kind = 'flicker'").and_then(|config| config.resolved_faults().map(drop)).unwrap_err();
    assert!(refused.to_string().contains("give input, 0 to 7"), "{refused}");
    let refused = |tables: &str, script: &str| {
        let card = Card::new(script);
        card.write("handshakes.toml", tables);
        card.refused()
    };
    let text = refused(&FAULTS.replace("unless_fault = 'lost'", "unless_fault = 'last'"), "");
    assert!(text.contains(":17: ") && text.contains("did you mean lost?"), "{text}");
    let text = refused(FAULTS, "");
    assert!(text.contains("handshakes.toml:1: the fault `flicker` has no effect"), "{text}");
    let text = refused(&FAULTS.replace("'lost'\ntext", "'flicker'\ntext"), FAULT_HOOK);
    assert!(text.contains(":7: another [[fault]]"), "{text}");
    let text = refused("", FAULT_HOOK);
    assert!(text.contains("the hook fault has no effect"), "{text}");
    let text = refused(FAULTS, "fn fault(name) {}");
    assert!(text.contains("the hook fault is a function fault(name, on, fields)"), "{text}");
}

/// The unit of a plant finds the folders of its devices after a simulator has unpacked it elsewhere.
#[test]
fn a_unit_runs_the_script_of_a_folder() {
    let card = Card::new(
        "fn written(register, old, value) { after(\"1ms\", \"show\", [value]); }\nfn show(value) { output(\"card.w_COUNT\", value); }\n",
    );
    let name = card.dir().file_name().unwrap().to_str().unwrap().to_owned();
    let parent = tempfile::tempdir_in(card.dir().parent().unwrap()).unwrap();
    let plant = parent.path().join("plant.toml");
    fs::write(&plant, format!("[[device]]\nname = 'card'\nkind = '../{name}'\n")).unwrap();
    let unpacked = tempfile::tempdir().unwrap();
    for (file, content) in Resources::of_file(&plant, Vec::new()).unwrap().files() {
        fs::write(unpacked.path().join(file), content).unwrap();
    }
    let mut unit = Unit::new(&Resources::of_directory(unpacked.path()).unwrap()).unwrap();
    let at = |unit: &Unit, name: &str| unit.variables().iter().position(|it| it.name == name).unwrap() as u32;
    let (data, count) = (at(&unit, "card.w_DATA"), at(&unit, "card.w_COUNT"));
    unit.begin(0.0, None).unwrap();
    unit.set(data, VariableType::U16, Value::Integer(7)).unwrap();
    unit.step(0.0, 0.001).unwrap();
    assert_eq!(unit.get(count, VariableType::U16), Ok(Value::Integer(0)));
    unit.step(0.001, 0.001).unwrap();
    assert_eq!(unit.get(count, VariableType::U16), Ok(Value::Integer(7)));
}

/// A unit has the registers of an option card among those of its PLC.
#[test]
fn a_unit_runs_an_option_card() {
    let card = Card::new("fn written(register, old, value) { output(\"card.w_COUNT\", value); }\n");
    let place = tempfile::tempdir().unwrap();
    let plant = place.path().join("plant.toml");
    let section = format!("[[plc.option]]\nslot = 1\ncard = '{}'\n", card.dir().display());
    fs::write(&plant, format!("[[plc]]\nname = 'line'\n{section}")).unwrap();
    let names = vec!["line:card1.*".to_owned()];
    let mut unit = Unit::new(&Resources::of_file(&plant, names).unwrap()).unwrap();
    let at = |unit: &Unit, name: &str| unit.variables().iter().position(|it| it.name == name).unwrap() as u32;
    let (data, count) = (at(&unit, "line:card1.w_DATA"), at(&unit, "line:card1.w_COUNT"));
    unit.begin(0.0, None).unwrap();
    unit.set(data, VariableType::U16, Value::Integer(7)).unwrap();
    unit.step(0.0, 0.001).unwrap();
    assert_eq!(unit.get(count, VariableType::U16), Ok(Value::Integer(7)));
}

/// Each bit of a toggle table has its time, which begins when the firmware sees the bit.
#[test]
fn each_toggled_bit_has_its_own_time() {
    let card = Card::new("");
    card.write(
        "handshakes.toml",
        "[[toggle]]\nregister = 'card.w_DATA'\nacknowledge = 'card.w_COUNT'\nbits = 7\nafter = '5ms'\npage = '1'\nsource = 'manual'\n",
    );
    let mut bench = card.bench();
    bench.poke("card.w_DATA", 1).unwrap();
    bench.step("3ms").unwrap();
    bench.poke("card.w_DATA", 7).unwrap();
    bench.step("1ms").unwrap();
    // The program takes bit 2 back.
    bench.poke("card.w_DATA", 3).unwrap();
    let middle = bench.save().unwrap();
    for _ in 0..2 {
        let mut seen = Vec::new();
        for _ in 0..60 {
            bench.step("100us").unwrap();
            seen.push((bench.now().unwrap(), bench.peek("card.w_COUNT").unwrap()));
        }
        seen.dedup_by_key(|(_, value)| *value);
        // The first bit was seen at the poll at 0.5 ms, the second one at the poll at 3.5 ms. Each has its effect 5 ms
        // later.
        assert_eq!(seen, [(4_100, 0), (5_500, 1), (8_500, 3)]);
        bench.back_to(middle).unwrap();
    }
}

/// Scripts that do not end, and scripts that request all memory or the whole stack: each of them stops at its line.
#[test]
fn a_hostile_script_stops_and_the_emulator_continues() {
    for (script, place, what) in [
        ("fn poll() { loop {} }", ":1:", "does not end"),
        ("fn poll() {\n poll(); }", ":", "nested too deep"),
        ("fn power_on() { after(0, \"again\"); }\nfn again() { after(0, \"again\"); }", ":", "does not end"),
        (
            "fn poll() { let s = \"x\"; loop { s += s; } }",
            ":1:",
            "a value has at most 4096 bytes in all its texts",
        ),
        (
            "fn poll() { let s = []; s.pad(4000, 0); }",
            ":1:",
            "a value has at most 2048 elements in all its arrays",
        ),
        ("fn poll() { let s = [0]; loop { s += s; } }", ":1:", "2048 elements in all its arrays"),
        ("fn poll() { let s = [0]; loop { s.push(s); } }", ":1:", "2048 elements in all its arrays"),
        // The copies of values that are nested deep take many steps.
        ("fn poll() { let s = [0]; loop { s = [s]; } }", ":1:", "does not end"),
        ("fn poll() { let s = #{ a: 0 }; loop { s = #{ a: s }; } }", ":1:", "does not end"),
        (
            "fn poll() { let s = #{ }; let n = 0; loop { n += 1; s[`${n}`] = s; } }",
            ":1:",
            "512 entries in all its maps",
        ),
        ("fn power_on() { this.s = []; }\nfn poll() { this.s = [this.s]; }", ":", "16 deep"),
        ("fn poll() { let s = []; for n in 0..64 { s = [s]; } this.s = s; }", ":", "16 deep"),
        ("fn poll() { this.s = helper; }\nfn helper() {}", ":", "cannot keep"),
        ("fn poll() { for n in 0..100 { after(\"1s\", \"poll\"); } }", ":1:", "at most 64"),
        (
            "fn poll() { let name = \"w_DATA\"; write(\"card.\" + name, 1); }",
            ":1:",
            "only the program writes card.w_DATA",
        ),
        ("fn poll() { write(\"card.i_VALUE\", 40000000); }", ":1:", "does not fit"),
        ("fn poll() { let name = \"w_DATUM\"; read(\"card.\" + name); }", ":1:", "w_DATUM"),
        ("fn poll() { output_all(\"card.a_OUT\", [1]); }", ":1:", "is 4 registers, the array has 1 value"),
        ("fn poll() { copy(\"card.a_IN\", \"card.a_OUT\"); }", ":1:", "has 16 bytes, `card.a_OUT` has 8"),
        (
            "fn poll() { copy(\"card.a_OUT\", \"card.a_IN[0..3]\"); }",
            ":1:",
            "only the program writes card.a_IN[0]",
        ),
        ("fn poll() { copy(\"card.w_*\", \"card.a_OUT\"); }", ":1:", "`card.w_*` has a gap"),
        ("fn poll() { loop { copy(\"card.a_IN[0..3]\", \"card.a_OUT\"); } }", ":1:", "does not end"),
        ("fn poll() { loop { reset(\"card\"); } }", ":1:", "does not end"),
        ("fn poll() { let name = \"w_DATUM\"; reset(\"card.\" + name); }", ":1:", "w_DATUM"),
        (
            "fn power_on() { this.m = #{}; for n in 0..600 { this.m[`${n}`] = n; } }",
            ":1:",
            "after power_on: a value has at most 512 entries in all its maps",
        ),
        (
            "fn power_on() { this.x = []; for k in 0..3 { this.x.push([]); for n in 0..683 { this.x[k].push(n); } } }",
            ":1:",
            "a value has at most 2048 elements in all its arrays",
        ),
        (
            "fn power_on() { let a = []; a.pad(17, 1); after(1, \"many\", a); }
fn many(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q) {}",
            ":1:",
            "17 arguments for `many`; a call has at most 16",
        ),
        ("fn poll() { this = 5; }", ":1:", "this` after poll: it is a value of type i64; it must stay a map"),
        (
            "fn poll() { let name = \"script\"; write(\"front.\" + name, 1); }",
            ":1:",
            "only the emulator writes `front.script`",
        ),
        ("fn poll() { event(16); }", ":1:", "the events 0 to 15"),
        ("fn poll() { raed(\"card.w_DATA\"); }", ":1:", "did you mean read?"),
        ("fn poll() { let n = 5 / 0; }", ":1:", "zero"),
        ("fn poll() { this.missing += 1; }", ":1:", "`+` does not go with ()"),
    ] {
        let stop = stop_of(script);
        assert!(stop.contains(&format!("firmware.rhai{place}")) && stop.contains(what), "{script}: {stop}");
    }
}

/// Each file alone takes less than the permitted time.
#[test]
fn the_hook_for_writes_has_a_limited_number_of_registers() {
    let size = |script: &str| {
        let card = Card::new(script);
        let structure = STRUCTURE.replace("size = 32", "size = 160024");
        let structure = structure.replace("array = [8], owner = 'plc'", "array = [2, 40000], owner = 'plc'");
        card.write(
            "CARD.toml",
            &structure.replace("offset = 24", "offset = 160008").replace("array = [4]", "array = [8]"),
        );
        card
    };
    let refused = size("fn written(register, old, value) {}").refused();
    assert!(refused.contains("firmware.rhai:1: the hook written has more than 65536 registers"), "{refused}");
    let card =
        size("const WRITTEN = [\"card.w_DATA\"];\nfn written(register, old, value) { journal(register); }");
    let mut bench = card.bench();
    // Large areas are copied and recorded in parts.
    let before = bench.snapshot("card").unwrap();
    bench.poke("card.a_IN[1][39999]", 7).unwrap();
    let changes = bench.changes(&before).unwrap();
    assert_eq!(changes.iter().map(|it| it.register.as_str()).collect::<Vec<_>>(), ["card.a_IN[1][39999]"]);
    // The journal records the changes of at most 65,536 registers.
    let error = bench.record("card").unwrap_err().to_string();
    assert!(!error.contains("`len`"), "{error}");
}

/// Each file keeps its limit, but all files together take too long to compile.
#[test]
fn the_files_of_a_script_share_the_number_of_blocks() {
    let card = Card::new("fn poll() {}");
    let blocks = |count| format!("fn f() {{ {} }}", "{}".repeat(count));
    card.write("one.rhai", &blocks(2900));
    card.write("two.rhai", &blocks(2900));
    card.bench();
    card.write("two.rhai", &blocks(3100));
    let refused = card.refused();
    assert!(refused.contains("6003 blocks; a device in a folder has at most 6000"), "{refused}");
    card.write("one.rhai", &blocks(6000));
    assert!(card.refused().contains("one.rhai:1: Number of blocks"), "{}", card.refused());
}

#[test]
fn the_files_of_a_script_share_its_steps() {
    let card = Card::new("fn poll() {}");
    let slow = "for i in 0..20000 { let a = i; }\n";
    for number in 0..15 {
        card.write(&format!("slow{number}.rhai"), slow);
    }
    assert!(card.refused().contains("it takes more than 200000 steps"), "{}", card.refused());
}

#[test]
fn a_wrong_script_is_refused_with_its_line() {
    for (script, message) in [
        ("fn power_on( {", "firmware.rhai:1: "),
        ("\nfn poll() { eval(\"1\"); }", "firmware.rhai:2: "),
        ("fn poll() { let f = |x| x; }", "firmware.rhai:1: "),
        ("fn poll() { sleep(1); }", "firmware.rhai:1: "),
        ("fn poll() { let f = Fn(\"poll\"); f.curry(f); }", "firmware.rhai:1: "),
        ("fn written(register) { }", "the hook written is a function written(register, old, value)"),
        // The first one of several mistakes.
        (
            "fn poll() { a(); b(); c(); }\nfn c() { read(\"card.w_DATUM\"); }\nfn b() { read(\"y\"); }\nfn a() { read(\"z\"); }",
            "firmware.rhai:2: ",
        ),
        ("fn poll() {\n  output(\"front.script\", 1); }", "only the emulator writes `front.script`"),
        ("fn poll() { after(\"1ms\", \"nothing\"); }", "there is no function `nothing` to call later"),
        ("const WRITTEN = [\"card.w_DATUM\"];\nfn written(register, old, value) {}", "WRITTEN: "),
        (
            "const WRITTEN = [\"card.a_OUT\"];\nfn written(register, old, value) {}",
            "does not write `card.a_OUT`",
        ),
        ("const WRITTEN = \"card.w_DATA\";\nfn written(register, old, value) {}", "write an array of names"),
        ("const WRITTEN = [\"card.w_DATA\"];", "there is no hook written(register, old, value)"),
        ("write(\"card.w_COUNT\", 1);", "a verb works in a function only"),
        ("import \"other\" as other;", "the folder has no script `other` to import"),
        ("import \"/etc/passwd\" as other;", "the folder has no script `/etc/passwd` to import"),
        ("loop {}", "firmware.rhai:1: the script does not end"),
        (
            "\nfn writes(register, old, value) { }",
            "firmware.rhai:2: nothing calls the function `writes`; did you mean written?",
        ),
        ("fn poll() { output(\"card.w_DATA\", 1); }", "firmware.rhai:1: only the program writes card.w_DATA"),
        (
            "fn poll() {\n output_all(\"card.a_IN\", []); }",
            "firmware.rhai:2: only the program writes card.a_IN",
        ),
        ("fn poll() {\n  write(\"card.w_COUNT\", 16#0001); }", "firmware.rhai:2: `16#0001`: write 0x0001"),
        ("fn poll() {\n  IF now() > 5 { }\n}", "firmware.rhai:2: `IF`: write"),
        (
            "fn poll() {\n  let x = 1;\n  x := 2;\n}",
            "firmware.rhai:3: `:=`: write `=` for a variable, and write(",
        ),
        ("fn poll() {\n  if now() <> 5 { }\n}", "firmware.rhai:2: `<>`: write `!=`"),
        ("fn poll() {\n  let x = TRUE;\n}", "firmware.rhai:2: `TRUE`: write `true`"),
        (
            "fn poll() {\n  write(card.w_COUNT, 1);\n  let y = 5ms;\n}",
            "firmware.rhai:3: `5ms`: write a time as a text",
        ),
    ] {
        let refused = Card::new(script).refused();
        assert!(refused.contains(message), "{script}: {refused}");
    }
    // A function that the script itself calls may have any name.
    let used = Card::new("fn power_on() { after(1, \"pol\"); }\nfn pol() { powr_on(); }\nfn powr_on() {}");
    assert!(folder::load(used.dir()).is_ok());
    let deep = format!("fn poll() {{ let x = {}1{}; }}", "(".repeat(200), ")".repeat(200));
    assert!(
        Card::new(&deep).refused().contains(
            "firmware.rhai:1: expressions and blocks are nested too deep here: more than 64 levels"
        )
    );
    // Each of these has the largest depth.
    let card = Card::new("");
    for (begin, end, depth) in [("(", ")", 29), ("[", "]", 19), ("if true {", "}", 19)] {
        let nest = |depth| {
            let text = format!("fn poll() {{ let x = {}1{}; }}", begin.repeat(depth), end.repeat(depth));
            card.write("firmware.rhai", &text);
        };
        nest(depth);
        assert!(folder::load(card.dir()).is_ok(), "{begin}");
        nest(depth + 1);
        assert!(card.refused().contains("more than 64 levels"), "{begin}");
    }
    let many = format!("fn poll() {{ read({}); }}", vec!["1"; 17].join(", "));
    assert!(Card::new(&many).refused().contains("a call with 17 arguments; it has at most 16"));
}

/// The messages about calls have the numbers of parameters and arguments. The cards share their registers, because a
/// process reads a limited number of folders.
#[test]
fn a_wrong_number_of_arguments_is_named() {
    let card = Card::new("");
    for (script, what) in [
        (
            "fn poll() { let name = \"t\";\n after(\"1ms\", name, [1, 2]); }\nfn t() {}",
            "`t` has 0 parameters, and is called with 2 arguments",
        ),
        ("fn poll() { let name = \"u\";\n at(5, name); }\nfn t() {}", "no function `u` to call later"),
        ("fn poll() {\n t(1, 2); }\nfn t() {}", "`t` has 0 parameters, and is called with 2 arguments"),
        ("fn poll() {\n this.t(); }\nfn t(a) {}", "`t` has 1 parameter, and is called with 0 arguments"),
        ("fn poll() {\n after(1); }", "`after` has 2 or 3 parameters, and is called with 1 argument"),
        ("fn poll() {\n tt(1); }\nfn ttt(a) {}", "did you mean at or ttt?"),
    ] {
        let stop = stop_of_card(&card, script);
        assert!(stop.contains("firmware.rhai:2: ") && stop.contains(what), "{script}: {stop}");
    }
    for (script, message) in [
        (
            "fn poll() {\n after(\"1ms\", \"t\", [1, 2]); }\nfn t() {}",
            "firmware.rhai:2: `t` has 0 parameters, and is called with 2 arguments",
        ),
        (
            "fn poll() {\n at(5, \"t\"); }\nfn t(a) {}",
            "firmware.rhai:2: `t` has 1 parameter, and is called with 0 arguments",
        ),
    ] {
        card.write("firmware.rhai", script);
        assert!(card.refused().contains(message), "{script}: {}", card.refused());
    }
}

/// The limits for values do not depend on the way in which a script assigns to `this`.
#[test]
fn a_value_has_the_same_limits_in_each_assignment() {
    let card = Card::new(
        r#"
        const LARGEST = [2048, 1024, 255];
        fn written(register, old, value) {
            let value = value - 16;
            let kind = value % 4;
            let size = global::LARGEST[kind] + value / 4 % 2;
            let s = [];
            if kind == 0 { s = ""; s.pad(size, "x"); }
            if kind == 1 { s.pad(size, 1); }
            if kind == 2 { s = #{}; for n in 0..size { s[`${n}`] = n; } }
            if value < 8 { this.s = s; this.t = s; } else { this["s"] = s; this["t"] = s; }
        }
        "#,
    );
    let mut bench = card.bench();
    for (kind, limit) in [
        (0, "a value has at most 4096 bytes in all its texts"),
        (1, "a value has at most 2048 elements in all its arrays"),
        (2, "a value has at most 512 entries in all its maps"),
    ] {
        for by_index in [0, 8] {
            for is_larger in [0, 1] {
                bench.power_cycle("card").unwrap();
                bench.poke("card.w_DATA", 16 + kind + 4 * is_larger + by_index).unwrap();
                bench.step("2ms").unwrap();
                assert_eq!(bench.peek("front.script").unwrap(), is_larger, "{limit}: {by_index}");
                let last = journal(&mut bench).into_iter().rfind(|line| line.contains(" stopped: "));
                assert!(
                    is_larger == 0 || last.is_some_and(|last| last.ends_with(limit)),
                    "{limit}: {by_index}"
                );
            }
        }
    }
}

/// Functions that are called later are those of the main file, also if another file names them.
#[test]
fn a_module_calls_functions_of_the_main_file_later() {
    let card = Card::new(
        "import \"help\" as help;\nfn power_on() { help::begin(); }\nfn tick() { output(\"card.w_COUNT\", 7); }",
    );
    card.write("help.rhai", "fn begin() { after(\"1ms\", \"tick\"); }");
    let mut bench = card.bench();
    bench.step("2ms").unwrap();
    assert_eq!(bench.peek("card.w_COUNT").unwrap(), 7);
    card.write("help.rhai", "fn begin() {\n after(\"1ms\", \"own\"); }\nfn own() {}");
    assert!(
        card.refused().contains("help.rhai:2: there is no function `own` to call later"),
        "{}",
        card.refused()
    );
    card.write("help.rhai", "fn begin(a) {}");
    let mut bench = card.bench();
    bench.step("2ms").unwrap();
    let lines = journal(&mut bench).join("\n");
    assert!(lines.contains("firmware.rhai:2: `begin` has 1 parameter, and is called with 0"), "{lines}");
}

#[test]
fn the_files_of_a_script_lie_in_its_folder() {
    let card = Card::new("import \"one\" as one;");
    card.write("one.rhai", "import \"two\" as two;");
    card.write("two.rhai", "import \"one\" as one;");
    assert!(card.refused().contains("is circular"), "{}", card.refused());
    card.write("two.rhai", "fn wrong( {}");
    assert!(card.refused().contains("two.rhai:1: "), "{}", card.refused());
    fs::remove_file(card.dir().join("two.rhai")).unwrap();
    std::os::unix::fs::symlink("/etc/passwd", card.dir().join("two.rhai")).unwrap();
    assert!(card.refused().contains("is a link"), "{}", card.refused());
    fs::remove_file(card.dir().join("two.rhai")).unwrap();
    card.write("two.rhai", &"// much text\n".repeat(30_000));
    assert!(card.refused().contains("bytes of its script; a device in a folder has at most 262144"));
    for n in 0..17 {
        card.write(&format!("more{n}.rhai"), "");
    }
    assert!(card.refused().contains("files of its script; a device in a folder has at most 16"));
}

/// The word of the front panel is added to those of the device.
#[test]
fn a_front_may_have_words_of_its_own() {
    let card =
        Card::new("fn poll() { write(\"front.led\", 1); output(\"card.w_COUNT\", read(\"front.s1\")); }");
    let device = fs::read_to_string(card.dir().join("device.toml")).unwrap();
    let word = |name: &str, offset, owner: &str| {
        format!(
            "[[front]]\nname = '{name}'\ntype = 'DWORD'\noffset = {offset}\nowner = '{owner}'\nsource = 'manual'\npage = '1'\ndoc = 'x'\n"
        )
    };
    card.write("device.toml", &(device.clone() + &word("led", 0, "firmware") + &word("s1", 4, "plc")));
    let mut bench = card.bench();
    bench.step("1ms").unwrap();
    assert_eq!((bench.peek("front.led").unwrap(), bench.peek("front.script").unwrap()), (1, 0));
    card.write("device.toml", &(device + &word("script", 0, "firmware")));
    assert!(card.refused().contains("the front has a word `script`"), "{}", card.refused());
}

/// A PLC with this card in slot 2, with trigger 2. The SYNC signal of the card is the source of trigger 2 and of the
/// trigger controller.
fn with_option_card(card: &Card) -> Bench {
    let plant = format!(
        "[[plc]]\nname = 'line'\n[[plc.option]]\nname = 'card'\ncard = '{}'\nslot = 2\ntrigger = 2\n",
        card.dir().display()
    );
    let mut bench = Bench::plant(&plant).unwrap();
    let ram = bench.ram("line").unwrap();
    let header = ram.header();
    header.opt_init.triggers.iter().zip([0, 2, 0]).for_each(|(cell, mode)| cell.store(mode));
    header.opt_init.ask();
    header.interrupts[11].ask(0, true);
    header.submit_request();
    bench.step("1ms").unwrap();
    bench
}

/// Number of events 11, of pulses of trigger 2, and of pulses of the trigger controller.
fn pulses(bench: &mut Bench) -> [u32; 3] {
    let triggers = [2, 3].map(|trigger| bench.trigger_count("line", trigger).unwrap());
    [bench.event_count("line", 11).unwrap(), triggers[0], triggers[1]]
}

#[test]
fn an_option_card_exchanges_pulses_with_its_plc() {
    let card = Card::new(
        "fn power_on() { this.count = 0; sync_pulse(); }
fn written(register, old, value) { if register == \"card.w_DATA\" { sync_pulse(); sync_pulse(); } }
fn trigger() { this.count += 1; output(\"card.w_COUNT\", this.count); }
",
    );
    let mut bench = with_option_card(&card);
    assert_eq!((pulses(&mut bench), bench.peek("line:card2.w_COUNT").unwrap()), ([0; 3], 0));
    bench.poke("line:card2.w_DATA", 1).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!((pulses(&mut bench), bench.peek("line:card2.w_COUNT").unwrap()), ([1; 3], 1));
    // The pulse of a power-on comes at once, so a snapshot after it needs no pulse.
    bench.power_cycle("card").unwrap();
    assert_eq!((pulses(&mut bench), bench.peek("line:card2.w_COUNT").unwrap()), ([2; 3], 1));
    // A PLC without supply gets no pulses. After its next power-on its triggers have no sources.
    bench.set_board("line:power=off").unwrap();
    bench.poke("line:card2.w_DATA", 2).unwrap();
    bench.step("1ms").unwrap();
    bench.set_board("line:power=on").unwrap();
    bench.poke("line:card2.w_DATA", 3).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!((pulses(&mut bench), bench.peek("line:card2.w_COUNT").unwrap()), ([2; 3], 1));
    assert_eq!(bench.peek("card:front.script").unwrap(), 0);
}

/// A card whose script answers each trigger with a pulse that causes this trigger again is stopped. The emulator
/// continues.
#[test]
fn an_option_card_that_triggers_itself_stops() {
    let card = Card::new(
        "fn written(register, old, value) { sync_pulse(); }
fn trigger() { sync_pulse(); }
",
    );
    let mut bench = with_option_card(&card);
    bench.poke("line:card2.w_DATA", 1).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(bench.peek("card:front.script").unwrap(), 1);
    let now = bench.now().unwrap();
    bench.step("1s").unwrap();
    assert_eq!(bench.now().unwrap(), now + 1_000_000);
    let lines = journal(&mut bench);
    assert!(lines.iter().any(|line| line.contains(" stopped: ") && line.contains("steps")), "{lines:#?}");
}

/// Two equal cards: in slot 1, and at option interface 3 of slot 2.
fn with_two_cards(card: &Card) -> Bench {
    let section = |name: &str, place: &str| {
        let dir = card.dir().display();
        format!("[[plc.option]]\nname = '{name}'\ncard = '{dir}'\n{place}\n")
    };
    let cards = section("one", "slot = 1") + &section("two", "slot = 2\ninterface = 3");
    Bench::plant(&format!("[[plc]]\nname = 'line'\n{cards}")).unwrap()
}

#[test]
fn the_registers_of_an_option_card_are_in_the_memory_of_its_plc() {
    let card = Card::new(
        "fn power_on() { write(\"card.w_COUNT\", 1); }
fn written(register, old, value) {
    if register == \"card.w_COMMAND\" { exchange(register, 5, 4); write(\"card.i_VALUE\", read(\"card.w_DATA\")); }
    if value == 7 { violation(register, \"seven\"); }
}
",
    );
    let mut bench = with_two_cards(&card);
    bench.poke("line:card1.w_DATA", 11).unwrap();
    bench.poke("line:%MW3.3000002", 33).unwrap();
    bench.poke("line:card1.w_COMMAND", 5).unwrap();
    bench.poke("line:card3.w_COMMAND", 5).unwrap();
    let past = bench.save().unwrap();
    bench.step("1ms").unwrap();
    let all = |bench: &mut Bench| {
        let names = ["card1.w_COMMAND", "card3.w_COMMAND", "%MW3.1000004", "%MW3.3000004", "card1.w_COUNT"];
        names.map(|name| bench.peek(&format!("line:{name}")).unwrap())
    };
    assert_eq!(all(&mut bench), [4, 4, 11, 33, 1]);
    let lines = journal(&mut bench);
    for (source, register) in [("option1", "w_COMMAND"), ("option3", "w_COMMAND"), ("option3", "i_VALUE")] {
        let is_it = |line: &&String| line.contains(&format!("line:{source}")) && line.contains(register);
        assert!(lines.iter().any(|line| is_it(&line)), "{source} {register}: {lines:#?}");
    }
    // A snapshot of the plant has these registers.
    bench.back_to(past).unwrap();
    assert_eq!(all(&mut bench), [5, 5, 0, 0, 1]);
    bench.step("1ms").unwrap();
    assert_eq!(all(&mut bench), [4, 4, 11, 33, 1]);
    // The checker knows the owners and the rules of the card; the rest of an interface is plain RAM.
    bench.poke("line:card1.w_COUNT", 2).unwrap();
    bench.poke("line:card3.w_DATA", 7).unwrap();
    bench.poke("line:%MW3.1000100", 9).unwrap();
    bench.poke("line:%MW3.2000000", 9).unwrap();
    bench.step("1ms").unwrap();
    let findings = bench.findings().unwrap();
    let found: Vec<_> =
        findings.iter().map(|it| format!("{} {}", it.last.rule.id(), bench.finding_place(it))).collect();
    assert_eq!(found, ["owner line:card1.w_COUNT", "own-rule line:card3.w_DATA"]);
    // The registers belong to the supply of the card, and not to that of the PLC.
    bench.power_cycle("line").unwrap();
    assert_eq!(all(&mut bench), [4, 4, 11, 33, 2]);
    bench.power_cycle("one").unwrap();
    assert_eq!(all(&mut bench), [0, 4, 0, 33, 1]);
    assert_eq!(bench.peek("one:front.script").unwrap(), 0);
    assert!(bench.peek("one:card.w_DATA").is_err());
}

#[test]
fn a_program_for_the_plc_alone_finds_its_map_beside_that_of_the_cards() {
    let card = Card::new("fn trigger() { }");
    let mut bench = with_two_cards(&card);
    let alone = commram::devices::default().layout;
    let ram = bench.ram("line").unwrap();
    let header = ram.header();
    assert_eq!(header.base_layout_hash.load(), alone.layout_hash);
    assert_ne!(header.layout_hash.load(), alone.layout_hash);
    let composed = commram::devices::of_hash(header.layout_hash.load()).unwrap().layout;
    assert_eq!(composed.segment_size(), alone.segment_size());
    for area in alone.areas.iter().filter(|area| !area.structures.is_empty()) {
        assert_eq!(composed.area(area.name).unwrap().first, area.first);
    }
    // The same cards in the same slots give the same map.
    let mut again = with_two_cards(&card);
    assert_eq!(again.ram("line").unwrap().header().layout_hash.load(), header.layout_hash.load());
}

#[test]
fn a_card_that_does_not_fit_into_its_interface_is_refused() {
    let refused = |from: &str, to: &str, option: &str| {
        let card = Card::new("fn trigger() { }");
        let device = fs::read_to_string(card.dir().join("device.toml")).unwrap();
        assert!(device.contains(from), "{from}");
        card.write("device.toml", &device.replace(from, to));
        let plant = format!(
            "[[plc]]\nname = 'line'\n[[plc.option]]\nname = 'card'\n{option}\ncard = '{}'\n",
            card.dir().display()
        );
        PlantConfig::parse("p.toml", &plant).unwrap_err().to_string()
    };
    let contains = |message: String, part: &str| {
        assert!(message.starts_with("p.toml: line 6: 'card': ") && message.contains(part), "{message}");
    };
    let name = |name: &str| format!("area = [{{ name = '{name}'");
    let long = refused("area = [{ name = 'card'", &name("a_long_area_150"), "slot = 1");
    contains(long, "is called `a_long_area_1501`");
    let taken = refused("area = [{ name = 'card'", &name("node"), "slot = 1");
    contains(taken, "is called `node1` at option interface 1");
    let words = refused("unit = 'byte', first = 0", "unit = 'word', first = 0", "slot = 1");
    contains(words, "unit = \"byte\"");
    let far = refused("name = 'card', first = 0, page", "name = 'card', first = 262144, page", "slot = 2");
    contains(far, "has 262176 bytes, and option interface 2 has 262144");
    let interface = refused("title", "title", "slot = 1\ninterface = 3");
    contains(interface, "slot 1 of 'line' has no option interface 3; use 1");
}

#[test]
fn a_place_of_an_option_card_that_does_not_exist_is_refused() {
    let card = Card::new("fn trigger() { }");
    let dir = card.dir().display().to_string();
    let parse = |sections: &str| {
        let plant = format!("[[plc]]\nname = 'line'\n{sections}");
        PlantConfig::parse("p.toml", &plant).map_err(|error| error.to_string())
    };
    let card = |keys: &str| format!("[[plc.option]]\ncard = '{dir}'\n{keys}\n");
    let refused = |sections: &str| parse(sections).unwrap_err();
    let line = |line: usize, what: &str| format!("p.toml: line {line}: {what}");
    let slot = "'line-option3': 'line' has no slot 3 for option cards; number of its slots: 2";
    assert_eq!(refused(&card("slot = 3")), line(5, slot));
    let taken = |name| {
        format!("'{name}': slot 1 of 'line' already has the option card 'line-option1'; use another slot")
    };
    let two = card("slot = 1");
    assert_eq!(refused(&(two.clone() + &card("name = 'other'\nslot = 1"))), line(9, &taken("other")));
    assert_eq!(refused(&(two.clone() + &two)), line(8, &taken("line-option1")));
    let trigger = "trigger of 'line-option1' is 3; it must be 1 or 2";
    assert_eq!(refused(&card("slot = 1\ntrigger = 3")), line(6, trigger));
    let twice = "there are two PLCs named 'line'; names must be unique";
    assert_eq!(refused(&card("slot = 1\nname = 'line'")), line(3, twice));
    let keys = "unknown field `slots`; did you mean slot?; the keys of [[plc.option]] are: \
                slot, card, name, interface, trigger, bus";
    assert_eq!(refused(&card("slots = 1")), line(5, keys));
    assert_eq!(refused("[[plc.option]]\nslot = 1\n"), line(3, "missing field `card`"));
    assert_eq!(
        refused("[plc.option]\nslot = 1\n"),
        line(3, "[[plc.option]] begins a section; there can be several")
    );
    let unknown = refused("[[plc.option]]\nslot = 1\ncard = 'no-such-card'\n");
    let kind = "there is no option card of kind 'no-such-card'; kinds are: ";
    assert!(unknown.starts_with(&line(5, kind)) && unknown.ends_with("a path with a '/'"), "{unknown}");
    // A device without slots has no such key, and names the others.
    let other =
        format!("[[device]]\nkind = 'cs0015'\nname = 'a'\n[[device.option]]\nslot = 1\ncard = '{dir}'\n");
    assert!(
        refused(&other).contains("unknown field `option`; the keys of [[device]] are: kind, "),
        "{}",
        refused(&other)
    );
    // The old form of the section.
    let old = format!("[[device]]\nkind = '{dir}'\nname = 'a'\noption = {{ plc = 'line', slot = 1 }}\n");
    let right = format!(
        "an option card is a section of its PLC: write [[plc.option]] with slot = 1 and card = \"{dir}\" instead of this \
         [[device]]"
    );
    assert_eq!(refused(&old), line(6, &right));
    // A PLC as a [[device]] has cards, too.
    let controller = "[[device]]\nkind = 'omega-drive-line-2'\nname = 'second'\n";
    let plant = parse(&(controller.to_owned() + &card("slot = 2").replace("plc", "device"))).unwrap();
    assert_eq!(
        plant.devices.iter().map(|device| device.name()).collect::<Vec<_>>(),
        ["line", "second", "second-option2"]
    );
}
