//! Data that survives power-off: the NOVRAM and the retain flags.

use crate::common::{Emulator, files_of, run, unique_name};
use std::time::Duration;

#[test]
fn the_novram_survives_if_it_has_a_directory() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().to_str().unwrap();
    let start = || Emulator::start(&["--clock", "stepped", "--novram", path]);
    let first = start();
    first.poke(&["ethernet_config.a_IP_ADDRESS[3]=190", "ethernet_config.d_IP_CONFIG=16#12345678"]);
    first.run("stop", &[]).ok();
    let second = start();
    assert_eq!(
        second.peek(&["ethernet_config.a_IP_ADDRESS[3]", "ethernet_config.d_IP_CONFIG"]),
        "16#BE 16#12345678"
    );
    let without = Emulator::stepped();
    assert_eq!(without.peek(&["ethernet_config.d_IP_CONFIG"]), "16#00000000");
}

/// Any program of the user may remove or damage the file between the last write and the end.
#[test]
fn the_novram_is_written_at_the_end_although_its_file_was_damaged() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().to_str().unwrap();
    let start = || Emulator::start(&["--clock", "stepped", "--novram", path]);
    let file = directory.path().join("line.novram");
    let first = start();
    first.poke(&["ethernet_config.a_IP_ADDRESS[3]=190", "ethernet_config.d_IP_CONFIG=16#12345678"]);
    first.run("stop", &[]).ok();
    let kept = std::fs::read(&file).unwrap();
    let damages: [&dyn Fn(); 4] = [
        &|| std::fs::remove_file(&file).unwrap(),
        &|| std::fs::File::options().write(true).open(&file).unwrap().set_len(20).unwrap(),
        &|| std::fs::write(&file, "something else").unwrap(),
        &|| std::fs::remove_dir_all(directory.path()).unwrap(),
    ];
    for damage in damages {
        let emulator = start();
        damage();
        emulator.run("stop", &[]).ok();
        assert_eq!(std::fs::read(&file).unwrap(), kept);
    }
    let emulator = start();
    std::fs::remove_file(&file).unwrap();
    std::fs::create_dir_all(file.join("in the way")).unwrap();
    let lost = emulator.run("stop", &[]);
    assert!(lost.fails(1).contains("could not write NOVRAM"), "{}", lost.err);
}

/// The flags are in the image, at the byte that its header names.
#[test]
fn retain_flags_survive_if_they_have_a_directory() {
    use commram::memory::header::Start;
    use commram::memory::{AttachMode, Attached, Image, Width};
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().to_str().unwrap();
    let start = || Emulator::start(&["--clock", "stepped", "--novram", path]);
    let attach = |emulator: &Emulator| -> Attached {
        Image::attach(&emulator.name, "line", AttachMode::ReadWrite, None).unwrap()
    };
    let flag = |image: &Attached| image.header().unwrap().retain_offset.load() + 19_996;
    let loaded = |image: &Attached| {
        let program = &image.header().unwrap().program;
        program.state.store(1);
        let asked = program.start.rings();
        image.ring().unwrap();
        image
            .wait_until("start", Duration::from_secs(60), |_| (program.start.rings() != asked).then_some(()))
            .unwrap();
        Start::from_code(program.start_kind.load()).unwrap()
    };
    let mut emulator = start();
    let image = attach(&emulator);
    assert_eq!(loaded(&image), Start::Cold, "nothing was kept");
    image.segment().store(flag(&image), Width::Dword, 0x1234_5678).unwrap();
    emulator.run("stop", &[]).ok();
    emulator.wait();
    let emulator = start();
    let image = attach(&emulator);
    assert_eq!(image.segment().load(flag(&image), Width::Dword).unwrap(), 0x1234_5678);
    assert_eq!(loaded(&image), Start::Warm);
}

/// A user with write permission for the directory could set any flags of the PLC, or make it read the target of a link.
#[test]
fn a_novram_directory_that_others_can_write_to_is_refused() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let parent = tempfile::tempdir().unwrap();
    let (name, path) = (unique_name(), parent.path().join("novram"));
    std::fs::create_dir(&path).unwrap();
    for mode in [0o1777, 0o777, 0o702, 0o775] {
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
        let outcome = run(&["run", "-i", &name, "--novram", path.to_str().unwrap()]);
        let expected = format!("others can write to this directory (mode {mode:o})");
        let message = outcome.fails(1);
        assert!(message.contains(&expected) && message.contains("chmod go-w"), "{message}");
        assert_eq!(
            std::fs::metadata(&path).unwrap().mode() & 0o7777,
            mode,
            "the user's own is left as it is"
        );
    }
    assert_eq!(std::fs::read_dir(&path).unwrap().count(), 0);
    assert!(files_of(&name).is_empty());
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    Emulator::start(&["--clock", "stepped", "--novram", path.to_str().unwrap()]).run("stop", &[]).ok();
}

#[test]
fn a_novram_directory_that_cannot_be_used_is_an_error() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let name = unique_name();
    let outcome = run(&["run", "-i", &name, "--novram", file.path().to_str().unwrap()]);
    assert!(outcome.fails(1).contains("--novram needs a writable directory"), "{}", outcome.err);
    assert!(files_of(&name).is_empty());
}

/// In a plant with several devices, each device stores its own data. A b maXX PLC has none, so it gets no file.
#[test]
fn devices_without_novram_get_no_file() {
    let directory = tempfile::tempdir().unwrap();
    let plant = directory.path().join("plant.toml");
    let text = "[[device]]\nkind = 'bm4-plc'\nname = 'maxx'\n[[plc]]\nname = 'omega'\n[[bus]]\nname = 'b'\n";
    std::fs::write(&plant, text).unwrap();
    let novram = directory.path().join("novram");
    let arguments = [plant.to_str().unwrap(), "--clock", "stepped", "--novram", novram.to_str().unwrap()];
    let mut emulator = Emulator::start(&arguments);
    emulator.poke(&["omega:ethernet_config.d_ROUTER=16#4E6F5F52"]);
    emulator.run("stop", &[]).ok();
    assert_eq!(emulator.wait().code(), Some(0));
    let files = std::fs::read_dir(&novram).unwrap().map(|file| file.unwrap().file_name());
    assert_eq!(
        files.filter(|file| file.to_str().unwrap().ends_with("novram")).collect::<Vec<_>>(),
        ["omega.novram"]
    );
    let emulator = Emulator::start(&arguments);
    assert_eq!(emulator.peek(&["omega:ethernet_config.d_ROUTER"]), "16#4E6F5F52");
}

/// A start that is refused removes what it has made, and nothing else.
#[test]
fn a_refused_start_leaves_the_novram_directory_as_it_was() {
    let place = tempfile::tempdir().unwrap();
    let (new, empty, used) =
        (place.path().join("new"), place.path().join("empty"), place.path().join("used"));
    std::fs::create_dir(&empty).unwrap();
    std::fs::create_dir(&used).unwrap();
    std::fs::write(used.join("line.novram.bad-1"), "").unwrap();
    for novram in [new.join("inner"), empty.clone(), used.clone()] {
        let name = unique_name();
        let path = novram.to_str().unwrap();
        let refused =
            run(&["run", "--clock", "stepped", "-i", &name, "--novram", path, "--record", "node2.none"]);
        assert!(refused.fails(2).contains("none"), "{}", refused.err);
        assert!(files_of(&name).is_empty());
    }
    assert!(!new.exists());
    assert_eq!(std::fs::read_dir(&empty).unwrap().count(), 0);
    assert!(used.join("line.novram.bad-1").exists());
}
