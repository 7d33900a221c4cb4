//! Rules for PLC programs at the registers of CANsync, and for the settings of drives on a CANsync bus.

use crate::rules;

rules! {
    VALUE_NUMBER: 4, "value-number", Error, "5.00005.03a p. 153, 158, 178, 181, 184; 5.02066.01a p. 54, 61, 83, 87, 89",
        "A word of a frame is assigned to a value number above 7. Only the values 0 to 7 exist.";
    WORD_UNASSIGNED: 5, "word-unassigned", Warning, "5.00005.03a p. 152, 157, 177, 180, 184; 5.02066.01a p. 52, 58, 81, 85, 89",
        "A word of a frame names a value, but its bit 0 (assigned) is not set. Set bit 0, or write 16#00 for a word \
         that is not used.";
    SPLIT_DOUBLEWORD: 6, "split-doubleword", Warning, "5.00005.03a p. 153, 158, 178, 181; 5.02066.01a p. 54, 61, 83, 87",
        "Low and high word of one value travel in different frames, so they may belong to different moments. Put \
         both into one frame.";
    SLAVE_NUMBER: 7, "slave-number", Error, "5.00005.03a p. 154, 160, 167; 5.02066.01a p. 55, 62, 68",
        "A slave number above 31. Use 0 to 31, or 16#80 (automatic) where that is possible.";
    NEVER_POLLED: 8, "never-polled", Error, "5.00005.03a p. 160; 5.02066.01a p. 62; D-08",
        "A job was entered for a slave above b_MAX_SL_NR while slaves are polled automatically, so it is never \
         sent. Raise b_MAX_SL_NR or name the slave in the polling register.";
    NOT_POLLED: 120, "not-polled", Warning, "5.00005.03a p. 160; 5.02066.01a p. 62; D-832",
        "A job was entered for a slave while the polling register names another one, or none, so the job waits. Name \
         the slave in the polling register, or write 16#80 there to poll all slaves up to b_MAX_SL_NR.";
    NOT_REQUESTED: 9, "not-requested", Warning, "5.00005.03a p. 154, 159; 5.02066.01a p. 55, 62",
        "Actual values are requested automatically, but a slave expected in a_SL_TYP lies above b_MAX_SL_NR and is \
         never asked. Set b_MAX_SL_NR to the highest slave number.";
    COMMAND: 10, "command", Error, "5.00005.03a p. 149-150, 174-175; 5.02066.01a p. 50, 79; D-05",
        "w_CPU_CONTROL was given a command that does not exist or is not possible in this state. Wait for the \
         value of w_OPTION_STATUS that must precede the command.";
    LEFT_BEHIND: 11, "left-behind", Warning, "5.00005.03a p. 149-150, 174-175; 5.02066.01a p. 50, 79; D-29",
        "Bit 7 was written to w_CPU_CONTROL with no other bit, and clearing it leaves 16#0000. The remaining \
         16#0000 is no restart. A restart that a program stores over it in the RAM cannot be detected. Write bit 7 \
         together with the bits already set in the register: 16#00C0 in active operation.";
    ORDER: 12, "order", Error, "5.00005.03a p. 165, 167, 189, 191; 5.02066.01a p. 67, 69, 94, 96",
        "The control register of a job was written before its status register. Write the status register first, \
         then the control register, both with the same value.";
    JOB_CHANGED: 13, "job-changed", Error, "5.00005.03a p. 165, 167; 5.02066.01a p. 67, 69; D-48",
        "A register of a job was changed while the job was under way. Wait until bit 0 (active) is clear, or end \
         the job first.";
    JOB_REPLACED: 14, "job-replaced", Warning, "5.00005.03a p. 165, 167; 5.02066.01a p. 67, 69; D-48",
        "A job was entered while the previous one was still under way. The previous job is lost. Wait until bit 0 \
         (active) is clear, or clear it and let the firmware see it.";
    REQUEST_DATA_CHANGED: 121, "request-data-changed", Warning, "5.00005.03a p. 162-163; 5.02066.01a p. 64-65; D-833",
        "The data of a broadcast or control word were changed while their control register was 16#05, so the frame has \
         the old or the new data. Write the data first, then 16#05, and wait for 16#04 before the next data.";
    LATE_REFERENCE: 15, "late-reference", Error, "5.00005.03a p. 153-154; 5.02066.01a p. 54; D-09, D-142, D-298",
        "Reference values were released with 16#05 after their deadline, so their frame was left out in this \
         interval. Release them earlier in the event task, or one interval ahead.";
    LATE_ACTUAL: 16, "late-actual", Error, "5.00005.03a p. 181-182; 5.02066.01a p. 86-87; D-26, D-142, D-298",
        "Own actual values were released with 16#05 after their deadline, so their frame was left out in this \
         interval. Release them earlier in the event task, or one interval ahead.";
    INIT_MODE: 17, "init-mode", Error, "5.00005.03a p. 149, 174; 5.02066.01a p. 49-51, 80; D-12",
        "b_MA_SL_MODE does not suit the role of the node. Write 16#00 (or 16#02 to pass SYNC on) at a master, 16#01 at a slave.";
    INIT_BAUD_RATE: 18, "init-baud-rate", Error, "5.00005.03a p. 125, 149; 5.02066.01a p. 51, 80, 126-127",
        "b_BT_0 and b_BT_1 give no baud rate of the device. On an Omega Drive-Line II write 16#00, 16#1C for 500 kbit/s, \
         16#01, 16#1C for 250 or 16#03, 16#1C for 125; on a BM4-O-CAN 16#40, 16#34 for 1000, 16#41, 16#34 for 500, \
         16#43, 16#34 for 250 or 16#47, 16#34 for 125.";
    INIT_INTERVAL: 19, "init-interval", Error, "5.00005.03a p. 125, 149; 5.02066.01a p. 51, 80, 126-127",
        "b_TIME_PATTERN does not belong to the baud rate. Write 1 ms at 1000 kbit/s, 2 at 500, 4 at \
         250, 8 at 125.";
    INIT_CONTROLLER: 20, "init-controller", Warning, "5.00005.03a p. 149, 174; 5.02066.01a p. 51, 80",
        "b_OUTPUT_CONTROL or b_CLOCK_DIVIDER is not what the controller needs. Write 16#FA and 16#07.";
    BUS_BAUD_RATE: 21, "bus-baud-rate", Error, "5.00005.03a p. 125; 5.02066.01a p. 16-18",
        "The node was started with another baud rate than its bus and receives nothing. Give all nodes of a bus the \
         same baud rate.";
    CLUSTER_BAUD_RATE: 22, "cluster-baud-rate", Error, "5.00005.03a p. 122-125; D-282",
        "A master passes on the SYNC signal of a bus at another baud rate, so none of its slaves ever synchronizes. \
         Give all buses of a cluster the same b_BT_0 and b_TIME_PATTERN.";
    BEFORE_INIT: 23, "before-init", Error, "5.00005.03a p. 145; 5.02066.01a p. 42, 71; D-03",
        "A register after the initialization structure was written before the initialization data were taken over, \
         which clears the register. Wait for w_OPTION_STATUS 16#0003 first.";
    AFTER_INIT: 24, "after-init", Error, "5.00005.03a p. 145; 5.02066.01a p. 42, 71; D-02, D-03",
        "A register of the initialization structure was written after the data had been taken over and before the \
         start: the write has no effect and hits a reserved register. Restart the node with 16#0000 to initialize it \
         again.";
    DRIVE_SYNC_SLOT: 31, "drive-sync-slot", Error, "5.01010.01 p. 13; D-291",
        "The SYNC slot (P167) of a drive does not belong to the baud rate of its bus, so the drive never locks. Set P167 to 1000 \
         at 1000 kbit/s, 2000 at 500, 4000 at 250, 8000 at 125.";
    DRIVE_PWM: 32, "drive-pwm", Warning, "5.00005.03a p. 74 (inferred); D-292",
        "The PWM frequency (P103) of a drive is not in the table of the masks over P258. Set P103 to 4 or 8 kHz.";
    DRIVE_BAUD_RATE: 33, "drive-baud-rate", Error, "5.01010.01 p. 10, 13; D-540",
        "A drive is set to another baud rate than its bus and receives nothing. The value is the drive's rate in \
         kbit/s. Set switches 1 and 2 of S20 on its card (kbit_s in the plant file) to the rate that the master is \
         initialized with, and set P167 to match.";
    DRIVE_SYNC_OFFSET: 91, "drive-sync-offset", Warning, "5.01010.01 p. 13",
        "The SYNC offset (P168) of a drive with CANsync card is not 0. Set P168 to 0 at every baud rate.";
    NO_SYNC_IN: 99, "no-sync-in", Error, "5.00005.03a p. 149; 5.02066.01a p. 50-51; D-12, D-646",
        "A master is to pass a SYNC signal on (b_MA_SL_MODE 16#02), but no other port can supply one, so the master \
         waits without end. Write 16#00, or connect the port that receives the signal: node1 of an Omega Drive-Line \
         II, sync_in_from of a module.";
    NUMBER_TAKEN: 100, "number-taken", Error, "5.00005.03a p. 22; 5.02066.01a p. 15, 26; D-184",
        "The slave number at the DIP switches of a node belongs to another station of its bus, so no master reaches the node. \
         Set a number that is free and switch the supply off and on.";
    NO_MASTER: 115, "no-master", Error, "5.00005.03a p. 122, 149, 174; 5.02066.01a p. 15-16, 50-51; D-743",
        "A slave was started at a port without a bus or on a bus without a master, so it never receives a SYNC signal. Connect \
         the port in the plant file to a bus that has a master.";
    FOREIGN_FRAME: 61, "foreign-frame", Warning, "D-315",
        "A program at a door sent a frame on a CANsync bus. Only the master and the slaves may send there, each in \
         its slot. Only receive on this bus.";
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::{bm4_o_can_06, omega_drive_line_2};

    /// The bit timings in the rule text are equal to those of the layouts.
    #[test]
    fn bit_timings_in_the_text_are_those_of_the_devices() {
        let rates =
            omega_drive_line_2::registers::BAUD_RATES.iter().chain(&bm4_o_can_06::registers::BAUD_RATES);
        let timings: Vec<_> = rates
            .map(|rate| format!("16#{:02X}, 16#{:02X} for {}", rate.b_BT_0, rate.b_BT_1, rate.kbit_per_s))
            .collect();
        let text = INIT_BAUD_RATE.text().replace(" or ", ", ").replace(" kbit/s", "");
        for timing in &timings {
            assert!(text.contains(timing.as_str()), "{timing}: {text}");
        }
        assert_eq!(text.matches(" for ").count(), timings.len(), "{text}");
    }
}
