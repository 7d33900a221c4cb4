//! The emulator's side of the channel, and its end when another program shortens a part of it.

use super::{Emulator, LONGEST_SLEEP};
use crate::channel::{ChannelWatch, EventNotifier, HeaderBells, Server};
use crate::identity::DeviceIndex;
use crate::memory::{Image, channel_has_gaps, names};
use crate::request::Host;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::{Duration, Instant};

/// Longest time after the end of the clock in which clients that follow the journal can read its rest.
const LAST_READS: Duration = Duration::from_millis(500);

impl Emulator {
    pub(super) fn open_channel(instance: &str, images: &[Image]) -> Option<Box<Server>> {
        let headers = images.iter().map(|image| image.header().clone()).collect();
        let opened = names::channel_root(instance).map_err(|error| error.to_string()).and_then(|root| {
            let bells = Box::new(HeaderBells::of_emulator(headers));
            let server = Server::open(instance, &root, bells);
            server.map(Box::new).map_err(|error| error.to_string())
        });
        opened.inspect_err(|error| tracing::error!("no channel, mapped clients only: {error}")).ok()
    }

    /// Handles requests of the channel; returns whether there were any.
    pub(in crate::runtime) fn serve_channel(&mut self) -> bool {
        self.slice.renew();
        self.serve_by(Server::poll)
    }

    /// Calls a function of the server that handles requests; returns whether there were any.
    fn serve_by(&mut self, serve: impl FnOnce(&mut Server, &mut dyn Host) -> usize) -> bool {
        if self.channel_is_damaged() {
            self.give_channel_up();
        }
        // The server is taken out of the emulator for the call, because it needs the rest of the emulator as host.
        let Some(mut server) = self.server.take() else { return false };
        let served = catch_unwind(AssertUnwindSafe(|| serve(&mut server, self)));
        self.server = Some(server);
        served.map_or_else(|panic| self.judge(panic), |served| served > 0)
    }

    /// True if a request has paused while it advances the stepped clock.
    pub(in crate::runtime) fn is_time_passing(&self) -> bool {
        self.server.as_ref().is_some_and(|server| server.waiting() > 0)
    }

    /// True if a client waits for a register or an event.
    pub(super) fn is_listened_to(&self) -> bool {
        self.is_time_passing() || self.events.as_ref().is_some_and(EventNotifier::is_listened_to)
    }

    /// Reports occurred events to the listeners of the event services.
    pub(in crate::runtime) fn notify_events(&mut self) {
        for plc in DeviceIndex::first(self.images.len()) {
            let fired = self.plant.take_fired(plc);
            if fired != 0
                && let Some(events) = &self.events
                && let Err(panic) = catch_unwind(AssertUnwindSafe(|| events.notify(plc, fired)))
            {
                self.judge(panic);
            }
        }
    }

    pub(super) fn close_channel(&mut self) {
        let is_short = self.channel_watch.as_ref().is_some_and(ChannelWatch::look);
        if is_short || self.channel_is_damaged() {
            self.give_channel_up();
        }
        self.hand_over_records();
        self.events = None;
        if let Some(server) = self.server.take() {
            server.close(self);
        }
    }

    /// Waits until the clients that follow the journal or changes of registers have read the rest of them.
    fn hand_over_records(&mut self) {
        let begin = Instant::now();
        loop {
            self.note_rings();
            let mut is_followed = false;
            let has_served = self.serve_by(|server, host| {
                let served = server.poll_followers(host);
                is_followed = server.is_followed();
                served
            });
            let left = LAST_READS.saturating_sub(begin.elapsed());
            if !is_followed || left.is_zero() {
                return;
            }
            if !has_served {
                self.sleep(left.min(LONGEST_SLEEP));
            }
        }
    }

    /// Handles a panic in iceoryx2, which missing memory can cause. If the channel is not damaged, the panic continues.
    fn judge(&mut self, panic: Box<dyn core::any::Any + Send>) -> bool {
        if !self.channel_is_damaged() {
            resume_unwind(panic);
        }
        self.give_channel_up();
        true
    }

    /// True if another process has shortened a part of the channel.
    fn channel_is_damaged(&self) -> bool {
        self.channel_watch.as_ref().is_some_and(|watch| watch.is_damaged() || channel_has_gaps())
    }

    /// Continues without the channel, and does not access its memory again.
    fn give_channel_up(&mut self) {
        core::mem::forget(self.events.take());
        self.channel_watch = None;
        if let Some(server) = self.server.take() {
            server.abandon();
            tracing::error!(
                "the channel is lost: another program has shortened a part of it, or /dev/shm is full; mapped clients \
                 only, until the next start"
            );
        }
    }
}
