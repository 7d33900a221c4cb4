//! Controllers (p. 120-131, D-448).

use super::calculation::{ValueHistory, us};
use crate::plc::{Ram, function_block};
use core::time::Duration;

/// Number of steps of a manipulated variable: the value 65536 means 0 %, the value 0 means 100 % (p. 127).
const RANGE: f64 = 65_536.0;
/// The largest effective deviation (p. 127).
const DEVIATION: i32 = 127;
/// Change of the manipulated variable for a deviation of 1 and a gain of 1.
const STEP: f64 = 256.0;

/// Settings of a controller.
struct Settings {
    kp: u8,
    tn: Duration,
    kd: u8,
    tv: Duration,
}

/// State of a controller.
#[derive(Clone, Debug, Default)]
pub struct Controller {
    /// Integral part of the controller's output.
    integral: f64,
    called_at: Option<u64>,
    /// Deviations during the last TV.
    past: ValueHistory<i32>,
}

impl Controller {
    /// Returns the sum of the proportional, integral and differential parts for a deviation.
    fn at(&mut self, deviation: i32, settings: &Settings, now: u64) -> f64 {
        let deviation = deviation.clamp(-DEVIATION, DEVIATION);
        let passed = now.saturating_sub(self.called_at.replace(now).unwrap_or(now));
        let [kp, kd] = [settings.kp, settings.kd].map(|tenths| f64::from(tenths) / 10.0 * STEP);
        let now_it_is = f64::from(deviation);
        self.integral = match us(settings.tn) {
            0 => 0.0,
            tn => self.integral + kp * now_it_is * passed as f64 / tn as f64,
        };
        // The integral part is limited to the range of the output. A larger value would not change the
        // output, but would take longer to decrease again.
        self.integral = self.integral.clamp(-RANGE, RANGE);
        // A change of the deviation has an effect only for the time TV (p. 126).
        let before = self.past.ago(deviation, now, us(settings.tv)).map_or(0.0, f64::from);
        kp * now_it_is + self.integral + kd * (now_it_is - before)
    }
}

/// Returns the part of the output that depends only on the setpoint (p. 127, 131). If the largest setpoint is
/// 0, the output is off.
fn reference(setpoint: u16, most: u16) -> f64 {
    if most == 0 { RANGE } else { RANGE - f64::from(setpoint) / f64::from(most) * RANGE }
}

/// Converts to the range of PWM.
fn output(value: f64) -> u16 {
    value.round().clamp(0.0, f64::from(u16::MAX)) as u16
}

function_block! {
    /// A PID controller (p. 125-129). Y is suitable for PWM with a RELOAD of 65535: 65535 is 0 %, 0 is 100 %.
    pub struct PID(ram: Ram) {
        in {
            /// Actual value of the controlled variable.
            X: u16;
            /// Setpoint of the controlled variable.
            XS: u16;
            /// Largest value of the setpoint.
            XMAX: u16;
            /// Gain of the controller, in tenths.
            KP: u8;
            /// Reset time; 0: no integral part.
            TN: Duration;
            /// Gain of the derivative part, in tenths.
            KD: u8;
            /// Derivative time of the controller.
            TV: Duration;
            /// Self-optimization. It has no effect in commram, because the manual does not describe it
            /// (D-448).
            SO: bool;
        }
        out {
            /// Manipulated variable: the output of the controller.
            Y: u16;
        }
        internal: Controller;
    }
}

impl PID {
    /// Runs one PLC cycle.
    pub fn call(&mut self, ram: &Ram) {
        let settings = Settings { kp: self.KP, tn: self.TN, kd: self.KD, tv: self.TV };
        let deviation = i32::from(self.X) - i32::from(self.XS);
        let parts = self.internal.at(deviation, &settings, ram.now_us());
        self.Y = output(reference(self.XS, self.XMAX) + parts);
    }
}

function_block! {
    /// Keeps two actual values equal (p. 130-131): reduces the output of the channel with the larger value.
    pub struct GLR(ram: Ram) {
        in {
            /// Actual value of channel 1.
            X1: u16;
            /// Actual value of channel 2.
            X2: u16;
            /// Setpoint of the controlled variable.
            XS: u16;
            /// Largest value of the setpoint.
            XMAX: u16;
            /// Gain of the controller, in tenths.
            KP: u8;
            /// Reset time; 0: no integral part.
            TN: Duration;
            /// Gain of the derivative part, in tenths.
            KD: u8;
            /// Derivative time of the controller.
            TV: Duration;
        }
        out {
            /// Manipulated variable of channel 1.
            Y1: u16;
            /// Manipulated variable of channel 2.
            Y2: u16;
        }
        internal: Controller;
    }
}

impl GLR {
    /// Runs one PLC cycle.
    pub fn call(&mut self, ram: &Ram) {
        let settings = Settings { kp: self.KP, tn: self.TN, kd: self.KD, tv: self.TV };
        let deviation = i32::from(self.X1) - i32::from(self.X2);
        let parts = self.internal.at(deviation, &settings, ram.now_us());
        let reference = reference(self.XS, self.XMAX);
        // Increases the manipulated variable only of the channel with the larger value, which reduces its
        // output.
        let raised = |is_larger: bool, by: f64| output(reference + if is_larger { by.max(0.0) } else { 0.0 });
        self.Y1 = raised(deviation >= 0, parts);
        self.Y2 = raised(deviation <= 0, -parts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::cs0015::registers::DEVICE;
    use crate::memory::Segment;

    const MS: u64 = 1000;

    fn ram() -> Ram {
        Ram::of(&Segment::of(&DEVICE)).unwrap()
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn the_setpoint_alone_drives() {
        let ram = ram();
        for (XS, XMAX, expected) in
            [(1000, 1000, 0), (500, 1000, 32_768), (0, 1000, 65_535), (2000, 1000, 0), (1, 0, 65_535)]
        {
            let mut pid = PID { X: XS, XS, XMAX, KP: 17, TN: ms(50), ..Default::default() };
            pid.call(&ram);
            assert_eq!(pid.Y, expected, "{XS} of {XMAX}");
        }
    }

    /// If X is greater than XS, Y increases; if X is less than XS, Y decreases (p. 127).
    #[test]
    fn a_deviation_raises_and_reduces_up_to_127() {
        let ram = ram();
        for (X, expected) in
            [(500, 32_768), (510, 32_768 + 17 * 256), (490, 32_768 - 17 * 256), (900, 65_535), (0, 0)]
        {
            let mut pid = PID { X, XS: 500, XMAX: 1000, KP: 17, ..Default::default() };
            pid.call(&ram);
            assert_eq!(pid.Y, expected, "{X}");
        }
        let mut weak = PID { X: 1000, XS: 500, XMAX: 1000, KP: 1, ..Default::default() };
        weak.call(&ram);
        assert_eq!(weak.Y, 32_768 + 3251, "12.7 x 256");
    }

    #[test]
    fn a_lasting_deviation_adds_up_within_the_reset_time_and_is_limited() {
        let ram = ram();
        let mut pid = PID { X: 510, XS: 500, XMAX: 1000, KP: 10, TN: ms(100), ..Default::default() };
        pid.call(&ram);
        assert_eq!(pid.Y, 32_768 + 2560);
        ram.header().virtual_time_us.store(100 * MS);
        pid.call(&ram);
        assert_eq!(pid.Y, 32_768 + 2 * 2560, "as much again after TN");
        ram.header().virtual_time_us.store(1_000_000 * MS);
        pid.call(&ram);
        assert_eq!((pid.Y, pid.internal.integral), (65_535, RANGE));
    }

    /// Manual p. 126.
    #[test]
    fn a_change_counts_until_the_derivative_time_is_over() {
        let ram = ram();
        let mut pid = PID { X: 500, XS: 500, XMAX: 1000, KP: 10, KD: 20, TV: ms(30), ..Default::default() };
        let mut seen = Vec::new();
        for (cycle, x) in [500, 510, 510, 510, 510, 510].into_iter().enumerate() {
            ram.header().virtual_time_us.store(cycle as u64 * 10 * MS);
            pid.X = x;
            pid.call(&ram);
            seen.push(i32::from(pid.Y) - 32_768);
        }
        assert_eq!(seen, [0, 7680, 7680, 7680, 2560, 2560]);
    }

    /// Manual p. 131.
    #[test]
    fn the_larger_of_two_values_is_driven_less() {
        let ram = ram();
        let mut both = GLR { X1: 510, X2: 500, XS: 250, XMAX: 1000, KP: 10, ..Default::default() };
        both.call(&ram);
        assert_eq!((both.Y1, both.Y2), (49_152 + 2560, 49_152));
        (both.X1, both.X2) = (500, 510);
        both.call(&ram);
        assert_eq!((both.Y1, both.Y2), (49_152, 49_152 + 2560));
        both.X1 = 510;
        both.call(&ram);
        assert_eq!((both.Y1, both.Y2), (49_152, 49_152));
    }
}
