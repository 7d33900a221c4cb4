//! The page in a real browser.

use crate::common::{commram, is_there, python};
use serde_json::{Value, json};
use std::process::Command;

/// Each page shows what the commands print, each control acts, a recording is a scenario that passes, and the wrong
/// order of two stores is visible. The console has no message, and no page overflows a window of 390, 1280 or 2560
/// pixels.
#[test]
fn the_pages_work_in_a_browser() {
    if !is_there("chromium") {
        return;
    }
    let Some(python) = python(&["websocket"]) else { return };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/check_web.py");
    let mut browser = Command::new(python.get_program());
    browser.env("PYTHONDONTWRITEBYTECODE", "1");
    // Each step of the script has its own time limit; all steps together can take longer than the watchdog of a command
    // allows.
    let output = browser.arg(script).arg("chromium").arg(commram().get_program()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result, json!({ "passed": true }));
}
