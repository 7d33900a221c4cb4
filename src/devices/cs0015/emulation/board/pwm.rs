//! PWM: outputs 0 to 7 in two groups of four. The outputs of a group are either digital outputs or PWM outputs (p.
//! 86-95).

use serde::{Deserialize, Serialize};

/// Number of channels; channel n is output n.
pub(crate) const CHANNELS: usize = 8;
/// Number of channels in a group.
const GROUP: usize = 4;
/// Highest frequency in Hz that the outputs can follow (p. 91).
const USEFUL_HZ: u32 = 200;
/// Highest frequency in Hz. Higher values are limited to it (p. 92, 94).
const MOST_HZ: u32 = 10_000;
/// Counts per second of both groups with DIV64 (p. 88, 90).
const DIVIDED_HZ: u32 = 156_250;

/// Group of channels. The counters of the two groups count in different directions.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Group {
    /// Channels 0 to 3: the counter counts from RELOAD down to 0. Each channel has its own frequency.
    Down,
    /// Channels 4 to 7: the counter counts from RELOAD up to FFFFh. All four channels have one frequency.
    Up,
}

impl Group {
    const fn of(channel: usize) -> Self {
        if channel < GROUP { Group::Down } else { Group::Up }
    }

    /// Returns the counts per second.
    const fn counts_hz(self, is_divided: bool) -> u32 {
        match (self, is_divided) {
            (_, true) => DIVIDED_HZ,
            (Group::Down, false) => 10_000_000,
            (Group::Up, false) => 2_500_000,
        }
    }

    /// Returns RELOAD for a number of counts per period, at most 10000h.
    fn reload(self, counts: u32) -> u16 {
        let reload = match self {
            Group::Down => counts.min(0xFFFF),
            Group::Up => 0x1_0000 - counts.min(0x1_0000),
        };
        reload as u16
    }

    /// Returns the counts per period.
    fn counts(self, reload: u16) -> u32 {
        match self {
            Group::Down => reload.into(),
            Group::Up => 0x1_0000 - u32::from(reload),
        }
    }
}

/// Counter settings of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct PwmCounter {
    reload: u16,
    is_divided: bool,
}

impl PwmCounter {
    /// Creates the settings, with the frequency limited.
    fn new(group: Group, reload: u16, is_divided: bool) -> Self {
        let least = group.counts_hz(is_divided).div_ceil(MOST_HZ);
        PwmCounter { reload: group.reload(group.counts(reload).max(least)), is_divided }
    }

    /// Creates the settings for a frequency in Hz. If the range of the counter is too small for it, sets
    /// DIV64 (p. 88, 90).
    fn of_hz(group: Group, hz: u16) -> Self {
        let hz = u32::from(hz).clamp(1, MOST_HZ);
        let counts = |is_divided| group.counts_hz(is_divided) / hz;
        let is_divided = counts(false) > 0xFFFF;
        PwmCounter { reload: group.reload(counts(is_divided)), is_divided }
    }

    fn hz(self, group: Group) -> u32 {
        let counts = group.counts(self.reload);
        (group.counts_hz(self.is_divided) + counts / 2) / counts.max(1)
    }

    /// Returns VALUE for a percentage.
    fn value(self, group: Group, percent: u8) -> u16 {
        let (off, on) = self.ends(group);
        let percent = i64::from(percent.min(100));
        (i64::from(off) + (i64::from(on) - i64::from(off)) * percent / 100) as u16
    }

    /// Returns VALUE for 0 % and for 100 % (p. 89, 91).
    fn ends(self, group: Group) -> (u16, u16) {
        match group {
            Group::Down => (self.reload, 0),
            Group::Up => (0xFFFF, self.reload),
        }
    }

    /// Returns the duty cycle of an output with this VALUE, in 0.01 %. If the value is outside the range, the
    /// nearer limit is used.
    fn duty(self, group: Group, value: u16) -> u32 {
        let (off, on) = self.ends(group);
        let value = value.clamp(off.min(on), off.max(on));
        u32::from(off.abs_diff(value)) * 10_000 / u32::from(off.abs_diff(on)).max(1)
    }
}

/// Function that has initialised a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Function {
    Pwm,
    Pwm100,
}

/// Mistakes in an initialisation. The initialisation still takes effect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Misuse {
    /// True if a program uses both `PWM` and `PWM100` for channels 4 to 7.
    pub is_mixed: bool,
    /// True if the frequency differs from the present frequency of channels 4 to 7.
    pub has_other_frequency: bool,
    /// True if the outputs cannot follow the frequency.
    pub is_too_fast: bool,
}

/// The PWM of a controller. Channels are 0 to 7.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Pwm {
    down: [Option<PwmCounter>; GROUP],
    up: Option<(Function, PwmCounter)>,
    values: [u16; CHANNELS],
}

impl Pwm {
    /// Handles `PWM` with INIT (p. 92). From now on the channel has 0 %, and all outputs of its group are PWM
    /// outputs.
    pub(crate) fn init(&mut self, channel: u8, reload: u16, is_divided: bool) -> Misuse {
        let channel = usize::from(channel);
        self.start(channel, Function::Pwm, PwmCounter::new(Group::of(channel), reload, is_divided))
    }

    /// Handles `PWM100` with INIT (p. 94). The frequency is in Hz.
    pub(crate) fn init_hz(&mut self, channel: u8, hz: u16) -> Misuse {
        let channel = usize::from(channel);
        self.start(channel, Function::Pwm100, PwmCounter::of_hz(Group::of(channel), hz))
    }

    fn start(&mut self, channel: usize, function: Function, clock: PwmCounter) -> Misuse {
        let group = Group::of(channel);
        let mut misuse = Misuse { is_too_fast: clock.hz(group) > USEFUL_HZ, ..Misuse::default() };
        match (group, self.down.get_mut(channel)) {
            (Group::Down, Some(own)) => *own = Some(clock),
            _ => match self.up.replace((function, clock)) {
                Some((before, known)) => {
                    misuse.is_mixed = before != function;
                    misuse.has_other_frequency = known != clock;
                }
                None => self.values[GROUP..].fill(0xFFFF),
            },
        }
        (self.values[channel], _) = clock.ends(group);
        misuse
    }

    fn clock(&self, channel: usize) -> Option<PwmCounter> {
        match Group::of(channel) {
            Group::Down => self.down[channel],
            Group::Up => self.up.map(|(_, clock)| clock),
        }
    }

    /// Changes the ratio of a channel: block `PWM` with input CHANGE (CS0015 p. 92). Has no effect until the
    /// channel's group is initialised.
    pub(crate) fn set(&mut self, channel: u8, value: u16) {
        self.put(channel.into(), |_, _| value);
    }

    /// Changes the ratio in percent: block `PWM100` with input CHANGE (CS0015 p. 94). A value above 100
    /// counts as 100.
    pub(crate) fn set_percent(&mut self, channel: u8, percent: u8) {
        self.put(channel.into(), |clock, group| clock.value(group, percent));
    }

    fn put(&mut self, channel: usize, value: impl FnOnce(PwmCounter, Group) -> u16) {
        if let Some(clock) = self.clock(channel) {
            self.values[channel] = value(clock, Group::of(channel));
        }
    }

    /// Returns the PWM outputs, bit n for output n. After the initialisation of one output, all four outputs of its
    /// group are PWM outputs (p. 91) until the supply is switched off.
    pub(crate) fn outputs(&self) -> u16 {
        let down = if self.down.iter().any(Option::is_some) { 0x0F } else { 0 };
        down | if self.up.is_some() { 0xF0 } else { 0 }
    }

    /// Returns the PWM outputs with a duty cycle above 0.
    pub(crate) fn on(&self) -> u16 {
        (0..CHANNELS).filter(|channel| self.duty(*channel) != 0).fold(0, |on, channel| on | 1 << channel)
    }

    /// Returns the duty cycle of a channel, in 0.01 %.
    pub(crate) fn duty(&self, channel: usize) -> u32 {
        self.clock(channel).map_or(0, |clock| clock.duty(Group::of(channel), self.values[channel]))
    }

    /// Returns the frequency of a channel in Hz; 0 until its initialisation.
    pub(crate) fn hz(&self, channel: usize) -> u32 {
        self.clock(channel).map_or(0, |clock| clock.hz(Group::of(channel)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Manual p. 88-89.
    #[test]
    fn channels_0_to_3_count_down_from_reload() {
        let mut pwm = Pwm::default();
        assert_eq!(pwm.init(0, 50_000, false), Misuse::default());
        assert_eq!((pwm.hz(0), pwm.duty(0)), (200, 0));
        for (value, duty) in [(0xC350, 0), (0, 10_000), (25_000, 5_000), (0xFFFF, 0)] {
            pwm.set(0, value);
            assert_eq!(pwm.duty(0), duty, "{value:04X}");
        }
        let others = [pwm.init(1, 1_562, true), pwm.init_hz(2, 200), pwm.init_hz(3, 100)];
        assert_eq!(others, [Misuse::default(); 3], "each channel has its own frequency");
        assert_eq!([0, 1, 2, 3].map(|channel| pwm.hz(channel)), [200, 100, 200, 100]);
        pwm.set_percent(3, 70);
        assert_eq!((pwm.duty(3), pwm.outputs(), pwm.on()), (6_997, 0x0F, 0x08));
    }

    /// Manual p. 90-91.
    #[test]
    fn channels_4_to_7_count_up_and_have_one_frequency() {
        let mut pwm = Pwm::default();
        assert_eq!(pwm.init(4, 0xCF2C, false), Misuse::default());
        assert_eq!((pwm.hz(4), pwm.init(5, 0xCF2C, false)), (200, Misuse::default()));
        for (value, duty) in [(0xFFFF, 0), (0xCF2C, 10_000), (0, 10_000)] {
            pwm.set(4, value);
            assert_eq!(pwm.duty(4), duty, "{value:04X}");
        }
        assert_eq!((pwm.outputs(), pwm.on()), (0xF0, 0x10));
        let other = Misuse { is_mixed: true, has_other_frequency: true, is_too_fast: false };
        assert_eq!(pwm.init_hz(7, 100), other);
        assert_eq!([4, 5, 6, 7].map(|channel| pwm.hz(channel)), [100; 4]);
        assert_eq!((pwm.duty(5), pwm.duty(7)), (0, 0));
    }

    /// Manual p. 88, 90-92, 94.
    #[test]
    fn frequencies_are_limited() {
        let mut pwm = Pwm::default();
        for (channel, reload, is_divided, hz) in
            [(0, 1, false, 10_000), (0, 0, true, 9_766), (4, 0xFFFF, false, 10_000), (4, 0, true, 2)]
        {
            assert_eq!(pwm.init(channel, reload, is_divided).is_too_fast, hz > 200);
            assert_eq!(pwm.hz(usize::from(channel)), hz, "{channel} {reload}");
        }
        for (channel, hz) in [(0, 151), (0, 153), (4, 38), (4, 40)] {
            pwm.init_hz(channel, hz);
            assert_eq!(pwm.hz(usize::from(channel)), u32::from(hz));
        }
        pwm.init_hz(0, 20_000);
        pwm.init_hz(4, 0);
        assert_eq!((pwm.hz(0), pwm.hz(4)), (10_000, 2));
    }

    #[test]
    fn no_output_is_driven_before_its_initialisation() {
        let mut pwm = Pwm::default();
        pwm.set(1, 0);
        pwm.set_percent(4, 100);
        assert_eq!((pwm.outputs(), pwm.on()), (0, 0));
        pwm.init(1, 50_000, false);
        pwm.set(2, 0);
        assert_eq!((pwm.outputs(), pwm.on()), (0x0F, 0));
    }
}
