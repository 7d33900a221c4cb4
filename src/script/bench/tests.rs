use super::*;
use crate::devices::samples::tables::NODES;
use crate::fault::{FaultNews, News};
use crate::journal::{Journal, Record};
use crate::memory::Cell16;
use crate::request::Op;
use crate::script::{Numbers, ScenarioError};
use core::num::NonZeroU16;

fn message<T>(outcome: Result<T, ScenarioError>) -> String {
    outcome.err().map(|error| error.to_string()).unwrap_or_default()
}

fn failure<T>(outcome: Result<T, ScenarioError>) -> Failure {
    match outcome {
        Err(ScenarioError::Failed(failure)) => *failure,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("the expectation is met"),
    }
}

/// Returns a bench with a master in set-up mode.
fn set_up() -> Result<Bench, ScenarioError> {
    let mut bench = Bench::built_in()?;
    for (command, status) in [(1, 2), (2, 3), (0x20, 0x43)] {
        if command == 2 {
            bench.poke("node2.b_BT_1", 0x1C)?;
            bench.poke("node2.b_TIME_PATTERN", 2)?;
            bench.poke("node2.b_AC", 0xFF)?;
            bench.poke("node2.b_AM", 0xFF)?;
            bench.poke("node2.a_SL_TYP[1]", 1)?;
        }
        bench.poke("node2.w_CPU_CONTROL", command)?;
        bench.wait("node2.w_OPTION_STATUS", status, "1ms")?;
    }
    Ok(bench)
}

#[test]
fn a_failure_knows_register_values_time_section_and_the_line_of_the_test() -> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    bench.section("start");
    bench.step("1ms")?;
    let line = line!() + 1;
    let failure = failure(bench.expect("%MW3.200002", "16#0002"));
    assert_eq!(failure.register.as_deref(), Some("node2.w_OPTION_STATUS"));
    assert_eq!(failure.address.as_deref(), Some("%MW3.200002"));
    assert_eq!(failure.actual.as_deref(), Some("16#0001  start-up"));
    let numbers = Numbers { expected: 2, actual: 1, mask: None, tolerance: None };
    assert_eq!(failure.numbers, Some(numbers));
    assert_eq!((failure.time_us, failure.section.as_deref()), (1000, Some("start")));
    let location = failure.location.unwrap().to_string();
    assert!(location.starts_with(&format!("{}:{line}:", file!())), "{location}");
    Ok(())
}

#[test]
fn waits_end_at_the_moment_of_the_match() -> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    bench.poke("node2.w_CPU_CONTROL", 1)?;
    assert_eq!(bench.wait("node2.w_OPTION_STATUS", 2, "10ms")?, 500);
    assert_eq!(bench.wait("node2.w_OPTION_STATUS", 2, "10ms")?, 0);
    assert_eq!(bench.now()?, 500);
    let failure = failure(bench.wait("node2.w_OPTION_STATUS", 3, 1234));
    assert_eq!((failure.time_us, failure.within_us), (1734, Some(1234)));
    Ok(())
}

#[test]
fn compare_exchange_writes_only_over_the_expected_value() -> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    assert!(!bench.compare_exchange("node2.b_BT_1", 5, 6)?);
    assert!(bench.compare_exchange("node2.b_BT_1", 0, 6)?);
    assert_eq!(bench.peek("node2.b_BT_1")?, 6);
    Ok(())
}

#[test]
fn frames_are_found_once_and_in_their_order() -> Result<(), ScenarioError> {
    let mut bench = set_up()?;
    let sync_mode = bench.expect_frame("drives", 0x010, "FF FF FF FF ..  .. .. ..", "4ms")?;
    let job = bench.expect_masked_frame("drives", 0x500, 0x780, "*", "4ms")?;
    assert_eq!(job.frame.arbitration().number(), 0x501);
    assert!(job.time_us > sync_mode.time_us);
    assert_eq!(bench.now()?, job.time_us, "the wait ends with the frame");
    bench.expect_no_frame("drives", 0x100, 0x780, "10ms")?;
    let failure = failure(bench.expect_no_frame("drives", 0x501, 0x7FF, "10ms"));
    assert!(failure.what.starts_with("there is a frame 16#501"), "{failure}");
    assert_eq!(bench.frames("drives", job.time_us)?.first(), Some(&job));
    Ok(())
}

#[test]
fn changes_since_a_snapshot_are_those_of_the_live_structure() -> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    let before = bench.snapshot("node2")?;
    assert_eq!(bench.changes(&before)?, []);
    bench.poke("node2.w_CPU_CONTROL", 1)?;
    bench.wait("node2.w_OPTION_STATUS", 2, "1ms")?;
    bench.poke("node2.b_MA_SL_MODE", 1)?;
    bench.expect_changes(&before, &["node2.b_MA_SL_MODE", "%MW3.200002", "node2.w_CPU_CONTROL"])?;
    let changes = bench.changes(&before)?;
    assert_eq!(changes.len(), 3, "{changes:?}");
    assert_eq!((changes[1].before, changes[1].after), (1, 2));
    Ok(())
}

#[test]
fn time_has_a_limit() -> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    bench.set_limit(5_000);
    bench.step("5ms")?;
    assert!(message(bench.step(1)).contains("would go beyond the 5 ms"));
    assert!(message(bench.wait("node2.w_OPTION_STATUS", 2, "1h")).contains("would go beyond"));
    Ok(())
}

#[test]
fn a_forced_register_keeps_its_value_until_it_is_unforced() -> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    bench.force("node2.w_CPU_CONTROL", 0)?;
    bench.poke("node2.w_CPU_CONTROL", 1)?;
    bench.step("2ms")?;
    bench.expect("node2.w_OPTION_STATUS", 1)?;
    assert!(!bench.compare_exchange("node2.w_CPU_CONTROL", 0, 1)?);
    bench.poke("%MX3.200000.1", true)?;
    bench.expect("node2.w_CPU_CONTROL", 0)?;
    bench.unforce("node2.w_CPU_CONTROL")?;
    bench.poke("node2.w_CPU_CONTROL", 1)?;
    bench.wait("node2.w_OPTION_STATUS", 2, "1ms")?;
    assert!(message(bench.unforce("node2.w_CPU_CONTROL")).contains("is not forced"));
    Ok(())
}

#[test]
fn programs_work_on_the_ram_of_a_bench() -> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    let [control, status] =
        ["node2.w_CPU_CONTROL", "node2.w_OPTION_STATUS"].map(|name| NODES.register(name).unwrap().offset());
    let ram = bench.ram("line")?;
    let (control, status) = (ram.at::<Cell16>(control)?, ram.at::<Cell16>(status)?);
    bench.wait_until("1s", |_| {
        control.store(1);
        Ok(status.load() == 2)
    })?;
    bench.expect("node2.w_OPTION_STATUS", 2)?;
    assert!(message(bench.ram("other")).contains("there is no PLC 'other'"));
    Ok(())
}

#[test]
fn a_required_fault_must_strike() -> Result<(), ScenarioError> {
    let mut bench = set_up()?;
    bench.fault("lose_sync count=1 required")?;
    let missed = failure(bench.expect_required_faults());
    assert_eq!(missed.what, "fault 1 has not taken effect: lose_sync count=1 required");
    bench.step("4ms")?;
    bench.expect_required_faults()?;
    // A fault without hits has taken effect once it has begun, even if it has ended since.
    bench.fault("slave_off slave=1 at=1s duration=1ms required")?;
    assert!(failure(bench.expect_required_faults()).what.starts_with("fault 2 has not taken effect"));
    bench.step("2s")?;
    bench.expect_required_faults()?;
    // No request contains the other identifiers.
    bench.fault("lose_frame id=16#7FF")?;
    bench.expect_required_faults()
}

/// The journal keeps 65,536 rare records. Those of other faults push the record of the hit out.
#[test]
fn a_required_fault_counts_after_its_record_is_lost() -> Result<(), ScenarioError> {
    let mut bench = set_up()?;
    bench.fault("lose_sync count=1 required")?;
    bench.step("20ms")?;
    for _ in 0..33_000 {
        let second = bench.fault("lose_frame id=16#7FF at=1000s")?;
        bench.ask(Op::FaultClear { id: NonZeroU16::new(second) })?;
    }
    assert!(bench.journal(0)?.iter().all(|record| !is_hit(record)), "the hit is still in the journal");
    bench.expect_required_faults()
}

fn is_hit(record: &Record) -> bool {
    record.event.get::<FaultNews>().is_some_and(|it| matches!(it.news, News::Hit(_)))
}

/// The end of a scenario knows the effect of a fault without hits that was cleared before.
#[test]
fn a_required_fault_that_was_cleared_has_taken_effect_if_it_had_begun() -> Result<(), ScenarioError> {
    let mut bench = set_up()?;
    let first = bench.fault("slave_off slave=1 required")?;
    bench.step("4ms")?;
    bench.clear_fault(first)?;
    bench.expect_required_faults()?;
    bench.fault("slave_off slave=2 required")?;
    bench.step("4ms")?;
    bench.clear_faults()?;
    bench.expect_required_faults()?;
    bench.fault("slave_off slave=3 at=1000s required")?;
    bench.step("4ms")?;
    bench.clear_faults()?;
    assert!(failure(bench.expect_required_faults()).what.starts_with("fault 3 has not taken effect"));
    Ok(())
}

/// A return to an earlier moment does not undo that a fault has taken effect, and gives the number to another fault.
#[test]
fn a_required_fault_has_taken_effect_also_after_a_return() -> Result<(), ScenarioError> {
    let mut bench = set_up()?;
    let saved = bench.save()?;
    bench.fault("lose_sync count=1 required")?;
    bench.step("4ms")?;
    bench.back_to(saved)?;
    bench.expect_required_faults()?;
    bench.fault("lose_frame id=16#7FF required")?;
    bench.step("4ms")?;
    bench.back_to(saved)?;
    assert_eq!(bench.fault("lose_sync count=1 required")?, 1);
    bench.step("4ms")?;
    let missed = failure(bench.expect_required_faults());
    assert_eq!(missed.what, "fault 1 has not taken effect: lose_frame id=16#7FF required");
    Ok(())
}

#[test]
fn a_fault_of_the_plant_file_can_be_required() -> Result<(), ScenarioError> {
    let plant = |required| {
        let fault = "[[fault]]\nkind = 'lose_sync'\n";
        Bench::plant(&format!(
            "[[plc]]\nname = 'p'\n[[bus]]\nname = 'b'\n{fault}{fault}required = {required}\n"
        ))
    };
    assert_eq!(
        failure(plant(true)?.expect_required_faults()).what,
        "fault 2 has not taken effect: lose_sync"
    );
    plant(false)?.expect_required_faults()
}

#[test]
fn intermediate_values_of_a_recorded_register_are_known() -> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    let start = bench.save()?;
    let unrecorded = |bench: &mut Bench| {
        let errors = [
            bench.history("node2.w_CPU_CONTROL").unwrap_err(),
            bench.expect_history("node2.w_CPU_CONTROL", [0; 0]).unwrap_err(),
        ];
        for error in errors.map(|error| error.to_string()) {
            assert!(error.starts_with("`node2.w_CPU_CONTROL`: this register is not recorded"), "{error}");
        }
    };
    unrecorded(&mut bench);
    bench.record("node2")?;
    bench.back_to(start)?;
    unrecorded(&mut bench);
    bench.record("node2")?;
    bench.record("node2.w_OPTION_STATUS")?;
    assert!(bench.history("node2.w_CPU_CONTROL")?.is_empty());
    bench.poke("node2.w_CPU_CONTROL", 1)?;
    bench.step("1ms")?;
    bench.poke("node2.w_CPU_CONTROL", 7)?;
    bench.poke("node2.w_CPU_CONTROL", 1)?;
    bench.expect_history("node2.w_CPU_CONTROL", [1, 7, 1])?;
    bench.expect_history("node2.w_OPTION_STATUS", ["16#0002"])?;
    let [change] = bench.history("node2.w_OPTION_STATUS")?[..] else { panic!("one change") };
    assert_eq!((change.from, change.to, change.by.name()), (1, 2, "firmware"));
    let failure = bench.expect_history("node2.w_OPTION_STATUS", [2, 3]).unwrap_err().to_string();
    assert!(failure.contains("16#0002, 16#0003"), "{failure}");
    let unknown = bench.record("node2.w_OPTION_STATE").unwrap_err().to_string();
    assert!(unknown.contains("w_OPTION_STATE"), "{unknown}");
    Ok(())
}

#[test]
fn a_history_without_its_first_changes_is_an_error() -> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    bench.record("node2")?;
    bench.poke("node2.b_AC", 7)?;
    // These and the first change are as many as the journal keeps.
    for value in 1..Journal::MOST_CHANGES as i64 {
        bench.poke("node2.a_WR_VALUE[0]", value)?;
    }
    bench.expect_history("node2.b_AC", [7])?;
    bench.poke("node2.a_WR_VALUE[0]", 0)?;
    for error in
        [bench.history("node2.b_AC").unwrap_err(), bench.expect_history("node2.b_AC", [0; 0]).unwrap_err()]
    {
        let lost = "`node2.b_AC`: the journal no longer has all changes since `record`";
        assert!(error.to_string().starts_with(lost), "{error}");
    }
    Ok(())
}

/// A ring of the journal has room for the frames of a few minutes.
#[test]
fn frames_since_a_time_that_the_journal_no_longer_has_are_an_error() -> Result<(), ScenarioError> {
    let mut bench = set_up()?;
    let start = bench.now()?;
    bench.step("1s")?;
    let saved = bench.save()?;
    let first = bench.frames("drives", start)?.first().cloned();
    assert!(first.is_some());
    let mut bound = 0..20;
    while bound.next().is_some() && bench.frames("drives", 0)?.iter().any(|it| Some(it) == first.as_ref()) {
        bench.step("30s")?;
    }
    let refused = message(bench.frames("drives", start));
    assert!(refused.contains("the journal no longer has all frames since this time"), "{refused}");
    let kept = bench.frames("drives", 0)?;
    let late = kept[1].time_us;
    assert_eq!(bench.frames("drives", late)?.len(), kept.iter().filter(|it| it.time_us >= late).count());
    bench.back_to(saved)?;
    bench.forget(saved)?;
    // The journal does not keep these frames for a return.
    assert!(message(bench.frames("drives", start)).contains("no longer has all frames"));
    let returned = bench.now()?;
    bench.step("1s")?;
    assert!(bench.frames("drives", returned).is_ok_and(|frames| !frames.is_empty()));
    assert!(message(bench.back_to(saved)).contains("snapshot"));
    assert!(message(bench.forget(saved)).contains("snapshot"));
    Ok(())
}

/// A ring that was full before a return is not full after it.
#[test]
fn a_history_is_refused_if_the_plant_has_gone_back_over_more_changes_than_the_journal_keeps()
-> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    bench.record("node2")?;
    for value in 1..=3 {
        bench.poke("node2.b_AC", value)?;
    }
    let saved = bench.save()?;
    for value in 1..Journal::MOST_CHANGES as i64 - 3 {
        bench.poke("node2.a_WR_VALUE[0]", value)?;
    }
    bench.back_to(saved)?;
    bench.expect_history("node2.b_AC", [1, 2, 3])?;
    for value in 1..Journal::MOST_CHANGES as i64 - 1 {
        bench.poke("node2.a_WR_VALUE[0]", value)?;
    }
    bench.back_to(saved)?;
    assert!(bench.history("node2.b_AC").unwrap_err().to_string().contains("gone back over more records"));
    for value in 1..=Journal::MOST_CHANGES as i64 {
        bench.poke("node2.a_WR_VALUE[0]", value)?;
    }
    bench.back_to(saved)?;
    assert!(
        bench
            .expect_history("node2.b_AC", [0; 0])
            .unwrap_err()
            .to_string()
            .contains("gone back over more records")
    );
    Ok(())
}

/// A return to an earlier snapshot removes the records up to a later one.
#[test]
fn histories_and_frames_before_a_later_snapshot_are_refused_after_a_return_to_it() -> Result<(), ScenarioError>
{
    let mut bench = set_up()?;
    let start = bench.now()?;
    bench.record("node2.b_AC")?;
    bench.poke("node2.b_AC", 1)?;
    bench.step("5ms")?;
    let earlier = bench.save()?;
    bench.poke("node2.b_AC", 2)?;
    bench.step("5ms")?;
    let later = bench.save()?;
    bench.back_to(later)?;
    assert_eq!(bench.history("node2.b_AC")?.len(), 2);
    assert!(!bench.frames("drives", start)?.is_empty());
    bench.back_to(earlier)?;
    assert_eq!(bench.history("node2.b_AC")?.len(), 1);
    bench.back_to(later)?;
    for error in
        [bench.history("node2.b_AC").unwrap_err(), bench.expect_history("node2.b_AC", [0; 0]).unwrap_err()]
    {
        assert!(error.to_string().contains("begins with a later snapshot"), "{error}");
    }
    assert!(message(bench.frames("drives", start)).contains("no longer has all frames"));
    let returned = bench.now()?;
    bench.record("node2.b_AC")?;
    bench.poke("node2.b_AC", 3)?;
    bench.step("5ms")?;
    assert!(!bench.frames("drives", returned)?.is_empty());
    Ok(())
}

#[test]
fn a_snapshot_can_be_restored_repeatedly() {
    let mut bench = Bench::built_in().unwrap();
    bench.poke("node2.w_CPU_CONTROL", 0x0001).unwrap();
    bench.wait("node2.w_OPTION_STATUS", 0x0002, "1ms").unwrap();
    let (saved, at) = (bench.save().unwrap(), bench.now().unwrap());
    for value in [0x0000, 0x0080] {
        bench.poke("node2.w_CPU_CONTROL", value).unwrap();
        bench.step("2ms").unwrap();
        bench.back_to(saved).unwrap();
        bench.expect("node2.w_OPTION_STATUS", 0x0002).unwrap();
        assert_eq!(bench.now().unwrap(), at);
    }
    let wrong = bench.back_to(saved + 1).unwrap_err().to_string();
    assert!(wrong.contains("no snapshot 2 is kept"), "{wrong}");
}
