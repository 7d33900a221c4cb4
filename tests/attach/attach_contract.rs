//! Compiles the C client printed in `docs/reference/attach.md` and runs it on an emulator's memory. So the contract
//! contains everything that a program needs.

use commram::devices::omega_drive_line_2::registers::DEVICE;
use commram::memory::{ClockMode, Image, ImageSpec, Width};
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
    thread,
    time::Duration,
};

const WATCHDOG: Option<Duration> = Some(Duration::from_secs(60));

/// Compiles a C program of the document, which must not cause a warning. Program 0 uses the exported header, program 1
/// does not.
fn printed(directory: &Path, number: usize) -> PathBuf {
    let contract = include_str!("../../docs/reference/attach.md");
    let code = contract.split("```c\n").nth(number + 1).and_then(|rest| rest.split("```").next()).unwrap();
    let (source, program) = (directory.join("client.c"), directory.join("client"));
    fs::write(&source, code).unwrap();
    let header = commram::export::export(&DEVICE, commram::export::Format::C, None).unwrap();
    fs::write(directory.join("commram.h"), header).unwrap();
    let compiled = Command::new("cc")
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-o"])
        .args([&program, &source])
        .output()
        .unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    program
}

/// Compiles the client without the header.
fn client(directory: &Path) -> PathBuf {
    printed(directory, 1)
}

fn image(test: &str) -> Image {
    let spec = ImageSpec {
        device: &DEVICE,
        clock_mode: ClockMode::RealTime,
        speed: 1000,
        processor_cycle_us: 1_000,
    };
    Image::create(&format!("contract-{}-{test}", std::process::id()), "plc", &spec).unwrap()
}

fn hash() -> String {
    format!("{:016X}", DEVICE.layout_hash)
}

fn run(program: &Path, image: &Path, hash: &str) -> Output {
    Command::new(program).arg(image).args([hash, "4711"]).output().unwrap()
}

fn refusal(output: &Output) -> (Option<i32>, String) {
    (output.status.code(), String::from_utf8_lossy(&output.stderr).trim().to_owned())
}

/// Runs a client on an image with a simulated firmware, which answers 16#05 with 16#04. Returns the output and the
/// values that the client sent.
fn meets(image: &Image, client: impl FnOnce() -> Output + Send) -> (Output, u32) {
    image.set_ready();
    thread::scope(|scope| {
        let firmware = scope.spawn(|| {
            let (segment, bell) = (image.segment(), &image.header().doorbell);
            loop {
                let seen = bell.rings();
                if segment.compare_exchange(200_012, Width::Byte, 0x05, 0x04).unwrap().is_ok() {
                    image.header().answer.ring();
                    return segment.load(200_052, Width::Dword).unwrap();
                }
                assert!(bell.wait(seen, WATCHDOG), "the client did not ring");
            }
        });
        let output = client();
        (output, firmware.join().unwrap())
    })
}

#[test]
fn the_printed_clients_meet_the_firmware() {
    let directory = tempfile::tempdir().unwrap();
    let bytes = image("bytes");
    let program = printed(directory.path(), 1);
    let (output, sent) = meets(&bytes, || run(&program, bytes.path(), &hash()));
    assert_eq!((refusal(&output), sent), ((Some(0), String::new()), 4711));
    let header = image("header");
    let program = printed(directory.path(), 0);
    let (output, sent) =
        meets(&header, || Command::new(&program).arg(header.path()).arg("4712").output().unwrap());
    assert_eq!((refusal(&output), sent), ((Some(0), String::new()), 4712));
}

#[test]
fn the_printed_client_refuses_an_unsuitable_image() {
    let directory = tempfile::tempdir().unwrap();
    let program = client(directory.path());
    let image = image("refuses");
    let path = image.path().to_owned();
    let refused = |hash: &str| refusal(&run(&program, &path, hash));
    assert_eq!(refused(&hash()), (Some(2), "the emulator is not ready or dead".to_owned()));
    image.set_ready();
    assert_eq!(refused("1"), (Some(2), "other register map".to_owned()));
    image.header().abi_version.store(1);
    assert_eq!(
        refused(&hash()),
        (
            Some(2),
            "the image has ABI version 1, this program knows 3; use a client of that version".to_owned()
        )
    );
    drop(image);
    assert_eq!(refused(&hash()), (Some(2), "no image there".to_owned()));
}

#[test]
fn the_printed_client_gives_up_when_the_emulator_ends() {
    let directory = tempfile::tempdir().unwrap();
    let program = client(directory.path());
    let image = image("ends");
    image.set_ready();
    let seen = image.header().doorbell.rings();
    let path = image.path().to_owned();
    thread::scope(|scope| {
        let client = scope.spawn(|| run(&program, &path, &hash()));
        assert!(image.header().doorbell.wait(seen, WATCHDOG), "the client did not ring");
        drop(image);
        assert_eq!(client.join().unwrap().status.code(), Some(1));
    });
}
