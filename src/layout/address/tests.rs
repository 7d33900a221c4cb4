use super::*;
use crate::devices::samples::tables::NODES as DEVICE;
use crate::layout::space::samples::WORDS;

fn parse(text: &str) -> Result<Address, LayoutError> {
    DEVICE.address(text)
}

#[test]
fn a_parsed_address_prints_the_same_text() {
    for text in ["%MB3.200001", "%MW3.200000", "%MD3.300000", "%MX3.100003.7"] {
        assert_eq!(parse(text).unwrap().to_string(), text);
        assert_eq!(parse(&text.to_lowercase()).unwrap().to_string(), text);
    }
    assert_eq!(parse("%MX3.100005.2").unwrap().bit(), Some(2));
}

#[test]
fn addresses_print_as_the_programmer_writes_them() {
    assert_eq!(DEVICE.at(Width::Byte, 3_262_143).to_string(), "%MB3.3262143");
    assert_eq!(DEVICE.at(Width::Word, 200_000).to_string(), "%MW3.200000");
    assert_eq!(DEVICE.at(Width::Dword, 80_000).to_string(), "%MD3.80000");
}

#[test]
fn an_address_without_a_name_is_a_byte_of_the_image() {
    assert_eq!(Width::Byte.at(12).to_string(), "byte 12 of the image");
    assert_eq!(Width::Word.at(200_000).to_string(), "WORD at byte 200000 of the image");
    assert_eq!(DEVICE.at(Width::Dword, 128).to_string(), "DWORD at byte 128 of the image", "the header page");
    assert_eq!(Width::Word.at(200_000), DEVICE.at(Width::Word, 200_000), "the same place");
    assert_eq!(DEVICE.in_device_spelling(Width::Word.at(200_000)).to_string(), "%MW3.200000");
}

#[test]
fn retain_flags_have_addresses_of_their_own() {
    for (text, offset) in [
        ("%MB10000000", 8192),
        ("%MW10000002", 8194),
        ("%MD10019996", 28_188),
        ("%MX10000001.7", 8193),
        ("%MB10057343", 65_535),
    ] {
        let address = parse(text).unwrap();
        assert_eq!((address.to_string().as_str(), address.offset()), (text, offset));
        assert!(DEVICE.is_retain(offset));
    }
    assert_eq!(DEVICE.at(Width::Byte, 8193).to_string(), "%MB10000001", "the byte of the image");
    assert_eq!(DEVICE.at(Width::Byte, 80_000).to_string(), "%MB3.80000");
    assert!(parse("%MB3.8192").is_err(), "named in one way only");
    let message = |text| parse(text).unwrap_err().to_string();
    assert_eq!(message("%MW10000001"), "%MW10000001: a WORD needs an even address");
    assert_eq!(
        message("%MB10057344"),
        "%MB10057344 is no address of this device, which has %MB3.80000 to %MB3.3262143 (communication RAM, segment 3), \
         %MB10000000 to %MB10057343 (retain flags), %MB0 to %MB79999 (flags that are not retained)"
    );
    assert_eq!(message("%MX10000000.8"), "%MX10000000.8: a BYTE has bits 0 to 7, not 8");
    for text in ["%MX10000000", "%MX10000000.1.1"] {
        assert!(parse(text).is_err(), "{text}");
    }
}

#[test]
fn alignment_errors_name_the_rule() {
    let message = |text| parse(text).unwrap_err().to_string();
    assert_eq!(message("%MW3.200001"), "%MW3.200001: a WORD needs an even address");
    assert_eq!(message("%MD3.200002"), "%MD3.200002: a DWORD needs an address divisible by 4");
    assert_eq!(DEVICE.aligned(Width::Word, 200_001).unwrap_err().to_string(), message("%MW3.200001"));
}

#[test]
fn other_spaces_are_refused_and_the_devices_own_are_named() {
    for text in ["%MW4.200000", "%MB80000", "%IX0.1", "%MW90000", "%MB10000000.1"] {
        let message = parse(text).unwrap_err().to_string();
        let known = format!("{text} is no address of this device, which has %MB3.80000 to %MB3.3262143 (");
        assert!(message.starts_with(&known), "{message}");
    }
    assert_eq!(
        parse("%MB3.0").unwrap_err().to_string(),
        format!(
            "%MB3.0 is not in any area; the first one, `{}`, starts at %MB3.80000",
            DEVICE.areas.first().unwrap().name
        )
    );
    let beyond = parse("%MB3.4294967295").unwrap_err().to_string();
    assert!(beyond.ends_with("the last one, `option3`, ends at %MB3.3262143"), "{beyond}");
}

#[test]
fn everything_else_is_no_address() {
    for text in [
        "",
        "%",
        "%M",
        "%MQ3.1",
        "MW3.2",
        "%MW3.",
        "%MW3.x",
        "%MW3.+2",
        "%MW3.2.1",
        "%MX3.x",
        "%MX3.2.1.0",
        "%é3.1",
        "%MB3.4294967296",
    ] {
        assert!(matches!(parse(text), Err(LayoutError::BadAddress { .. })), "{text}");
    }
    assert_eq!(
        parse("%MX3.100000.8").unwrap_err().to_string(),
        "%MX3.100000.8: a BYTE has bits 0 to 7, not 8"
    );
}

#[test]
fn numbers_of_words_count_accesses_of_their_own_width() {
    for (text, spelling, offset, bit) in [
        ("%IW0", "%IW0", 4096, None),
        ("%IX0.03", "%IX0.3", 4096, Some(3)),
        ("%ix1.8", "%IX1.8", 4099, Some(0)),
        ("%IX0.15", "%IX0.15", 4097, Some(7)),
        ("%IB5", "%IB5", 4101, None),
        ("%QW0", "%QW0", 4104, None),
        ("%MW2000", "%MW2000", 12_192, None),
        ("%MB4001", "%MB4001", 12_193, None),
        ("%MD1000", "%MD1000", 12_192, None),
        ("%MX1010.0", "%MX1010.0", 10_212, Some(0)),
        ("%MB8191", "%MB8191", 16_383, None),
    ] {
        let address = WORDS.address(text).unwrap();
        assert_eq!((address.to_string().as_str(), address.offset(), address.bit()), (spelling, offset, bit));
        assert_eq!(WORDS.address(spelling), Ok(address));
        if bit.is_none() {
            assert_eq!(WORDS.at(address.width(), offset).to_string(), spelling);
        }
    }
    assert_eq!(
        WORDS.at(Width::Word, 8193).to_string(),
        "WORD at byte 8193 of the image",
        "between two words"
    );
    let message = |text| WORDS.address(text).unwrap_err().to_string();
    assert_eq!(message("%MX1010.16"), "%MX1010.16: a WORD has bits 0 to 15, not 16");
    let known = "%IW0 to %IW2 (inputs), %QW0 to %QW0 (outputs), %MW0 to %MW4095 (flags)";
    for text in ["%IW3", "%MW4096", "%MD2048", "%MW3.200000", "%QX1.0"] {
        assert_eq!(message(text), format!("{text} is no address of this device, which has {known}"));
    }
    assert!(message("%MX12").starts_with("`%MX12` is no address;"));
}
