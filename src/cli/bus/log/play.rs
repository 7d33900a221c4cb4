//! `commram bus play`.

use super::super::super::demo::Interrupts;
use super::super::super::error::CliError;
use super::super::super::session::Session;
use super::super::super::{Instance, output, time};
use super::message::Message;
use super::select::Select;
use super::{AddressedMessage, Buses, frame_us, nothing, put_in_order, read, telegram_us};
use crate::channel::ClientError;
use crate::identity::BusIndex;
use crate::journal::Source;
use crate::plural::plural;
use crate::request::{Code, FilePart, MAX_ADVANCE_US, MAX_OPS, Op, Reply, read_journal};
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Send the frames of a log to buses, with the time intervals of the log.
///
/// LOG is a text of `candump -L` or `candump -ta`, of python-can, of GVRET or SavvyCAN (CSV), of `commram trace
/// --format candump` or `json`, or a pcapng file of Wireshark or `commram trace`. Telegrams of PROFIBUS are in `json` and
/// pcapng. Error frames and other entries that are no frames of classical CAN are skipped with a note. The first frame
/// is sent at once. With the stepped clock the command advances the clock from one frame to the next, with the
/// real-time clock it waits. Other stations on the bus take part in the arbitration; a frame for which there is no room
/// waits. The command ends when the last frame has ended on its bus. An interface of the log means the bus of the same
/// name, or the only bus of the instance.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram bus play open.log
  commram bus play open.pcapng
  commram bus play can0.log --bus open --without-node 32
  commram bus play dp.jsonl --without-station 5
  commram bus play machine.csv --interface can1 --id 180:780 --bus open")]
pub(in super::super) struct Play {
    /// The log
    log: PathBuf,
    /// Send all frames to this bus
    #[arg(long, value_name = "NAME")]
    bus: Option<String>,
    /// A log without a frame to play is no error
    #[arg(long)]
    allow_empty: bool,
    #[command(flatten)]
    select: Select,
    #[command(flatten)]
    instance: Instance,
}

/// Longest time between two frames of a played log: the limit of one advance operation, 24 h in
/// microseconds.
const LONGEST_GAP_US: u64 = MAX_ADVANCE_US;
/// Step of the clock, in emulated microseconds, while telegrams wait for room in the queue or the last frame is still
/// on the bus.
const ROOM_US: u64 = 100;
/// Bits of the frames for which the clock advances while a frame waits for room: 16 of the shortest frames of CAN (no
/// data, 44 bits and 3 bits of intermission). The queue holds four times as many frames, so the bus never runs out of
/// frames. The emulator takes a snapshot for its history at each request, so a request for 16 frames costs less than 16
/// requests.
const ROOM_BITS: u64 = 16 * 47;
/// Longest emulated time, in microseconds, between two counts of the frames that have ended. The count uses the
/// journal, which keeps only the last 65,536 frames of all buses.
const COUNT_US: u64 = 100_000;
/// Longest wait in which no frame makes progress: emulated time with the stepped clock, real time with the real-time
/// clock.
const PATIENCE: Duration = Duration::from_secs(1);
/// Minimum emulated time, in microseconds, between two requests that send frames with the real-time clock, unless a
/// request is full: each request wakes up the emulator and this command, which costs more than its frames. canplayer of
/// can-utils sends once per millisecond, too. With the stepped clock, longest advance of a request while another client
/// advances the clock too: each of them is late by the advances of the other.
const PART_US: u64 = 1_000;
/// Pause between two attempts with the real-time clock.
const PAUSE: Duration = Duration::from_millis(1);

/// Checks that no gap between two frames in the order of their times is too long.
fn check_gaps(log: &[AddressedMessage], unit: &str, path: &Path) -> Result<(), CliError> {
    for (before, frame) in log.iter().zip(log.iter().skip(1)) {
        let gap_us = frame.time_us.saturating_sub(before.time_us);
        if gap_us > LONGEST_GAP_US {
            let right = format!(
                "{unit} {}: its frame comes {} after the preceding frame; the longest gap in a log is {}",
                frame.at,
                time::seconds(gap_us),
                time::seconds(LONGEST_GAP_US)
            );
            return Err(CliError::Argument { text: path.display().to_string(), right });
        }
    }
    Ok(())
}

/// Prints a note for frames with an earlier time than a preceding frame of their bus. `earlier` has their positions.
fn note_earlier(earlier: &[usize], unit: &str, path: &Path) {
    let Some((first, others)) = earlier.split_first() else { return };
    let path = path.display();
    output::note(&match others.len() as u64 {
        0 => format!(
            "{path}: {unit} {first}: its time is before the time of an earlier frame; it is sent at once"
        ),
        count => format!(
            "{path}: {unit} {first}: its time is before the time of an earlier frame, as in {}; they are sent at once",
            plural(count, format_args!("later {unit}"))
        ),
    });
}

/// Changes the time of each message from its end to its start, at which it is sent, and sorts the messages by these
/// times.
fn begin_messages(log: &mut [AddressedMessage], buses: &Buses) {
    let duration = |it: &AddressedMessage| match &it.message {
        Message::Frame(frame) => frame_us(frame, buses.bit_s(it.bus)),
        Message::Telegram(octets) => telegram_us(octets, buses.bit_s(it.bus)),
    };
    // The first message of a log may end at time 0, but cannot start before 0. So all times are first shifted by the
    // duration of the longest message.
    let longest = log.iter().map(duration).max().unwrap_or(0);
    for it in log.iter_mut() {
        it.time_us = it.time_us.saturating_add(longest).saturating_sub(duration(it));
    }
    // Messages of one bus keep their order. Messages of different buses are then sorted by their times.
    put_in_order(log);
    log.sort_by_key(|it| it.time_us);
}

/// Plays the frames of a log on a bus.
pub(in super::super) fn play(args: &Play) -> Result<(), CliError> {
    let log = read(&args.log)?;
    let unit = log.unit;
    let buses = Buses::of(&Session::open(&args.instance, 0)?)?;
    let mut log = log.aim(&args.select, args.bus.as_deref(), &buses)?;
    note_earlier(&put_in_order(&mut log), unit, &args.log);
    let ends = || log.iter().map(|it| it.time_us);
    let length_us = ends().max().zip(ends().min()).map_or(0, |(last, first)| last - first);
    begin_messages(&mut log, &buses);
    check_gaps(&log, unit, &args.log)?;
    let Some(first) = log.first() else {
        if args.allow_empty {
            return output::print("0 frames\n");
        }
        return Err(nothing(&args.log, "it has no frame to play; --allow-empty accepts that"));
    };
    let start_us = first.time_us;
    // The times of a log may be very large, so the time of the first frame is subtracted.
    log.iter_mut().for_each(|it| it.time_us = it.time_us.saturating_sub(start_us));
    let session = Session::open(&args.instance, length_us)?;
    let next = session.ask(Op::Journal { from: u64::MAX, max: 1 })?.journal_part()?.end;
    let mut player = Player::new(&session, &buses, &log, next);
    let played = match buses.info.is_stepped {
        true => player.stepped().map(|clock| clock.text()),
        false => player.in_real_time().map(|timing| timing.text()),
    };
    let frames = plural(log.len() as u64, "frame");
    let sent = player.accepted;
    let timing = played.inspect_err(|_| output::note(&format!("{sent} of {frames} were sent")))?;
    output::print(&format!("{frames} in {}{timing}\n", time::short(length_us)))
}

/// Timing of a log that was played with the real-time clock. Times are emulated, in microseconds.
struct Timing {
    took_us: u64,
    latest_us: u64,
}

impl Timing {
    fn text(&self) -> String {
        let Timing { took_us, latest_us } = self;
        format!(" of the log; sent within {}, {}", time::short(*took_us), lateness(*latest_us))
    }
}

/// Describes the longest delay of a frame.
fn lateness(latest_us: u64) -> String {
    match latest_us {
        0 => "no frame late".to_owned(),
        latest_us => format!("up to {} late", time::short(latest_us)),
    }
}

/// The stepped clock in the time of the log, in microseconds: 0 is the time of the first frame.
#[derive(Default)]
struct SteppedClock {
    /// Emulated time of the first frame; `None` before the first request.
    begin_us: Option<u64>,
    now_us: u64,
    /// Time until which other clients are assumed to advance the clock too; 0 if no other client has moved the clock.
    shared_until_us: u64,
    /// Longest delay of a frame after another client has moved the clock.
    latest_us: u64,
}

impl SteppedClock {
    fn is_shared(&self) -> bool {
        self.now_us < self.shared_until_us
    }

    /// True if another client has moved the clock.
    fn was_shared(&self) -> bool {
        self.shared_until_us > 0
    }

    /// Longest time for which one request advances the clock.
    fn part_us(&self) -> u64 {
        if self.is_shared() { PART_US } else { COUNT_US }
    }

    /// Takes over the emulated time that the emulator has reported.
    fn is_at(&mut self, time_us: u64) {
        let now_us = time_us.saturating_sub(*self.begin_us.get_or_insert(time_us));
        if now_us != self.now_us {
            self.now_us = now_us;
            self.shared_until_us = now_us.saturating_add(COUNT_US);
        }
    }

    /// Notes that a frame with the time `due_us` is sent now. The advance before the frame may have reached the end of the
    /// time in which the clock is assumed to be shared.
    fn sends(&mut self, due_us: u64) {
        if self.was_shared() {
            self.latest_us = self.latest_us.max(self.now_us.saturating_sub(due_us));
        }
    }

    fn text(&self) -> String {
        if !self.was_shared() {
            return String::new();
        }
        format!(" of the log; another client moved the clock, {}", lateness(self.latest_us))
    }
}

/// Plays the frames of a log.
struct Player<'a> {
    session: &'a Session,
    buses: &'a Buses,
    log: &'a [AddressedMessage],
    /// Time of the first frame.
    start_us: u64,
    /// Number of frames that the buses have accepted.
    accepted: usize,
    /// Number of frames that have ended on their bus.
    left: usize,
    /// Indices of the accepted frames that have not ended, for each bus.
    pending: BTreeMap<BusIndex, VecDeque<usize>>,
    /// Number of the next record of the journal.
    next: u64,
    /// Time of the last count of ended frames, in microseconds.
    counted_us: u64,
    /// Sum of `accepted` and `left` at the last progress. `waited` is the duration of the wait since then.
    moved: usize,
    waited: Duration,
}

impl<'a> Player<'a> {
    /// Creates a player of a log with at least one frame. `next` is the number of the next record of the journal.
    fn new(session: &'a Session, buses: &'a Buses, log: &'a [AddressedMessage], next: u64) -> Self {
        let start_us = log.first().map_or(0, |first| first.time_us);
        Player {
            session,
            buses,
            log,
            start_us,
            accepted: 0,
            left: 0,
            pending: BTreeMap::new(),
            next,
            counted_us: 0,
            moved: 0,
            waited: Duration::ZERO,
        }
    }

    /// Advances the clock from frame to frame, then until the last frame has ended.
    fn stepped(&mut self) -> Result<SteppedClock, CliError> {
        let mut clock = SteppedClock::default();
        while let Some(next) = self.log.get(self.accepted) {
            if clock.is_shared() {
                clock.is_at(self.session.ask(Op::Time)?.time()?);
            }
            if next.time_us.saturating_sub(clock.now_us) > COUNT_US {
                self.count_within_gap(&mut clock, next.time_us)?;
            }
            if self.send_part(&mut clock)? {
                let us = self.room_us();
                self.wait_for(&mut clock, us)?;
            }
            self.count_at(clock.now_us)?;
        }
        while !self.all_have_left()? {
            self.wait_for(&mut clock, ROOM_US)?;
        }
        Ok(clock)
    }

    /// Advances the clock, so that frames can leave the queues of the bus.
    fn wait_for(&mut self, clock: &mut SteppedClock, us: u64) -> Result<(), CliError> {
        self.note_wait(Duration::from_micros(us))?;
        self.request_at(clock, vec![Op::Advance { us }]).map(drop)
    }

    /// Returns the emulated time, in microseconds, after which the next message tries again to get room in the queue of
    /// its bus.
    fn room_us(&self) -> u64 {
        match self.log.get(self.accepted) {
            Some(AddressedMessage { bus, message: Message::Frame(_), .. }) => {
                (ROOM_BITS * 1_000_000 / self.buses.bit_s(*bus)).max(ROOM_US)
            }
            _ => ROOM_US,
        }
    }

    /// Advances the clock in parts up to `due_us`, and counts the accepted frames that end on their bus during this
    /// time.
    fn count_within_gap(&mut self, clock: &mut SteppedClock, due_us: u64) -> Result<(), CliError> {
        let mut waited = Duration::ZERO;
        while waited < PATIENCE && clock.now_us < due_us {
            let before = self.left;
            self.count_left()?;
            if self.left >= self.accepted {
                break;
            }
            if self.left > before {
                waited = Duration::ZERO;
            }
            let us = clock.part_us().min(due_us - clock.now_us);
            self.request_at(clock, vec![Op::Advance { us }])?;
            waited += Duration::from_micros(us);
        }
        Ok(())
    }

    /// Sends the next frames, and advances the clock between them. Returns true if there is no room for the next frame.
    fn send_part(&mut self, clock: &mut SteppedClock) -> Result<bool, CliError> {
        let part = &self.log[self.accepted..];
        let mut ops = Vec::with_capacity(MAX_OPS);
        let mut then_us = clock.now_us;
        for it in part {
            let us = it.time_us.saturating_sub(then_us);
            let sends = sends(it);
            // The first operation of the request reads the clock.
            let is_full = ops.len() + 2 + sends.len() > MAX_OPS;
            if is_full || !ops.is_empty() && then_us + us - clock.now_us > clock.part_us() {
                break;
            }
            if clock.is_shared() && us > clock.part_us() {
                ops.push(Op::Advance { us: clock.part_us() });
                break;
            }
            ops.extend((us > 0).then_some(Op::Advance { us }));
            then_us += us;
            ops.extend(sends);
        }
        Ok(!self.request_at(clock, ops)?)
    }

    /// Sends operations like [`Player::request`], and keeps the clock: the emulator executes a request as a whole, but other
    /// clients may have moved the clock before it.
    fn request_at(&mut self, clock: &mut SteppedClock, mut ops: Vec<Op>) -> Result<bool, CliError> {
        ops.insert(0, Op::Time);
        let log = self.log;
        let mut due = log[self.accepted..].iter();
        self.request(&ops, |op, reply| match (op, reply) {
            (Op::Time, Reply::Time(time_us)) => clock.is_at(*time_us),
            (Op::Advance { us }, _) => clock.now_us += us,
            (Op::BusSend { .. } | Op::TelegramSend { is_last: true, .. }, _) => {
                clock.sends(due.next().map_or(u64::MAX, |it| it.time_us));
            }
            _ => {}
        })
    }

    /// Sends operations in one request, and counts the frames that the buses have accepted. Passes each operation to
    /// `executed`, with its reply. Returns false if there is no room for the next frame; the operations after that frame
    /// are not executed.
    fn request(&mut self, ops: &[Op], mut executed: impl FnMut(&Op, &Reply)) -> Result<bool, CliError> {
        for (op, reply) in ops.iter().zip(self.session.replies(ops)?) {
            match (op, reply) {
                (_, Reply::Error(refused)) if refused.code == Code::QUEUE_FULL => return Ok(false),
                (_, Reply::Error(refused)) => return Err(ClientError::Refused(refused).into()),
                (Op::BusSend { bus, .. } | Op::TelegramSend { bus, is_last: true, .. }, reply) => {
                    self.pending.entry(*bus).or_default().push_back(self.accepted);
                    self.accepted += 1;
                    executed(op, &reply);
                }
                (op, reply) => executed(op, &reply),
            }
        }
        Ok(true)
    }

    /// Waits for the time of each frame, and until the last frame has ended.
    fn in_real_time(&mut self) -> Result<Timing, CliError> {
        let interrupts = Interrupts::catch()?;
        let begin_us = self.session.ask(Op::Time)?.time()?;
        let mut timing = Timing { took_us: 0, latest_us: 0 };
        let mut now_us = begin_us;
        let mut part_us = begin_us;
        while let Some(next) = self.log.get(self.accepted) {
            let left_us = self.due_us(next, begin_us).max(part_us).saturating_sub(now_us);
            if left_us > 0 {
                self.count_at(now_us)?;
                // Sleeps at most 10 ms before the next query, because emulated time can run faster or slower than real
                // time.
                pause(&interrupts, Duration::from_micros(left_us.min(10_000)))?;
                now_us = self.session.ask(Op::Time)?.time()?;
                continue;
            }
            let has_room = self.send_due(begin_us, &mut now_us, &mut timing)?;
            // Frames that are late are sent at once.
            if self.log.get(self.accepted).is_some_and(|next| self.due_us(next, begin_us) > now_us) {
                part_us = now_us + PART_US;
            }
            self.count_at(now_us)?;
            if !has_room {
                self.note_wait(PAUSE)?;
                pause(&interrupts, PAUSE)?;
            } else if interrupts.any() {
                return Err(CliError::Interrupted);
            }
        }
        while !self.all_have_left()? {
            self.note_wait(PAUSE)?;
            pause(&interrupts, PAUSE)?;
        }
        Ok(timing)
    }

    /// Returns the emulated time at which a frame is to be sent.
    fn due_us(&self, it: &AddressedMessage, begin_us: u64) -> u64 {
        begin_us + it.time_us.saturating_sub(self.start_us)
    }

    /// Sends the frames with a time of at most `now_us`, as many as fit into one request, and reads the clock. Returns
    /// false if there is no room for the next frame.
    fn send_due(&mut self, begin_us: u64, now_us: &mut u64, timing: &mut Timing) -> Result<bool, CliError> {
        let due = self.log[self.accepted..].iter().take_while(|it| self.due_us(it, begin_us) <= *now_us);
        // The last operation of the request reads the clock.
        let mut ops = Vec::with_capacity(MAX_OPS);
        for sends in due.map(sends) {
            if ops.len() + sends.len() >= MAX_OPS {
                break;
            }
            ops.extend(sends);
        }
        ops.push(Op::Time);
        let before = self.accepted;
        let has_room = self.request(&ops, |_, reply| {
            if let Reply::Time(time_us) = reply {
                *now_us = *time_us;
            }
        })?;
        if !has_room {
            *now_us = self.session.ask(Op::Time)?.time()?;
        }
        for it in &self.log[before..self.accepted] {
            timing.latest_us = timing.latest_us.max(now_us.saturating_sub(self.due_us(it, begin_us)));
            timing.took_us = now_us.saturating_sub(begin_us);
        }
        Ok(has_room)
    }

    /// Returns true if all frames of the log have ended on their buses.
    fn all_have_left(&mut self) -> Result<bool, CliError> {
        self.count_left()?;
        Ok(self.left >= self.log.len())
    }

    /// Counts the frames that have ended, if the last count was long before `now_us`.
    fn count_at(&mut self, now_us: u64) -> Result<(), CliError> {
        if now_us.saturating_sub(self.counted_us) < COUNT_US {
            return Ok(());
        }
        self.counted_us = now_us;
        self.count_left()
    }

    /// Counts the frames that have ended on their buses. In the journal, these are frames of guest 0, which is the sender
    /// of played frames. The frames that other clients send come from guest 0, too.
    fn count_left(&mut self) -> Result<(), CliError> {
        if self.left < self.accepted {
            let part = read_journal(self.next, |op| self.session.ask(op))?;
            let log = self.log;
            for record in part.records.iter().filter(|record| record.event.guest() == Some(0)) {
                let Source::Bus(bus) = record.event.source() else { continue };
                let pending = self.pending.entry(bus).or_default();
                // A message that was disturbed is not complete in the journal.
                let message = Message::of_record(record);
                let is_same = |index: &usize| message.as_ref().is_none_or(|it| log[*index].message == *it);
                // The octets of a disturbed telegram can be others in the journal.
                let other = matches!(message, Some(Message::Telegram(_))).then_some(0);
                if let Some(place) =
                    pending.iter().position(is_same).or(other.filter(|_| !pending.is_empty()))
                {
                    pending.remove(place);
                    self.left += 1;
                }
            }
            self.next = part.end;
        }
        Ok(())
    }

    /// Adds `time` to the duration of the present wait. The wait ends when the bus accepts a frame, or when a frame has
    /// ended.
    ///
    /// # Errors
    /// No frame has made progress for too long.
    fn note_wait(&mut self, time: Duration) -> Result<(), CliError> {
        let moved = self.accepted + self.left;
        if moved > self.moved {
            (self.moved, self.waited) = (moved, Duration::ZERO);
        }
        self.waited += time;
        if self.waited <= PATIENCE {
            return Ok(());
        }
        output::complain(&format!(
            "{} not sent, and none left within {} s: no other station acknowledges them, or other stations use the \
             whole bus",
            plural(self.log.len().saturating_sub(self.left) as u64, "frame"),
            PATIENCE.as_secs()
        ));
        Err(CliError::Reported)
    }
}

/// Returns the operations that send a message.
fn sends(it: &AddressedMessage) -> Vec<Op> {
    let bus = it.bus;
    match &it.message {
        Message::Frame(frame) => vec![Op::BusSend { bus, frame: Some(*frame) }],
        Message::Telegram(octets) => {
            let parts: Vec<_> = octets.chunks(FilePart::MAX).filter_map(FilePart::new).collect();
            let last = parts.len().saturating_sub(1);
            let op = |(at, part)| Op::TelegramSend { bus, is_last: at == last, part };
            parts.into_iter().enumerate().map(op).collect()
        }
    }
}

/// Waits, unless the user interrupts the command.
fn pause(interrupts: &Interrupts, time: Duration) -> Result<(), CliError> {
    if interrupts.any() {
        return Err(CliError::Interrupted);
    }
    std::thread::sleep(time);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moved_clock_without_a_late_frame_is_reported_as_such() {
        let mut clock = SteppedClock::default();
        clock.is_at(1_000);
        clock.sends(0);
        assert_eq!(clock.text(), "");
        clock.is_at(6_000);
        clock.sends(5_000);
        assert_eq!(clock.text(), " of the log; another client moved the clock, no frame late");
        clock.sends(3_000);
        assert_eq!(clock.text(), " of the log; another client moved the clock, up to 2 ms late");
        let timing = Timing { took_us: 10_000, latest_us: 0 };
        assert_eq!(timing.text(), " of the log; sent within 10 ms, no frame late");
    }
}
