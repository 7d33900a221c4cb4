//! Image files that other programs change during use, and a full `/dev/shm`.

use crate::common::{Emulator, eventually, in_mount_namespace, unique_name};
use std::fs::File;

fn image(emulator: &Emulator) -> String {
    format!("/dev/shm/commram.{}.line", emulator.name)
}

/// An access to the removed part would kill the emulator without a message.
#[test]
fn a_shortened_image_ends_the_emulator_with_a_message() {
    for (clock, size) in [("stepped", 0), ("stepped", 200_000), ("realtime", 0), ("realtime", 200_000)] {
        let mut emulator = Emulator::start(&["--clock", clock]);
        let file = File::options().write(true).open(image(&emulator)).unwrap();
        file.set_len(size).unwrap();
        assert_eq!(emulator.wait().code(), Some(1), "{clock} {size}");
        let complaints = emulator.complaints();
        assert!(complaints.contains("another program has shortened it"), "{complaints}");
        assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
    }
}

/// The emulator receives the request to end before it has accessed the missing part, and before the watch has checked
/// the image.
#[test]
fn a_stop_right_after_the_damage_still_reports_it() {
    let directory = tempfile::tempdir().unwrap();
    let mut emulator =
        Emulator::start(&["--clock", "stepped", "--novram", directory.path().to_str().unwrap()]);
    File::options().write(true).open(image(&emulator)).unwrap().set_len(200_000).unwrap();
    emulator.signal("-TERM");
    assert_eq!(emulator.wait().code(), Some(1));
    assert!(emulator.complaints().contains("another program has shortened it"));
    assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
}

/// The lost part reads as zeros. The emulator must not write these zeros to NOVRAM, so the file keeps its previous
/// content.
#[test]
fn nothing_of_a_shortened_image_gets_into_novram() {
    use commram::devices::omega_drive_line_2::registers::RETAIN;
    use commram::memory::{AttachMode, Image, Width};
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().to_str().unwrap();
    let start = || Emulator::start(&["--clock", "stepped", "--novram", path]);
    let attach =
        |emulator: &Emulator| Image::attach(&emulator.name, "line", AttachMode::ReadWrite, None).unwrap();
    let flag = RETAIN;
    let mut emulator = start();
    attach(&emulator).segment().store(flag, Width::Dword, 0x1234_5678).unwrap();
    let novram = directory.path().join("line.novram");
    assert!(eventually(|| novram.exists()), "it is written once a second");
    File::options().write(true).open(image(&emulator)).unwrap().set_len(0).unwrap();
    assert_eq!(emulator.wait().code(), Some(1));

    // The process gives the file its length back before the emulator accesses it. The header page is intact.
    let mut emulator = start();
    let file = File::options().write(true).open(image(&emulator)).unwrap();
    let length = file.metadata().unwrap().len();
    attach(&emulator).segment().store(flag, Width::Dword, 5).unwrap();
    file.set_len(4096).unwrap();
    file.set_len(length).unwrap();
    let stopped = emulator.run("stop", &[]);
    assert!(matches!(stopped.code, Some(1 | 3)), "{stopped:?}");
    assert_eq!(emulator.wait().code(), Some(1));
    let emulator = start();
    assert_eq!(attach(&emulator).segment().load(flag, Width::Dword).unwrap(), 0x1234_5678);
}

#[test]
fn a_longer_image_is_reported_and_the_emulator_continues() {
    let mut emulator = Emulator::stepped();
    File::options().write(true).open(image(&emulator)).unwrap().set_len(4_000_000).unwrap();
    assert_eq!(emulator.step(&["5ms"]), "0.005000 s");
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0001");
    emulator.run("stop", &[]).ok();
    assert_eq!(emulator.wait().code(), Some(0));
    let complaints = emulator.complaints();
    assert!(complaints.contains("another program has made it longer (4000000 bytes)"), "{complaints}");
}

#[test]
fn a_removed_image_is_reported_and_attached_programs_continue() {
    use commram::memory::{AttachMode, Image, Width};
    let mut emulator = Emulator::start(&[]);
    let attached = Image::attach(&emulator.name, "line", AttachMode::ReadWrite, None).unwrap();
    std::fs::remove_file(image(&emulator)).unwrap();
    let within = std::time::Duration::from_secs(60);
    attached.post(200_000, Width::Word, 1).unwrap();
    attached.wait_register(200_002, Width::Word, within, |status| status == 2).unwrap();
    let outcome = emulator.run("peek", &["node2.w_OPTION_STATUS"]);
    let pid = emulator.pid();
    assert!(
        outcome.fails(3).contains(&format!("runs (process {pid}), but its images were removed")),
        "{}",
        outcome.err
    );
    let again = emulator.run("run", &["--clock", "stepped"]);
    assert!(again.fails(1).contains("is already running"), "{}", again.err);
    emulator.run("stop", &[]).ok();
    assert_eq!(emulator.wait().code(), Some(0));
    let complaints = emulator.complaints();
    assert!(complaints.contains("another program has removed it"), "{complaints}");
    assert_eq!(emulator.files(), Vec::<std::path::PathBuf>::new());
}

/// Runs a shell script with a separate `/dev/shm` of `size`. Prints a note and returns `None` if the machine cannot
/// provide one.
fn with_small_shm(size: &str, script: &str) -> Option<crate::common::Outcome> {
    let shell = format!("mount -t tmpfs -o size={size},mode=1777 tmpfs /dev/shm || exit 77\n{script}");
    in_mount_namespace(&shell, Some(&unique_name()))
}

/// Starts an emulator, runs `then`, and ends the emulator.
fn while_running(then: &str) -> String {
    format!(
        "$COMMRAM run --clock stepped >/tmp/$COMMRAM_INSTANCE & pid=$!
        until grep -q ready /tmp/$COMMRAM_INSTANCE || ! kill -0 $pid; do sleep 0.01; done
        rm /tmp/$COMMRAM_INSTANCE
        {then}
        $COMMRAM stop; wait $pid; echo ended with $?; ls /dev/shm"
    )
}

#[test]
fn an_image_without_enough_memory_is_refused_with_the_needed_size() {
    let Some(outcome) = with_small_shm("2m", "$COMMRAM run; code=$?; ls /dev/shm; exit $code") else {
        return;
    };
    let message = outcome.fails(1);
    assert!(
        message.contains("no room for an image of 3264 KiB") && message.contains("--shm-size"),
        "{message}"
    );
}

/// If the memory is not enough for all images, no memory is allocated for any of them, because other programs need it.
#[test]
fn images_that_do_not_fit_together_are_refused_before_the_first_is_made() {
    let plant = "for plc in a b c d; do printf '[[plc]]\\nname = \"%s\"\\ndip = 0\\n' $plc; done >/tmp/$COMMRAM_INSTANCE";
    let script = format!(
        "{plant}; $COMMRAM run /tmp/$COMMRAM_INSTANCE; code=$?; rm /tmp/$COMMRAM_INSTANCE; exit $code"
    );
    let Some(outcome) = with_small_shm("8m", &script) else { return };
    let message = outcome.fails(1);
    assert!(message.contains("no room for 4 images of 13056 KiB together"), "{message}");
}

#[test]
fn without_memory_for_the_channel_the_emulator_runs_without_it() {
    let script = while_running("$COMMRAM peek --raw node2.w_OPTION_STATUS");
    let Some(outcome) = with_small_shm("4m", &script) else { return };
    assert_eq!(outcome.out.lines().next(), Some("16#0001"), "{outcome:?}");
    assert!(
        outcome.err.contains("no channel") && outcome.err.contains("/dev/shm has only"),
        "{}",
        outcome.err
    );
    assert!(outcome.out.ends_with("ended with 0\n"), "{outcome:?}");
}

/// Such a file system reports 0 free bytes of 0.
#[test]
fn memory_without_a_limit_is_not_full() {
    let script = while_running("$COMMRAM step 1ms");
    let Some(outcome) = with_small_shm("0", &script) else { return };
    assert_eq!(outcome.out.lines().next(), Some("0.001000 s"), "{outcome:?}");
    assert!(!outcome.err.contains("no channel"), "{}", outcome.err);
}

#[test]
fn a_client_of_an_emulator_without_a_channel_learns_what_works() {
    let script = while_running(
        "for command in 'step 1ms' status 'poke node2.w_CPU_CONTROL=1'; do $COMMRAM $command; echo $?; done
        for command in 'peek --raw node2.w_OPTION_STATUS' 'dump node2' 'board get'; do
            $COMMRAM $command >/dev/null; echo $?
        done",
    );
    let Some(outcome) = with_small_shm("4m", &script) else { return };
    let message =
        "but has no channel, which this command needs; `commram peek`, `dump`, `diff` and `board get` read";
    assert_eq!(outcome.err.matches(message).count(), 3, "{outcome:?}");
    assert_eq!(outcome.err.matches("end the emulator with `commram stop -i ").count(), 3, "{outcome:?}");
    assert!(!outcome.err.contains("is not running"), "{outcome:?}");
    assert!(outcome.out.starts_with("3\n3\n3\n0\n0\n0\n"), "{outcome:?}");
}

#[test]
fn memory_that_runs_out_later_blocks_and_kills_no_process() {
    let script = while_running(
        "$COMMRAM peek --raw node2.w_OPTION_STATUS
        cat /dev/zero >/dev/shm/filler 2>/dev/null
        $COMMRAM peek --raw node2.w_OPTION_STATUS; echo peek $?
        $COMMRAM run -i late; echo run $?; ls /dev/shm | grep -c late
        rm /dev/shm/filler
        $COMMRAM poke node2.w_CPU_CONTROL=1; echo poke $?",
    );
    let Some(outcome) = with_small_shm("8m", &script) else { return };
    assert!(outcome.err.contains("a client needs"), "{outcome:?}");
    assert!(outcome.out.starts_with("16#0001\npeek 3\n") && outcome.out.contains("poke 0\n"), "{outcome:?}");
    assert!(outcome.out.contains("run 1\n0\n"), "nothing stays of one that cannot start: {outcome:?}");
    assert!(outcome.out.ends_with("ended with 0\n"), "{outcome:?}");
}
