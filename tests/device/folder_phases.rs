//! Devices in folders whose structures overlay each other.

use super::folders::{Card, journal};
use std::fs;

const HEAD: &str = "\
name_from = 'manual'
size = 8
page = '1'
doc = 'Registers'
offsets = 'manual'
names = 'manual'
types = 'manual'
owners = 'manual'
resets = 'manual'
";

/// Structure INI is valid while `w_PH` is below 10, structure RUN from 10 on.
fn card(script: &str) -> Card {
    let card = Card::new(script);
    let structure = |name: &str, registers: &str| {
        let first = "{ offset = 0, name = 'w_PH', type = 'WORD', owner = 'both', doc = 'Phase' }";
        let text = format!(
            "name = '{name}'\n{HEAD}register = [{first}, {registers}, {{ offset = 6, padding = 2 }}]\n"
        );
        fs::write(card.dir().join(format!("{name}.toml")), text).unwrap();
    };
    structure(
        "INI",
        "{ offset = 2, name = 'w_INI', type = 'WORD', owner = 'both', reset = 29, reset_from = 'manual', doc = 'I' },
         { offset = 4, name = 'u_INI', type = 'UINT', owner = 'plc', doc = 'U' }",
    );
    structure(
        "RUN",
        "{ offset = 2, name = 'w_RUN', type = 'WORD', owner = 'both', doc = 'R' },
         { offset = 4, name = 'u_RUN', type = 'UINT', owner = 'plc', reset = 31, reset_from = 'manual', doc = 'U' }",
    );
    change(&card, "structures = ['CARD']", "structures = ['INI', 'RUN']");
    change(
        &card,
        "{ name = 'CARD', live = 'always' }",
        "{ name = 'INI', live = 'init' }, { name = 'RUN', live = 'run' }",
    );
    let device = text(&card);
    let phase = "[phase]\nregister = 'w_PH'\nsource = 'manual'\nvalues = [{ name = 'init', from = 0, variable = '_INIT', doc = 'I' }, { name = 'run', from = 10, variable = '_RUN', doc = 'R' }]\n";
    fs::write(card.dir().join("device.toml"), device + phase).unwrap();
    card
}

fn text(card: &Card) -> String {
    fs::read_to_string(card.dir().join("device.toml")).unwrap()
}

fn change(card: &Card, from: &str, to: &str) {
    let device = text(card);
    assert!(device.contains(from), "{device}");
    fs::write(card.dir().join("device.toml"), device.replace(from, to)).unwrap();
}

#[test]
fn registers_of_the_first_phase_have_their_reset_values() {
    let mut bench = card("fn poll() {}").bench();
    let values = |bench: &mut commram::script::Bench| {
        ["card.w_INI", "card.u_INI"].map(|register| bench.peek(register).unwrap())
    };
    assert_eq!(values(&mut bench), [29, 0]);
    bench.poke("card.w_PH", 12).unwrap();
    bench.poke("card.u_RUN", 5).unwrap();
    bench.step("1ms").unwrap();
    bench.power_cycle("").unwrap();
    assert_eq!(values(&mut bench), [29, 0]);
}

/// A client and the script change the phase; each record has the name of the register that was valid.
#[test]
fn the_journal_names_the_registers_of_the_present_phase() {
    let script = "\
const WRITTEN = [\"card.u_*\"];
fn written(register, old, value) {
    journal(register);
    write(\"card.w_INI\", 77);
    output(\"card.w_PH\", 11);
    write(\"card.w_RUN\", 78);
}
";
    let mut bench = card(script).bench();
    bench.step("1ms").unwrap();
    bench.poke("card.w_INI", 5).unwrap();
    let saved = bench.save().unwrap();
    for _ in 0..2 {
        bench.poke("card.u_INI", 6).unwrap();
        bench.step("1ms").unwrap();
        bench.poke("card.w_RUN", 7).unwrap();
        bench.poke("card.w_PH", 0).unwrap();
        bench.poke("card.w_INI", 8).unwrap();
        bench.step("1ms").unwrap();
        let names = |line: String| {
            let words = line.split([' ', '(']).filter(|word| word.contains("_I") || word.contains("_R"));
            words.map(str::to_owned).next()
        };
        let names: Vec<_> = journal(&mut bench).into_iter().filter_map(names).collect();
        assert_eq!(
            names,
            ["w_INI", "u_INI", "card.u_INI", "w_INI", "w_RUN", "w_RUN", "w_INI"],
            "{:#?}",
            journal(&mut bench)
        );
        bench.back_to(saved).unwrap();
    }
}

/// A history contains the changes of the memory in all phases. Its values are compared as bits, because the type at an
/// address may depend on the phase.
#[test]
fn a_history_at_an_address_has_the_changes_of_all_phases() {
    let card = card("fn poll() {}");
    let path = card.dir().join("RUN.toml");
    let run = fs::read_to_string(&path).unwrap();
    fs::write(&path, run.replace("name = 'u_RUN', type = 'UINT'", "name = 'i_RUN', type = 'INT'")).unwrap();
    let mut bench = card.bench();
    bench.step("1ms").unwrap();
    bench.record("card").unwrap();
    bench.poke("card.w_PH", 12).unwrap();
    bench.poke("card.i_RUN", -2).unwrap();
    bench.step("1ms").unwrap();
    bench.poke("card.w_PH", 0).unwrap();
    bench.poke("card.u_INI", 7).unwrap();
    bench.step("1ms").unwrap();
    let numbers = |bench: &mut commram::script::Bench, register: &str| {
        let past = bench.history(register).unwrap();
        past.iter().map(|change| (change.from, change.to)).collect::<Vec<_>>()
    };
    // A name has the type of its register, an address that of the valid structure.
    assert_eq!(numbers(&mut bench, "card.i_RUN"), [(0, -2), (-2, 7)]);
    assert_eq!(numbers(&mut bench, "card.u_INI"), [(0, 0xFFFE), (0xFFFE, 7)]);
    assert_eq!(numbers(&mut bench, "%MW3.4"), [(0, -2), (0xFFFE, 7)]);
    for register in ["card.i_RUN", "card.u_INI", "%MW3.4"] {
        bench.expect_history(register, [0xFFFE, 7]).unwrap();
    }
}

/// All structures have the register of the phase, so its hook must not be called for each of them. The journal shows an
/// answer only if the script writes the register after the program.
#[test]
fn a_store_in_the_register_of_the_phase_is_one_write_and_no_answer() {
    let script = "\
const WRITTEN = [\"card.w_PH\"];
fn written(register, old, value) {
    journal(`${register} ${old} ${value}`);
    if value == 20 { output(\"card.w_PH\", 3); }
}
";
    let mut bench = card(script).bench();
    for (value, notes, answers) in [(12, vec!["card.w_PH 0 12"], 0), (20, vec!["card.w_PH 12 20"], 1)] {
        let before = journal(&mut bench).len();
        bench.poke("card.w_PH", value).unwrap();
        bench.step("1ms").unwrap();
        let lines = journal(&mut bench).split_off(before);
        let hooks: Vec<_> = lines
            .iter()
            .filter_map(|line| Some(&line[line.find("card.w_PH 0 12").or(line.find("card.w_PH 12 20"))?..]))
            .collect();
        assert_eq!(hooks, notes, "{lines:#?}");
        assert_eq!(
            lines.iter().filter(|line| line.contains("answered after")).count(),
            answers,
            "{lines:#?}"
        );
    }
}

#[test]
fn overlaid_structures_that_have_no_clear_phase_are_refused() {
    let twice = card("fn poll() {}");
    change(&twice, "live = 'run' }", "live = 'run' }, { name = 'INI', live = 'run' }");
    // Returns the line and the column of a text in device.toml, from 1.
    let place = |card: &Card, part: &str| {
        let device = text(card);
        let (line, found) = device.lines().enumerate().find(|(_, line)| line.contains(part)).unwrap();
        format!("device.toml:{}:{}: ", line + 1, found.find(part).unwrap() + 1)
    };
    let refused = twice.refused();
    let second = place(&twice, "'run' }]");
    assert!(refused.contains(&second), "{refused}, not {second}");
    assert!(refused.contains("`INI` and `RUN` are valid in the phase `run`; in a device"), "{refused}");
    let wide = card("fn poll() {}");
    for structure in ["INI.toml", "RUN.toml"] {
        let path = wide.dir().join(structure);
        let text = fs::read_to_string(&path).unwrap();
        let moved = text.replace("name = 'w_PH', type = 'WORD'", "name = 'd_PH', type = 'DWORD'");
        let moved = moved.replace("offset = 4,", "offset = 6,").replace("offset = 2,", "offset = 4,");
        fs::write(&path, moved.replace(", { offset = 6, padding = 2 }", "")).unwrap();
    }
    change(&wide, "register = 'w_PH'", "register = 'd_PH'");
    let (refused, register) = (wide.refused(), place(&wide, "'d_PH'"));
    assert!(refused.contains(&format!("{register}`d_PH` shows the phase, so")), "{refused}, not {register}");
    let areas = card("fn poll() {}");
    let device = text(&areas);
    let line = device.lines().find(|line| line.starts_with("area = ")).unwrap();
    let area = line.trim_start_matches("area = [").trim_end_matches(']');
    let second = area.replace("name = 'card'", "name = 'second'").replace("first = 0", "first = 64");
    change(&areas, line, &format!("area = [{area}, {second}]"));
    let (refused, other) = (areas.refused(), place(&areas, "'second'"));
    assert!(refused.contains(&format!("{other}the areas `card` and `second` have structures")), "{refused}");
}

/// The rules are those of the valid structure, for writes through the channel and for stores in the image. Between the
/// change of the phase and the next check, the order of stores is unknown.
#[test]
fn the_checker_uses_the_rules_of_the_valid_structure() {
    let card = card("fn poll() {}");
    let meaning = "meaning = 'level', ";
    let path = card.dir().join("INI.toml");
    let ini = fs::read_to_string(&path).unwrap();
    let ini = ini.replace(
        "name = 'u_INI', type = 'UINT', owner = 'plc'",
        "name = 'u_INI', type = 'UINT', owner = 'firmware'",
    );
    fs::write(
        &path,
        ini.replace("owner = 'both', reset = 29", &format!("owner = 'both', {meaning}reset = 29")),
    )
    .unwrap();
    let level = "[[meaning]]\nname = 'level'\npage = '1'\nvalue = [{ is = 29, text = 'default' }, { from = 50, to = 100, reserved = true }]\n";
    fs::write(card.dir().join("level.toml"), level).unwrap();
    change(&card, "names = 'manual'", "names = 'manual'\nparts = ['level.toml']");
    let mut bench = card.bench();
    let segment = bench.segment("").unwrap();
    // Offsets of the registers in the image.
    let [phase, value, number] = [4096, 4098, 4100];
    let store = |offset, value| segment.store(offset, commram::memory::Width::Word, value).unwrap();
    let found = |bench: &mut commram::script::Bench| {
        let found = bench.findings().unwrap();
        let found: Vec<_> =
            found.iter().map(|it| format!("{} {}", it.last.rule.id(), bench.finding_place(it))).collect();
        bench.clear_findings().unwrap();
        found
    };
    bench.step("1ms").unwrap();
    bench.poke("card.u_INI", 5).unwrap();
    bench.poke("card.w_INI", 60).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(found(&mut bench), ["owner card.u_INI", "reserved-value card.w_INI"]);
    store(number, 6);
    store(value, 70);
    bench.step("1ms").unwrap();
    assert_eq!(found(&mut bench), ["reserved-value card.w_INI", "owner card.u_INI"]);
    // The same addresses have no rules in the other phase.
    bench.poke("card.w_PH", 12).unwrap();
    bench.poke("card.u_RUN", 7).unwrap();
    bench.step("1ms").unwrap();
    store(number, 8);
    store(value, 80);
    bench.step("1ms").unwrap();
    assert_eq!(found(&mut bench), [] as [String; 0]);
    // A program enters a phase and writes registers at once.
    store(number, 9);
    store(phase, 0);
    bench.step("1ms").unwrap();
    assert_eq!(found(&mut bench), [] as [String; 0]);
    let saved = bench.save().unwrap();
    for _ in 0..2 {
        store(number, 10);
        bench.step("1ms").unwrap();
        assert_eq!(found(&mut bench), ["owner card.u_INI"]);
        bench.back_to(saved).unwrap();
    }
}
