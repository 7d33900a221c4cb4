//! Latencies with their quantiles, and the results compared with the targets.

use std::time::{Duration, Instant};

/// Maximum number of samples of one measurement. If there are more samples, the last ones are kept.
const KEPT: usize = 1 << 20;
/// Number of durations from which the cost of reading the clock is calculated.
const CLOCK_READS: usize = 10_000;

/// The latencies of one measurement.
pub(crate) struct Samples {
    nanoseconds: Vec<u64>,
    /// Index of the next sample to replace, when the maximum number is reached.
    next: usize,
    /// Time that reading the clock adds to a measured duration.
    clock: Duration,
}

impl Samples {
    /// Makes an empty set of samples.
    pub(crate) fn new() -> Self {
        let mut empty = Samples { nanoseconds: Vec::with_capacity(KEPT), next: 0, clock: Duration::ZERO };
        for _ in 0..CLOCK_READS {
            empty.time(|| ());
        }
        let clock = Duration::from_nanos(empty.quantile(0.5));
        empty.nanoseconds.clear();
        Samples { clock, ..empty }
    }

    /// Measures one run of `f`, without the cost of the clock.
    pub(crate) fn time(&mut self, f: impl FnOnce()) -> Duration {
        let start = Instant::now();
        f();
        let duration = start.elapsed().saturating_sub(self.clock);
        self.push(duration);
        duration
    }

    fn push(&mut self, duration: Duration) {
        let sample = duration.as_nanos() as u64;
        if self.nanoseconds.len() < KEPT {
            self.nanoseconds.push(sample);
        } else {
            self.nanoseconds[self.next] = sample;
            self.next = (self.next + 1) % KEPT;
        }
    }

    fn is_empty(&self) -> bool {
        self.nanoseconds.is_empty()
    }

    fn quantile(&self, part: f64) -> u64 {
        let mut sorted = self.nanoseconds.clone();
        sorted.sort_unstable();
        let place = (sorted.len() as f64 * part) as usize;
        sorted.get(place.min(sorted.len().saturating_sub(1))).copied().unwrap_or(0)
    }

    fn microseconds(&self, part: f64) -> f64 {
        self.quantile(part) as f64 / 1000.0
    }
}

/// Reference value for a median.
pub(crate) enum Target {
    /// At most this factor times the median of the other samples; the text names these samples.
    Times(f64, &'static str, Samples),
    /// At most the given number of microseconds. The other samples, which the text names, show the part that the
    /// emulator does not cause.
    Microseconds(f64, &'static str, Samples),
}

/// A measurement and its target.
pub(crate) struct Outcome {
    /// Name of the measured quantity.
    pub what: &'static str,
    /// The measured latencies.
    pub samples: Samples,
    /// Target of the measurement.
    pub target: Target,
}

impl Outcome {
    /// Prints the medians with the target. Prints nothing if the filter on the command line excludes this measurement.
    pub(crate) fn print(&self) {
        if self.samples.is_empty() {
            return;
        }
        println!();
        print_line(self.what, &self.samples);
        let median = self.samples.microseconds(0.5);
        let verdict = |met: bool| if met { "met" } else { "MISSED" };
        match &self.target {
            Target::Times(_, name, raw) if raw.is_empty() => println!("{name}: not measured"),
            Target::Times(times, name, raw) => {
                print_line(name, raw);
                let ratio = median / raw.microseconds(0.5);
                println!("{ratio:.2} times; target: at most {times} times: {}", verdict(ratio <= *times));
            }
            Target::Microseconds(most, name, raw) => {
                if !raw.is_empty() {
                    print_line(name, raw);
                }
                println!("target: at most {most} us: {}", verdict(median <= *most));
            }
        }
    }
}

fn print_line(name: &str, samples: &Samples) {
    let [median, late, latest] = [0.5, 0.99, 0.999].map(|part| samples.microseconds(part));
    println!("{name:<46} {median:>10.3} us median {late:>10.3} us 99 % {latest:>10.3} us 99.9 %");
}
