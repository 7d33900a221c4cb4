use super::*;
use proptest::prelude::*;

fn line(frame: &Frame) -> String {
    match decode(frame) {
        Ok(decoded) => decoded.to_string(),
        Err(error) => format!("error: {error}"),
    }
}

fn raw(id: u16, data: &[u8]) -> String {
    line(&Frame::new(id, data).unwrap())
}

#[test]
fn one_line_for_each_kind_of_frame() {
    for (id, data, expected) in [
        (0x103, &[0x44, 0x33, 0x22, 0x11][..], "WRC1 -> answer by slave 3: 3344 1122"),
        (0x183, &[], "WRC2 -> answer by slave 3: no data"),
        (0x100, &[0x44, 0x33, 0x22], "WRC1 -> answer by slave 0: 3344 22"),
        (0x303, &[1, 0, 2, 0, 0x37, 0x80], "RDC1 of slave 3: 0001 0002 8037"),
        (0x39F, &[1, 0], "RDC2 of slave 31: 0001"),
        (0x010, &[8, 0, 0, 0, 1, 0, 0x0F, 0], "CC to slave 3: control word 16#000F"),
        (0x010, &[9, 0, 0, 0x80, 2, 0, 0, 0], "CC to slave 0, 3, 31: SYNC mode off"),
        (0x010, &[0xFF, 0xFF, 0xFF, 0xFF, 2, 1, 0, 0], "CC to all slaves: SYNC mode on"),
        (0x010, &[0, 0, 0, 0, 0x80, 1, 2, 3], "CC to no slave: command 16#80, DB 16#01, DW 16#0302"),
        (0x505, &[0x71, 0x2C, 0, 0], "CC to slave 5: read parameter 300"),
        (0x505, &[0x21, 0x2C, 1, 0], "CC to slave 5: read parameter 300, element 2, sub-slave 16#0001"),
        (0x505, &[0x71, 0x2C, 7, 0, 0, 0], "CC to slave 5: write parameter 300 := 16#0007"),
        (
            0x505,
            &[0x71, 0x2C, 0x44, 0x33, 0x22, 0x11, 0, 0],
            "CC to slave 5: write parameter 300 := 16#11223344",
        ),
        (0x585, &[0x01, 0x2C, 7, 0, 0, 0], "RC of slave 5: parameter 300 = 16#0007"),
        (0x585, &[0x01, 0x2C, 0x44, 0x33, 0x22, 0x11, 0, 0], "RC of slave 5: parameter 300 = 16#11223344"),
        (0x585, &[0x01, 0x2C, 2, 0], "RC of slave 5: parameter 300 written, sub-slave 16#0002"),
        (0x585, &[0x21, 0x2C, 0xFB, 0xFF, 0, 0], "RC of slave 5: parameter 300: error 16#FFFB (not present)"),
        (0x585, &[0x41, 0x2C, 0, 0], "RC of slave 5: parameter 300: BUSY"),
        (
            0x505,
            &[0xD1, 0x2C, 0, 1, 0, 0, 3, 0],
            "CC to slave 5: download of 300 bytes from 16#00000100 begins, sub-slave 16#0003",
        ),
        (0x505, &[0x90, 0, 0, 0, 0, 0, 0, 0], "CC to slave 5: cancel up-/download"),
        (0x505, &[0xA0, 6], "CC to slave 5: upload, block 6"),
        (0x505, &[0xF0, 12, 1, 2, 3, 4, 5, 6], "CC to slave 5: download, last block 12: 01 02 03 04 05 06"),
        (0x585, &[0x80, 12], "RC of slave 5: up-/download, block 12: done"),
        (0x585, &[0x80, 6, 1, 2, 3, 4, 5, 6], "RC of slave 5: up-/download, block 6: 01 02 03 04 05 06"),
        (
            0x585,
            &[0xA0, 6, 4, 1],
            "RC of slave 5: up-/download, block 6: error 16#0104 (up-/download not possible)",
        ),
        (0x585, &[0xC0, 6], "RC of slave 5: up-/download, block 6: BUSY"),
    ] {
        assert_eq!(raw(id, data), expected);
    }
}

#[test]
fn errors_name_the_right_form() {
    for (id, data, expected) in [
        (
            0x7FF,
            &[][..],
            "error: identifier 16#7FF is none of CANsync (16#010, 16#100-1FF, 16#300-3FF, 16#500-5FF)",
        ),
        (0x010, &[1, 0, 0, 0], "error: action command with 4 data bytes, 5 to 8 would be right"),
        (0x500, &[0x70], "error: parameter job with 1 data bytes, 4, 6 or 8 would be right"),
        (0x500, &[], "error: parameter job with 0 data bytes, 4, 6 or 8 would be right"),
        (
            0x500,
            &[0x80, 0],
            "error: up-/download job with MODE 00, which is reserved (01 init, 10 body, 11 last block)",
        ),
        (0x580, &[0xA0, 0], "error: up-/download error answer with 2 data bytes, 4 would be right"),
    ] {
        assert_eq!(raw(id, data), expected);
    }
}

/// Encodes a decoded frame again.
fn encode(decoded: &DecodedFrame) -> Frame {
    match *decoded {
        DecodedFrame::ReferenceValue { channel, asked, payload } => {
            Frame::of(FrameKind::ReferenceValue(channel, asked), payload)
        }
        DecodedFrame::ActualValue { channel, slave, payload } => {
            Frame::of(FrameKind::ActualValue(channel, slave), payload)
        }
        DecodedFrame::Action(command) => command.frame(),
        DecodedFrame::ParameterJob { slave, job } => job.frame(slave),
        DecodedFrame::ParameterResponse { slave, response } => response.frame(slave),
        DecodedFrame::UpDownJob { slave, job } => job.frame(slave),
        DecodedFrame::UpDownResponse { slave, response } => response.frame(slave),
    }
}

fn decoded_or_refused(id: u16, bytes: [u8; 8], len: usize) {
    let frame = Frame::new(id, Payload::from_padded(bytes, len).data()).unwrap();
    assert!(!line(&frame).is_empty());
    match decode(&frame) {
        Ok(decoded) => {
            // Decoding may lose reserved bits, and lengths that the emulator never sends. However, encoding
            // and decoding again must not change the meaning of the frame.
            let again = encode(&decoded);
            assert_eq!(again.kind(), frame.kind());
            assert_eq!(decode(&again), Ok(decoded));
        }
        Err(CodecError::ForeignIdentifier(foreign)) => {
            assert_eq!(foreign, id);
            assert_eq!(frame.kind(), None);
        }
        Err(_) => assert!(frame.kind().is_some()),
    }
}

/// The input of the fuzzer consists of frames, each with an identifier, a length and eight bytes.
#[test]
fn fuzz_cansync_frame() {
    crate::fuzz("cansync_frame", |bytes| {
        for [low, high, bytes @ ..] in bytes.as_chunks::<10>().0 {
            let len = usize::from(high >> 4).min(8);
            decoded_or_refused(u16::from_le_bytes([*low, high & 7]), *bytes, len);
        }
    });
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, ..crate::property_tests() })]
    #[test]
    fn any_frame_is_decoded_or_refused(id in 0u16..0x800, bytes: [u8; 8], len in 0usize..=8) {
        decoded_or_refused(id, bytes, len);
    }

    #[test]
    fn command_and_answer_frames_never_panic(id in 0x500u16..0x600, bytes: [u8; 8], len in 0usize..=8) {
        let frame = Frame::new(id, Payload::from_padded(bytes, len).data()).unwrap();
        let read = ParameterJob::new(0, Access::Read).unwrap();
        let upload = UpDownJob::cancel();
        let _ = (line(&frame), ParameterResponse::decode(&read, frame.payload()));
        let _ = UpDownResponse::decode(&upload, frame.payload());
    }
}
