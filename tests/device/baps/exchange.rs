//! Tests of cyclic process data.

use super::bench::*;
use crate::rig::Memory;

#[test]
fn reference_values_move_the_drive() {
    Bench::on_both("", |mut bench| {
        bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL]);
        bench.regs.a_WR_VALUE[0].store(1000);
        bench.enable();
        assert_eq!(bench.regs.w_STATUSWORD.load(), 0x0033, "the status word before this slice");
        bench.exchange(2);
        assert_eq!(bench.regs.w_STATUSWORD.load(), 0x0037);
        assert_eq!(bench.regs.a_RD_VALUE[0].load(), 1000);
    });
}

#[test]
fn without_a_command_the_reference_values_stay_but_actual_values_go_on() {
    Bench::on_both("", |mut bench| {
        bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL, 303]);
        bench.regs.a_WR_VALUE[0].store(1000);
        bench.enable();
        bench.exchange(2);
        let angle = bench.regs.a_RD_VALUE[1].load();
        bench.regs.a_WR_VALUE[0].store(0);
        bench.regs.w_CONTROLWORD.store(0);
        let events = bench.events();
        bench.step(5000);
        assert_eq!(bench.events() - events, 10, "an event in each communication");
        assert_eq!(bench.regs.a_RD_VALUE[0].load(), 1000);
        assert_eq!(bench.regs.a_RD_VALUE[1].load() - angle, 5000);
    });
}

#[test]
fn each_communication_is_an_event() {
    for event in [4, 8] {
        Bench::on_both("", |mut bench| {
            bench.intr_set(event);
            bench.configure(SAME_CYCLE, &[], &[]);
            bench.step(10_000);
            assert_eq!((bench.occurred(event), bench.occurred(12 - event)), (20, 0));
        });
    }
}

#[test]
fn a_command_waits_for_its_communication() {
    Bench::on_both("", |mut bench| {
        // Configures an exchange every 2 ms, counted in slices.
        bench.configure(0x0044, &[ADDITIONAL], &[]);
        bench.regs.b_COMMAND.store(EXCHANGE);
        bench.step(1500);
        assert_eq!(bench.regs.b_COMMAND.load(), EXCHANGE);
        bench.step(500);
        assert_eq!((bench.regs.b_COMMAND.load(), bench.events()), (0, 1));
    });
}

#[test]
fn each_cycle_time_gives_its_number_of_communications() {
    for (command_reg, us) in
        [(0x0010, 500), (0x0020, 1000), (0x0030, 1500), (0x00F0, 7500), (0x0018, 1000), (0x0058, 16_000)]
    {
        let mut bench = Bench::new(Memory::Heap, "");
        bench.configure(command_reg, &[], &[]);
        bench.step(1_000_000);
        let events = bench.events();
        bench.step(240_000);
        assert_eq!(bench.events() - events, 240_000 / us, "16#{command_reg:04X}");
    }
}

#[test]
fn time_slices_refresh_each_value_at_its_own_cycle() {
    Bench::on_both("parameters = [{ number = 400, format = 'doubleword' }]", |mut bench| {
        bench.configure(TIME_SLICES, &[400; 8], &[303; 8]);
        let mut seen = Vec::new();
        for call in 1..=512u64 {
            for x in 0..8 {
                bench.regs.a_WR_VALUE[x].store((call as u32) << 4 | x as u32);
            }
            let before = bench.p(400);
            bench.exchange(1);
            if bench.p(400) != before {
                assert_eq!(u64::from(bench.p(400) >> 4), call);
                seen.push((call, bench.p(400) & 0xF));
            }
        }
        for x in 0..8u32 {
            let calls: Vec<u64> = seen.iter().filter(|(_, y)| *y == x).map(|(call, _)| *call).collect();
            let expected: Vec<u64> = (1 << x..=512).step_by(2 << x).collect();
            assert_eq!(calls, expected, "value {x}");
        }
    });
}

#[test]
fn a_word_takes_the_low_half_of_its_reference_value() {
    Bench::on_both("parameters = [{ number = 400, format = 'word', min = -5 }]", |mut bench| {
        bench.configure(SAME_CYCLE, &[400], &[400]);
        bench.regs.a_WR_VALUE[0].store(0xFFFF_FFFD);
        bench.exchange(2);
        assert_eq!(bench.regs.a_RD_VALUE[0].load(), 0xFFFD);
        bench.regs.a_WR_VALUE[0].store(0xFFFF_FFFA);
        assert_eq!(bench.command(EXCHANGE, 500), 0x83, "below -5");
    });
}

#[test]
fn angle_references_are_masked_and_followed() {
    Bench::on_both("", |mut bench| {
        assert_eq!(bench.write_word(304, 1), 0);
        bench.configure(0x0044, &[258], &[258, 303]);
        for word in [0x0006, 0x0007, 0x000F] {
            bench.regs.w_CONTROLWORD.store(word);
            assert_eq!(bench.command(EXCHANGE, 2000), 0x01);
        }
        for n in 1..=200u32 {
            bench.regs.a_WR_VALUE[0].store(n * 100_000 + 7);
            assert_eq!(bench.command(EXCHANGE, 2000), 0x01);
        }
        // With P167 = 2000 us and P103 = 4 kHz, the lowest four bits of the position are not used (manual p. 74).
        assert_eq!(bench.regs.a_RD_VALUE[0].load(), (199 * 100_000 + 7) & 0xFFFF_FFF0);
        bench.step(500);
        assert_eq!(bench.p(258), (200 * 100_000 + 7) & 0xFFFF_FFF0);
        // The drive follows its reference with a delay of one slot, plus or minus the remaining error of the position loop.
        let lag = (200 * 100_000i64) - i64::from(bench.p(303));
        assert!((0..150_000).contains(&lag), "{lag}");
    });
}

#[test]
fn a_fault_stops_the_drive_until_it_is_reset() {
    Bench::on_both("ramp_per_second = 1000000", |mut bench| {
        bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL, 308]);
        bench.regs.a_WR_VALUE[0].store(2000);
        bench.enable();
        bench.exchange(6);
        assert_eq!(bench.regs.a_RD_VALUE[0].load(), 2000);
        bench.trip(17);
        bench.exchange(2);
        assert_eq!((bench.regs.w_STATUSWORD.load(), bench.regs.a_RD_VALUE[1].load()), (0x001F, 17));
        bench.exchange(4);
        assert_eq!((bench.regs.w_STATUSWORD.load(), bench.regs.a_RD_VALUE[0].load()), (0x0018, 0));
        for word in [0x0080, 0x0006, 0x0007, 0x000F] {
            bench.regs.w_CONTROLWORD.store(word);
            bench.exchange(1);
        }
        bench.exchange(6);
        assert_eq!((bench.regs.w_STATUSWORD.load(), bench.regs.a_RD_VALUE[1].load()), (0x0037, 0));
        assert_eq!(bench.plant.faults().count(), 0, "it happens once");
    });
}
