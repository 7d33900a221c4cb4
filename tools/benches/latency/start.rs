//! Time from the start of `commram run` to the first answered peek of a client that waits for the emulator. For
//! comparison: a process that has only a bare iceoryx2 server.

use crate::bare::{LOOK, Pair};
use crate::support::PATIENCE;
use crate::support::child;
use crate::support::emulator::{attach, connect, unique_instance};
use crate::support::report::{Outcome, Samples, Target};
use commram::channel::Client;
use commram::devices::omega_drive_line_2::registers::NODE2;
use commram::identity::DeviceIndex;
use commram::memory::Width;
use criterion::Criterion;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// `w_OPTION_STATUS` of node 2, and its value after power-on.
const W_OPTION_STATUS: u32 = NODE2 + 2;
const START_UP: u32 = 0x0001;

/// Measures the start. The processes are not pinned, as in a script that starts an emulator and continues at once.
pub(crate) fn first_peek(criterion: &mut Criterion) -> Outcome {
    let (mut raw, mut samples) = (Samples::new(), Samples::new());
    let mut group = criterion.benchmark_group("start");
    group.sample_size(20);
    group.bench_function("bare iceoryx2 server to first answer", |bencher| {
        bencher.iter_custom(|times| {
            (0..times)
                .map(|number| {
                    let mut pair = None;
                    raw.time(|| pair.insert(Pair::start("sleeping", None)).exchange(number))
                })
                .sum()
        });
    });
    group.bench_function("commram run to first answered peek", |bencher| {
        bencher.iter_custom(|times| (0..times).map(|_| one_start(&mut samples)).sum());
    });
    group.finish();
    let what = "process start to first answered peek";
    Outcome { what, samples, target: Target::Microseconds(4_000.0, "bare iceoryx2 server", raw) }
}

fn one_start(samples: &mut Samples) -> Duration {
    let mut run = None;
    let duration = samples.time(|| {
        let run = run.insert(Run::start());
        let client = run.connect();
        let value = client.peek(DeviceIndex(0), W_OPTION_STATUS, Width::Word).expect("the emulator answers");
        assert_eq!(value, START_UP);
    });
    if let Some(run) = run {
        run.stop();
    }
    duration
}

/// A running `commram run`. It is killed when this value is dropped.
struct Run {
    process: Child,
    instance: String,
}

impl Run {
    fn start() -> Self {
        let instance = unique_instance();
        let mut command = Command::new(env!("CARGO_BIN_EXE_commram"));
        command.args(["run", "--clock", "stepped", "--instance", &instance]).stdout(Stdio::null());
        let process = command.spawn().expect("commram can be started");
        Run { process, instance }
    }

    /// Waits until the emulator is ready, and connects.
    fn connect(&mut self) -> Client {
        let start = Instant::now();
        while let Err(error) = attach(&self.instance) {
            assert!(start.elapsed() < PATIENCE, "{error}");
            std::thread::sleep(LOOK);
        }
        connect(&self.instance, Duration::ZERO)
    }

    fn stop(mut self) {
        connect(&self.instance, Duration::ZERO).stop().expect("the emulator accepts the request to end");
        let status = child::wait(&mut self.process);
        assert!(status.is_some_and(|status| status.success()), "commram run: {status:?}");
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        // `kill` has no effect on a process that has ended and for which `wait` was called.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
