//! Hostile input of the adapter.

use super::session::{Event, Next, Session};
use super::wire;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::io::Cursor;
use std::sync::mpsc;

const REQUESTS: [&str; 19] = [
    "initialize",
    "launch",
    "configurationDone",
    "setBreakpoints",
    "setExceptionBreakpoints",
    "threads",
    "pause",
    "continue",
    "next",
    "stepIn",
    "stepOut",
    "stackTrace",
    "scopes",
    "variables",
    "setVariable",
    "evaluate",
    "exceptionInfo",
    "stepBack",
    "reverseContinue",
];

fn arguments() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        "[a-z/.]{0,8}".prop_map(Value::from),
    ];
    let name = prop::sample::select(vec![
        "program",
        "line",
        "source",
        "path",
        "breakpoints",
        "frameId",
        "variablesReference",
        "name",
        "value",
        "expression",
        "start",
        "count",
        "levels",
        "startFrame",
        "maxTime",
        "device",
        "linesStartAt1",
    ]);
    leaf.prop_recursive(3, 24, 6, move |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..4).prop_map(Value::from),
            prop::collection::vec((name.clone(), inner), 0..6)
                .prop_map(|pairs| pairs.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()),
        ]
    })
}

proptest! {
    #![proptest_config(crate::property_tests())]

    /// Every request gets one answer with its number, whatever its arguments are.
    #[test]
    fn random_requests_get_one_answer_each(
        requests in prop::collection::vec((prop::sample::select(REQUESTS.to_vec()), arguments()), 1..20)
    ) {
        let (events, _received) = mpsc::channel();
        let mut session = Session::new(events);
        for (seq, (command, arguments)) in requests.into_iter().enumerate() {
            let mut answers = Vec::new();
            let message =
                json!({ "seq": seq, "type": "request", "command": command, "arguments": arguments });
            prop_assert!(matches!(session.take(Event::Message(message), &mut answers), Next::Continue));
            let responses: Vec<_> = answers.iter().filter(|answer| answer["type"] == "response").collect();
            prop_assert_eq!(responses.len(), 1);
            prop_assert_eq!(&responses[0]["request_seq"], &json!(seq));
        }
    }

    /// Random bytes end the connection with an error or at the end of the input.
    #[test]
    fn random_bytes_end_the_connection(
        bytes in prop_oneof![
            prop::collection::vec(any::<u8>(), 0..200),
            "(Content-Length: [0-9]{0,22}\r\n\r\n[{}a-z\":]{0,9}){0,3}".prop_map(String::into_bytes),
        ]
    ) {
        let (events, received) = mpsc::channel();
        wire::read_all(&mut Cursor::new(bytes), &events);
        drop(events);
        let all: Vec<_> = received.iter().collect();
        let ends = all.iter().filter(|event| matches!(event, Event::Closed(_))).count();
        prop_assert_eq!(ends, 1);
    }
}
