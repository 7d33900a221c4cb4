//! The blocks of the BAPS and of the board.

use super::Main;
use commram::devices::omega_drive_line_2::blocks::*;
use std::time::Duration;

/// Method and cycle time of the BAPS.
const CYCLE: u16 = 0x0014;

impl Main {
    pub(super) fn baps(&mut self) {
        let (scans, base) = (self.scans, &self._baps);
        if scans > 20 && !self.own.b_init.x_OK {
            let init = &mut self.own.b_init;
            (init.i_EVENT, init.w_COMMAND_REG, init.u_WR_PAR_NR0, init.u_RD_PAR_NR0) = (4, CYCLE, 300, 301);
            init.call(base);
            self.baps_pd.all(&[init.x_OK]).mix(init.b_ERR.into());
        }
        if self.own.b_init.x_OK {
            match scans {
                0..300 => {
                    let two = &mut self.own.b_two;
                    (two.w_CONTROLWORD, two.w_COMMAND_REG, two.ud_WR_VALUE0) = (0x0006, CYCLE, scans);
                    two.call(base);
                }
                300..500 => {
                    let eight = &mut self.own.b_eight;
                    (eight.w_CONTROLWORD, eight.w_COMMAND_REG, eight.ud_WR_VALUE0) = (0x000F, CYCLE, scans);
                    eight.call(base);
                }
                500..1000 => {
                    if scans == 600 {
                        let (u_WR_PAR_NR0, u_RD_PAR_NR0, u_RD_PAR_NR1) = (300, 301, 300);
                        BAPS_INIT {
                            us_MODE: 2,
                            u_WR_PAR_NR0,
                            u_RD_PAR_NR0,
                            u_RD_PAR_NR1,
                            ..Default::default()
                        }
                        .call(base);
                    }
                    let four = &mut self.own.b_four;
                    (four.w_CONTROLWORD, four.w_COMMAND_REG, four.ud_WR_VALUE0) = (0x000F, CYCLE, scans);
                    (four.x_RE_INIT_START, four.t_RE_INIT_TIME) = (scans > 600, Duration::from_millis(300));
                    four.call(base);
                }
                _ => {}
            }
            (self.own.b_watch.t_TIME, self.own.b_watch.x_RESET) = (Duration::from_millis(20), scans == 1100);
            self.own.b_watch.call(base);
        }
        let (two, eight, four) = (&self.own.b_two, &self.own.b_eight, &self.own.b_four);
        let sum = self.baps_pd.mix(two.ud_RD_VALUE0).mix(two.w_STATUSWORD.into());
        sum.mix(two.b_SL_QUIT.into()).mix(two.b_ERR.into());
        sum.mix(eight.ud_RD_VALUE0).mix(eight.w_STATUS_REG.into());
        sum.mix(four.ud_RD_VALUE0).mix(four.ud_RD_VALUE1).mix(four.b_ERR.into());
        sum.all(&[four.x_RE_INIT_OK, four.x_RE_INIT_ERR, self.own.b_watch.x_ERR]);
    }

    pub(super) fn service_data(&mut self) {
        let scans = self.scans;
        (self.own.b_control.x_RESET, self.own.b_control.t_TIME) = (scans == 800, Duration::from_millis(100));
        self.own.b_control.call(&self._baps, &mut self.own.b_data);
        let read = &mut self.own.b_read;
        read.u_PAR_NR = if scans > 110 { 5999 } else { 301 };
        read.x_EN = scans > 30 && scans < 100 || scans > 120 && scans < 300 || scans == 700;
        read.x_RESET = scans == 800;
        read.call(&mut self.own.b_data);
        let write = &mut self.own.b_write;
        (write.u_PAR_NR, write.x_PAR_FORMAT, write.ud_PAR_VALUE) = (300, scans > 400, 77);
        write.x_EN = scans > 40 && scans < 400 || scans > 420;
        write.x_RESET = scans == 810;
        write.call(&mut self.own.b_data);
        let sum = self.baps_sd.all(&[read.x_BUSY]).mix(read.ud_PAR_VALUE);
        sum.all(&[read.x_PAR_FORMAT, read.x_OK]).i(read.i_ERR_DETAIL).i(read.i_ERR_COMM);
        sum.all(&[read.x_ERR, write.x_BUSY]).i(write.i_ERR_DETAIL).i(write.i_ERR_COMM);
        sum.all(&[write.x_ERR, write.x_OK]).mix(self.own.b_control.b_ERR.into());
    }

    pub(super) fn board(&mut self) {
        let ram = &self.ram;
        let mut began = TIME_MEASURE_START::default();
        began.call(ram);
        LED { b_LEDS: (self.scans / 10 % 16) as u8 }.call(ram);
        let option = &mut self.own.option;
        (option.us_MODE_TRIGGER_CONTROLLER, option.u_DIVIDER_TIMER_A, option.x_EN_TIMER_A) = (2, 2499, true);
        option.call(ram);
        (self.own.timer.i_EVENT, self.own.timer.i_PAR1, self.own.timer.x_EN) = (2, 100, self.scans < 500);
        self.own.timer.call(ram);
        (self.own.no_event.i_EVENT, self.own.no_event.x_EN) = (1, true);
        self.own.no_event.call(ram);
        let mut took = TIME_MEASURE_END { ud_TIME: began.ud_TIME, ..Default::default() };
        took.call(ram);
        let sum = self.board.all(&[
            self.own.option.x_OK,
            self.own.option.x_ERR,
            self.own.timer.x_ERR,
            self.own.no_event.x_ERR,
        ]);
        sum.mix(began.ud_TIME).mix(took.ud_TIME_DIFF);
    }
}
