use super::rig::{Emulator, InstanceFiles};
use crate::channel::client::Patience;
use crate::channel::{ClientError, ServerError};
use crate::identity::DeviceIndex;
use crate::memory::Width;
use crate::request::testing::{RAM, TestHost};
use crate::request::{Code, Host, MAX_OPS, MAX_RANGE, Op, Reply};
use std::sync::Arc;
use std::time::Duration;

const REG: u32 = RAM.start;

fn place() -> Arc<InstanceFiles> {
    Arc::new(InstanceFiles::new())
}

#[test]
fn a_poke_a_step_and_a_peek_in_one_message() {
    let place = place();
    let mut host = TestHost::new(true);
    host.script.push((2_000, REG, 0x44));
    let _emulator = Emulator::start_with(&place, host);
    let client = place.client();
    let poke = Op::Poke { plc: DeviceIndex(0), offset: REG, width: Width::Word, value: 5 };
    let peek = Op::Peek { plc: DeviceIndex(0), offset: REG, width: Width::Word };
    let replies = client.request(&[poke, peek, Op::Advance { us: 2_000 }, peek]).unwrap();
    let expected = [Reply::Written, Reply::Value(5), Reply::Time(2_000), Reply::Value(0x44)];
    assert_eq!(replies, expected);
}

/// iceoryx2 opens its files so that started programs inherit them.
#[test]
fn programs_that_a_process_with_the_channel_starts_get_none_of_its_files() {
    let place = place();
    let _emulator = Emulator::start(&place, true);
    let client = place.client();
    client.poke(DeviceIndex(0), REG, Width::Word, 1).unwrap();
    let links = std::process::Command::new("sh").args(["-c", "ls -l /proc/self/fd"]).output().unwrap();
    let links = String::from_utf8(links.stdout).unwrap();
    let root = place.root().canonicalize().unwrap();
    let prefix = std::fs::read_to_string(root.join("prefix")).unwrap();
    let of_channel = [root.to_str().unwrap(), prefix.trim()];
    let open = || std::fs::read_dir("/proc/self/fd").unwrap().flatten();
    assert!(open().any(|file| std::fs::read_link(file.path()).is_ok_and(|path| path.starts_with(&root))));
    let inherited: Vec<_> =
        links.lines().filter(|link| of_channel.iter().any(|part| link.contains(part))).collect();
    assert!(links.contains(" -> ") && inherited.is_empty(), "{inherited:?}");
}

#[test]
fn thousands_of_requests_use_up_no_resources() {
    let place = place();
    let _emulator = Emulator::start(&place, true);
    let client = place.client();
    for value in 0..5_000 {
        client.poke(DeviceIndex(0), REG, Width::Dword, value).unwrap();
        assert_eq!(client.peek(DeviceIndex(0), REG, Width::Dword).unwrap(), value);
    }
}

#[test]
fn operations_after_an_error_are_not_executed() {
    let place = place();
    let _emulator = Emulator::start(&place, true);
    let client = place.client();
    let poke = |offset, value| Op::Poke { plc: DeviceIndex(0), offset, width: Width::Word, value };
    let replies = client.request(&[poke(REG, 1), poke(REG + 1, 2), poke(REG, 3), Op::Info]).unwrap();
    assert!(matches!(&replies[1], Reply::Error(refused) if refused.code == Code::MISALIGNED), "{replies:?}");
    assert_eq!(
        [&replies[0], &replies[2], &replies[3]],
        [&Reply::Written, &Reply::NotExecuted, &Reply::NotExecuted]
    );
    assert_eq!(client.peek(DeviceIndex(0), REG, Width::Word).unwrap(), 1);
}

#[test]
fn the_largest_request_and_the_largest_reply() {
    let place = place();
    let _emulator = Emulator::start(&place, true);
    let client = place.client();
    let pokes: Vec<Op> = (0..MAX_OPS as u32)
        .map(|i| Op::Poke { plc: DeviceIndex(1), offset: REG + i, width: Width::Byte, value: i & 0xFF })
        .collect();
    assert_eq!(client.request(&pokes).unwrap().len(), MAX_OPS);
    let range = Op::ReadRange { plc: DeviceIndex(1), offset: REG, len: MAX_RANGE };
    let replies = client.request(&[range; 4]).unwrap();
    let expected: Vec<u8> = (0..MAX_RANGE).map(|i| if i < 256 { i as u8 } else { 0 }).collect();
    assert!(replies.iter().all(|reply| *reply == Reply::Bytes(expected.clone())));
    let replies = client.request(&[range; 5]).unwrap();
    assert!(matches!(&replies[4], Reply::Error(refused) if refused.code == Code::REPLY_TOO_LONG));

    let too_many = vec![Op::Info; MAX_OPS + 1];
    let refused = client.request(&too_many).unwrap_err();
    assert!(matches!(refused, ClientError::TooManyOperations { count: 257 }));
    assert_eq!(client.request(&[]).unwrap(), []);
}

#[test]
fn each_client_restores_the_file_that_it_has_brought() {
    let place = place();
    let _emulator = Emulator::start(&place, true);
    let [one, two] = [place.client(), place.client()];
    let save = |client: &crate::channel::Client| {
        let number = client.request(&[Op::Save]).unwrap().remove(0).value().unwrap();
        let read = Op::ReadSaved { number, from: 0 };
        client.request(&[read]).unwrap().remove(0).bytes().unwrap()
    };
    let earlier = save(&one);
    one.advance(2_000).unwrap();
    let later = save(&two);
    assert!(earlier.len().max(later.len()) < MAX_RANGE as usize);
    let (mut first, mut second) = (Op::bring(&earlier), Op::bring(&later));
    // The parts arrive alternately.
    loop {
        let parts = [(&one, first.next()), (&two, second.next())];
        if parts.iter().all(|(_, part)| part.is_none()) {
            break;
        }
        for (client, part) in parts {
            let replies = client.request(part.as_slice()).unwrap();
            assert!(replies.iter().all(|reply| *reply == Reply::Written), "{replies:?}");
        }
    }
    let restore = [Op::Restore { detached: false }];
    assert_eq!(two.request(&restore).unwrap(), [Reply::Time(2_000)]);
    assert_eq!(one.request(&restore).unwrap(), [Reply::Time(0)]);
    let again = one.request(&restore).unwrap();
    assert!(matches!(&again[0], Reply::Error(refused) if refused.code == Code::SNAPSHOT), "{again:?}");
}

#[test]
fn the_instance_describes_itself() {
    let place = place();
    let _emulator = Emulator::start(&place, true);
    assert_eq!(place.client().info().unwrap(), TestHost::new(true).info());
}

#[test]
fn a_refusal_is_an_error_of_the_single_operation() {
    let place = place();
    let _emulator = Emulator::start(&place, false);
    let refused = place.client().advance(1_000).unwrap_err();
    assert!(
        matches!(&refused, ClientError::Refused(refused) if refused.code == Code::CLOCK_IS_REAL_TIME),
        "{refused}"
    );
}

#[test]
fn concurrent_clients_get_their_own_replies() {
    let place = place();
    let _emulator = Emulator::start(&place, true);
    std::thread::scope(|scope| {
        for number in 0..6 {
            let place = &place;
            scope.spawn(move || {
                let client = place.client();
                let offset = REG + 4 * number;
                for value in 0..500 {
                    client.poke(DeviceIndex(0), offset, Width::Dword, value).unwrap();
                    assert_eq!(client.peek(DeviceIndex(0), offset, Width::Dword).unwrap(), value);
                }
            });
        }
    });
}

#[test]
fn clients_above_the_limit_are_refused() {
    let place = place();
    let _emulator = Emulator::start(&place, true);
    let mut clients: Vec<_> = (0..crate::channel::server::MAX_CLIENTS).map(|_| place.client()).collect();
    let refused = place.connect(Patience::default()).unwrap_err();
    assert!(matches!(refused, ClientError::TooManyClients { .. }), "{refused}");
    clients.pop();
    let late = place.client();
    late.poke(DeviceIndex(0), REG, Width::Byte, 1).unwrap();
}

#[test]
fn instances_side_by_side_do_not_see_each_other() {
    let places = [place(), place()];
    let _emulators = places.each_ref().map(|place| Emulator::start(place, true));
    let clients = places.each_ref().map(|place| place.client());
    clients[0].poke(DeviceIndex(0), REG, Width::Word, 1).unwrap();
    clients[1].poke(DeviceIndex(0), REG, Width::Word, 2).unwrap();
    assert_eq!(clients[0].peek(DeviceIndex(0), REG, Width::Word).unwrap(), 1);
    assert_eq!(clients[1].peek(DeviceIndex(0), REG, Width::Word).unwrap(), 2);
}

#[test]
fn a_second_server_is_refused_and_does_not_harm_the_first() {
    let place = place();
    let emulator = Emulator::start(&place, true);
    let client = place.client();
    let refused = place.server().unwrap_err();
    assert!(matches!(refused, ServerError::AlreadyServed { .. }), "{refused}");
    client.poke(DeviceIndex(0), REG, Width::Word, 1).unwrap();
    assert_eq!(place.client().peek(DeviceIndex(0), REG, Width::Word).unwrap(), 1);
    emulator.end();
}

#[test]
fn without_an_emulator_there_is_no_connection() {
    let place = place();
    let refused = place.connect(Patience::default()).unwrap_err();
    assert!(matches!(refused, ClientError::NotRunning { .. }), "{refused}");
    // A client can also check its connection after the emulator has ended.
    Emulator::start(&place, true).end();
    let refused = place.connect(Patience::default()).unwrap_err();
    assert!(matches!(refused, ClientError::NotRunning { .. }), "{refused}");
}

#[test]
fn a_normal_end_leaves_no_files() {
    let place = place();
    let emulator = Emulator::start(&place, true);
    let client = place.client();
    client.poke(DeviceIndex(0), REG, Width::Word, 1).unwrap();
    assert!(!place.remains().is_empty());
    drop(client);
    emulator.end();
    assert!(!place.root().exists());
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

#[test]
fn an_ended_emulator_leaves_no_files_for_its_clients() {
    let place = place();
    let emulator = Emulator::start(&place, true);
    let clients = [place.client(), place.client()];
    emulator.end();
    assert!(place.remains().is_empty(), "{:?}", place.remains());
    drop(clients);
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

#[test]
fn stop_ends_the_emulator_and_later_requests_fail() {
    let place = place();
    let emulator = Emulator::start(&place, true);
    let client = place.client();
    client.stop().unwrap();
    emulator.end();
    let gone = client.peek(DeviceIndex(0), REG, Width::Word).unwrap_err();
    assert!(matches!(gone, ClientError::EmulatorGone { .. }), "{gone}");
}

#[test]
fn a_client_that_outlives_its_emulator_does_not_disturb_the_next() {
    let place = place();
    let emulator = Emulator::start(&place, true);
    let client = place.client();
    client.poke(DeviceIndex(0), REG, Width::Word, 7).unwrap();
    emulator.end();
    assert!(client.peek(DeviceIndex(0), REG, Width::Word).is_err());
    let emulator = Emulator::start(&place, true);
    let second = place.client();
    assert_eq!(second.peek(DeviceIndex(0), REG, Width::Word).unwrap(), 0);
    assert!(client.peek(DeviceIndex(0), REG, Width::Word).is_err());
    drop(client);
    assert_eq!(second.peek(DeviceIndex(0), REG, Width::Word).unwrap(), 0);
    drop(second);
    emulator.end();
    assert!(place.remains().is_empty(), "{:?}", place.remains());
}

#[test]
fn a_path_too_long_is_refused_with_the_limit() {
    let place = place();
    let long = place.directory.join("x".repeat(200));
    std::fs::create_dir_all(&long).unwrap();
    let bells = place.bells();
    let refused = crate::channel::Server::open("long", &long, Box::new(bells)).unwrap_err();
    assert!(refused.to_string().contains("at most 120 bytes"), "{refused}");
}

#[test]
fn patience_is_finite_by_default() {
    assert_eq!(Patience::default().connect, Duration::ZERO);
    assert!(Patience::default().reply <= Duration::from_secs(10));
}
