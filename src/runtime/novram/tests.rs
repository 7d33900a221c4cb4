use super::file::{decode, encode};
use super::*;
use std::fs;

const ROUTER: u32 = ETHERNET_CONFIG as u32 + 12;
const ADDRESS: u32 = ETHERNET_CONFIG as u32 + 4;
const FLAG: u32 = RETAIN_OFFSET as u32;
const LAST_FLAG: u32 = (RETAIN_OFFSET + RETAIN_SIZE - 1) as u32;

fn content(byte: u8) -> Content {
    Content::new(&[byte; ETHERNET_SIZE], &[byte; RETAIN_SIZE])
}

#[test]
fn content_survives_power_off() {
    let directory = tempfile::tempdir().unwrap();
    let first = Segment::heap();
    let (mut novram, found) = Novram::power_on(directory.path(), "line", &first).unwrap();
    assert_eq!(found, Found::Nothing);
    let mut config = [0; ETHERNET_SIZE];
    assert_eq!(novram.changed((&config, 0), true), None, "nothing to save");
    config[4] = 192;
    config[12..].copy_from_slice(&0x4E6F_5F52_u32.to_le_bytes());
    assert_eq!(novram.changed((&config, 0), true), None, "not stored");
    first.store(FLAG, Width::Byte, 1).unwrap();
    first.store(LAST_FLAG, Width::Byte, 2).unwrap();
    let changed = novram.changed((&config, 1), false).unwrap();
    file::store(&novram.path, &changed).unwrap();
    assert_eq!(novram.changed((&config, 1), true), None, "saved already");

    let second = Segment::heap();
    let (_, found) = Novram::power_on(directory.path(), "line", &second).unwrap();
    assert_eq!(found, Found::Content { retain: true });
    for (offset, width, value) in
        [(ROUTER, Width::Dword, 0x4E6F_5F52), (ADDRESS, Width::Byte, 192), (FLAG, Width::Byte, 1)]
    {
        assert_eq!(second.load(offset, width).unwrap(), value);
    }
    assert_eq!(second.load(LAST_FLAG, Width::Byte).unwrap(), 2);
    let left: Vec<_> = fs::read_dir(directory.path()).unwrap().collect();
    assert_eq!(left.len(), 1, "no temporary file stays: {left:?}");
}

#[test]
fn retain_flags_are_looked_at_when_it_is_time() {
    let directory = tempfile::tempdir().unwrap();
    let segment = Segment::heap();
    let (mut novram, _) = Novram::power_on(directory.path(), "line", &segment).unwrap();
    segment.store(FLAG, Width::Dword, 7).unwrap();
    let config = [0; ETHERNET_SIZE];
    assert_eq!(novram.changed((&config, 0), false), None);
    let mut flags = [0; RETAIN_SIZE];
    flags[0] = 7;
    assert_eq!(novram.changed((&config, 0), true), Some(Content::new(&config, &flags)));
}

#[test]
fn a_damaged_or_foreign_file_is_set_aside() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("line.novram");
    let good = encode(&content(7));
    assert_eq!(decode(&good), Some(content(7)));
    let mut flipped = good.clone();
    flipped[20] ^= 1;
    let mut older = good.clone();
    older[8] = 1;
    let truncated = good[..good.len() - 1].to_vec();
    let bad = [flipped, older, truncated, b"something else".to_vec(), Vec::new()];
    for (n, bytes) in bad.into_iter().enumerate() {
        fs::write(&path, &bytes).unwrap();
        let segment = Segment::heap();
        let (_, found) = Novram::power_on(directory.path(), "line", &segment).unwrap();
        let aside = directory.path().join(format!("line.novram.bad-{}", n + 1));
        assert_eq!(found, Found::SetAside(aside.clone()));
        assert_eq!(fs::read(aside).unwrap(), bytes, "kept as it was");
        assert_eq!(segment.load(ROUTER, Width::Dword).unwrap(), 0);
    }
}

#[test]
fn a_directory_that_cannot_be_used_is_named() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let error = Novram::power_on(file.path(), "line", &Segment::heap()).unwrap_err().to_string();
    assert!(error.contains("line.novram") && error.contains("--novram needs"), "{error}");
}

#[test]
fn the_keeper_has_written_everything_when_it_ends() {
    let directory = tempfile::tempdir().unwrap();
    let segments = [Segment::heap(), Segment::heap()];
    let power_on = |name, segment| Novram::power_on(directory.path(), name, segment).unwrap().0;
    let novram = vec![power_on("a", &segments[0]), power_on("b", &segments[1])];
    let mut keeper = Keeper::new(novram).unwrap();
    let configs = [1, 2].map(|byte| [byte; ETHERNET_SIZE]);
    for generation in 1..50 {
        keeper.save(|plc| Some((&configs[plc], generation)), false);
    }
    segments[1].store(FLAG, Width::Byte, 9).unwrap();
    keeper.save(|plc| Some((&configs[plc], 50)), true);
    drop(keeper);
    for (name, byte, flag) in [("a", 1, 0), ("b", 2, 9)] {
        let bytes = fs::read(directory.path().join(format!("{name}.novram"))).unwrap();
        let content = decode(&bytes).unwrap();
        assert_eq!((content.ethernet()[0], content.retain()[0]), (byte, flag));
    }
}

/// A file that cannot be written does not stop anything.
#[test]
fn a_directory_that_has_gone_is_no_end() {
    let directory = tempfile::tempdir().unwrap();
    let (novram, _) = Novram::power_on(directory.path(), "line", &Segment::heap()).unwrap();
    directory.close().unwrap();
    let mut keeper = Keeper::new(vec![novram]).unwrap();
    for generation in 1..4 {
        let config = [generation as u8; ETHERNET_SIZE];
        keeper.save(|_| Some((&config, generation)), true);
    }
}

mod killed {
    //! Kills a process that writes, at random moments.

    use super::*;
    use std::io::{BufRead, BufReader};
    use std::os::unix::process::ExitStatusExt;
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    const DIRECTORY: &str = "COMMRAM_TEST_NOVRAM";
    const KILLS: u64 = 300;
    /// The child writes for this long before it is killed, at most.
    const LONGEST_US: u64 = 4_000;

    /// Not a test: what the child processes run.
    #[test]
    fn child() {
        let Some(directory) = std::env::var_os(DIRECTORY) else { return };
        let segment = Segment::heap();
        let (novram, found) = Novram::power_on(Path::new(&directory), "line", &segment).unwrap();
        assert!(!matches!(found, Found::SetAside(_)), "{found:?}");
        let first = novram.saved.ethernet()[0];
        println!("\nwriting");
        for byte in (0..=u8::MAX).cycle().skip(usize::from(first) + 1) {
            file::store(&novram.path, &content(byte)).unwrap();
        }
    }

    #[test]
    fn the_file_holds_the_old_or_the_new_content_never_a_mixture() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("line.novram");
        // The same in every run.
        let mut numbers = fastrand::Rng::with_seed(4711);
        let mut contents = std::collections::BTreeSet::new();
        for _ in 0..KILLS {
            let mut child = Command::new(std::env::current_exe().unwrap())
                .args(["--exact", "runtime::novram::tests::killed::child", "--nocapture"])
                .env(DIRECTORY, directory.path())
                .stdout(Stdio::piped())
                .spawn()
                .unwrap();
            let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
            assert!(lines.any(|line| line.unwrap() == "writing"), "the child has ended by itself");
            let (start, moment) = (Instant::now(), Duration::from_micros(numbers.u64(..LONGEST_US)));
            while start.elapsed() < moment {
                std::hint::spin_loop();
            }
            child.kill().unwrap();
            assert_eq!(child.wait().unwrap().signal(), Some(9));
            let Ok(bytes) = fs::read(&path) else { continue };
            let found = decode(&bytes).expect("whole");
            let byte = found.ethernet()[0];
            assert_eq!(found, content(byte), "no mixture");
            contents.insert(byte);
        }
        assert!(contents.len() > 10, "the kills meet different contents: {contents:?}");
        let names: Vec<_> =
            fs::read_dir(directory.path()).unwrap().map(|it| it.unwrap().file_name()).collect();
        assert!(names.iter().all(|name| name == "line.novram" || name == "line.novram.new"), "{names:?}");
    }
}
