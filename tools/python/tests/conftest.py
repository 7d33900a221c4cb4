"""Runs the program where a test needs a running instance: COMMRAM names it, as in tests/python."""

import os
import subprocess
import uuid

import commram
import pytest

pytest_plugins = ["pytester"]


@pytest.fixture
def emulator():
    with commram.Emulator() as plant:
        yield plant


@pytest.fixture
def program():
    path = os.environ.get("COMMRAM")
    if not path:
        if os.environ.get("COMMRAM_REQUIRE_TOOLS"):
            pytest.fail("COMMRAM is to name the program")
        pytest.skip("COMMRAM does not name the program")
    return path


@pytest.fixture
def start(program):
    """Starts instances; all end with the test. Returns their names."""
    running = []

    def start(*arguments):
        name = f"pkg-{os.getpid()}-{uuid.uuid4().hex[:8]}"
        command = [program, "run", "-i", name, *arguments]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        running.append((name, process))
        ready = process.stdout.readline()
        assert "ready" in ready, ready
        return name

    start.processes = running
    yield start
    for name, process in running:
        if process.poll() is None:
            process.terminate()
            process.wait(timeout=60)
        process.stdout.close()
        subprocess.run([program, "stop", "--clean", "-i", name], capture_output=True, check=False)


@pytest.fixture
def stepped(start):
    return start("--clock", "stepped")


def bring_up(plant):
    """Brings a master from power-on to active operation with drive 1 locked: the steps of docs/guide/python.md."""
    plant.poke("node2.w_CPU_CONTROL", 0x0001)
    plant.wait("node2.w_OPTION_STATUS", 0x0002, "1ms")
    for register, value in {
        "b_BT_1": 0x1C,
        "b_TIME_PATTERN": 2,
        "b_AC": 0xFF,
        "b_AM": 0xFF,
        "b_OUTPUT_CONTROL": 0xFA,
        "b_CLOCK_DIVIDER": 0x07,
        "a_SL_TYP[1]": 1,
    }.items():
        plant.poke(f"node2.{register}", value)
    plant.poke("node2.w_CPU_CONTROL", 0x0002)
    plant.wait("node2.w_OPTION_STATUS", 0x0003, "1ms")
    for direction in ("_CFG_WRC_WORD.b_CFG_WRC1", "a_CFG_RDC_WORD[1].b_CFG_RDC1"):
        plant.poke(f"node2.{direction}_WORD0", 0x01)
        plant.poke(f"node2.{direction}_WORD1", 0x03)
    plant.poke("node2.b_CTRLREG_RD_ORDER_RDC1", 1)
    plant.poke("node2.w_CPU_CONTROL", 0x0020)
    plant.wait("node2.a_STAT_SL[1]", 3, "2s")
    plant.poke("node2.w_CPU_CONTROL", 0x0040)
    plant.wait("node2.w_OPTION_STATUS", 0x0080, "10ms")
