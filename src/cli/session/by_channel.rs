//! Access to a running instance.

use super::*;
use crate::channel::client::Patience;
use crate::channel::{Client, ClientError, HeaderBells};
use crate::cli::{output, progress};
use crate::identity::DeviceIndex;
use crate::journal::{Names, Record};
use crate::memory::names::channel_root;
use crate::memory::{InstanceLock, State};
use crate::plural::plural;
use crate::request::InstanceInfo;
use crate::request::{Code, MAX_OPS, MAX_RANGE, Op, Reply, WrongReply, read_journal};
use crate::time;
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Maximum number of registers that a request can read, in addition to the time and the forces.
const MAX_READS: usize = MAX_OPS - 2;
/// A clock that advances by less than this part of the requested time within the patience of a client counts as stopped.
const SLOWEST: u64 = 100;
/// Maximum number of bytes that a request reads. The replies of a request are limited, too.
const MAX_BYTES: u32 = 4 * MAX_RANGE;

impl Session {
    /// Opens a running instance. `waits_us` is the longest emulated time that the next request can take.
    ///
    /// # Errors
    /// No instance of this name is running, or its channel cannot be used.
    pub(crate) fn open(instance: &Instance, waits_us: u64) -> Result<Self, CliError> {
        instance.reach(|| {
            let name = instance.name();
            let images = images_of(name)?;
            match dead(&images) {
                Some(pid) => Err(CliError::Dead { instance: name.to_owned(), pid }),
                None => Self::connect(name, &images, waits_us),
            }
        })
    }

    /// Opens a running instance for requests that take no emulated time. Waits at most `limit` for the channel, and for each
    /// reply.
    ///
    /// # Errors
    /// Returns the errors of [`Session::open`].
    pub(crate) fn open_within(instance: &str, limit: Duration) -> Result<Self, CliError> {
        let patience = |_| Patience { enter_limit: limit, reply: limit, ..Patience::default() };
        Self::connect_to(instance, &images_of(instance)?, patience)
    }

    pub(super) fn connect(instance: &str, images: &[ImageInfo], waits_us: u64) -> Result<Self, CliError> {
        let patience = |slowed| Patience { reply: patience(waits_us, slowed), ..Patience::default() };
        Self::connect_to(instance, images, patience).map_err(|error| match taken_from(instance, images) {
            Some(pid) => CliError::Dead { instance: instance.to_owned(), pid },
            None => error,
        })
    }

    /// Connects with the patience for a clock of which a second takes the real time that is passed to `patience`.
    fn connect_to(
        instance: &str,
        images: &[ImageInfo],
        patience: impl FnOnce(f64) -> Patience,
    ) -> Result<Self, CliError> {
        let (attached, layout) = attach_live(instance, images)?;
        let slowed = slowdown(&attached);
        // If the instance has a single PLC, its header page has all names, so no request is needed. But if a new
        // emulator is just taking over the image of a killed one, only a request shows that the old channel has no
        // server.
        let only = match images {
            [image] if taken_from(instance, images).is_none() => {
                Some((vec![image.plc.clone()], vec![attached.header_snapshot().fitted(layout)]))
            }
            _ => None,
        };
        let patience = patience(slowed);
        let bells = Box::new(HeaderBells::of_client(attached)?);
        let client = Client::connect(instance, &channel_root(instance)?, bells, patience);
        let client = Box::new(client.map_err(|error| match error {
            ClientError::NotRunning { .. } => without_channel(instance).unwrap_or_else(|| error.into()),
            other => other.into(),
        })?);
        let (plcs, fitted) = match only {
            Some(only) => only,
            None => {
                let Names { plcs, devices, .. } = client.info()?.names;
                (plcs, devices)
            }
        };
        Ok(Self { instance: instance.to_owned(), plcs, fitted, door: Access::Channel(client), slowed })
    }

    /// Sets the longest wait for a reply: `waits_us` is the emulated time that the next request can take.
    pub(crate) fn expect_to_wait(&mut self, waits_us: u64) {
        let patience = patience(waits_us, self.slowed);
        if let Access::Channel(client) = &mut self.door {
            client.set_patience(patience);
        }
    }

    /// From now on cancels requests when `cancel` becomes true.
    pub(crate) fn set_cancel(&mut self, cancel: Arc<AtomicBool>) {
        if let Access::Channel(client) = &mut self.door {
            client.set_cancel(cancel);
        }
    }

    /// True if the emulator of this connection still runs.
    #[cfg(feature = "web")]
    pub(crate) fn is_served(&self) -> bool {
        matches!(&self.door, Access::Channel(client) if client.is_emulator_alive())
    }

    /// True if another program has shortened a part of the channel.
    #[cfg(feature = "web")]
    pub(crate) fn has_shortened_channel(&self) -> bool {
        matches!(&self.door, Access::Channel(client) if client.is_shortened())
    }

    /// Returns the client connection.
    ///
    /// # Errors
    /// The instance was opened without a connection.
    pub(crate) fn into_client(self) -> Result<Client, CliError> {
        match self.door {
            Access::Channel(client) => Ok(*client),
            Access::Images(_) => Err(no_channel(&self.instance)),
        }
    }

    /// Sends the operations as one request. If the function returns no error, the emulator has executed all of them.
    ///
    /// # Errors
    /// The error of the first operation that was refused, or of a missing reply.
    pub(crate) fn request(&self, ops: &[Op]) -> Result<Vec<Reply>, CliError> {
        let replies = self.replies(ops)?;
        match replies.iter().find(|reply| matches!(reply, Reply::Error(_))) {
            Some(Reply::Error(refused)) => Err(ClientError::Refused(refused.clone()).into()),
            _ => Ok(replies),
        }
    }

    /// Does the same as [`Session::request`]. If the operations or their replies do not fit into one request, the others follow
    /// in further requests.
    ///
    /// # Errors
    /// Returns the errors of [`Session::request`].
    pub(crate) fn request_in_parts(&self, ops: &[Op]) -> Result<Vec<Reply>, CliError> {
        let mut replies = Vec::with_capacity(ops.len());
        while replies.len() < ops.len() {
            let rest = &ops[replies.len()..];
            let part = self.replies(&rest[..rest.len().min(MAX_OPS)])?;
            let executed = part.iter().position(|reply| matches!(reply, Reply::Error(_)));
            if let Some((at, Reply::Error(refused))) = executed.map(|at| (at, &part[at])) {
                // Only operations that read have long replies, so the refused one can be repeated.
                if refused.code != Code::REPLY_TOO_LONG || at == 0 {
                    return Err(ClientError::Refused(refused.clone()).into());
                }
            }
            replies.extend(part.into_iter().take(executed.unwrap_or(MAX_OPS)));
        }
        Ok(replies)
    }

    /// Sends operations and returns their replies in order: [`Reply::Error`] for a refused operation, if any.
    ///
    /// # Errors
    /// The emulator did not reply to the request.
    pub(crate) fn replies(&self, ops: &[Op]) -> Result<Vec<Reply>, CliError> {
        let Access::Channel(client) = &self.door else {
            return Err(no_channel(&self.instance));
        };
        let plc = self.plcs.first().map_or("", String::as_str);
        let instance = self.instance.as_str();
        let emulated_us = || progress::emulated_us(instance, plc);
        let work = || send(client, instance, ops, &emulated_us);
        let replies = progress::shown(advance(ops), &emulated_us, work);
        replies.map_err(|error| self.explain(error, client, ops))
    }

    /// Explains a missing reply. An emulator that is busy with another client reports what it is doing.
    fn explain(&self, error: ClientError, client: &Client, ops: &[Op]) -> CliError {
        let ClientError::Timeout { after, .. } = error else { return error.into() };
        let is_busy = ops.iter().any(|op| !op.only_looks());
        let Some(info) = is_busy.then(|| client.info().ok()).flatten() else { return error.into() };
        CliError::Busy {
            instance: self.instance.clone(),
            after_ms: after.as_millis(),
            is_paused: !info.is_stepped && info.speed == 0,
            time_us: info.time_us,
            waits_for: info.waits_for,
        }
    }

    /// Sends one operation as a separate request.
    ///
    /// # Errors
    /// The emulator refused the operation, or did not reply.
    pub(crate) fn ask(&self, op: Op) -> Result<Reply, CliError> {
        Ok(self.request(&[op])?.pop().ok_or(WrongReply)?)
    }

    /// Information about the instance.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(crate) fn info(&self) -> Result<InstanceInfo, CliError> {
        Ok(self.ask(Op::Info)?.info()?)
    }

    /// Returns the number of the next record of the journal.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(crate) fn journal_end(&self) -> Result<u64, CliError> {
        Ok(self.ask(Op::Journal { from: u64::MAX, max: 0 })?.journal_part()?.end)
    }

    /// Returns the journal from record number `from` on. Records with a count that can still grow come last. Prints a note
    /// about lost records.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(crate) fn records(&self, from: u64) -> Result<Vec<Record>, CliError> {
        let mut part = read_journal(from, |op| self.ask(op))?;
        let begin = part.begins_at(from);
        if let Some(begin) = begin {
            output::note(&continues(begin));
        }
        let begin = begin.unwrap_or(from);
        let lost = part.end.saturating_sub(begin).saturating_sub(part.records.len() as u64);
        if lost > 0 {
            output::note(&format!("{} lost: the journal was full", plural(lost, "record")));
        }
        part.records.append(&mut part.pending);
        Ok(part.records)
    }

    pub(super) fn boards_by_channel(&self) -> Result<Vec<BoardState>, CliError> {
        let ops: Vec<_> = DeviceIndex::first(self.plcs.len()).map(|plc| Op::Board { plc }).collect();
        self.request_in_parts(&ops)?.into_iter().map(|reply| Ok(reply.board()?)).collect()
    }

    /// Reads the registers in as many requests as necessary. Prints a note if the clock has advanced between the
    /// requests.
    pub(super) fn read_by_channel(&self, reads: &[Read]) -> Result<Snapshot, CliError> {
        let (mut snapshot, mut rest) = self.read_first(reads)?;
        let mut until_us = snapshot.time_us;
        while !rest.is_empty() {
            let (next, others) = self.read_first(rest)?;
            snapshot.data.extend(next.data);
            until_us = next.time_us;
            rest = others;
        }
        if until_us != snapshot.time_us {
            let (from, until) = (time::seconds(snapshot.time_us), time::seconds(until_us));
            output::note(&format!(
                "more than {MAX_READS} registers or {MAX_BYTES} bytes need several requests: they were read from {from} to {until}"
            ));
        }
        Ok(snapshot)
    }

    /// Reads as many registers as one request can read. Returns them, and the others.
    fn read_first<'a>(&self, reads: &'a [Read]) -> Result<(Snapshot, &'a [Read]), CliError> {
        let mut count = fitting(reads);
        loop {
            let (first, others) = reads.split_at(count);
            match self.request(&Read::ops(first)) {
                // Many forced registers leave less room.
                Err(CliError::Client(ClientError::Refused(refused)))
                    if refused.code == Code::REPLY_TOO_LONG && count > 1 =>
                {
                    count /= 2;
                }
                replies => return Ok((Snapshot::of(replies?)?, others)),
            }
        }
    }
}

impl Read {
    /// Returns the operations for these reads. [`Snapshot::of`] needs the replies of all of them.
    pub(crate) fn ops(reads: &[Self]) -> Vec<Op> {
        let op = |read: &Read| match *read {
            Read::Register { plc, offset, width } => Op::Peek { plc, offset, width },
            Read::Block { plc, offset, len } => Op::ReadRange { plc, offset, len },
        };
        [Op::Time, Op::Forces].into_iter().chain(reads.iter().map(op)).collect()
    }
}

impl Snapshot {
    /// Returns the values in the replies to the operations of [`Read::ops`].
    ///
    /// # Errors
    /// A reply is of another kind.
    pub(crate) fn of(replies: Vec<Reply>) -> Result<Self, CliError> {
        let (mut time_us, mut forces) = (0, Vec::new());
        let mut data = Vec::with_capacity(replies.len());
        for reply in replies {
            match reply {
                Reply::Time(now_us) => time_us = now_us,
                Reply::Forces(forced) => forces = forced,
                Reply::Value(value) => data.push(value.to_le_bytes().to_vec()),
                Reply::Bytes(bytes) => data.push(bytes),
                _ => return Err(WrongReply.into()),
            }
        }
        Ok(Snapshot { time_us, data, forces })
    }
}

/// Returns how many of these reads one request can contain, at least one if there is one.
fn fitting(reads: &[Read]) -> usize {
    let mut bytes = 0;
    let fits = |read: &&Read| {
        bytes += match read {
            Read::Register { width, .. } => width.bytes(),
            Read::Block { len, .. } => *len,
        };
        bytes <= MAX_BYTES
    };
    reads.iter().take(MAX_READS).take_while(fits).count().max(reads.len().min(1))
}

/// Note that the journal does not contain the records before number `begin`.
pub(crate) fn continues(begin: u64) -> String {
    format!("the instance continues from a snapshot; its journal begins with record {begin}")
}

/// Attaches to the first image. Also returns its layout.
fn attach_live(instance: &str, images: &[ImageInfo]) -> Result<(Attached, &'static DeviceLayout), CliError> {
    let Some(image) = images.iter().find(|image| is_alive(image)) else {
        return Err(no_channel(instance));
    };
    Ok(devices::attach(instance, &image.plc, AttachMode::HeaderOnly)?)
}

/// Process id of a killed emulator, if another emulator is taking over its images. The new emulator first locks the
/// images, and later writes its own process id into them. Between these steps, the killed emulator seems to run,
/// because the images are locked and contain its process id.
fn taken_from(instance: &str, images: &[ImageInfo]) -> Option<u32> {
    let owner = images.iter().find_map(|image| match &image.condition {
        Condition::Alive(summary) => Some(summary.pid),
        _ => None,
    })?;
    // If the holder of the lock is in another PID namespace, we cannot tell whether it is the process of the emulator
    // that this session knows.
    let holder = InstanceLock::holder(instance).ok()??.map(|process| process.pid());
    holder.is_some_and(|holder| holder != owner).then_some(owner)
}

fn no_channel(instance: &str) -> CliError {
    let not_running = || CliError::NotRunning { instance: instance.to_owned(), running: String::new() };
    without_channel(instance).unwrap_or_else(not_running)
}

/// Called by a command that has found no channel. An emulator opens its channel before it is ready. So if an emulator
/// of this instance is ready, it has no channel, and the function returns this error.
fn without_channel(instance: &str) -> Option<CliError> {
    let is_ready = |image: &ImageInfo| matches!(&image.condition, Condition::Alive(summary) if summary.state == Some(State::Ready));
    let images = images_of(instance).ok()?;
    images
        .iter()
        .any(is_ready)
        .then(|| CliError::NoChannel { instance: instance.to_owned(), pid: alive(&images) })
}

/// Sends the operations as one request. While the emulator returns to an earlier moment, waits for the reply without a
/// limit. While the emulator advances the clock, waits until the clock has stopped. `emulated_us` returns
/// the emulated time.
///
/// # Errors
/// The emulator did not reply to the request.
pub(crate) fn send(
    client: &Client,
    instance: &str,
    ops: &[Op],
    emulated_us: &dyn Fn() -> Option<u64>,
) -> Result<Vec<Reply>, ClientError> {
    let travels = ops.iter().any(Op::travels);
    let wanted: u64 = ops.iter().map(Op::advances_us).sum();
    let last = Cell::new(Some(wanted).filter(|us| *us > 0).and_then(|_| emulated_us()));
    let advances = || {
        let now = emulated_us();
        let advanced = now.zip(last.replace(now)).map(|(now, last)| now.saturating_sub(last));
        advanced.is_some_and(|us| us > wanted / SLOWEST)
    };
    client.request_while(ops, &|| if travels { answers_nobody(instance) } else { advances() })
}

/// True if the emulator runs, but does not answer. An emulator that executes the request of another client answers requests
/// that only read; an emulator that returns to an earlier moment does not.
fn answers_nobody(instance: &str) -> bool {
    let asked = Session::open(&Instance::running(instance), 0).and_then(|session| session.info());
    matches!(asked, Err(CliError::Client(ClientError::Timeout { .. })))
}

/// Longest wait for a reply to a request that can take `waits_us` of emulated time.
fn patience(waits_us: u64, slowed: f64) -> Duration {
    Duration::from_secs(10).saturating_add(Duration::from_micros(waits_us).mul_f64(slowed))
}

/// Seconds of real time for a second of emulated time.
fn slowdown(attached: &Attached) -> f64 {
    match attached.header_snapshot().speed.load() {
        0 => 1.0,
        permille => 1_000.0 / f64::from(permille),
    }
}

/// Returns the time by which the operations advance the clock, if it is known in advance.
fn advance(ops: &[Op]) -> Option<u64> {
    ops.iter().find_map(|op| match op {
        Op::Advance { us } => Some(*us),
        _ => None,
    })
}
