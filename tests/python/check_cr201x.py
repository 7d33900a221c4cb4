"""canopen as master of an I/O module at a door: its dictionary, its configuration, outputs and currents with SYNC.

Usage: check_cr201x.py PORT BITRATE EDS
"""

import struct
import sys
import threading

import can
import canopen

PATIENCE = 60
NUMBER = 3


def main(port, bitrate, eds):
    bus = can.Bus(
        interface="slcan", channel=f"socket://127.0.0.1:{port}", bitrate=bitrate, sleep_after_open=0
    )
    network = canopen.Network(bus=bus)
    network.connect()
    try:
        node = network.add_node(NUMBER, eds)
        node.sdo.RESPONSE_TIMEOUT = PATIENCE
        assert (node.sdo[0x1000].raw, node.sdo[0x1008].raw) == (0x191, "CR2011")
        # A pair of current-controlled outputs; a CR2011 has no inputs.
        node.sdo[0x2000][1].raw = 5
        try:
            node.sdo[0x2000][1].raw = 1
            raise AssertionError("it has inputs")
        except canopen.SdoAbortedError as abort:
            assert abort.code == 0x06090030, abort
        node.nmt.state = "OPERATIONAL"
        told, has_come = [], threading.Event()

        def note(_, data, __):
            told.append(struct.unpack("<4h", data))
            has_come.set()

        network.subscribe(0x280 + NUMBER, note)
        network.send_message(0x300 + NUMBER, struct.pack("<4h", -500, 0, 0, 0))
        network.sync.transmit()
        assert has_come.wait(PATIENCE) and told[-1] == (500, 0, 0, 0), told
        assert node.sdo[0x6411][1].raw == 0x10000 - 500
    finally:
        network.disconnect()


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
    print("canopen is the master of an I/O module")
