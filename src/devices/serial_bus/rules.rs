//! Rules for programs that use a serial port.

use crate::rules;

rules! {
    SERIAL_SETTINGS: 34, "serial-settings", Error, "5.00005.03a p. 10; D-855",
        "The serial port was switched on with settings that it does not have, and stays off. Set u_BAUD_RATE to 300, 600, \
         1200, 2400, 4800, 9600, 19200 or 38400, us_DATA_BITS to 7 or 8, b_PARITY to 0, 1 or 2, us_STOP_BITS to 1 or 2 and \
         us_WIRES to 2 or 4, then set bit 0 of w_CONTROL again.";
    SERIAL_FORMAT: 35, "serial-format", Error, "5.00005.03a p. 24; D-856",
        "The serial port sends in another format than the other participants of the line expect, so they receive errors. \
         Set u_BAUD_RATE, us_DATA_BITS, b_PARITY and us_STOP_BITS to the settings of the line in the plant file.";
    SERIAL_WIRES: 36, "serial-wires", Error, "5.00005.03a p. 26; D-856",
        "The serial port is set to another number of wires than the line has. On two wires the transmitter of such a port \
         destroys the characters of all other participants. Set us_WIRES to the number of wires of the line.";
    SERIAL_TERMINATION: 37, "serial-termination", Warning, "5.00005.03a p. 25; D-857",
        "The serial line has more or fewer than two terminating resistors, so its ends reflect the signals. Set bit 1 of \
         b_RESISTORS at the ports at the ends of the line only, and declare the other resistors in the plant file.";
    SERIAL_PULL: 38, "serial-pull", Warning, "5.00005.03a p. 25-26; D-857",
        "The potential of the serial line is undefined while no participant sends, or too many resistors load the line. \
         Set bit 0 of b_RESISTORS at one or two participants.";
    SERIAL_COLLISION: 39, "serial-collision", Error, "5.00005.03a p. 26",
        "The program sent a character while another participant was sending on the same pair of wires. On two wires, send \
         only when the protocol gives the program the turn.";
    SERIAL_RING: 40, "serial-ring", Error, "D-855",
        "u_TX_HEAD is more than 256 characters ahead of u_TX_TAIL, so characters were overwritten before they were sent, \
         and the port has discarded all of them: wait until a_TX has room before storing more characters. Or u_RX_TAIL is \
         ahead of u_RX_HEAD, so the port regards a_RX as full and loses what it receives: store only counts of characters \
         that the port has received.";
}
