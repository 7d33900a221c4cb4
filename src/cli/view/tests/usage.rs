//! User actions and their effects.

use super::User;
use crate::cli::view::link::LinkReport;
use crate::cli::view::model::Connection;
use crate::devices;
use crate::identity::DeviceIndex;
use crate::journal::{Changed, Keep};
use crate::layout::NamedLocation;
use crate::plant::PlantConfig;
use crate::request::testing::TestHost;
use crate::request::{Op, Reply};
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

/// Returns the value of a register of the first PLC.
fn holds(user: &User, name: &str) -> u32 {
    let place = NamedLocation::parse(&user.host.plant.names().fitted(DeviceIndex(0)), name).unwrap();
    let device = &user.host.plant.devices()[0];
    device.segment().load(place.offset(), place.width()).unwrap()
}

#[test]
fn a_poke_asks_before_it_is_done() {
    let mut user = User::built_in();
    user.find("node2.w_CPU_CONTROL");
    user.type_in("p");
    user.sees("poke node2.w_CPU_CONTROL (%MW3.200000)");
    user.sees("start_synchronous");
    user.type_in("70000\n");
    user.sees("out of range");
    user.press(KeyCode::Esc);
    user.type_in("p16#0001\n");
    user.sees("poke node2.w_CPU_CONTROL (%MW3.200000) = 16#0001, handshake?");
    assert_eq!(holds(&user, "node2.w_CPU_CONTROL"), 0);
    user.type_in("n");
    assert_eq!(holds(&user, "node2.w_CPU_CONTROL"), 0);
    user.type_in("phandshake\ny");
    assert_eq!(holds(&user, "node2.w_CPU_CONTROL"), 1);
}

#[test]
fn a_forced_register_is_marked_and_can_be_unforced() {
    let mut user = User::built_in();
    user.find("node2.w_OPTION_STATUS");
    user.type_in(" f16#80\ny");
    user.sees("!16#0080");
    user.type_in("uy");
    assert!(!user.screen().contains("!16#0080"), "{}", user.screen());
    user.type_in("uy");
    user.sees("is not forced");
}

/// The name of a bit pins only this bit; the other bits of the register keep their values.
#[test]
fn a_single_bit_is_poked_and_forced() {
    let mut user = User::built_in();
    let fitted = user.host.plant.names().fitted(DeviceIndex(0));
    let bit = NamedLocation::parse(&fitted, "%MX3.200000.6").unwrap();
    user.model.pins.toggle(DeviceIndex(0), bit);
    user.poke(&[("node2.w_CPU_CONTROL", 0x0081)], 0);
    user.type_in("2");
    user.press(KeyCode::Tab);
    user.type_in("p1\ny");
    assert_eq!(holds(&user, "node2.w_CPU_CONTROL"), 0x00C1);
    user.type_in("f0\ny");
    assert_eq!(holds(&user, "node2.w_CPU_CONTROL"), 0x0081);
    assert_eq!(user.host.plant.forces().len(), 1);
    user.type_in("uy");
    assert_eq!(user.host.plant.forces().len(), 0);
}

#[test]
fn a_read_only_view_changes_nothing() {
    let mut user = User::at(TestHost::new(true), true);
    user.find("press:node2.w_CPU_CONTROL");
    for key in ["p", "f", "u", "t", "s", "n", "e", "w", "b", "B", "c"] {
        user.type_in(key);
        user.sees("--read-only");
        assert!(user.model.prompt.is_none(), "{key}");
    }
    assert_eq!(user.host.plant.now(), 0);
}

#[test]
fn a_stepped_clock_advances_by_the_given_time() {
    let mut user = User::built_in();
    user.type_in("s\n");
    assert_eq!(user.host.plant.now(), 1_000);
    // The prompt offers the last input, and typing replaces it.
    user.type_in("s");
    user.sees("1ms");
    user.type_in("2\n");
    user.sees("a time needs a unit");
    user.type_in("50us\n");
    assert_eq!(user.host.plant.now(), 1_250);
    user.type_in("e");
    assert_eq!(user.host.plant.now(), 1_500);
    user.type_in("n");
    user.sees("SYNC");
    user.type_in("wnode2.w_OPTION_STATUS == 16#0001\n");
    user.sees("node2.w_OPTION_STATUS == 16#0001");
    user.type_in("w");
    user.press(KeyCode::End);
    user.type_in(" and node2.w_CPU_CONTROL==9\n");
    user.sees("not yet: node2.w_OPTION_STATUS == 16#0001 and node2.w_CPU_CONTROL==9");
    assert_eq!(user.host.plant.now(), 10_001_500);
}

#[test]
fn a_wrong_condition_is_explained() {
    let mut user = User::at(TestHost::new(true), false);
    user.type_in("wnode2.w_CPU_CONTROL==1\n");
    user.sees("write the PLC in front: press, saw:...");
    user.press(KeyCode::Esc);
    user.type_in("wpress:node2.w_CPU_CONTRL==1\n");
    user.sees("w_CPU_CONTROL");
    user.press(KeyCode::Esc);
    user.type_in("wpress:node2.w_CPU_CONTROL=1\n");
    user.sees("write REG==VALUE");
}

#[test]
fn a_running_clock_is_not_stepped() {
    let mut user = User::at(TestHost::new(false), false);
    for key in ["s", "n", "e", "b", "B"] {
        user.type_in(key);
        user.sees("the clock runs by itself");
    }
}

#[test]
fn a_request_that_was_answered_between_two_polls_is_seen() {
    let mut user = User::built_in();
    user.activate();
    user.find("node2.b_CTRLREG_WRC1");
    user.type_in(" 3");
    user.poke(&[("node2.b_CTRLREG_WRC1", 5)], 4_000);
    user.look();
    let screen = user.screen();
    let found_lines: Vec<_> = screen.lines().filter(|line| line.contains("node2.b_CTRLREG_WRC1")).collect();
    let [request, answer] = found_lines.as_slice() else { panic!("{screen}") };
    assert!(request.contains("16#05") && request.contains("channel"), "{request}");
    assert!(answer.contains("16#04") && answer.contains("firmware"), "{answer}");
}

#[test]
fn the_mouse_chooses_panes_and_lines() {
    let mut user = User::built_in();
    user.click(3, 1);
    user.sees(" plant ");
    user.click(12, 1);
    user.sees(" blocks ");
    user.click(4, 4);
    let chosen = user.model.tree.list.chosen;
    let rows = user.model.tree.rows().len();
    user.click(4, 4);
    assert_eq!(chosen, 1);
    assert!(user.model.tree.rows().len() > rows, "a second click opens it");
}

/// From 120 columns on, the pane of changes is beside the other panes.
#[test]
fn wide_terminals_show_two_panes_side_by_side() {
    let mut user = User::built_in();
    user.find("node2.w_CPU_CONTROL");
    user.press(KeyCode::Char(' '));
    user.press(KeyCode::Esc);
    user.poke(&[("node2.w_CPU_CONTROL", 1)], 5_000);
    let is_beside = |user: &User| {
        let has_both = |line: &str| line.contains(" blocks ") && line.contains(" changes ");
        user.screen().lines().any(has_both)
    };
    for (width, wanted) in [(80, false), (119, false), (120, true), (135, true), (149, true), (200, true)] {
        user.terminal.backend_mut().resize(width, 24);
        user.look();
        assert_eq!(is_beside(&user), wanted, "{width}: {}", user.screen());
        if wanted {
            user.sees("16#0001");
        }
    }
}

#[test]
fn the_view_waits_for_a_new_emulator_and_keeps_the_pins() {
    let mut user = User::at(TestHost::new(true), false);
    user.find("press:node2.w_CPU_CONTROL");
    user.type_in(" ");
    user.press(KeyCode::Esc);
    user.model.take(LinkReport::Absent("no such instance is running".to_owned()));
    user.draw();
    user.sees("gone, waiting for it");
    user.sees("no such instance is running");
    user.model.take(LinkReport::Busy);
    user.draw();
    user.sees("busy with another client");
    let mut successor = user.model.info.clone().unwrap();
    successor.generation += 1;
    user.model.info = Some(successor);
    user.look();
    assert_eq!(user.model.connection, Connection::Live);
    user.sees("press:node2.w_CPU_CONTROL");
    user.sees("another emulator of this name");
}

#[test]
fn the_user_can_cancel_a_long_wait() {
    let mut user = User::built_in();
    user.model.press(KeyCode::Char('s').into());
    user.model.press(KeyCode::Enter.into());
    user.model.orders.clear();
    user.type_in("s");
    "60s".chars().for_each(|letter| user.model.press(KeyCode::Char(letter).into()));
    user.model.press(KeyCode::Enter.into());
    user.model.orders.drain(..).for_each(|order| user.queue.take(order));
    let news = user.queue.turn(&mut user.host, &mut user.poller);
    assert!(
        matches!(&news[0], LinkReport::Progress(text) if text == "0.1 s of 60 s passed; Esc ends"),
        "{news:?}"
    );
    user.press(KeyCode::Esc);
    assert_eq!(user.host.plant.now(), 100_000);
    user.sees("cancelled: 0.1 s of 60 s passed");
}

#[test]
fn the_tree_opens_and_closes() {
    let mut user = User::built_in();
    let closed = user.model.tree.rows().len();
    user.press(KeyCode::Right);
    let open = user.model.tree.rows().len();
    assert!(open > closed);
    user.press(KeyCode::Down);
    user.press(KeyCode::Left);
    assert_eq!(user.model.tree.list.chosen, 0, "closing a register chooses its block");
    user.press(KeyCode::Left);
    assert_eq!(user.model.tree.rows().len(), closed);
}

#[test]
fn addresses_and_patterns_are_found() {
    let mut user = User::built_in();
    user.find("%MW3.200002");
    user.sees("node2.w_OPTION_STATUS");
    user.press(KeyCode::Esc);
    user.find("node2.a_STAT_SL[1..3]");
    assert_eq!(user.model.tree.rows().len(), 3);
    user.press(KeyCode::Esc);
    user.type_in("/nothing of the kind");
    user.sees("no register has this text");
}

#[test]
fn a_modular_plc_shows_its_modules_at_its_front() {
    let modular = devices::all().iter().find(|known| known.emulation.module.is_some()).unwrap();
    let mut user = User::of(modular.emulation.template.unwrap(), false);
    user.type_in("5");
    user.sees("slotG");
    user.sees("can-06");
}

#[test]
fn a_stepped_plant_goes_back_and_reports_its_limit() {
    let mut user = User::built_in();
    user.poke(&[("node2.w_CPU_CONTROL", 1)], 5_000);
    user.type_in("s5ms\n");
    let now = user.host.plant.now();
    user.type_in("b2ms\n");
    user.sees("2 ms back");
    assert_eq!(user.host.plant.now(), now - 2_000);
    user.type_in("Bnode2.w_OPTION_STATUS==16#0043\n");
    user.sees("did not become true");
    user.type_in("b1h\n");
    user.sees("are too far");
    user.type_in("Bnode2.w_OPTION_STATUS==16#0002 and node2.w_CPU_CONTROL==1\n");
    user.sees("have been true since");
    assert_eq!(user.host.plant.now(), now - 2_000);
}

#[test]
fn switches_of_the_board_are_turned_as_on_the_command_line() {
    let mut user = User::built_in();
    user.type_in("5");
    user.sees("t turns");
    user.type_in("t");
    user.sees("this line has no switch");
    let line =
        |user: &User, what: &str| user.screen().lines().position(|line| line.contains(what)).unwrap() as u16;
    let switch = line(&user, "RUN");
    user.click(4, switch);
    user.press(KeyCode::Enter);
    user.sees("set switch");
    user.sees("reset");
    user.type_in("sideways\n");
    user.sees("the switch has the positions run, stop, reset");
    user.press(KeyCode::Esc);
    user.type_in("tstop\n");
    user.sees("set switch=stop?");
    assert_eq!(user.host.plant.devices()[0].board().switch, 0);
    user.type_in("y");
    assert_eq!(user.host.plant.devices()[0].board().switch, 1);
    let dip = line(&user, "DIP switch");
    user.click(4, dip);
    user.type_in("t21\ny");
    user.sees("number 21");
}

#[test]
fn a_selected_interval_stays_while_the_clock_runs() {
    let mut user = User::at(TestHost::of(&PlantConfig::built_in().unwrap(), false), false);
    user.activate();
    user.type_in("4");
    let from = |user: &User| user.screen().lines().nth(2).unwrap().to_owned();
    user.host.run_to(user.host.plant.now() + 10_000);
    user.look();
    user.press(KeyCode::Left);
    user.sees(", held");
    let held = from(&user);
    user.host.run_to(user.host.plant.now() + 20_000);
    user.look();
    assert_eq!(from(&user), held);
    user.press(KeyCode::Left);
    user.press(KeyCode::Right);
    assert_eq!(from(&user), held);
    user.press(KeyCode::End);
    assert!(!user.screen().contains(", held") && from(&user) != held, "{}", user.screen());
}

#[test]
fn with_a_running_clock_the_last_complete_interval_is_shown_with_pending_records() {
    let mut user = User::at(TestHost::of(&PlantConfig::built_in().unwrap(), false), false);
    user.activate();
    user.type_in("4");
    // These times end in the middle of an interval. At their ends, the journal still counts further events in the
    // records of repeated events.
    for passes in [10_300, 30_700, 1_100, 1_900] {
        user.host.run_to(user.host.plant.now() + passes);
        user.look();
        user.sees("interval of 2 ms");
        user.sees("WRC1 is left out in this interval");
        let screen = user.screen();
        assert!(!screen.contains("no frame") && !screen.contains("\u{25b2}"), "{screen}");
        assert_eq!(screen.matches("WRC1 is left out").count(), 1, "{screen}");
    }
}

#[test]
fn a_register_of_overlaid_structures_is_found_once_by_its_address() {
    let mut user = User::built_in();
    user.type_in("/%MW3.200000");
    assert_eq!(user.screen().matches("node2.w_CPU_CONTROL").count(), 1, "{}", user.screen());
}

#[test]
fn a_long_message_is_shown_with_its_end() {
    let mut user = User::built_in();
    user.model.complain(format!("begin {} and the end", "of a message that is long ".repeat(5)));
    user.draw();
    user.sees("begin");
    user.sees("and the end");
}

#[test]
fn the_rate_is_the_number_of_changes_in_the_last_second() {
    let mut user = User::built_in();
    user.find("node2.w_CPU_CONTROL");
    user.type_in(" ");
    user.press(KeyCode::Esc);
    for value in 0..4 {
        user.poke(&[("node2.w_CPU_CONTROL", 16 + value)], 1_000);
    }
    user.look();
    user.sees(" 4/s");
    user.type_in("s2s\n");
    assert!(!user.screen().contains("/s "), "{}", user.screen());
}

#[test]
fn quitting_and_interrupting_have_different_exit_codes() {
    let mut user = User::built_in();
    user.model.press(KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL));
    assert!(user.model.quits && user.model.is_interrupted);
    let mut user = User::built_in();
    user.type_in("q");
    assert!(user.model.quits && !user.model.is_interrupted);
}

/// Returns lines of the screen that contain the name of a register of the master.
fn changes_of(user: &User, name: &str) -> Vec<String> {
    user.screen().lines().filter(|line| line.contains(name)).map(str::to_owned).collect()
}

/// The view also shows changes from the time before it was opened, as far as the journal contains them. It shows each
/// change once.
#[test]
fn changes_that_were_recorded_before_the_view_was_opened_are_shown() {
    let mut before = User::built_in();
    let fitted = before.host.plant.names().fitted(DeviceIndex(0));
    let place = NamedLocation::parse(&fitted, "node2.w_OPTION_STATUS").unwrap();
    let (offset, len) = (place.offset(), place.width().bytes());
    let follow = Op::Follow { plc: DeviceIndex(0), offset, len, keep: Keep::InJournal };
    assert_eq!(before.host.request(&[follow]), [Reply::Written]);
    before.poke(&[("node2.w_CPU_CONTROL", 0)], 1_000);
    before.poke(&[("node2.w_CPU_CONTROL", 1)], 5_000);
    let recorded = before.host.plant.journal().records().filter(|it| it.event.is::<Changed>()).count();
    assert!(recorded >= 1);
    let mut user = User::at(before.host, false);
    user.type_in("3");
    assert_eq!(changes_of(&user, "node2.w_OPTION_STATUS").len(), recorded, "{}", user.screen());
    user.sees("recorded registers");
    user.type_in("2");
    user.find("node2.w_OPTION_STATUS");
    user.type_in(" 3");
    user.sees("pinned registers");
    assert_eq!(changes_of(&user, "node2.w_OPTION_STATUS").len(), recorded, "{}", user.screen());
    user.poke(&[("node2.w_CPU_CONTROL", 0)], 5_000);
    user.look();
    let now = user.host.plant.journal().records().filter(|it| it.event.is::<Changed>()).count();
    assert_eq!(changes_of(&user, "node2.w_OPTION_STATUS").len(), now, "{}", user.screen());
}

/// A plant that starts from a snapshot has a journal without records, but its numbering continues.
#[test]
fn a_journal_that_continues_from_a_snapshot_is_shown() {
    let mut user = User::built_in();
    user.activate();
    let snapshot = user.host.plant.snapshot();
    user.host.plant.restore(&snapshot).unwrap();
    let mut user = User::at(user.host, false);
    user.type_in("34");
    user.host.run_to(user.host.plant.now() + 10_000);
    user.look();
    user.sees("interval of 2 ms");
    let before = user.host.plant.snapshot();
    user.host.run_to(user.host.plant.now() + 10_000);
    user.look();
    user.host.plant.restore(&before).unwrap();
    user.look();
    user.host.run_to(user.host.plant.now() + 4_000);
    user.look();
    user.sees("interval of 2 ms");
    assert!(!user.screen().contains("no frame"), "{}", user.screen());
}
