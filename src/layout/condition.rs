//! Conditions on registers: `node2.w_OPTION_STATUS==16#0043`, `node2.a_STAT_SL[1] & 2 != 0`, `node2.a_RD_VALUE[1][0] <
//! -5`.

use super::Width;
use super::place::{BadValue, NamedLocation};
use thiserror::Error;

/// The comparison of a register's content with a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Compare {
    /// `==`
    Equal,
    /// `!=`
    NotEqual,
    /// `<`
    Less,
    /// `<=`
    LessOrEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterOrEqual,
}

impl Compare {
    /// All comparisons. Requests of the channel name a comparison by its position in this list.
    pub const ALL: [Self; 6] =
        [Self::Equal, Self::NotEqual, Self::Less, Self::LessOrEqual, Self::Greater, Self::GreaterOrEqual];

    /// Notations of the comparisons. A parser tries them in this order, so `<=` must come before `<`.
    const WRITTEN: [(&'static str, Self); 7] = [
        ("==", Self::Equal),
        ("!=", Self::NotEqual),
        ("<>", Self::NotEqual),
        ("<=", Self::LessOrEqual),
        (">=", Self::GreaterOrEqual),
        ("<", Self::Less),
        (">", Self::Greater),
    ];

    /// Returns words for messages that precede the value, for example `other than `, `less than `; empty for equality.
    #[must_use]
    pub const fn than(self) -> &'static str {
        match self {
            Self::Equal => "",
            Self::NotEqual => "other than ",
            Self::Less => "less than ",
            Self::LessOrEqual => "at most ",
            Self::Greater => "greater than ",
            Self::GreaterOrEqual => "at least ",
        }
    }
}

/// A condition on the content of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Test {
    /// Mask of the compared bits.
    pub mask: u32,
    /// Comparison between the register and the value.
    pub compare: Compare,
    /// True if the compared bits are the two's complement of a number with a sign.
    pub is_signed: bool,
    /// The value to compare with.
    pub value: u32,
}

impl Test {
    /// Returns the condition that a register of this width equals `value`.
    #[must_use]
    pub const fn equal(width: Width, value: u32) -> Self {
        Self { mask: width.max_value(), compare: Compare::Equal, is_signed: false, value }
    }

    /// True if the condition holds for a register of this width with the value `found`.
    #[must_use]
    pub fn holds(self, width: Width, found: u32) -> bool {
        let unused = 32 - 8 * width.bytes();
        // Shifts the number up, so that its sign bit becomes the sign bit of the i32.
        let number = |bits: u32| match self.is_signed {
            true => i64::from((bits << unused) as i32),
            false => i64::from(bits),
        };
        let (found, value) = (number(found & self.mask), number(self.value));
        match self.compare {
            Compare::Equal => found == value,
            Compare::NotEqual => found != value,
            Compare::Less => found < value,
            Compare::LessOrEqual => found <= value,
            Compare::Greater => found > value,
            Compare::GreaterOrEqual => found >= value,
        }
    }

    /// True if `value` has bits outside the mask that make the condition always true or always false.
    #[must_use]
    pub const fn is_decided(self) -> bool {
        matches!(self.compare, Compare::Equal | Compare::NotEqual) && self.value & !self.mask != 0
    }
}

/// A register and a condition on its content.
#[derive(Clone, Debug)]
pub struct Condition {
    /// Register that the condition compares.
    pub place: NamedLocation,
    /// The condition on the content.
    pub test: Test,
    /// Description of the awaited content, in words that can follow "did not become": `less than 16#05`, `16#80 under
    /// mask 16#80`.
    pub wanted: String,
}

/// An error in a condition. `E` is the type of errors in the name of the register.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum ConditionError<E> {
    /// There is no such register.
    #[error(transparent)]
    Register(E),
    /// The register cannot hold the value.
    #[error(transparent)]
    Value(#[from] BadValue),
    /// The text is not a condition, or has no effect.
    #[error("`{text}`: {right}")]
    Notation {
        /// Text that should be a condition.
        text: String,
        /// Description or example of a correct condition.
        right: &'static str,
    },
}

impl Condition {
    /// Parses `REG==VALUE` or `REG&MASK==VALUE`. The comparison is `==`, `!=` (or `<>`), `<`, `<=`, `>` or `>=`.
    /// `place` looks up the register. Registers of signed types are compared as signed numbers, except if the condition
    /// has a mask.
    ///
    /// # Errors
    /// The notation, the register or the value is wrong.
    pub fn parse<E>(
        text: &str,
        place: impl FnOnce(&str) -> Result<NamedLocation, E>,
    ) -> Result<Self, ConditionError<E>> {
        let wrong = |right| ConditionError::Notation { text: text.to_owned(), right };
        let example = "write REG==VALUE or REG&MASK==VALUE, for example node2.w_OPTION_STATUS==16#0043; there are also \
                       !=, <, <=, > and >=";
        let at = text.find(['=', '!', '<', '>']).ok_or_else(|| wrong(example))?;
        let (left, right) = text.split_at(at);
        let found = Compare::WRITTEN.iter().find_map(|(sign, it)| Some((*it, right.strip_prefix(sign)?)));
        let (compare, value) = found.ok_or_else(|| wrong(example))?;
        let (register, mask) = match left.split_once('&') {
            Some((register, mask)) => (register, Some(mask)),
            None => (left, None),
        };
        let place = place(register.trim()).map_err(ConditionError::Register)?;
        let given = if mask.is_some() { place.parse_pattern(value)? } else { place.parse_value(value)? };
        let shown = |value| format!("{}{}", compare.than(), place.format(place.last_phase(), value));
        let is_order = !matches!(compare, Compare::Equal | Compare::NotEqual);
        let (mask, is_signed, value, wanted) = match (place.bit(), mask) {
            (Some(_), _) if is_order => {
                return Err(wrong("a single bit is 0 or 1; it can be == or != to one of them"));
            }
            (Some(_), Some(_)) => return Err(wrong("a single bit needs no mask")),
            (Some(bit), None) => (1 << bit, false, given << bit, format!("{}{given}", compare.than())),
            (None, Some(mask)) => {
                let mask = place.parse_pattern(mask)?;
                let under = place.format(place.last_phase(), mask);
                (mask, false, given, format!("{} under mask {under}", shown(given)))
            }
            (None, None) => {
                (place.width().max_value(), place.ty(place.last_phase()).is_signed(), given, shown(given))
            }
        };
        let test = Test { mask, compare, is_signed, value };
        if test.is_decided() {
            return Err(wrong(match compare {
                Compare::NotEqual => "the value has bits outside the mask, so this always holds",
                _ => "the value has bits outside the mask, so this can never be",
            }));
        }
        Ok(Self { place, test, wanted })
    }

    /// True if the condition holds for a register with the value `found`.
    #[must_use]
    pub fn holds(&self, found: u32) -> bool {
        self.test.holds(self.place.width(), found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;
    use crate::layout::{DeviceFit, LayoutError};

    fn parse(text: &str) -> Result<Condition, ConditionError<LayoutError>> {
        Condition::parse(text, |name| NamedLocation::parse(&DeviceFit::unknown(&DEVICE), name))
    }

    #[test]
    fn a_condition_is_a_register_a_sign_and_a_value() {
        let parsed =
            |text: &str| parse(text).map(|it| (it.test.mask, it.test.compare, it.test.value)).unwrap();
        assert_eq!(parsed("node2.w_OPTION_STATUS==16#0043"), (0xFFFF, Compare::Equal, 0x43));
        assert_eq!(parsed("node2.w_OPTION_STATUS & 16#80 != 16#80"), (0x80, Compare::NotEqual, 0x80));
        assert_eq!(parsed("node2.w_OPTION_STATUS <> MASTER_ACTIVE"), (0xFFFF, Compare::NotEqual, 0x80));
        assert_eq!(parsed("%MX3.200004.2==1"), (4, Compare::Equal, 4));
        assert_eq!(parsed("node2.w_CPU_CONTROL.2==0"), (4, Compare::Equal, 0));
        assert_eq!(parsed("node2.w_CPU_CONTROL.10!=0"), (4, Compare::NotEqual, 0));
        for (sign, compare) in [
            ("<", Compare::Less),
            ("<=", Compare::LessOrEqual),
            (">", Compare::Greater),
            (">=", Compare::GreaterOrEqual),
        ] {
            assert_eq!(parsed(&format!("node2.w_OPTION_STATUS{sign}5")), (0xFFFF, compare, 5));
        }
    }

    #[test]
    fn numbers_with_a_sign_are_compared_as_such() {
        let less = parse("node2.a_RD_BMARRAY[1][0] < -1").unwrap();
        assert_eq!(
            [0xFFFF_FFFE, 0xFFFF_FFFF, 0, 0x7FFF_FFFF].map(|it| less.holds(it)),
            [true, false, false, false]
        );
        let word = parse("node2.w_OPTION_STATUS > 16#7FFF").unwrap();
        assert_eq!([0x7FFF, 0x8000, 0xFFFF].map(|it| word.holds(it)), [false, true, true]);
        let short = Test { mask: 0xFF, compare: Compare::GreaterOrEqual, is_signed: true, value: 0xFE };
        assert_eq!(
            [0x80, 0xFD, 0xFE, 0xFF, 0, 0x7F].map(|it| short.holds(Width::Byte, it)),
            [false, false, true, true, true, true]
        );
    }

    #[test]
    fn only_the_bits_of_the_mask_count() {
        let set = parse("node2.w_OPTION_STATUS&3==2").unwrap();
        assert_eq!([2, 6, 3, 0].map(|it| set.holds(it)), [true, true, false, false]);
        let not = parse("node2.w_OPTION_STATUS&3!=2").unwrap();
        assert_eq!([2, 6, 3, 0].map(|it| not.holds(it)), [false, false, true, true]);
    }

    /// A mask and the value under it are bits, not numbers with a sign.
    #[test]
    fn a_mask_can_have_every_bit_of_a_register_with_a_sign() {
        let parsed =
            |text| parse(text).map(|it| (it.test.mask, it.test.value)).map_err(|error| error.to_string());
        assert_eq!(parsed("node2.i_SW1_NR&32768==32768"), Ok((0x8000, 0x8000)));
        assert_eq!(parsed("node2.i_SW1_NR & 65535 != 65535"), Ok((0xFFFF, 0xFFFF)));
        assert_eq!(parsed("node2.i_SW1_NR&-1==-2"), Ok((0xFFFF, 0xFFFE)));
        assert_eq!(parsed("node2.a_RD_BMARRAY[1][0]&4294967295==2147483648"), Ok((u32::MAX, 1 << 31)));
        let range = "`65536` is out of range, a WORD holds 0 to 65535 (16#0 to 16#FFFF)";
        assert!(parsed("node2.i_SW1_NR&65536==0").unwrap_err().ends_with(range));
        // Without a mask, the value is a number of the type.
        assert!(parsed("node2.i_SW1_NR==32768").unwrap_err().contains("an INT holds -32768 to 32767"));
    }

    #[test]
    fn the_awaited_text_can_follow_did_not_become() {
        let wanted = |text| parse(text).unwrap().wanted;
        assert_eq!(wanted("node2.w_OPTION_STATUS==16#43"), "16#0043");
        assert_eq!(wanted("node2.w_OPTION_STATUS!=16#43"), "other than 16#0043");
        assert_eq!(wanted("node2.w_OPTION_STATUS&3<=2"), "at most 16#0002 under mask 16#0003");
        assert_eq!(wanted("%MX3.200004.2!=1"), "other than 1");
    }

    #[test]
    fn mistakes_are_explained() {
        let message = |text| parse(text).err().unwrap().to_string();
        assert!(message("node2.w_OPTION_STATUS=1").contains("write REG==VALUE"));
        assert!(message("node2.w_OPTION_STATUS").contains("write REG==VALUE"));
        assert!(message("node2.w_OPTION_STATUS&1==2").contains("can never be"));
        assert!(message("node2.w_OPTION_STATUS&1!=2").contains("always holds"));
        assert!(message("%MX3.200004.2&1==1").contains("needs no mask"));
        assert!(message("%MX3.200004.2<1").contains("0 or 1"));
        assert!(message("node2.w_OPTION_STATUS===1").contains("is no number"));
        assert!(message("node2.w_OPTION_STATUS==SLAVE_ACTIV").contains("did you mean slave_active?"));
        assert!(message("node2.w_OPTION_STAT==1").contains("did you mean w_OPTION_STATUS?"));
    }
}
