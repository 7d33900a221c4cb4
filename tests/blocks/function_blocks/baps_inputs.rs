//! Inputs of the BAPS blocks that describe the wiring and the settings of the device: `w_COMMAND_REG` and `us_HW_TYPE`.

use super::baps::{SAME_CYCLE, SPEED, SPEED_ACTUAL, Stage, init};
use crate::rig::Memory;
use commram::devices::omega_drive_line_2::blocks::*;

/// Manual p. 100, 105, 113: method and cycle time are selected at these blocks, too. An unconnected input is
/// 0, which is not a valid cycle time.
#[test]
fn the_command_register_of_an_exchange_counts() {
    macro_rules! check {
        ($block:ident) => {
            let mut stage = Stage::new(Memory::Heap, "");
            stage.initialize(&mut init(SAME_CYCLE, [SPEED, 0], [SPEED_ACTUAL, 0, 0, 0]));
            let mut comm = $block { ud_WR_VALUE0: 700, ..Default::default() };
            for _ in 0..5 {
                comm.call(&stage.base);
                stage.step(500);
            }
            comm.call(&stage.base);
            assert_eq!((comm.b_SL_QUIT, comm.b_ERR, comm.x_ERR), (0x80, 1, true), stringify!($block));
            let drive = stage.plant.devices()[0]
                .as_a::<commram::devices::omega_drive_line_2::Plc>()
                .unwrap()
                .baps()
                .drive();
            assert_eq!(
                (drive.parameter(SPEED), drive.parameter(120)),
                (Some(0), Some(0x000F)),
                "nothing is taken"
            );

            (comm.w_COMMAND_REG, comm.w_CONTROLWORD) = (SAME_CYCLE, 0x000F);
            for _ in 0..5 {
                comm.call(&stage.base);
                stage.step(500);
            }
            assert_eq!((comm.b_SL_QUIT, comm.x_ERR, comm.ud_RD_VALUE0), (0x01, false, 700));

            // From the next communication on, the values are exchanged every 2 ms.
            comm.w_COMMAND_REG = 0x0044;
            comm.call(&stage.base);
            stage.step(500);
            let events = stage.plant.devices()[0]
                .as_a::<commram::devices::omega_drive_line_2::Plc>()
                .unwrap()
                .baps()
                .process_data_events();
            stage.step(20_000);
            assert_eq!(
                stage.plant.devices()[0]
                    .as_a::<commram::devices::omega_drive_line_2::Plc>()
                    .unwrap()
                    .baps()
                    .process_data_events()
                    - events,
                10
            );
        };
    }
    check!(BAPS_PD_COMM2);
    check!(BAPS_PD_COMM8);
    check!(BAPS_PD_COMM24);
}

/// Manual p. 87, 99, 104, 112: other values of `us_HW_TYPE` are not implemented.
#[test]
fn with_another_hardware_type_a_block_does_nothing() {
    let mut stage = Stage::new(Memory::Heap, "");
    let mut block = BAPS_INIT { us_HW_TYPE: 1, ..init(SAME_CYCLE, [SPEED, 0], [SPEED_ACTUAL, 0, 0, 0]) };
    block.call(&stage.base);
    assert_eq!((stage.base.b_COMMAND.load(), stage.base.w_COMMAND_REG.load()), (0, 0));
    block.us_HW_TYPE = 0;
    stage.initialize(&mut block);
    assert!(block.x_OK);
    stage.step(500);
    macro_rules! check {
        ($block:ident) => {
            let timeout = stage.base.w_TIMEOUT.load();
            let mut comm = $block { us_HW_TYPE: 1, w_COMMAND_REG: SAME_CYCLE, ..Default::default() };
            comm.call(&stage.base);
            assert_eq!((stage.base.b_COMMAND.load(), stage.base.w_TIMEOUT.load()), (0, timeout));
            assert_eq!((comm.b_SL_QUIT, comm.w_STATUSWORD), (0, 0), stringify!($block));
            comm.us_HW_TYPE = 0;
            comm.call(&stage.base);
            assert_eq!(stage.base.b_COMMAND.load(), 0x01);
            stage.step(500);
        };
    }
    check!(BAPS_PD_COMM2);
    check!(BAPS_PD_COMM8);
    check!(BAPS_PD_COMM24);
}
