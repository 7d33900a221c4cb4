//! Clients and emulators whose wire format has another version: both directions end with a clear message.

use super::rig::{Emulator, InstanceFiles};
use crate::channel::ClientError;
use crate::channel::client::Patience;
use crate::channel::domain::{Domain, Ipc, Threads};
use crate::channel::wire::{Block, WIRE_VERSION, WireOp};
use iceoryx2::prelude::*;
use iceoryx2::service::builder::request_response::RequestResponseOpenError as OpenError;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The types of another version of the wire format: they have the same content as the types of the current version, and
/// the names of the other version.
macro_rules! of_version {
    ($module:ident, $op:literal, $block:literal) => {
        mod $module {
            use super::*;

            #[derive(Clone, Copy, Debug, ZeroCopySend)]
            #[type_name($op)]
            #[repr(C)]
            pub(super) struct Op {
                pub op: WireOp,
            }

            #[derive(Clone, Copy, Debug, ZeroCopySend)]
            #[type_name($block)]
            #[repr(C)]
            pub(super) struct Reply {
                pub block: Block,
            }
        }
    };
}

of_version!(older, "commram.channel.WireOp.v4", "commram.channel.Block.v4");
of_version!(newer, "commram.channel.WireOp.v6", "commram.channel.Block.v6");

const SERVICE: &str = "commram.channel";

/// Fails if the act takes so long that a user would call it a hang.
fn soon<R>(act: impl FnOnce() -> R) -> R {
    let start = Instant::now();
    let done = act();
    assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
    done
}

#[test]
fn the_versions_beside_todays_are_tried() {
    assert_eq!(WIRE_VERSION, 5, "take the version before and the version after it");
}

/// A client of the current version at an emulator of another version.
#[test]
fn a_client_names_the_version_of_an_emulator_that_has_another() {
    fn refused<Op: ZeroCopySend + core::fmt::Debug + Copy, Reply: ZeroCopySend + core::fmt::Debug + Copy>(
        version: u32,
    ) {
        let place = InstanceFiles::new();
        place.bells().set_pid(std::process::id());
        let domain = place.domain();
        let node = domain.node::<Ipc>().unwrap();
        let name = ServiceName::new(SERVICE).unwrap();
        let service = node.service_builder(&name).request_response::<[Op], [Reply]>().create().unwrap();
        domain.announce().unwrap();
        let error = soon(|| place.connect(Patience::default())).err().unwrap();
        assert!(matches!(error, ClientError::Incompatible { .. }), "{error:?}");
        let text = format!(
            "instance '{}': its channel has format {version} of iceoryx2 0.10.0, the channel of this commram ({}) has format {WIRE_VERSION} \
             (IncompatibleRequestOrResponseType); use the commram version of the emulator",
            place.instance,
            env!("CARGO_PKG_VERSION")
        );
        assert_eq!(error.to_string(), text);
        drop((service, node));
        domain.close(Duration::ZERO);
    }
    refused::<older::Op, older::Reply>(4);
    refused::<newer::Op, newer::Reply>(6);
}

/// A client of another version at an emulator of the current version, which goes on to answer clients of the current
/// version.
#[test]
fn an_emulator_lets_no_client_of_another_version_in() {
    let place = Arc::new(InstanceFiles::new());
    let _emulator = Emulator::start(&place, true);
    let ours = place.client();
    let domain = Domain::find(&place.instance, &place.root()).unwrap().unwrap();
    let node = domain.node::<Threads>().unwrap();
    let name = ServiceName::new(SERVICE).unwrap();
    let builder = || node.service_builder(&name);
    let refusals = soon(|| {
        [
            builder().request_response::<[older::Op], [older::Reply]>().open().err(),
            builder().request_response::<[newer::Op], [newer::Reply]>().open().err(),
        ]
    });
    assert_eq!(refusals, [Some(OpenError::IncompatibleRequestOrResponseType); 2]);
    assert!(soon(|| ours.info()).is_ok());
}
