//! Whole screens of the view, compared with stored files.

use super::picture::svg;
use super::{User, held};
use ratatui::crossterm::event::KeyCode;

fn screen(user: &User, name: &str) {
    held(&format!("tests/view/{name}.txt"), &user.screen());
}

#[test]
fn the_tree_and_the_pins() {
    let mut user = User::built_in();
    screen(&user, "begin");
    for name in ["node2.w_CPU_CONTROL", "node2.w_OPTION_STATUS"] {
        user.find(name);
        user.press(KeyCode::Char(' '));
    }
    user.press(KeyCode::Esc);
    user.poke(&[("node2.w_CPU_CONTROL", 1)], 5_000);
    user.look();
    screen(&user, "pinned");
    user.type_in("/sync status");
    screen(&user, "found");
    user.press(KeyCode::Esc);
    user.type_in("3");
    screen(&user, "changes");
    user.type_in("?");
    screen(&user, "help");
}

#[test]
fn findings_with_their_page() {
    let mut user = User::built_in();
    user.poke(&[("node2.w_CPU_CONTROL", 1)], 5_000);
    user.poke(&[("node2.b_BT_0", 0x55), ("node2.w_CPU_CONTROL", 2)], 5_000);
    user.type_in("7");
    screen(&user, "findings");
    user.type_in("cy");
    user.sees("no violations of the manual");
}

#[test]
fn a_running_plant() {
    let mut user = User::built_in();
    for name in ["node2.b_CTRLREG_WRC1", "node2.a_WR_VALUE[0]", "node2.a_RD_BMARRAY[1][0]"] {
        user.find(name);
        user.press(KeyCode::Char(' '));
    }
    user.press(KeyCode::Esc);
    user.activate();
    user.type_in("46");
    for value in 0..40 {
        user.poke(&[("node2.a_WR_VALUE[0]", 100 * (value % 16)), ("node2.b_CTRLREG_WRC1", 5)], 2_000);
        user.look();
    }
    screen(&user, "drives");
    held(
        "docs/guide/view-drives.svg",
        &svg(user.buffer(), "The drives of the built-in plant, with the chart of the first one"),
    );
    user.type_in("4n");
    user.type_in("s\u{8}");
    user.press(KeyCode::Esc);
    user.poke(&[("node2.b_CTRLREG_WRC1", 5)], 1_990);
    user.look();
    screen(&user, "frames");
    held("docs/guide/view-frames.svg", &svg(user.buffer(), "The frames of an interval with its slots"));
    user.type_in("1");
    screen(&user, "plant");
    user.type_in("5");
    screen(&user, "board");
    user.type_in("2");
    screen(&user, "registers");
    held(
        "docs/guide/view-registers.svg",
        &svg(user.buffer(), "Blocks with their registers, and the pinned registers below"),
    );
    user.type_in("3");
    screen(&user, "handshakes");
    held(
        "docs/guide/view-changes.svg",
        &svg(user.buffer(), "Every change of the pinned registers, with time and writer"),
    );
}
