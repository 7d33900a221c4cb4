//! The emulator's main loop.
//!
//! One thread does it all: it lets emulated time pass, answers rung doorbells and channel requests, and
//! sleeps on the doorbells until the next event is due. The order "note the rings, look at everything,
//! sleep unless it rang since" makes sure that nothing is slept through.

use super::clock::{Clock, WallClock};
use crate::layout::omega_drive_line_2 as device;
use crate::memory::{ClockMode, Image, ImageSpec, MemoryError, bell};
use crate::plant::{Plant, PlantConfig, PlantError};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use thiserror::Error;

/// Longest sleep; a bound for everything that does not ring.
const LONGEST_SLEEP: Duration = Duration::from_millis(100);

/// How an emulator is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Name of the instance.
    pub instance: String,
    /// Its clock.
    pub clock: Clock,
    /// Poll instead of sleeping: answers clients that only store, at the price of a processor core.
    pub busy: bool,
}

/// Why an emulator cannot run.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// Image file trouble.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The plant is refused.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A speed factor out of range.
    #[error("speed {speed}: must be {} to {}", Clock::SLOWEST, Clock::FASTEST)]
    Speed {
        /// The factor.
        speed: f64,
    },
}

/// Ends a running emulator from another thread.
#[derive(Clone)]
pub struct StopHandle {
    stop: Arc<AtomicBool>,
    doorbell: crate::memory::View<crate::memory::Header>,
}

impl StopHandle {
    /// Asks the emulator to end; it does so within its present step.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Release);
        self.doorbell.doorbell.ring();
    }
}

/// A plant on image files.
pub struct Emulator {
    pub(super) plant: Plant,
    pub(super) options: Options,
    pub(super) stop: Arc<AtomicBool>,
    images: Vec<Image>,
    #[cfg(feature = "channel")]
    server: Option<crate::channel::Server>,
    #[cfg(feature = "channel")]
    pub(super) registers: super::machine::RegisterWidths,
}

impl Emulator {
    /// Creates the image files and powers the plant on. If the channel cannot be had, the emulator runs
    /// without it and says so in the log; mapped clients do not need it.
    ///
    /// # Errors
    /// [`RuntimeError`]: another emulator has the instance, a file is in the way, the plant is refused.
    pub fn start(config: &PlantConfig, options: Options) -> Result<Self, RuntimeError> {
        let speed = match options.clock {
            Clock::Stepped => 0.0,
            Clock::RealTime { speed } if (Clock::SLOWEST..=Clock::FASTEST).contains(&speed) => speed,
            Clock::RealTime { speed } => return Err(RuntimeError::Speed { speed }),
        };
        let spec = ImageSpec {
            layout_hash: device::LAYOUT_HASH,
            device: "Omega Drive-Line II".to_owned(),
            clock: if options.clock.is_stepped() { ClockMode::Stepped } else { ClockMode::RealTime },
            speed_permille: (speed * 1000.0) as u32,
            processor_cycle_us: config.processor_cycle_us,
        };
        let mut images = Vec::with_capacity(config.plcs.len());
        let plant = Plant::new(config, |plc| {
            let image = Image::create(&options.instance, plc, &spec)?;
            let segment = image.segment().clone();
            images.push(image);
            Ok::<_, RuntimeError>(segment)
        })?;
        #[cfg(feature = "channel")]
        let server = open_channel(&options.instance, &images);
        images.iter().for_each(Image::set_ready);
        Ok(Emulator {
            plant,
            options,
            stop: Arc::new(AtomicBool::new(false)),
            images,
            #[cfg(feature = "channel")]
            server,
            #[cfg(feature = "channel")]
            registers: super::machine::RegisterWidths::of_device(),
        })
    }

    /// The images, one for each PLC.
    pub fn images(&self) -> &[Image] {
        &self.images
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// A handle to end the emulator with.
    ///
    /// # Panics
    /// Never: a plant has at least one PLC.
    pub fn stop_handle(&self) -> Option<StopHandle> {
        let doorbell = self.images.first()?.header().clone();
        Some(StopHandle { stop: Arc::clone(&self.stop), doorbell })
    }

    /// Whether the emulator was asked to end.
    pub(super) fn is_stopping(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Runs until asked to end.
    pub fn run(&mut self) {
        match self.options.clock {
            Clock::Stepped => self.run_stepped(),
            Clock::RealTime { speed } => self.run_real_time(&WallClock::start(speed)),
        }
        self.images.iter().for_each(Image::set_stopping);
        self.close_channel();
    }

    fn run_stepped(&mut self) {
        while !self.is_stopping() {
            let rings = self.rings();
            if self.serve_channel() {
                self.announce();
                continue;
            }
            if !self.options.busy {
                self.sleep(&rings, LONGEST_SLEEP);
            }
        }
    }

    fn run_real_time(&mut self, clock: &WallClock) {
        let mut handled = self.rings();
        while !self.is_stopping() {
            let rings = self.rings();
            let rung = rings != handled;
            let now = clock.now();
            let due = self.plant.next_event() <= now;
            self.plant.advance_to(now);
            if rung || self.options.busy && self.plant.control_changed() {
                self.plant.processor_cycle();
            }
            handled.clone_from(&rings);
            if rung || due || self.options.busy {
                self.announce();
            }
            if self.serve_channel() || self.options.busy {
                continue;
            }
            let sleep = clock.until(self.plant.next_event()).min(LONGEST_SLEEP);
            self.sleep(&rings, sleep);
        }
    }

    /// How often each PLC's doorbell has been rung.
    fn rings(&self) -> Vec<u32> {
        self.images.iter().map(|image| image.header().doorbell.rings()).collect()
    }

    /// Sleeps until a doorbell is rung that was not in `seen`, or until `timeout`.
    fn sleep(&self, seen: &[u32], timeout: Duration) {
        let bells: Vec<_> =
            self.images.iter().map(|image| &image.header().doorbell).zip(seen.iter().copied()).collect();
        bell::wait_any(&bells, Some(timeout));
    }

    /// Tells waiting clients that registers may have changed.
    fn announce(&self) {
        self.images.iter().for_each(|image| image.header().answer.ring());
    }

    #[cfg(feature = "channel")]
    fn serve_channel(&mut self) -> bool {
        let Some(mut server) = self.server.take() else { return false };
        let served = server.poll(self);
        self.server = Some(server);
        served > 0
    }

    #[cfg(not(feature = "channel"))]
    fn serve_channel(&mut self) -> bool {
        false
    }

    #[cfg(feature = "channel")]
    fn close_channel(&mut self) {
        self.server = None;
    }

    #[cfg(not(feature = "channel"))]
    fn close_channel(&mut self) {}
}
