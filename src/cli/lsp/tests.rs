//! Tests the server with messages, in the way in which an editor uses it.

use super::server::{Next, Server, position};
use crate::devices::samples::{BLOCK, copy_folder};
use lsp_server::{Message, Notification, Request, RequestId, Response};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

/// An editor with one open document. `¦` in the text of the document marks the cursor.
struct Editor {
    server: Server,
    answers: Vec<Message>,
    uri: String,
    text: String,
    cursor: usize,
}

impl Editor {
    fn new() -> Self {
        let (uri, text) = ("untitled:none".to_owned(), String::new());
        let mut editor = Self { server: Server::new(), answers: Vec::new(), uri, text, cursor: 0 };
        let capabilities = editor.ask("initialize", json!({ "capabilities": {} }));
        assert_eq!(capabilities["capabilities"]["positionEncoding"], "utf-16");
        editor.note("initialized", json!({}));
        editor
    }

    fn with(text: &str) -> Self {
        let mut editor = Self::new();
        editor.open(Path::new("/nonexistent/one.rhai"), text);
        editor
    }

    fn open(&mut self, path: &Path, text: &str) {
        self.uri = format!("file://{}", path.display());
        self.cursor = text.find('¦').unwrap_or(text.len());
        self.text = text.replacen('¦', "", 1);
        let document = json!({ "uri": self.uri, "languageId": "rhai", "version": 1, "text": self.text });
        self.note("textDocument/didOpen", json!({ "textDocument": document }));
    }

    fn note(&mut self, method: &str, params: Value) {
        let message = Notification { method: method.to_owned(), params };
        assert_eq!(self.server.take(message.into(), &mut self.answers), Next::Continue);
    }

    fn response(&mut self, method: &str, params: Value) -> Response {
        let request = Request { id: RequestId::from(7), method: method.to_owned(), params };
        self.server.take(request.into(), &mut self.answers);
        match self.answers.pop() {
            Some(Message::Response(response)) => response,
            other => panic!("{method}: {other:?}"),
        }
    }

    fn ask(&mut self, method: &str, params: Value) -> Value {
        self.response(method, params).response_result.unwrap_or_else(|error| panic!("{method}: {error:?}"))
    }

    /// Returns the parameters of a request for the position of the cursor.
    fn place(&self) -> Value {
        json!({ "textDocument": { "uri": self.uri }, "position": position(&self.text, self.cursor) })
    }

    /// Returns the errors of the document as `LINE:COLUMN MESSAGE`.
    fn errors(&mut self) -> Vec<String> {
        self.server.settle(&mut self.answers);
        let mut found = Vec::new();
        for message in self.answers.drain(..) {
            let Message::Notification(Notification { params, .. }) = message else { panic!("{message:?}") };
            if params["uri"] == self.uri.as_str() {
                found = params["diagnostics"].as_array().unwrap().clone();
            }
        }
        let line = |it: &Value| {
            let start = &it["range"]["start"];
            format!("{}:{} {}", start["line"], start["character"], it["message"].as_str().unwrap())
        };
        found.iter().map(line).collect()
    }

    fn completions(&mut self) -> Vec<String> {
        let found = self.ask("textDocument/completion", self.place());
        let label = |item: &Value| item["label"].as_str().unwrap().to_owned();
        found["items"].as_array().map(|items| items.iter().map(label).collect()).unwrap_or_default()
    }

    fn hover(&mut self) -> String {
        self.ask("textDocument/hover", self.place())["contents"]["value"]
            .as_str()
            .unwrap_or_default()
            .to_owned()
    }
}

fn errors(text: &str) -> Vec<String> {
    Editor::with(text).errors()
}

/// Asserts that the text has exactly one error, and that its message begins with `expected`.
fn assert_error(text: &str, expected: &str) {
    let found = errors(text);
    assert!(found.len() == 1 && found[0].starts_with(expected), "{text}: {found:?}, not {expected}");
}

#[test]
fn a_right_scenario_has_no_errors() {
    let text = r#"
        section("start");
        fn start(us) { step(us); }
        let init = block("BLOCK", "node2");
        init.us_BAUDRATE = 5;
        poke("node2.w_CPU_CONTROL", "handshake");
        let us = wait("node2.w_OPTION_STATUS", "16#0002", "1ms");
        expect_that(us <= 500, `${us} us`);
        start(500); [1, 2].len(); print(type_of(us));
        fault("lose_frame slot=WRC1 count=3");
        if (us > 1) { throw "x" } else { expect_no_findings(["reserved-value"]); }
        try { expect("node2.a_RD_BMARRAY[3][0]", 0xFFFF) } catch (error) { print(error.kind) }
        wait_until(|| drive("drive1").state == "ready", "1ms");
        let data = "44 33 22 11"; let within = "4ms";
        expect_frame("drives", 0x100, 0x700, "44 33 22 11", "4ms");
        expect_frame("drives", 0x100, 0x700, "44 33 22 11", within);
        expect_frame("drives", 0x100, data, "4ms", true);
    "#;
    assert_eq!(errors(&text.replace("BLOCK", BLOCK)), [""; 0]);
}

#[test]
fn errors_have_the_messages_of_the_engine_and_their_place() {
    for (text, expected) in [
        ("let x = ;", "0:8 "),
        ("poke(\"node2.w_CPU_CONTROL\", 16#0001);", "0:28 `16#0001`: write 0x0001"),
        ("\u{1F980}", "0:0 "),
        (
            "// \u{1F980}\r\n/* \u{1F980} */ expct(1);",
            "1:9 there is no verb or function `expct`; did you mean expect",
        ),
        ("assert(1);", "0:0 there is no verb or function `assert`; write expect_that(condition, \"text\")"),
        (
            "wait(\"node2.w_OPTION_STATUS\", 2);",
            "0:0 `wait`: 2 arguments are given; write wait(register, value, within)",
        ),
        ("peek(\"node2.w_CPU_CONTRL\");", "0:6 area `node2` has no register `w_CPU_CONTRL`"),
        ("peek(\"w_CPU_CONTRL\");", "0:6 "),
        (
            "expect_changes(snapshot(\"node2\"), [\"node2.b_BT_1\", \"node2.x\"]);",
            "0:52 area `node2` has no register `x`",
        ),
        ("snapshot(\"node9\");", "0:10 there is no area 'node9'; there are: "),
        (
            "poke(\"node2.w_CPU_CONTROL\", 70000);",
            "0:28 node2.w_CPU_CONTROL (%MW3.200000): `70000 (16#11170)` is out of range",
        ),
        (
            "poke(\"node2.w_CPU_CONTROL\", \"handshook\");",
            "0:28 node2.w_CPU_CONTROL (%MW3.200000): `handshook` is no number",
        ),
        (
            "wait_bits(\"node2.i_SW1_NR\", \"32768\", \"65536\", 5);",
            "0:37 node2.i_SW1_NR (%MW3.200008): `65536` is out of range, a WORD holds 0 to 65535",
        ),
        (
            "expect_bits(\"node2.i_SW1_NR\", 65536, \"32768\");",
            "0:30 node2.i_SW1_NR (%MW3.200008): `65536 (16#10000)` is out of range",
        ),
        ("step(\"1 day\");", "0:6 `1 day`: "),
        ("poke(\"node2.b_BT_0\", - 1);", "0:21 node2.b_BT_0 (%MB3.200015): `-1` is out of range"),
        ("expect_frame(\"drives\", 0x100, 0x700, \"44\", \"4 days\");", "0:44 `4 days`: "),
        ("expect_frame(\"drives\", 0x100, \"44\", \"4 days\", true);", "0:37 `4 days`: "),
        ("fault(\"lost_frame\");", "0:7 kind = \"lost_frame\": there is no such fault"),
        ("fault(\"lose_frame slot=X\");", "0:7 "),
        ("send_frame(\"bus\", 1, \"01\");", "0:12 there is no bus 'bus'; there are: drives"),
        ("drive(\"drive9\");", "0:7 there is no drive 'drive9'; there are: "),
        ("plant(\"none.toml\");", "0:6 /nonexistent/none.toml: "),
        ("import \"none\" as n; n::f();", "0:8 there is no script `none` to import"),
        ("plant(`[[plc]]\nnam = 1`);", "0:6 plant: line 2: "),
    ] {
        assert_error(text, expected);
    }
}

#[test]
fn a_script_that_shares_functions_has_no_plant() {
    assert_eq!(errors("fn start(plc) { poke(\"press:node2.w_CPU_CONTROL\", 1); }"), [""; 0]);
}

#[test]
fn the_plant_of_the_scenario_decides_on_the_registers() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let plant = "[[plc]]\nname = \"a\"\nnode2 = \"x\"\n[[plc]]\nname = \"b\"\n[[bus]]\nname = \"x\"\n";
    std::fs::write(at("two.toml"), plant).unwrap();
    let mut editor = Editor::new();
    editor.open(&at("one.rhai"), "plant(\"two.toml\"); peek(\"node2.w_CPU_CONTROL\");");
    let found = editor.errors();
    assert!(found[0].contains("the plant has several PLCs (a, b)"), "{found:?}");
    editor.open(&at("two.rhai"), "plant(\"two.toml\"); peek(\"b:¦\");");
    assert!(editor.completions().contains(&"b:node1.w_CPU_CONTROL".to_owned()));
    // The plant is changed in the editor but not saved. The server must use the text of the editor.
    editor.open(&at("two.toml"), &plant.replace("\"b\"", "\"c\""));
    editor.open(&at("one.rhai"), "plant(\"two.toml\"); peek(\"b:node2.w_CPU_CONTROL\");");
    assert!(editor.errors()[0].contains("there is no PLC 'b'; there are: a, c"));
}

#[test]
fn registers_values_faults_and_verbs_are_completed() {
    for (text, expected) in [
        ("peek(\"¦", "node2.w_OPTION_STATUS"),
        ("peek(\"node2.w_¦\");", "node2.w_CPU_CONTROL"),
        ("peek(\"node2.a_RD_BMARRAY[3][¦", "node2.a_RD_BMARRAY[3][0]"),
        ("expect_changes(s, [\"node2.b_BT_1\", \"¦\"])", "node2.w_OPTION_STATUS"),
        ("poke(\"node2.w_CPU_CONTROL\", \"¦\")", "handshake"),
        ("poke(\"node2.w_CPU_CONTROL\", ¦)", "0x0001"),
        ("fault(\"¦\")", "lose_frame"),
        ("fault(\"lose_frame slot=WRC1 ¦\")", "count="),
        ("fault(\"lose_frame slot=¦\")", "slot=WRC1"),
        ("fault(\"lose_frame bus=¦\")", "bus=drives"),
        // A no-break space has two bytes.
        ("fault(\"lose_frame\u{A0}slot=¦\")", "slot=WRC1"),
        ("wait(\"node2.w_OPTION_STATUS\", 2, \"¦\")", "1ms"),
        ("wait(\"node2.w_OPTION_STATUS\", 2, ¦)", "\"1ms\""),
        ("step(\"¦\")", "1ms"),
        ("snapshot(\"¦\")", "node2"),
        ("send_frame(\"¦\")", "drives"),
        ("drive(\"¦\")", "drive1"),
        ("block(\"¦\")", BLOCK),
        ("expect_no_findings([\"¦\"])", "reserved-value"),
        ("exp¦", "expect_near"),
        ("fn own() {} ow¦", "own"),
    ] {
        let found = Editor::with(text).completions();
        assert!(found.iter().any(|label| label == expected), "{text}: {found:?}");
    }
    for text in ["// peek(\"¦", "print(\"¦", "poke(\"node2.w_CPU_CONTROL\", 0x¦"] {
        assert_eq!(Editor::with(text).completions(), [""; 0], "{text}");
    }
}

#[test]
fn a_typed_sign_proposes_names_in_texts_only() {
    for (text, expected) in [("let x = ¦", false), ("fault(\"lose_frame ¦\")", true)] {
        let mut editor = Editor::with(text);
        let mut params = editor.place();
        params["context"] = json!({ "triggerKind": 2, "triggerCharacter": " " });
        let found = editor.ask("textDocument/completion", params);
        let items = found["items"].as_array().unwrap();
        assert_eq!(items.iter().any(|item| item["label"] == "required"), expected, "{text}");
        assert_eq!(!items.is_empty(), expected, "{text}");
    }
}

#[test]
fn bits_are_marked_among_the_values() {
    let mut editor = Editor::with("poke(\"node2.w_CPU_CONTROL\", \"¦\")");
    let found = editor.ask("textDocument/completion", editor.place());
    let detail = |label: &str| {
        let items = found["items"].as_array().unwrap();
        let item = items.iter().find(|item| item["label"] == label).unwrap();
        item["detail"].as_str().unwrap().to_owned()
    };
    assert_eq!(detail("handshake"), "handshake");
    assert_eq!(detail("enable"), "bit 6: enable active operation");
}

#[test]
fn a_completion_replaces_the_whole_text() {
    let mut editor = Editor::with("peek(\"node2.w_¦CPU\");");
    let found = editor.ask("textDocument/completion", editor.place());
    let range = &found["items"][0]["textEdit"]["range"];
    assert_eq!((&range["start"]["character"], &range["end"]["character"]), (&json!(6), &json!(17)));
}

#[test]
fn descriptions_name_meaning_address_page_and_source() {
    let register = Editor::with("peek(\"node2.w_OPTION_¦STATUS\");").hover();
    for part in [
        "node2.w_OPTION_STATUS",
        "%MW3.200002",
        "WORD",
        "owner",
        " p. ",
        "offset from",
        "take over initialization data",
    ] {
        assert!(register.contains(part), "{part}: {register}");
    }
    assert!(register.find("  values\n") < register.find("  sources\n"), "{register}");
    let verb = Editor::with("wa¦it(\"x\");").hover();
    assert!(
        verb.contains("wait(register: String, value, within) -> int") && verb.contains("Advances the clock"),
        "{verb}"
    );
    let own = Editor::with("// Starts.\nfn start(us) {}\nsta¦rt(1);").hover();
    assert!(own.contains("start(us)") && own.contains("Starts."), "{own}");
    assert!(Editor::with("fault(\"lose_fr¦ame\");").hover().contains("frame"));
    assert!(Editor::with("fault(\"lose_frame cou¦nt=3\");").hover().starts_with("`count`: "));
    assert_eq!(Editor::with("let x¦ = 1;").hover(), "");
}

#[test]
fn the_signature_has_the_parameter_at_the_cursor() {
    let mut editor = Editor::with("wait(peek(\"x\"), ¦");
    let help = editor.ask("textDocument/signatureHelp", editor.place());
    assert_eq!(help["signatures"][0]["label"], "wait(register: String, value, within) -> int");
    assert_eq!(help["activeParameter"], 1);
}

#[test]
fn a_register_of_a_folder_is_defined_in_its_structure() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/devices/mailbox");
    let test = std::fs::read_dir(folder.join("tests")).unwrap().next().unwrap().unwrap().path();
    let text = std::fs::read_to_string(folder.join("MAILBOX.toml")).unwrap();
    let name = text.split("name = \"w_").nth(1).unwrap().split('"').next().unwrap();
    let mut editor = Editor::new();
    editor.open(&test, "peek(\"¦\")");
    let register =
        editor.completions().into_iter().find(|label| label.ends_with(&format!(".w_{name}"))).unwrap();
    editor.open(&test, &format!("peek(\"{}¦\");", register));
    assert_eq!(editor.errors(), [""; 0]);
    let target = editor.ask("textDocument/definition", editor.place());
    assert!(target["uri"].as_str().unwrap().ends_with("/mailbox/MAILBOX.toml"), "{target}");
    let line = target["range"]["start"]["line"].as_u64().unwrap();
    assert!(
        text.lines().nth(usize::try_from(line).unwrap()).unwrap().contains(&format!("w_{name}")),
        "{target}"
    );
}

/// The registers of an option card are defined in the folder of the card, and not in that of the PLC.
#[test]
fn a_register_of_an_option_card_is_defined_in_the_folder_of_the_card() {
    let test = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/devices/encoder/tests/option.rhai");
    let mut editor = Editor::new();
    editor.open(&test, "plant(\"option.toml\");\npeek(\"line:encoder1.w_COM¦MAND\");");
    assert_eq!(editor.errors(), [""; 0]);
    let target = editor.ask("textDocument/definition", editor.place());
    assert!(target["uri"].as_str().unwrap().ends_with("/encoder/ENCODER.toml"), "{target}");
    assert!(editor.hover().contains("p. 1 of encoder-1.0"), "{}", editor.hover());
}

#[test]
fn functions_of_one_name_in_several_scripts_are_marked_at_the_import() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::create_dir(at("lib")).unwrap();
    std::fs::write(at("lib/a.rhai"), "fn helper() { 1 }\nfn run() { helper() }\n").unwrap();
    std::fs::write(at("lib/b.rhai"), "fn helper() { 2 }\nfn other() { helper() }\n").unwrap();
    std::fs::write(at("lib/c.rhai"), "import \"b\" as b;\nfn all() { b::other() }\n").unwrap();
    let what = "there are functions `helper` with 0 parameters in";
    let advice = "and the scripts would call each other's functions; rename them";
    let mut editor = Editor::new();
    for (text, expected) in [
        ("import \"lib/a\" as a;\nimport \"lib/b\" as b;\n", format!("1:8 {what} lib/a and lib/b, {advice}")),
        ("import \"lib/a\" as a;\nimport \"lib/c\" as c;\n", format!("1:8 {what} lib/a and lib/b, {advice}")),
        (
            "import \"lib/a\" as a;\nfn helper() { 3 }\nhelper();\n",
            format!("0:8 {what} lib/a and own.rhai, {advice}"),
        ),
    ] {
        editor.open(&at("own.rhai"), &format!("¦{text}"));
        assert_eq!(editor.errors(), [expected], "{text}");
    }
    editor.open(&at("own.rhai"), "¦import \"lib/c\" as c;\nimport \"lib/b\" as b;\nfn helper() { 3 }\n");
    assert!(editor.errors().is_empty());
}

/// `commram test` resolves such an import beside the importing script, or else beside the scenario.
#[test]
fn imports_of_a_library_are_found_as_in_a_run() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::create_dir(at("lib")).unwrap();
    std::fs::write(at("lib/u.rhai"), "fn g() { 3 }\n").unwrap();
    let mut editor = Editor::new();
    for (name, path, is_found) in
        [("lib/v.rhai", "u", true), ("lib/v.rhai", "lib/u", true), ("lib/v.rhai", "lib/w", false)]
    {
        editor.open(&at(name), &format!("¦import \"{path}\" as u;\nfn f() {{ u::g() }}\n"));
        assert_eq!(editor.errors().is_empty(), is_found, "{name} {path}: {:?}", editor.errors());
    }
    // A scenario finds no script above its directory.
    editor.open(&at("lib/own.rhai"), "¦import \"lib/u\" as u;\nu::g();\n");
    assert_eq!(editor.errors(), ["0:8 there is no script `lib/u` to import"]);
}

#[test]
fn own_and_imported_functions_are_found_and_renamed() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::write(at("part.rhai"), "fn start() { stop() }\nfn stop() {}\n").unwrap();
    std::fs::write(at("user.rhai"), "import \"part\" as p;\np::stop(); p::start();\n").unwrap();
    let mut editor = Editor::new();
    let root = format!("file://{}", directory.path().display());
    editor.server = Server::new();
    editor.ask("initialize", json!({ "capabilities": {}, "rootUri": root }));
    editor.open(&at("user.rhai"), "import \"part\" as p;\np::sto¦p(); p::start(); p::none();\n");
    assert_eq!(editor.errors(), ["1:26 part.rhai has no function `none`"]);
    let target = editor.ask("textDocument/definition", editor.place());
    assert!(target["uri"].as_str().unwrap().ends_with("/part.rhai"), "{target}");
    assert_eq!(target["range"]["start"], json!({ "line": 1, "character": 3 }));

    editor.open(&at("part.rhai"), "fn start() { sto¦p(); let f = Fn(\"stop\"); }\nfn stop() {}\n");
    assert_eq!(editor.ask("textDocument/prepareRename", editor.place())["placeholder"], "stop");
    let mut params = editor.place();
    params["newName"] = json!("halt");
    let changes = editor.ask("textDocument/rename", params.clone())["changes"].clone();
    let count = |name: &str| {
        let of = changes.as_object().unwrap().iter().find(|(uri, _)| uri.ends_with(name)).unwrap().1;
        of.as_array().unwrap().len()
    };
    assert_eq!((count("/part.rhai"), count("/user.rhai")), (3, 1), "{changes}");
    for wrong in ["let", "9x", "start", "poke", "a b", "match", "print", "default", "thread"] {
        params["newName"] = json!(wrong);
        assert!(editor.response("textDocument/rename", params.clone()).response_result.is_err(), "{wrong}");
    }
}

/// The code in `${...}` is code, and a text in this code is a text.
#[test]
fn code_in_texts_is_found_and_renamed() {
    let text = "fn f(x) { x + 1 }\nprint(`v ${f(1)} f(2)`);\n\
                let z = `w ${ if f(2) == 3 { `n ${f(3)}` } else { `f(9) is text` } }`;\nexpect_that(f(1) == 2, z);\n";
    let places = json!([[0, 3], [1, 11], [2, 17], [2, 34], [3, 12]]);
    for cursor in ["fn ¦f(x)", "${¦f(1)}", "${f¦(3)}"] {
        let mut editor = Editor::with(&text.replacen(&cursor.replace('¦', ""), cursor, 1));
        assert_eq!(editor.errors(), [""; 0]);
        let mut params = editor.place();
        params["context"] = json!({ "includeDeclaration": true });
        params["newName"] = json!("func");
        let start = |it: &Value| {
            let start = &it["range"]["start"];
            json!([start["line"], start["character"]])
        };
        let found = editor.ask("textDocument/references", params.clone());
        assert_eq!(found.as_array().unwrap().iter().map(start).collect::<Value>(), places, "{cursor}");
        let changes = editor.ask("textDocument/rename", params.clone())["changes"].clone();
        let edits = changes.as_object().unwrap().values().next().unwrap().as_array().unwrap().clone();
        assert_eq!(edits.iter().map(start).collect::<Value>(), places, "{cursor}");
        let target = editor.ask("textDocument/definition", params);
        assert_eq!(start(&target), json!([0, 3]), "{cursor}");
    }
    assert_eq!(
        errors(
            "print(`v ${nofunc(1)} ${peek(\"node2.nix\")} no(1) ${`no(2)`}`);\nexpect_that(true, `${16#1}`);"
        )
        .len(),
        3
    );
    assert_error("print(`v ${nofunc(1)} no(1) ${`no(2)`}`);", "0:11 there is no verb or function `nofunc`");
    assert_error("print(`v ${peek(\"node2.nix\")}`);", "0:17 area `node2` has no register `nix`");
    let open = "nofunc(1);\nprint(`a ${ b`);\nnofunc(2);\nfn f() { nofunc(3); }\nprint(`c ${1}`);\n";
    let unknown = |line, column| format!("{line}:{column} there is no verb or function `nofunc`");
    let mut found = errors(open);
    found.sort();
    assert_eq!(found.len(), 4, "{found:?}");
    for (found, expected) in found.iter().zip([
        unknown(0, 0),
        "1:9 the code in this text does not end".to_owned(),
        unknown(2, 0),
        unknown(3, 9),
    ]) {
        assert!(found.starts_with(&expected), "{found}, not {expected}");
    }
    for (text, expected) in [
        ("print(`${pe¦}`)", Some("peek")),
        ("peek(`a ${ b`);\npe¦", Some("peek")),
        ("print(`a ${¦", Some("peek")),
        ("print(`${peek(\"¦\")}`)", Some("node2.w_OPTION_STATUS")),
        ("print(`${1} pe¦`)", None),
        ("print(`pe¦ ${1}`)", None),
    ] {
        let found = Editor::with(text).completions();
        let is_right = expected.map_or(found.is_empty(), |name| found.iter().any(|label| label == name));
        assert!(is_right, "{text}: {found:?}");
    }
    assert!(Editor::with("print(`${pe¦ek(\"x\")}`)").hover().contains("peek("));
    let array = "expect_changes(snapshot(\"node2\"), [`node2.${\"b_BT_1\"}`]);";
    assert_eq!(errors(array), [""; 0]);
}

#[test]
fn firmware_of_a_device_has_its_own_verbs() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/devices/mailbox");
    let mut editor = Editor::new();
    editor.open(&folder.join("firmware.rhai"), "fn poll() { out¦put(\"x\", 1); }");
    let found = editor.completions();
    assert!(found.contains(&"set_bits".to_owned()) && !found.contains(&"wait_until".to_owned()));
    assert!(editor.hover().contains("Replaces the value of a register with process data"));
}

#[test]
fn requests_out_of_order_are_refused() {
    let mut server = Server::new();
    let mut ask = |method: &str| {
        let mut answers = Vec::new();
        let request = Request { id: RequestId::from(1), method: method.to_owned(), params: json!({}) };
        server.take(request.into(), &mut answers);
        let Some(Message::Response(response)) = answers.pop() else { panic!("{method}") };
        response.response_result.err().map(|error| error.code)
    };
    assert_eq!(ask("textDocument/hover"), Some(-32002));
    assert_eq!(ask("initialize"), Some(-32602), "without capabilities");
}

#[test]
fn a_script_that_is_too_long_is_not_judged() {
    let found = errors(&format!("let x = ;\n{}", "// long\n".repeat(9000)));
    assert_eq!(found, ["0:0 a script has at most 64 KiB; import a part of it"]);
}

/// Returns the links of the open document: the linked text, and the last parts of the target.
fn links(editor: &mut Editor) -> Vec<String> {
    let found = editor.ask("textDocument/documentLink", json!({ "textDocument": { "uri": editor.uri } }));
    let lines: Vec<_> = editor.text.lines().collect();
    let line = |it: &Value| {
        let [start, end] = ["start", "end"].map(|end| &it["range"][end]);
        let column = |place: &Value| usize::try_from(place["character"].as_u64().unwrap()).unwrap();
        let line = lines[usize::try_from(start["line"].as_u64().unwrap()).unwrap()];
        assert_eq!(start["line"], end["line"], "{it}");
        let target = it["target"].as_str().unwrap();
        let path = target.strip_prefix("file://").unwrap().split('#').next().unwrap();
        assert!(Path::new(path).is_file(), "dead link: {target}");
        let parts: Vec<_> = target.split('/').rev().take(2).collect();
        let units: Vec<u16> = line.encode_utf16().collect();
        let linked = String::from_utf16(&units[column(start)..column(end)]).unwrap();
        format!("{linked} -> {}/{}", parts[1], parts[0])
    };
    found.as_array().unwrap().iter().map(line).collect()
}

/// Returns the text of a link to a heading of a page.
fn to_heading(text: &str, page: &str, heading: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(page);
    let line = std::fs::read_to_string(path).unwrap().lines().position(|line| line == heading).unwrap() + 1;
    let parts: Vec<_> = page.split('/').rev().take(2).collect();
    format!("{text} -> {}/{}#L{line}", parts[1], parts[0])
}

#[test]
fn plants_link_to_pages_and_to_folders_of_devices() {
    let directory = tempfile::tempdir().unwrap();
    copy_folder("mailbox", &directory.path().join("cards/mailbox"));
    let mut editor = Editor::new();
    let text = "[[plc]] # first\nname = \"a\"\n [plc.drive]\n[[plc.option]]\ncard = './cards/mailbox'\n\
                [[device]]\nkind = \"./cards/mailbox\"\n\
                [[device]]\nkind = './cards/none'\n[[device]]\nkind = \"can-dp2\"\npage = \"12\"\n\
                [[bus]]\nkind = \"can\"\n[[fault]]\nkind = \"slave_off\"\n[unknown]\n[[device]]\nkind = \"mail";
    editor.open(&directory.path().join("plant.toml"), text);
    let found = links(&mut editor);
    let expected = [
        "[[plc]] -> reference/plant.md".to_owned(),
        to_heading("[plc.drive]", "reference/plant.md", "## The drive of a PLC"),
        "[[device]] -> reference/plant.md".to_owned(),
        "[[device]] -> reference/plant.md".to_owned(),
        "[[device]] -> reference/plant.md".to_owned(),
        "[[bus]] -> reference/plant.md".to_owned(),
        "[[fault]] -> reference/faults.md".to_owned(),
        "[[device]] -> reference/plant.md".to_owned(),
        "./cards/mailbox -> mailbox/device.toml".to_owned(),
        "./cards/mailbox -> mailbox/device.toml".to_owned(),
        to_heading("[[plc.option]]", "reference/device-folders.md", "## Option cards"),
        "can-dp2 -> can-dp2/overview.md".to_owned(),
        "can -> reference/can.md".to_owned(),
        to_heading("slave_off", "reference/faults.md", "### `slave_off`"),
    ];
    let (mut found, mut expected) = (found, expected.to_vec());
    found.sort();
    expected.sort();
    assert_eq!(found, expected);
}

#[test]
fn files_of_a_device_link_to_each_other_and_to_their_pages() {
    let directory = tempfile::tempdir().unwrap();
    copy_folder("netx-dpm", directory.path());
    let mut editor = Editor::new();
    let text = std::fs::read_to_string(directory.path().join("device.toml")).unwrap();
    editor.open(&directory.path().join("device.toml"), &text);
    let found = links(&mut editor);
    let name = directory.path().file_name().unwrap().to_str().unwrap().to_owned();
    for file in ["HIL_DPM_SYSTEM_CHANNEL", "meanings.toml"] {
        let target = format!("{file} -> {name}/{}.toml", file.trim_end_matches(".toml"));
        assert!(found.contains(&target), "{target}: {found:?}");
    }
    editor.open(&directory.path().join("handshakes.toml"), "[[ready]]\n[[fault]]\nname = \"device.toml\"\n");
    let page = "reference/device-folders.md";
    let expected =
        [to_heading("[[ready]]", page, "## Handshakes"), to_heading("[[fault]]", page, "## Faults")];
    assert_eq!(links(&mut editor), expected);
    // A file of another program.
    editor.open(&directory.path().join("sub/Cargo.toml"), "[[plc_code]]\nkind = \"can\"\n");
    let none = editor.ask("textDocument/documentLink", json!({ "textDocument": { "uri": editor.uri } }));
    assert_eq!(none, Value::Null);
}

#[test]
fn scenarios_link_to_their_plant_and_to_imported_scripts() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::create_dir(at("tests")).unwrap();
    std::fs::write(at("tests/part.rhai"), "fn start() {}\n").unwrap();
    std::fs::write(at("plant.toml"), "[[plc]]\nname = \"a\"\n").unwrap();
    let mut editor = Editor::new();
    let text =
        "import \"part\" as p;\nimport \"none\" as n;\nplant(\"../plant.toml\");\npeek(\"plant.toml\");\n";
    editor.open(&at("tests/one.rhai"), text);
    let name = directory.path().file_name().unwrap().to_str().unwrap().to_owned();
    let expected = ["part -> tests/part.rhai".to_owned(), format!("../plant.toml -> {name}/plant.toml")];
    assert_eq!(links(&mut editor), expected);
    editor.open(&at("tests/one.rhai"), "plant(\"none.toml\"); plant(`[[plc]]\nname = \"a\"`);");
    assert_eq!(links(&mut editor), [""; 0]);
}

/// Generates a piece of text: parts of scripts, signs, line ends, characters of all lengths.
fn piece() -> impl Strategy<Value = String> {
    let parts = prop::sample::select(vec![
        "poke(\"node2.w_CPU_CONTROL\", 0x0001);",
        "peek(\"",
        "\"",
        "`${",
        "`",
        "${f(`",
        "}",
        "{",
        "(",
        ")",
        "[",
        "]",
        ",",
        ";",
        "\r\n",
        "\r",
        "\n",
        "fn f(a) {",
        "import \"x\" as y;",
        "y::f(",
        "fault(\"lose_frame slot=",
        "wait_until(|| ",
        "/*",
        "//",
        "'",
        "\\",
        "\u{1F980}",
        "ü",
        "\u{0}",
        "16#",
        "let x = ",
        "plant(`[[plc]]",
        "[[",
        "#{",
        "..",
        "0x",
        "|",
        "#\"",
    ]);
    prop_oneof![parts.prop_map(str::to_owned), ".{0,8}"]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..crate::property_tests() })]

    /// Random edits, at positions inside and outside of the text, never end the server. Changes of ranges and changes
    /// of the whole text give the same document.
    #[test]
    fn random_edits_never_end_the_server(
        edits in prop::collection::vec((piece(), 0..12_u32, 0..40_u32, 0..3_u32, 0..20_u32, any::<bool>()), 1..24)
    ) {
        let run = || {
            let mut editor = Editor::with("section(\"a\");\npoke(\"node2.w_CPU_CONTROL\", 1);\n");
            let mut mirror = super::text::Text::new(editor.text.clone());
            for (version, (text, line, character, lines, more, is_full)) in (2..).zip(edits) {
                let end = json!({ "line": line + lines, "character": character + more });
                let range = json!({ "start": { "line": line, "character": character }, "end": end });
                let change = json!({ "range": range, "text": text });
                mirror.apply(serde_json::from_value(change.clone()).unwrap());
                let sent = if is_full { json!({ "text": mirror.as_str() }) } else { change };
                let document = json!({ "uri": editor.uri, "version": version });
                editor.note("textDocument/didChange", json!({ "textDocument": document, "contentChanges": [sent] }));
                let place = json!({ "textDocument": { "uri": editor.uri }, "position": { "line": line, "character": character } });
                for method in [
                    "textDocument/completion", "textDocument/hover", "textDocument/signatureHelp", "textDocument/definition",
                    "textDocument/prepareRename",
                ] {
                    editor.ask(method, place.clone());
                }
                let mut references = place;
                references["context"] = json!({ "includeDeclaration": true });
                editor.ask("textDocument/references", references);
                links(&mut editor);
                editor.errors();
            }
            // The server still answers requests, and removes the errors of a closed document.
            let document = json!({ "textDocument": { "uri": editor.uri } });
            editor.note("textDocument/didClose", document);
            assert_eq!(editor.errors(), [""; 0]);
        };
        // Compiles scripts in a thread with a large stack, as the program does.
        crate::script::with_stack(run).unwrap();
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..crate::property_tests() })]

    /// The server answers each request in a TOML file with any content, also if it ends in the middle of a value.
    #[test]
    fn random_tables_never_end_the_server(
        lines in prop::collection::vec(prop::sample::select(vec![
            "[[plc]]", "[plc.drive", "[[device]]", "kind = \"can-dp2\"", "kind = \"./x\"", "kind = '", "name = \"\"\"",
            "option = { plc = \"a\", ", "kind = \"\\u0041\"", "]]", "# \u{1F980} [", "[[fault]]", "kind = \"lose_frame\"", "",
            "structures = [\"A\",", "parts = [\"meanings.toml\"]", "area = [{ structure = [{ name = \"A\"", "\"", "= 5",
        ]), 0..12),
        kept in 0..200_usize,
        is_device in any::<bool>(),
    ) {
        let directory = tempfile::tempdir().unwrap();
        let text: String = lines.join("\n").chars().take(kept).collect();
        let mut editor = Editor::new();
        editor.open(&directory.path().join(if is_device { "device.toml" } else { "plant.toml" }), &text);
        links(&mut editor);
        for method in ["textDocument/completion", "textDocument/hover"] {
            editor.ask(method, editor.place());
        }
        editor.errors();
    }
}

/// Copies the folder of a device of this project.
fn folder(name: &str) -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    copy_folder(name, copy.path());
    copy
}

#[test]
fn plants_have_the_messages_of_the_program_with_their_line() {
    let mut editor = Editor::new();
    let mut errors = |text: &str| {
        editor.open(Path::new("/nonexistent/plant.toml"), text);
        editor.errors()
    };
    assert_eq!(errors("[[plc]]\nname = \"a\"\n"), [""; 0]);
    assert!(
        errors("[[plc]]\nname = \"a\"\nnod1 = 1\n")[0]
            .starts_with("2:0 unknown field `nod1`; did you mean node1")
    );
    assert!(errors("[[plc]]\nname = \"a\"\ndip = 99\n")[0].starts_with("2:0 "));
    assert!(errors("[[plc]\nname = \"a\"\n")[0].starts_with("0:0 "));
    let warned = errors("[[plc]]\nname = \"a\"\nnode1 = \"x\"\n[[bus]]\nname = \"x\"\n");
    assert!(warned[0].contains("has no master"), "{warned:?}");
    // The server reports no errors in files of other programs.
    editor.open(Path::new("/nonexistent/Cargo.toml"), "[package]\nname = 1\n");
    assert_eq!(editor.errors(), [""; 0]);
}

#[test]
fn keys_and_values_of_plants_come_from_the_schema() {
    for (text, expected) in [
        ("[[plc]]\n¦", "retain_bytes"),
        ("[[plc]]\nproject = ¦", "\"boot\""),
        ("[[device]]\nkind = \"can-dp2\"\ns¦", "switches"),
        ("[[device]]\nkind = ¦", "\"can-dp2\""),
        ("[[¦", "[[bus.drive]]"),
        ("[[fault]]\nkind = \"lose_frame\"\n¦", "slot"),
        ("[plc.drive.monitoring.sync]\nreaction = ¦", "\"quick_stop\""),
        ("[[plc]]\nname = \"a\"\n[[plc.option]]\n¦", "interface"),
        ("[[¦", "[[plc.option]]"),
    ] {
        let mut editor = Editor::new();
        editor.open(Path::new("/nonexistent/plant.toml"), text);
        let found = editor.completions();
        assert!(found.iter().any(|label| label == expected), "{text}: {found:?}");
        // The server does not propose a key that only another kind of device has.
        assert!(!text.contains("can-dp2") || !found.contains(&"retain_bytes".to_owned()), "{found:?}");
    }
    let mut editor = Editor::new();
    editor.open(Path::new("/nonexistent/plant.toml"), "[[device]]\nkind = \"can-dp2\"\nswit¦ches = 3\n");
    assert!(editor.hover().starts_with("`switches`: integer, 0 to 255, default 3"), "{}", editor.hover());
}

#[test]
fn files_of_a_folder_are_judged_as_they_are_typed() {
    let copy = folder("digital-io");
    let at = |name: &str| copy.path().join(name);
    let read = |name: &str| std::fs::read_to_string(at(name)).unwrap();
    let mut editor = Editor::new();
    for name in ["device.toml", "IO_DATA.toml", "IO_CONTROL.toml", "meanings.toml", "handshakes.toml"] {
        editor.open(&at(name), &read(name));
        assert_eq!(editor.errors(), [""; 0], "{name}");
    }
    editor.open(&at("IO_DATA.toml"), &read("IO_DATA.toml").replace("\"firmware\"", "\"someone\""));
    let found = editor.errors();
    assert!(found[0].contains("someone"), "{found:?}");
    editor.open(&at("IO_DATA.toml"), "name = \"IO_DATA\"\nregister = [\n  { offset = 0, owner = ¦ },\n]\n");
    assert!(editor.completions().contains(&"\"firmware\"".to_owned()));
    editor.open(&at("IO_DATA.toml"), &read("IO_DATA.toml"));
    editor.open(
        &at("handshakes.toml"),
        &format!("{}\n[[toggle]]\nregister = \"none\"\n", read("handshakes.toml")),
    );
    assert!(!editor.errors().is_empty());
    editor.open(&at("handshakes.toml"), "[[watchdog]]\nwi¦");
    assert!(editor.completions().contains(&"within".to_owned()));
    editor.open(&at("handshakes.toml"), "[[counter]]\nregister = \"¦");
    let found = editor.completions();
    assert!(found.iter().any(|label| label.starts_with('"') && label.contains('.')), "{found:?}");
}

#[test]
fn scripts_of_a_device_have_the_messages_of_its_engine() {
    let copy = folder("mailbox");
    let at = |name: &str| copy.path().join(name);
    let text = std::fs::read_to_string(at("firmware.rhai")).unwrap();
    let mut editor = Editor::new();
    editor.open(&at("firmware.rhai"), &text);
    assert_eq!(editor.errors(), [""; 0]);
    editor.open(&at("firmware.rhai"), &format!("{text}\nfn wrong() {{ read(\"none\"); }}\n"));
    let found = editor.errors();
    assert!(found.len() == 1 && found[0].contains("none"), "{found:?}");
}
