//! The ports of a device in a folder: frames, filters, losses, faults and snapshots on CAN; the master on PROFIBUS.

use super::folders::{Card, journal};
use commram::can::{BitRate, Frame, Payload, wire};
use commram::plant::PlantConfig;
use commram::script::Bench;

/// A plant with these cards at a bus of 125 kbit/s.
fn plant(cards: &[(&str, &Card)]) -> Bench {
    let mut text = "[[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n".to_owned();
    for (name, card) in cards {
        text += &format!("[[device]]\nname = '{name}'\nkind = '{}'\nbus = 'open'\n", card.dir().display());
    }
    Bench::plant(&text).unwrap()
}

const SENDER: &str = "fn written(register, old, value) { send(0x123, [value, 2, 3]); }
fn frame(frame) { journal(`answer ${frame.id} ${frame.extended} ${frame.data}`); output(\"card.w_COUNT\", frame.data[0]); }
";
const ANSWERER: &str = "fn frame(frame) {
    journal(`request ${frame.id} ${frame.remote} ${frame.length}`);
    frame.id = 0x12345;
    frame.extended = true;
    send(frame);
}
";

/// Frames take the time of their bits, and the hooks are called at their ends.
#[test]
fn frames_arrive_at_the_end_of_their_bits() {
    let (one, other) = (Card::with_port(SENDER), Card::with_port(ANSWERER));
    let run = |steps: &[&str]| {
        let mut bench = plant(&[("one", &one), ("other", &other)]);
        bench.poke("one:card.w_DATA", 7).unwrap();
        steps.iter().for_each(|step| bench.step(*step).unwrap());
        assert_eq!(bench.peek("one:card.w_COUNT").unwrap(), 7);
        (journal(&mut bench), bench.journal_hash())
    };
    let (lines, hash) = run(&["10ms"]);
    let data = Payload::new(&[7, 2, 3]).unwrap();
    let rate = BitRate::new(125_000).unwrap();
    let request = wire::airtime(&Frame::standard(0x123, data), rate);
    // The firmware sees the store at its first cycle, 500 us after power-on.
    let arrival = 500 + request.delivery_ns.div_ceil(1000);
    let id = commram::can::ExtendedId::new(0x12345).unwrap();
    let answer = wire::airtime(&Frame::new(id, data), rate);
    let answered = 500 + (request.occupation_ns + answer.delivery_ns).div_ceil(1000);
    for (time, text) in [
        (arrival, "16#123 07 02 03 from one:can"),
        (arrival, "request 291 false 3"),
        (answered, "16#00012345 07 02 03 from other:can"),
        (answered, "answer 74565 true [7, 2, 3]"),
    ] {
        let is_it = |line: &String| line.starts_with(&format!("{time} ")) && line.contains(text);
        assert_eq!(lines.iter().filter(|line| is_it(line)).count(), 1, "{time} {text}: {lines:#?}");
    }
    assert_eq!(run(&["100us"; 100]).1, hash, "the steps of the clock make no difference");
}

/// A snapshot contains frames in the queue and on the wire.
#[test]
fn going_back_restores_the_frames_of_the_port() {
    let burst =
        "fn written(register, old, value) { for i in 0..20 { send(0x100 + i, [value]); } accept([0x300]); }";
    let count = "fn frame(frame) { write(\"card.w_COUNT\", read(\"card.w_COUNT\") + 1); }";
    let (one, other) = (Card::with_port(burst), Card::with_port(count));
    let mut bench = plant(&[("one", &one), ("other", &other)]);
    bench.poke("one:card.w_DATA", 1).unwrap();
    bench.step("3700us").unwrap();
    let (middle, before) = (bench.save().unwrap(), bench.peek("other:card.w_COUNT").unwrap());
    assert!((1..20).contains(&before), "{before}");
    let mut ends = Vec::new();
    for _ in 0..2 {
        bench.step("30ms").unwrap();
        ends.push((bench.peek("other:card.w_COUNT").unwrap(), bench.journal_hash()));
        bench.back_to(middle).unwrap();
        assert_eq!(bench.peek("other:card.w_COUNT").unwrap(), before);
    }
    assert_eq!((ends[0].0, ends[0]), (20, ends[1]));
}

/// No frame is lost silently: the verb returns false, and the journal has a record.
#[test]
fn lost_frames_are_visible() {
    let script = "fn power_off() { this.count(1); }
fn written(register, old, value) { this.count(value); journal(bus_state()); }
fn count(value) { for i in 0..value { if !send(i, []) { write(\"card.w_COUNT\", read(\"card.w_COUNT\") + 1); } } }";
    let card = Card::with_port(script);
    let mut bench = card.bench();
    bench.poke("card.w_DATA", 2).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(bench.peek("card.w_COUNT").unwrap(), 2);
    let lines = journal(&mut bench);
    assert!(lines.iter().any(|line| line.ends_with(" no_bus")), "{lines:#?}");
    let lost = |lines: &[String], text: &str| lines.iter().filter(|line| line.ends_with(text)).count();
    assert_eq!(lost(&lines, "frame not sent: 16#001: the port is at no bus"), 1, "{lines:#?}");
    // The card is the only station of its bus, so its frames get no acknowledgement.
    let mut bench = plant(&[("one", &card)]);
    bench.poke("card.w_DATA", 66).unwrap();
    bench.step("100ms").unwrap();
    assert_eq!(bench.peek("card.w_COUNT").unwrap(), 2);
    let lines = journal(&mut bench);
    assert_eq!(lost(&lines, "the transmit queue is full (64 frames)"), 2, "{lines:#?}");
    assert_eq!(lost(&lines, "frame not sent: 16#041: the transmit queue is full (64 frames)"), 1);
    bench.power_cycle("").unwrap();
    assert_eq!(lost(&journal(&mut bench), "frame not sent: 16#000: the device has no power"), 1);
    // After power-on the queue is empty, and a second station acknowledges.
    bench.poke("card.w_DATA", 64).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(bench.peek("card.w_COUNT").unwrap(), 0);
    bench.send_frame("open", 0x7FF, false, "").unwrap();
    bench.step("100ms").unwrap();
    bench.poke("card.w_DATA", 63).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(bench.peek("card.w_COUNT").unwrap(), 0, "sent frames leave the queue");
}

/// Filters select the frames for which the hook is called. Power-on removes them.
#[test]
fn filters_select_frames() {
    let script = "fn written(register, old, value) {
    accept([0x123, #{ id: 0x200, mask: 0x7F0 }, #{ id: 0x123, extended: true }]);
}
fn frame(frame) { write(\"card.w_COUNT\", read(\"card.w_COUNT\") + 1); }";
    let card = Card::with_port(script);
    let mut bench = plant(&[("one", &card)]);
    let arrivals = |bench: &mut Bench| {
        let before = bench.peek("card.w_COUNT").unwrap();
        for (id, extended) in [(0x123, false), (0x124, false), (0x20F, false), (0x210, false), (0x123, true)]
        {
            bench.send_frame("open", id, extended, "01").unwrap();
            bench.step("3ms").unwrap();
        }
        bench.peek("card.w_COUNT").unwrap() - before
    };
    assert_eq!(arrivals(&mut bench), 5);
    bench.poke("card.w_DATA", 1).unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(arrivals(&mut bench), 3);
    bench.power_cycle("").unwrap();
    bench.step("1ms").unwrap();
    assert_eq!(arrivals(&mut bench), 5, "power-on removes the filters");
}

/// Faults of the bus reach the port and its script.
#[test]
fn faults_of_the_bus_reach_the_script() {
    let script = "fn written(register, old, value) { send(5, [1]); }
fn bus_event(event) { journal(`event ${event} ${bus_state()}`); }
fn frame(frame) { journal(\"frame\"); }";
    let card = Card::with_port(script);
    let mut bench = plant(&[("one", &card)]);
    bench.fault("bus_off plc=one node=can").unwrap();
    bench.poke("card.w_DATA", 1).unwrap();
    bench.send_frame("open", 0x10, false, "").unwrap();
    bench.step("1ms").unwrap();
    bench.fault("overrun plc=one node=can").unwrap();
    bench.step("50ms").unwrap();
    bench.send_frame("open", 0x10, false, "").unwrap();
    bench.step("50ms").unwrap();
    let lines = journal(&mut bench);
    let at = |text: &str| lines.iter().position(|line| line.contains(text));
    let events =
        ["event bus_off bus_off", "event error_active error_active", "16#005 01 from", "event overrun"];
    let places = events.map(at);
    assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{places:?} {lines:#?}");
    assert_eq!(at("note: frame"), None, "{lines:#?}");
}

/// Each mistake has its place and the correct form.
#[test]
fn mistakes_about_ports_are_refused() {
    let declare = "declare it in device.toml: port = [{ name = \"can\", number = 1, medium = \"can\", roles = [\"peer\"] }]";
    for (script, line, what) in [
        ("\nfn frame(frame) {}", 2, "the hook frame needs a port; "),
        ("fn bus_event(event) {}", 1, "the hook bus_event needs a port; "),
        ("fn poll() {\n  send(1, [2]); }", 2, "`send` needs a port; "),
        ("fn poll() { accept([]); }", 1, "`accept` needs a port; "),
    ] {
        let refused = Card::new(script).refused();
        assert!(refused.ends_with(&format!("firmware.rhai:{line}: {what}{declare}")), "{refused}");
    }
    let parameters = Card::with_port("fn frame() {}").refused();
    assert!(parameters.ends_with("the hook frame is a function frame(frame)"), "{parameters}");
    let refused = |card: &Card, kind: &str, bus: &str| {
        let text = format!(
            "[[bus]]\nname = 'open'\nkind = '{kind}'\nkbit_s = 500\n[[device]]\nname = 'one'\nkind = '{}'\nbus = '{bus}'\n",
            card.dir().display()
        );
        let config = PlantConfig::parse("plant", &text).and_then(|plant| plant.check());
        config.unwrap_err().to_string()
    };
    let (with, without) = (Card::with_port("fn frame(frame) {}"), Card::new("fn poll() {}"));
    let none = refused(&without, "can", "open");
    assert!(
        none.contains("'one' has no port at can: its ") && none.contains("declares no such [[port]]"),
        "{none}"
    );
    let unknown = refused(&with, "can", "others");
    assert!(unknown.contains("others") && unknown.contains("open"), "{unknown}");
    let other = refused(&with, "profibus", "open");
    assert!(other.contains("profibus") && other.contains("can"), "{other}");
    // An invalid frame stops the script, like every other error of a running script.
    let card = Card::with_port("fn written(register, old, value) { send(0x800, []); }");
    let mut bench = plant(&[("one", &card)]);
    bench.poke("card.w_DATA", 1).unwrap();
    bench.step("1ms").unwrap();
    let lines = journal(&mut bench);
    assert!(
        lines.iter().any(|line| line.contains("script stopped: firmware.rhai:1: 16#800 is no identifier")),
        "{lines:#?}"
    );
}

/// The dual-port memory as a master with these keys, and without the bus.
fn master(keys: &str) -> String {
    let kind = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/netx-dpm");
    format!("[[bus]]\nname = 'dp'\nkind = 'profibus'\n[[device]]\nkind = '{kind}'\nname = 'card'\n{keys}\n")
}

/// A slave with its address, and parameters of this length.
fn slave(address: u8, parameters: usize, outputs: u8) -> String {
    let parameters = vec![0; parameters];
    format!(
        "[[device.slave]]\naddress = {address}\nparameters = {parameters:?}\nconfiguration = [0x20]\noutputs = {outputs}\n"
    )
}

#[test]
fn mistakes_about_a_profibus_master_are_refused() {
    let refused = |keys: &str| PlantConfig::parse("plant", &master(keys)).unwrap_err().to_string();
    let bus = "profibus = 'dp'\n";
    for (keys, what) in [
        (slave(5, 7, 0), "'card': slaves need the key profibus"),
        (bus.to_owned() + &slave(1, 7, 0), "'card': slave 1: an address is 0 to 125; the master has 1"),
        (bus.to_owned() + &slave(126, 7, 0), "'card': slave 126: an address is 0 to 125; the master has 1"),
        (bus.to_owned() + &slave(5, 7, 0) + &slave(5, 7, 0), "'card': two slaves have the address 5"),
        (bus.to_owned() + &slave(5, 6, 0), "'card': slave 5: parameters has 7 to 244 bytes"),
        (bus.to_owned() + &slave(5, 7, 245), "'card': slave 5: outputs and inputs are at most 244 bytes"),
        (
            (5..30).fold(bus.to_owned(), |all, address| all + &slave(address, 7, 244)),
            "'card': its slaves have 6100 bytes of outputs and 0 of inputs; the process image has 5760 and 5760",
        ),
    ] {
        let line = if keys.starts_with("profibus") { 8 } else { 7 };
        let found = refused(&keys);
        assert!(found.starts_with(&format!("plant: line {line}: {what}")), "{found}");
    }
    assert!(
        refused("profibus = 'none'").contains("line 7: dp of PLC 'card' is on bus 'none'"),
        "{}",
        refused("profibus = 'none'")
    );
    assert!(refused("bus = 'dp'").contains("it needs one of kind 'can'"), "{}", refused("bus = 'dp'"));
    let key = refused("profibus = 'dp'\n[[device.slave]]\nnumber = 5");
    assert!(key.contains("unknown field `number`; the keys here are: address, parameters"), "{key}");
    let with_port = |port: &str| {
        let card = Card::new("fn poll() {}");
        let device = std::fs::read_to_string(card.dir().join("device.toml")).unwrap();
        std::fs::write(
            card.dir().join("device.toml"),
            format!("{device}port = [{{ name = 'dp', {port} }}]\n"),
        )
        .unwrap();
        card.refused()
    };
    for (port, what) in [
        (
            "number = 2, medium = 'profibus', roles = ['master']",
            "the port `dp` needs a table [process_image]",
        ),
        ("number = 1, medium = 'profibus', roles = ['master']", "its number at \"profibus\" is 2"),
        ("number = 2, medium = 'profibus', roles = ['slave']", "its roles at \"profibus\" are [\"master\"]"),
        ("number = 2, medium = 'can', roles = ['peer']", "its number at \"can\" is 1"),
        ("number = 1, medium = 'cansync', roles = ['master']", "its medium is \"can\" or \"profibus\""),
    ] {
        assert!(with_port(port).contains(what), "{port}: {}", with_port(port));
    }
}

/// The section of a card has no key for a PROFIBUS bus, so the port could never be connected.
#[test]
fn an_option_card_has_only_a_can_port() {
    let parse = |kind: &str| {
        let plant =
            format!("[[plc]]\nname = 'line'\n[[plc.option]]\nname = 'card'\nslot = 1\ncard = '{kind}'\n");
        PlantConfig::parse("p.toml", &plant).map_err(|error| error.to_string())
    };
    let kind = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/netx-dpm");
    let right =
        "a card can only have a port at can; remove this [[port]], or describe the device in a [[device]]";
    assert_eq!(
        parse(kind).unwrap_err(),
        format!(
            "p.toml: line 6: 'card' is no option card: {kind} has the port `dp` at profibus, and {right}"
        )
    );
    let can = Card::with_port("fn trigger() { }");
    assert!(parse(&can.dir().display().to_string()).is_ok());
}

/// Slaves that do not answer delay nothing, and no number of them is active.
#[test]
fn a_master_without_slaves_on_the_bus_continues() {
    let slaves = slave(5, 7, 2) + &slave(6, 7, 2);
    let mut bench = Bench::plant(&master(&format!("profibus = 'dp'\n{slaves}"))).unwrap();
    bench.step("40ms").unwrap();
    assert_eq!(bench.peek("com0.tCommonStatus.ulNumOfConfigSlaves").unwrap(), 2);
    bench.poke("com0.tControl.ulApplicationCOS", 0x7).unwrap();
    bench.poke("hsk.tCommFlags0.usHostFlags", 0x4).unwrap();
    bench.step("100ms").unwrap();
    assert_eq!(bench.peek("bus.bRun").unwrap(), 1);
    assert_eq!(bench.peek("com0.tCommonStatus.ulNumOfActiveSlaves").unwrap(), 0);
    let telegrams = journal(&mut bench).iter().filter(|line| line.contains("Slave_Diag")).count();
    assert!(telegrams > 20, "{telegrams}");
}

/// A fault of the bus at any moment of the start delays the exchange, but never prevents it.
#[test]
fn a_master_exchanges_data_after_every_transient_fault() {
    const FAULTS: [&str; 10] = [
        "lose_telegram",
        "lose_telegram what=request",
        "lose_telegram what=answer",
        "delay_telegram delay=20ms",
        "repeat_telegram delay=700us",
        "garble_telegram",
        "wrong_frame_count",
        "silent_station station=1",
        "silent_station station=5",
        "noise octets=20",
    ];
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/netx-dpm/tests/profibus.toml");
    let kind = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/netx-dpm");
    let text = std::fs::read_to_string(file).unwrap().replace("\"../../netx-dpm\"", &format!("\"{kind}\""));
    let mut bench = Bench::plant(&text).unwrap();
    let active = |bench: &mut Bench| bench.peek("card:com0.tCommonStatus.ulNumOfActiveSlaves").unwrap();
    bench.step("400ms").unwrap();
    bench.poke("card:com0.tControl.ulApplicationCOS", 7).unwrap();
    bench.poke("card:hsk.tCommFlags0.usHostFlags", 4).unwrap();
    let mut moments = Vec::new();
    while active(&mut bench) == 0 {
        moments.push(bench.save().unwrap());
        bench.step("500us").unwrap();
    }
    moments.push(bench.save().unwrap());
    assert!(moments.len() > 8, "{}", moments.len());
    for fault in FAULTS {
        for (place, moment) in moments.iter().enumerate() {
            for count in 1..=8 {
                bench.back_to(*moment).unwrap();
                let number = bench.fault(&format!("{fault} bus=dp count={count}")).unwrap();
                let mut left = 80;
                while bench.faults().unwrap().iter().any(|it| it.id == number) || active(&mut bench) == 0 {
                    assert!(left > 0, "no exchange after {fault} count={count} at moment {place}");
                    left -= 1;
                    bench.step("50ms").unwrap();
                }
                bench.step("20ms").unwrap();
                assert_eq!(active(&mut bench), 1, "{fault} count={count} at moment {place}");
            }
        }
    }
}
