"""This program runs a CS0015 by mmap and in lockstep. A node of canopen is connected to a door of its bus.

The program is the CANopen master. The class `Node` adds the functions that canopen's node lacks: answers to
node guarding, PDOs with SYNC, the end of a reset.

Usage: check_cs0015_master.py INSTANCE PORT BITRATE, with the module of `commram export python --device cs0015` beside it
"""

import os
import struct
import sys
import time

import can
import canopen
from canopen.objectdictionary import DOMAIN, UNSIGNED16, UNSIGNED32, VISIBLE_STRING, ODVariable

import commram

PATIENCE = 120
NUMBER = 5
CYCLE = 1
NAME = "a node of canopen"


def dictionary():
    """Device type, name, heartbeat time (which canopen wants) and a block."""
    entries = canopen.ObjectDictionary()
    for index, name, kind, default in [
        (0x1000, "device type", UNSIGNED32, 0x191),
        (0x1008, "device name", VISIBLE_STRING, NAME),
        (0x1017, "heartbeat time", UNSIGNED16, 0),
        (0x2000, "block", DOMAIN, None),
    ]:
        entry = ODVariable(name, index, 0)
        entry.data_type, entry.default, entry.access_type = kind, default, "rw"
        entries.add_object(entry)
    return entries


class Node(can.Listener):
    """Answers remote frames with its state and a toggle bit, and SYNC with a counter."""

    STATES = {"PRE-OPERATIONAL": 127, "OPERATIONAL": 5, "STOPPED": 4}

    def __init__(self, network):
        self.network = network
        self.node = canopen.LocalNode(NUMBER, dictionary())
        self.toggle = 0
        self.count = 0
        self.resets = 0
        self.is_silent = False

    def on_message_received(self, message):
        state = self.node.nmt.state
        if message.arbitration_id == 0x700 + NUMBER and message.is_remote_frame and not self.is_silent:
            self.network.send_message(0x700 + NUMBER, [self.STATES[state] | self.toggle])
            self.toggle ^= 0x80
        if message.arbitration_id == 0x80 and state == "OPERATIONAL":
            self.count += 1
            self.network.send_message(0x180 + NUMBER, struct.pack("<4H", self.count, 0, 0, 0))
        if message.arbitration_id == 0 and bytes(message.data) == bytes([129, NUMBER]):
            # The node of the package canopen must be in the state after a reset.
            self.node.nmt.state = "PRE-OPERATIONAL"
            self.resets += 1
            self.toggle = 0


class Task:
    """A seat for the event task of the program's cycle."""

    def __init__(self, ram):
        self.ram = ram
        with open("/proc/self/stat", encoding="utf-8") as stat:
            start = int(stat.read().rpartition(")")[2].split()[19])
        self.seen = ram.header("lockstep[0].turn.word")
        for field, value in {"owner": os.getpid(), "owner_start": start, "event": CYCLE, "patience_ms": 0}.items():
            ram.write_header(f"lockstep[0].{field}", value)
        self.state(1)
        self.until(lambda: ram.header("lockstep[0].state") == 2, "a seat")

    def state(self, state):
        self.ram.write_header("lockstep[0].state", state)
        self.ram.write_header("board_requests", self.ram.header("board_requests") + 1)

    def until(self, is_so, what):
        end = time.monotonic() + PATIENCE
        while not is_so():
            assert time.monotonic() < end, what
            self.ram.check()
            time.sleep(0.0005)

    def run(self, program):
        """Runs a step of the program in each cycle, until the program ends."""
        word = "lockstep[0].turn.word"
        for _ in program:
            self.ram.write_header("lockstep[0].run_us", 0)
            self.ram.write_header("lockstep[0].done.word", self.ram.header("lockstep[0].done.word") + 1)
            self.until(lambda: self.ram.header(word) != self.seen, "a cycle")
            self.seen = self.ram.header(word)
        self.state(0)
        self.ram.write_header("lockstep[0].owner", 0)
        self.ram.write_header("lockstep[0].done.word", self.ram.header("lockstep[0].done.word") + 1)


def order(ram, function, *arguments, data=b""):
    """Sends a request to the operating system. Returns results and data of the answer, some cycles later."""
    ram["jobs.a_FUNCTION[0]"] = function
    for number, argument in enumerate(arguments):
        ram[f"jobs.a_ARGUMENT[0][{number}]"] = argument
    for number, byte in enumerate(data):
        ram[f"jobs.a_DATA[0][{number}]"] = byte
    ram["jobs.a_LENGTH[0]"] = len(data)
    # Writes the data first, then the control register.
    ram["jobs.a_CONTROL[0]"] = commram.JOB_CONTROL.ORDER
    yield
    while ram["jobs.a_CONTROL[0]"] == commram.JOB_CONTROL.ORDER:
        yield
    assert ram["jobs.a_CONTROL[0]"] == commram.JOB_CONTROL.ANSWERED
    assert ram["jobs.a_ERROR[0]"] == 0, (function, arguments, ram.text("jobs.a_ERROR[0]"))
    results = [ram[f"jobs.a_RESULT[0][{number}]"] for number in range(8)]
    return results, bytes(ram[f"jobs.a_DATA[0][{number}]"] for number in range(ram["jobs.a_LENGTH[0]"]))


def guarded(ram, is_so, what):
    """Guards the nodes until a condition is true."""
    for _ in range(2000):
        results, _ = yield from order(ram, commram.JOB.NMM_NODE_GUARDING, 1)
        if is_so(results[0]):
            return
    raise AssertionError(what)


def state(ram):
    results, _ = yield from order(ram, commram.JOB.NMM_GET_NODE_STATE, NUMBER)
    return results[0]


def start(ram):
    ram["flags.CAN_OPEN"] = 1
    # The first receive PDO is the node's PDO; the master's configuration follows (p. 48).
    yield from order(ram, commram.JOB.PDO_RX_CONFIG, 1, 0x180 + NUMBER, 255)
    yield from order(ram, commram.JOB.NMM_SET_NMT_MASTER)
    results, _ = yield from order(ram, commram.JOB.NMM_ADD_NODE, NUMBER, 200, 4)
    assert results[0] == 0
    yield from order(ram, commram.JOB.NMM_START_GUARDING, NUMBER)
    yield from order(ram, commram.JOB.NMM_NODE_GUARDING, 1)
    while (yield from state(ram)) != 127:
        yield


def entries(ram, node):
    results, data = yield from order(ram, commram.JOB.SDO_READ, NUMBER, 0x1000, 0, 4)
    assert (results[0], data) == (1, struct.pack("<I", 0x191)), (results, data)
    results, data = yield from order(ram, commram.JOB.SDO_READ, NUMBER, 0x1008, 0, len(NAME))
    assert (results[0], data) == (1, NAME.encode()), (results, data)
    block = bytes(range(30))
    results, _ = yield from order(ram, commram.JOB.SDO_WRITE, NUMBER, 0x2000, 0, len(block), data=block)
    assert results[0] == 1 and node.node.get_data(0x2000, 0) == block
    results, data = yield from order(ram, commram.JOB.SDO_READ, NUMBER, 0x2000, 0, len(block))
    assert (results[0], data) == (1, block)
    results, _ = yield from order(ram, commram.JOB.SDO_READ, NUMBER, 0x1234, 0, 4)
    assert results[:2] == [0, 0x06020000], results


def exchange(ram, node):
    yield from order(ram, commram.JOB.NMM_SET_OPERATIONAL, 0)
    while node.node.nmt.state != "OPERATIONAL":
        yield
    assert ram["flags.COP_PREOPERATIONAL"] == 0, "the master itself, too"
    yield from order(ram, commram.JOB.PDO_INI_SEND_SYNC_OBJ)
    for count in range(1, 4):
        results, _ = yield from order(ram, commram.JOB.PDO_SEND_SYNC_OBJ)
        assert results[0] == 1
        while ram["rx_pdo.a_RX_PDO[0][0]"] != count:
            yield


def emergency(ram, node):
    node.node.emcy.send(0x8130, 0x11, bytes([1, 2, 3, 4, 5]))
    while True:
        results, data = yield from order(ram, commram.JOB.EMC_GET_EMERGENCY)
        if results[0]:
            break
    assert results[:4] == [1, NUMBER, 0x8130, 0x11] and data == bytes([1, 2, 3, 4, 5]), (results, data)


def failure(ram, node):
    node.is_silent = True
    yield from guarded(ram, lambda missing: missing == NUMBER, "it is missed")
    yield from guarded(ram, lambda _: node.resets > 1, "it is reset again and again")
    assert ram["flags.COP_GUARDFAIL_NODEID"] == NUMBER
    node.is_silent = False
    yield from guarded(ram, lambda missing: missing == 0, "it is back")
    yield from guarded(ram, lambda _: node.node.nmt.state == "OPERATIONAL", "it is started again")


def program(ram, node):
    yield
    for part in [start(ram), entries(ram, node), exchange(ram, node), emergency(ram, node), failure(ram, node)]:
        yield from part


def main(instance, port, bitrate):
    bus = can.Bus(
        interface="slcan", channel=f"socket://127.0.0.1:{port}", bitrate=bitrate, sleep_after_open=0
    )
    network = canopen.Network(bus=bus)
    node = Node(network)
    network.listeners.append(node)
    network.connect()
    network.add_node(node.node)
    node.node.nmt.state = "PRE-OPERATIONAL"
    try:
        with commram.attach(instance, "plc") as ram:
            Task(ram).run(program(ram, node))
    finally:
        network.disconnect()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
    print("a program by mmap is the master of a node of canopen")
