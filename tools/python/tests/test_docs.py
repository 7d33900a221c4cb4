"""The examples of docs/guide/python.md work as printed."""

import pathlib
import re
import subprocess
import sys

import pytest

PAGE = (pathlib.Path(__file__).parents[3] / "docs/guide/python.md").read_text()

VERBS = (pathlib.Path(__file__).parents[3] / "src/script/verbs.d.rhai").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def test_the_way_to_an_actual_value(pytester):
    (test,) = [block for block in blocks("python") if block.startswith("# test_drive.py")]
    pytester.makepyfile(test_drive=test)
    pytester.runpytest_subprocess("-p", "no:cacheprovider", "test_drive.py").assert_outcomes(passed=1)


def test_the_examples_run(tmp_path, start):
    name = start()
    scripts = [block for block in blocks("python") if block.startswith("import commram\n")]
    assert len(scripts) == 3
    shown = []
    for script in scripts:
        script = script.replace('attach("default")', f"attach({name!r})")
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        shown.append(done.stdout)
        # Comments hold the expected output.
        said = re.findall(r"print\(.*\)  # ([^:\n]*)", script)
        assert done.stdout.splitlines()[: len(said)] == said
    assert "node2.b_BT_1" in shown[1] and shown[2].startswith("waiting for")


def test_the_marks_of_the_plugin(pytester):
    (test,) = [block for block in blocks("python") if "def test_winder" in block]
    pytester.makepyfile(test_winder=test)
    pytester.path.joinpath("winder.toml").write_text('[[plc]]\nname = "line"\n[[bus]]\nname = "b"\n')
    pytester.runpytest_subprocess("-p", "no:cacheprovider").assert_outcomes(passed=1)


def test_the_suite_of_robot(tmp_path):
    pytest.importorskip("robot")
    (suite,) = blocks("robotframework")
    (tmp_path / "it.robot").write_text(suite)
    command = [sys.executable, "-m", "robot", "--log", "NONE", "--report", "NONE", "--output", "NONE", "it.robot"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout


def test_every_verb_is_in_the_package_or_named_as_missing():
    import commram

    paragraph = next(part for part in PAGE.split("\n\n") if part.startswith("`Emulator` and the object"))
    missing = set(re.findall(r"`(\w+)`", paragraph.split("(", 1)[1])) - {"Emulator", "connect", "wait_until"}
    verbs = set(re.findall(r"^fn (\w+)\(", VERBS, re.MULTILINE))
    assert {verb for verb in verbs if not hasattr(commram.Emulator, verb)} == missing
    assert {verb for verb in verbs if not hasattr(commram.Connection, verb)} == missing
