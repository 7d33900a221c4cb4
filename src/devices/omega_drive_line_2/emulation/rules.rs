//! Rules for the access of PLC programs to the BAPS and to the IP address.

use crate::rules;

rules! {
    IP_ADDRESS: 25, "ip-address", Error, "5.00005.03a p. 79-80; D-190",
        "An IP address that ends in 0 or 255, by itself or with the DIP number added, was stored by writing d_IP_CONFIG; \
         the firmware put the old configuration back. Choose a last byte from 1 to 254, from which the DIP number stays \
         below 255.";
    BAPS_EARLY: 26, "baps-early", Error, "5.00005.03a p. 63; D-313",
        "The BAPS was configured in a start task or in one of the first five cycles of the PLC program. Enable BAPS_INIT \
         in the cyclic task, not before its sixth cycle.";
    BAPS_RUNNING: 27, "baps-running", Error, "5.00005.03a p. 90; D-312",
        "The BAPS was configured again while process data were being exchanged. Stop calling BAPS_PD_COMMxx and let one \
         communication pass without it first, or change the parameter numbers with us_MODE 2.";
    BAPS_CYCLE: 28, "baps-cycle", Warning, "5.00005.03a p. 88, 100; D-311",
        "w_COMMAND_REG of an exchange differs from that of the previous exchange, so method or cycle time change while process data \
         run. Connect the same value to BAPS_INIT and BAPS_PD_COMMxx.";
    BAPS_SYNC_SLOT: 29, "baps-sync-slot", Error, "5.00005.03a p. 89",
        "The SYNC slot of the drive (P167) is not the time between two communications, although the drive is triggered or \
         follows synchronous reference positions. Set P167 to t_cycK in microseconds.";
}
