//! Master and slaves against the expected characters and times.

use super::*;
use crate::serial::{Character, CharacterError};

const TIMING: Timing = Timing::new(38_400);

fn layout(pkw: PkwWidth, pzd: u8) -> Layout {
    Layout::new(pkw, pzd).unwrap()
}

fn parameters() -> Parameters {
    Parameters::new([
        Parameter::new(700, ParameterType::Unsigned16, 2.0).within(0.0, 5.0),
        Parameter::new(1080, ParameterType::Real, 50.0).within(0.0, 650.0),
        Parameter::new(2010, ParameterType::Integer32, -70_000.0),
        Parameter::new(21, ParameterType::Integer16, -3.0).read_only(),
        Parameter::array(719, ParameterType::Unsigned16, &[1.0, 2.0, 3.0]),
        Parameter::array(947, ParameterType::Unsigned32, &[70_000.0, 1.0]),
    ])
    .unwrap()
}

fn slave(address: u8, layout: Layout) -> Slave {
    Slave::new(address, TIMING, layout, parameters()).unwrap()
}

/// Passes characters without pauses, and returns the end of the last one.
fn pass(at: u64, octets: &[u8], mut receive: impl FnMut(u64, Character)) -> u64 {
    let end = |count: usize| at + TIMING.characters(count as u64);
    octets.iter().enumerate().for_each(|(index, octet)| receive(end(index + 1), Character::Byte(*octet)));
    end(octets.len())
}

/// Asks a slave for one exchange at `at`.
fn ask(slave: &mut Slave, at: u64, telegram: &Telegram) -> Option<(u64, Vec<u8>)> {
    pass(at, &telegram.characters().unwrap(), |at, character| slave.received(at, character));
    let time = slave.due()?;
    Some((time, slave.poll(time)))
}

/// Executes one request at a slave with a parameter channel of this width.
fn execute(slave: &mut Slave, at: u64, layout: Layout, request: &Pkw) -> Pkw {
    let data = layout.data(request, &vec![0; layout.pzd()]).unwrap();
    let (_, answer) =
        ask(slave, at, &Telegram { address: Address::of_station(slave.address()), data }).unwrap();
    layout.parse(&answer[3..answer.len() - 1]).unwrap().0
}

#[test]
fn times_follow_from_the_baud_rate() {
    // CU240S operating instructions: 1.146 ms for a character at 9600 bit/s, 0.573 ms start delay at 38400 bit/s.
    assert_eq!((Timing::new(9600).characters(1), TIMING.start_delay()), (1146, 573));
    assert_eq!(TIMING.residual(12), TIMING.characters(45).div_ceil(2));
    assert!(Timing::new(0).characters(1) > 0);
}

#[test]
fn a_telegram_has_length_address_and_check_sum() {
    let telegram = Telegram { address: Address::of_station(3), data: vec![0x12, 0xBC, 0, 0] };
    let characters = telegram.characters().unwrap();
    assert_eq!(characters, [0x02, 6, 3, 0x12, 0xBC, 0, 0, 0x02 ^ 6 ^ 3 ^ 0x12 ^ 0xBC]);
    assert_eq!(Telegram::of_characters(&characters), Ok(telegram));
    let long = Telegram { address: Address::BROADCAST, data: vec![0; 253] };
    assert_eq!(long.characters(), Err(TelegramError::TooLong(253)));
}

#[test]
fn values_are_at_the_end_of_the_channel() {
    let pkw = Pkw { index: 5, ..Pkw::write_word(2010, 0x1234) };
    let pzd = [0x047F, 0x2000];
    let cases: [(PkwWidth, &[u16]); 3] = [
        (PkwWidth::Three, &[0x200A, 0x8005, 0x1234]),
        (PkwWidth::Four, &[0x200A, 0x8005, 0, 0x1234]),
        (PkwWidth::Variable, &[0x200A, 0x8005, 0x1234]),
    ];
    for (width, words) in cases {
        let layout = layout(width, 2);
        let data = layout.data(&pkw, &pzd).unwrap();
        let expected: Vec<u8> = words.iter().chain(&pzd).flat_map(|word| word.to_be_bytes()).collect();
        assert_eq!(data, expected);
        let (back, process) = layout.parse(&data).unwrap();
        assert_eq!((back.word(), back.number, back.index, process.as_slice()), (0x1234, 2010, 5, &pzd[..]));
    }
    let double = Pkw::write_double(1, 0x1234_5678);
    assert_eq!(layout(PkwWidth::Three, 0).data(&double, &[]), Err(LayoutError::Values(2)));
    assert_eq!(layout(PkwWidth::None, 1).data(&Pkw::NONE, &[1]), Ok(vec![0, 1]));
    assert_eq!(layout(PkwWidth::Four, 2).parse(&[0; 11]), Err(LayoutError::Length(11)));
    assert_eq!(Layout::new(PkwWidth::Four, 17), Err(LayoutError::ProcessData(17)));
}

#[test]
fn each_page_of_parameters_has_its_bits() {
    for (number, ind) in
        [(1999, 0), (2000, 0x8000), (4000, 0x1000), (6000, 0x9000), (8000, 0x2000), (16_000, 0x4000)]
    {
        let words = Pkw::read(number).words();
        assert_eq!((words[1], Pkw::of_words(&words).number), (ind, number), "{number}");
    }
}

#[test]
fn ppo_types_have_the_sizes_of_profibus() {
    let sizes = [(4, 2), (4, 6), (0, 2), (0, 6), (4, 10)];
    for (kind, (pkw, pzd)) in (1..).zip(sizes) {
        let layout = Layout::ppo(kind).unwrap();
        assert_eq!(layout.data(&Pkw::NONE, &vec![0; pzd]).unwrap().len(), 2 * (pkw + pzd));
    }
    assert_eq!(Layout::ppo(6), Err(LayoutError::Ppo(6)));
}

#[test]
fn a_slave_answers_each_request() {
    use ReplyCode as R;
    let variable = layout(PkwWidth::Variable, 0);
    let mut drive = slave(3, variable);
    let code = |task: u8, request: Pkw| Pkw { code: task, ..request };
    let refused = |refusal: Refusal| (R::Refused, vec![refusal as u16]);
    let cases: Vec<(Pkw, (R, Vec<u16>))> = vec![
        (Pkw::NONE, (R::None, vec![])),
        (Pkw::read(700), (R::Word, vec![2])),
        (Pkw::read(2010), (R::Double, vec![0xFFFE, 0xEE90])),
        (Pkw::read(1080), (R::Double, vec![0x4248, 0])),
        (Pkw::read(21), (R::Word, vec![0xFFFD])),
        (Pkw::read(1), refused(Refusal::Number)),
        (Pkw::write_word(700, 3), (R::Word, vec![3])),
        (Pkw::write_word(700, 6), refused(Refusal::Limit)),
        (Pkw::write_double(700, 3), refused(Refusal::Type)),
        // The channel has no value, one word of a double word, or too many words.
        (Pkw { values: vec![], ..Pkw::write_word(700, 3) }, refused(Refusal::Type)),
        (Pkw { values: vec![], ..Pkw::write_double(2010, 3) }, refused(Refusal::Type)),
        (Pkw { values: vec![1], ..Pkw::write_double(2010, 3) }, refused(Refusal::Type)),
        (Pkw { values: vec![1, 2, 3], ..Pkw::write_word(700, 3) }, refused(Refusal::Type)),
        (Pkw::read(2010), (R::Double, vec![0xFFFE, 0xEE90])),
        (Pkw::write_word(21, 3), refused(Refusal::ReadOnly)),
        (Pkw::write_double(1080, 10f32.to_bits()), (R::Double, vec![0x4120, 0])),
        (Pkw::write_double(1080, f32::NAN.to_bits()), refused(Refusal::Limit)),
        (Pkw::read_element(719, 2), (R::ElementWord, vec![3])),
        (Pkw::read_element(719, 3), refused(Refusal::Index)),
        (Pkw::read_element(719, 255), (R::ElementWord, vec![1, 2, 3])),
        (Pkw::read_element(947, 0), (R::ElementDouble, vec![1, 0x1170])),
        (Pkw::read_element(700, 0), refused(Refusal::NoArray)),
        (Pkw::write_element_word(719, 1, 9), (R::ElementWord, vec![9])),
        (Pkw::write_element_double(947, 1, 0x10001), (R::ElementDouble, vec![1, 1])),
        (Pkw::read_count(719), (R::Count, vec![3])),
        (Pkw::read_count(700), refused(Refusal::NoArray)),
        (Pkw::read_description(719, 1), (R::Description, vec![0x4006])),
        (Pkw::read_description(21, 1), (R::Description, vec![0x0203])),
        (Pkw::read_description(719, 2), (R::Description, vec![3])),
        (Pkw::read_description(700, 8), (R::Description, vec![5])),
        (Pkw::read_description(700, 6), refused(Refusal::NoDescription)),
        (code(5, Pkw::read(700)), refused(Refusal::Description)),
        (code(10, Pkw::read(700)), refused(Refusal::Other)),
        (code(15, Pkw::read(700)), refused(Refusal::NoText)),
    ];
    for (index, (request, (reply, values))) in cases.into_iter().enumerate() {
        let answer = execute(&mut drive, index as u64 * 100_000, variable, &request);
        assert_eq!((answer.code, &answer.values), (reply as u8, &values), "{request:?}");
        assert_eq!((answer.number, answer.index), (request.number, request.index));
        assert_eq!(answer.answers(&request), request.code != 0);
    }
    assert_eq!(
        (drive.parameters().value(719, 1), drive.parameters().value(947, 1)),
        (Some(9.0), Some(65_537.0))
    );
}

#[test]
fn stored_values_survive_a_restart() {
    let four = layout(PkwWidth::Four, 0);
    let mut drive = slave(3, four);
    let requests = [
        Pkw::write_word(700, 3).stored(),
        Pkw::write_double(1080, 20f32.to_bits()).stored(),
        Pkw::write_element_word(719, 0, 7).stored(),
        Pkw::write_element_double(947, 0, 8).stored(),
        Pkw::write_element_word(719, 2, 8),
    ];
    for (index, request) in requests.iter().enumerate() {
        let answer = execute(&mut drive, index as u64 * 100_000, four, request);
        assert!(answer.answers(request) && answer.refusal().is_none(), "{answer:?}");
    }
    drive.parameters_mut().restart();
    let value = |number, index| drive.parameters().value(number, index);
    assert_eq!(
        (value(700, 0), value(1080, 0), value(719, 0), value(947, 0)),
        (Some(3.0), Some(20.0), Some(7.0), Some(8.0))
    );
    assert_eq!(value(719, 2), Some(3.0));
    // The drive withdraws the right to change parameters, and changes a parameter itself.
    drive.parameters_mut().lock(true);
    assert_eq!(
        execute(&mut drive, 1_000_000, four, &Pkw::write_word(700, 1)).code,
        ReplyCode::NoRights as u8
    );
    assert_eq!(execute(&mut drive, 1_100_000, four, &Pkw::read(700)).word(), 3);
    drive.parameters_mut().set(21, 0, -4.0).unwrap();
    assert_eq!(execute(&mut drive, 1_200_000, four, &Pkw::read(21)).word(), 0xFFFC);
    let missing = ParametersError::NotDefined { number: 21, index: 1 };
    assert_eq!(drive.parameters_mut().set(21, 1, 0.0), Err(missing));
}

#[test]
fn a_table_of_parameters_is_checked() {
    let word = |number| Parameter::new(number, ParameterType::Unsigned16, 1.0);
    let check = |parameters: Vec<Parameter>| Parameters::new(parameters).err().map(|error| error.to_string());
    assert_eq!(check(vec![word(1), word(1)]).unwrap(), "parameter 1 is defined twice");
    assert_eq!(check(vec![word(32_000)]).unwrap(), "parameter 32000: the number must be 0 to 31999");
    assert_eq!(
        check(vec![word(1).within(2.0, 3.0)]).unwrap(),
        "parameter 1: the value 1 is outside the limits"
    );
    let limits = "parameter 1: the limits -1 and 3 are in the wrong order or outside its type";
    assert_eq!(check(vec![word(1).within(-1.0, 3.0)]).unwrap(), limits);
    let empty = Parameter::array(1, ParameterType::Real, &[]);
    assert_eq!(check(vec![empty]).unwrap(), "parameter 1 has 0 elements; an array has 1 to 255");
}

#[test]
fn a_slave_answers_after_the_start_delay() {
    let two = layout(PkwWidth::None, 2);
    let mut drive = slave(3, two);
    drive.set_actual(&[0x1234, 0x5678]).unwrap();
    assert_eq!(drive.set_actual(&[1]), Err(LayoutError::Words { found: 1, expected: 2 }));
    let telegram = Telegram { address: Address::of_station(3), data: vec![0x04, 0x7F, 0x10, 0x00] };
    let (time, answer) = ask(&mut drive, 0, &telegram).unwrap();
    assert_eq!(time, TIMING.characters(8) + TIMING.start_delay());
    assert_eq!(answer[..7], [0x02, 6, 3, 0x12, 0x34, 0x56, 0x78]);
    assert_eq!(
        (drive.setpoints(), drive.last_telegram()),
        (&[0x047F, 0x1000][..], Some(TIMING.characters(8)))
    );
    assert_eq!((drive.next_event(), drive.next_event()), (Some(SlaveEvent::Setpoints), None));
    // The delay can be longer, but not shorter.
    drive.set_response_delay(0);
    assert_eq!(ask(&mut drive, 100_000, &telegram).unwrap().0, 100_000 + time);
    drive.set_response_delay(9_000);
    assert_eq!(ask(&mut drive, 200_000, &telegram).unwrap().0, 209_000 + TIMING.characters(8));
}

#[test]
fn a_slave_answers_only_its_own_telegrams() {
    let four = layout(PkwWidth::Four, 1);
    let mut drive = slave(3, four);
    let data = four.data(&Pkw::write_word(700, 4), &[7]).unwrap();
    let telegram = |address| Telegram { address, data: data.clone() };
    assert_eq!(ask(&mut drive, 0, &telegram(Address::of_station(4))), None);
    assert_eq!(ask(&mut drive, 100_000, &telegram(Address(0x83))), None);
    assert_eq!(drive.next_event(), None);
    assert_eq!(drive.setpoints(), [0]);
    // A mirror telegram comes back and changes nothing; its net data may have any length.
    let mirror = Telegram { address: Address::of_station(3).mirror(), data: vec![1, 2, 3] };
    assert_eq!(ask(&mut drive, 200_000, &mirror).unwrap().1, mirror.characters().unwrap());
    assert_eq!(drive.parameters().value(700, 0), Some(2.0));
    // A broadcast has effects and no answer.
    assert_eq!(ask(&mut drive, 300_000, &telegram(Address::BROADCAST)), None);
    assert_eq!((drive.setpoints(), drive.parameters().value(700, 0)), (&[7][..], Some(4.0)));
    drive.next_event();
    drive.next_event();
    // The slave does not answer net data of a wrong length.
    let short = Telegram { address: Address::of_station(3), data: vec![0; 8] };
    assert_eq!(ask(&mut drive, 400_000, &short), None);
    assert_eq!(drive.next_event(), Some(SlaveEvent::WrongLength(8)));
}

#[test]
fn telegrams_need_a_start_delay_and_their_time() {
    let two = layout(PkwWidth::None, 2);
    let telegram = Telegram { address: Address::of_station(3), data: vec![0; 4] };
    let characters = telegram.characters().unwrap();
    let character = TIMING.characters(1);
    // The pause before the telegram, the pause between its characters, and whether the slave answers.
    let cases = [
        (0, 0, false),
        (character, 0, false),
        (2 * character + 2, 0, true),
        (2 * character + 2, character, false),
    ];
    for (before, between, answers) in cases {
        let mut drive = slave(3, two);
        drive.received(100_000, Character::Byte(0x55));
        let mut at = 100_000 + before;
        for octet in &characters {
            at += character;
            drive.received(at, Character::Byte(*octet));
            at += between;
        }
        assert_eq!(drive.due().is_some(), answers, "{before} {between}");
    }
    for (error, expected) in [
        (CharacterError::Parity, TelegramError::DamagedCharacter),
        (CharacterError::Break, TelegramError::Break),
    ] {
        let mut drive = slave(3, two);
        pass(0, &characters[..4], |at, character| drive.received(at, character));
        drive.received(5 * character, Character::Error(error));
        assert_eq!((drive.due(), drive.next_event()), (None, Some(SlaveEvent::Damaged(expected))));
    }
    for (length, characters) in [(0u8, [STX, 0, 3, 0]), (255, [STX, 255, 3, 0])] {
        let mut drive = slave(3, two);
        pass(0, &characters, |at, character| drive.received(at, character));
        assert_eq!(drive.next_event(), Some(SlaveEvent::Damaged(TelegramError::Length(length))));
    }
}

/// A master with its slaves on a line without faults.
struct Bench {
    master: Master,
    slaves: Vec<Slave>,
    now: u64,
    telegrams: Vec<(u64, Vec<u8>)>,
}

impl Bench {
    fn new(slaves: Vec<(Slave, Layout)>) -> Self {
        let stations =
            slaves.iter().map(|(slave, layout)| Station { address: slave.address(), layout: *layout });
        let master = Master::new(TIMING, stations).unwrap();
        Bench {
            master,
            slaves: slaves.into_iter().map(|(slave, _)| slave).collect(),
            now: 0,
            telegrams: Vec::new(),
        }
    }

    fn run(&mut self, until: u64) -> Vec<MasterEvent> {
        loop {
            let slaves = self.slaves.iter().filter_map(Slave::due);
            match slaves.chain(self.master.due()).min() {
                Some(time) if time <= until => self.now = self.now.max(time),
                _ => break,
            }
            let request = self.master.poll(self.now);
            if !request.is_empty() {
                self.telegrams.push((self.now, request.clone()));
                pass(self.now, &request, |at, character| {
                    self.slaves.iter_mut().for_each(|slave| slave.received(at, character));
                });
            }
            for index in 0..self.slaves.len() {
                let answer = self.slaves[index].poll(self.now);
                if !answer.is_empty() {
                    pass(self.now, &answer, |at, character| {
                        self.master.received(at, character);
                        let others = self.slaves.iter_mut().enumerate().filter(|(other, _)| *other != index);
                        others.for_each(|(_, slave)| slave.received(at, character));
                    });
                }
            }
        }
        core::iter::from_fn(|| self.master.next_event()).collect()
    }
}

#[test]
fn the_master_polls_its_slaves_in_turn() {
    let (four, three) = (layout(PkwWidth::Four, 2), layout(PkwWidth::Three, 1));
    let mut bench = Bench::new(vec![(slave(3, four), four), (slave(7, three), three)]);
    bench.master.set_setpoints(3, &[1, 2]).unwrap();
    bench.master.set_setpoints(7, &[9]).unwrap();
    bench.slaves[0].set_actual(&[0xA, 0xB]).unwrap();
    bench.slaves[1].set_actual(&[0xC]).unwrap();
    assert_eq!(bench.run(100_000), []);
    let addresses: Vec<u8> = bench.telegrams.iter().take(4).map(|(_, telegram)| telegram[2]).collect();
    assert_eq!(addresses, [3, 7, 3, 7]);
    // Request of 16 characters, start delay, answer of 16 characters, start delay.
    let exchange = TIMING.characters(16) * 2 + TIMING.start_delay() * 2;
    assert_eq!(bench.telegrams[1].0, exchange);
    assert_eq!((bench.slaves[0].setpoints(), bench.slaves[1].setpoints()), (&[1, 2][..], &[9][..]));
    assert_eq!((bench.master.actual(3), bench.master.actual(7)), (Ok(&[0xA, 0xB][..]), Ok(&[0xC][..])));
    bench.master.request(7, Pkw::read(700)).unwrap();
    assert_eq!(bench.master.request(7, Pkw::read(700)), Err(MasterError::Busy(7)));
    bench.master.request(3, Pkw::read(1)).unwrap();
    let events = bench.run(200_000);
    let values: Vec<(u8, u16, Option<u16>)> = events
        .into_iter()
        .map(|event| match event {
            MasterEvent::Answered { address, reply } => (address, reply.word(), reply.refusal()),
            other => panic!("{other:?}"),
        })
        .collect();
    assert!(values.contains(&(7, 2, None)) && values.contains(&(3, 0, Some(0))), "{values:?}");
}

#[test]
fn broadcast_and_mirror_telegrams_come_between_the_slaves() {
    let four = layout(PkwWidth::Four, 2);
    let mut bench = Bench::new(vec![(slave(3, four), four), (slave(7, four), four)]);
    bench.master.broadcast(four, &Pkw::write_word(700, 4), &[5, 6]).unwrap();
    bench.master.mirror(7, &[1, 2, 3]).unwrap();
    assert_eq!(bench.run(15_000), [MasterEvent::Mirrored(7)]);
    assert_eq!(bench.telegrams[1].0, TIMING.characters(16) + TIMING.start_delay());
    assert!(bench.slaves.iter().all(|slave| slave.parameters().value(700, 0) == Some(4.0)));
    assert_eq!(bench.slaves[1].setpoints(), [5, 6]);
    assert_eq!(bench.telegrams[1].1, [0x02, 5, 0x47, 1, 2, 3, 0x02 ^ 5 ^ 0x47 ^ 1 ^ 2 ^ 3]);
}

#[test]
fn the_master_reports_slaves_that_do_not_answer() {
    let four = layout(PkwWidth::Four, 0);
    let mut bench = Bench::new(vec![(slave(3, four), four)]);
    bench.master.request(3, Pkw::read(700)).unwrap();
    let drive = bench.slaves.pop().unwrap();
    let silent = MasterEvent::Failed { address: 3, fault: StationFault::Silent };
    let wait = TIMING.characters(12) + Timing::RESPONSE_DELAY + TIMING.characters(1);
    assert_eq!(bench.run(wait - 1), []);
    assert_eq!(bench.run(wait), std::slice::from_ref(&silent));
    assert_eq!(bench.telegrams.len(), 1);
    let events = bench.run(3_500_000);
    assert_eq!(events[..3], [silent.clone(), silent, MasterEvent::Lost(3)]);
    let unanswered = MasterEvent::Unanswered { address: 3, request: Pkw::read(700) };
    assert!(events.contains(&unanswered) && bench.master.is_present(3) == Ok(false));
    bench.slaves.push(drive);
    let now = bench.now;
    assert!(bench.run(now + 100_000).contains(&MasterEvent::Returned(3)));
    // A slave with a response delay above 20 ms.
    bench.slaves[0].set_response_delay(25_000);
    let now = bench.now;
    assert!(bench.run(now + 200_000).contains(&MasterEvent::Lost(3)));
}

#[test]
fn the_master_reports_answers_that_are_none() {
    use StationFault as F;
    let two = layout(PkwWidth::None, 1);
    let sum = |characters: &[u8]| {
        let sum = characters.iter().fold(0, |sum, character| sum ^ character);
        [characters, &[sum]].concat()
    };
    let mut wrong = sum(&[STX, 4, 3, 0, 1]);
    wrong[5] ^= 0x80;
    let expected = wrong[5] ^ 0x80;
    let cases = [
        (sum(&[STX, 4, 4, 0, 1]), F::Address(4)),
        (sum(&[STX, 4, 0x43, 0, 1]), F::Address(0x43)),
        (sum(&[STX, 6, 3, 0, 1, 0, 2]), F::Length(4)),
        (wrong.clone(), F::Damaged(TelegramError::CheckSum { found: wrong[5], expected })),
        (sum(&[STX, 4, 3, 0, 1])[..4].to_vec(), F::Damaged(TelegramError::Late)),
    ];
    for (answer, fault) in cases {
        let mut master = Master::new(TIMING, [Station { address: 3, layout: two }]).unwrap();
        let request = master.poll(0);
        let end = TIMING.characters(request.len() as u64 + 2);
        pass(end, &answer, |at, character| master.received(at, character));
        let time = master.due().unwrap();
        master.poll(time);
        assert_eq!(master.next_event(), Some(MasterEvent::Failed { address: 3, fault }));
        assert_eq!(master.actual(3), Ok(&[0][..]));
    }
}

#[test]
fn the_master_refuses_wrong_calls() {
    let (none, four) = (layout(PkwWidth::None, 1), layout(PkwWidth::Three, 0));
    let station = |address, layout| Station { address, layout };
    assert_eq!(Master::new(TIMING, [station(32, none)]).err(), Some(MasterError::Address(32)));
    assert_eq!(Master::new(TIMING, [station(3, none), station(3, four)]).err(), Some(MasterError::Twice(3)));
    assert_eq!(Slave::new(32, TIMING, none, Parameters::default()).err(), Some(MasterError::Address(32)));
    let mut master = Master::new(TIMING, [station(3, none), station(4, four)]).unwrap();
    let words = LayoutError::Words { found: 2, expected: 1 };
    assert_eq!(master.set_setpoints(3, &[1, 2]), Err(MasterError::Layout(words)));
    assert_eq!(master.set_setpoints(5, &[]), Err(MasterError::NoStation(5)));
    assert_eq!(master.request(3, Pkw::read(1)), Err(MasterError::NoParameters(3)));
    assert_eq!(master.request(4, Pkw::NONE), Err(MasterError::NoRequest(0)));
    assert_eq!(master.request(4, Pkw::read(32_000)), Err(MasterError::Number(32_000)));
    assert_eq!(master.request(4, Pkw::write_double(1, 1)), Err(MasterError::Layout(LayoutError::Values(2))));
    assert_eq!(master.mirror(4, &[0; 253]), Err(MasterError::Telegram(TelegramError::TooLong(253))));
    let mut idle = Master::new(TIMING, []).unwrap();
    assert_eq!((idle.due(), idle.poll(0)), (None, vec![]));
}
