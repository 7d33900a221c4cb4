//! `CANsync_COMM_CONTROL_MA`, `CANsync_BC_...`, `CANsync_CONTROLWORD_...`.

use super::bench::{Bench, Dead};
use super::device::*;
use crate::rig::{BOTH, Memory};

/// Manual p. 204-206: the block takes over only inputs that are enabled and legal.
#[test]
fn comm_control_applies_the_enabled_inputs() {
    let dead = Dead::new();
    let base = dead.master();
    let registers = || {
        [&base.b_SL_NR_CONTROLWORD, &base.b_SL_NR_PARAMETER, &base.b_SL_NR_UPDOWN, &base.b_MAX_SL_NR]
            .map(|cell| cell.load())
    };
    let mut block = CANsync_COMM_CONTROL_MA::default();
    block.call(&base);
    assert_eq!(registers(), [0, 0, 0, 0]);
    block.x_EN_CTRL = true;
    block.si_MAX_SL_NR = 31;
    block.call(&base);
    assert_eq!(registers(), [0x80, 0, 0, 31]);
    (block.x_EN_PAR, block.si_SL_NR_PAR, block.si_MAX_SL_NR) = (true, 7, -1);
    block.call(&base);
    assert_eq!(registers(), [0x80, 7, 0, 31]);
    (block.x_EN_UDL, block.si_SL_NR_UDL, block.si_SL_NR_PAR) = (true, 31, 32);
    block.call(&base);
    assert_eq!(registers(), [0x80, 7, 31, 31]);
}

/// Manual p. 196-203: a command of each rank reaches its slave once.
#[test]
fn broadcast_commands_of_each_rank_reach_the_slave() {
    for memory in BOTH {
        let mut bench = Bench::active(memory);
        let mut received = CANsync_BC_SL::default();
        let mut check = |bench: &mut Bench, number| {
            let mut seen = Vec::new();
            bench.cycles(6, |b| {
                received.call(&b.sl);
                seen.extend((received.si_BC_RECEIVED == 2).then_some(received.us_BC_CMD_NR));
            });
            assert_eq!(seen, [number], "{memory:?}");
            assert_eq!(received.si_BC_RECEIVED, 0);
            assert_eq!((received.si_BC_BYTE, received.i_BC_WORD), (-3, -4));
        };
        macro_rules! send {
            ($block:ident, $number:expr) => {
                let mut block = $block {
                    us_BC_CMD_NR: $number,
                    si_BC_BYTE: -3,
                    i_BC_WORD: -4,
                    d_SL_MASK: 1,
                    x_EN: true,
                    ..Default::default()
                };
                block.call(&bench.ma);
                block.x_EN = false;
                block.call(&bench.ma);
                assert!(!block.x_OK, "not sent yet");
                check(&mut bench, $number);
                block.call(&bench.ma);
                assert!(block.x_OK, "sent");
            };
        }
        send!(CANsync_BC_MA0, 128);
        send!(CANsync_BC_MA1, 129);
        send!(CANsync_BC_MA2, 255);
    }
}

#[test]
fn a_broadcast_command_for_others_is_not_received() {
    let mut bench = Bench::active(Memory::Heap);
    let mut block = CANsync_BC_MA0 { us_BC_CMD_NR: 200, d_SL_MASK: !1, x_EN: true, ..Default::default() };
    let mut received = CANsync_BC_SL::default();
    block.call(&bench.ma);
    block.x_EN = false;
    bench.until(|b| {
        block.call(&b.ma);
        block.x_OK
    });
    bench.rig.step(2000);
    received.call(&bench.sl);
    assert_eq!((received.si_BC_RECEIVED, received.us_BC_CMD_NR), (0, 0));
}

/// Manual p. 207-210.
#[test]
fn a_control_word_reaches_its_slave_once() {
    let mut bench = Bench::active(Memory::Heap);
    let mut send = CANsync_CONTROLWORD_MA { w_CONTROLWORD: 0x000F, x_EN: true, ..Default::default() };
    let mut receive = CANsync_CONTROLWORD_SL::default();
    send.call(&bench.ma);
    assert!(!send.x_OK);
    send.x_EN = false;
    bench.until(|b| {
        send.call(&b.ma);
        send.x_OK
    });
    bench.until(|b| {
        receive.call(&b.sl);
        receive.si_RECEIVED == 2
    });
    assert_eq!(receive.w_CONTROLWORD, 0x000F);
    receive.call(&bench.sl);
    assert_eq!((receive.si_RECEIVED, receive.w_CONTROLWORD), (0, 0x000F));
    // The block sends nothing to a slave number that does not exist, so the drive has received no control word.
    assert_eq!(bench.ma.a_STEUREG_CONTROLWORD[1].load(), 0);
    (send.si_SL_NR_CTRL, send.x_EN) = (-1, true);
    send.call(&bench.ma);
    assert!(!send.x_OK);
}

/// Manual p. 207: "as long as x_EN is TRUE", the control word is sent again and again.
#[test]
fn a_control_word_is_repeated_while_enabled() {
    let mut bench = Bench::active(Memory::Heap);
    let mut send = CANsync_CONTROLWORD_MA { si_SL_NR_CTRL: 0, x_EN: true, ..Default::default() };
    let mut receive = CANsync_CONTROLWORD_SL::default();
    let mut count = 0;
    bench.cycles(40, |b| {
        send.call(&b.ma);
        receive.call(&b.sl);
        count += receive.si_RECEIVED / 2;
    });
    // Slave 0 and slave 1 take turns, so each has its turn in every second interval.
    let turns = (40_000 / (2 * rate().interval_us)) as i8;
    assert!((turns - 2..=turns).contains(&count), "{count}");
}

/// Manual p. 203, 210; 5.02066.01a p. 112, 122: broadcast command 1 is a control word. Both blocks show it once, in either order
/// of their calls, and also if only one of them is called (D-603).
#[test]
fn a_control_word_is_broadcast_command_1_too() {
    for order in [&[0, 1][..], &[1, 0], &[0], &[1]] {
        let dead = Dead::new();
        let base = dead.slave();
        let mut broadcast = CANsync_BC_SL { si_BC_BYTE: 7, ..Default::default() };
        let mut control_word = CANsync_CONTROLWORD_SL::default();
        for word in [0x1234, 0xABCD, 0xABCD] {
            base.w_CONTROLWORD.store(word);
            base.b_STATREG_CONTROLWORD.store(0x02);
            for received in [2, 0] {
                for block in order {
                    if *block == 0 {
                        broadcast.call(&base);
                        let shown = (broadcast.us_BC_CMD_NR, broadcast.si_BC_BYTE, broadcast.i_BC_WORD);
                        assert_eq!((broadcast.si_BC_RECEIVED, shown), (received, (1, 0, word as i16)));
                    } else {
                        control_word.call(&base);
                        assert_eq!((control_word.si_RECEIVED, control_word.w_CONTROLWORD), (received, word));
                    }
                }
            }
        }
        // Plays a different broadcast command first.
        base.b_STATREG_CONTROLWORD.store(0x02);
        base.b_AKT_CMD.store(200);
        base.b_STATREG_AKT_CMD.store(0x02);
        for number in [200, 1] {
            broadcast.call(&base);
            assert_eq!((broadcast.si_BC_RECEIVED, broadcast.us_BC_CMD_NR), (2, number));
        }
    }
}

/// 5.02066.01a p. 92 gives 16#02 as reception indicator of the control word. When one of the two blocks has shown the
/// word, it stores another value, so that the second block also shows the word. The page of the function blocks
/// describes this for a program that polls the register itself (D-603).
#[test]
fn the_page_lists_the_reception_indicator_after_a_block() {
    let page = include_str!("../../../docs/devices/omega-drive-line-2/function-blocks.md");
    let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
    let dead = Dead::new();
    let base = dead.slave();
    base.b_STATREG_CONTROLWORD.store(0x02);
    CANsync_BC_SL::default().call(&base);
    let after_broadcast = base.b_STATREG_CONTROLWORD.load();
    base.b_STATREG_CONTROLWORD.store(0x02);
    CANsync_CONTROLWORD_SL::default().call(&base);
    let after_control_word = base.b_STATREG_CONTROLWORD.load();
    for (block, left) in [("CANsync_BC_SL", after_broadcast), ("CANsync_CONTROLWORD_SL", after_control_word)]
    {
        assert!(page.contains(&format!("`{block}` by 16#{left:02X}")), "{block} leaves 16#{left:02X}");
    }
}

/// Broadcast command 1 over the bus: the master sends it by its block for broadcast commands.
#[test]
fn broadcast_command_1_reaches_the_slave() {
    let mut bench = Bench::active(Memory::Heap);
    let mut send =
        CANsync_BC_MA1 { us_BC_CMD_NR: 1, i_BC_WORD: 0x000F, d_SL_MASK: 1, x_EN: true, ..Default::default() };
    let mut received = CANsync_BC_SL::default();
    send.call(&bench.ma);
    bench.until(|b| {
        received.call(&b.sl);
        received.si_BC_RECEIVED == 2
    });
    assert_eq!((received.us_BC_CMD_NR, received.i_BC_WORD), (1, 0x000F));
}
