//! A queue of many participants, each with the time of its next event. A tournament tree finds the earliest event
//! without a search over all participants.

/// Entry of a participant that has no event.
pub(crate) const NEVER: u64 = u64::MAX;

/// Number of participants in a group. A group is searched in order, because that takes less time than a tree of this size.
const GROUP: usize = 8;

/// Times of several participants, in groups, and the earliest times of the groups as a tree. Each node has the earlier
/// time of its two children. The root is at index 1.
pub(crate) struct DueQueue {
    groups: Vec<[u64; GROUP]>,
    /// Number of leaves of the tree, one for each group; a power of two.
    size: usize,
    times: Vec<u64>,
}

impl DueQueue {
    /// Creates a queue of `count` participants without events.
    pub(crate) fn of(count: usize) -> Self {
        let size = count.div_ceil(GROUP).max(1).next_power_of_two();
        DueQueue { groups: vec![[NEVER; GROUP]; size], size, times: vec![NEVER; 2 * size] }
    }

    /// Makes room for `count` participants.
    pub(crate) fn grow(&mut self, count: usize) {
        if count <= self.size * GROUP {
            return;
        }
        let old = core::mem::replace(self, DueQueue::of(count));
        for (participant, time) in old.groups.iter().flatten().enumerate() {
            self.set(participant, *time);
        }
    }

    /// Sets the next time of participant `participant`.
    #[inline]
    pub(crate) fn set(&mut self, participant: usize, time: u64) {
        let group = &mut self.groups[participant / GROUP];
        group[participant % GROUP] = time;
        let mut earlier = group.iter().copied().fold(NEVER, u64::min);
        let mut node = self.size + participant / GROUP;
        while self.times[node] != earlier {
            self.times[node] = earlier;
            if node == 1 {
                return;
            }
            earlier = earlier.min(self.times[node ^ 1]);
            node /= 2;
        }
    }

    /// Returns the next time of participant `participant`.
    pub(crate) fn time(&self, participant: usize) -> u64 {
        self.groups[participant / GROUP][participant % GROUP]
    }

    /// Returns the earliest time.
    #[inline]
    pub(crate) fn first(&self) -> u64 {
        self.times[1]
    }

    /// Returns the earliest time of all participants except `participant`.
    #[inline]
    pub(crate) fn first_besides(&self, participant: usize) -> u64 {
        let mut group = self.groups[participant / GROUP];
        group[participant % GROUP] = NEVER;
        let mut first = group.into_iter().fold(NEVER, u64::min);
        let mut node = self.size + participant / GROUP;
        while node > 1 {
            first = first.min(self.times[node ^ 1]);
            node /= 2;
        }
        first
    }

    /// Returns the first participant from `from` on with a time of at most `now`.
    #[inline]
    pub(crate) fn due(&self, from: usize, now: u64) -> Option<usize> {
        let (group, place) = (from / GROUP, from % GROUP);
        let in_group = |group: usize, place: usize| {
            let found = self.groups[group][place..].iter().position(|time| *time <= now);
            found.map(|found| group * GROUP + place + found)
        };
        if place == 0 {
            return in_group(self.group_due(group, now)?, 0);
        }
        if group >= self.size {
            return None;
        }
        in_group(group, place).or_else(|| in_group(self.group_due(group + 1, now)?, 0))
    }

    /// Returns the first group from `from` on with a time of at most `now`.
    #[inline]
    fn group_due(&self, from: usize, now: u64) -> Option<usize> {
        if from >= self.size {
            return None;
        }
        // A search over all groups starts at the root.
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
