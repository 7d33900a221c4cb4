//! Errors that the DP master of a CAN-DP/2 can make (D-481).

use crate::rules;

rules! {
    REQUEST: 80, "dp-request", Error, "D-369, D-481",
        "16#05 was written to mst_control with an invalid request, and nothing was sent. Choose an address from 0 to 126, at most \
         244 octets, and a service that mst_dsap knows.";
    REQUEST_CHANGED: 81, "dp-request-changed", Error, "D-369, D-481",
        "The request was changed before it had an answer; the original request was sent. Wait until mst_control is 16#04 before \
         the next one.";
    CONTROL_TAKEN: 82, "dp-control", Error, "D-369, D-481",
        "Another value was written to mst_control while a request was in progress, so its end is not reported. Write only 16#05, \
         and wait for 16#04.";
    OUTPUT_LENGTH: 83, "dp-output-length", Error, "D-387, D-481",
        "A data exchange had another number of octets (the value) than the configuration has outputs, which ends it. Send cfg.output_len \
         octets.";
    SWITCHES: 84, "dp-switches", Warning, "CAN-DP/2 rev. 1.1 p. 9",
        "The switches were below 3 or above 124 at power-on, so the gateway uses another address. Set them to 16#03 to 16#7C.";
    NO_OUTPUT: 85, "dp-no-output", Warning, "CAN-DP/2 rev. 1.1 p. 32",
        "A configuration has no output, so the gateway does nothing on CAN. Add an output, if necessary one without CAN \
         (16#07F8).";
    RX_TWICE: 86, "dp-rx-twice", Warning, "CAN-DP/2 rev. 1.1 p. 35",
        "Two inputs of a configuration have the same identifier, so the earlier one never changes. Give each identifier one input.";
    WINDOW: 109, "dp-window", Error, "CAN-DP/2 rev. 1.1 p. 38-39; D-680",
        "A module of the Communication Window (the value is its number) violates the manual. Give the window one module in each \
         direction, 16 bytes long, consistent over the whole length, with the identifier FF EF and the format byte 00.";
    ADDRESS: 110, "dp-address", Error, "CAN-DP/2 rev. 1.1 p. 9, 26",
        "Another station of the segment answers at the same address (the value), so both answer at the same time, and no master can read \
         either answer. Set the switches of each gateway to a different address; the gateway reads them at power-on.";
    MASTER_ADDRESS: 111, "dp-master-address", Warning, "D-481, D-721",
        "Another master of the segment uses the same address (the value), so no slave can distinguish the two, and a slave locked by \
         one of them accepts both. Write a different mst_address for each master.";
}
