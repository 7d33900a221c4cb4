"""canopen as master of a CS0015 at a door: network management, the whole object dictionary, PDOs, SYNC, guarding, emergencies.

Usage: check_cs0015.py PORT BITRATE EDS
"""

import struct
import sys
import threading
import time

import can
import canopen
from canopen.objectdictionary import ODRecord, ODArray

PATIENCE = 60


def entries(dictionary):
    """Every entry with index and sub-index."""
    for thing in dictionary.values():
        if isinstance(thing, (ODRecord, ODArray)):
            yield from ((thing.index, variable.subindex, variable) for variable in thing.values())
        else:
            yield thing.index, 0, thing


def is_only_in_the_sheet(index, sub):
    """Entries that CiA 306 requires and the device does not have (D-770)."""
    return index == 0x1018 or sub == 0 and index in [*range(0x5800, 0x5880, 0x10), *range(0xA100, 0xA108)]


def read_everything(node):
    """Reads the whole object dictionary by SDO and compares it with the data sheet."""
    count = 0
    for index, sub, variable in entries(node.object_dictionary):
        if is_only_in_the_sheet(index, sub):
            try:
                node.sdo.upload(index, sub)
                raise AssertionError((hex(index), sub))
            except canopen.SdoAbortedError as abort:
                assert abort.code in (0x06020000, 0x06090011), abort
            continue
        data = node.sdo.upload(index, sub)
        count += 1
        if variable.data_type == canopen.objectdictionary.DOMAIN:
            assert len(data) == 256, (hex(index), len(data))
        elif variable.default is not None:
            assert variable.decode_raw(data) == variable.default, (hex(index), sub, data, variable.default)
    assert count == 215, count


def heard(network, identifier):
    """Returns a list that collects the messages with this identifier, and an event for each message."""
    data, event = [], threading.Event()

    def note(_, payload, __):
        data.append(bytes(payload))
        event.set()

    network.subscribe(identifier, note)
    return data, event


def boot_up(node):
    """Resets the communication. canopen waits for a message after the call, but the message may arrive before the wait."""
    for _ in range(PATIENCE):
        node.nmt.send_command(0x82)
        try:
            return node.nmt.wait_for_bootup(1)
        except canopen.nmt.NmtError:
            continue
    raise AssertionError("no boot-up message")


def exchange(network, node):
    node.nmt.state = "OPERATIONAL"
    transmit, has_come = heard(network, 0x1A0)
    node.sdo.download(0xA100, 1, struct.pack("<H", 0x1234))
    assert has_come.wait(PATIENCE) and transmit[-1] == b"\x34\x12" + bytes(6), transmit
    network.send_message(0x220, struct.pack("<4H", 0x1234, 0x5678, 1, 2))
    words = [struct.unpack("<H", node.sdo.upload(0x5800, word))[0] for word in range(1, 5)]
    assert words == [0x1234, 0x5678, 1, 2], words
    # The PDO is sent with every SYNC. The change takes effect when the node enters Operational the next time.
    node.sdo.download(0x1801, 2, b"\x01")
    node.nmt.state = "PRE-OPERATIONAL"
    node.nmt.state = "OPERATIONAL"
    synchronous, has_come = heard(network, 0x2A0)
    for count in range(1, 4):
        has_come.clear()
        network.sync.transmit()
        assert has_come.wait(PATIENCE) and len(synchronous) == count, synchronous


def emergency(node, code):
    """Waits for the last emergency to have this code. canopen's `wait` misses messages that arrive before the call."""
    end = time.monotonic() + PATIENCE
    while not (node.emcy.log and node.emcy.log[-1].code == code):
        assert time.monotonic() < end, (hex(code), node.emcy.log)
        time.sleep(0.01)
    return node.emcy.log[-1]


def guarding(network, node):
    node.sdo.download(0x100C, 0, struct.pack("<H", 200))
    node.sdo.download(0x100D, 0, b"\x02")
    answers, has_come = heard(network, 0x720)
    for _ in range(2):
        has_come.clear()
        network.send_message(0x720, [], remote=True)
        assert has_come.wait(PATIENCE)
    assert answers == [b"\x05", b"\x85"], answers
    assert emergency(node, 0x8100).register == 0x10
    network.send_message(0x720, [], remote=True)
    assert emergency(node, 0).register == 0
    node.sdo.download(0x100C, 0, b"\0\0")


def refusals(node):
    for index, sub, data, code in [
        (0x1000, 0, b"\0\0\0\0", 0x06010002),
        (0x1002, 0, b"\0", 0x06020000),
        (0x1400, 3, b"\0", 0x06090011),
        (0x1400, 2, b"\xFC", 0x06090030),
        (0x100C, 0, b"\0", 0x06070013),
        (0x2000, 0, bytes(257), 0x06070012),
    ]:
        try:
            node.sdo.download(index, sub, data)
            raise AssertionError(f"{index:X} takes {data}")
        except canopen.SdoAbortedError as abort:
            assert abort.code == code, (hex(index), abort)


def main(port, bitrate, eds):
    bus = can.Bus(
        interface="slcan", channel=f"socket://127.0.0.1:{port}", bitrate=bitrate, sleep_after_open=0
    )
    network = canopen.Network(bus=bus)
    network.connect()
    try:
        node = network.add_node(32, eds)
        node.sdo.RESPONSE_TIMEOUT = PATIENCE
        boot_up(node)
        read_everything(node)
        exchange(network, node)
        guarding(network, node)
        refusals(node)
        block = bytes(range(256))
        node.sdo.download(0x2000, 0, block)
        assert node.sdo.upload(0x2000, 0) == block
        # A new Node-ID that is entered twice takes effect at once.
        node.sdo.download(0x20F0, 0, b"\x05")
        node.sdo.download(0x20F1, 0, b"\x05")
        moved = network.add_node(5, eds)
        moved.sdo.RESPONSE_TIMEOUT = PATIENCE
        assert moved.sdo[0x100B].raw == 5
    finally:
        network.disconnect()


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
    print("canopen is the master of a CS0015")
