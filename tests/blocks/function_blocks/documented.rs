//! `docs/function-blocks.md` names every input and output with its preset, and the presets are the manual's.

use commram::devices::omega_drive_line_2::blocks::*;
use std::collections::BTreeSet;
use std::time::Duration;

const DOCS: &str = include_str!("../../../docs/function-blocks.md");

/// A preset as the documentation prints it.
trait Preset {
    fn shown(&self) -> String;
}
macro_rules! numbers {
    ($($type:ty),*) => { $(impl Preset for $type {
        fn shown(&self) -> String { self.to_string() }
    })* };
}
numbers!(i8, i16, i32, u8, u16, u32);
impl Preset for bool {
    fn shown(&self) -> String {
        self.to_string().to_uppercase()
    }
}
impl Preset for Duration {
    fn shown(&self) -> String {
        format!("{} s", self.as_secs())
    }
}
impl<T: Preset + PartialEq, const N: usize> Preset for [T; N] {
    fn shown(&self) -> String {
        assert!(self.iter().all(|item| *item == self[0]));
        format!("all {}", self[0].shown())
    }
}

/// Name of a block, names and presets of its inputs and outputs.
type Block = (&'static str, Vec<(&'static str, String)>);

macro_rules! blocks {
    ($($block:ident { $($field:ident),* })*) => {
        vec![$({
            let block = $block::default();
            (stringify!($block), vec![$((stringify!($field), block.$field.shown())),*])
        }),*]
    };
}

/// The section of a block; one section may describe several.
fn section(block: &str) -> &'static str {
    DOCS.split("\n### ")
        .skip(1)
        .find(|section| {
            section.lines().next().is_some_and(|title| title.split(", ").any(|name| name == block))
        })
        .unwrap_or_else(|| panic!("{block} is not documented"))
}

#[test]
fn every_input_and_output_is_documented_with_its_preset() {
    for (block, fields) in documented() {
        let rows: Vec<Vec<&str>> = section(block)
            .lines()
            .filter(|line| line.starts_with("| in |") || line.starts_with("| out |"))
            .map(|line| line.split('|').map(str::trim).collect())
            .collect();
        assert_eq!(rows.len(), fields.len(), "{block}");
        for (row, (field, preset)) in rows.iter().zip(fields) {
            assert_eq!(row[2], format!("`{field}`"), "{block}");
            let hex = preset.parse().map(|value: u8| format!("16#{value:02X}"));
            let fits = row[4] == preset || hex.is_ok_and(|hex| row[4] == hex);
            assert!(fits || row[1] == "out" && row[4].is_empty(), "{block}.{field}: {preset}");
        }
    }
}

/// Every block is called by a test against the firmware.
#[test]
fn every_block_is_tested() {
    let tests = [
        include_str!("baps.rs"),
        include_str!("bench.rs"),
        include_str!("board.rs"),
        include_str!("command_channel.rs"),
        include_str!("parameter.rs"),
        include_str!("process_data.rs"),
        include_str!("service_data.rs"),
        include_str!("start.rs"),
        include_str!("updownload.rs"),
    ];
    let titles = DOCS.lines().filter_map(|line| line.strip_prefix("### "));
    let blocks: Vec<_> = titles.flat_map(|title| title.split(", ")).collect();
    assert_eq!(blocks.len(), 24 + 8 + 5, "{blocks:?}");
    let words: BTreeSet<_> =
        tests.iter().flat_map(|test| test.split(|c: char| !c.is_alphanumeric() && c != '_')).collect();
    for block in blocks {
        assert!(words.contains(block), "{block}");
    }
}

/// Every preset that the manual names.
#[test]
fn presets_are_the_manuals() {
    let comm_control = CANsync_COMM_CONTROL_MA::default();
    let numbers = [comm_control.si_SL_NR_CTRL, comm_control.si_SL_NR_PAR, comm_control.si_SL_NR_UDL];
    assert_eq!(numbers, [-128; 3], "p. 205-206");
    assert_eq!(comm_control.si_MAX_SL_NR, -1, "p. 206");
    let init = CANsync_INIT::default();
    assert_eq!((init.b_ACCEPT_CODE, init.b_ACCEPT_MASK), (0xFF, 0xFF), "p. 214");
    assert_eq!(init.us_BAUDRATE, 0, "p. 214");
    assert_eq!(CANsync_PAR_READ_MA::default().t_TIME, Duration::from_secs(3), "p. 223");
    assert_eq!(CANsync_PAR_WRITE_MA::default().t_TIME, Duration::from_secs(3), "p. 231");
    let comm = CANsync_PD_COMM_MA::default();
    assert_eq!((comm.si_RD_SL_NR1_RECEIVE, comm.si_RD_SL_NR2_RECEIVE), (-128, -128), "p. 250");
    assert_eq!((comm.si_MAX_SL_NR, comm.x_COPY_TO_RD_ARRAY), (-1, false), "p. 250-251");
    assert!(!CANsync_PD_COMM_SL::default().x_COPY_TO_RD_ARRAY, "p. 259");
    assert_eq!(CANsync_UPDOWNLOAD_MA::default().us_MAX_NR_OF_COMM, 1, "p. 266");
    assert_eq!(CANsync_UPDOWNLOAD_SL::default().t_TIME, Duration::from_secs(30), "p. 270");

    let init = BAPS_INIT::default();
    assert_eq!((init.us_HW_TYPE, init.i_EVENT, init.x_EN), (0, 0, true), "p. 87, 91");
    assert_eq!(init.t_TIME, Duration::from_secs(3), "p. 91");
    assert_eq!(BAPS_PAR_READ::default().us_PAR_ELEMENT, 7, "p. 94");
    assert!(BAPS_PAR_WRITE::default().x_EN_ERR_FORMAT, "p. 97");
    let [two, eight] = [
        (
            BAPS_PD_COMM2::default().us_HW_TYPE,
            BAPS_PD_COMM2::default().us_MODE,
            BAPS_PD_COMM2::default().x_EN,
        ),
        (
            BAPS_PD_COMM8::default().us_HW_TYPE,
            BAPS_PD_COMM8::default().us_MODE,
            BAPS_PD_COMM8::default().x_EN,
        ),
    ];
    assert_eq!([two, eight], [(0, 0, true); 2], "p. 99-102, 112-115");
    let comm = BAPS_PD_COMM24::default();
    assert_eq!((comm.us_HW_TYPE, comm.us_MODE, comm.x_EN), (0, 0, true), "p. 104-107");
    assert_eq!(comm.t_RE_INIT_TIME, Duration::from_secs(1), "p. 109");
    assert_eq!(BAPS_PD_CONTROL::default().t_TIME, Duration::from_secs(3), "p. 117");
    assert_eq!(BAPS_SD_CONTROL::default().t_TIME, Duration::from_secs(3), "p. 119");
}

fn documented() -> Vec<Block> {
    blocks! {
        BAPS_INIT { us_HW_TYPE, i_EVENT, w_COMMAND_REG, us_MODE, u_WR_PAR_NR0, u_WR_PAR_NR1, u_WR_PAR_NR2, u_WR_PAR_NR3, u_WR_PAR_NR4, u_WR_PAR_NR5, u_WR_PAR_NR6, u_WR_PAR_NR7, u_RD_PAR_NR0, u_RD_PAR_NR1, u_RD_PAR_NR2, u_RD_PAR_NR3, u_RD_PAR_NR4, u_RD_PAR_NR5, u_RD_PAR_NR6, u_RD_PAR_NR7, t_TIME, x_EN, x_RESET, w_STATUS_REG, x_BUSY, b_SL_QUIT, b_ERR, x_ERR, x_OK }
        BAPS_PAR_READ { u_PAR_NR, us_PAR_ELEMENT, x_EN, x_RESET, ud_PAR_VALUE, x_PAR_FORMAT, x_BUSY, i_ERR_DETAIL, i_ERR_COMM, x_ERR, x_OK }
        BAPS_PAR_WRITE { u_PAR_NR, x_PAR_FORMAT, ud_PAR_VALUE, x_EN_ERR_FORMAT, x_EN, x_RESET, x_BUSY, i_ERR_DETAIL, i_ERR_COMM, x_ERR, x_OK }
        BAPS_PD_COMM2 { us_HW_TYPE, w_CONTROLWORD, w_COMMAND_REG, us_MODE, ud_WR_VALUE0, ud_WR_VALUE1, x_EN, w_STATUSWORD, w_STATUS_REG, ud_RD_VALUE0, ud_RD_VALUE1, b_SL_QUIT, b_ERR, x_ERR }
        BAPS_PD_COMM24 { us_HW_TYPE, w_CONTROLWORD, w_COMMAND_REG, us_MODE, ud_WR_VALUE0, ud_WR_VALUE1, t_RE_INIT_TIME, x_RE_INIT_START, x_EN, w_STATUSWORD, w_STATUS_REG, ud_RD_VALUE0, ud_RD_VALUE1, ud_RD_VALUE2, ud_RD_VALUE3, b_SL_QUIT, b_ERR, x_ERR, x_RE_INIT_ERR, x_RE_INIT_OK }
        BAPS_PD_COMM8 { us_HW_TYPE, w_CONTROLWORD, w_COMMAND_REG, us_MODE, ud_WR_VALUE0, ud_WR_VALUE1, ud_WR_VALUE2, ud_WR_VALUE3, ud_WR_VALUE4, ud_WR_VALUE5, ud_WR_VALUE6, ud_WR_VALUE7, x_EN, w_STATUSWORD, w_STATUS_REG, ud_RD_VALUE0, ud_RD_VALUE1, ud_RD_VALUE2, ud_RD_VALUE3, ud_RD_VALUE4, ud_RD_VALUE5, ud_RD_VALUE6, ud_RD_VALUE7, b_SL_QUIT, b_ERR, x_ERR }
        BAPS_PD_CONTROL { x_RESET, t_TIME, x_ERR }
        BAPS_SD_CONTROL { x_RESET, t_TIME, b_ERR, x_ERR }
        CANsync_BC_MA0 { us_BC_CMD_NR, si_BC_BYTE, i_BC_WORD, d_SL_MASK, x_EN, x_OK }
        CANsync_BC_MA1 { us_BC_CMD_NR, si_BC_BYTE, i_BC_WORD, d_SL_MASK, x_EN, x_OK }
        CANsync_BC_MA2 { us_BC_CMD_NR, si_BC_BYTE, i_BC_WORD, d_SL_MASK, x_EN, x_OK }
        CANsync_BC_SL { us_BC_CMD_NR, si_BC_BYTE, i_BC_WORD, si_BC_RECEIVED }
        CANsync_COMM_CONTROL_MA { si_SL_NR_CTRL, x_EN_CTRL, si_SL_NR_PAR, x_EN_PAR, si_SL_NR_UDL, x_EN_UDL, si_MAX_SL_NR }
        CANsync_CONTROLWORD_MA { si_SL_NR_CTRL, w_CONTROLWORD, x_EN, x_OK }
        CANsync_CONTROLWORD_SL { w_CONTROLWORD, si_RECEIVED }
        CANsync_INIT { x_SL, x_SYNC_IN, x_SYNC_MODE, x_ASYNC_MODE0, x_ASYNC_MODE1, a_SL_TYP, b_ACCEPT_CODE, b_ACCEPT_MASK, b_BIT_TIMING0, b_BIT_TIMING1, us_BAUDRATE, us_SYNC_INTERVAL, w_ERR, x_ERR, x_OK }
        CANsync_MODE_MA { x_RESET_SOFTWARE, x_SET_INIT_DATA, x_CANsync_RUN, x_RESET_CANsync_CONTROLLER, x_SYNC_MODE, x_ASYNC_MODE0, x_ASYNC_MODE1, x_HS_ACTIV, x_INIT_POSSIBLE, x_WAIT, x_PREPARE_ACTIV, x_CANsync_ACTIV, x_SYNC_MODE_ACTIV, x_ASYNC_MODE_ACTIV, x_SL, x_MA }
        CANsync_MODE_SL { x_RESET_SOFTWARE, x_SET_INIT_DATA, x_CANsync_RUN, x_RESET_CANsync_CONTROLLER, x_SYNC_MODE, x_ASYNC_MODE0, x_ASYNC_MODE1, x_HS_ACTIV, x_INIT_POSSIBLE, x_WAIT, x_PREPARE_ACTIV, x_CANsync_ACTIV, x_SYNC_MODE_ACTIV, x_ASYNC_MODE_ACTIV, x_SL, x_MA }
        CANsync_PAR_READ_MA { si_SL_NR, u_PAR_NR, x_PAR_FORMAT, i_SUB_SL, t_TIME, x_EN, x_RESET, ud_PAR_VALUE, x_PAR_FORMAT_READ, x_BUSY, b_ERR, i_ERR, x_ERR, x_OK }
        CANsync_PAR_SL { ud_PAR_VALUE_READ, x_PAR_FORMAT_READ, i_ERR, x_ERR_IN, x_OK_IN, x_EN, x_RESET, x_RESET_JOB, x_READ, x_WRITE, u_PAR_NR, x_PAR_FORMAT_WRITE, ud_PAR_VALUE_WRITE, x_ACTIV, x_BUSY, x_OK }
        CANsync_PAR_WRITE_MA { si_SL_NR, u_PAR_NR, x_PAR_FORMAT, i_SUB_SL, ud_PAR_VALUE, t_TIME, x_EN, x_RESET, x_BUSY, i_ERR, b_ERR, x_ERR, x_OK }
        CANsync_PD_CFG_MA { a_WRC1, a_HL_WRC1, a_WRC2, a_HL_WRC2 }
        CANsync_PD_CFG_READ_MA { si_SL_NR, a_RDC1, a_HL_RDC1, a_RDC2, a_HL_RDC2 }
        CANsync_PD_CFG_READ_SL { si_SL_NR, a_RDC1, a_HL_RDC1, a_RDC2, a_HL_RDC2 }
        CANsync_PD_CFG_SL { a_WRC1, a_HL_WRC1, a_WRC2, a_HL_WRC2, a_RDC1, a_HL_RDC1, a_RDC2, a_HL_RDC2 }
        CANsync_PD_COMM_MA { a_WR_VALUES_SEND, si_WRC1_SEND, si_WRC2_SEND, si_RD_SL_NR1_RECEIVE, si_RD_SL_NR2_RECEIVE, si_MAX_SL_NR, x_COPY_TO_RD_ARRAY, si_RD_SL_NR1_RECEIVED, si_RD_SL_NR2_RECEIVED }
        CANsync_PD_COMM_READ_MA { si_SL_NR, a_RD_VALUES, si_RD_SL_NR1_RECEIVED, si_RD_SL_NR2_RECEIVED }
        CANsync_PD_COMM_READ_SL { si_SL_NR, a_RD_VALUES, si_RD_SL_NR1_RECEIVED, si_RD_SL_NR2_RECEIVED }
        CANsync_PD_COMM_SL { a_RD_VALUES_SEND, si_RDC1_SEND, si_RDC2_SEND, x_COPY_TO_RD_ARRAY, a_WR_VALUES_RECEIVED, si_WRC1_RECEIVED, si_WRC2_RECEIVED, si_RD_SL_NR1_RECEIVED, si_RD_SL_NR2_RECEIVED }
        CANsync_UPDOWNLOAD_MA { si_SL_NR, x_UPDOWN, u_LENGTH, us_MAX_NR_OF_COMM, t_TIME, x_EN, x_RESET, x_BUSY, w_ERR_SL, x_ERR_SL, b_ERR, x_ERR, x_OK }
        CANsync_UPDOWNLOAD_SL { t_TIME, x_EN, x_RESET, x_UPDOWN, x_ORDER_ACTIV, u_LENGTH, x_BUSY, w_ERR, x_ERR, x_OK }
        INTR_SET { i_EVENT, i_MODE, i_PAR1, i_PAR2, x_EN, x_ERR }
        LED { b_LEDS }
        OPT_INIT { us_MODE_TRIGGER_1, us_MODE_TRIGGER_2, us_MODE_TRIGGER_CONTROLLER, u_DIVIDER_TIMER_A, x_EN_TIMER_A, ud_CFG_MODE_TIMER_A, u_DIVIDER_TIMER_B, x_EN_TIMER_B, ud_CFG_MODE_TIMER_B, x_ERR, x_OK }
        TIME_MEASURE_END { ud_TIME, ud_TIME_DIFF }
        TIME_MEASURE_START { ud_TIME }
    }
}
