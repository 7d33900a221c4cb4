//! Rules of devices in folders.

crate::rules! {
    OWN_RULE: 116, "own-rule", Error, "the pages of the device; D-802",
        "A rule of the device was broken. The note before the finding in the journal names the rule.";
}
