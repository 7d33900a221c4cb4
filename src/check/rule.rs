//! The rules, as data: what a PLC program may do wrong, how bad it is, and where that is written.

use core::fmt;

/// How bad it is to break a rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Severity {
    /// The manual forbids it, or it cannot have the effect that was wanted.
    Error,
    /// Allowed or without effect, but hardly what was meant.
    Warning,
}

impl Severity {
    /// `error` or `warning`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Severity::Error => "error",
            Severity::Warning => "warning",
        }
    }
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

macro_rules! rules {
    ($($variant:ident: $id:literal, $severity:ident, $source:literal, $text:literal;)+) => {
        /// A rule of the access checker.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum Rule {
            $(#[doc = $text] $variant,)+
        }

        impl Rule {
            /// All rules, in the order in which they are listed.
            pub const ALL: &'static [Rule] = &[$(Rule::$variant),+];

            /// Name by which people refer to the rule.
            #[must_use]
            pub const fn id(self) -> &'static str {
                match self { $(Rule::$variant => $id,)+ }
            }

            /// How bad it is.
            #[must_use]
            pub const fn severity(self) -> Severity {
                match self { $(Rule::$variant => Severity::$severity,)+ }
            }

            /// What the PLC program did, and what would be right.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self { $(Rule::$variant => $text,)+ }
            }

            /// Pages of manual 5.00005.03a, or a decision of the project.
            #[must_use]
            pub const fn source(self) -> &'static str {
                match self { $(Rule::$variant => $source,)+ }
            }
        }
    };
}

rules! {
    Owner: "owner", Error, "p. 147-193, D-17",
        "A register that only the firmware writes was written; the firmware will overwrite it. Only read it.";
    ReservedRegister: "reserved-register", Error, "p. 151-190, D-91",
        "A reserved register was written. Leave it at 0.";
    ReservedBit: "reserved-bit", Error, "p. 88, 152, 156, 164, 177, 180, 184",
        "A reserved bit was set. Leave it at 0.";
    ReservedValue: "reserved-value", Warning, "p. 88, 149, 163, 196",
        "A register was given a value that is reserved. Use one of the values that the manual gives a meaning.";
    ValueNumber: "value-number", Error, "p. 153, 158, 178, 181, 184",
        "A word of a frame is assigned to a value number above 7. Only the values 0 to 7 exist.";
    WordUnassigned: "word-unassigned", Warning, "p. 152, 157, 177, 180, 184",
        "A word of a frame names a value, but its bit 0 (assigned) is not set. Set bit 0, or write 16#00 for a word \
         that is not used.";
    SplitDoubleword: "split-doubleword", Warning, "p. 153, 158, 178, 181",
        "Low and high word of one value travel in different frames, so they may belong to different moments. Put \
         both into one frame.";
    SlaveNumber: "slave-number", Error, "p. 154, 160, 167",
        "A slave number above 31. Use 0 to 31, or 16#80 (automatic) where that is possible.";
    NeverPolled: "never-polled", Error, "p. 160, D-08",
        "A job was entered for a slave above b_MAX_SL_NR while slaves are polled automatically, so it is never \
         sent. Raise b_MAX_SL_NR or name the slave in the polling register.";
    NotRequested: "not-requested", Warning, "p. 154, 159",
        "Actual values are requested automatically, but a slave expected in a_SL_TYP lies above b_MAX_SL_NR and is \
         never asked. Set b_MAX_SL_NR to the highest slave number.";
    Command: "command", Error, "p. 149-150, 174-175, D-05",
        "w_CPU_CONTROL was given a command that does not exist or is not possible in this state. Wait for the \
         value of w_OPTION_STATUS that comes before it.";
    LeftBehind: "left-behind", Warning, "p. 149-150, 174-175, D-29",
        "Bit 7 was written to w_CPU_CONTROL with no other bit, and clearing it leaves 16#0000. That is no restart, but one \
         stored over it in the RAM cannot be seen. Write bit 7 together with the bits that stand there: 16#00C0 in active \
         operation.";
    Order: "order", Error, "p. 165, 167, 189, 191",
        "The control register of a job was written before its status register. Write the status register first, \
         then the control register, both with the same value.";
    JobChanged: "job-changed", Error, "p. 165, 167, D-48",
        "A register of a job was changed while the job was under way. Wait until bit 0 (active) is clear, or end \
         the job first.";
    JobReplaced: "job-replaced", Warning, "p. 165, 167, D-48",
        "A job was entered while the former one was still under way; that one is forgotten. Wait until bit 0 \
         (active) is clear, or clear it and let the firmware see it.";
    LateReference: "late-reference", Error, "p. 153-154, D-09, D-142",
        "Reference values were released with 16#05 after their deadline, so their frame was left out in this \
         interval. Release them earlier in the event task, or one interval ahead.";
    LateActual: "late-actual", Error, "p. 181-182, D-26, D-142",
        "Own actual values were released with 16#05 after their deadline, so their frame was left out in this \
         interval. Release them earlier in the event task, or one interval ahead.";
    InitMode: "init-mode", Error, "p. 149, 174, D-12",
        "b_MA_SL_MODE does not fit the node. Write 16#00 (or 16#02 to pass SYNC on) on node 2, 16#01 on node 1.";
    InitBaudRate: "init-baud-rate", Error, "p. 125, 149",
        "b_BT_0 and b_BT_1 give no baud rate of CANsync. Write 16#00, 16#1C for 500 kbit/s, 16#01, 16#1C for 250 or \
         16#03, 16#1C for 125.";
    InitInterval: "init-interval", Error, "p. 125, 149",
        "b_TIME_PATTERN does not belong to the baud rate. Write 2 ms at 500 kbit/s, 4 at 250, 8 at 125.";
    InitController: "init-controller", Warning, "p. 149, 174",
        "b_OUTPUT_CONTROL or b_CLOCK_DIVIDER is not what the controller needs. Write 16#FA and 16#07.";
    BusBaudRate: "bus-baud-rate", Error, "p. 125",
        "The node was started with another baud rate than its bus runs at and hears nothing. Give all nodes of a \
         bus the same b_BT_0.";
    ClusterBaudRate: "cluster-baud-rate", Error, "p. 122-125, D-282",
        "Node 2 passes on the SYNC signal of a bus at another baud rate, so no slave of it ever synchronizes. Give all \
         buses of a cluster the same b_BT_0 and b_TIME_PATTERN.";
    BeforeInit: "before-init", Error, "p. 145, D-03",
        "A register behind the initialization structure was written before the initialization data were taken \
         over, which clears it. Wait for w_OPTION_STATUS 16#0003 first.";
    AfterInit: "after-init", Error, "p. 145, D-02, D-03",
        "A register of the initialization structure was written after the data had been taken over: it has no \
         effect and hits a reserved register. Restart the node with 16#0000 to initialize it anew.";
    IpAddress: "ip-address", Error, "p. 79-80, D-190",
        "An IP address that ends in 0 or 255, by itself or with the DIP number added, was stored by writing d_IP_CONFIG; \
         the firmware put the old configuration back. Choose a last byte from 1 to 254, from which the DIP number stays \
         below 255.";
    BapsEarly: "baps-early", Error, "p. 63, D-313",
        "The BAPS was configured in a start task or in one of the first five cycles of the PLC program. Enable BAPS_INIT \
         in the cyclic task, not before its sixth cycle.";
    BapsRunning: "baps-running", Error, "p. 90, D-312",
        "The BAPS was configured anew while process data were being exchanged. Stop calling BAPS_PD_COMMxx and let one \
         communication pass without it first, or change the parameter numbers with us_MODE 2.";
    BapsCycle: "baps-cycle", Warning, "p. 88, 100, D-311",
        "w_COMMAND_REG of an exchange is another one than before, so method or cycle time change while process data \
         run. Connect the same value to BAPS_INIT and BAPS_PD_COMMxx.";
    BapsSyncSlot: "baps-sync-slot", Error, "p. 89",
        "The SYNC slot of the drive (P167) is not the time between two communications, although the drive is triggered or \
         follows synchronous reference positions. Set P167 to t_cycK in microseconds.";
    Header: "header", Error, "docs/attach.md",
        "A field of the header page that belongs to the emulator was written. Only read it.";
    DriveSyncSlot: "drive-sync-slot", Error, "5.01010.01 p. 13, D-291",
        "The SYNC slot (P167) of a drive does not belong to the baud rate of its bus, so the drive never locks. Set P167 to 1000 \
         at 1000 kbit/s, 2000 at 500, 4000 at 250, 8000 at 125.";
    DrivePwm: "drive-pwm", Warning, "p. 74 (inferred), D-292",
        "The PWM frequency (P103) of a drive is none of the two that the table of the masks over P258 knows. Set it to 4 or \
         8 kHz.";
}

impl Rule {
    /// The rule of this number, as it travels through journal and channel.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Rule> {
        Rule::ALL.get(usize::from(number)).copied()
    }

    /// The rule with this name.
    #[must_use]
    pub fn from_id(id: &str) -> Option<Rule> {
        Rule::ALL.iter().copied().find(|rule| rule.id() == id)
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.id())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_lead_back_to_their_rule() {
        for (number, &rule) in Rule::ALL.iter().enumerate() {
            assert_eq!(Rule::from_number(number as u8), Some(rule));
            assert_eq!(Rule::from_id(rule.id()), Some(rule), "{rule} has its name alone");
        }
        assert_eq!(Rule::from_number(Rule::ALL.len() as u8), None);
    }

    #[test]
    fn every_rule_says_what_would_be_right_in_full_sentences() {
        for rule in Rule::ALL {
            let text = rule.text();
            assert!(text.ends_with('.') && text.matches(". ").count() >= 1, "{rule}: {text}");
            assert!(rule.id().bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'-'), "{rule}");
        }
    }

    /// The page for users lists every rule, letter for letter, and no other.
    #[test]
    fn the_documentation_lists_exactly_these_rules() {
        let page = include_str!("../../docs/checker.md");
        let rows: Vec<_> = page.lines().filter(|line| line.starts_with("| `")).collect();
        let expected: Vec<_> = Rule::ALL
            .iter()
            .map(|rule| format!("| `{rule}` | {} | {} | {} |", rule.severity(), rule.text(), rule.source()))
            .collect();
        assert_eq!(rows, expected);
    }
}
