//! An emulator in a child process, and functions to attach and connect to it.

use super::child::{Child, when_parent_ends};
use super::{PATIENCE, cpu};
use commram::channel::client::Patience;
use commram::channel::{Client, HeaderBells};
use commram::devices::omega_drive_line_2::registers::LAYOUT_HASH;
use commram::memory::names::channel_root;
use commram::memory::{AttachMode, Attached, Image, MemoryError};
use commram::plant::PlantConfig;
use commram::runtime::{Clock, Emulator, Options};
use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Role of the child process that runs the emulator.
pub(crate) const ROLE: &str = "emulator";
/// The only PLC of the built-in plant.
pub(crate) const PLC: &str = "line";
/// Slave numbers of the drives of the built-in plant.
pub(crate) const DRIVES: RangeInclusive<u8> = 1..=3;

/// Options of the emulator.
#[derive(Clone, Copy)]
pub(crate) struct EmulatorOptions {
    /// Real time or stepped.
    pub clock: Clock,
    /// True if the emulator polls instead of sleeping.
    pub busy: bool,
    /// Processor on which the emulator runs.
    pub cpu: usize,
}

/// Runs the built-in plant in the child process until the parent ends.
pub(crate) fn play(args: &[String]) {
    let [instance, clock, waiting, processor] = args else { panic!("emulator: wrong arguments {args:?}") };
    cpu::pin(processor.parse().expect("the number of a processor"));
    let clock = if clock == "stepped" { Clock::Stepped } else { Clock::RealTime { speed: 1.0 } };
    let options = Options {
        instance: instance.clone(),
        clock,
        busy: waiting == "busy",
        novram: None,
        is_federate: false,
    };
    let plant = PlantConfig::built_in().expect("the built-in plant is a good one");
    let mut emulator = Emulator::start(&plant, options).expect("the emulator starts");
    let stop = emulator.stop_handle();
    when_parent_ends(move || stop.stop());
    emulator.run().expect("without NOVRAM nothing can be lost");
}

/// Returns an instance name that no other run has.
pub(crate) fn unique_instance() -> String {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    format!("bench-{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed))
}

/// A running emulator. It ends when this value is dropped.
pub(crate) struct Remote {
    // This field is dropped first, so that the client detaches before the emulator ends.
    attached: Attached,
    instance: String,
    child: Child,
}

impl Remote {
    /// Starts an emulator and attaches to it.
    pub(crate) fn start(how: EmulatorOptions) -> Self {
        let instance = unique_instance();
        let clock = if how.clock.is_stepped() { "stepped" } else { "realtime" };
        let waiting = if how.busy { "busy" } else { "sleeping" };
        let mut child = Child::play(&[ROLE, &instance, clock, waiting, &how.cpu.to_string()]);
        let start = Instant::now();
        let attached = loop {
            match attach(&instance) {
                Ok(attached) => break attached,
                Err(error) => assert!(start.elapsed() < PATIENCE, "{error}"),
            }
            child.check();
            std::thread::sleep(Duration::from_millis(1));
        };
        Remote { attached, instance, child }
    }

    /// Returns the mapped image.
    pub(crate) fn attached(&self) -> &Attached {
        &self.attached
    }

    /// Detaches from the image; the emulator continues.
    pub(crate) fn into_child(self) -> Child {
        self.child
    }

    /// Returns the process of the emulator.
    pub(crate) fn child(&self) -> &Child {
        &self.child
    }

    /// Connects to the channel. The client polls for a reply for the time `spin` before it sleeps.
    pub(crate) fn connect(&self, spin: Duration) -> Client {
        connect(&self.instance, spin)
    }
}

/// Attaches to the image of a ready emulator of the built-in plant.
///
/// # Errors
/// The emulator is not ready.
pub(crate) fn attach(instance: &str) -> Result<Attached, MemoryError> {
    Image::attach(instance, PLC, AttachMode::ReadWrite, Some(LAYOUT_HASH))
}

/// Connects to the channel of a ready emulator.
pub(crate) fn connect(instance: &str, spin: Duration) -> Client {
    let bells = HeaderBells::of_client(attach(instance).expect("the emulator is ready"));
    let patience = Patience { connect: PATIENCE, spin, ..Patience::default() };
    let root = channel_root(instance).expect("the instance's name is a good one");
    Client::connect(instance, &root, Box::new(bells.expect("attached for writing")), patience)
        .expect("the emulator has a channel")
}
