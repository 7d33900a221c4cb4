//! Journal records of the BAPS.

use super::bench::*;
use crate::rig::Memory;
use commram::journal::Format;
use commram::journal::text::Text;

fn journal_text(bench: &Bench) -> String {
    let mut text = Text::new(bench.plant.names(), commram::devices::catalogue());
    let mut out = String::new();
    for record in bench.plant.journal().records() {
        text.record(&record, &mut out);
    }
    out
}

#[test]
fn commands_acknowledgements_and_jobs() {
    let mut bench = Bench::new(Memory::Heap, "");
    bench.configure(SAME_CYCLE, &[], &[]);
    bench.exchange(1);
    bench.regs.w_CONTROLWORD.store(0x0006);
    bench.exchange(2);
    bench.read(999);
    let found = journal_text(&bench);
    let expected = "
0.000500 s line:baps b_SL_QUIT (%MB3.80005) 16#FF -> 16#02, configured
0.000500 s line:baps b_COMMAND (%MB3.80004) 16#02 -> 16#00
0.001000 s line:baps w_STATUSWORD (%MW3.80010) 16#0000 -> 16#0050
0.001000 s line:baps b_SL_QUIT (%MB3.80005) 16#FF -> 16#01, reference values read, actual values written
0.001000 s line:baps b_COMMAND (%MB3.80004) 16#01 -> 16#00
0.002000 s line:baps w_STATUSWORD (%MW3.80010) 16#0050 -> 16#0031
0.004500 s line:baps i_ERR_DETAIL (%MW3.80120) 16#0000 -> 16#FFFB, no such element
0.004500 s line:baps b_SL_SEMAPHORE (%MB3.80109) 16#00 -> 16#01, job
0.005500 s line:baps b_SL_SEMAPHORE (%MB3.80109) 16#01 -> 16#00, idle";
    let found: Vec<String> =
        found.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    for line in expected.lines().skip(1) {
        assert!(found.iter().any(|found| found.starts_with(line)), "{line}\n{}", found.join("\n"));
    }
}
