//! Values as text: IEC notation and meaning.

use super::descriptor::{BitField, Meaning, Provenance, RegType, ValueMeaning};

/// Text that follows a value without a meaning in the manual.
const NO_MEANING: &str = "no meaning";

/// Formats `value` in IEC notation with all digits of the type: `16#0043` for a WORD.
#[must_use]
pub fn format_value(ty: RegType, value: u32) -> String {
    format!("16#{:0digits$X}", value & ty.mask(), digits = 2 * ty.width() as usize)
}

/// Returns the meaning of `value` in a register of type `ty`. For a plain number, returns the number. If the meaning is
/// inferred, the number of the decision follows it: `SYNC mode (D-06)`.
pub(super) fn decode(ty: RegType, meaning: Option<&'static Meaning>, value: u32) -> String {
    let value = value & ty.mask();
    let Some(meaning) = meaning else {
        return ty.number(value).to_string();
    };
    if let Some(known) = meaning.value(value) {
        return known.text_for(value);
    }
    if meaning.bits.is_empty() {
        return NO_MEANING.to_owned();
    }
    let mut text = Text::default();
    let mut described = 0;
    for field in meaning.bits {
        described |= field.mask();
        let (part, source) = describe(field, value);
        text.add(&part, field.joined, source.decision());
    }
    let rest = value & !described;
    if rest != 0 {
        text.add(&format!("bits {} have no meaning", format_value(ty, rest)), false, None);
    }
    text.finish()
}

/// Returns the value with the meaning `text`, for example `operation enabled, warning (D-06)`. This is the reverse of
/// [`decode`]. Case and references to decisions are ignored. `None` if no value or more than one value has this
/// meaning.
pub(super) fn value_of(meaning: &'static Meaning, text: &str) -> Option<u32> {
    let text = without_decisions(text);
    if text.is_empty() {
        return None;
    }
    let whole = meaning.values.iter().flat_map(|known| {
        let values = known.first..=known.last.min(known.first.saturating_add(MOST_TRIED));
        values.filter(|value| known.text.replace("{}", &value.to_string()).eq_ignore_ascii_case(&text))
    });
    let mut found: Vec<u32> = whole.take(2).collect();
    if found.is_empty() {
        add_fields(meaning.bits, &text, &Text::default(), 0, &mut found);
        // A meaning of the whole value has priority over meanings of its bits.
        found.retain(|value| meaning.value(*value).is_none());
    }
    match found.as_slice() {
        [value] => Some(*value),
        _ => None,
    }
}

/// Maximum number of values of a range or a field that are compared with a text.
const MOST_TRIED: u32 = 0xFFFF;

/// Collects the values with the description `text`. `begun` is the description of the fields so far; `fields` are the
/// remaining fields.
fn add_fields(fields: &'static [BitField], text: &str, begun: &Text, value: u32, found: &mut Vec<u32>) {
    let Some((field, rest)) = fields.split_first() else {
        if begun.text.eq_ignore_ascii_case(text) {
            found.push(value);
        }
        return;
    };
    let last = (field.mask() >> field.first).min(MOST_TRIED);
    for part in 0..=if field.reserved { 0 } else { last } {
        let (words, _) = describe(field, part << field.first);
        let mut begun = begun.clone();
        // References to decisions are not compared.
        begun.add(&words, field.joined, None);
        let is_front =
            text.get(..begun.text.len()).is_some_and(|front| front.eq_ignore_ascii_case(&begun.text));
        if is_front && found.len() < 2 {
            add_fields(rest, text, &begun, value | part << field.first, found);
        }
    }
}

/// Removes the references to decisions: ` (D-06)`.
fn without_decisions(text: &str) -> String {
    let mut parts = text.trim().split(" (D-");
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        match part.split_once(')') {
            Some((number, rest)) if number.bytes().all(|digit| digit.is_ascii_digit()) => kept.push_str(rest),
            _ => kept.push_str(&format!(" (D-{part}")),
        }
    }
    kept
}

/// Returns the meaning of bit `bit` alone; empty if it is not known.
pub(super) fn decode_bit(meaning: Option<&'static Meaning>, bit: u32, is_set: bool) -> String {
    let fields = meaning.map_or(&[][..], |meaning| meaning.bits);
    let single = |field: &&BitField| field.first == field.last && u32::from(field.first) == bit;
    let Some(field) = fields.iter().find(single) else { return String::new() };
    let (part, source) = describe(field, u32::from(is_set) << bit);
    let mut text = Text::default();
    text.add(&part, false, source.decision());
    text.finish()
}

/// A text that consists of parts. If adjacent parts are based on the same decision, the decision is named once, after
/// the last of these parts.
#[derive(Default, Clone)]
struct Text {
    text: String,
    decision: Option<&'static str>,
}

impl Text {
    fn add(&mut self, part: &str, joined: bool, decision: Option<&'static str>) {
        if part.is_empty() {
            return;
        }
        if decision != self.decision {
            self.name_decision();
            self.decision = decision;
        }
        if !self.text.is_empty() {
            self.text.push_str(if joined { " " } else { ", " });
        }
        self.text.push_str(part);
    }

    fn name_decision(&mut self) {
        if let Some(decision) = self.decision.take() {
            self.text += &format!(" ({decision})");
        }
    }

    fn finish(mut self) -> String {
        self.name_decision();
        self.text
    }
}

/// Returns a description of the field's bits of `value`, and the source of the description.
fn describe(field: &'static BitField, value: u32) -> (String, Provenance) {
    let part = field.of(value);
    let text = if field.reserved {
        if part == 0 { String::new() } else { reserved(field, part << field.first) }
    } else if let Some(known) = ValueMeaning::find(field.values, part) {
        return (known.text.replace("{}", &part.to_string()), known.source);
    } else if field.first == field.last {
        (if part == 0 { field.zero } else { field.one }).to_owned()
    } else {
        field.text.replace("{}", &part.to_string())
    };
    (text, field.source)
}

/// Names the reserved bits that are set, with all digits of the bytes up to the field's last bit.
fn reserved(field: &BitField, bits: u32) -> String {
    let plural = if bits.is_power_of_two() { "" } else { "s" };
    format!("reserved bit{plural} 16#{bits:0digits$X} set", digits = 2 * (field.last as usize / 8 + 1))
}

#[cfg(test)]
mod tests {
    use crate::devices::samples::tables::NODES as DEVICE;

    fn decode(name: &str, value: u32) -> String {
        DEVICE.register(name).unwrap().decode(value)
    }

    #[test]
    fn states_and_commands_are_distinguished() {
        let status = "node2.w_OPTION_STATUS";
        assert_eq!(decode(status, 0x0043), "synchronous operation of the master is being set up");
        assert_eq!(decode(status, 0x0020), "synchronous operation of the slave is active");
        assert_eq!(decode(status, 0x0044), "no meaning");
        let command = "node2.w_CPU_CONTROL";
        assert_eq!(decode(command, 0x0020), "start synchronous operation");
        assert_eq!(decode(command, 0x0040), "enable active operation");
        assert_eq!(decode(command, 0x00C0), "enable active operation, reset CAN controller");
        assert_eq!(decode(command, 0x0041), "enable active operation, bits 16#0001 have no meaning");
    }

    #[test]
    fn a_bit_alone_has_its_meaning_too() {
        let bit = |name: &str, bit, is_set| DEVICE.register(name).unwrap().decode_bit(bit, is_set);
        assert_eq!(bit("node2.w_CPU_CONTROL", 7, true), "reset CAN controller");
        assert_eq!(bit("node2.w_CPU_CONTROL", 7, false), "");
        assert_eq!(bit("node2.w_OPTION_STATUS", 2, true), "", "only the whole has a meaning");
    }

    #[test]
    fn a_number_is_shown_as_a_number() {
        let value = "node2.a_DATA_PARAMETER[3].d_PAR_VALUE";
        assert_eq!(
            [0, 4000, 0xFFF8, 0x8000_0000].map(|n| decode(value, n)),
            ["0", "4000", "65528", "2147483648"]
        );
        assert_eq!(decode(value, 0xFFFB), "65531; with the error bit set: not present");
        assert_eq!(decode("node2.d_BASE_ADR_UPDOWNBLK1", 0x1000), "4096");
    }

    #[test]
    fn mapping_bytes_read_as_the_manual_explains_them() {
        // 16#0D: manual p. 153, 157, 177, 180, 185.
        for name in [
            "node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0",
            "node2.a_CFG_RDC_WORD[0].b_CFG_RDC1_WORD0",
            "node1._CFG_WRC_WORD.b_CFG_WRC1_WORD0",
            "node1._CFG_RDC_WORD.b_CFG_RDC1_WORD0",
        ] {
            assert_eq!(decode(name, 0x0D), "assigned, low word of value 3");
            assert_eq!(decode(name, 0x00), "word not used");
        }
        assert_eq!(decode("node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0", 0x7F), "assigned, high word of value 31");
        assert_eq!(
            decode("node1._CFG_WRC_WORD.b_CFG_WRC1_WORD0", 0x5F),
            "assigned, high word of value 7, reserved bit 16#40 set"
        );
    }

    #[test]
    fn job_registers_show_progress() {
        let master = "node2.a_CTRLREG_PAR_CMD_SL[3].b_STEUREG_PAR_CMD";
        assert_eq!(decode(master, 0x05), "active, write, word");
        assert_eq!(decode(master, 0x5D), "active, write, sent, doubleword, busy");
        assert_eq!(decode(master, 0x12), "finished, read, doubleword");
        assert_eq!(decode("node1.b_STEUREG_PAR_CMD", 0x45), "active, write, word, answer not yet sent");
        assert_eq!(decode("node2.b_STEUREG_UPDOWNBLK1", 0x15), "active, initialization, download");
        assert_eq!(decode("node2.b_STEUREG_UPDOWNBLK1", 0x0C), "finished, block end, upload");
        assert_eq!(decode("node2.b_STEUREG_UPDOWNBLK1", 0x11), "active, reserved mode, download");
        assert_eq!(
            decode("node1.b_STEUREG_UPDOWN_SINGLE", 0x80),
            "processed, reserved mode, upload, answer sent, change acknowledged"
        );
    }

    #[test]
    fn handshakes_errors_slaves_and_numbers() {
        assert_eq!(decode("node2.b_CTRLREG_WRC1", 0x05), "data written, to be sent");
        assert_eq!(decode("node2.b_CTRLREG_WRC1", 0x04), "taken over and sent");
        assert_eq!(decode("node1.b_CTRLREG_WRC1", 0x02), "received");
        assert_eq!(decode("node2.w_ERR_NR_UPDOWNBLK1", 0x0107), "block longer than the slave takes");
        for number in [0x0003, 0x00FF, 0x0106, 0x0109, 0xFFFF] {
            assert_eq!(decode("node1.w_ERR_NR_UPDOWN_SINGLE", number), "reserved", "16#{number:04X}, p. 267");
        }
        assert_eq!(decode("node1.w_ERR_NR_PAR_CMD", 0xFFFB), "not present");
        assert_eq!(decode("node2.d_SL_MASK_BC0", 0x8000_0001), "slave 0, slave 31");
        assert_eq!(
            decode("node2.b_CTRLREG_RD_ORDER_RDC1", 0x80),
            "automatic, next slave number every interval"
        );
        assert_eq!(decode("node2.b_STATREG_RDC2", 7), "frame of slave 7 received");
        assert_eq!(decode("node2.a_STAT_SL[0]", 3), "responds, synchronized");
        assert_eq!(decode("node2.a_WR_VALUE[0]", 0xFFFF_FFFF), "-1");
        assert_eq!(decode("node2.a_WR_VALUE[8]", 1), "reserved");
        assert_eq!(decode("ethernet_config.d_IP_CONFIG", 0x1234_5678), "own fixed address");
    }

    #[test]
    fn facts_outside_the_manual_name_their_decision() {
        assert_eq!(decode("node1.b_SYNC_MODUS", 1), "on (D-06)");
        assert_eq!(decode("node2.b_CMD_BC0", 1), "control word");
        assert_eq!(decode("node2.b_CMD_BC0", 2), "SYNC mode (D-06)");
        assert_eq!(decode("node1.b_STEUREG_PAR_CMD", 0x43), "active, read, word, answer not yet sent");
        // Bits, too.
        let release = decode("node2.i_SW1_RELEASE", 0x0302);
        assert!(release.ends_with("(D-35)"), "{release}");
    }

    #[test]
    fn values_have_all_digits_of_their_type() {
        let format = |name: &str, value| DEVICE.register(name).unwrap().format_value(value);
        assert_eq!(format("node2.w_OPTION_STATUS", 0x43), "16#0043");
        assert_eq!(format("node2.b_CTRLREG_WRC1", 0x105), "16#05");
        assert_eq!(format("ethernet_config.d_ROUTER", 0x4E6F_5F52), "16#4E6F5F52");
    }
}
