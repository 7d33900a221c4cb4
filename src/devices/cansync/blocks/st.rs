//! The CANsync blocks in IEC Structured Text, for `commram export st --blocks`. A test of the documentation
//! compares their names and pins with those of the Rust blocks. Other tests run both versions of a block and
//! compare the behaviour.

/// The texts, in `st/`.
pub(crate) mod text {
    pub(crate) const WATCH: &str = include_str!("st/watch.st");
    pub(crate) const COMMON: &str = include_str!("st/common.st");
    pub(crate) const SL_TYP_INIT: &str = include_str!("st/sl_typ_init.st");
    pub(crate) const INIT: &str = include_str!("st/init.st");
    pub(crate) const MODE: &str = include_str!("st/mode.st");
    pub(crate) const BROADCAST_MA: &str = include_str!("st/broadcast_ma.st");
    pub(crate) const COMMANDS: &str = include_str!("st/commands.st");
    pub(crate) const PAR_MA: &str = include_str!("st/par_ma.st");
    pub(crate) const PAR_SL: &str = include_str!("st/par_sl.st");
    pub(crate) const PD_CFG: &str = include_str!("st/pd_cfg.st");
    pub(crate) const READ: &str = include_str!("st/read.st");
    pub(crate) const PD_COMM: &str = include_str!("st/pd_comm.st");
    pub(crate) const UPDOWNLOAD_MA: &str = include_str!("st/updownload_ma.st");
    pub(crate) const UPDOWNLOAD_SL: &str = include_str!("st/updownload_sl.st");
    pub(crate) const INTR_SET: &str = include_str!("../../intr_set.st");
}

/// Declares the blocks of a device in Structured Text: the names of its INIT, master and slave structures,
/// its own parts of these blocks, and the parts that come after them in the text.
macro_rules! st {
    ($init:literal, $ma:literal, $sl:literal, $own:expr, [$($following:expr),*]) => {{
        use $crate::devices::cansync::blocks::st::text;
        use $crate::plc::StPart;
        &[
            StPart { text: text::WATCH, words: &[] },
            StPart { text: text::COMMON, words: &[] },
            StPart { text: $own, words: &[] },
            StPart { text: text::SL_TYP_INIT, words: &[] },
            StPart { text: text::INIT, words: &[("INIT", $init)] },
            StPart { text: text::MODE, words: &[("ROLE", "MA"), ("BASE", $ma), ("PAGE", "216-218")] },
            StPart { text: text::MODE, words: &[("ROLE", "SL"), ("BASE", $sl), ("PAGE", "219-221")] },
            StPart { text: text::BROADCAST_MA, words: &[("RANK", "0"), ("MA", $ma), ("PAGE", "196-197")] },
            StPart { text: text::BROADCAST_MA, words: &[("RANK", "1"), ("MA", $ma), ("PAGE", "198-199")] },
            StPart { text: text::BROADCAST_MA, words: &[("RANK", "2"), ("MA", $ma), ("PAGE", "200-201")] },
            StPart { text: text::COMMANDS, words: &[("MA", $ma), ("SL", $sl)] },
            StPart { text: text::PAR_MA, words: &[("MA", $ma)] },
            StPart { text: text::PAR_SL, words: &[("SL", $sl)] },
            StPart { text: text::PD_CFG, words: &[("MA", $ma), ("SL", $sl)] },
            StPart {
                text: text::READ,
                words: &[("ROLE", "MA"), ("BASE", $ma), ("PAGE_CFG", "236-238"), ("PAGE_COMM", "252-253")],
            },
            StPart {
                text: text::READ,
                words: &[("ROLE", "SL"), ("BASE", $sl), ("PAGE_CFG", "239-241"), ("PAGE_COMM", "254-255")],
            },
            StPart { text: text::PD_COMM, words: &[("MA", $ma), ("SL", $sl)] },
            StPart { text: text::UPDOWNLOAD_MA, words: &[("MA", $ma)] },
            StPart { text: text::UPDOWNLOAD_SL, words: &[("SL", $sl)] },
            StPart { text: text::INTR_SET, words: &[] },
            $(StPart { text: $following, words: &[] },)*
        ]
    }};
}

pub(crate) use st;
