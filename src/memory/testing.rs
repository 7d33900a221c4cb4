//! Shared fixtures of the tests of images: unique names, clean-up, and an emulator that can be
//! killed.

use super::{ClockMode, Header, Image, ImageSpec, State, Width, header, image::tests::MARK, names};
use crate::identity::PortNumber;
use crate::layout::{Area, DeviceLayout, Port, Provenance, Retain, Role, Space, Unit};
use std::{
    fs,
    io::{BufRead, BufReader, Read},
    path::PathBuf,
    process::{Child, Command, Stdio},
    sync::atomic::{AtomicU32, Ordering},
};
use zerocopy::{FromZeros, IntoBytes};

/// The name of the PLC in all tests.
pub(crate) const PLC: &str = "plc";
/// The layout hash in all tests.
pub(crate) const HASH: u64 = 0x0123_4567_89AB_CDEF;
/// Length of the memory segment in all tests.
pub(crate) const SEGMENT_SIZE: usize = test_device().segment_size();
/// The device in all tests.
pub(crate) static DEVICE: DeviceLayout = test_device();

const RAM_SPACE: Space = Space {
    name: "ram",
    letter: 'M',
    segment: "3.",
    unit: Unit::Byte,
    first: 80_000,
    offset: 80_000,
    bytes: 3_182_144,
    page: "",
    doc: "plain RAM",
};

const FLAGS: Space = Space {
    name: "flags",
    segment: "",
    first: 10_000_000,
    offset: 8192,
    bytes: 71_808,
    doc: "retain flags",
    ..RAM_SPACE
};

const RAM: Area = area("ram", &RAM_SPACE);

static RETAIN: Retain = Retain { area: area("retain", &FLAGS), default_bytes: 20_000 };

const fn area(name: &'static str, space: &'static Space) -> Area {
    Area {
        name,
        name_from: Provenance::Inferred("D-220"),
        space,
        first: space.offset,
        bytes: space.bytes,
        cpu: None,
        doc: "Plain RAM",
        page: "",
        phases: None,
        structures: &[],
    }
}

/// Returns a device of plain RAM.
pub(crate) const fn test_device() -> DeviceLayout {
    DeviceLayout {
        name: "test-device",
        title: "Test Device",
        undocumented: "",
        manual: "none",
        layout_hash: HASH,
        spaces: &[RAM_SPACE, FLAGS],
        areas: &[RAM],
        retain: Some(&RETAIN),
        objects: &[],
        gsd: None,
        front: &[],
        front_area: None,
        ports: &[Port {
            name: "end",
            number: PortNumber(1),
            medium: "wire",
            roles: &[Role::Peer],
            area: &RAM,
        }],
        own: None,
    }
}
const CHILD: &str = "COMMRAM_TEST_EMULATOR";

/// A unique instance name; its files are removed at the end.
pub(crate) struct Instance(String);

impl Instance {
    pub(crate) fn new() -> Self {
        static COUNTER: AtomicU32 = AtomicU32::new(0);
        Self(format!("test-{}-{}", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed)))
    }

    pub(crate) fn path(&self) -> PathBuf {
        names::image_path(self, PLC).unwrap()
    }

    pub(crate) fn create(&self) -> Image {
        Image::create(self, PLC, &spec()).unwrap()
    }

    pub(crate) fn create_ready(&self) -> Image {
        let image = self.create();
        image.set_ready();
        image
    }

    /// Creates the files of a killed emulator, after `damage` has changed the header.
    pub(crate) fn leave(&self, size: usize, damage: impl FnOnce(&Header)) {
        let mut header = Header::new_box_zeroed().unwrap();
        header.magic.store(header::MAGIC);
        header.abi_version.store(header::ABI_VERSION);
        header.layout_hash.store(HASH);
        header.segment_size.store(SEGMENT_SIZE as u32);
        header.generation.store(7);
        header.state.store(State::Ready.code());
        header.firmware_pid.store(u32::MAX);
        damage(&header);
        let mut bytes = header.as_mut_bytes().to_vec();
        bytes.resize(size, 0);
        fs::write(self.path(), bytes).unwrap();
    }
}

impl std::ops::Deref for Instance {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        let _ = fs::remove_file(self.path());
        let _ = fs::remove_dir(self.path());
    }
}

pub(crate) fn spec() -> ImageSpec {
    ImageSpec { device: &DEVICE, clock_mode: ClockMode::RealTime, speed: 1000, processor_cycle_us: 1_000 }
}

/// An emulator in a separate process.
pub(crate) struct Emulator(Child);

impl Emulator {
    pub(crate) fn start(instance: &Instance) -> Self {
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "memory::testing::emulator_process", "--nocapture"])
            .env(CHILD, &**instance)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut emulator = Self(child);
        let output = BufReader::new(emulator.0.stdout.take().unwrap());
        assert!(output.lines().any(|line| line.unwrap().contains("READY")), "the emulator did not start");
        emulator
    }

    pub(crate) fn pid(&self) -> u32 {
        self.0.id()
    }

    /// Sends SIGKILL, and waits for the end of the process.
    pub(crate) fn kill(mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The process of [`Emulator`], and not a real test. It reads a pipe from its parent, and ends when the parent ends.
#[test]
fn emulator_process() {
    let Ok(instance) = std::env::var(CHILD) else { return };
    let image = Image::create(&instance, PLC, &spec()).unwrap();
    image.segment().store(MARK, Width::Dword, std::process::id()).unwrap();
    image.set_ready();
    println!("READY");
    let _ = std::io::stdin().read(&mut [0]);
}
