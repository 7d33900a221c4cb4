"""A soft-PLC in Python brings up a master and sees a drive answer."""

import commram

DRIVE = 1


def command(ram, value, status):
    ram["node2.w_CPU_CONTROL"] = value
    ram.wait("node2.w_OPTION_STATUS", status, timeout=20)


def bring_up(ram):
    command(ram, 0x0000, 0x0001)
    command(ram, 0x0001, 0x0002)
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
    command(ram, 0x0002, 0x0003)
    low, high = commram.CFG_WORD.ASSIGNED, commram.CFG_WORD.ASSIGNED | commram.CFG_WORD.HIGH_WORD
    ram["node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0"] = low
    ram["node2._CFG_WRC_WORD.b_CFG_WRC1_WORD1"] = high
    ram[f"node2.a_CFG_RDC_WORD[{DRIVE}].b_CFG_RDC1_WORD0"] = low
    ram[f"node2.a_CFG_RDC_WORD[{DRIVE}].b_CFG_RDC1_WORD1"] = high
    ram["node2.b_CTRLREG_RD_ORDER_RDC1"] = DRIVE
    command(ram, 0x0020, 0x0043)
    locked = commram.STAT_SL.RESPONSE | commram.STAT_SL.SYNCHRONIZED
    ram.wait(f"node2.a_STAT_SL[{DRIVE}]", locked, timeout=20)
    command(ram, 0x0040, 0x0080)


def test_a_drive_returns_the_reference_value(emulator):
    running = emulator()
    with running.attach() as ram:
        bring_up(ram)
        for _ in range(100):
            ram["node2.a_WR_VALUE[0]"] = -4711
            ram["node2.b_CTRLREG_WRC1"] = commram.SEND.DATA_WRITTEN_TO_BE_SENT
            ram.wait("node2.b_CTRLREG_WRC1", commram.SEND.TAKEN_OVER_AND_SENT)
            if ram[f"node2.a_RD_BMARRAY[{DRIVE}][0]"] == -4711:
                break
        assert ram[f"node2.a_RD_BMARRAY[{DRIVE}][0]"] == -4711
    shown = running.command("peek", "--raw", f"node2.a_RD_BMARRAY[{DRIVE}][0]")
    assert shown == "16#FFFFED99\n"
