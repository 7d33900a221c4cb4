"""The Robot Framework library, in runs of robot."""

import subprocess
import sys

import pytest

pytest.importorskip("robot")

SUITE = """
*** Settings ***
Library    CommramLibrary

*** Test Cases ***
A master starts
    Section    start
    Poke    node2.w_CPU_CONTROL    16#0001
    ${waited}=    Wait    node2.w_OPTION_STATUS    16#0002    1ms
    Should Be Equal As Integers    ${waited}    500
    ${before}=    Snapshot    node2
    Poke    node2.b_BT_1    ${28}
    Expect Changes    ${before}    node2.b_BT_1
    ${value}=    Peek    node2.b_BT_1
    Should Be Equal As Integers    ${value}    28
    Expect No Frame    drives    0x101    2ms
    ${frames}=    Frames    drives
    Should Be Empty    ${frames}
    Expect That    ${value == 28}    the byte is stored
    ${drive}=    Drive    drive1
    Should Be Equal    ${drive}[state]    operation_enabled
    ${lines}=    Journal Lines    ${3}
    Length Should Be    ${lines}    3

Each test has a plant of its own
    ${now}=    Now
    Should Be Equal As Integers    ${now}    0
    Expect    node2.b_BT_1    0

A wait fails
    Poke    node2.w_CPU_CONTROL    1
    Wait    node2.w_OPTION_STATUS    3    2ms

Findings fail
    Poke    node2.w_OPTION_STATUS    16#0080
    Step    1ms

A type is wrong
    Poke    node2.b_BT_0    ${1.7}
"""


def robot(tmp_path, text, *arguments):
    suite = tmp_path / "suite.robot"
    suite.write_text(text)
    command = [sys.executable, "-m", "robot", "--log", "NONE", "--report", "NONE", "--output", "NONE", *arguments]
    return subprocess.run([*command, str(suite)], capture_output=True, text=True, cwd=tmp_path)


def test_verbs_are_keywords(tmp_path):
    done = robot(tmp_path, SUITE)
    assert "5 tests, 2 passed, 3 failed" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 3
    for said in (
        "node2.w_OPTION_STATUS (%MW3.200002) did not become 16#0003 within 2 ms",
        "w_CPU_CONTROL (%MW3.200000) := 16#0001",
        "the access checker has 1 finding",
        "1.7 is a float; a register takes an integer",
    ):
        assert said in done.stdout, done.stdout


def test_plants_and_allowed_findings_are_arguments(tmp_path):
    (tmp_path / "two.toml").write_text('[[plc]]\nname = "one"\n[[plc]]\nname = "two"\n')
    text = SUITE.split("*** Test Cases")[0].replace(
        "CommramLibrary", "CommramLibrary    plant=two.toml    findings=owner"
    )
    text += """
*** Test Cases ***
Two PLCs
    Poke    two:node2.w_OPTION_STATUS    16#0080
    Step    1ms
    Expect No Findings    owner
"""
    done = robot(tmp_path, text)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_running_instance(tmp_path, stepped):
    text = SUITE.split("*** Test Cases")[0].replace("CommramLibrary", f"CommramLibrary    instance={stepped}")
    text += """
*** Test Cases ***
It is there
    Poke    node2.w_CPU_CONTROL    1
    Wait    node2.w_OPTION_STATUS    2    1ms
"""
    done = robot(tmp_path, text)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_running_instance_has_required_faults_too(tmp_path, stepped):
    head = SUITE.split("*** Test Cases")[0].replace("CommramLibrary", f"CommramLibrary    instance={stepped}")
    text = head + """
*** Test Cases ***
No frame is lost
    Fault    lose_frame slot=WRC1 count=1 required
"""
    done = robot(tmp_path, text)
    assert "fault 1 has not taken effect" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 1
    done = robot(tmp_path, text.replace("instance=", "findings=owner    instance="))
    assert "findings= is for a plant of the test" in done.stdout + done.stderr
