//! Services of DP as text. The names of the services follow from the service access points. Octets are
//! described if they have one meaning for all slaves. Octets with a meaning that depends on the slave stay
//! numbers.

use crate::plural::plural_of;
use crate::profibus::{Frame, FunctionCode};
use core::fmt::Write;

/// Service access points of slaves (IEC 61158-6-3).
const SERVICES: [(u8, &str); 9] = [
    (54, "Master_To_Master"),
    (55, "Set_Slave_Add"),
    (56, "RD_Inp"),
    (57, "RD_Outp"),
    (58, "Global_Control"),
    (59, "Get_Cfg"),
    (60, "Slave_Diag"),
    (61, "Set_Prm"),
    (62, "Chk_Cfg"),
];

/// Service access point of a DP master.
const MASTER: u8 = 62;

/// Bits of octet 1 of Set_Prm, from bit 3 on.
const PRM_STATUS: [&str; 5] = ["WD_On", "Freeze_Req", "Sync_Req", "Unlock_Req", "Lock_Req"];

/// Bits of octets 1 and 2 of a diagnosis. An empty name means that the bit has no meaning, or is always 1.
const STATUS_1: [&str; 8] = [
    "Station_Non_Existent",
    "Station_Not_Ready",
    "Cfg_Fault",
    "Ext_Diag",
    "Not_Supported",
    "Invalid_Slave_Response",
    "Prm_Fault",
    "Master_Lock",
];
const STATUS_2: [&str; 8] =
    ["Prm_Req", "Stat_Diag", "", "WD_On", "Freeze_Mode", "Sync_Mode", "", "Deactivated"];

/// Value of the master's address in a diagnosis, if the slave has no master.
const NO_MASTER: u8 = 255;

/// Returns the name of a telegram's service. `None` for an exchange of data, and for a telegram that DP does
/// not use.
pub(super) fn name(frame: &Frame) -> Option<&'static str> {
    let sap = if FunctionCode::is_answer(frame.fc) {
        frame.ssap.filter(|_| frame.dsap == Some(MASTER))
    } else {
        frame.dsap.filter(|_| frame.ssap == Some(MASTER))
    };
    SERVICES.iter().find(|(known, _)| Some(*known) == sap).map(|(_, name)| *name)
}

/// Returns the text of the octets of a telegram, if the telegram's service defines them for all slaves.
pub(super) fn text(frame: &Frame) -> Option<String> {
    match (name(frame)?, FunctionCode::is_answer(frame.fc)) {
        ("Set_Prm", false) => parameters(&frame.data),
        ("Slave_Diag", true) => diagnosis(&frame.data),
        _ => None,
    }
}

/// Returns the names of the set bits of an octet, lowest first.
fn bits<'a>(octet: u8, names: &[&'a str]) -> Vec<&'a str> {
    let is_set = |(bit, name): &(usize, &&str)| octet & 1 << bit != 0 && !name.is_empty();
    names.iter().enumerate().filter(is_set).map(|(_, name)| *name).collect()
}

fn parameters(data: &[u8]) -> Option<String> {
    let (&[status, factor_1, factor_2, tsdr, high, low, groups], user) = data.split_first_chunk()?;
    let mut parts: Vec<String> = bits(status >> 3, &PRM_STATUS).into_iter().map(str::to_owned).collect();
    if status & 0x08 != 0 {
        parts.push(format!("watchdog {} ms", 10 * u32::from(factor_1) * u32::from(factor_2)));
    }
    parts.push(format!("min_Tsdr {tsdr}"));
    parts.push(format!("ident 16#{:04X}", u16::from_be_bytes([high, low])));
    parts.push(format!("groups 16#{groups:02X}"));
    parts.push(format!("{} of the user", plural_of(user, "octet")));
    Some(parts.join(", "))
}

fn diagnosis(data: &[u8]) -> Option<String> {
    let (&[one, two, _, master, high, low], more) = data.split_first_chunk()?;
    let mut parts: Vec<String> = bits(one, &STATUS_1).into_iter().map(str::to_owned).collect();
    parts.extend(bits(two, &STATUS_2).into_iter().map(str::to_owned));
    let master = if master == NO_MASTER { "no master".to_owned() } else { format!("master {master}") };
    parts.push(master);
    let mut text = format!("{}, ident 16#{:04X}", parts.join(", "), u16::from_be_bytes([high, low]));
    if !more.is_empty() {
        // Writing to a String cannot fail.
        let _ = write!(text, ", {} of extended diagnosis", plural_of(more, "octet"));
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(fc: u8, dsap: u8, ssap: u8, data: &[u8]) -> Frame {
        Frame { da: 5, sa: 2, fc, dsap: Some(dsap), ssap: Some(ssap), data: data.to_vec() }
    }

    #[test]
    fn services_are_known_in_both_directions() {
        for (frame, wanted) in [
            (frame(0x6D, 60, 62, &[]), Some("Slave_Diag")),
            (frame(0x08, 62, 60, &[]), Some("Slave_Diag")),
            (frame(0x5D, 62, 62, &[0x10]), Some("Chk_Cfg")),
            (frame(0x46, 58, 62, &[0, 0]), Some("Global_Control")),
            (frame(0x6D, 60, 5, &[]), None),
            (frame(0x6D, 20, 62, &[]), None),
            (Frame { dsap: None, ssap: None, ..frame(0x7D, 0, 0, &[1]) }, None),
        ] {
            assert_eq!(name(&frame), wanted, "{frame:?}");
        }
    }

    #[test]
    fn parameters_and_diagnosis_are_decoded() {
        let parameters = frame(0x5D, 61, 62, &[0xA8, 2, 10, 11, 0x0A, 0x1B, 0, 1, 2, 3]);
        assert_eq!(
            text(&parameters).as_deref(),
            Some(
                "WD_On, Sync_Req, Lock_Req, watchdog 200 ms, min_Tsdr 11, ident 16#0A1B, groups 16#00, 3 octets of \
                 the user"
            )
        );
        let diagnosis = frame(0x08, 62, 60, &[0x4A, 0x05, 0, 255, 0x0A, 0x1B, 5, 4, 1, 2, 3]);
        assert_eq!(
            text(&diagnosis).as_deref(),
            Some(
                "Station_Not_Ready, Ext_Diag, Prm_Fault, Prm_Req, no master, ident 16#0A1B, 5 octets of extended \
                 diagnosis"
            )
        );
        assert_eq!(text(&frame(0x08, 62, 60, &[0; 5])), None, "too short");
        assert_eq!(text(&frame(0x5D, 62, 62, &[0x10])), None, "octets of the user");
    }
}
