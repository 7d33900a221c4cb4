//! Tests the range of each time in a plant file.

use crate::plant::PlantConfig;

#[test]
fn each_time_has_its_range() {
    let (none, long) = ("1 to 3600000000", "at most one hour");
    let drive = "[[plc]]\nname = 'p'\n[[bus]]\nname = 'b'\n[[bus.drive]]\nname = 'd'\nslave_number = 4\n";
    for (before, key, value, whose, right) in [
        ("", "lock_time_us", 3_600_000_001, "lock_time_us of 'p'", long),
        ("", "sync_loss_us", 0, "sync_loss_us of 'p'", none),
        ("[plc.drive]", "lock_time_us", 3_600_000_001, "drive.lock_time_us of 'p'", long),
        ("[plc.drive]", "service_time_us", 3_600_000_001, "drive.service_time_us of 'p'", long),
        ("[plc.drive]", "sync_loss_us", 0, "drive.sync_loss_us of 'p'", none),
        (
            "[plc.drive.monitoring.sync]",
            "time_us",
            3_600_000_001,
            "drive.monitoring.sync.time_us of 'p'",
            long,
        ),
        (
            "[plc.drive.monitoring.cyclic_data]",
            "time_us",
            0,
            "drive.monitoring.cyclic_data.time_us of 'p'",
            none,
        ),
        (drive, "lock_time_us", 3_600_000_001, "lock_time_us of 'd'", long),
        (drive, "sync_loss_us", 3_600_000_001, "sync_loss_us of 'd'", none),
        (drive, "monitoring.sync.time_us", 3_600_000_001, "monitoring.sync.time_us of 'd'", long),
        (
            drive,
            "monitoring.reference_values.time_us",
            3_600_000_001,
            "monitoring.reference_values.time_us of 'd'",
            long,
        ),
    ] {
        let plc = if before.starts_with("[[plc]]") { "" } else { "[[plc]]\nname = 'p'\n" };
        let parse = |value: u64| {
            PlantConfig::parse("test.toml", &format!("{plc}{before}\n{key} = {value}\n"))
                .map(|_| ())
                .map_err(|error| error.to_string())
        };
        assert_eq!(parse(3_600_000_000), Ok(()), "{whose}");
        let line = 1 + format!("{plc}{before}\n").matches('\n').count();
        let message = format!("test.toml: line {line}: {whose} is {value}; it must be {right}");
        assert_eq!(parse(value), Err(message));
    }
}

#[test]
fn cyclic_data_need_a_time_and_reactions_are_known() {
    let error = |text: &str| {
        let text = format!("[[plc]]\nname = 'p'\n[plc.drive.monitoring.{text}\n");
        PlantConfig::parse("test.toml", &text).unwrap_err().to_string()
    };
    assert!(
        error("cyclic_data]\nreaction = 'inhibit'")
            .contains("cyclic_data.time_us of 'p' is 0; it must be 1 to")
    );
    assert!(error("sync]\nreaction = 'explode'").contains("unknown variant `explode`"));
}
