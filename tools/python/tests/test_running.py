"""Running instances: by the map of their RAM, and through their channel."""

import subprocess
import threading
import time

import commram
import pytest
from conftest import bring_up


def test_a_map_and_the_channel_see_the_same(stepped):
    with commram.attach(stepped) as ram, commram.connect(stepped) as plant:
        assert ram.plc == "line" and plant.plcs == ["line"] and ram.names() == plant.names()
        ram.node2.w_CPU_CONTROL = 0x0001
        assert plant.wait("node2.w_OPTION_STATUS", 2, "1ms") == 500
        assert ram["node2.w_OPTION_STATUS"] == 2 and ram.text("node2.w_OPTION_STATUS") == plant.text("node2.w_OPTION_STATUS")
        assert ram.describe("node2.w_OPTION_STATUS") == plant.describe("node2.w_OPTION_STATUS")
        before = ram.snapshot("node2")
        assert before == plant.snapshot("node2")
        plant.poke("node2.b_BT_1", 0x1C)
        assert [change.register for change in ram.changes(before)] == ["node2.b_BT_1"]
        plant.array("node2.a_WR_VALUE")[1] = -3
        assert ram["node2.a_WR_VALUE[1]"] == ram.view("node2.a_WR_VALUE")[1] == plant["node2.a_WR_VALUE[1]"] == -3
        assert ram.compare_exchange("node2.b_BT_0", 0, 3) and not ram.compare_exchange("node2.b_BT_0", 0, 3)
        plant.step("1s")
        assert plant.now() == ram.header("virtual_time_us") == 1_000_500
        handle = plant.handle("node2.b_BT_0")
        handle.value = 4
        assert handle.value == ram.node2.b_BT_0 == 4


def test_a_connected_scenario_is_that_of_a_plant_in_process(stepped):
    with commram.connect(stepped) as there, commram.Emulator() as here:
        for plant in (there, here):
            bring_up(plant)
        assert there.now() == here.now()
        assert [record.text for record in there.journal()] == [record.text for record in here.journal()]
        assert there.frames("drives") == here.frames("drives")


def test_types_and_values_are_checked(stepped):
    with commram.attach(stepped) as ram, commram.attach(stepped, writable=False) as reader:
        for value in (1.7, True, None, b"1"):
            for attempt in (
                lambda: ram.poke("node2.b_BT_0", value),
                lambda: ram.__setitem__("node2.b_BT_0", value),
                lambda: ram.write("node2.b_BT_0", value),
                lambda: ram.compare_exchange("node2.b_BT_0", 0, value),
                lambda: ram.wait("node2.b_BT_0", value, timeout=0),
                lambda: ram.write_header("board.dip", value),
            ):
                with pytest.raises(TypeError):
                    attempt()
        with pytest.raises(ValueError):
            ram["node2.b_BT_0"] = 256
        with pytest.raises(ValueError):
            ram.write_header("board.dip", 1 << 32)
        assert ram["node2.b_BT_0"] == 0
        for attempt in (
            lambda: reader.poke("node2.b_BT_0", 1),
            lambda: reader.write_header("board.dip", 1),
            lambda: reader.view("node2.a_WR_VALUE").__setitem__(0, 1),
        ):
            with pytest.raises(TypeError):
                attempt()
        with pytest.raises(ValueError, match="read-only"):
            reader.array("node2.a_WR_VALUE")[0] = 1


def test_a_wait_is_in_real_time_and_lets_others_run(stepped):
    with commram.attach(stepped) as ram, commram.connect(stepped) as plant:
        ram.node2.w_CPU_CONTROL = 1
        thread = threading.Thread(target=lambda: plant.step("1ms"))
        thread.start()
        assert ram.wait("node2.w_OPTION_STATUS", 2, timeout=60) == 2
        thread.join()
        assert ram.wait("node2.w_OPTION_STATUS", lambda value: value > 1) == 2
        with pytest.raises(commram.Timeout, match=r"%MW3\.200002.*16#0003.*16#0002: waiting"):
            ram.wait("node2.w_OPTION_STATUS", 3, timeout=0.01)
        with pytest.raises(ZeroDivisionError):
            ram.wait("node2.w_OPTION_STATUS", lambda value: 1 / 0)


def test_every_thread_may_use_a_connection(stepped):
    with commram.connect(stepped) as plant:
        errors = []

        def work(register):
            try:
                for value in range(50):
                    plant.poke(register, value)
                    assert plant.peek(register) == value
            except BaseException as error:
                errors.append(error)

        threads = [threading.Thread(target=work, args=(f"node2.a_SL_TYP[{at}]",)) for at in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert errors == []


def test_a_clock_that_runs_by_itself_is_not_stepped(start):
    with commram.connect(start()) as plant:
        with pytest.raises(commram.Refused, match="clock runs in real time") as refused:
            plant.step("1ms")
        assert refused.value.code == 9
        plant.poke("node2.w_CPU_CONTROL", 1)
        plant.wait("node2.w_OPTION_STATUS", 2, "10s")


def test_a_missing_instance_is_reported(start, program):
    for attempt in (commram.attach, commram.connect):
        with pytest.raises(commram.NotAttached, match="no instance 'nobody-of-this-name' is running"):
            attempt("nobody-of-this-name")
        with pytest.raises(commram.NotAttached, match="A-Z a-z"):
            attempt("a.b")
        with pytest.raises(TypeError):
            attempt(7)
    name = start()
    with pytest.raises(commram.NotAttached):
        commram.attach(name, "other")
    with pytest.raises(commram.NotAttached, match="attach"):
        commram.Ram("/tmp/image")
    ram, plant = commram.attach(name), commram.connect(name)
    (_, process), = start.processes
    process.kill()
    process.wait()
    with pytest.raises(commram.Gone):
        ram.check()
    time.sleep(0.1)  # The process of the emulator is looked for at this interval.
    with pytest.raises(commram.Gone):
        ram.poke("node2.w_CPU_CONTROL", 1)
    with pytest.raises(commram.Gone):
        ram.wait("node2.w_OPTION_STATUS", 2, timeout=60)
    with pytest.raises(commram.Gone):
        plant.now()
    with pytest.raises(commram.Gone):
        commram.attach(name)


def test_registers_of_an_ended_emulator_are_refused(stepped, start):
    for writable in (True, False):
        name = start("--clock", "stepped")
        with commram.attach(name, writable=writable) as ram:
            before, process = ram.snapshot("node2"), start.processes[-1][1]
            process.terminate()
            process.wait(timeout=60)
            for access in (
                lambda: ram.peek("node2.w_OPTION_STATUS"),
                lambda: ram["node2.w_OPTION_STATUS"],
                lambda: ram.text("node2.w_OPTION_STATUS"),
                lambda: ram.describe("node2.w_OPTION_STATUS"),
                lambda: ram.snapshot("node2"),
                lambda: ram.changes(before),
                ram.ring,
            ):
                with pytest.raises(commram.Gone):
                    access()
            for access in (
                lambda: ram.poke("node2.w_CPU_CONTROL", 1),
                lambda: ram.compare_exchange("node2.w_CPU_CONTROL", 0, 1),
                lambda: ram.write_header("board.dip", 5),
            ):
                with pytest.raises(commram.Gone):
                    access()
            assert ram.header("state") in (3, 4)


def test_a_timeout_is_a_number_of_seconds(stepped):
    with commram.attach(stepped) as ram:
        for wrong in (-1, float("nan"), float("-inf")):
            with pytest.raises(ValueError, match="a timeout is a number of seconds, 0 or greater"):
                commram.connect(stepped, timeout=wrong)
            with pytest.raises(ValueError, match="a timeout is a number of seconds, 0 or greater"):
                ram.wait("node2.w_OPTION_STATUS", 2, timeout=wrong)
        for right in (1e300, float("inf")):
            commram.connect(stepped, timeout=right).close()
            assert ram.wait("node2.w_OPTION_STATUS", 1, timeout=right) == 1


def test_connect_waits_for_an_instance_that_starts(program):
    name = "pkg-late-%d" % id(program)
    thread_error = []

    def late():
        try:
            with commram.connect(name, timeout=60) as plant:
                plant.step("1ms")
        except BaseException as error:
            thread_error.append(error)

    thread = threading.Thread(target=late)
    thread.start()
    process = subprocess.Popen([program, "run", "-i", name, "--clock", "stepped"], stdout=subprocess.DEVNULL)
    thread.join()
    process.terminate()
    process.wait(timeout=60)
    assert thread_error == []
