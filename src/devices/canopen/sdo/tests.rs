//! A server between a test client and a dictionary of a few entries.

use super::*;
use proptest::prelude::*;

const BYTE: EntryAddress = EntryAddress { index: 0x2000, sub: 1 };
const BLOCK: EntryAddress = EntryAddress { index: 0x2001, sub: 0 };
const FIXED: EntryAddress = EntryAddress { index: 0x2002, sub: 0 };

/// A byte, a block of at most 20 bytes, and a read-only value.
#[derive(Clone, Default)]
struct Entries {
    byte: u8,
    block: Vec<u8>,
}

impl Dictionary for Entries {
    fn writable(&self, at: EntryAddress) -> Result<Length, Abort> {
        match at {
            BYTE => Ok(Length::Exactly(1)),
            BLOCK => Ok(Length::UpTo(20)),
            FIXED => Err(Abort::ReadOnly),
            _ => Err(Abort::NoObject),
        }
    }

    fn read(&self, at: EntryAddress) -> Result<Vec<u8>, Abort> {
        match at {
            BYTE => Ok(vec![self.byte]),
            BLOCK => Ok(self.block.clone()),
            FIXED => Ok(vec![1, 2, 3, 4]),
            _ => Err(Abort::NoObject),
        }
    }

    fn write(&mut self, at: EntryAddress, value: &[u8]) -> Result<(), Abort> {
        match (at, value) {
            (BYTE, [0xFF]) => return Err(Abort::Value),
            (BYTE, [byte]) => self.byte = *byte,
            _ => self.block = value.to_vec(),
        }
        Ok(())
    }
}

fn frame(command: u8, at: EntryAddress, data: [u8; 4]) -> Data {
    first(command, at, data)
}

fn aborted(at: EntryAddress, abort: Abort) -> Option<Data> {
    Some(first(0x80, at, abort.code().to_le_bytes()))
}

/// Reads an entry as a client does.
fn read(server: &mut Server, entries: &mut Entries, at: EntryAddress) -> Vec<u8> {
    let answer = server.request(frame(0x40, at, [0; 4]), entries).unwrap();
    if answer[0] & 2 != 0 {
        return answer[4..8 - usize::from(answer[0] >> 2 & 3)].to_vec();
    }
    let mut value = Vec::new();
    for toggle in [0, 0x10].into_iter().cycle() {
        let answer = server.request([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0], entries).unwrap();
        assert_eq!(answer[0] & 0xF0, toggle);
        value.extend_from_slice(&answer[1..8 - usize::from(answer[0] >> 1 & 7)]);
        if answer[0] & 1 != 0 {
            break;
        }
    }
    value
}

/// Writes an entry in segments as a client does. All answers except the last must be right.
fn write(
    server: &mut Server,
    entries: &mut Entries,
    at: EntryAddress,
    value: &[u8],
    is_sized: bool,
) -> Option<Data> {
    let length = if is_sized { (value.len() as u32).to_le_bytes() } else { [0; 4] };
    let mut answer = server.request(frame(0x20 | u8::from(is_sized), at, length), entries);
    if answer != Some(frame(0x60, at, [0; 4])) {
        return answer;
    }
    let segments = value.chunks(7).count();
    for (number, chunk) in value.chunks(7).enumerate() {
        let toggle = (number % 2) as u8 * TOGGLE;
        let mut request = [0; 8];
        request[0] = toggle | ((7 - chunk.len()) as u8) << 1 | u8::from(number + 1 == segments);
        request[1..=chunk.len()].copy_from_slice(chunk);
        answer = server.request(request, entries);
        if answer != Some([0x20 | toggle, 0, 0, 0, 0, 0, 0, 0]) {
            break;
        }
    }
    answer
}

#[test]
fn short_values_go_in_one_frame() {
    let (server, entries) = (&mut Server::default(), &mut Entries::default());
    assert_eq!(server.request(frame(0x2F, BYTE, [7, 0, 0, 0]), entries), Some(frame(0x60, BYTE, [0; 4])));
    assert_eq!(server.request(frame(0x40, BYTE, [0; 4]), entries), Some(frame(0x4F, BYTE, [7, 0, 0, 0])));
    // The request contains no number of bytes.
    assert_eq!(server.request(frame(0x22, BYTE, [9, 8, 7, 6]), entries), Some(frame(0x60, BYTE, [0; 4])));
    assert_eq!((entries.byte, read(server, entries, FIXED)), (9, vec![1, 2, 3, 4]));
}

#[test]
fn long_values_go_in_segments() {
    let (server, entries) = (&mut Server::default(), &mut Entries::default());
    for (length, is_sized) in [(20, true), (20, false), (14, true), (1, false)] {
        let value: Vec<u8> = (1..=length).collect();
        let answer = write(server, entries, BLOCK, &value, is_sized).unwrap();
        assert_eq!(answer[0] & 0xEF, 0x20, "{length}");
        assert_eq!(read(server, entries, BLOCK), value);
    }
}

#[test]
fn wrong_requests_are_aborted_and_change_nothing() {
    let mut server = Server::default();
    let mut entries = Entries { byte: 5, block: vec![1; 9] };
    let other = EntryAddress { index: 0x1002, sub: 0 };
    let cases = [
        (frame(0x2B, BYTE, [1, 2, 0, 0]), BYTE, Abort::TooLong),
        (frame(0x2F, BYTE, [0xFF, 0, 0, 0]), BYTE, Abort::Value),
        (frame(0x2F, FIXED, [0; 4]), FIXED, Abort::ReadOnly),
        (frame(0x2F, other, [0; 4]), other, Abort::NoObject),
        (frame(0x40, other, [0; 4]), other, Abort::NoObject),
        (frame(0x21, BLOCK, [21, 0, 0, 0]), BLOCK, Abort::TooLong),
        // Block transfers.
        (frame(0xA0, BLOCK, [0; 4]), BLOCK, Abort::Command),
        (frame(0xC0, BLOCK, [0; 4]), BLOCK, Abort::Command),
        // Segments without a first frame.
        ([0x60; 8], EntryAddress { index: 0, sub: 0 }, Abort::Command),
        ([0; 8], EntryAddress { index: 0, sub: 0 }, Abort::Command),
    ];
    for (request, at, abort) in cases {
        assert_eq!(server.request(request, &mut entries), aborted(at, abort), "{request:X?}");
    }
    let long: Vec<u8> = (0..21).collect();
    assert_eq!(write(&mut server, &mut entries, BLOCK, &long, false), aborted(BLOCK, Abort::TooLong));
    assert_eq!((entries.byte, entries.block), (5, vec![1; 9]));
}

#[test]
fn segments_must_toggle_and_have_the_announced_length() {
    let (server, entries) = (&mut Server::default(), &mut Entries { byte: 0, block: vec![3; 10] });
    server.request(frame(0x40, BLOCK, [0; 4]), entries);
    assert_eq!(server.request([0x70, 0, 0, 0, 0, 0, 0, 0], entries), aborted(BLOCK, Abort::Toggle));
    server.request(frame(0x21, BLOCK, [8, 0, 0, 0]), entries);
    assert_eq!(server.request([0x10; 8], entries), aborted(BLOCK, Abort::Toggle));
    server.request(frame(0x21, BLOCK, [8, 0, 0, 0]), entries);
    assert_eq!(
        server.request([1; 8], entries),
        aborted(BLOCK, Abort::TooShort),
        "seven of eight bytes, and no more"
    );
    server.request(frame(0x21, BLOCK, [8, 0, 0, 0]), entries);
    server.request([0; 8], entries);
    assert_eq!(server.request([0x11; 8], entries), aborted(BLOCK, Abort::TooLong));
    // The client gives up.
    server.request(frame(0x40, BLOCK, [0; 4]), entries);
    assert_eq!(server.request(frame(0x80, BLOCK, [0; 4]), entries), None);
    assert_eq!(
        server.request([0x60; 8], entries),
        aborted(EntryAddress { index: 0, sub: 0 }, Abort::Command)
    );
    assert_eq!(entries.block, [3; 10]);
}

fn request() -> impl Strategy<Value = Data> {
    let at = prop_oneof![Just(BYTE), Just(BLOCK), Just(FIXED), Just(EntryAddress { index: 0x2003, sub: 9 })];
    let named = (any::<u8>(), at, any::<[u8; 4]>()).prop_map(|(command, at, data)| frame(command, at, data));
    prop_oneof![
        named,
        any::<Data>(),
        (0..0x20_u8, any::<[u8; 7]>()).prop_map(|(command, rest)| {
            let mut data = [command; 8];
            data[1..].copy_from_slice(&rest);
            data
        })
    ]
}

/// Each request except an abort gets exactly one answer, and the entries keep valid values. This is true for
/// any requests.
fn each_request_has_one_answer(requests: &[Data]) {
    let (mut server, mut entries) = (Server::default(), Entries::default());
    for request in requests {
        let answer = server.request(*request, &mut entries);
        assert_eq!(answer.is_none(), request[0] >> 5 == 4);
        assert!(entries.block.len() <= 20 && entries.byte != 0xFF);
    }
    // The server still serves.
    assert_eq!(read(&mut server, &mut entries, FIXED), [1, 2, 3, 4]);
}

#[test]
fn fuzz_sdo_server() {
    crate::fuzz("sdo_server", |bytes| each_request_has_one_answer(bytes.as_chunks().0));
}

/// The input of the fuzzer: the first byte gives the number of bytes to write, or means that a block is read.
/// The bytes to write and the answers follow.
#[test]
fn fuzz_sdo_client() {
    crate::fuzz("sdo_client", |bytes| {
        let Some((head, rest)) = bytes.split_first() else { return };
        let is_read = head & 0x80 != 0;
        let written = if is_read { 0 } else { usize::from(head & 0x1F).min(rest.len()) };
        let (value, answers) = rest.split_at(written);
        let (client, _) = if is_read { Client::read(BLOCK, 30) } else { Client::write(BLOCK, value) };
        check_answers(client, answers.as_chunks().0);
    });
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn any_request_has_one_answer(requests in proptest::collection::vec(request(), 0..60)) {
        each_request_has_one_answer(&requests);
    }

    #[test]
    fn written_values_are_read_back(value in proptest::collection::vec(any::<u8>(), 1..=20), is_sized: bool) {
        let (mut server, mut entries) = (Server::default(), Entries::default());
        write(&mut server, &mut entries, BLOCK, &value, is_sized);
        prop_assert_eq!(read(&mut server, &mut entries, BLOCK), value);
    }
}

/// Runs a complete transfer between a client and the server.
fn carry_out(server: &mut Server, entries: &mut Entries, (mut client, mut request): (Client, Data)) -> Step {
    loop {
        let answer = server.request(request, entries).unwrap();
        match client.answered(answer) {
            Step::Send(next) => request = next,
            step => return step,
        }
    }
}

#[test]
fn a_client_gets_the_abort_code_of_the_server() {
    let (server, entries) = (&mut Server::default(), &mut Entries::default());
    for (transfer, abort) in [
        (Client::write(FIXED, &[1]), Abort::ReadOnly),
        (Client::write(BYTE, &[0xFF]), Abort::Value),
        (Client::write(BYTE, &[1, 2]), Abort::TooLong),
        (Client::write(BLOCK, &[0; 21]), Abort::TooLong),
        (Client::write(BYTE, &[]), Abort::TooShort),
        (Client::read(EntryAddress { index: 0x3000, sub: 0 }, 4), Abort::NoObject),
    ] {
        assert_eq!(carry_out(server, entries, transfer), Step::Aborted(abort.code()));
    }
    entries.block = vec![0; 8];
    let failed = |abort: Abort| Step::Failed(abort, first(0x80, BLOCK, abort.code().to_le_bytes()));
    assert_eq!(carry_out(server, entries, Client::read(BLOCK, 7)), failed(Abort::Memory));
    assert_eq!(Client::read(BLOCK, 7).0.give_up(), first(0x80, BLOCK, [0, 0, 4, 5]));
}

#[test]
fn a_client_compares_answers_with_its_request() {
    let failed = |abort: Abort| Step::Failed(abort, first(0x80, BLOCK, abort.code().to_le_bytes()));
    let (mut client, _) = Client::read(BLOCK, 20);
    assert_eq!(client.answered(first(0x41, BYTE, [8, 0, 0, 0])), Step::Ignored, "of another entry");
    assert_eq!(client.answered(first(0x41, BLOCK, [8, 0, 0, 0])), Step::Send([0x60, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(client.clone().answered([0x10, 1, 2, 3, 4, 5, 6, 7]), failed(Abort::Toggle));
    assert_eq!(client.clone().answered([0x01, 1, 2, 3, 4, 5, 6, 7]), failed(Abort::TooShort));
    assert_eq!(client.answered([0x00, 1, 2, 3, 4, 5, 6, 7]), Step::Send([0x70, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(client.clone().answered([0x11, 1, 2, 3, 4, 5, 6, 7]), failed(Abort::TooLong));
    assert_eq!(client.answered([0x1D, 8, 0, 0, 0, 0, 0, 0]), Step::Done(vec![1, 2, 3, 4, 5, 6, 7, 8]));
    let (mut client, _) = Client::write(BLOCK, &[0; 8]);
    assert_eq!(client.clone().answered([0x20, 0, 0, 0, 0, 0, 0, 0]), failed(Abort::Command));
    assert_eq!(client.answered(first(0x60, BLOCK, [0; 4])), Step::Send([0; 8]));
    assert_eq!(client.clone().answered([0x30, 0, 0, 0, 0, 0, 0, 0]), failed(Abort::Toggle));
    assert_eq!(client.answered([0x20, 0, 0, 0, 0, 0, 0, 0]), Step::Send([0x1D, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(client.answered([0x30, 0, 0, 0, 0, 0, 0, 0]), Step::Done(Vec::new()));
}

/// A dictionary that accepts any block.
struct Anything(Vec<u8>);

impl Dictionary for Anything {
    fn writable(&self, _: EntryAddress) -> Result<Length, Abort> {
        Ok(Length::UpTo(600))
    }

    fn read(&self, _: EntryAddress) -> Result<Vec<u8>, Abort> {
        Ok(self.0.clone())
    }

    fn write(&mut self, _: EntryAddress, value: &[u8]) -> Result<(), Abort> {
        self.0 = value.to_vec();
        Ok(())
    }
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn a_client_reads_back_written_values(value in proptest::collection::vec(any::<u8>(), 0..600)) {
        let (mut server, mut entry) = (Server::default(), Anything(Vec::new()));
        let mut carry_out = |(mut client, mut request): (Client, Data)| loop {
            match client.answered(server.request(request, &mut entry).unwrap()) {
                Step::Send(next) => request = next,
                step => return step,
            }
        };
        prop_assert_eq!(carry_out(Client::write(BLOCK, &value)), Step::Done(Vec::new()));
        prop_assert_eq!(carry_out(Client::read(BLOCK, 600)), Step::Done(value));
    }

    #[test]
    fn any_answers_end_or_continue_a_transfer(
        value in proptest::collection::vec(any::<u8>(), 0..30),
        answers in proptest::collection::vec(any::<[u8; 8]>(), 0..60),
        is_read in any::<bool>(),
    ) {
        let (client, _) = if is_read { Client::read(BLOCK, 30) } else { Client::write(BLOCK, &value) };
        check_answers(client, &answers);
    }
}

/// With any answers, a transfer either ends after as many answers as its data have segments, or still waits.
fn check_answers(mut client: Client, answers: &[Data]) {
    for answer in answers {
        match client.answered(*answer) {
            Step::Send(_) | Step::Ignored => {}
            Step::Done(data) => {
                assert!(data.len() <= 30);
                break;
            }
            Step::Aborted(_) | Step::Failed(..) => break,
        }
    }
}
