"""The template `pytest` of `commram new`, with the program that COMMRAM names."""

import subprocess
import sys

import pytest

DEVICES = ["omega-drive-line-2", "bm4-plc", "cs0015", "cr201x", "can-dp2"]


def run(*command, cwd):
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True)


@pytest.mark.parametrize("device", DEVICES)
def test_the_tests_of_a_new_project_pass(tmp_path, program, device):
    made = run(program, "new", "press", "--device", device, "--template", "pytest", cwd=tmp_path)
    assert (made.returncode, made.stderr) == (0, "")
    assert made.stdout.splitlines()[-1] == "  pytest"
    project = tmp_path / "press"
    pytest_command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    passed = run(*pytest_command, cwd=project)
    assert passed.returncode == 0 and "1 passed" in passed.stdout, passed.stdout

    # The failing test, without the first character of its lines.
    test = project / "test_start.py"
    head, failing = test.read_text().split("reported.\n#\n")
    test.write_text(head + "reported.\n" + "".join(line[1:] for line in failing.splitlines(keepends=True)))
    failed = run(*pytest_command, cwd=project)
    assert failed.returncode == 1 and "1 failed, 1 passed" in failed.stdout, failed.stdout
