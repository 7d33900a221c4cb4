//! No frame from the bus stops the controller.

use super::*;
use embedded_can::ExtendedId;
use proptest::prelude::*;

/// Returns random frames. Many of them have a meaning for the controller.
fn frame() -> impl Strategy<Value = Frame> {
    let known =
        prop_oneof![Just(0), Just(0x80), Just(0x620), Just(0x720), Just(0x220), Just(0x387), 0..0x800_u16];
    let data = |data: Vec<u8>| Payload::new(&data).unwrap();
    let any_data = proptest::collection::vec(any::<u8>(), 0..=8);
    let plain = (known.clone(), any_data).prop_map(move |(id, it)| Frame::standard(id, data(it)));
    let management = (proptest::sample::select(&[1, 2, 128, 129, 130, 3][..]), 0..40_u8)
        .prop_map(move |(command, node)| Frame::standard(0, data(vec![command, node])));
    let sdo =
        (any::<u8>(), 0..DEVICE.objects.len(), any::<[u8; 4]>()).prop_map(move |(command, at, value)| {
            let object = &DEVICE.objects[at];
            let [low, high] = object.index.to_le_bytes();
            Frame::standard(0x620, data([&[command, low, high, object.sub][..], &value].concat()))
        });
    let remote = (known, 0..=8_usize)
        .prop_map(|(id, length)| Frame::remote(StandardId::new(id).unwrap(), length).unwrap());
    let extended =
        (0..1_u32 << 29).prop_map(move |id| Frame::new(ExtendedId::new(id).unwrap(), data(vec![1, 0])));
    prop_oneof![3 => plain, 2 => management, 4 => sdo, 2 => remote, 1 => extended]
}

/// True if the frame is an SDO request: it has eight bytes, and is not an abort of the client.
fn is_request(frame: &Frame) -> bool {
    let is_sdo = frame.id() == Id::Standard(StandardId::new(0x620).unwrap()) && !frame.is_remote_frame();
    is_sdo && frame.data().len() == 8 && frame.data()[0] >> 5 != 4
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn random_frames_never_stop_the_node(frames in proptest::collection::vec(frame(), 0..25), is_master: bool) {
        let mut bench = if is_master {
            Bench::running("program = 'master', nodes = [5, 7], sync_ms = 9")
        } else {
            Bench::operational("")
        };
        for frame in frames {
            let most = usize::from(is_request(&frame));
            bench.wires.lock().unwrap().to_send.push(frame);
            bench.run(5 * MS);
            let answers = bench.heard().into_iter().filter(|(id, data)| *id == 0x5A0 && data.len() == 8);
            prop_assert!(answers.count() <= most);
        }
        bench.power_cycle();
        prop_assert_eq!(bench.state(), "run");
    }
}
