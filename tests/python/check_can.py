"""Two external stacks at a door of a CAN bus: python-can, and canopen as master and as slave (docs/reference/can.md).

Usage: check_can.py PORT BITRATE
"""

import sys

import can
import canopen
from canopen.objectdictionary import ODVariable, ObjectDictionary, datatypes

PATIENCE = 60


def open_bus(port, bitrate):
    return can.Bus(
        interface="slcan", channel=f"socket://127.0.0.1:{port}", bitrate=bitrate, sleep_after_open=0
    )


def raw_frames(port, bitrate):
    """Frames of all four kinds arrive unchanged at the other side."""
    with open_bus(port, bitrate) as one, open_bus(port, bitrate) as other:
        sent = [
            can.Message(arbitration_id=0x123, is_extended_id=False, data=bytes(range(8))),
            can.Message(arbitration_id=0x18FF1234, is_extended_id=True, data=b"\x01\x02"),
            can.Message(arbitration_id=0x720, is_extended_id=False, is_remote_frame=True, dlc=1),
            can.Message(arbitration_id=0x1FFFFFFF, is_extended_id=True, is_remote_frame=True, dlc=0),
            can.Message(arbitration_id=0, is_extended_id=False, data=b""),
        ]
        for message in sent:
            one.send(message)
        for message in sent:
            heard = other.recv(PATIENCE)
            assert heard is not None and heard.equals(message, timestamp_delta=None, check_channel=False,
                                                      check_direction=False), (heard, message)
        assert one.recv(0.05) is None, "nobody hears itself"


def dictionary():
    od = ObjectDictionary()
    for index, name, data_type, default in [
        (0x1000, "device type", datatypes.UNSIGNED32, 0x191),
        (0x1017, "heartbeat", datatypes.UNSIGNED16, 0),
        (0x2000, "speed", datatypes.INTEGER16, -7),
        (0x2001, "name", datatypes.VISIBLE_STRING, "a name that takes more than one segment"),
    ]:
        variable = ODVariable(name, index)
        variable.data_type = data_type
        variable.default = default
        variable.access_type = "rw"
        od.add_object(variable)
    return od


def canopen_both_ends(port, bitrate):
    slave_side, master_side = (canopen.Network(bus=open_bus(port, bitrate)) for _ in range(2))
    slave_side.connect()
    master_side.connect()
    try:
        slave = slave_side.create_node(5, dictionary())
        node = master_side.add_node(5, dictionary())
        node.sdo.RESPONSE_TIMEOUT = PATIENCE
        slave.nmt.send_command(0)
        assert node.sdo[0x1000].raw == 0x191
        node.sdo[0x2000].raw = 1234
        assert slave.sdo[0x2000].raw == 1234 and node.sdo[0x2000].raw == 1234
        assert node.sdo[0x2001].raw == "a name that takes more than one segment"
        node.sdo[0x2001].raw = "another one, which is a little longer than that"
        assert slave.sdo[0x2001].raw == "another one, which is a little longer than that"
        try:
            node.sdo.upload(0x3000, 0)
            raise AssertionError("there is no such object")
        except canopen.SdoAbortedError as abort:
            assert abort.code == 0x06020000, abort
        slave.emcy.send(0x2310, 2, b"\x01\x02")
        emergency = node.emcy.wait(0x2310, PATIENCE)
        assert (emergency.code, emergency.register) == (0x2310, 2), emergency
        slave.nmt.start_heartbeat(20)
        node.nmt.state = "OPERATIONAL"
        while slave.nmt.state != "OPERATIONAL" or node.nmt.wait_for_heartbeat(PATIENCE) != "OPERATIONAL":
            pass
        slave.nmt.stop_heartbeat()
    finally:
        master_side.disconnect()
        slave_side.disconnect()


if __name__ == "__main__":
    arguments = int(sys.argv[1]), int(sys.argv[2])
    raw_frames(*arguments)
    canopen_both_ends(*arguments)
    print("python-can and canopen agree")
