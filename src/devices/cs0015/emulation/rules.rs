//! Errors that a program can make at a CS0015.

use crate::rules;

rules! {
    SYSTEM_AREA: 70, "system-area", Error, "CS0015 10/1999 p. 154",
        "An unnamed flag of the operating system's area, %MW3968 to %MW4095, was written. Keep variables elsewhere, for example \
         from %MW2064 on.";
    PWM_OUTPUT: 71, "pwm-output", Error, "CS0015 10/1999 p. 91",
        "A bit of %QW0 was changed although its output belongs to a group in PWM mode, so the change has no effect until the \
         supply is switched off and on. Switch such an output by PWM with 0 % and 100 %.";
    PWM_MIXED: 72, "pwm-mixed", Error, "CS0015 10/1999 p. 90-94",
        "PWM and PWM100 were both used on channels 4 to 7. Use one of them for all four.";
    PWM_FREQUENCY: 73, "pwm-frequency", Error, "CS0015 10/1999 p. 90-94",
        "Channels 4 to 7 were given different frequencies, and the last one applies to all. Give them the same RELOAD and DIV64, \
         or the same FREQUENCY.";
    PWM_TOO_FAST: 74, "pwm-too-fast", Warning, "CS0015 10/1999 p. 91",
        "A PWM frequency above 200 Hz, which the output transistors do not follow exactly. Choose 200 Hz at most.";
    SERIAL_MODE: 75, "serial-mode", Error, "CS0015 10/1999 p. 112-114",
        "SERIAL_TX or SERIAL_RX was called while RS 232 belongs to the programming system. Set SERIAL_MODE first.";
    PDO_AFTER_MASTER: 76, "pdo-after-master", Error, "CS0015 10/1999 p. 48, 50, 53",
        "PDO_TX_CONFIG or PDO_RX_CONFIG was called after NMM_SET_NMT_MASTER; it resets the communication, and the device is no \
         master any more. Configure all PDOs first, and begin the master's boot-up a cycle later.";
    PDO_LATE: 77, "pdo-late", Error, "CS0015 10/1999 p. 42, 47-50, 155",
        "PDO_TX_CONFIG or PDO_RX_CONFIG was called while the device is Operational; it resets the communication, and no PDO is \
         exchanged until the master starts the device again. Configure all PDOs once, in the first cycles of the program.";
}
