//! Events of the boards as an iceoryx2 event service, one for each PLC: `commram.events.<plc>`, in the domain of the
//! channel. The id of a notification is the number of the event.
//!
//! Notifications only wake listeners. Several events of one number may become one notification. The counters in the
//! header page count the events, and are updated before the notification.

use super::client::{ClientError, Patience, domain_of};
use super::domain::{Domain, Ipc, MAX_CLIENTS, MAX_NODES, Threads};
use super::guest::{self, Guest};
use super::{Bells, ServerError};
use crate::identity::DeviceIndex;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::*;
use iceoryx2::service::builder::event::Builder;
use iceoryx2::service::port_factory::event::PortFactory as Service;
use std::path::Path as FsPath;
use std::time::{Duration, Instant};

/// Highest event number that can be notified.
const LAST_EVENT: usize = crate::memory::header::EVENT_SLOTS - 1;
/// Interval at which a listener checks that the emulator runs.
const ALIVE_CHECK: Duration = Duration::from_millis(100);

fn builder<S: iceoryx2::service::Service>(node: &Node<S>, plc: &str) -> Option<Builder<S>> {
    let name = ServiceName::new(&format!("commram.events.{plc}")).ok()?;
    let builder = node.service_builder(&name).event();
    let builder = builder.max_notifiers(1).max_listeners(MAX_CLIENTS).max_nodes(MAX_NODES);
    Some(builder.event_id_max_value(LAST_EVENT))
}

/// The emulator's side: notifies listeners of events. Without listeners it takes almost no time.
pub struct EventNotifier {
    /// One service per PLC.
    services: Vec<(Service<Ipc>, Notifier<Ipc>)>,
}

impl EventNotifier {
    pub(super) fn open(instance: &str, node: &Node<Ipc>, plcs: &[String]) -> Result<Self, ServerError> {
        let failed = |reason: String| ServerError::Service { instance: instance.to_owned(), reason };
        let open = |plc: &String| {
            let builder = builder(node, plc).ok_or_else(|| failed(format!("no service for {plc}")))?;
            let service = builder.open_or_create().map_err(|error| failed(error.to_string()))?;
            let notifier = service.notifier_builder().create().map_err(|error| failed(error.to_string()))?;
            Ok((service, notifier))
        };
        Ok(EventNotifier { services: plcs.iter().map(open).collect::<Result<_, ServerError>>()? })
    }

    /// True if a client listens to any PLC.
    pub fn is_listened_to(&self) -> bool {
        self.services.iter().any(|(service, _)| service.dynamic_config().number_of_listeners() != 0)
    }

    /// Notifies listeners of events of PLC `plc`: bit n for event n.
    #[inline]
    pub fn notify(&self, plc: DeviceIndex, events: u16) {
        let Some((service, notifier)) = self.services.get(plc.index()) else { return };
        if service.dynamic_config().number_of_listeners() == 0 {
            return;
        }
        for event in (0..=LAST_EVENT).filter(|event| events & 1 << event != 0) {
            if let Err(reason) = notifier.notify_with_custom_event_id(EventId::new(event)) {
                // A listener has died. The other listeners were notified.
                tracing::debug!(?reason, "a listener could not be notified");
            }
        }
    }
}

/// The client's side: waits for events of one PLC.
pub struct EventListener {
    listener: Listener<Threads>,
    // The port uses the service and the guest, so it must be dropped first. Rust drops fields in the order of
    // their declaration, so these two fields are declared after the port.
    service: Service<Threads>,
    _guest: Guest,
    bells: Box<dyn Bells>,
    instance: String,
}

impl EventListener {
    /// Listens to the events of PLC `plc` of `instance`. The files of its channel are in the directory `root`.
    ///
    /// # Errors
    /// The instance is not running or has no such PLC, or iceoryx2 refuses.
    pub fn connect(
        instance: &str,
        root: &FsPath,
        plc: &str,
        bells: Box<dyn Bells>,
    ) -> Result<Self, ClientError> {
        let domain = domain_of(instance, root, &*bells)?;
        let (name, plc) = (instance.to_owned(), plc.to_owned());
        let limit = Patience::default().enter_limit;
        let (listener, service, guest) =
            guest::enter_within(limit, instance, move || enter(&name, &plc, domain))?;
        Ok(EventListener { listener, service, _guest: guest, bells, instance: instance.to_owned() })
    }

    /// Waits for events since the last call, for at most `timeout`. Bit n of the result means event n; 0 means none.
    /// Read the counters before the first call, and after each call.
    ///
    /// # Errors
    /// [`ClientError::EmulatorGone`], detected within 100 ms, or iceoryx2 fails.
    pub fn wait(&self, timeout: Duration) -> Result<u16, ClientError> {
        let start = Instant::now();
        loop {
            let mut events = 0;
            let left = timeout.saturating_sub(start.elapsed());
            let waited = self.listener.timed_wait(
                |event| events |= 1u16.checked_shl(event.id.as_value() as u32).unwrap_or(0),
                left.min(ALIVE_CHECK),
            );
            if let Err(reason) = waited {
                let reason = reason.to_string();
                return Err(ClientError::Connect { instance: self.instance.clone(), reason });
            }
            if events != 0 || left.is_zero() {
                return Ok(events);
            }
            // An emulator that ends removes its port before it waits for its clients to leave.
            if self.service.dynamic_config().number_of_notifiers() == 0 || !self.bells.emulator_alive() {
                let killed = self.bells.emulator_was_killed().then(|| self.bells.emulator_pid());
                return Err(ClientError::EmulatorGone { instance: self.instance.clone(), killed });
            }
        }
    }
}

fn enter(
    instance: &str,
    plc: &str,
    domain: Domain,
) -> Result<(Listener<Threads>, Service<Threads>, Guest), ClientError> {
    let connect = |reason: String| ClientError::Connect { instance: instance.to_owned(), reason };
    let guest = Guest::enter(domain).map_err(|error| connect(error.to_string()))?;
    let builder = guest.node().and_then(|node| builder(node, plc));
    let builder = builder.ok_or_else(|| connect(format!("{plc} is no name of a PLC")))?;
    let service = builder.open().map_err(|error| connect(format!("events of PLC {plc}: {error}")))?;
    let listener = service.listener_builder().create().map_err(|error| connect(format!("{error:?}")))?;
    guest.domain().keep_from_programs();
    Ok((listener, service, guest))
}
