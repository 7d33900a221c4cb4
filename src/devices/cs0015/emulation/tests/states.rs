//! Tests operating states, LED STAT, network management, the programming system, inputs and outputs.

use super::*;
use crate::devices::canopen::records::NodeState;
use crate::devices::cs0015::emulation::records::CommandRefused;
use crate::devices::cs0015::registers::values::program;
use crate::devices::cs0015::registers::{FRONT_INPUTS, FRONT_OUTPUTS, FRONT_S2, FRONT_S3, FRONT_S5};
use crate::layout::Width;
use crate::memory::Header;
use crate::memory::header::{ProgramState, Project, Start};

/// Manual p. 13-14.
#[test]
fn network_management_starts_and_stops_the_controller() {
    let mut bench = Bench::new("");
    bench.run(100 * MS);
    assert_eq!((bench.state(), bench.stat()), ("reset".into(), "green and red".into()));
    bench.run(150 * MS);
    let flags = |bench: &Bench| bench.registers.flags.COP_PREOPERATIONAL.load();
    assert_eq!((bench.state(), bench.stat(), flags(&bench)), ("run".into(), "green 0.5 Hz".into(), 1));
    assert_eq!(bench.heard(), [], "no boot-up message unless the plant file says so");
    bench.exchange(0, &[1, 32]);
    assert_eq!((bench.state(), bench.stat(), flags(&bench)), ("run".into(), "green 2 Hz".into(), 0));
    bench.exchange(0, &[2, 32]);
    assert_eq!((bench.state(), bench.stat(), flags(&bench)), ("stop".into(), "green".into(), 0));
    bench.exchange(0, &[128, 0]);
    assert_eq!((bench.state(), bench.stat(), flags(&bench)), ("run".into(), "green 0.5 Hz".into(), 1));
    bench.exchange(0, &[1, 33]);
    assert_eq!(bench.stat(), "green 0.5 Hz", "the command is for another node");
    let states: Vec<_> =
        bench.journal.records().filter_map(|record| record.event.get().map(|it: NodeState| it.to)).collect();
    assert_eq!(states, [127, 5, 4, 127]);
}

/// Manual p. 13-14, 28: the program starts warm after the reset, and continues with a hot start after a stop (D-630). A
/// process that attaches its program while the controller is in the state "run" requests a cold start; in the state
/// "stop" this request is refused.
#[test]
fn the_program_starts_and_stops_with_the_states() {
    let mut bench = Bench::new("program = 'attached'");
    let header = bench.segment.header().unwrap();
    let ordered = |header: &Header| {
        let kind = Start::from_code(header.program.start_kind.load()).unwrap();
        (header.program.start.rings(), kind)
    };
    bench.run(100 * MS);
    assert_eq!(ordered(&header), (0, Start::None), "the reset is still in progress");
    bench.registers.flags.CAN_OPEN.store(1);
    bench.run(150 * MS);
    assert_eq!((ordered(&header), header.project.load()), ((1, Start::Warm), Project::Boot.code()));
    bench.exchange(0, &[2, 0]);
    assert_eq!(ordered(&header), (2, Start::Stop));
    header.program.start_request.store(Start::Cold.code());
    bench.run(MS);
    assert_eq!((ordered(&header).0, header.program.start_request.load()), (2, 0), "refused in Stop");
    bench.exchange(0, &[128, 0]);
    assert_eq!(ordered(&header), (3, Start::Hot));
    // One program ends, and another program starts before the next check of the firmware.
    header.program.state.store(ProgramState::None.code());
    header.program.state.store(ProgramState::Stopped.code());
    header.program.start_request.store(Start::Cold.code());
    bench.run(MS);
    assert_eq!(
        (ordered(&header), header.program.state.load()),
        ((4, Start::Cold), ProgramState::Cyclic.code())
    );
    bench.power_cycle();
    assert_eq!(ordered(&header), (6, Start::Warm), "stopped without supply, then started");
    let without = Bench::running("program = 'none'");
    let header = without.segment.header().unwrap();
    assert_eq!((ordered(&header), header.project.load()), ((0, Start::None), Project::None.code()));
}

/// Manual p. 13.
#[test]
fn a_controller_without_a_program_stops_and_is_not_a_node() {
    let mut bench = Bench::running("program = 'none'");
    assert_eq!((bench.state(), bench.stat()), ("stop".into(), "green".into()));
    bench.exchange(0, &[1, 0]);
    bench.ask(0x720);
    bench.run(5 * MS);
    assert_eq!((bench.heard(), bench.state()), (vec![], "stop".into()));
    bench.command(program::RUN);
    assert_eq!(bench.state(), "stop");
}

#[test]
fn a_boot_up_message_is_sent_if_configured() {
    let boot_up = |keys: &str| {
        let mut bench = Bench::new(keys);
        bench.run(250 * MS);
        bench.heard()
    };
    assert_eq!(boot_up("boot_up = '700'"), [(0x720, vec![0])]);
    assert_eq!(boot_up("boot_up = 'empty-emcy', node_id = 5"), [(0x85, vec![])]);
}

/// Manual p. 43: only the communication restarts.
#[test]
fn a_reset_by_the_master_sets_a_flag_for_the_program() {
    for (command, is_node) in [(129, true), (130, false)] {
        let mut bench = Bench::operational("boot_up = '700'");
        bench.registers.tx.a_TX_PDO[0][0].store(7);
        bench.run(20 * MS);
        bench.heard();
        assert_eq!(bench.exchange(0, &[command, 0]), [(0x720, vec![0])]);
        let flags = &bench.registers.flags;
        let events = [&flags.COP_EVENT_RESETNODE, &flags.COP_EVENT_RESETCOM].map(|flag| flag.load());
        assert_eq!(events, if is_node { [1, 0] } else { [0, 1] });
        assert_eq!(bench.registers.tx.a_TX_PDO[0][0].load(), 7, "the program runs on");
        assert_eq!((bench.state(), bench.stat()), ("run".into(), "green 0.5 Hz".into()));
        bench.run(1000 * MS);
        assert_eq!(bench.registers.flags.COP_EVENT_RESETNODE.load(), u8::from(is_node));
    }
}

/// Manual p. 17, 28.
#[test]
fn a_controller_stopped_by_the_programming_system_is_not_started_by_the_master() {
    let mut bench = Bench::operational("");
    bench.set(FRONT_PROGRAM, program::STOP);
    assert_eq!(bench.state(), "run", "S1 is at LOCK");
    let refused = |record: crate::journal::Record| record.event.get::<CommandRefused>();
    assert_eq!(bench.journal.records().filter_map(refused).count(), 1);
    assert_eq!(bench.registers.flags.UNLOCK.load(), 0);
    bench.command(program::STOP);
    assert_eq!((bench.state(), bench.registers.flags.UNLOCK.load()), ("stop".into(), 1));
    for command in [1, 128] {
        bench.exchange(0, &[command, 0]);
        assert_eq!(bench.state(), "stop");
    }
    bench.ask(0x720);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x720, vec![4])], "it is still a node");
    bench.exchange(0, &[130, 0]);
    assert_eq!(bench.state(), "stop");
    bench.command(program::RUN);
    assert_eq!((bench.state(), bench.stat()), ("run".into(), "green 0.5 Hz".into()));
    bench.exchange(0, &[1, 0]);
    assert_eq!(bench.stat(), "green 2 Hz");
    bench.exchange(0, &[2, 0]);
    assert_eq!(bench.state(), "stop", "a stop of the master is always executed");
}

/// Manual p. 28: after a reset command the device is not a CANopen node until its program switches CANopen on. D-663.
#[test]
fn a_reset_command_begins_in_direct_mode() {
    let mut bench = Bench::running("program = 'attached'");
    let flags = &bench.registers.flags;
    flags.CAN_OPEN.store(1);
    flags.ERROR.store(1);
    bench.run(20 * MS);
    bench.send(0, &[1, 0]);
    bench.run(5 * MS);
    bench.command(program::RESET);
    bench.run(MS);
    assert_eq!(bench.state(), "reset");
    bench.run(250 * MS);
    let flags = &bench.registers.flags;
    assert_eq!((bench.state(), flags.CAN_OPEN.load(), flags.ERROR.load()), ("run".into(), 0, 0));
    bench.heard();
    bench.ask(0x720);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [], "it is no node");
    bench.registers.flags.CAN_OPEN.store(1);
    bench.run(20 * MS);
    bench.ask(0x720);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x720, vec![0x7F])]);
}

/// Manual p. 7: inputs 4 to 15 follow signals of at most 25 Hz.
#[test]
fn a_short_signal_at_a_slow_input_is_not_seen() {
    let mut bench = Bench::running("cycle_us = 1000");
    let seen = |bench: &mut Bench, ms: u64| {
        bench.set(FRONT_INPUTS, 0x8011);
        bench.run((ms - 1) * MS);
        bench.set(FRONT_INPUTS, 0);
        let mut seen = 0;
        for _ in 0..45 {
            bench.run(MS);
            seen |= bench.registers.inputs.I0.load();
        }
        seen & 0xFFF0
    };
    assert_eq!((seen(&mut bench, 18), seen(&mut bench, 21)), (0, 0x8010));
    bench.set(FRONT_INPUTS, 0x0011);
    bench.run(2 * MS);
    assert_eq!(bench.registers.inputs.I0.load(), 0x0001, "input 0 has no such filter");
}

/// Manual p. 11-12, 152-153.
#[test]
fn terminals_and_keys_are_inputs() {
    let mut bench = Bench::running("");
    bench.set(FRONT_INPUTS, 0x8001);
    bench.set(FRONT_S2, 15);
    bench.set(FRONT_S3, 1);
    bench.run(30 * MS);
    let inputs = |bench: &Bench| {
        let inputs = &bench.registers.inputs;
        (inputs.I0.load(), inputs.S2.load(), inputs.S3.load(), inputs.S4.load(), inputs.S5.load())
    };
    assert_eq!(inputs(&bench), (0x8001, 15, 1, 0, 0));
    bench.set(FRONT_S3, 0);
    bench.set(FRONT_S5, 1);
    bench.run(10 * MS);
    assert_eq!(inputs(&bench), (0x8001, 15, 0, 0, 1));
}

/// Manual p. 19: while the program reports an error, the outputs are off.
#[test]
fn outputs_are_driven_while_the_program_runs_without_error() {
    let mut bench = Bench::operational("");
    let outputs = |bench: &Bench| bench.registers.shown(FRONT_OUTPUTS).load();
    bench.registers.outputs.Q0.store(0x00FF);
    bench.run(20 * MS);
    assert_eq!(outputs(&bench), 0x00FF);
    bench.registers.flags.ERROR.store(1);
    bench.run(5 * MS);
    assert_eq!((outputs(&bench), bench.stat()), (0, "red 2 Hz".into()));
    assert_eq!(bench.heard(), [(0xA0, vec![0x00, 0x10, 0x01, 0, 0, 0, 0, 0])]);
    bench.exchange(0, &[128, 0]);
    assert_eq!(bench.stat(), "red 0.5 Hz");
    bench.registers.flags.ERROR.store(0);
    bench.run(5 * MS);
    assert_eq!((outputs(&bench), bench.stat()), (0x00FF, "green 0.5 Hz".into()));
    assert_eq!(bench.heard(), [(0xA0, vec![0; 8])]);
    bench.exchange(0, &[2, 0]);
    assert_eq!(outputs(&bench), 0, "D-427");
}

/// Manual p. 107, 154.
#[test]
fn only_retained_flags_survive_a_power_cycle() {
    let mut bench = Bench::running("");
    let flags = DEVICE.spaces.iter().find(|space| space.name == "flags").unwrap();
    // The operating system uses the words below %MW512 and the words of the PDOs.
    let words = [0, 127, 128, 600, 1500, 2000, 3967].map(|word| flags.offset + 2 * word);
    for word in words {
        bench.segment.store(word, Width::Word, 0x1234).unwrap();
    }
    bench.power_cycle();
    let left = words.map(|word| bench.segment.load(word, Width::Word).unwrap());
    assert_eq!(left, [0x1234, 0x1234, 0, 0, 0, 0, 0]);
    assert_eq!(bench.stat(), "green 0.5 Hz");
}
