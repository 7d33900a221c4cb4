//! Runs every command that a page shows, at the built-in plant or at a plant with the names that the command uses.

use crate::shell::Shell;
use std::collections::BTreeMap;
use std::path::Path;

/// The plant for commands that name devices which the built-in plant does not have.
const OTHERS: &str = "\
[[plc]]
name = 'line'
serial = 'rs485'
[[plc]]
name = 'line2'
node2 = 'upper'
[[device]]
kind = 'bm4-plc'
name = 'maxx'
[[device.module]]
slot = 'G'
kind = 'can-06'
bus = 'fast'
[[device.module]]
slot = 'H'
kind = 'can-05'
bus = 'upper'
[[device]]
kind = 'cs0015'
name = 'panel'
bus = 'open'
node_id = 32
kbit_s = 125
[[device]]
kind = 'can-dp2'
name = 'gw'
profibus = 'dp'
[[bus]]
name = 'dp'
kind = 'profibus'
[[bus]]
name = 'rs485'
kind = 'serial'
wires = 4
[[bus]]
name = 'fast'
kbit_s = 1000
[[bus]]
name = 'upper'
[[bus]]
name = 'open'
kind = 'can'
kbit_s = 125
";

/// A command that contains one of these texts runs at that plant.
const OF_OTHERS: &[&str] = &["line:", "line2", "maxx", "panel", "open", "bus=dp", "rs485"];

/// Commands that contain one of these texts are not run here, with the reason.
const ELSEWHERE: &[(&str, &str)] = &[
    ("--follow", "it ends with the emulator; tests/cli/trace.rs follows"),
    (" | ", "other programs read along; .ci/tools says which of them CI has"),
    ("commram layout import", "it needs the user's declarations; tests/cli/layout.rs imports"),
    (
        "commram export fmu",
        "it wants the shared object beside the program; tools/fmi/tests packs and runs units",
    ),
    ("commram test ", "it needs the user's scenarios; tests/cli/scenarios.rs runs those of the project"),
    (" ./cards/", "it needs the user's folder; tests/cli/folders.rs reads folders"),
    (" line:encoder1", "it needs a PLC with an option card; tests/cli/option_cards.rs has one"),
    (" plant.toml:line", "it needs the user's plant; tests/cli/folders.rs exports a PLC with its cards"),
    ("matiec/iec2c", "tests/export/matiec.rs compiles"),
    ("cc ", "tests/export/c.rs compiles"),
    ("commram bus play", "it needs the user's log; tests/cli/doors.rs plays logs"),
    ("commram bus compare", "it needs the user's log; tests/cli/doors.rs compares logs"),
    ("commram view", "it needs a terminal; src/cli/view/tests makes one"),
    ("commram web", "it ends with the emulator; tests/web serves"),
    ("commram run", "an emulator runs already; tests/cli/instances.rs starts them"),
];

/// Pages with sessions that a separate test runs as a whole, and that test.
const SESSIONS: &[(&str, &str)] = &[
    ("README.md", "pages.rs"),
    ("reference/command-line.md", "pages.rs"),
    ("guide/getting-started.md", "pages.rs"),
    ("guide/snapshots.md", "pages.rs"),
    ("guide/journals.md", "journals.rs"),
    (
        "devices/can-dp2/overview.md",
        "tests/cli/can_dp2.rs and tests/cli/profibus_door.rs: each line needs those before it",
    ),
    ("guide/helics.md", "tests/cli/federates.rs and simulators.rs: it needs a broker and other federates"),
    ("guide/plc-programs.md", "tests/export/openplc.rs: it needs the sources of OpenPLC and Beremiz"),
    ("guide/openplc-4.md", "tests/export/strucpp.rs: it needs STruC++"),
    ("guide/own-device.md", "pages.rs"),
    ("reference/can.md", "pages.rs"),
    ("internals/architecture.md", "it shows no commands, but how one goes its way"),
];

/// Returns the commands of the shell blocks. In console blocks they follow a `$`.
fn commands(page: &str) -> Vec<String> {
    let mut commands = Vec::new();
    for (language, is_console) in [("```console\n", true), ("```sh\n", false)] {
        let blocks = page.split(language).skip(1).filter_map(|rest| rest.split("```").next());
        let text: String = blocks.collect::<String>().replace("\\\n", " ");
        let lines =
            text.lines().filter_map(|line| if is_console { line.strip_prefix("$ ") } else { Some(line) });
        commands.extend(lines.filter(|line| line.starts_with("commram ")).map(str::to_owned));
    }
    commands
}

#[test]
fn every_command_of_the_pages_works() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let name = |path: &Path| path.strip_prefix(&docs).unwrap().to_str().unwrap().to_owned();
    let mut pages: BTreeMap<_, _> = crate::pages()
        .iter()
        .map(|path| (name(path), commands(&std::fs::read_to_string(path).unwrap())))
        .collect();
    pages.retain(|name, commands| {
        !commands.is_empty() && !SESSIONS.iter().any(|(session, _)| session == name)
    });
    let (built_in, others) = (Shell::new(&[]), Shell::new(&[]));
    built_in.run("commram run --clock stepped --detach").ok();
    // debugging.md draws a plot that begins at 100 ms.
    built_in.run("commram step 200ms").ok();
    others
        .run(&format!(
            "cat > plant.toml <<'END'\n{OTHERS}END\ncommram run plant.toml --clock stepped --detach"
        ))
        .ok();
    // A CS0015 accepts commands of the programming system after its reset.
    others.run("commram step 300ms").ok();
    let (mut run, mut failed) = (0, Vec::new());
    for (page, commands) in &pages {
        for command in commands {
            if ELSEWHERE.iter().any(|(part, _)| {
                command.starts_with(part) || part.starts_with([' ', '-']) && command.contains(part)
            }) {
                continue;
            }
            let is_of_others = OF_OTHERS.iter().any(|name| command.contains(name));
            let outcome = if is_of_others { &others } else { &built_in }.run(command);
            if outcome.code != Some(0) {
                failed.push(format!("{page}: {command}\n  {}", outcome.err));
            }
            run += 1;
        }
    }
    for shell in [&built_in, &others] {
        shell.run("commram stop").ok();
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    assert!(run > 60, "only {run} commands of {:?}", pages.keys());
}
