# The daily commands; `just` lists them.

default:
    @just --list

# Everything that CI checks.
ci:
    .ci/run

# The quick look after a change: format, lints, unit tests.
check:
    cargo fmt --all --check
    cargo clippy --workspace --all-targets --locked -- -D warnings
    cargo test --workspace --locked --lib

# One group of integration tests: attach, blocks, cli, device, docs, export.
group NAME *FILTER:
    cargo test --locked --test {{NAME}} {{FILTER}}

# The tutorial's scenarios.
scenarios:
    cargo run --quiet -- test tests/scenarios

# Renews the register pages.
registers:
    cargo run --quiet -- export md --output docs/devices/omega-drive-line-2/registers.md
    cargo run --quiet -- export md --device bm4-plc --output docs/devices/bm4-plc/registers.md
    cargo run --quiet -- export md --device cs0015 --output docs/devices/cs0015/registers.md
    cargo run --quiet -- export md --device can-dp2 --output docs/devices/can-dp2/registers.md
    cargo run --quiet -- export md --device cr201x --output docs/devices/cs0015/registers-cr201x.md

# All benchmarks; docs/internals/performance.md describes them.
bench:
    cargo bench --bench intervals --bench clusters --bench can_bus --bench cards --bench latency --bench sync_edge --bench cycles

# Instructions of an interval with 3 and with 32 drives, counted by valgrind's callgrind.
instructions:
    tools/benches/instructions

# Checks that take too long for every change: oldest compiler and dependencies, licences, release builds. Steps can be named.
nightly *STEPS:
    tools/nightly {{STEPS}}
