"""A soft-PLC in Python: brings CANsync node 2 from start to active operation, waits until the drive with slave number 1
has locked, and sends it a reference value until its actual value is the same.

    commram export python --output commram.py
    commram with -- sh -c 'PYTHONPATH=. python3 tools/python/soft_plc.py $COMMRAM_INSTANCE 1000'

Exit code: 0 done, 1 the emulator did not answer as it should, 2 wrong use or not attached.
"""

import sys

import commram

DRIVE = 1
STATE_S = 10


def command(ram, value, status):
    """Gives a command and waits for the state that follows it."""
    ram["node2.w_CPU_CONTROL"] = value
    ram.wait("node2.w_OPTION_STATUS", status, STATE_S)


def initialization_data(ram):
    """Master at 500 kbit/s; one slave is expected."""
    for register, value in {
        "b_MA_SL_MODE": 0x00,
        "b_AC": 0xFF,
        "b_AM": 0xFF,
        "b_BT_0": 0x00,
        "b_BT_1": 0x1C,
        "b_OUTPUT_CONTROL": 0xFA,
        "b_CLOCK_DIVIDER": 0x07,
        "b_TIME_PATTERN": 2,
        f"a_SL_TYP[{DRIVE}]": commram.SL_TYP.EXPECTED,
    }.items():
        ram[f"node2.{register}"] = value


def mapping(ram):
    """Value 0 is words 0 and 1 of frame 1, in both directions."""
    low, high = commram.CFG_WORD.ASSIGNED, commram.CFG_WORD.ASSIGNED | commram.CFG_WORD.HIGH_WORD
    ram["node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0"] = low
    ram["node2._CFG_WRC_WORD.b_CFG_WRC1_WORD1"] = high
    ram[f"node2.a_CFG_RDC_WORD[{DRIVE}].b_CFG_RDC1_WORD0"] = low
    ram[f"node2.a_CFG_RDC_WORD[{DRIVE}].b_CFG_RDC1_WORD1"] = high
    ram["node2.b_CTRLREG_RD_ORDER_RDC1"] = DRIVE


def bring_up(ram):
    """Brings the node from any state to active operation with the drive locked."""
    command(ram, 0x0000, 0x0001)
    command(ram, 0x0001, 0x0002)
    initialization_data(ram)
    command(ram, 0x0002, 0x0003)
    mapping(ram)
    command(ram, 0x0020, 0x0043)
    locked = commram.STAT_SL.RESPONSE | commram.STAT_SL.SYNCHRONIZED
    ram.wait(f"node2.a_STAT_SL[{DRIVE}]", locked, STATE_S)
    command(ram, 0x0040, 0x0080)


def exchange(ram, value):
    """Sends the reference value until the drive's actual value is the same; returns the actual value."""
    for _ in range(100):
        # Stores the data first, then the control register. The firmware answers 16#04.
        ram["node2.a_WR_VALUE[0]"] = value
        ram["node2.b_CTRLREG_WRC1"] = commram.SEND.DATA_WRITTEN_TO_BE_SENT
        ram.wait("node2.b_CTRLREG_WRC1", commram.SEND.TAKEN_OVER_AND_SENT)
        if ram[f"node2.a_RD_BMARRAY[{DRIVE}][0]"] == value:
            break
    return ram[f"node2.a_RD_BMARRAY[{DRIVE}][0]"]


def main():
    try:
        instance, value = sys.argv[1], int(sys.argv[2], 0)
    except (IndexError, ValueError):
        print("usage: soft_plc.py INSTANCE VALUE", file=sys.stderr)
        return 2
    try:
        ram = commram.attach(instance)
    except commram.Error as error:
        print(error, file=sys.stderr)
        return 2
    with ram:
        try:
            bring_up(ram)
            actual = exchange(ram, value)
        except commram.Error as error:
            print(error, file=sys.stderr)
            return 1
    print(f"a_RD_BMARRAY[{DRIVE}][0] = {actual}")
    return 0 if actual == value else 1


if __name__ == "__main__":
    sys.exit(main())
