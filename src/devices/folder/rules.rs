//! Rules of devices in folders.

crate::rules! {
    OWN_RULE: 116, "own-rule", Error, "the pages of the device; D-802",
        "A rule of the device was broken. The note of the finding names the rule.";
    SCRIPT_STOPPED: 126, "script-stopped", Error, "D-801",
        "The script of the device has stopped after an error, and the device does nothing until the next power-on. Correct the script in the line that the note of the finding names.";
}
