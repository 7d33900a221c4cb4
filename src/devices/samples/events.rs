//! Events to test with, of every kind that anybody has registered.

use crate::devices::catalogue;
use crate::journal::{Event, Packer};
use proptest::prelude::*;

/// Any event of any kind.
pub(crate) fn event() -> impl Strategy<Value = Event> {
    let number = prop_oneof![0..8_u32, any::<u32>()];
    let what = (any::<(u16, u8)>(), proptest::array::uniform5(number));
    let kind = proptest::sample::select(&catalogue().kinds[..]);
    (kind, what).prop_filter_map("numbers that mean something", |(kind, ((index, number), halves))| {
        let mut packer = Packer::new(kind, index, number);
        halves.into_iter().for_each(|half| packer.put(half));
        let words = kind.normal(packer.words(), catalogue())?;
        Some(catalogue().event(words).unwrap())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::journal::Names;
    use crate::journal::jsonl::Jsonl;
    use crate::journal::text::Text;
    use crate::journal::{Format, Record};
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;

    #[test]
    fn every_kind_is_among_the_samples() {
        let (mut runner, events) = (TestRunner::deterministic(), event());
        let mut drawn = || events.new_tree(&mut runner).unwrap().current().kind();
        let mut missing = catalogue().kinds.clone();
        for _ in 0..10_000 {
            let kind = drawn();
            missing.retain(|other| *other != kind);
        }
        assert_eq!(missing, Vec::<&crate::journal::Kind>::new());
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn words_give_the_event_back(event in event()) {
            prop_assert_eq!(catalogue().event(event.words()), Some(event));
        }

        #[test]
        fn words_differ_if_the_events_do(one in event(), other in event()) {
            prop_assert_eq!(one == other, one.words() == other.words());
        }

        #[test]
        fn every_event_reads(event in event()) {
            let record = Record { seq: 7, time_us: 8, event, count: 1, period_us: 0, latency_us: None };
            let (mut text, mut json) = (String::new(), String::new());
            Text::new(Names::default(), catalogue()).record(&record, &mut text);
            Jsonl::new(Names::default(), catalogue()).record(&record, &mut json);
            prop_assert!(text.ends_with('\n') && text.lines().count() == 1, "{}", text);
            let json: serde_json::Value = serde_json::from_str(&json).unwrap();
            prop_assert_eq!(json["kind"].as_str(), Some(event.kind().name()));
        }
    }
}
