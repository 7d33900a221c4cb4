use super::*;
use proptest::prelude::*;

const DATA: [u8; 6] = [1, 2, 3, 4, 5, 6];

fn init(direction: Direction) -> UpDownStep {
    UpDownStep::Init { direction, address: 0x1122_3344, sub_slave: 0x5566 }
}

fn job(offset: u16, step: UpDownStep) -> UpDownJob {
    UpDownJob::new(offset, step).unwrap()
}

#[test]
fn jobs_byte_by_byte() {
    let address = [0x44, 0x33, 0x22, 0x11, 0x66, 0x55];
    for (step, control, rest) in [
        (init(Direction::Upload), 0x91, &address[..]),
        (init(Direction::Download), 0xD1, &address),
        (UpDownStep::Upload { last: false }, 0xA1, &[]),
        (UpDownStep::Upload { last: true }, 0xB1, &[]),
        (UpDownStep::Download { last: false, data: DATA }, 0xE1, &DATA),
        (UpDownStep::Download { last: true, data: DATA }, 0xF1, &DATA),
    ] {
        // 300 = 16#12C bytes.
        let frame = job(300, step).frame(5);
        assert_eq!((frame.id(), frame.data()), (0x505, &[&[control, 0x2C], rest].concat()[..]), "{step:?}");
    }
}

#[test]
fn answers_byte_by_byte() {
    let body = job(300, UpDownStep::Upload { last: false });
    for (result, bytes) in [
        (UpDownResult::Done, &[0x81, 0x2C][..]),
        (UpDownResult::Data(DATA), &[0x81, 0x2C, 1, 2, 3, 4, 5, 6]),
        (UpDownResult::Error(0x0104), &[0xA1, 0x2C, 0x04, 0x01]),
        (UpDownResult::Busy, &[0xC1, 0x2C]),
    ] {
        let frame = body.answer(result).frame(5);
        assert_eq!((frame.id(), frame.data()), (0x585, bytes));
    }
}

#[test]
fn cancel_is_an_upload_init_without_address_and_length() {
    let cancel = UpDownJob::cancel();
    assert_eq!(cancel.frame(0).data(), [0x90, 0, 0, 0, 0, 0, 0, 0]);
    assert!(cancel.is_cancel());
    for (offset, address, cancels) in [(0, 0, true), (0, 0x100, false), (6, 0, false)] {
        for direction in [Direction::Upload, Direction::Download] {
            let step = UpDownStep::Init { direction, address, sub_slave: 1 };
            assert_eq!(job(offset, step).is_cancel(), cancels, "{offset} {address}");
        }
    }
    assert!(!job(0, UpDownStep::Upload { last: false }).is_cancel());
}

#[test]
fn the_answer_to_init_has_length_0_or_the_length_of_the_slave() {
    let upload = job(0, init(Direction::Upload));
    assert_eq!(job(300, init(Direction::Download)).answer(UpDownResult::Done).offset(), 0);
    let answer = upload.answer_with_length(1234).unwrap();
    assert_eq!(UpDownResponse::decode(&upload, answer.frame(0).payload()), Ok(answer));
    assert_eq!(upload.answer_with_length(4096), Err(CodecError::Offset(4096)));
}

#[test]
fn an_answer_has_to_fit_its_job() {
    let upload = job(6, UpDownStep::Upload { last: false });
    let download = job(6, UpDownStep::Download { last: false, data: DATA });
    let begin = job(6, init(Direction::Upload));
    for (job, result, fits) in [
        (&upload, UpDownResult::Data(DATA), true),
        (&upload, UpDownResult::Done, false),
        (&download, UpDownResult::Done, true),
        (&download, UpDownResult::Data(DATA), false),
        (&begin, UpDownResult::Done, true),
        (&begin, UpDownResult::Data(DATA), false),
        (&upload, UpDownResult::Busy, true),
        (&download, UpDownResult::Busy, true),
        (&begin, UpDownResult::Busy, true),
        (&upload, UpDownResult::Error(0x0104), true),
        (&download, UpDownResult::Error(0x0104), true),
        (&begin, UpDownResult::Error(0x0104), true),
    ] {
        let answer = job.answer(result);
        let decoded = UpDownResponse::decode(job, answer.frame(1).payload());
        if fits {
            assert_eq!(decoded, Ok(answer));
        } else {
            assert!(matches!(decoded, Err(CodecError::Mismatch { .. })), "{decoded:?}");
        }
    }
}

#[test]
fn a_wrong_block_number_is_refused_except_in_error_answers() {
    let asked = job(12, UpDownStep::Upload { last: false });
    let other = job(6, UpDownStep::Upload { last: false }).answer(UpDownResult::Data(DATA));
    let decoded = UpDownResponse::decode(&asked, other.frame(0).payload());
    assert_eq!(decoded, Err(CodecError::OtherOffset { asked: 12, found: 6 }));
    let instead = asked.expects_instead(6).unwrap();
    assert_eq!((instead.offset(), instead.result()), (6, UpDownResult::Error(0x0100)));
    assert_eq!(UpDownResponse::decode(&asked, instead.frame(0).payload()), Ok(instead));
    assert_eq!(asked.expects_instead(4096), Err(CodecError::Offset(4096)));
}

#[test]
fn lengths_modes_and_services_outside_the_format_are_refused() {
    for len in 0..=8 {
        let decode = |control| UpDownJob::decode(&Payload::from_padded([control; 8], len));
        for (control, right) in [(0x90, 8), (0xD0, 8), (0xA0, 2), (0xB0, 2), (0xE0, 8), (0xF0, 8)] {
            match decode(control) {
                Ok(_) => assert_eq!(len, right, "16#{control:02X}"),
                Err(CodecError::Length { found, .. }) => {
                    assert_ne!(len, right, "16#{control:02X}");
                    assert_eq!(usize::from(found), len);
                }
                other => panic!("16#{control:02X} with {len} bytes: {other:?}"),
            }
        }
        if len > 0 {
            assert_eq!(decode(0x80), Err(CodecError::ReservedMode));
            assert_eq!(decode(0xC0), Err(CodecError::ReservedMode));
            assert!(matches!(decode(0x10), Err(CodecError::OtherService { .. })));
        }
    }
}

#[test]
fn answer_lengths_outside_the_format_are_refused() {
    for len in 0..=8 {
        for (status, right) in [(0x80, &[2, 8][..]), (0xA0, &[4]), (0xC0, &[2, 3, 4, 5, 6, 7, 8])] {
            let decoded = UpDownResponse::decode_alone(&Payload::from_padded([status; 8], len));
            assert_eq!(decoded.is_ok(), right.contains(&len), "16#{status:02X} with {len} bytes");
        }
    }
    let parameter = Payload::from_padded([0; 8], 2);
    assert!(matches!(UpDownResponse::decode_alone(&parameter), Err(CodecError::OtherService { .. })));
}

#[test]
fn offsets_have_12_bits() {
    assert_eq!(UpDownJob::new(4096, init(Direction::Upload)), Err(CodecError::Offset(4096)));
    assert!(UpDownJob::new(4095, init(Direction::Upload)).is_ok());
}

fn steps() -> impl Strategy<Value = UpDownStep> {
    let direction = prop_oneof![Just(Direction::Upload), Just(Direction::Download)];
    prop_oneof![
        (direction, any::<u32>(), any::<u16>())
            .prop_map(|(direction, address, sub_slave)| UpDownStep::Init { direction, address, sub_slave }),
        any::<bool>().prop_map(|last| UpDownStep::Upload { last }),
        (any::<bool>(), any::<[u8; 6]>()).prop_map(|(last, data)| UpDownStep::Download { last, data }),
    ]
}

fn results() -> impl Strategy<Value = UpDownResult> {
    prop_oneof![
        Just(UpDownResult::Done),
        any::<[u8; 6]>().prop_map(UpDownResult::Data),
        any::<u16>().prop_map(UpDownResult::Error),
        Just(UpDownResult::Busy),
    ]
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn job_round_trip(offset in 0u16..=4095, step in steps()) {
        let sent = job(offset, step);
        let frame = sent.frame(31);
        prop_assert_eq!(frame.kind(), Some(FrameKind::Job(31)));
        prop_assert_eq!(UpDownJob::decode(frame.payload()), Ok(sent));
    }

    #[test]
    fn response_round_trip(offset in 0u16..=4095, step in steps(), result in results()) {
        let sent = job(offset, step).answer(result);
        prop_assert_eq!(UpDownResponse::decode_alone(sent.frame(0).payload()), Ok(sent));
    }
}
