//! Tests all refusals, and the changes that a client detects while it waits.

use super::*;
use crate::memory::{
    header::ABI_VERSION,
    testing::{Emulator, HASH, Instance, PLC, SEGMENT_SIZE},
};
use std::{fs, os::unix::fs::symlink, thread};

const REGISTER: u32 = 200_000;
/// Far longer than any machine needs; no test waits for its end.
const WATCHDOG: Duration = Duration::from_secs(60);
const BOTH: [AttachMode; 2] = [AttachMode::ReadWrite, AttachMode::ReadOnly];

fn attach(instance: &Instance, mode: AttachMode) -> Result<Attached, MemoryError> {
    Image::attach(instance, PLC, mode, Some(HASH))
}

fn refusal(instance: &Instance, mode: AttachMode) -> String {
    attach(instance, mode).unwrap_err().to_string()
}

/// Waits until a client has entered itself as a waiter.
fn wait_for_waiter(bell: &Bell) {
    while !format!("{bell:?}").contains("waiters: 16#00000001") {
        thread::yield_now();
    }
}

#[test]
fn nothing_there() {
    for mode in BOTH {
        let instance = Instance::new();
        assert_eq!(
            refusal(&instance, mode),
            format!(
                "{} does not exist, no emulator with this name runs; start it with `commram run -i {}`",
                instance.path().display(),
                &*instance
            )
        );
    }
}

#[test]
fn not_an_image() {
    for mode in BOTH {
        let instance = Instance::new();
        fs::write(instance.path(), "something else").unwrap();
        assert!(refusal(&instance, mode).contains("is no commram image"));
        fs::remove_file(instance.path()).unwrap();
        fs::create_dir(instance.path()).unwrap();
        assert!(refusal(&instance, mode).contains("is no regular file"));
        fs::remove_dir(instance.path()).unwrap();
        symlink("/dev/null", instance.path()).unwrap();
        assert!(refusal(&instance, mode).contains("is a symbolic link"));
    }
}

#[test]
fn other_abi_version() {
    for mode in BOTH {
        let instance = Instance::new();
        instance.leave(SEGMENT_SIZE, |header| header.abi_version.store(ABI_VERSION + 1));
        assert!(refusal(&instance, mode).contains("has ABI version 4, this program knows 3"));
    }
}

#[test]
fn other_layout() {
    for mode in BOTH {
        let instance = Instance::new();
        let _image = instance.create_ready();
        let refused = Image::attach(&instance, PLC, mode, Some(1)).unwrap_err().to_string();
        assert!(
            refused.contains(
                "holds Test Device with register map 16#0123456789ABCDEF, \
                 this program is made for 16#0000000000000001"
            ),
            "{refused}"
        );
        assert!(Image::attach(&instance, PLC, mode, None).is_ok());
    }
}

#[test]
fn too_short_to_be_mapped() {
    for mode in BOTH {
        let instance = Instance::new();
        instance.leave(SEGMENT_SIZE - 1, |_| ());
        assert!(refusal(&instance, mode).contains("is 3262143 bytes long, an image has 3262144"));
    }
}

#[test]
fn foreign_owner() {
    let instance = Instance::new();
    instance.leave(SEGMENT_SIZE, |_| ());
    // Only root can create such a file; other users cannot run this test.
    if std::os::unix::fs::chown(instance.path(), Some(4711), None).is_err() {
        return;
    }
    for mode in BOTH {
        assert!(refusal(&instance, mode).contains("belongs to user 4711, not to user 0"));
    }
    assert!(matches!(
        Image::create(&instance, PLC, &crate::memory::testing::spec()),
        Err(MemoryError::ForeignOwner { owner: 4711, user: 0, .. })
    ));
}

#[test]
fn not_ready() {
    for mode in BOTH {
        let instance = Instance::new();
        let image = instance.create();
        assert!(refusal(&instance, mode).contains("is not ready, its emulator is starting"));
        image.set_ready();
        assert!(attach(&instance, mode).is_ok());
        image.set_stopping();
        assert!(refusal(&instance, mode).contains("is not ready, its emulator is stopping"));
        image.header().state.store(99);
        assert!(refusal(&instance, mode).contains("is not ready, its emulator is in an unknown state"));
    }
}

#[test]
fn a_dead_emulators_image_is_for_reading_only() {
    let instance = Instance::new();
    instance.leave(SEGMENT_SIZE, |_| ());
    assert!(refusal(&instance, AttachMode::ReadWrite).contains("(process 4294967295) has died"));
    assert!(!attach(&instance, AttachMode::ReadOnly).unwrap().is_alive());
}

#[test]
fn a_read_only_client_can_only_look() {
    let instance = Instance::new();
    let image = instance.create_ready();
    let client = attach(&instance, AttachMode::ReadOnly).unwrap();
    image.segment().store(REGISTER, Width::Word, 0x0043).unwrap();
    assert_eq!(client.segment().load(REGISTER, Width::Word).unwrap(), 0x0043);
    assert!(matches!(client.ring(), Err(MemoryError::ReadOnly { .. })));
    assert!(matches!(client.post(REGISTER, Width::Word, 1), Err(MemoryError::ReadOnly { .. })));
    assert!(matches!(client.header(), Err(MemoryError::ReadOnly { .. })));
    assert_eq!(client.wait_register(REGISTER, Width::Word, WATCHDOG, |v| v == 0x0043).unwrap(), 0x0043);
    image.header().events[12].fire(1);
    let rings = image.header().events[12].bell.rings();
    assert_eq!(client.wait_event(12, 0, WATCHDOG).unwrap(), rings);
}

#[test]
fn post_and_answer_meet() {
    let instance = Instance::new();
    let image = instance.create_ready();
    let client = attach(&instance, AttachMode::ReadWrite).unwrap();
    thread::scope(|scope| {
        scope.spawn(|| {
            let register = image.segment().view::<crate::memory::Cell8>(REGISTER).unwrap();
            let bell = &image.header().doorbell;
            loop {
                let seen = bell.rings();
                if register.compare_exchange(0x05, 0x04).is_ok() {
                    return image.header().answer.ring();
                }
                assert!(bell.wait(seen, Some(WATCHDOG)));
            }
        });
        client.post(REGISTER, Width::Byte, 0x05).unwrap();
        assert_eq!(client.wait_register(REGISTER, Width::Byte, WATCHDOG, |v| v != 0x05).unwrap(), 0x04);
    });
}

#[test]
fn a_sleeping_client_is_woken_by_the_answer_bell() {
    let instance = Instance::new();
    let image = instance.create_ready();
    let client = attach(&instance, AttachMode::ReadWrite).unwrap();
    thread::scope(|scope| {
        let waiter = scope.spawn(|| {
            client.wait_until("the mark", WATCHDOG, |segment| {
                segment.load(REGISTER, Width::Word).ok().filter(|&value| value != 0)
            })
        });
        wait_for_waiter(&image.header().answer);
        image.segment().store(REGISTER, Width::Word, 7).unwrap();
        image.header().answer.ring();
        assert_eq!(waiter.join().unwrap().unwrap(), 7);
    });
}

#[test]
fn events_are_waited_for_by_number() {
    let instance = Instance::new();
    let image = instance.create_ready();
    let client = attach(&instance, AttachMode::ReadWrite).unwrap();
    let seen = client.header().unwrap().events[12].bell.rings();
    thread::scope(|scope| {
        let waiter = scope.spawn(|| client.wait_event(12, seen, WATCHDOG));
        wait_for_waiter(&image.header().events[12].bell);
        image.header().events[12].fire(8_000);
        assert_eq!(waiter.join().unwrap().unwrap(), seen + 1);
    });
    assert_eq!(
        client.wait_event(16, 0, WATCHDOG).unwrap_err().to_string(),
        "event 16: events have the numbers 0 to 15"
    );
}

#[test]
fn timeouts_name_what_did_not_come() {
    let instance = Instance::new();
    let image = instance.create_ready();
    image.segment().store(REGISTER, Width::Byte, 0x05).unwrap();
    for mode in BOTH {
        let client = attach(&instance, mode).unwrap();
        let soon = Duration::from_millis(2);
        let refused = client.wait_register(REGISTER, Width::Byte, soon, |v| v == 0x04).unwrap_err();
        assert_eq!(refused.to_string(), "byte 200000 of the image still holds 16#05 after 2ms");
        let refused = client.wait_until("slave 3 in mode 3", soon, |_| None::<()>).unwrap_err();
        assert_eq!(refused.to_string(), "slave 3 in mode 3 did not happen within 2ms");
        let seen = image.header().events[0].bell.rings();
        let refused = client.wait_event(0, seen, soon).unwrap_err();
        assert_eq!(refused.to_string(), "event 0 did not happen within 2ms");
        let refused = client.wait_register(REGISTER + 1, Width::Word, soon, |_| true).unwrap_err();
        assert_eq!(refused.to_string(), "WORD at byte 200001 of the image: a WORD needs an even address");
    }
}

#[test]
fn a_waiting_client_notices_that_the_emulator_is_killed() {
    for mode in BOTH {
        let instance = Instance::new();
        let emulator = Emulator::start(&instance);
        let (pid, client) = (emulator.pid(), attach(&instance, mode).unwrap());
        thread::scope(|scope| {
            let waiter =
                scope.spawn(|| client.wait_register(REGISTER + 4, Width::Word, WATCHDOG, |v| v != 0));
            emulator.kill();
            let refused = waiter.join().unwrap().unwrap_err();
            assert!(matches!(refused, MemoryError::EmulatorDied { pid: p, .. } if p == pid), "{refused}");
        });
    }
}

#[test]
fn a_waiting_client_notices_the_end_of_the_emulator() {
    for mode in BOTH {
        let instance = Instance::new();
        let image = instance.create_ready();
        let client = attach(&instance, mode).unwrap();
        thread::scope(|scope| {
            let waiter = scope.spawn(|| client.wait_until("anything", WATCHDOG, |_| None::<()>));
            drop(image);
            let refused = waiter.join().unwrap().unwrap_err();
            assert!(matches!(refused, MemoryError::EmulatorStopped { .. }), "{refused}");
        });
        assert!(!client.is_alive());
        assert!(matches!(client.check(), Err(MemoryError::EmulatorStopped { .. })));
        assert!(matches!(client.check_header(), Err(MemoryError::EmulatorStopped { .. })));
    }
}

#[test]
fn a_waiting_client_notices_a_takeover() {
    let instance = Instance::new();
    let emulator = Emulator::start(&instance);
    let client = attach(&instance, AttachMode::ReadWrite).unwrap();
    emulator.kill();
    client.check_header().unwrap();
    let image = instance.create_ready();
    assert!(matches!(client.check_header(), Err(MemoryError::EmulatorRestarted { .. })));
    let refused = client.wait_until("anything", WATCHDOG, |_| None::<()>).unwrap_err();
    assert!(matches!(refused, MemoryError::EmulatorRestarted { attached: 1, found: 2, .. }), "{refused}");
    assert_eq!(attach(&instance, AttachMode::ReadWrite).unwrap().generation(), image.generation());
}

#[test]
fn detaching_changes_nothing() {
    let instance = Instance::new();
    let image = instance.create_ready();
    drop(attach(&instance, AttachMode::ReadWrite).unwrap());
    assert!(instance.path().exists());
    assert_eq!(State::from_code(image.header().state.load()), Some(State::Ready));
}
