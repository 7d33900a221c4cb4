"""Cost of a poke, a step and a peek from Python; `cargo bench --bench cycles` measures the same in Rust.

    pip install ./tools/python        # a release build
    python3 tools/python/cycles.py
"""

import statistics
import time

import commram

CYCLES, ROUNDS = 100_000, 9
CONTROL, STATUS = "node2.w_CPU_CONTROL", "node2.w_OPTION_STATUS"
STEP_US = 50


def by_name(plant):
    poke, step, peek = plant.poke, plant.step, plant.peek
    for _ in range(CYCLES):
        poke(CONTROL, 0)
        step(STEP_US)
        peek(STATUS)


def by_handle(plant):
    poke, step, peek = plant.handle(CONTROL).poke, plant.step, plant.handle(STATUS).peek
    for _ in range(CYCLES):
        poke(0)
        step(STEP_US)
        peek()


def nothing(plant):
    """The loop alone."""
    for _ in range(CYCLES):
        pass


for name, cycle in (("by name", by_name), ("by handle", by_handle), ("empty loop", nothing)):
    times = []
    for _ in range(ROUNDS):
        with commram.Emulator() as plant:
            begin = time.perf_counter()
            cycle(plant)
            times.append((time.perf_counter() - begin) / CYCLES * 1e6)
    print(f"{name:<12} {statistics.median(times):.3f} us ({min(times):.3f} to {max(times):.3f})")
