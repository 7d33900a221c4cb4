use super::*;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::{Journal, Names};
use crate::layout::DeviceLayout;

/// Effect of the faults of a family.
#[derive(Debug, PartialEq)]
enum Noise {
    Hiss(u32),
    Hum,
}

static HISS: FaultKind = FaultKind::new(201, "hiss", TargetKind::Bus, "It hisses", |fault| {
    Effect::new(Noise::Hiss(fault.value("volume").unwrap_or(0)))
})
.with(
    const {
        &[
            Field::new("volume", Form::Number { least: 1, most: 9 }, "How loud").required("give 1 to 9"),
            Field::new("tone", Form::Word(&["low", "high"]), "Which").default(1),
            Field::new("mark", Form::Hex { least: 0, most: 0xFF, digits: 2 }, "Whose"),
        ]
    },
)
.agreeing(|fault| match (fault.value("volume"), fault.value("tone")) {
    (Some(9), Some(0)) => Err("9 is too loud for a low tone".to_owned()),
    _ => Ok(()),
});
static HUM: FaultKind =
    FaultKind::new(202, "hum", TargetKind::Participant, "It hums", |_| Effect::new(Noise::Hum)).once();
static FOG: FaultKind =
    FaultKind::new(203, "fog", TargetKind::Device, "It sees nothing", |_| Effect::new(())).without_hits();
static LEAK: FaultKind = FaultKind::new(204, "leak", TargetKind::Port, "It leaks", |_| Effect::new(()));
static OF_BUS: &[&FaultKind] = &[&HISS, &HUM, &LEAK];
static OF_DEVICE: &[&FaultKind] = &[&FOG];
static KINDS: [&FaultKind; 4] = [&HISS, &HUM, &FOG, &LEAK];

fn names() -> Names {
    Names { plcs: vec!["saw".into()], buses: vec!["air".into(), "wire".into()], devices: Vec::new() }
}

fn words(kind: &str, fields: &[&str]) -> Result<FaultSpec, String> {
    FaultSpec::from_words(&KINDS, kind, fields).map_err(|error| error.to_string())
}

fn fault(text: &str) -> Result<Fault, String> {
    let (kind, fields) = text.split_once(' ').unwrap_or((text, ""));
    let fields: Vec<_> = fields.split_whitespace().collect();
    words(kind, &fields)?.resolve(&KINDS, &names()).map_err(|error| error.to_string())
}

#[test]
fn left_out_values_are_those_of_the_description() {
    let hiss = fault("hiss bus=wire volume=3").unwrap();
    assert_eq!(["volume", "tone", "mark", "x"].map(|name| hiss.value(name)), [Some(3), Some(1), None, None]);
    assert_eq!((hiss.target(), hiss.limit()), (Target::Bus(BusIndex(1)), Limit::UntilCleared));
    assert_eq!(hiss.text(&names()), "hiss bus=wire volume=3");
    assert_eq!(fault("hum bus=air slave=3").unwrap().limit(), Limit::Count(1));
    let all = "hiss bus=air volume=3 tone=low mark=16#0A at_us=5 duration_us=6";
    assert_eq!(fault(all).unwrap().text(&names()), all);
}

#[test]
fn values_that_a_kind_does_not_allow_are_refused_from_any_source() {
    let draft = Draft::new(&HISS, Target::Bus(BusIndex(0)));
    let (volume, at_us) = (&HISS.fields()[0], FaultKind::COMMON[0]);
    assert_eq!(draft.check(), Err(Refusal::Missing { field: volume, right: "give 1 to 9".to_owned() }));
    let draft = Draft { values: [Some(3), None, None, None, None], ..draft };
    assert!(draft.check().is_ok());
    let too_late = Refusal::Range { field: at_us, value: MAX_AT_US + 1, least: 0, most: MAX_AT_US };
    for (draft, expected) in [
        (Draft { at_us: MAX_AT_US + 1, ..draft }, too_late),
        (
            Draft { target: Target::Device(DeviceIndex(0)), ..draft },
            Refusal::OtherPlace { place: TargetKind::Bus },
        ),
        (Draft { count: Some(1), duration_us: Some(1), ..draft }, Refusal::TwoLimits),
        (
            Draft { count: Some(1), ..Draft::new(&FOG, Target::Device(DeviceIndex(0))) },
            Refusal::NotCounted { kind: &FOG },
        ),
    ] {
        assert_eq!(draft.check(), Err(expected));
    }
    for (text, expected) in [
        ("hiss bus=air volume=10", "hiss: volume is 10; it must be 1 to 9"),
        ("hiss bus=air volume=3 mark=16#100", "hiss: mark is 16#100; it must be 16#000 to 16#0FF"),
        ("hiss bus=air volume=9 tone=low", "hiss: 9 is too loud for a low tone"),
        ("hiss bus=air volume=1 tone=x", "hiss: tone = \"x\"; it must be low, high"),
        ("hum bus=air slave=32", "hum: slave is 32; it must be 0 to 31"),
        ("fog count=0", "fog: count has no meaning for fog; give duration_us, or clear the fault"),
        ("fog tone=low", "fog: tone has no meaning; its fields are: plc, at_us, duration_us"),
        ("fog colour=1", "`colour=1`: there is no field `colour`; the fields are: plc, at, duration"),
        (
            "hum colour=1",
            "`colour=1`: there is no field `colour`; the fields are: bus, slave, at, count, duration",
        ),
        ("leak node=1", "leak: PLC \"saw\" has no port 1; its ports are: none"),
        ("leak", "leak: node is missing; give a port; the PLC has none"),
        ("hiss bus=air volume=1 count=0", "hiss: count is 0; it must be 1 to 4294967295"),
        ("hiss bus=air volume=1 duration_us=0", "hiss: duration_us is 0; it must be 1 to 3600000000 (1 h)"),
    ] {
        assert_eq!(fault(text), Err(expected.to_owned()));
    }
}

#[test]
fn faults_of_missing_targets_are_refused() {
    let sites = Sites {
        buses: vec![
            BusSite { faults: OF_BUS, fits: |_| Ok(()), participants: 1 << 3 },
            BusSite { faults: &[], fits: |_| Ok(()), participants: 0 },
        ],
        devices: vec![
            DeviceSite {
                layout: &DeviceLayout::UNKNOWN,
                faults: OF_DEVICE,
                plugged: Vec::new(),
                drives: Vec::new(),
            },
            DeviceSite {
                layout: &DeviceLayout::UNKNOWN,
                faults: &[],
                plugged: Vec::new(),
                drives: Vec::new(),
            },
        ],
    };
    let owner = |kind: &'static FaultKind, target| {
        let values = [(kind == &HISS).then_some(1), None, None, None, None];
        sites.owner(&Draft { values, ..Draft::new(kind, target) }.check().unwrap())
    };
    let hum = |bus, number| owner(&HUM, Target::Participant { bus, number });
    assert_eq!(owner(&HISS, Target::Bus(BusIndex(0))), Ok(Owner::Bus(BusIndex(0))));
    assert_eq!(hum(BusIndex(0), 3), Ok(Owner::Bus(BusIndex(0))));
    assert_eq!(owner(&FOG, Target::Device(DeviceIndex(0))), Ok(Owner::Device(DeviceIndex(0))));
    assert_eq!(
        owner(&HISS, Target::Bus(BusIndex(1))),
        Err(Refusal::NotOfBus { bus: BusIndex(1), known: &[] })
    );
    assert_eq!(
        owner(&HISS, Target::Bus(BusIndex(2))),
        Err(Refusal::UnknownBus { bus: BusIndex(2), count: 2 })
    );
    assert_eq!(hum(BusIndex(0), 4), Err(Refusal::NoSlave { bus: BusIndex(0), slave: 4, present: 1 << 3 }));
    assert_eq!(
        owner(&FOG, Target::Device(DeviceIndex(1))),
        Err(Refusal::NotOfPlc { plc: DeviceIndex(1), known: &[] })
    );
    assert_eq!(
        owner(&FOG, Target::Device(DeviceIndex(2))),
        Err(Refusal::UnknownPlc { plc: DeviceIndex(2), count: 2 })
    );
    let layout = &DeviceLayout::UNKNOWN;
    assert_eq!(
        owner(&LEAK, Target::Port { device: DeviceIndex(0), port: PortNumber(1) }),
        Err(Refusal::NoPort { plc: DeviceIndex(0), port: PortNumber(1), layout })
    );
}

#[test]
fn only_the_owner_fires_a_fault_and_only_the_given_number_of_times() {
    let (mut faults, mut journal) = (Faults::default(), Journal::default());
    for (index, count) in [(0, 2), (1, 1)] {
        let text = format!("hiss bus={} volume={} count={count}", names().buses[index], index + 5);
        faults.add(0, fault(&text).unwrap(), Owner::Bus(BusIndex::at(index)), &mut journal).unwrap();
    }
    let mut seen = Vec::new();
    let fire = |faults: &mut Faults, journal: &mut Journal, seen: &mut Vec<(u32, u32)>| {
        faults.fire(1, Owner::Bus(BusIndex(0)), journal, |_, effect: &Noise, hits| {
            let Noise::Hiss(volume) = *effect else { return None };
            seen.push((volume, hits));
            Some(Hit::Plain)
        });
    };
    fire(&mut faults, &mut journal, &mut seen);
    assert!(seen.is_empty(), "they have not begun");
    faults.advance(1, &mut journal);
    assert_eq!(faults.acting::<Noise>(Owner::Bus(BusIndex(1))).count(), 1);
    assert_eq!(faults.acting::<()>(Owner::Bus(BusIndex(1))).count(), 0, "an effect of another type");
    (0..3).for_each(|_| fire(&mut faults, &mut journal, &mut seen));
    assert_eq!(seen, [(5, 0), (5, 1)]);
    assert_eq!(faults.list().map(|fault| fault.id).collect::<Vec<_>>(), [2]);
}

#[test]
fn refusals_get_names() {
    let names = Names { plcs: vec!["line".into(), "saw".into()], ..names() };
    let named = |refusal| FaultError::refused(&HUM, refusal, &names).to_string();
    assert_eq!(
        named(Refusal::NoSlave { bus: BusIndex(1), slave: 7, present: 1 << 3 | 1 << 31 }),
        "hum: bus \"wire\" has no slave 7; its slaves are: 3, 31"
    );
    assert_eq!(
        named(Refusal::NoSlave { bus: BusIndex(0), slave: 7, present: 0 }),
        "hum: bus \"air\" has no slave 7; its slaves are: none"
    );
    assert_eq!(
        named(Refusal::NotPlugged { plc: DeviceIndex(1), port: "node1", plugged: vec!["node2"] }),
        "hum: node1 of PLC \"saw\" is not on a bus; ports on a bus: node2"
    );
    assert_eq!(
        named(Refusal::NotOfPlc { plc: DeviceIndex(1), known: OF_DEVICE }),
        "hum: PLC \"saw\" cannot have it; its faults are: fog"
    );
    assert_eq!(named(Refusal::TooMany), "hum: there are 256 faults already; clear one first");
}

#[test]
fn the_only_bus_or_plc_needs_no_name() {
    assert_eq!(fault("fog").unwrap().target(), Target::Device(DeviceIndex(0)));
    let one = Names { buses: vec!["air".into()], ..Names::default() };
    let hiss = words("hiss", &["volume=1"]).unwrap().resolve(&KINDS, &one);
    assert_eq!(hiss.unwrap().target(), Target::Bus(BusIndex(0)));
    assert_eq!(fault("hiss volume=1"), Err("hiss: bus is missing; give one of: air, wire".to_owned()));
}
