//! Configuration, re-initialization and every acknowledgement.

use super::bench::*;

#[test]
fn first_configuration() {
    Bench::on_both("", |mut bench| {
        assert_eq!(bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL, 121]), 0x02);
        assert_eq!(bench.command(EXCHANGE, 500), 0x01);
    });
}

#[test]
fn nothing_is_done_before_the_configuration() {
    Bench::on_both("", |mut bench| {
        assert_eq!(bench.command(EXCHANGE, 500), 0x81);
        assert_eq!(bench.command(RE_INITIALIZE, 500), 0x81);
        assert_eq!(bench.events(), 0);
        assert_eq!(
            bench.plant.devices()[0]
                .as_a::<commram::devices::omega_drive_line_2::Plc>()
                .unwrap()
                .baps()
                .next_time(),
            u64::MAX,
            "no time slices without need"
        );
    });
}

#[test]
fn invalid_commands() {
    Bench::on_both("", |mut bench| {
        for command in [0x04, 0x7F, 0xFF] {
            assert_eq!(bench.command(command, 500), 0x80);
        }
        assert_eq!(bench.configure(SAME_CYCLE, &[], &[]), 0x02);
        assert_eq!(bench.command(0x04, 500), 0x80);
        assert_eq!(bench.command(EXCHANGE, 500), 0x01, "the configuration stays");
    });
}

#[test]
fn reserved_methods_are_not_understood() {
    Bench::on_both("", |mut bench| {
        for reserved in [0x0012, 0x0016, 0x0004] {
            assert_eq!(bench.configure(reserved, &[], &[]), 0x80, "16#{reserved:04X}");
        }
        assert_eq!(bench.command(EXCHANGE, 500), 0x81);
    });
}

#[test]
fn numbers_the_drive_cannot_exchange() {
    Bench::on_both("", |mut bench| {
        assert_eq!(bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[999]), 0x82);
        assert_eq!(bench.configure(SAME_CYCLE, &[999], &[SPEED_ACTUAL]), 0x83);
        assert_eq!(bench.configure(SAME_CYCLE, &[SPEED_ACTUAL], &[]), 0x83, "read only");
        assert_eq!(bench.configure(SAME_CYCLE, &[999], &[999]), 0x83);
        assert_eq!(bench.command(EXCHANGE, 500), 0x81, "a failed configuration leaves none");
    });
}

#[test]
fn values_that_are_refused_while_process_data_run() {
    Bench::on_both("", |mut bench| {
        // The PWM frequency has limits and is not available while the drive recalculates.
        assert_eq!(bench.configure(SAME_CYCLE, &[103], &[301, 103]), 0x02);
        bench.regs.a_WR_VALUE[0].store(9);
        assert_eq!(bench.command(EXCHANGE, 500), 0x83);
        assert_eq!(bench.p(103), 4);
        assert_eq!(bench.configure(SAME_CYCLE, &[], &[103]), 0x02);
        assert_eq!(bench.write_word(103, 8), 0);
        assert_eq!(bench.command(EXCHANGE, 500), 0x82);
        bench.step(20_000);
        assert_eq!(bench.command(EXCHANGE, 500), 0x01);
        assert_eq!(bench.regs.a_RD_VALUE[0].load(), 8);
    });
}

#[test]
fn reconfiguration_with_process_data_stopped() {
    Bench::on_both("", |mut bench| {
        bench.configure(SAME_CYCLE, &[SPEED_REFERENCE, ADDITIONAL], &[SPEED_ACTUAL]);
        bench.regs.a_WR_VALUE[1].store(5);
        bench.exchange(2);
        assert_eq!(bench.configure(0x0024, &[0, ADDITIONAL], &[ADDITIONAL]), 0x02);
        bench.regs.a_WR_VALUE[1].store(6);
        assert_eq!(bench.command(EXCHANGE, 1000), 0x01);
        assert_eq!((bench.p(SPEED_REFERENCE), bench.p(ADDITIONAL)), (0, 6));
        bench.step(1000);
        assert_eq!(bench.regs.a_RD_VALUE[0].load(), 6);
    });
}

#[test]
fn re_initialization_while_process_data_run() {
    Bench::on_both("", |mut bench| {
        bench.configure(SAME_CYCLE, &[SPEED_REFERENCE, ADDITIONAL], &[SPEED_ACTUAL, 121, ADDITIONAL, 103]);
        bench.regs.a_WR_VALUE[1].store(7);
        bench.exchange(2);
        // Reference value 0 and actual value 3 change; the other values stay valid.
        bench.numbers(&[305, ADDITIONAL], &[SPEED_ACTUAL, 121, ADDITIONAL, 305]);
        bench.regs.a_WR_VALUE[0].store(1234);
        for count in 0..6 {
            bench.regs.a_WR_VALUE[1].store(count);
            assert_eq!(bench.command(RE_INITIALIZE, 500), 0x03);
            assert_eq!(bench.p(ADDITIONAL), count);
        }
        assert_eq!(bench.p(305), 0x7FFF_FFFF, "not before the end");
        assert_eq!(bench.command(RE_INITIALIZE, 500), 0x01);
        assert_eq!(bench.command(RE_INITIALIZE, 500), 0x01, "the result stays");
        bench.exchange(2);
        assert_eq!(bench.p(305), 1234);
        assert_eq!(bench.regs.a_RD_VALUE[3].load(), 1234);
    });
}

#[test]
fn re_initialization_with_numbers_that_do_not_exist() {
    for (writes, reads, answer) in [
        ([999, 0], [0; 4], 0x86),
        ([0, 301], [0; 4], 0x86),
        ([0; 2], [0, 0, 0, 999], 0x87),
        ([0, 999], [999; 4], 0x86),
    ] {
        Bench::on_both("", |mut bench| {
            bench.configure(SAME_CYCLE, &[ADDITIONAL], &[ADDITIONAL]);
            bench.exchange(1);
            bench.numbers(&writes, &reads);
            for _ in 0..6 {
                assert_eq!(bench.command(RE_INITIALIZE, 500), 0x03);
            }
            assert_eq!(bench.command(RE_INITIALIZE, 500), answer);
            // The drive still exchanges the previous parameter numbers.
            bench.regs.a_WR_VALUE[0].store(77);
            bench.exchange(2);
            assert_eq!(bench.regs.a_RD_VALUE[0].load(), 77);
        });
    }
}

#[test]
fn re_initialization_goes_on_while_the_plc_only_exchanges() {
    Bench::on_both("", |mut bench| {
        bench.configure(SAME_CYCLE, &[], &[]);
        assert_eq!(bench.command(RE_INITIALIZE, 500), 0x03);
        let answers: Vec<u8> = (0..8).map(|_| bench.command(EXCHANGE, 500)).collect();
        assert_eq!(answers, [0x03, 0x03, 0x03, 0x03, 0x03, 0x01, 0x01, 0x01]);
        assert_eq!(bench.command(RE_INITIALIZE, 500), 0x03, "a new one");
    });
}

/// A change of the cycle time during a re-initialization does not restart the re-initialization.
#[test]
fn re_initialization_outlasts_a_change_of_the_cycle() {
    Bench::on_both("", |mut bench| {
        bench.configure(SAME_CYCLE, &[], &[]);
        for _ in 0..2 {
            assert_eq!(bench.command(RE_INITIALIZE, 500), 0x03);
        }
        bench.regs.w_COMMAND_REG.store(0x0024);
        let answers: Vec<u8> = (0..6).map(|_| bench.command(RE_INITIALIZE, 1000)).collect();
        assert_eq!(answers, [0x03, 0x03, 0x03, 0x03, 0x01, 0x01]);
    });
}

#[test]
fn re_initialization_needs_the_drive_software_and_the_method() {
    Bench::on_both("software = 308", |mut bench| {
        bench.configure(SAME_CYCLE, &[ADDITIONAL], &[ADDITIONAL; 4]);
        bench.regs.a_WR_VALUE[0].store(3);
        assert_eq!(bench.command(RE_INITIALIZE, 500), 0x80);
        bench.exchange(2);
        let values: Vec<u32> = (0..4).map(|x| bench.regs.a_RD_VALUE[x].load()).collect();
        assert_eq!(values, [3, 3, 0, 0], "two actual values only");
    });
    Bench::on_both("", |mut bench| {
        bench.configure(TIME_SLICES, &[], &[]);
        assert_eq!(bench.command(RE_INITIALIZE, 500), 0x80);
    });
}
