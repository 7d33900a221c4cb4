use super::*;
use proptest::prelude::*;

fn job(number: u16, access: Access) -> ParameterJob {
    ParameterJob::new(number, access).unwrap()
}

#[test]
fn jobs_byte_by_byte() {
    // T28: read parameter 300 (16#12C) of slave 5.
    let read = job(300, Access::Read).with_sub_slave(0x0201).frame(5);
    assert_eq!((read.id(), read.data()), (0x505, &[0x71, 0x2C, 0x01, 0x02][..]));
    let word = job(300, Access::WriteWord(0x1122)).with_sub_slave(0x0201).frame(5);
    assert_eq!(word.data(), [0x71, 0x2C, 0x22, 0x11, 0x01, 0x02]);
    let dword = job(300, Access::WriteDoubleword(0x1122_3344)).with_sub_slave(0x0201).frame(5);
    assert_eq!(dword.data(), [0x71, 0x2C, 0x44, 0x33, 0x22, 0x11, 0x01, 0x02]);
    let element = job(0xFFF, Access::Read).with_element(2).unwrap().frame(0);
    assert_eq!(element.data(), [0x2F, 0xFF, 0, 0]);
}

#[test]
fn answers_byte_by_byte() {
    let job = job(300, Access::Read).with_sub_slave(0x0201);
    for (result, bytes) in [
        (ParameterResult::Word(0x1122), &[0x01, 0x2C, 0x22, 0x11, 0x01, 0x02][..]),
        (ParameterResult::Doubleword(0x1122_3344), &[0x01, 0x2C, 0x44, 0x33, 0x22, 0x11, 0x01, 0x02]),
        (ParameterResult::Done, &[0x01, 0x2C, 0x01, 0x02]),
        (ParameterResult::Error(0xFFFB), &[0x21, 0x2C, 0xFB, 0xFF, 0x01, 0x02]),
        (ParameterResult::Busy, &[0x41, 0x2C, 0x01, 0x02]),
    ] {
        let frame = job.answer(result).frame(5);
        assert_eq!((frame.id(), frame.data()), (0x585, bytes));
    }
}

#[test]
fn the_job_decides_which_answers_are_valid() {
    let read = job(300, Access::Read);
    let write = job(300, Access::WriteWord(1));
    let (done, word) = (write.answer(ParameterResult::Done), read.answer(ParameterResult::Word(1)));
    assert_eq!(ParameterResponse::decode(&write, done.frame(1).payload()), Ok(done));
    assert_eq!(ParameterResponse::decode(&read, word.frame(1).payload()), Ok(word));
    for (job, answer) in [(&read, done), (&write, word)] {
        let decoded = ParameterResponse::decode(job, answer.frame(1).payload());
        assert!(matches!(decoded, Err(CodecError::Mismatch { .. })), "{decoded:?}");
    }
    for result in [ParameterResult::Busy, ParameterResult::Error(0xFFFC)] {
        for job in [&read, &write] {
            let answer = job.answer(result);
            assert_eq!(ParameterResponse::decode(job, answer.frame(1).payload()), Ok(answer));
        }
    }
}

#[test]
fn answers_to_other_jobs_are_refused() {
    let asked = job(300, Access::Read);
    let other = job(301, Access::Read).answer(ParameterResult::Word(1)).frame(1);
    let err = ParameterResponse::decode(&asked, other.payload());
    assert_eq!(err, Err(CodecError::OtherParameter { asked: 300, found: 301 }));
    let other = asked.with_sub_slave(2).answer(ParameterResult::Word(1)).frame(1);
    let err = ParameterResponse::decode(&asked, other.payload());
    assert_eq!(err, Err(CodecError::OtherSubSlave { asked: 0, found: 2 }));
}

#[test]
fn busy_is_accepted_in_every_plausible_length() {
    let asked = job(300, Access::Read).with_sub_slave(7);
    for len in 0..=8 {
        let answer = Payload::from_padded([0x41, 0x2C, 1, 2, 3, 4, 5, 6], len);
        let decoded = ParameterResponse::decode(&asked, &answer);
        if len < 2 {
            assert!(matches!(decoded, Err(CodecError::Length { .. })), "{len}");
        } else {
            assert_eq!(decoded, Ok(asked.answer(ParameterResult::Busy)), "{len}");
        }
    }
}

#[test]
fn lengths_outside_the_format_are_refused() {
    for len in [0, 1, 2, 3, 5, 7] {
        for status in [0x01, 0x21] {
            let payload = Payload::from_padded([status; 8], len);
            assert!(matches!(ParameterJob::decode(&payload), Err(CodecError::Length { .. })));
            assert!(matches!(ParameterResponse::decode_alone(&payload), Err(CodecError::Length { .. })));
        }
    }
    let error = Payload::from_padded([0x21; 8], 8);
    assert!(matches!(ParameterResponse::decode_alone(&error), Err(CodecError::Length { .. })));
    let updown = Payload::from_padded([0x80; 8], 4);
    assert!(matches!(ParameterJob::decode(&updown), Err(CodecError::OtherService { .. })));
    assert!(matches!(ParameterResponse::decode_alone(&updown), Err(CodecError::OtherService { .. })));
}

#[test]
fn values_that_do_not_fit_the_frame_are_refused_before_sending() {
    assert_eq!(ParameterJob::new(4096, Access::Read), Err(CodecError::ParameterNumber(4096)));
    assert_eq!(job(4095, Access::Read).with_element(8), Err(CodecError::Element(8)));
}

fn accesses() -> impl Strategy<Value = Access> {
    prop_oneof![
        Just(Access::Read),
        any::<u16>().prop_map(Access::WriteWord),
        any::<u32>().prop_map(Access::WriteDoubleword),
    ]
}

fn results() -> impl Strategy<Value = ParameterResult> {
    prop_oneof![
        any::<u16>().prop_map(ParameterResult::Word),
        any::<u32>().prop_map(ParameterResult::Doubleword),
        Just(ParameterResult::Done),
        any::<u16>().prop_map(ParameterResult::Error),
        Just(ParameterResult::Busy),
    ]
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn job_round_trip(number in 0u16..=4095, element in 0u8..8, sub: u16, access in accesses()) {
        let sent = job(number, access).with_element(element).unwrap().with_sub_slave(sub);
        let frame = sent.frame(31);
        prop_assert_eq!(frame.kind(), Some(FrameKind::Job(31)));
        prop_assert_eq!(ParameterJob::decode(frame.payload()), Ok(sent));
    }

    #[test]
    fn response_round_trip(number in 0u16..=4095, sub: u16, result in results()) {
        let sent = job(number, Access::Read).with_sub_slave(sub).answer(result);
        prop_assert_eq!(ParameterResponse::decode_alone(sent.frame(0).payload()), Ok(sent));
    }
}
