//! A PLC program that follows the manual uses all blocks of chapter 7.4 in both roles while faults begin and end: the
//! access checker finds nothing, and after the end of the faults every job ends.

use super::bench::Bench;
use super::device::*;
use super::process_data::mapped;
use crate::rig::{Memory, NodePlace};
use commram::devices::fault_kinds;
use commram::fault::FaultSpec;
use proptest::prelude::*;
use std::time::Duration;

const FAULTS: [&str; 14] = [
    "kind = 'lose_frame'\ncount = 3",
    "kind = 'lose_frame'\nslot = 'RC'\ncount = 5",
    "kind = 'delay_frame'\ndelay_us = 1500\ncount = 2",
    "kind = 'duplicate_frame'\ndelay_us = 900\nduration_us = 5000",
    "kind = 'lose_sync'\ncount = 2",
    "kind = 'jitter_sync'\namplitude_us = AMPLITUDE\nduration_us = 9000",
    "kind = 'slave_off'\nslave = 0\nduration_us = 7000",
    "kind = 'slave_late'\nslave = 0\ndelay_us = 2500\ncount = 3",
    "kind = 'slave_busy'\nslave = 1\ncount = 9",
    "kind = 'slave_error'\nslave = 0\nerror = 0x0103\ncount = 1",
    "kind = 'wrong_offset'\nslave = 0\ncount = 1",
    "kind = 'bus_off'\nplc = 'a'\nnode = 'MASTER'",
    "kind = 'bus_off'\nplc = 'b'\nnode = 'SLAVE'",
    "kind = 'overrun'\nplc = 'a'\nnode = 'MASTER'\ncount = 3",
];

/// Returns the text of a fault with the port names of this device, and with a jitter that suits its interval.
fn fault_text(fault: &str) -> String {
    rate().kind.named(fault).replace("AMPLITUDE", &rate().scaled(400).to_string())
}

/// The programs of both PLCs.
struct Programs {
    bench: Bench,
    comm_ma: CANsync_PD_COMM_MA,
    comm_sl: CANsync_PD_COMM_SL,
    mode_ma: CANsync_MODE_MA,
    mode_sl: CANsync_MODE_SL,
    read: CANsync_PAR_READ_MA,
    write: CANsync_PAR_WRITE_MA,
    control_word: CANsync_CONTROLWORD_MA,
    broadcast: CANsync_BC_MA1,
    transfer: CANsync_UPDOWNLOAD_MA,
    parameters: CANsync_PAR_SL,
    transfers: CANsync_UPDOWNLOAD_SL,
    at_master: Box<[CANsync_RD_BMARRAY; 2]>,
    blocks: Box<[CANsync_UPDOWN_BMARRAY; 2]>,
    /// SYNC edges that master and slave have seen.
    edges: [u32; 2],
    /// Jobs that have ended without an error: parameters read, written, blocks.
    done: [u32; 3],
}

impl Programs {
    fn new() -> Self {
        let send = |comm: &mut CANsync_PD_COMM_MA| (comm.si_WRC1_SEND, comm.si_WRC2_SEND) = (5, 5);
        let mut comm_ma =
            CANsync_PD_COMM_MA { si_MAX_SL_NR: 1, x_COPY_TO_RD_ARRAY: true, ..Default::default() };
        send(&mut comm_ma);
        // The monitoring time is shorter than some faults, so that the blocks also give up jobs.
        let t_TIME = Duration::from_millis(30);
        let for_blocks = Duration::from_millis(100);
        Programs {
            bench: mapped(Memory::Heap),
            comm_ma,
            comm_sl: CANsync_PD_COMM_SL { si_RDC1_SEND: 5, si_RDC2_SEND: 5, ..Default::default() },
            mode_ma: CANsync_MODE_MA::default(),
            mode_sl: CANsync_MODE_SL::default(),
            read: CANsync_PAR_READ_MA { si_SL_NR: 1, u_PAR_NR: 1000, t_TIME, ..Default::default() },
            write: CANsync_PAR_WRITE_MA {
                si_SL_NR: 0,
                u_PAR_NR: 7,
                ud_PAR_VALUE: 99,
                t_TIME,
                ..Default::default()
            },
            control_word: CANsync_CONTROLWORD_MA {
                si_SL_NR_CTRL: 1,
                w_CONTROLWORD: 0x000F,
                ..Default::default()
            },
            broadcast: CANsync_BC_MA1 { us_BC_CMD_NR: 200, d_SL_MASK: u32::MAX, ..Default::default() },
            transfer: CANsync_UPDOWNLOAD_MA { u_LENGTH: 5, t_TIME: for_blocks, ..Default::default() },
            parameters: CANsync_PAR_SL { x_EN: true, ..Default::default() },
            transfers: CANsync_UPDOWNLOAD_SL { x_EN: true, t_TIME: for_blocks, ..Default::default() },
            at_master: Box::new([[[0; 16]; 32]; 2]),
            blocks: Box::new([[3; UPDOWN_VALUES]; 2]),
            edges: [0; 2],
            done: [0; 3],
        }
    }

    /// Runs an interval: advances the clock to the next edge, then runs the event tasks of the PLCs that have seen it.
    fn interval(&mut self, number: u32) {
        self.bench.rig.run_to_sync();
        self.bench.rig.step(80);
        let counter = |at: NodePlace| {
            let header = self.bench.rig.plant.devices()[at.plc].segment().header().unwrap();
            header.sync_counter[at.port.index()].load()
        };
        let edges = [self.bench.rig.master_at, self.bench.rig.slave_at].map(counter);
        let [master_runs, slave_runs] = [0, 1].map(|node| edges[node] != self.edges[node]);
        self.edges = edges;
        if slave_runs {
            self.slave_task();
        }
        if master_runs {
            self.master_task(number);
        }
    }

    fn slave_task(&mut self) {
        let Bench { sl, .. } = &self.bench;
        self.comm_sl.call(sl, &mut self.at_master[1]);
        self.parameters.call(sl);
        self.parameters.x_OK_IN = self.parameters.x_ACTIV;
        self.transfers.x_RESET = self.transfers.x_ERR;
        let [download, upload] = &mut *self.blocks;
        self.transfers.call(sl, download, upload);
        self.mode_sl.x_RESET_CANsync_CONTROLLER = sl.w_CANsync_STATUS.load() & 0x80 != 0;
        self.mode_sl.call(sl);
    }

    fn master_task(&mut self, number: u32) {
        let Bench { ma, .. } = &self.bench;
        self.comm_ma.call(ma, &mut self.at_master[0]);
        self.mode_ma.x_RESET_CANsync_CONTROLLER = ma.w_CANsync_STATUS.load() & 0x80 != 0;
        self.mode_ma.call(ma);
        self.control_word.x_EN = number.is_multiple_of(11);
        self.control_word.call(ma);
        self.broadcast.x_EN = number.is_multiple_of(17);
        self.broadcast.call(ma);
        // After the end of a job the next one can begin; after a failed job the block needs a reset first.
        macro_rules! next_job {
            ($block:ident, $failed:expr, $done:expr, $begins:expr, $call:expr) => {
                let was_busy = self.$block.x_BUSY;
                self.$block.x_RESET = $failed;
                self.$block.x_EN = was_busy || $begins;
                $call;
                self.done[$done] += u32::from(was_busy && !self.$block.x_BUSY && self.$block.x_OK);
            };
        }
        // Parameter jobs have priority (p. 161), so they are given rarely. Otherwise the up-/downloads would not get
        // their turns.
        next_job!(read, self.read.x_ERR, 0, number.is_multiple_of(8), self.read.call(ma));
        next_job!(write, self.write.x_ERR, 1, number % 16 == 5, self.write.call(ma));
        let source = self.blocks[0];
        self.transfer.x_UPDOWN = self.done[2].is_multiple_of(2);
        next_job!(
            transfer,
            self.transfer.x_ERR || self.transfer.x_ERR_SL,
            2,
            !self.transfer.x_EN,
            self.transfer.call(ma, &source, &mut self.blocks[1])
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn the_checker_finds_nothing_in_a_correct_program(
        // A fault begins at most 1000 us after an edge. So jitter cannot move the next edge to a time before the begin
        // of the fault.
        faults in prop::collection::vec((1..40u32, 0..1000u64, 0..FAULTS.len()), 1..12),
    ) {
        let mut programs = Programs::new();
        let mut number = 0;
        for (intervals, us, fault) in faults {
            for _ in 0..intervals {
                programs.interval(number);
                number += 1;
            }
            programs.bench.rig.step(rate().scaled(us));
            let spec: FaultSpec = toml::from_str(&fault_text(FAULTS[fault])).unwrap();
            let plant = &mut programs.bench.rig.plant;
            let fault = spec.resolve(fault_kinds(), &plant.names()).unwrap();
            plant.add_fault(fault).unwrap();
        }
        programs.bench.rig.plant.clear_faults();
        for quiet in 0..300 {
            programs.interval(number + quiet);
            if quiet == 60 {
                programs.done = [0; 3];
            }
        }
        prop_assert!(programs.done.iter().all(|done| *done > 2), "{:?}", programs.done);
        let findings: Vec<_> = programs.bench.rig.plant.journal().findings().iter().collect();
        prop_assert!(findings.is_empty(), "{findings:#?}");
    }
}
