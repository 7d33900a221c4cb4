//! Parameter jobs, and drives that cannot be built.

use super::*;

#[test]
fn faulty_card_parameters_are_named() {
    let wide = ParamFormat::Doubleword;
    let cases: [(DriveConfig, (u8, ZkError)); 12] = [
        (with_zk(|zk| zk.zk_0 = 120), (0, ZkError::ControlOrStatusWord(120))),
        (with_zk(|zk| zk.zk_1 = 121), (1, ZkError::ControlOrStatusWord(121))),
        (with_zk(|zk| zk.zk_16 = 121), (16, ZkError::ControlOrStatusWord(121))),
        (with_zk(|zk| zk.zk_17 = 120), (17, ZkError::ControlOrStatusWord(120))),
        (with_zk(|zk| zk.zk_0 = 999), (0, ZkError::NoParameter(999))),
        (with_zk(|zk| zk.zk_1 = 301), (1, ZkError::ReadOnly(301))),
        (with_zk(|zk| zk.zk_4 = 0x0001), (4, ZkError::Format(300))),
        (with_zk(|zk| zk.zk_5 = 0x0011), (5, ZkError::Mapping(MappingError::Frame(2)))),
        (with_zk(|zk| zk.zk_21 = 0x0047), (21, ZkError::Mapping(MappingError::BeyondFrame))),
        (with_zk(|zk| zk.zk_25 = 0x0003), (25, ZkError::Overlap(20))),
        (with_zk(|zk| zk.zk_24 = 4), (24, ZkError::Delay)),
        (
            with_zk(|zk| {
                let source = Source::Slave(3);
                zk.zk_4 = ReferenceMapping { word: 0, channel: Channel::One, format: wide, source }.to_zk();
            }),
            (4, ZkError::OwnFrame),
        ),
    ];
    for (cfg, fault) in cases {
        assert_eq!(zk_fault(&cfg), fault);
    }
}

#[test]
fn numbers_of_unmapped_values_do_not_matter() {
    let cfg = with_zk(|zk| (zk.zk_0, zk.zk_4, zk.zk_17, zk.zk_21) = (120, 0, 9999, 0));
    assert!(Drive::new(&cfg, 500).is_ok());
}

#[test]
fn faulty_drives_are_refused() {
    assert!(matches!(
        Drive::new(&DriveConfig::demo("a", 32), 500),
        Err(DriveError::SlaveNumber { number: 32, .. })
    ));
    let refused = |parameters: Vec<ParameterSpec>| {
        let number = parameters[0].number;
        let err = Drive::new(&DriveConfig { parameters, ..demo() }, 500).unwrap_err();
        let DriveError::Parameter { drive, number: named, reason } = err else { panic!("{err:?}") };
        assert_eq!((drive.as_str(), named), ("drive", number));
        reason
    };
    let word = |number| ParameterSpec::new(number, ParamFormat::Word);
    for number in [120, 121, 300, 301, 302] {
        assert_eq!(refused(vec![word(number)]), ParameterError::Own);
    }
    assert_eq!(refused(vec![ParameterSpec { max: Some(9), ..word(167) }]), ParameterError::Own);
    assert_eq!(refused(vec![ParameterSpec { initial: 9, ..word(103) }]), ParameterError::Limits(9));
    for number in [167, 1000] {
        assert_eq!(refused(vec![word(number), word(number)]), ParameterError::Twice);
    }
}

/// The plant file can set the values that the drive's own parameters have after power-on.
#[test]
fn own_parameters_get_their_values_from_the_plant_file() {
    let value = |number, initial| ParameterSpec { initial, ..ParameterSpec::new(number, ParamFormat::Word) };
    let drive = Drive::new(&DriveConfig { parameters: vec![value(167, 4000), value(103, 8)], ..demo() }, 500)
        .unwrap();
    assert_eq!([103, 167, 168].map(|number| drive.parameter(number)), [Some(8), Some(4000), Some(0)]);
}

#[test]
fn built_in_numbers_can_be_changed_and_the_standard_mapping_follows() {
    let numbers = ParameterNumbers { speed_reference: 18, speed_actual: 19, additional_reference: 20 };
    let mut bench = Bench::synchronized(&DriveConfig { numbers, ..demo() });
    bench.send(Channel::One, &[5, 0]).edge();
    assert_eq!((bench.p(18), bench.p(19), bench.drive.parameter(300)), (5, 5, None));
}

#[test]
fn parameter_jobs() {
    use Access::{Read, WriteDoubleword, WriteWord};
    use ParameterResult::{Done, Doubleword, Error, Word};
    let parameters = vec![
        ParameterSpec {
            min: Some(1),
            max: Some(100),
            initial: 7,
            ..ParameterSpec::new(400, ParamFormat::Word)
        },
        ParameterSpec { initial: 9, ..ParameterSpec::new(0, ParamFormat::Doubleword) },
    ];
    let mut bench = Bench::new(&DriveConfig { parameters, ..demo() });
    bench.edge();
    for (number, access, result) in [
        (400, Read, Word(7)),
        (400, WriteWord(8), Done),
        (400, Read, Word(8)),
        (400, WriteWord(0), Error(0xFFFE)),
        (400, WriteWord(101), Error(0xFFFD)),
        (400, WriteDoubleword(8), Error(0xFFF9)),
        (0, Read, Doubleword(9)),
        (0, WriteWord(1), Error(0xFFF9)),
        (0, WriteDoubleword(1), Done),
        (1, Read, Error(0xFFFB)),
        (4095, WriteWord(1), Error(0xFFFB)),
        (301, WriteDoubleword(1), Error(0xFFFC)),
        (121, Read, Word(0x0037)),
        (121, WriteWord(1), Error(0xFFFC)),
        (120, Read, Word(0x000F)),
        (120, WriteWord(0x0007), Done),
        (121, Read, Word(0x0033)),
        (120, Read, Word(0x0007)),
        (300, WriteDoubleword(5), Done),
        (300, Read, Doubleword(5)),
    ] {
        let job = ParameterJob::new(number, access).unwrap();
        assert_eq!(bench.drive.parameter_job(&job), job.answer(result), "{number} {access:?}");
    }
}

#[test]
fn elements_and_sub_slaves() {
    let mut bench = Bench::new(&demo());
    bench.edge();
    for element in 0..8 {
        let read = ParameterJob::new(302, Access::Read).unwrap().with_element(element).unwrap();
        assert_eq!(bench.drive.parameter_job(&read).result(), ParameterResult::Doubleword(0));
        let write =
            ParameterJob::new(302, Access::WriteDoubleword(0)).unwrap().with_element(element).unwrap();
        let result = if element == 7 { ParameterResult::Done } else { ParameterResult::Error(0xFFFC) };
        assert_eq!(bench.drive.parameter_job(&write).result(), result, "element {element}");
    }
    let job = ParameterJob::new(302, Access::Read).unwrap().with_sub_slave(1);
    assert_eq!(bench.drive.parameter_job(&job), job.answer(ParameterResult::Error(0xFFFB)));
}
