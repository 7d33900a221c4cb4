"""Names in the exported module, and its errors. The package of the same name behaves in the same way."""

import csv
import io
import os
import re
import shutil
import subprocess
import time

import commram
import pytest
from conftest import PROGRAM


def exported(kind):
    return subprocess.run([PROGRAM, "export", kind], check=True, capture_output=True, text=True).stdout


def test_every_register_has_the_address_of_the_map():
    rows = {row["name"]: row for row in csv.DictReader(io.StringIO(exported("csv")))}
    names = list(commram.names())
    assert len(names) == len(set(names))
    assert set(names) == set(rows)
    for name in names:
        found, row = commram.register(name), rows[name]
        assert found.iec_address == row["address"], name
        assert found.owner == row["owner"], name
        assert str(found.reserved).lower() == row["reserved"], name


def test_names_and_addresses_are_checked():
    for wrong in (
        "w_CPU_CONTROL",
        "node2.w_CPU_CONTROLS",
        "node2.a_STAT_SL",
        "node2.a_STAT_SL[32]",
        "node2.w_CPU_CONTROL[0]",
        "%MW3.200001",
        "%MB3.0",
        "%MD3.3262144",
    ):
        with pytest.raises(KeyError):
            commram.register(wrong)


def test_reads_and_writes_are_those_of_the_registers(stepped):
    with stepped.attach() as ram:
        ram["node2.a_WR_VALUE[0]"] = -2
        assert ram["node2.a_WR_VALUE[0]"] == -2
        # The package reads an address with the type of its register; the module reads its bits.
        assert ram["%MD3.200052"] & 0xFFFFFFFF == 0xFFFFFFFE
        assert stepped.command("peek", "--raw", "node2.a_WR_VALUE[0]") == "16#FFFFFFFE\n"
        ram["%MW3.200000"] = 0x0001
        assert ram["node2.w_CPU_CONTROL"] == 0x0001
        stepped.command("step", "1ms")
        assert ram["node2.w_OPTION_STATUS"] == 0x0002
        for name, wrong in (
            ("node2.b_CTRLREG_WRC1", 256),
            ("node2.b_CTRLREG_WRC1", -1),
            ("node2.w_CPU_CONTROL", -1),
            ("node2.a_WR_VALUE[0]", -(1 << 31) - 1),
            ("%MW3.200000", -1),
        ):
            with pytest.raises(ValueError):
                ram[name] = wrong
        with pytest.raises(ValueError):
            ram.write_header("board.dip", -1)


def test_a_value_that_is_no_integer_is_refused(stepped):
    with stepped.attach() as ram:
        for wrong in (1.7, 1.0, True, None, b"1"):
            with pytest.raises(TypeError):
                ram["node2.b_BT_0"] = wrong
            with pytest.raises(TypeError):
                ram.write_header("board.dip", wrong)
            with pytest.raises(TypeError):
                ram.wait("node2.b_BT_0", wrong, timeout=0)
        assert ram["node2.b_BT_0"] == 0 and ram.header("board.dip") == 0
        ram["node2.b_BT_0"] = commram.STAT_SL.RESPONSE
        assert ram["node2.b_BT_0"] == 1


def test_values_have_the_explanations_of_the_program(stepped):
    places = {
        "node2.w_OPTION_STATUS": (0x0043, 0x0044, 0x0080),
        "node2.w_CPU_CONTROL": (0x0020, 0x00C0, 0x0041),
        "node2._CFG_WRC_WORD.b_CFG_WRC1_WORD0": (0x00, 0x0D, 0x7F),
        "node1._CFG_WRC_WORD.b_CFG_WRC1_WORD0": (0x5F,),
        "node2.a_WR_VALUE[0]": (0xFFFFFFFF,),
        "node2.b_STATREG_RDC2": (7,),
        "node2.a_WR_VALUE[8]": (1,),
    }
    with stepped.attach() as ram:
        for name, values in places.items():
            for value in values:
                ram[name] = value
                shown = stepped.command("peek", name).rstrip("\n").split("  ", 1)[1]
                # Two structures overlay each other: the error names the invalid one.
                shown = re.sub(r" \(\w+, not live\)$", "", shown)
                assert re.sub(r" \(\w+, not live\)$", "", ram.text(name)) == shown, name


def test_the_header_page_is_read_by_name(stepped):
    with stepped.attach() as ram:
        assert ram.header("clock_mode") == commram.ClockMode.STEPPED
        assert ram.header("segment_size") == commram.SEGMENT_SIZE
        before = ram.header("virtual_time_us")
        stepped.command("step", "5ms")
        assert ram.header("virtual_time_us") == before + 5000
        ram.write_header("board.dip", 5)
        assert ram.header("board.dip") == 5
        assert ram.header("events[12].bell.word") == 0
        for wrong in ("nothing", "board", "events.time_us", "events[16].time_us", "state[0]", "state.word"):
            with pytest.raises(KeyError):
                ram.header(wrong)


def test_a_reader_cannot_write(stepped):
    with stepped.attach(writable=False) as ram:
        assert ram["node2.w_OPTION_STATUS"] == 0x0001
        with pytest.raises(TypeError):
            ram["node2.w_CPU_CONTROL"] = 1


def test_a_wait_ends_and_reports_the_value(stepped):
    with stepped.attach() as ram:
        with pytest.raises(commram.Timeout, match=r"%MW3\.200002.*16#0002.*16#0001: start-up"):
            ram.wait("node2.w_OPTION_STATUS", 0x0002, timeout=0.01)
        assert ram.wait("node2.w_OPTION_STATUS", lambda value: value > 0) == 1


def test_a_killed_emulator_is_noticed(stepped):
    with stepped.attach() as ram:
        stepped.kill()
        with pytest.raises(commram.Gone):
            ram.wait("node2.w_OPTION_STATUS", 0x0002, timeout=60)
        time.sleep(0.1)  # The module looks for the process of the emulator at this interval.
        for access in accesses(ram):
            with pytest.raises(commram.Gone):
                access()
    with pytest.raises(commram.Gone):
        stepped.attach()


def accesses(ram):
    return [
        lambda: ram["node2.w_OPTION_STATUS"],
        lambda: ram.text("node2.w_OPTION_STATUS"),
        lambda: ram.write("node2.w_CPU_CONTROL", 1),
        lambda: ram.write_header("board.dip", 5),
    ]


def test_registers_of_an_ended_emulator_are_refused(stepped):
    with stepped.attach() as ram:
        stepped.command("stop")
        for access in accesses(ram):
            with pytest.raises(commram.Gone):
                access()
        assert ram.header("state") in (3, 4)


@pytest.mark.skipif(not hasattr(commram, "connect"), reason="the module of an export has no channel")
def test_a_connection_does_not_act_on_the_next_emulator(stepped):
    with commram.connect(stepped.name) as connection:
        connection.step("5ms")
        stepped.kill()
        stepped.start()
        for act in (connection.now, lambda: connection.poke("node2.w_CPU_CONTROL", 1), lambda: connection.step("1ms")):
            with pytest.raises(commram.Gone, match="another one runs now"):
                act()
    with stepped.attach() as ram:
        assert ram["node2.w_CPU_CONTROL"] == 0


@pytest.mark.skipif(hasattr(commram, "Emulator"), reason="the package maps nothing but images of instances")
def test_an_invalid_image_is_refused_with_its_mistake(stepped, tmp_path):
    path = str(tmp_path / "image")

    def refused(why, *places, length=None):
        shutil.copy(f"/dev/shm/commram.{stepped.name}.line", path)
        for at in places:
            with open(path, "r+b") as file:
                file.seek(at)
                file.write(b"\x7f")
        if length is not None:
            os.truncate(path, length)
        with pytest.raises(commram.NotAttached, match=why):
            commram.Ram(path)

    refused("no image of a communication RAM", 0)
    refused("ABI version 127, this (module|program) knows 3", 8)
    # A program accepts the map of the image, or the map without option cards (`base_layout_hash`).
    refused("another register map", 16, 776)
    refused("too short", length=20)
    refused("too short", length=4096)
    with pytest.raises(commram.NotAttached, match="No such file"):
        commram.attach("nobody-of-this-name")
    with pytest.raises(commram.NotAttached):
        commram.Ram("/dev/shm")
