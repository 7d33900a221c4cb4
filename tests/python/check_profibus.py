"""pyprofibus as DP master of the gateway, with a seat in lockstep at the door of its PROFIBUS (docs/devices/can-dp2/overview.md),
or over a serial line in real time.

Usage: check_profibus.py PORT|/dev/pts/NUMBER
It exchanges data until its outputs have come back as inputs.
"""

import socket
import struct
import sys
from collections import deque

from pyprofibus import DPM1
from pyprofibus.dp import DpCfgDataElement, DpTelegram_ChkCfg_Req, DpTelegram_SetPrm_Req
from pyprofibus.dp_master import DpSlaveDesc
from pyprofibus.phy import CpPhy
from pyprofibus import dp_master, phy as phy_module, util

SLAVE, MASTER = 5, 2
# Duration of a poll at 500 kbit/s: five milliseconds.
BITS = 2500
OUTPUTS, ANSWER = b"\x12\x34" + bytes(6), b"\xab\xcd"


class Door(CpPhy):
    """The bus line: telegrams with bit times."""

    def __init__(self, port):
        super().__init__()
        self.stream = socket.create_connection(("127.0.0.1", port)).makefile("rwb")
        self.heard = deque()
        self.now = 0

    def say(self, octets, at=0):
        self.stream.write(struct.pack("<HQ", len(octets), at) + bytes(octets))
        self.stream.flush()

    def sendData(self, telegramData, srd):
        self.say(telegramData)

    def pollData(self, timeout=0.0):
        if not self.heard:
            self.say(b"", self.now + BITS)
            while True:
                head = self.stream.read(10)
                assert len(head) == 10, "the door was shut"
                length, self.now = struct.unpack("<HQ", head)
                if length == 0:
                    break
                self.heard.append(bytearray(self.stream.read(length)))
        return self.heard.popleft() if self.heard else None


def slave():
    description = DpSlaveDesc()
    description.slaveAddr = SLAVE
    description.name = "gw"
    # The slave receives outputs and sends inputs.
    description.inputSize = description.outputSize = 8
    description.setPrmTelegram = DpTelegram_SetPrm_Req(da=SLAVE, sa=None)
    description.setPrmTelegram.identNumber = 0x04A4
    description.chkCfgTelegram = DpTelegram_ChkCfg_Req(da=SLAVE, sa=None)
    # Configures a CANopen master with start frame at 125 kbit/s, and in each direction one word from 220h on with
    # swapped bytes.
    description.setUserPrmData(bytes([0, 6, 0x06, 1, 0, 0, 0, 0, 0]))
    description.setCfgDataElements([
        DpCfgDataElement(0x83, bytes([0x87, 0x02, 0x20, 0xAA])),
        DpCfgDataElement(0x43, bytes([0x87, 0x01, 0xA0, 0xAA])),
    ])
    return description


def main():
    if sys.argv[1].startswith("/"):
        from pyprofibus.phy_serial import CpPhySerial
        phy = CpPhySerial(port=sys.argv[1])
    else:
        phy = Door(int(sys.argv[1]))
        # The timeouts of pyprofibus use the time of the bus, which does not advance between steps of the plant's clock.
        for module in (dp_master, phy_module, util):
            module.monotonic_time = lambda: phy.now / 500000
    phy.setConfig(baudrate=500000)
    master, description = DPM1(phy, MASTER), slave()
    master.addSlave(description)
    master.initialize()
    inputs = None
    while inputs is None or bytes(inputs[:2]) != ANSWER:
        description.setMasterOutData(OUTPUTS)
        master.run()
        inputs = description.getMasterInData() or inputs
    assert description.isConnected()
    print("pyprofibus exchanges data")


main()
