"""A plant in this process."""

import os
import pathlib
import re

import commram
import pytest
from conftest import bring_up

TWO = """
[[plc]]
name = "line"
[[plc]]
name = "line2"
[[bus]]
name = "drives"
"""


def test_a_slave_returns_the_reference_value(emulator):
    bring_up(emulator)
    emulator.poke("node2.a_WR_VALUE[0]", -4711)
    emulator.step_to_sync()
    for _ in range(3):
        # The release is directly after a SYNC edge, so that it is in time for this interval.
        emulator.poke("node2.b_CTRLREG_WRC1", commram.SEND.DATA_WRITTEN_TO_BE_SENT)
        emulator.step("2ms")
        emulator.expect("node2.b_CTRLREG_WRC1", commram.SEND.TAKEN_OVER_AND_SENT)
    assert emulator.peek("node2.a_RD_BMARRAY[1][0]") == -4711
    emulator.expect_no_findings()
    emulator.poke("node2.b_CTRLREG_WRC1", commram.SEND.DATA_WRITTEN_TO_BE_SENT)
    frame = emulator.expect_frame("drives", 0x101, "*", "4ms")
    assert (frame.id, frame.time, frame.data[:4]) == (0x101, emulator.now(), (-4711).to_bytes(4, "little", signed=True))
    assert frame in emulator.frames("drives", frame.time)
    assert any("16#0080" in record.text for record in emulator.journal())


@pytest.mark.parametrize("value", [1.7, 1.0, True, False, None, b"1", [1], 1j])
def test_bad_types_are_refused_everywhere(emulator, value):
    before = emulator.snapshot("node2")
    handle = emulator.handle("node2.b_BT_0")
    for attempt in (
        lambda: emulator.poke("node2.b_BT_0", value),
        lambda: emulator.__setitem__("node2.b_BT_0", value),
        lambda: setattr(emulator.node2, "b_BT_0", value),
        lambda: handle.poke(value),
        lambda: setattr(handle, "value", value),
        lambda: emulator.force("node2.b_BT_0", value),
        lambda: emulator.expect("node2.b_BT_0", value),
        lambda: emulator.wait("node2.b_BT_0", value, "1ms"),
        lambda: emulator.compare_exchange("node2.b_BT_0", 0, value),
        lambda: emulator.initial_flag("%MB10000000", value),
        lambda: emulator.step(value),
    ):
        with pytest.raises(TypeError):
            attempt()
    assert emulator.changes(before) == [] and emulator.now() == 0


def test_values_that_do_not_fit_are_refused(emulator):
    for value in (256, -1, 1 << 64, -(1 << 70), "16#100", "256", "many", ""):
        with pytest.raises(ValueError):
            emulator.poke("node2.b_BT_0", value)
    assert emulator["node2.b_BT_0"] == 0
    for value, is_now in ((0xFF, 0xFF), ("2#101", 5), (commram.STAT_SL.RESPONSE, 1)):
        emulator["node2.b_BT_0"] = value
        assert emulator["node2.b_BT_0"] == is_now
    emulator["node2.a_WR_VALUE[0]"] = 0xFFFFFFFE
    assert emulator["node2.a_WR_VALUE[0]"] == -2
    emulator.poke("%MX3.200000.1", 1)
    assert emulator["node2.w_CPU_CONTROL"] == 2


def test_numbers_out_of_range_are_refused(emulator):
    calls = {
        "journal": (), "journal_lines": (), "back_to": (), "forget": (), "clear_fault": (), "event_count": (),
        "trigger_count": (), "frames": ("drives",), "rtr": ("drives",), "expect_near": ("node2.b_BT_0", 0),
    }
    for name, first in calls.items():
        for number in (-1, 1 << 64, -(1 << 70)):
            with pytest.raises(ValueError, match="a number from 0 to"):
                getattr(emulator, name)(*first, number)
        with pytest.raises(TypeError):
            getattr(emulator, name)(*first, "1")
    for call in (emulator.send_frame, emulator.expect_frame):
        with pytest.raises(ValueError, match="-1: a number from 0 to 4294967295"):
            call("drives", -1, "", *(["1ms"] if call == emulator.expect_frame else []))
    with pytest.raises(ValueError, match="from 0 to 65535"):
        emulator.expect_frame("drives", 1, "", "1ms", mask=65536)


def test_a_forgotten_snapshot_makes_room(emulator):
    saved = [emulator.save() for _ in range(64)]
    with pytest.raises(commram.Error, match=r"64 snapshots are kept.*forget\(saved\)"):
        emulator.save()
    emulator.forget(saved[0])
    assert emulator.save() not in saved
    with pytest.raises(commram.Error, match="snapshot"):
        emulator.back_to(saved[0])


def test_names_are_checked_and_errors_suggest_the_right_one(emulator):
    for name in ("node2.w_CPU", "node3.w_CPU_CONTROL", "other:node2.w_CPU_CONTROL", "%MW3.200001", "%MX3", ""):
        with pytest.raises(KeyError) as refused:
            emulator.peek(name)
        assert isinstance(refused.value, commram.Error) and not str(refused.value).startswith('"')
    with pytest.raises(commram.UnknownName, match="no bus 'nowhere'; there are: drives"):
        emulator.frames("nowhere")
    with pytest.raises(AttributeError, match="did you mean 'w_CPU_CONTROL'"):
        emulator.node2.w_CPU_CONTROLS
    with pytest.raises(AttributeError, match="no attribute or area 'node3'"):
        emulator.node3


def test_time_passes_only_in_the_verbs(emulator):
    assert emulator.now() == 0
    emulator.step("1.5ms")
    emulator.step(500)
    assert emulator.now() == 2000
    with pytest.raises(ValueError, match="unit"):
        emulator.step("2")
    with pytest.raises(ValueError, match="negative"):
        emulator.step(-1)
    emulator.poke("node2.w_CPU_CONTROL", 1)
    assert emulator.wait("node2.w_OPTION_STATUS", "16#0002", "1ms") == 500
    assert emulator.wait_until(lambda: emulator.now() >= 4000, "10ms") >= 1500
    with pytest.raises(commram.Timeout, match="did not hold within 3 ms"):
        emulator.wait_until(lambda: False, "3ms")
    # Unlike scripts, tests have no limit of an hour.
    assert emulator.wait("node2.w_OPTION_STATUS", 2, 7_200_000_000) == 0


def test_a_failure_knows_everything(emulator):
    emulator.section("start")
    emulator.poke("node2.w_CPU_CONTROL", 1)
    with pytest.raises(commram.Timeout) as late:
        emulator.wait("node2.w_OPTION_STATUS", 3, "2ms")
    error = late.value
    assert isinstance(error, (AssertionError, TimeoutError)) and isinstance(error, commram.Failed)
    assert (error.register, error.address) == ("node2.w_OPTION_STATUS", "%MW3.200002")
    assert error.actual.startswith("16#0002  waiting for") and error.expected.startswith("16#0003")
    assert (error.time, error.section) == (2000, "start") and len(error.journal) == 2
    assert ".rs" not in str(error)
    with pytest.raises(AssertionError) as wrong:
        emulator.expect("node2.w_OPTION_STATUS", 7)
    assert not isinstance(wrong.value, commram.Timeout)


def test_snapshots_are_compared(emulator):
    before, all_before = emulator.snapshot("node2"), emulator.snapshot()
    assert before == emulator.snapshot("node2") and all_before == emulator.snapshot()
    emulator.poke("node2.b_BT_1", 0x1C)
    after = emulator.snapshot("node2")
    assert before != after and all_before != emulator.snapshot() and before != all_before
    (change,) = before.diff(after)
    assert (change.register, change.address, change.before, change.after) == ("node2.b_BT_1", "%MB3.200016", 0, 0x1C)
    assert emulator.changes(before) == [change] and emulator.changes(all_before) == [change]
    assert after["node2.b_BT_1"] == 0x1C and "node2.b_BT_1" in after and len(after) == len(after.keys())
    emulator.expect_changes(before, ["node2.b_BT_1"])
    with pytest.raises(commram.Failed, match="b_BT_0 has not changed"):
        emulator.expect_changes(before, ["node2.b_BT_0", "node2.b_BT_1"])
    with pytest.raises(ValueError, match="different registers"):
        before.diff(all_before)
    with pytest.raises(KeyError, match="no register of this snapshot"):
        before["node1.b_BT_1"]


def test_faults_and_findings(emulator):
    number = emulator.fault("lose_frame id=16#7FF required")
    (fault,) = emulator.faults()
    assert (fault.number, fault.kind, fault.acting, fault.hits) == (number, "lose_frame", True, 0), fault
    assert fault.text == "lose_frame bus=drives id=16#7FF"
    with pytest.raises(commram.Failed, match="has not taken effect"):
        emulator.expect_required_faults()
    emulator.clear_fault(number)
    assert emulator.faults() == []
    for wrong in ("lose_everything", "lose_frame id=x"):
        with pytest.raises(ValueError):
            emulator.fault(wrong)
    with pytest.raises(commram.Refused) as refused:
        emulator.clear_fault(number)
    assert refused.value.code == 28
    # Only the firmware may write the status.
    emulator.poke("node2.w_OPTION_STATUS", 0x0080)
    emulator.step("1ms")
    findings = emulator.findings()
    assert [(it.rule, it.register, it.value, it.severity) for it in findings] == [
        ("owner", "node2.w_OPTION_STATUS", 0x0080, "error")
    ]
    assert "owner" in commram.Emulator.rules()
    emulator.expect_no_findings(["owner"])
    with pytest.raises(commram.Failed, match="1 finding"):
        emulator.expect_no_findings()
    with pytest.raises(commram.UnknownName, match="no rule 'owners'"):
        emulator.expect_no_findings(["owners"])
    emulator.clear_findings()
    emulator.expect_no_findings()


def test_forces_board_and_frames(emulator):
    emulator.force("node2.w_CPU_CONTROL", 0)
    emulator.poke("node2.w_CPU_CONTROL", 1)
    emulator.step("2ms")
    emulator.expect("node2.w_OPTION_STATUS", 1)
    emulator.unforce("node2.w_CPU_CONTROL")
    emulator.set_board("dip=5")
    assert emulator.board()["dip"] == 5 and emulator.board()["power"] == "on"
    emulator.power_cycle()
    assert emulator.board()["dip_latched"] == 5
    emulator.expect_no_frame("drives", 0x100, "1ms", mask=0x780)
    with pytest.raises(commram.Timeout, match="no frame 16#010"):
        emulator.expect_frame("drives", 0x010, "*", "1ms")
    for wrong in (lambda: emulator.expect_frame("drives", 0x800, "*", 1), lambda: emulator.rtr("drives", 1 << 29)):
        with pytest.raises(ValueError):
            wrong()


def test_frames_are_sent_as_bytes_or_texts():
    plant = (pathlib.Path(__file__).parents[2] / "plants/cs0015.toml").read_text()
    with commram.Emulator(plant) as emulator:
        (bus,) = emulator.buses
        for at, data in enumerate((bytes([0x81, 0x00]), "81 00", [0x81, 0x00])):
            emulator.send_frame(bus, 0x123 + at, data)
            assert emulator.expect_frame(bus, 0x123 + at, "81 ..", "10ms").data == b"\x81\x00"
        emulator.send_frame(bus, 0x18FF1234, b"\x01", extended=True)
        assert emulator.expect_frame(bus, 0x18FF1234, b"\x01", "10ms", extended=True).extended
        with pytest.raises(TypeError):
            emulator.send_frame(bus, 1, 1.5)


def test_a_step_has_no_longest_time(emulator):
    emulator.step("25h")
    assert emulator.now() == 25 * 3600 * 1_000_000


def test_plants_are_files_texts_or_built_in(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(TWO)
    for plant in (path, str(path), TWO):
        with commram.Emulator(plant) as emulator:
            assert emulator.plcs == ["line", "line2"] and emulator.buses == ["drives"]
            emulator.line2.node2.b_BT_0 = 3
            assert emulator["line2:node2.b_BT_0"] == 3 and emulator["line:node2.b_BT_0"] == 0
            assert emulator.array("line2:node2.a_WR_VALUE").shape == (32,)
            assert emulator.names("line2:node2")[0].startswith("line2:node2.")
            with pytest.raises(commram.UnknownName, match="several PLCs"):
                emulator.peek("node2.b_BT_0")
    # Python represents bytes of a name outside of UTF-8 as surrogates.
    odd = os.fsdecode(os.fsencode(tmp_path) + b"/two-\xff.toml")
    with open(odd, "w") as file:
        file.write(TWO)
    for plant in (odd, pathlib.Path(odd)):
        with commram.Emulator(plant) as emulator:
            assert emulator.plcs == ["line", "line2"]
    with pytest.raises(ValueError, match="no file name contains this surrogate"):
        commram.Emulator("\ud800")
    with pytest.raises(ValueError, match="the text of a plant contains a surrogate"):
        commram.Emulator(TWO + "# \udcff")
    for wrong, error in (("[[plc]]\nnom = 'x'", commram.PlantError), (str(tmp_path / "none.toml"), ValueError), (7, TypeError)):
        with pytest.raises(error):
            commram.Emulator(wrong)


def test_use_after_close_is_reported(emulator):
    handle, view = emulator.handle("node2.b_BT_0"), emulator.view("node2.a_WR_VALUE")
    emulator.close()
    assert emulator.closed and repr(emulator) == "<Emulator, closed>"
    for attempt in (handle.peek, emulator.now, lambda: emulator.peek("node2.b_BT_0")):
        with pytest.raises(commram.Error, match="closed"):
            attempt()
    # The memory exists as long as a view of it exists.
    view[0] = 1
    assert view[0] == 1
    emulator.close()


CORPUS = pathlib.Path(__file__).parents[3] / "tests/__fuzz__/plant/corpus"
SCENARIOS = (pathlib.Path(__file__).parents[3] / "docs/reference/scenarios.md").read_text()


def test_boards_of_all_devices_have_the_fields_of_scenarios():
    table = SCENARIOS.split("#### Fields of board", 1)[1].split("\n\n")[1]
    rows = [line.split("|")[1:3] for line in table.splitlines()[2:]]
    documented = {frozenset(re.findall(r"`(\w+)`", fields)) for _, fields in rows}
    seen = set()
    for device in ("omega_drive_line_2", "bm4_o_can_06", "cs0015", "can_dp2", "cr201x"):
        with commram.Emulator(CORPUS / f"{device}.toml") as emulator:
            for plc in emulator.plcs:
                board = emulator.board(plc)
                seen.add(frozenset(board))
                for module in board.get("modules", {}).values():
                    assert {"kind", "leds"} <= set(module)
    assert documented <= seen


def test_drives_have_the_fields_of_scenarios(emulator):
    drive = emulator.drive("drive1")
    assert (drive["state"], drive["fault"], drive["stopped"]) == ("operation_enabled", 0, False)
    assert isinstance(drive["parameters"]["P167"], int)
    with pytest.raises(commram.UnknownName, match="no drive 'drive9'"):
        emulator.drive("drive9")
