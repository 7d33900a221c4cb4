//! Tests of the drive through its interface to the bus.

mod catch_up;
mod exchange;
mod mapping;
mod service;
mod states;

use super::*;

const INTERVAL: u32 = 2000;

/// A drive that is alone on a bus; `now` is the time of the next SYNC edge.
struct Bench {
    drive: Drive,
    now: u64,
}

impl Bench {
    fn new(cfg: &DriveConfig) -> Self {
        Bench { drive: Drive::new(cfg, 500).unwrap(), now: 0 }
    }

    /// Switches SYNC mode on and waits for the lock time.
    fn synchronized(cfg: &DriveConfig) -> Self {
        let mut bench = Bench::new(&DriveConfig { lock_time_us: 0, ..cfg.clone() });
        bench.drive.action_command(&ActionCommand::sync_mode(ActionCommand::ALL_SLAVES, true));
        bench.edge();
        bench
    }

    fn edge(&mut self) -> &mut Self {
        self.drive.sync_edge(self.now, INTERVAL);
        self.now += u64::from(INTERVAL);
        self
    }

    fn lost_edge(&mut self) -> &mut Self {
        self.drive.interval_without_edge(self.now, INTERVAL);
        self.now += u64::from(INTERVAL);
        self
    }

    fn send(&mut self, channel: Channel, words: &[u16]) -> &mut Self {
        self.drive.reference_frame(channel, &words_of(words));
        self
    }

    fn control(&mut self, word: u16) -> &mut Self {
        self.drive.action_command(&ActionCommand::control_word(1 << self.drive.slave_number(), word));
        self
    }

    fn sync_mode(&mut self, on: bool) -> &mut Self {
        self.drive.action_command(&ActionCommand::sync_mode(1 << self.drive.slave_number(), on));
        self
    }

    /// Returns the answer to a parameter job.
    fn job(&mut self, number: u16, access: Access) -> ParameterResult {
        self.drive.parameter_job(&ParameterJob::new(number, access).unwrap()).result()
    }

    fn p(&self, number: u16) -> u32 {
        self.drive.parameter(number).unwrap()
    }
}

fn words_of(words: &[u16]) -> Payload {
    let mut all = [0; 4];
    all[..words.len()].copy_from_slice(words);
    Payload::from_words(all, words.len())
}

fn demo() -> DriveConfig {
    DriveConfig::demo("drive", 3)
}

/// Returns the demo drive with another card configuration.
fn with_zk(change: impl FnOnce(&mut ZkParameters)) -> DriveConfig {
    let mut zk = demo().standard_mapping();
    change(&mut zk);
    DriveConfig { zk: Some(zk), ..demo() }
}

fn zk_fault(cfg: &DriveConfig) -> (u8, ZkError) {
    match Drive::new(cfg, 500) {
        Err(DriveError::Zk { drive, zk, reason, .. }) if drive == cfg.name => (zk, reason),
        other => panic!("no ZK error: {other:?}"),
    }
}
