"""Validates a unit with FMPy and runs it: with a list of writes, with a mechanical model, from saved states, several at once.

check_fmu.py UNIT WRITES: WRITES has lines `TIME_US NAME VALUE`; without a value the variable is printed.
"""

import ctypes
import math
import shutil
import sys
import time

import fmpy
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

STEP = 0.001  # seconds

problems = validate_fmu(sys.argv[1])
print("problems", problems)
description = fmpy.read_model_description(sys.argv[1])
variables = {variable.name: variable for variable in description.modelVariables}
directory = fmpy.extract(sys.argv[1])


class Machine:
    """An instance, with its variables by name."""

    def __init__(self, name, start=0.0, stop=None):
        self.said = []
        self.unit = FMU3Slave(
            guid=description.guid,
            unzipDirectory=directory,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        log = lambda environment, status, category, text: self.said.append(text.decode())
        self.unit.instantiate(loggingOn=True, logMessage=log)
        self.unit.enterInitializationMode(startTime=start, stopTime=stop)
        self.unit.exitInitializationMode()
        self.start, self.us = start, 0

    def __getitem__(self, name):
        variable = variables[name]
        return getattr(self.unit, f"get{variable.type}")([variable.valueReference])[0]

    def __setitem__(self, name, value):
        variable = variables[name]
        getattr(self.unit, f"set{variable.type}")([variable.valueReference], [value])

    def to(self, us):
        while self.us < us:
            size = min(us - self.us, round(STEP * 1e6))
            self.unit.doStep(self.start + self.us / 1e6, size / 1e6)
            self.us += size

    def does(self, path):
        """Yields the printed values, in the order of the list."""
        for line in open(path):
            us, name, *value = line.split()
            self.to(int(us))
            if value:
                self[name] = int(value[0])
            else:
                yield f"{us} {name} {self[name]}"

    def end(self):
        self.unit.terminate()
        self.unit.freeInstance()


# Runs the same steps in two units at once, with different start times.
one, two = Machine("one"), Machine("two", start=100.0)
for line, other in zip(one.does(sys.argv[2]), two.does(sys.argv[2])):
    assert line == other, (line, other)
    print(line)

# Models a motor that follows the drive's demand with a time constant, against friction. The master reads the values of
# the drive.
TIME_CONSTANT, SPEED = 0.02, 100.0  # seconds, rad/s
INCREMENTS = 2**32 / (2 * math.pi) / 1000
one["drive1.is_modelled"] = True
one["node2.a_WR_VALUE[0]"] = round(SPEED * INCREMENTS)
speed, seen = 0.0, []
for cycle in range(150):
    one["node2.b_CTRLREG_WRC1"] = 5
    for _ in range(2):
        demand = one["drive1.speed_demand"] if one["drive1.is_fed"] else 0.0
        speed += STEP / TIME_CONSTANT * (0.98 * demand - speed)
        one["drive1.speed_modelled"] = speed
        one.to(one.us + 1000)
    seen.append(one["node2.a_RD_BMARRAY[1][0]"] / INCREMENTS)
assert 5 < seen[8] < 60 and abs(seen[-1] - 98) < 0.5, seen
assert seen[5:] == sorted(seen[5:]), seen
print("loop closed", round(seen[-1]))

# A restored state continues identically in the same unit, and as bytes in the other unit.
state = one.unit.getFMUState()
saved, at = one.unit.serializeFMUState(state), one.us


def onwards(machine):
    machine["node2.a_WR_VALUE[0]"] = 4711
    machine["node2.b_CTRLREG_WRC1"] = 5
    machine["drive1.is_modelled"] = False
    machine.to(machine.us + 6000)
    return [machine[name] for name, it in sorted(variables.items()) if it.causality == "output"]


first = onwards(one)
one.unit.setFMUState(state)
one.us = at
assert onwards(one) == first
one.unit.freeFMUState(state)
two.unit.setFMUState(two.unit.deserializeFMUState(saved))
two.us, two.start = at, 0.0
print("state", onwards(two) == first)


def refused(what, *wanted, by=two):
    try:
        what()
    except Exception:
        assert all(text in by.said[-1] for text in wanted), by.said
        return
    raise AssertionError(f"not refused: {wanted}")


refused(lambda: two.unit.doStep(two.us / 1e6 + 1, 0.001), "a step begins at", "but the unit is at")
refused(lambda: two.unit.doStep(two.us / 1e6, -0.001), "must not be negative")
refused(lambda: two.unit.getUInt8([1 << 20]), "there is no variable")
refused(lambda: two.unit.getUInt8([variables["node2.w_CPU_CONTROL"].valueReference]), "is of type UInt16")
refused(lambda: two.unit.setUInt16([variables["node2.w_OPTION_STATUS"].valueReference], [1]), "is an output")
before = two["node2.w_CPU_CONTROL"]
several = [variables[name].valueReference for name in ["node2.w_CPU_CONTROL", "node2.w_OPTION_STATUS"]]
refused(lambda: two.unit.setUInt16(several, [before ^ 1, 1]), "is an output")
assert two["node2.w_CPU_CONTROL"] == before
refused(lambda: two.unit.deserializeFMUState(saved[:-9]), "no state")
three = Machine("three", start=1.0, stop=1.005)
three.to(5000)
refused(lambda: three.to(6000), "a step ends at", "with the stop time 1.005 s", by=three)
three.unit.reset()
refused(lambda: three.unit.enterInitializationMode(startTime=1.0, stopTime=0.5), "must not be earlier", by=three)
three.unit.setDebugLogging(True, ["findings", "logStatusError"])
unknown = lambda: three.unit.setDebugLogging(True, ["findings", "logAll"])
refused(unknown, "no log category 'logAll'", "logStatusError, findings", by=three)
three.unit.freeInstance()
told = []
report = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)(
    lambda _environment, status, category, text: told.append((status, category, text))
)
texts, switches = [ctypes.c_char_p(b"")] * 3, [ctypes.c_bool(False)] * 2
for kind, others, name in (
    ("ModelExchange", [], b"model exchange"),
    ("ScheduledExecution", [ctypes.c_void_p()] * 3, b"scheduled execution"),
):
    make = getattr(ctypes.CDLL(two.unit.dll._name), f"fmi3Instantiate{kind}")
    make.restype = ctypes.c_void_p
    assert make(*texts, *switches, ctypes.c_void_p(), report, *others) is None
    status, category, text = told.pop()
    assert (status, category) == (3, b"logStatusError") and name in text and b"fmi3InstantiateCoSimulation" in text, text
print("refused")

# Runs the loop of FMPy, and measures the real time for a minute of machine time.
started = time.monotonic()
two["drive2.is_modelled"] = True
for _ in range(int(sys.argv[3]) if len(sys.argv) > 3 else 1000):
    two["drive2.speed_modelled"] = two["drive2.speed_demand"]
    two["node2.b_CTRLREG_WRC1"] = 5
    two.to(two.us + 1000)
took = time.monotonic() - started
one.end()
two.end()
result = fmpy.simulate_fmu(sys.argv[1], stop_time=0.01, output=["node2.w_OPTION_STATUS"])
print("simulated", len(result), result["node2.w_OPTION_STATUS"][-1])
print(f"took {took:.3f} s", file=sys.stderr)
shutil.rmtree(directory)
