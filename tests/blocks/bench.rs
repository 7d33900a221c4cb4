//! A plant from the text of a plant file, for tests of function blocks.

use commram::devices::omega_drive_line_2::blocks::CANsync_INIT;
use commram::devices::omega_drive_line_2::registers::{CANsync_INIT_BMSTRUCT, NODE2};
use commram::script::{Bench, ScenarioError};

#[test]
fn function_blocks_work_on_the_ram_of_a_bench() -> Result<(), ScenarioError> {
    let mut bench = Bench::built_in()?;
    let base = bench.ram("line")?.at::<CANsync_INIT_BMSTRUCT>(NODE2)?;
    let mut init = CANsync_INIT { us_BAUDRATE: 5, us_SYNC_INTERVAL: 2, ..Default::default() };
    bench.wait_until("1s", |_| {
        init.call(&base);
        Ok(init.x_OK)
    })?;
    bench.expect("node2.w_OPTION_STATUS", "16#0003")
}
