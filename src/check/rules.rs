//! Rules that hold for every device.

use crate::rules;

rules! {
    OWNER: 0, "owner", Error, "the register's page; D-17",
        "A register that only the firmware writes was written; the value stays there until the firmware writes the register the next time, which may be never, and the firmware does not read it. Only read such a register; a copy of a whole structure (VAR_IN_OUT of IEC programs, memcpy) writes it back.";
    RESERVED_REGISTER: 1, "reserved-register", Error, "the register's page; D-91",
        "A reserved register was written. Leave it at 0.";
    RESERVED_BIT: 2, "reserved-bit", Error, "the register's page",
        "A reserved bit was set. Leave it at 0.";
    RESERVED_VALUE: 3, "reserved-value", Warning, "the register's page",
        "A register was given a value that is reserved. Use one of the values that the manual gives a meaning.";
    HEADER: 30, "header", Error, "docs/reference/attach.md",
        "A field of the header page that belongs to the emulator was written. Only read it.";
    GUEST_BIT_RATE: 60, "guest-bit-rate", Error, "D-316",
        "A program at a door has named another bit rate than its bus has (the value is the number after S), so it hears \
         nothing and is not heard. Name the rate of the bus.";
    GUEST_TELEGRAM: 62, "guest-telegram", Error, "D-357",
        "A program at a PROFIBUS door has announced a telegram of an impossible length (the value), so nothing after it can be \
         understood and it was sent away. Send 255 octets at most after their number and the bit time.";
    GUEST_TIME: 107, "guest-time", Error, "D-677",
        "A program at a PROFIBUS door gave a telegram a bit time that lies too far ahead (the value: in seconds), so the telegram was \
         refused. Give a bit time of the next 60 s, or 0 for as soon as the line is free.";
    GUEST_EARLY: 108, "guest-early", Error, "D-678",
        "A program at a PROFIBUS door began a telegram too soon after the previous one (the value: after this number of bits). Begin a \
         request or a token 33 bits (T_SYN) after the end of the last telegram, an answer 11 bits after its request, or give the bit \
         time 0.";
}
