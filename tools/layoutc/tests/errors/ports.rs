//! Errors in ports and in the times of a baud rate.

use super::check;

#[test]
fn numbers_of_ports() {
    check(
        "device.toml",
        "number = 1\n",
        "number = 0\n",
        "device.toml:33:10: port number 0 is the device itself; ports are 1 to 255",
    );
    let second =
        "[[port]]\nname = \"second\"\nnumber = 1\nmedium = \"cansync\"\nroles = [\"peer\"]\narea = \"ram\"\n";
    let twice = format!("{second}\n[[baud_rate]]");
    check("device.toml", "[[baud_rate]]", &twice, "device.toml:40:10: port number 1 is already in use");
}

#[test]
fn names_roles_and_areas_of_ports() {
    let again = "[[port]]\nname = \"first\"\nnumber = 2\nmedium = \"cansync\"\nroles = [\"peer\"]\narea = \"ram\"\n\n[[baud_rate]]";
    check(
        "device.toml",
        "[[baud_rate]]",
        again,
        "device.toml:39:8: `first` is already in use here; names must be unique",
    );
    for roles in ["[]", "[\"slave\", \"slave\"]"] {
        check(
            "device.toml",
            "[\"slave\", \"master\"]",
            roles,
            "device.toml:35:9: `roles` lists the roles of a port at its medium, each once: \"master\", \"slave\", \"peer\"",
        );
    }
    check(
        "device.toml",
        "area = \"node\"",
        "area = \"nodes\"",
        "device.toml:36:8: unknown area `nodes`; areas are defined under [[area]] of device.toml",
    );
    check(
        "device.toml",
        "parts = [",
        "own = \"nodes\"\nparts = [",
        "device.toml:6:7: unknown area `nodes`; areas are defined under [[area]] of device.toml",
    );
}

#[test]
fn a_port_of_a_device_in_a_crate_has_an_area() {
    check(
        "device.toml",
        "roles = [\"slave\", \"master\"]\narea = \"node\"",
        "roles = [\"slave\", \"master\"]",
        "device.toml:32:8: port `first` names no `area` of its registers",
    );
}

#[test]
fn a_deadline_is_one_time_or_two_in_order() {
    for wrong in ["from = 1000, to = 800", "from = 800", "at = 800, to = 1000"] {
        check(
            "device.toml",
            "from = 800, to = 1000",
            wrong,
            "device.toml:53:17: a deadline needs either `at`, or `from` and `to` in ascending order",
        );
    }
}
