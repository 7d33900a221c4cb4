"""The soft-PLC of `tools/python` brings up a master and sees a drive answer."""

import soft_plc


def test_a_drive_returns_the_reference_value(emulator):
    running = emulator()
    with running.attach() as ram:
        soft_plc.bring_up(ram)
        assert soft_plc.exchange(ram, -4711) == -4711
    shown = running.command("peek", "--raw", f"node2.a_RD_BMARRAY[{soft_plc.DRIVE}][0]")
    assert shown == "16#FFFFED99\n"
