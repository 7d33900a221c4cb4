"""Threads, the interpreter's lock, Ctrl-C."""

import subprocess
import sys
import threading
import time

import commram
import pytest


def test_every_thread_may_use_a_plant(emulator):
    errors, rounds = [], 500

    def work(register):
        try:
            for value in range(rounds):
                emulator.poke(register, value & 0xFF)
                assert emulator.peek(register) == value & 0xFF
                emulator.step(10)
        except BaseException as error:
            errors.append(error)

    registers = [f"node2.a_SL_TYP[{number}]" for number in range(4)]
    threads = [threading.Thread(target=work, args=(register,)) for register in registers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == [] and emulator.now() == 4 * rounds * 10


def test_other_threads_run_while_time_passes(emulator):
    counted, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0)

    thread = threading.Thread(target=count)
    before = sys.getswitchinterval()
    try:
        thread.start()
        # From here on, Python switches threads only where a thread releases the interpreter's lock itself.
        sys.setswitchinterval(3600)
        seen = counted[0]
        # Seconds without events take almost no real time.
        emulator.step("1h")
        assert counted[0] > seen
    finally:
        sys.setswitchinterval(before)
        stop.set()
        thread.join()


INTERRUPTED = """
import signal, commram
{make}
signal.signal(signal.SIGALRM, signal.default_int_handler)
try:
    signal.setitimer(signal.ITIMER_REAL, 0.2)
    {wait}
except KeyboardInterrupt:
    print("interrupted")
print(plant.peek("node2.w_OPTION_STATUS"))
"""
LONG_US = 36_000_000_000_000


def interrupted(make, wait):
    code = INTERRUPTED.format(make=make, wait=wait)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout == "interrupted\n1\n", done.stderr


@pytest.mark.parametrize(
    "wait",
    [
        f"plant.step({LONG_US})",
        f"plant.wait('node2.w_OPTION_STATUS', 0x0080, {LONG_US})",
        f"plant.wait_until(lambda: False, {LONG_US})",
        f"plant.expect_frame('drives', 0x010, '*', {LONG_US})",
    ],
)
def test_ctrl_c_ends_a_wait(wait):
    interrupted("plant = commram.Emulator()", wait)


def test_ctrl_c_ends_a_wait_on_running_instances(start):
    name = start()
    attach, connect = f"plant = commram.attach({name!r})", f"plant = commram.connect({name!r})"
    interrupted(attach, "plant.wait('node2.w_OPTION_STATUS', 2, timeout=3600)")
    interrupted(attach, "plant.wait('node2.w_OPTION_STATUS', lambda value: False, timeout=3600)")
    interrupted(connect, "plant.wait('node2.w_OPTION_STATUS', 2, 3_600_000_000)")


HANDLED = """
import signal, sys, commram
{make}
def handle(number, frame):
    {handle}
signal.signal(signal.SIGALRM, handle)
signal.setitimer(signal.ITIMER_REAL, 0.2)
try:
    {wait}
except BaseException as error:
    print(type(error).__name__, error)
print(plant.closed)
"""
MAKE, STEP = "plant = commram.Emulator()", f"plant.step({LONG_US})"
BUSY = "Error this is busy: a signal handler or finalizer cannot use it during a verb of its thread; "
CLOSED = "Error this is closed; make a new one"


def handled(handle, make=MAKE, wait=STEP):
    code = HANDLED.format(make=make, handle=handle, wait=wait)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stderr == ""
    return done.stdout.splitlines()


@pytest.mark.parametrize(
    "handle",
    [
        "plant.poke('node2.b_BT_1', 3)",
        "plant.node2.b_BT_1",
        "plant.handle('node2.b_BT_1')",
        "plant.now()",
        "plant.plcs",
        "plant.step('1ms')",
    ],
)
def test_a_signal_handler_is_refused_the_plant_of_the_interrupted_verb(handle):
    refusal, closed = handled(handle)
    assert refusal.startswith(BUSY) and closed == "False"


def test_a_signal_handler_can_describe_the_plant_of_the_interrupted_verb():
    lines = handled("print(repr(plant), plant.closed); raise KeyboardInterrupt('enough')")
    assert lines == ["<Emulator, busy> False", "KeyboardInterrupt enough", "False"]


@pytest.mark.parametrize(
    "wait",
    [STEP, f"plant.wait('node2.w_OPTION_STATUS', 0x0080, {LONG_US})", f"plant.wait_until(lambda: False, {LONG_US})"],
)
def test_a_signal_handler_that_closes_a_plant_ends_the_verb(wait):
    assert handled("plant.close(); print(plant.closed)", wait=wait) == ["True", CLOSED, "True"]
    assert handled("plant.close(); sys.exit(7)", wait=wait) == ["SystemExit 7", "True"]


def test_a_signal_handler_may_use_and_close_a_connection(start):
    name, stepped = start(), start("--clock", "stepped")
    connect = f"plant = commram.connect({name!r})"
    wait = "plant.wait('node2.w_OPTION_STATUS', 2, 3_600_000_000)"
    assert handled("plant.now()", connect, wait)[0].startswith(BUSY)
    assert handled("plant.close()", connect, wait) == [CLOSED, "True"]
    assert handled("plant.close()", f"plant = commram.connect({stepped!r})") == [CLOSED, "True"]
    attach, wait = f"plant = commram.attach({name!r})", "plant.wait('node2.w_OPTION_STATUS', 2, timeout=3600)"
    assert handled("plant.close()", attach, wait) == [CLOSED, "True"]


FORKED = """
import os, sys, commram
plant = commram.connect({name!r})
child = os.fork()
if child == 0:
    try:
        plant.now()
    except commram.Error as error:
        print(type(error).__name__, error, flush=True)
    {end}
    sys.exit(0)
print(os.waitpid(child, 0)[1])
print(plant.peek("node2.w_OPTION_STATUS"))
"""


FORKED_IN_A_STEP = """
import os, sys, threading, commram
plant, end = commram.Emulator(), threading.Event()

def work():
    while not end.is_set():
        plant.step("100ms")

worker = threading.Thread(target=work)
worker.start()
# In several of these processes, the other thread is in a step at the moment of the fork.
for _ in range(20):
    child = os.fork()
    if child == 0:
        for use in (lambda: plant.now(), lambda: plant["node2.b_BT_0"], lambda: plant.names()):
            try:
                use()
            except commram.Error as error:
                print(type(error).__name__, error, flush=True)
        print(plant.closed, repr(plant), flush=True)
        {end}
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
end.set()
worker.join()
print(plant.now() > 0)
"""


@pytest.mark.parametrize("end", ["plant.close()", "del plant, work, use"])
def test_an_emulator_stays_with_its_process(end):
    code = FORKED_IN_A_STEP.format(end=end)
    # Later versions of Python warn of a fork in a process with threads.
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=120)
    lines = done.stdout.splitlines()
    assert done.stderr == "" and lines.pop() == "True" and len(lines) == 80, done
    for number, line in enumerate(lines):
        right = "True <Emulator, closed>" if number % 4 == 3 else "Error this plant belongs to process "
        assert line.startswith(right), line


@pytest.mark.parametrize("end", ["plant.close()", "plant = None", "pass"])
def test_a_connection_outlives_a_forked_process(start, end):
    code = FORKED.format(name=start("--clock", "stepped"), end=end)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    lines = done.stdout.splitlines()
    assert done.stderr == "" and lines[0].startswith("Error this connection belongs to process "), done
    assert lines[1:] == ["0", "1"]
