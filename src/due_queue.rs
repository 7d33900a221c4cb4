//! A queue of many participants, each with the time of its next event. A tournament tree finds the earliest event
//! without a search over all participants.

/// Entry of a participant that has no event.
pub(crate) const NEVER: u64 = u64::MAX;

/// Times of several participants, as a tree. Each node has the earlier time of its two children. The root is at index
/// 1.
pub(crate) struct DueQueue {
    /// Number of leaves; a power of two.
    size: usize,
    times: Vec<u64>,
}

impl DueQueue {
    /// Creates a queue of `count` participants without events.
    pub(crate) fn of(count: usize) -> Self {
        let size = count.max(1).next_power_of_two();
        DueQueue { size, times: vec![NEVER; 2 * size] }
    }

    /// Makes room for `count` participants.
    pub(crate) fn grow(&mut self, count: usize) {
        if count <= self.size {
            return;
        }
        let old = core::mem::replace(self, DueQueue::of(count));
        for participant in 0..old.size {
            self.set(participant, old.times[old.size + participant]);
        }
    }

    /// Sets the next time of participant `participant`.
    #[inline]
    pub(crate) fn set(&mut self, participant: usize, time: u64) {
        let mut node = self.size + participant;
        self.times[node] = time;
        while node > 1 {
            let earlier = self.times[node].min(self.times[node ^ 1]);
            node /= 2;
            if self.times[node] == earlier {
                return;
            }
            self.times[node] = earlier;
        }
    }

    /// Returns the earliest time.
    #[inline]
    pub(crate) fn first(&self) -> u64 {
        self.times[1]
    }

    /// Returns the earliest time of all participants except `participant`.
    #[inline]
    pub(crate) fn first_besides(&self, participant: usize) -> u64 {
        let (mut node, mut first) = (self.size + participant, NEVER);
        while node > 1 {
            first = first.min(self.times[node ^ 1]);
            node /= 2;
        }
        first
    }

    /// Returns the first participant from `from` on with a time of at most `now`.
    #[inline]
    pub(crate) fn due(&self, from: usize, now: u64) -> Option<usize> {
        if from >= self.size {
            return None;
        }
        // A search over all participants starts at the root.
        let mut node = if from == 0 { 1 } else { self.size + from };
        while self.times[node] > now {
            // Goes to the next subtree on the right. After the last subtree, the search ends.
            while node & 1 == 1 {
                node /= 2;
            }
            if node == 0 {
                return None;
            }
            node += 1;
        }
        while node < self.size {
            node = 2 * node + usize::from(self.times[2 * node] > now);
        }
        Some(node - self.size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn it_agrees_with_a_list(
            count in 1usize..40,
            sets in prop::collection::vec((0usize..40, prop_oneof![0u64..20, Just(NEVER)]), 0..60),
            now in 0u64..20,
        ) {
            let (mut queue, mut list) = (DueQueue::of(count / 2), vec![NEVER; count]);
            (1..=count).for_each(|count| queue.grow(count));
            for (participant, time) in sets {
                queue.set(participant % count, time);
                list[participant % count] = time;
            }
            prop_assert_eq!(queue.first(), list.iter().copied().min().unwrap());
            for participant in 0..count {
                let others = (0..count).filter(|other| *other != participant);
                prop_assert_eq!(queue.first_besides(participant), others.map(|other| list[other]).min().unwrap_or(NEVER));
            }
            for from in 0..count + 2 {
                let due = (from..count).find(|participant| list[*participant] <= now);
                prop_assert_eq!(queue.due(from, now), due, "{}", from);
            }
        }

        #[test]
        fn growing_forgets_nothing(times in prop::collection::vec(0u64..20, 1..40)) {
            let mut queue = DueQueue::of(0);
            for (participant, time) in times.iter().enumerate() {
                queue.grow(participant + 1);
                queue.set(participant, *time);
            }
            prop_assert_eq!(queue.first(), *times.iter().min().unwrap());
        }
    }
}
