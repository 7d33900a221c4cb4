//! A slave node with random traffic and a random application: it never panics, its frames follow the
//! grammar, and a restarted PLC finds a working node.

use crate::rig::bench::{Bench, NUMBER};
use crate::rig::{FASTEST, Memory};
use commram::devices::cansync::frames::codec::{Access, DecodedFrame, ParameterJob, ParameterResult, decode};
use commram::devices::cansync::frames::{Frame, FrameKind};
use proptest::prelude::*;

#[derive(Clone, Debug)]
enum Step {
    /// A job frame and its response slot.
    Turn(Vec<u8>),
    /// Writes a byte into one of the six job registers.
    Write(usize, u8),
    /// A command in `w_CPU_CONTROL`.
    Control(u16),
    Enable(u8),
    Length(u16),
    Error(u16),
    Silence,
}

fn step() -> impl Strategy<Value = Step> {
    let mode =
        prop_oneof![Just(0x80u8), Just(0x90), Just(0xA0), Just(0xB0), Just(0xD0), Just(0xE0), Just(0xF0)];
    // The strategy has few offsets and addresses, so that jobs match each other often enough.
    let likely = (mode, 0u8..5, prop_oneof![Just(0u8), Just(1)], any::<bool>()).prop_map(
        |(control, block, page, long)| {
            let len = if long { 8 } else { 2 };
            [control, 6 * block, 0, page, 0, 0, 0, 0][..len].to_vec()
        },
    );
    prop_oneof![
        4 => likely.prop_map(Step::Turn),
        2 => proptest::collection::vec(any::<u8>(), 0..=8).prop_map(Step::Turn),
        4 => (0usize..6, prop_oneof![any::<u8>(), Just(0x00), Just(0x54), Just(0x14), Just(0x82)])
            .prop_map(|(register, value)| Step::Write(register, value)),
        1 => prop_oneof![Just(0x0020u16), Just(0x0040), any::<u16>()].prop_map(Step::Control),
        1 => any::<u8>().prop_map(Step::Enable),
        1 => any::<u16>().prop_map(Step::Length),
        1 => any::<u16>().prop_map(Step::Error),
        1 => Just(Step::Silence),
    ]
}

fn take(bench: &mut Bench, step: Step) {
    let regs = &bench.regs;
    match step {
        Step::Turn(data) => {
            let frame = Frame::new(0x500 + u16::from(NUMBER), &data).expect("at most eight bytes");
            if let Some(answer) = bench.turn(&frame) {
                assert_eq!(answer.kind(), Some(FrameKind::Response(NUMBER)));
                let decoded = decode(&answer).expect("an answer of the grammar");
                let is_up_download = matches!(decoded, DecodedFrame::UpDownResponse { .. });
                assert_eq!(is_up_download, data[0] & 0x80 != 0, "{decoded:?} to {data:02X?}");
            }
        }
        Step::Write(register, value) => [
            &regs.b_STEUREG_PAR_CMD,
            &regs.b_STATREG_PAR_CMD,
            &regs.b_STEUREG_UPDOWNBLK1,
            &regs.b_STATREG_UPDOWNBLK1,
            &regs.b_STEUREG_UPDOWN_SINGLE,
            &regs.b_STATREG_UPDOWN_SINGLE,
        ][register]
            .store(value),
        Step::Control(value) => bench.command(value),
        Step::Enable(value) => regs.b_EN_UPDOWNBLK1.store(value),
        Step::Length(value) => {
            regs.w_LENGTH_UPDOWNBLK1.store(value);
            regs.w_LENGTH_UPDOWN_SINGLE.store(value);
        }
        Step::Error(value) => {
            regs.w_ERR_NR_UPDOWNBLK1.store(value);
            regs.w_ERR_NR_UPDOWN_SINGLE.store(value);
        }
        Step::Silence => bench.pass(10_000),
    }
}

proptest! {
    #[test]
    fn random_traffic_never_stops_a_slave_node(
        rate in proptest::sample::select(&FASTEST[..]),
        steps in proptest::collection::vec(step(), 1..60),
    ) {
        let mut bench = Bench::active(Memory::Heap, rate);
        for step in steps {
            take(&mut bench, step);
        }
        bench.start_over([0xFF, 0xFF]);
        let job = ParameterJob::new(300, Access::WriteWord(1)).unwrap();
        prop_assert_eq!(bench.parameter(&job).result(), ParameterResult::Busy);
        prop_assert_eq!(bench.regs.b_STEUREG_PAR_CMD.load(), 0x45);
    }
}
