//! Start and end of an emulator; [`rounds`] contains the main loop.

#[cfg(feature = "channel")]
mod channel;
mod rounds;

#[cfg(feature = "channel")]
pub(super) use rounds::LONGEST_SLEEP;

use super::clock::{Clock, WallClock};
use super::end::EndRequest;
use super::error::RuntimeError;
use super::guests::Guests;
use super::lockstep::Lockstep;
use super::needs;
use super::novram::{Directory, Keeper, Novram, NovramError, RestoreOutcome};
use super::slice::Slice;
use super::watch::Watch;
use crate::awake_time::AwakeTime;
use crate::door::DoorSpec;
use crate::identity::{BusIndex, DeviceIndex};
use crate::journal::Keep;
use crate::memory::{Header, Image, ImageSpec, InstanceLock, MemoryError, View, room};
use crate::plant::{FollowError, Plant, PlantConfig, Snapshot};
use crate::request::Travel;
use core::num::NonZero;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Settings of an emulator.
#[derive(Clone, Debug)]
pub struct Options {
    /// Name of the instance.
    pub instance: String,
    /// Clock of the emulator.
    pub clock: Clock,
    /// True: poll instead of sleeping. The emulator then answers stores without a ring immediately, and uses a full
    /// processor core.
    pub busy: bool,
    /// Directory for the NOVRAM of the PLCs. With `None`, NOVRAM is lost at the end.
    pub novram: Option<PathBuf>,
    /// True if the emulator will share its plant with emulators on other hosts, by [`Emulator::join`].
    pub is_federate: bool,
}

/// Ends a running emulator from another thread.
#[derive(Clone)]
pub struct StopHandle {
    stop: Arc<EndRequest>,
    header: View<Header>,
}

impl StopHandle {
    /// Asks the emulator to end. It ends within its present step.
    pub fn stop(&self) {
        self.end(None);
    }

    /// Stops the emulator like [`StopHandle::stop`], with a reason. The reason is a part of a sentence that begins with
    /// the name of the instance. Clients get this sentence as a message.
    pub fn stop_because(&self, reason: impl Into<String>) {
        self.end(Some(reason.into()));
    }

    fn end(&self, reason: Option<String>) {
        self.stop.make(reason);
        self.wake();
    }

    /// Wakes the thread of the emulator.
    pub(super) fn wake(&self) {
        self.header.doorbell.ring();
    }
}

/// A change of the speed of a real-time clock.
pub(super) struct SpeedChange {
    /// New emulated time per real time x 1000.
    permille: u32,
    /// Emulated time from which the speed applies, in microseconds.
    from_us: u64,
}

/// A plant on image files.
pub struct Emulator {
    pub(super) plant: Plant,
    pub(super) travel: Travel,
    pub(super) options: Options,
    pub(super) stop: Arc<EndRequest>,
    pub(super) lockstep: Lockstep,
    pub(super) guests: Guests,
    /// The clock in real time; unused if stepped.
    wall: WallClock,
    /// A change of the speed of this clock, until the plant has reached its time.
    pub(super) speed_change: Option<SpeedChange>,
    /// True if the journal shows that the emulated time of this clock is late.
    pub(super) is_late: bool,
    /// Real time since the present turns of guests began, if guests have turns now.
    pub(super) turn_time: Option<AwakeTime>,
    /// Emulated time up to which a step was to advance that has paused to serve other clients.
    pub(super) under_way: Option<u64>,
    /// Declared before the images, and so dropped before them: it must write everything before another emulator can
    /// take over the images.
    novram: Keeper,
    /// The field is declared before the images, because the watch checks their files.
    watch: Watch,
    images: Vec<Image>,
    /// Last seen number of rings of each PLC's doorbell.
    rings: Vec<u32>,
    /// Real time of the present piece of work: an operation of a client, or an advance of the real-time clock.
    pub(super) slice: Slice,
    #[cfg(feature = "channel")]
    pub(super) membership: super::membership::Membership,
    /// Declared before the server, and so dropped before it, because the field uses the node of the server.
    #[cfg(feature = "channel")]
    events: Option<crate::channel::EventNotifier>,
    #[cfg(feature = "channel")]
    /// The server is in a box, because every pass of the main loop moves it out and back.
    server: Option<Box<crate::channel::Server>>,
    #[cfg(feature = "channel")]
    channel_watch: Option<crate::channel::ChannelWatch>,
    /// Declared after the images and the server, and so dropped after them: until then no other process may take the
    /// name of the instance.
    lock: InstanceLock,
}

impl Emulator {
    /// Creates the image files and powers the plant on. If the channel cannot be opened, the emulator runs without it
    /// and logs the reason; mapped clients do not need it.
    ///
    /// # Errors
    /// [`RuntimeError`]: another emulator has the instance, a file cannot be replaced, or the plant is refused.
    pub fn start(config: &PlantConfig, options: Options) -> Result<Self, RuntimeError> {
        Self::start_from(config, options, None)
    }

    /// Starts an emulator like [`Emulator::start`]. If a snapshot of this plant is given, the plant starts from it, and
    /// its NOVRAM replaces the content of the files.
    ///
    /// # Errors
    /// Returns the errors of [`Emulator::start`]. It is also an error if the snapshot is refused.
    pub fn start_from(
        config: &PlantConfig,
        options: Options,
        snapshot: Option<&Snapshot>,
    ) -> Result<Self, RuntimeError> {
        options.clock.check()?;
        let doors = config.buses.iter().map(|bus| bus.doors().len()).sum();
        // This check comes before any file of the instance exists, because the emulator could not remove the files
        // without free file descriptors.
        needs::allow_files_of(config.devices.len(), doors)?;
        needs::allow_memory_of(config.devices.len())?;
        needs::check_umask()?;
        let lock = take_instance(config, &options.instance)?;
        #[cfg(feature = "channel")]
        let instance = options.instance.clone();
        let started = Self::start_with(config, options, snapshot, lock);
        #[cfg(feature = "channel")]
        if started.is_err() {
            remove_killed(&instance);
        }
        started
    }

    /// Starts an emulator like [`Emulator::start_from`], which holds the lock of its instance.
    fn start_with(
        config: &PlantConfig,
        options: Options,
        snapshot: Option<&Snapshot>,
        lock: InstanceLock,
    ) -> Result<Self, RuntimeError> {
        let sizes = config.devices.iter().map(|device| (device.name(), device.layout().segment_size()));
        room::check(&options.instance, sizes)?;
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
            let segment = if options.is_federate { segment.with_request_page() } else { segment };
            images.push(image);
            if let (Some(path), Some(of)) = (&options.novram, config.device(plc)) {
                // The directory is opened after the first image exists. So if the instance already runs, the error is
                // about the instance and not about its directory.
                let directory = match &mut directory {
                    Some(directory) => directory,
                    none => none.insert(Directory::open(path)?),
                };
                let one = of.name();
                let mut names = config.devices.iter().map(|device| device.name());
                if let Some(other) = names.find(|it| *it != one && it.eq_ignore_ascii_case(one))
                    && directory.ignores_case()
                {
                    let (one, other) = (one.to_owned(), other.to_owned());
                    return Err(NovramError::Namesakes { path: path.clone(), one, other }.into());
                }
                let content = Novram::power_on(directory, of, &segment)?;
                if let Some((_, RestoreOutcome::SetAside { path, removed })) = &content {
                    tracing::warn!("damaged NOVRAM of {plc}: kept as {}", path.display());
                    for old in removed {
                        tracing::warn!(
                            "damaged NOVRAM of {plc}: removed {}, the last eight are kept",
                            old.display()
                        );
                    }
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
        let guests = Guests::new(config, options.clock.is_stepped(), move || bell.doorbell.ring())?;
        let stop = StopHandle { stop: Arc::default(), header: images[0].header().clone() };
        let end = Arc::clone(&stop.stop);
        plant.end_if(Arc::new(move || end.is_made()));
        // Created after the event services, so that the watch includes their memory.
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
            slice: Slice::default(),
            #[cfg(feature = "channel")]
            membership: super::membership::Membership::default(),
            lockstep,
            guests,
            wall: WallClock::paused(),
            speed_change: None,
            is_late: false,
            turn_time: None,
            under_way: None,
            novram,
            plant,
            travel: Travel::default(),
            options,
            stop: stop.stop,
            watch,
            images,
            lock,
            #[cfg(feature = "channel")]
            events,
            #[cfg(feature = "channel")]
            server,
            #[cfg(feature = "channel")]
            channel_watch,
        })
    }

    /// Returns the images, one for each PLC.
    pub fn images(&self) -> &[Image] {
        &self.images
    }

    /// Returns the open doors, each with the name of its bus.
    pub fn doors(&self) -> Vec<(&str, DoorSpec)> {
        let buses = BusIndex::enumerate(self.plant.buses());
        let of_bus = |index: BusIndex| self.guests.open_doors(index).into_iter();
        buses.flat_map(|(index, bus)| of_bus(index).map(|door| (bus.name(), door.door))).collect()
    }

    /// Limits the memory for snapshots of the past, in bytes, with a stepped clock. With 0, there are no snapshots.
    pub fn keep_states(&mut self, bytes: usize) {
        self.travel = Travel::new(bytes);
    }

    /// Sets the number of cores that run the plant.
    pub fn set_cores(&mut self, count: NonZero<usize>) {
        self.plant.set_cores(count);
    }

    /// Returns the plant of the emulator.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Records in the journal every later change of the registers in the `len` bytes from `offset` on of PLC `plc`.
    ///
    /// # Errors
    /// Returns the errors of [`Plant::follow_registers`].
    pub fn keep_changes(&mut self, plc: DeviceIndex, offset: u32, len: u32) -> Result<(), FollowError> {
        self.plant.follow_registers(plc, offset, len, Keep::InJournal)
    }

    /// Returns a handle that ends the emulator.
    pub fn stop_handle(&self) -> StopHandle {
        StopHandle { stop: Arc::clone(&self.stop), header: self.header().clone() }
    }

    /// Returns the header page of the first PLC, which also serves for the whole instance.
    pub(super) fn header(&self) -> &View<Header> {
        // `Plant::new` refuses a plant without a PLC.
        self.images[0].header()
    }

    /// Description of another process that can write to registers; `None` if there is none.
    pub(super) fn mapped_client(&self) -> Option<String> {
        let writer = self.images.iter().find_map(|image| image.writers().into_iter().next())?;
        Some(format!("{writer}, which has mapped the registers,"))
    }

    /// True if the emulator must end.
    pub(super) fn is_stopping(&self) -> bool {
        self.stop.is_made() || self.shortened().is_some()
    }

    /// Returns the first image that another process has shortened.
    fn shortened(&self) -> Option<&Image> {
        self.images.iter().find(|image| image.was_shortened())
    }

    /// Runs until the emulator is requested to end.
    ///
    /// # Errors
    /// [`RuntimeError::Federation`] if another federate or the connection has failed. [`RuntimeError::Novram`] if
    /// changes in NOVRAM could not be written; all other parts have ended normally.
    pub fn run(&mut self) -> Result<(), RuntimeError> {
        let outcome = match self.options.clock {
            #[cfg(feature = "channel")]
            Clock::Stepped if self.membership.federation.is_some() => self.run_federated(),
            Clock::Stepped => {
                self.run_stepped();
                Ok(())
            }
            Clock::RealTime { speed } => {
                // The default timer slack of 50 us would delay each SYNC edge by that time. With the smallest slack,
                // the delay is shorter.
                let _ = rustix::thread::set_current_timer_slack(core::num::NonZeroU64::new(1));
                self.run_wall(WallClock::at(self.plant.now(), speed), self.options.clock.speed_permille());
                self.run_real_time();
                Ok(())
            }
        };
        self.images.iter().for_each(Image::set_stopping);
        // NOVRAM is saved before the channel is closed. If a program has damaged the channel's memory, closing it can
        // kill this process.
        let saved = self.close_novram();
        if saved.is_err() && self.options.novram.is_some() {
            self.images.iter_mut().for_each(Image::set_unsaved);
            self.lock.set_unsaved();
        }
        self.close_channel();
        outcome.and(saved)
    }

    /// Continues with clock `wall` and publishes it in the header pages. Its speed is `permille` / 1000.
    fn run_wall(&mut self, wall: WallClock, permille: u32) {
        for image in &self.images {
            image.header().set_real_clock(wall.epoch_ns(), permille);
        }
        self.plant.show_speed(permille);
        self.wall = wall;
    }

    /// Begins a change of the real-time clock's speed. The clock continues from its present time. If the plant is late
    /// by more than one step, the rest of this time is dropped. Returns false while another change is in progress.
    pub(super) fn set_real_speed(&mut self, permille: u32) -> bool {
        if self.speed_change.is_some() {
            return false;
        }
        // The plant first advances to the present time. Otherwise a client that has computed the present time from the
        // clock could see an earlier time later. During the change clients wait, so that none of them computes a later
        // time (D-789).
        self.images.iter().for_each(|image| image.header().withdraw_real_clock());
        let from_us = self.real_now();
        self.speed_change = Some(SpeedChange { permille, from_us });
        self.advance_real_time(from_us);
        true
    }

    /// Advances to `now` with a real-time clock, or less far if this takes long. Completes a change of the clock's speed
    /// whose time is reached. Returns true if an event was due.
    fn advance_real_time(&mut self, now: u64) -> bool {
        let Emulator { plant, slice, .. } = &mut *self;
        slice.renew();
        let is_due = plant.next_event() <= now;
        if is_due {
            plant.advance_in_slices(now, &|| slice.is_over());
        } else {
            plant.pass_to(now);
        }
        let plant_us = self.plant.now();
        if let Some(change) = self.speed_change.take_if(|change| change.from_us <= plant_us) {
            let speed = f64::from(change.permille) / 1000.0;
            self.run_wall(WallClock::at(change.from_us, speed), change.permille);
        }
        is_due
    }

    /// Real time by which the plant is later than the real-time clock.
    pub(super) fn late_by(&self) -> Duration {
        self.wall.since(self.plant.now())
    }

    /// Writes NOVRAM for the last time, unless registers were lost.
    fn close_novram(&mut self) -> Result<(), RuntimeError> {
        let lost = |emulator: &Self| {
            let path = emulator.shortened().map(|image| image.path().to_owned());
            path.map_or(Ok(()), |path| Err(RuntimeError::Shortened { path }))
        };
        // An image may have been shortened without an access to the missing part. Only this check then detects it.
        for image in &self.images {
            let _ = image.is_shortened();
        }
        lost(self)?;
        self.plant.keep_novram();
        self.save_novram(true);
        self.novram.close()?;
        // An image may have been shortened during the write.
        lost(self)
    }

    /// Writes the NOVRAM that has changed to its files.
    fn save_novram(&mut self, last: bool) {
        let (devices, images) = (self.plant.devices(), &self.images);
        let stored = |plc: DeviceIndex, checks: bool| {
            let is_lost = if checks { Image::is_shortened } else { Image::was_shortened };
            if images.get(plc.index()).is_some_and(is_lost) {
                return None;
            }
            let device = devices.get(plc.index())?;
            Some(device.novram().map_or((&[][..], 0), |novram| novram.contents()))
        };
        self.novram.save(stored, last);
    }
}

/// An emulator without a channel has no requests and no listeners.
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

    pub(super) fn notify_events(&mut self) {}

    fn close_channel(&mut self) {}
}

/// Takes the lock of the instance. Removes the images of a killed emulator for PLCs that this plant does not
/// have.
fn take_instance(config: &PlantConfig, instance: &str) -> Result<InstanceLock, MemoryError> {
    let lock = InstanceLock::take(instance)?;
    let folders = config.devices.iter().filter_map(|device| Some((device.folder()?, device.has_script())));
    lock.publish_device_folders(folders, config.lines_of_controllers())?;
    match lock.remove_dead(|plc| config.devices.iter().any(|own| own.name() == plc)) {
        Err(error @ MemoryError::AlreadyRunning { .. }) => Err(error),
        Err(error) => {
            tracing::warn!("{error}");
            Ok(lock)
        }
        Ok(_) => Ok(lock),
    }
}

/// Removes the channel of a killed emulator after a start was refused that has taken over and removed all its images:
/// `commram list` no longer shows the killed emulator. Errors are ignored, because the start has its own error.
#[cfg(feature = "channel")]
fn remove_killed(instance: &str) {
    let Ok(lock) = InstanceLock::take_to_clean(instance) else { return };
    if lock.has_images() {
        return;
    }
    if let Ok(root) = crate::memory::names::channel_root(instance) {
        let _ = crate::channel::remove_remains(instance, &root);
    }
}
