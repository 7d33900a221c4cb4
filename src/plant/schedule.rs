//! Which medium is due next: a tournament among them, in which an event plays only the matches of those that it concerns.

/// When each of a number of things is due.
pub(super) struct Schedule {
    /// From index 1 on a tree of the earliest times; its leaves are the second half.
    times: Vec<u64>,
}

impl Schedule {
    const NEVER: u64 = u64::MAX;

    /// Of so many things, none of which is due.
    pub(super) fn new(count: usize) -> Self {
        Schedule { times: vec![Self::NEVER; 2 * count.max(1).next_power_of_two()] }
    }

    /// Number `index` is due at `time`.
    #[inline]
    pub(super) fn set(&mut self, index: usize, time: u64) {
        let mut node = self.times.len() / 2 + index;
        self.times[node] = time;
        while node > 1 {
            let earliest = self.times[node].min(self.times[node ^ 1]);
            node /= 2;
            if self.times[node] == earliest {
                return;
            }
            self.times[node] = earliest;
        }
    }

    /// The earliest time, [`u64::MAX`] if nothing is due.
    #[inline]
    pub(super) fn time(&self) -> u64 {
        self.times[1]
    }

    /// The first thing that is due then.
    #[inline]
    pub(super) fn first(&self) -> usize {
        let (mut node, leaves) = (1, self.times.len() / 2);
        while node < leaves {
            node = 2 * node + usize::from(self.times[2 * node] != self.times[node]);
        }
        node - leaves
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_the_earliest_comes_first() {
        for count in [1, 2, 3, 7, 8, 33] {
            let mut random = fastrand::Rng::with_seed(count as u64);
            let (mut schedule, mut times) = (Schedule::new(count), vec![u64::MAX; count]);
            assert_eq!(schedule.time(), u64::MAX);
            for _ in 0..200 {
                let (index, time) = (random.usize(..count), random.u64(..5));
                times[index] = if time == 0 { u64::MAX } else { time };
                schedule.set(index, times[index]);
                let earliest = times.iter().copied().min();
                assert_eq!(Some(schedule.time()), earliest);
                assert_eq!(Some(schedule.first()), times.iter().position(|time| Some(*time) == earliest));
            }
        }
    }
}
