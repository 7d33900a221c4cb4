#!/usr/bin/env python3
"""The work of tools/benches/cards.rs in a simulator of pymodbus: 200 registers, ten commands, process data of 32 bytes.

usage: peer_cards.py    wants `pip install pymodbus==3.16.1`

The device has an action in Python. A client stores command 5 and an output word in each emulated millisecond; the action
answers 4 when the client reads, and copies 16 words. Client and simulator are in one process, without Modbus and without a
network. pymodbus has no emulated time: the figure is the number of these milliseconds in one millisecond of processor time.
"""
import asyncio
import time

from pymodbus.simulator import DataType, SimData, SimDevice
from pymodbus.simulator.simruntime import SimRuntime

MILLISECONDS, ROUNDS, COMMANDS = 20_000, 5, 10
IN, OUT = 200, 216
READ, WRITE = 3, 16


async def firmware(function, start, address, count, registers, values):
    """Answers commands when the client reads them, and copies the process data."""
    if function == READ and address < COMMANDS and registers[address] == 5:
        registers[OUT : OUT + 16] = registers[IN : IN + 16]
        registers[address] = 4


async def measure():
    """Returns emulated time divided by processor time."""
    data = SimData(0, count=232, values=0, datatype=DataType.REGISTERS)
    device = SimRuntime(SimDevice(1, simdata=[data], action=firmware))
    begin = time.process_time()
    for ms in range(1, MILLISECONDS + 1):
        command = ms % COMMANDS
        await device.async_setValues(WRITE, IN, [ms & 0xFFFF])
        await device.async_setValues(WRITE, command, [5])
        answer = await device.async_getValues(READ, command, 1)
        assert answer == [4], answer
    took = time.process_time() - begin
    assert (await device.async_getValues(READ, OUT, 1)) == [MILLISECONDS & 0xFFFF]
    return MILLISECONDS / 1000 / took


speeds = sorted(asyncio.run(measure()) for _ in range(ROUNDS))
print(f"pymodbus action   {speeds[ROUNDS // 2]:.0f} times real time ({speeds[0]:.0f} to {speeds[-1]:.0f})")
