//! The emulator's main loop.
//!
//! One thread does it all: it lets emulated time pass, answers rung doorbells and channel requests, and
//! sleeps on the doorbells until the next event is due. The order "note the rings, look at everything,
//! sleep unless it rang since" makes sure that nothing is slept through.

#[cfg(feature = "channel")]
mod channel;

use super::clock::{Clock, WallClock};
use super::guests::Guests;
use super::lockstep::{Lockstep, NoWitness};
use super::novram::{Directory, Found, Keeper, Novram, NovramError};
use super::open_files;

use super::watch::Watch;
use crate::door::{DoorError, DoorSpec};
use crate::journal::Keep;
use crate::memory::{Header, Image, ImageSpec, InstanceLock, MemoryError, View, bell, room};
use crate::plant::{FollowError, Plant, PlantConfig, PlantError, Snapshot, SnapshotError};
use crate::request::Travel;
use core::num::NonZero;
use std::cell::Cell;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Longest sleep; a bound for everything that does not ring.
pub(super) const LONGEST_SLEEP: Duration = Duration::from_millis(100);

/// Most emulated time that passes unseen while nobody can see or store a register: whoever comes finds them that old at first.
const UNSEEN_US: u64 = 10_000;

/// Most emulated time handled in one go. After the machine was suspended there may be hours to catch up
/// with; signals and clients are heard in between.
const LONGEST_STEP_US: u64 = 100_000;
/// How many register writes a polling emulator may answer at one moment before it does anything else.
const LONGEST_CHAIN: u32 = 16;
/// How often it looks in vain for the next one behind an answer.
const LOOKS: u32 = 64;

/// How an emulator is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Name of the instance.
    pub instance: String,
    /// Its clock.
    pub clock: Clock,
    /// Poll instead of sleeping: answers clients that only store, at the price of a processor core.
    pub busy: bool,
    /// Directory that keeps the NOVRAM of the PLCs; none: it is forgotten at the end.
    pub novram: Option<PathBuf>,
    /// It will share its plant with others, by [`Emulator::join`].
    pub is_federate: bool,
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
    /// A NOVRAM file cannot be used.
    #[error(transparent)]
    Novram(#[from] NovramError),
    /// The snapshot to start from is refused.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// It cannot share its plant with others, or no longer.
    #[cfg(feature = "channel")]
    #[error(transparent)]
    Federation(#[from] crate::federation::FederationError),
    /// A door does not open.
    #[error(transparent)]
    Door(#[from] DoorError),
    /// Somebody has shortened an image while it was in use.
    #[error("{}: another program has shortened it while it was in use, so the registers are lost; nothing of them was \
             written to NOVRAM, start again", .path.display())]
    Shortened {
        /// The image.
        path: PathBuf,
    },
    /// No thread can be started.
    #[error("cannot start a thread: {reason}")]
    Thread {
        /// Why not.
        reason: std::io::Error,
    },
    /// More PLCs than this process may have files for.
    #[error(
        "{plcs} PLCs need {needed} open files, and a process may have {most}: raise that (`ulimit -Hn {needed}` as root)"
    )]
    OpenFiles {
        /// How many PLCs.
        plcs: usize,
        /// Files that they need.
        needed: u64,
        /// Files that there may be.
        most: u64,
    },
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
    header: View<Header>,
}

impl StopHandle {
    /// Asks the emulator to end; it does so within its present step.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Release);
        self.wake();
    }

    /// Wakes it up to look.
    pub(super) fn wake(&self) {
        self.header.doorbell.ring();
    }
}

/// A plant on image files.
pub struct Emulator {
    pub(super) plant: Plant,
    pub(super) travel: Travel,
    pub(super) options: Options,
    pub(super) stop: Arc<AtomicBool>,
    pub(super) lockstep: Lockstep,
    pub(super) guests: Guests,
    /// Since when guests have their turns, if any have.
    pub(super) turn_since: Option<Instant>,
    /// Where the way leads on which emulated time stands for others to be heard.
    pub(super) under_way: Option<u64>,
    /// Before the images: it must have written everything before another emulator can have them.
    novram: Keeper,
    /// Before the images: it looks at their files.
    watch: Watch,
    images: Vec<Image>,
    /// Rings of each PLC's doorbell as last noted.
    rings: Vec<u32>,
    /// When the channel was first asked in this round whether it is to pause.
    pub(super) slice: Cell<Option<Instant>>,
    #[cfg(feature = "channel")]
    pub(super) membership: super::federated::Membership,
    /// Before the server, on whose node it is.
    #[cfg(feature = "channel")]
    events: Option<crate::channel::EventNotifier>,
    #[cfg(feature = "channel")]
    /// In a box, because it is taken out in every round.
    server: Option<Box<crate::channel::Server>>,
    #[cfg(feature = "channel")]
    channel_watch: Option<crate::channel::ChannelWatch>,
    /// Behind the images and the server: nobody else may be this instance before they are gone.
    _lock: InstanceLock,
}

impl Emulator {
    /// Creates the image files and powers the plant on. If the channel cannot be had, the emulator runs
    /// without it and says so in the log; mapped clients do not need it.
    ///
    /// # Errors
    /// [`RuntimeError`]: another emulator has the instance, a file is in the way, the plant is refused.
    pub fn start(config: &PlantConfig, options: Options) -> Result<Self, RuntimeError> {
        Self::start_from(config, options, None)
    }

    /// As [`Emulator::start`], at a snapshot of this plant if there is one. What it says of NOVRAM counts, whatever a file has.
    ///
    /// # Errors
    /// As [`Emulator::start`], or the snapshot is refused.
    pub fn start_from(
        config: &PlantConfig,
        options: Options,
        snapshot: Option<&Snapshot>,
    ) -> Result<Self, RuntimeError> {
        if let Clock::RealTime { speed } = options.clock
            && !(Clock::SLOWEST..=Clock::FASTEST).contains(&speed)
        {
            return Err(RuntimeError::Speed { speed });
        }
        let lock = take_instance(config, &options.instance)?;
        let sizes = config.devices.iter().map(|device| (device.name(), device.layout().segment_size()));
        room::check(&options.instance, sizes)?;
        open_files::allow(config.devices.len())?;
        let mut images = Vec::with_capacity(config.devices.len());
        let mut directory = None;
        let mut novram = Vec::new();
        let mut plant = Plant::new(config, |plc, device| {
            let spec = ImageSpec {
                device,
                clock_mode: options.clock.mode(),
                speed: options.clock.speed_permille(),
                processor_cycle_us: config.processor_cycle_us,
            };
            let image = Image::create(&options.instance, plc, &spec)?;
            let segment = image.segment().clone();
            let segment = if options.is_federate { segment.asked_apart() } else { segment };
            images.push(image);
            if let (Some(path), Some(of)) = (&options.novram, config.device(plc)) {
                // After the first image: who starts an instance twice is told so, not that the directory is in use.
                let directory = match &mut directory {
                    Some(directory) => directory,
                    none => none.insert(Directory::open(path)?),
                };
                let content = Novram::power_on(directory, of, &segment)?;
                if let Some((_, Found::SetAside(path))) = &content {
                    tracing::warn!("damaged NOVRAM of {plc}: kept as {}", path.display());
                }
                novram.push(content.map(|(novram, _)| novram));
            }
            Ok::<_, RuntimeError>(segment)
        })?;
        if let Some(snapshot) = snapshot {
            plant.restore(snapshot)?;
        }
        #[cfg(feature = "channel")]
        let server = Self::open_channel(&options.instance, &images);
        #[cfg(feature = "channel")]
        let events = server.as_ref().and_then(|server| {
            let notifier = server.event_notifier(&options.instance, &plant.names().plcs);
            notifier.inspect_err(|error| tracing::error!("no event services: {error}")).ok()
        });
        let novram = Keeper::new(directory, novram).map_err(|reason| RuntimeError::Thread { reason })?;
        let headers = images.iter().map(|image| image.header().clone()).collect();
        let lockstep = Lockstep::new(headers, options.clock.is_stepped());
        let rings = vec![0; images.len()];
        images.iter().for_each(Image::set_ready);
        // `Plant::new` refuses a plant without a PLC.
        let bell = images[0].header().clone();
        let guests = Guests::new(config, move || bell.doorbell.ring())?;
        let stop = StopHandle { stop: Arc::default(), header: images[0].header().clone() };
        // Behind the event services, whose memory is to be watched as well.
        #[cfg(feature = "channel")]
        let channel_watch = server.as_ref().map(|server| server.watch());
        let watch = Watch::start(
            images.iter().map(Image::watch).collect(),
            #[cfg(feature = "channel")]
            channel_watch.clone(),
            stop.clone(),
        )
        .map_err(|reason| RuntimeError::Thread { reason })?;
        Ok(Emulator {
            rings,
            slice: Cell::default(),
            #[cfg(feature = "channel")]
            membership: super::federated::Membership::default(),
            lockstep,
            guests,
            turn_since: None,
            under_way: None,
            novram,
            plant,
            travel: Travel::default(),
            options,
            stop: stop.stop,
            watch,
            images,
            _lock: lock,
            #[cfg(feature = "channel")]
            events,
            #[cfg(feature = "channel")]
            server,
            #[cfg(feature = "channel")]
            channel_watch,
        })
    }

    /// The images, one for each PLC.
    pub fn images(&self) -> &[Image] {
        &self.images
    }

    /// The doors that are open, each with the name of its bus.
    pub fn doors(&self) -> Vec<(&str, DoorSpec)> {
        let media = self.plant.media().iter().enumerate();
        let of_bus = |bus: usize| self.guests.open_doors(bus as u16).into_iter();
        media.flat_map(|(bus, medium)| of_bus(bus).map(|door| (medium.name(), door.door))).collect()
    }

    /// Keeps so many bytes of snapshots of the way, with a stepped clock; 0: none.
    pub fn keep_states(&mut self, bytes: usize) {
        self.travel = Travel::new(bytes);
    }

    /// Lets so many cores work at the plant.
    pub fn set_cores(&mut self, count: NonZero<usize>) {
        self.plant.set_cores(count);
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Keeps every change from now on of the registers that `len` bytes from `offset` on of PLC `plc` meet, in the journal.
    ///
    /// # Errors
    /// As [`Plant::follow_registers`].
    pub fn keep_changes(&mut self, plc: u16, offset: u32, len: u32) -> Result<(), FollowError> {
        self.plant.follow_registers(plc.into(), offset, len, Keep::InJournal)
    }

    /// A handle to end the emulator with.
    pub fn stop_handle(&self) -> StopHandle {
        StopHandle { stop: Arc::clone(&self.stop), header: self.header().clone() }
    }

    /// The header page that speaks for the whole instance: that of the first PLC.
    pub(super) fn header(&self) -> &View<Header> {
        // `Plant::new` refuses a plant without a PLC.
        self.images[0].header()
    }

    /// Another process that can write to registers, for people.
    pub(super) fn mapped_client(&self) -> Option<String> {
        let writer = self.images.iter().find_map(|image| image.writers().into_iter().next())?;
        Some(format!("{writer}, which has mapped the registers,"))
    }

    /// Whether the emulator was asked to end.
    pub(super) fn is_stopping(&self) -> bool {
        self.stop.load(Ordering::Acquire) || self.shortened().is_some()
    }

    /// The first image that somebody has shortened.
    fn shortened(&self) -> Option<&Image> {
        self.images.iter().find(|image| image.was_shortened())
    }

    /// Runs until asked to end.
    ///
    /// # Errors
    /// [`RuntimeError::Federation`]: another federate, or the way there, has failed.
    /// [`RuntimeError::Novram`]: what has changed in NOVRAM could not be written; everything else ended in good order.
    pub fn run(&mut self) -> Result<(), RuntimeError> {
        let outcome = match self.options.clock {
            #[cfg(feature = "channel")]
            Clock::Stepped if self.membership.federation.is_some() => self.run_federated(),
            Clock::Stepped => {
                self.run_stepped();
                Ok(())
            }
            Clock::RealTime { speed } => {
                // The default of 50 us would make each SYNC edge that much later. Without it, it is later.
                let _ = rustix::thread::set_current_timer_slack(core::num::NonZeroU64::new(1));
                let clock = WallClock::start(speed);
                let epoch = clock.epoch_ns();
                self.images.iter().for_each(|image| image.header().real_epoch_ns.store(epoch));
                self.run_real_time(&clock);
                Ok(())
            }
        };
        self.images.iter().for_each(Image::set_stopping);
        // Ahead of the channel: a program that has damaged that one can get us killed when we leave it.
        let saved = self.close_novram();
        if saved.is_err() && self.options.novram.is_some() {
            self.images.iter_mut().for_each(Image::set_unsaved);
        }
        self.close_channel();
        outcome.and(saved)
    }

    /// Writes NOVRAM a last time, unless registers were lost.
    fn close_novram(&mut self) -> Result<(), RuntimeError> {
        let lost = |emulator: &Self| {
            let path = emulator.shortened().map(|image| image.path().to_owned());
            path.map_or(Ok(()), |path| Err(RuntimeError::Shortened { path }))
        };
        // Perhaps nobody has touched the part that is missing.
        for image in &self.images {
            let _ = image.watch().look();
        }
        lost(self)?;
        self.plant.keep_novram();
        self.save_novram(true);
        self.novram.close()?;
        // Perhaps it went missing meanwhile.
        lost(self)
    }

    fn run_stepped(&mut self) {
        while !self.is_stopping() {
            self.look_at_rings();
            self.save_novram(false);
            if self.serve_channel() {
                self.announce();
            } else if !self.options.busy && !self.is_time_passing() {
                self.sleep(LONGEST_SLEEP);
            }
        }
    }

    fn run_real_time(&mut self, clock: &WallClock) {
        while !self.is_stopping() {
            let rung = self.note_rings();
            let now = clock.now().min(self.plant.now() + LONGEST_STEP_US);
            let due = self.plant.next_event() <= now;
            let look = rung || self.options.busy && self.plant.control_changed();
            if due {
                self.plant.advance_to(now);
            } else {
                self.plant.pass_to(now);
            }
            if look {
                self.plant.processor_cycle();
                if self.options.busy {
                    self.answer_on();
                }
                self.lockstep.look(&mut self.plant, &mut NoWitness);
            }
            self.guests.tell(&self.plant);
            self.guests.grant(self.plant.now());
            self.guests.enter(&mut self.plant, false);
            if look || due {
                self.announce();
                self.tell_events();
            }
            self.save_novram(false);
            if self.serve_channel() {
                // A write through the channel is as good as a ring.
                self.plant.processor_cycle();
                self.announce();
            } else if !self.options.busy {
                self.sleep(clock.until(self.next_seen()).min(LONGEST_SLEEP));
            }
        }
    }

    /// Who polls mostly writes again at once: the next answers come before the rest, at the same moment (decision D-583).
    fn answer_on(&mut self) {
        for _ in 0..LONGEST_CHAIN {
            self.announce();
            if !(0..LOOKS).any(|_| self.plant.control_changed()) {
                return;
            }
            self.plant.processor_cycle();
        }
    }

    /// In real time: when something is due that somebody may see, or see to.
    fn next_seen(&self) -> u64 {
        let next = self.plant.next_event();
        let is_seen = !self.watch.is_alone() || self.is_listened_to() || self.guests.are_present();
        let next = if is_seen { next } else { next.max(self.plant.now() + UNSEEN_US) };
        next.min(self.guests.next_turn())
    }

    /// With a stepped clock: what the boards are asked for needs no time to pass; everything else is seen when it does.
    pub(super) fn look_at_rings(&mut self) {
        if self.note_rings() {
            self.guests.look(&mut self.plant);
            let (boards, tasks) =
                (self.plant.look_at_boards(), self.lockstep.look(&mut self.plant, &mut NoWitness));
            if boards || tasks {
                self.travel.touch();
                self.announce();
            }
        }
    }

    /// Notes how often each PLC's doorbell has been rung; tells whether one was rung since last time.
    pub(super) fn note_rings(&mut self) -> bool {
        let mut rung = false;
        for (noted, image) in self.rings.iter_mut().zip(&self.images) {
            let rings = image.header().doorbell.rings();
            rung |= core::mem::replace(noted, rings) != rings;
        }
        rung
    }

    /// Sleeps until a doorbell is rung again, or until `timeout`.
    pub(super) fn sleep(&self, timeout: Duration) {
        if let ([image], [rings]) = (&self.images[..], &self.rings[..]) {
            image.header().doorbell.wait(*rings, Some(timeout));
            return;
        }
        let bells: Vec<_> = self
            .images
            .iter()
            .map(|image| &image.header().doorbell)
            .zip(self.rings.iter().copied())
            .collect();
        bell::wait_any(&bells, Some(timeout));
    }

    /// Writes NOVRAM that has changed.
    fn save_novram(&mut self, last: bool) {
        let (devices, images) = (self.plant.devices(), &self.images);
        let is_lost = |plc: usize| images.get(plc).is_some_and(Image::was_shortened);
        let stored = |plc: usize| Some(devices.get(plc).filter(|_| !is_lost(plc))?.novram());
        self.novram.save(stored, last);
    }

    /// Tells waiting clients that registers may have changed.
    pub(super) fn announce(&self) {
        self.images.iter().for_each(|image| image.header().answer.ring());
    }
}

/// Without the channel there is nobody to serve.
#[cfg(not(feature = "channel"))]
impl Emulator {
    fn serve_channel(&mut self) -> bool {
        false
    }

    fn is_time_passing(&self) -> bool {
        false
    }

    fn is_listened_to(&self) -> bool {
        false
    }

    pub(super) fn tell_events(&mut self) {}

    fn close_channel(&mut self) {}
}

/// Takes the instance, and removes the images of PLCs that a killed emulator had and this one has not.
fn take_instance(config: &PlantConfig, instance: &str) -> Result<InstanceLock, MemoryError> {
    let lock = InstanceLock::take(instance)?;
    match lock.remove_dead(|plc| config.devices.iter().any(|own| own.name() == plc)) {
        Err(error @ MemoryError::AlreadyRunning { .. }) => Err(error),
        Err(error) => {
            tracing::warn!("{error}");
            Ok(lock)
        }
        Ok(_) => Ok(lock),
    }
}
