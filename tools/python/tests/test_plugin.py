"""The pytest plugin, in separate pytest runs."""

import pathlib
import subprocess
import sys

import commram
import pytest


@pytest.fixture
def suite(pytester, monkeypatch):
    """Runs a suite of this text in a separate process."""
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)

    def run(text, *arguments, **files):
        pytester.makepyfile(test_it=text)
        return pytester.runpytest_subprocess("-p", "no:cacheprovider", *arguments)

    return run


def test_each_test_has_a_plant_of_its_own(suite):
    result = suite(
        """
        def test_one(commram):
            commram.poke("node2.w_CPU_CONTROL", 1)
            commram.wait("node2.w_OPTION_STATUS", 2, "1ms")
            assert commram.now() == 500

        def test_two(commram):
            assert commram.now() == 0 and commram["node2.w_CPU_CONTROL"] == 0
        """
    )
    result.assert_outcomes(passed=2)


def test_a_failure_has_the_journal(suite):
    result = suite(
        """
        def test_fails(commram):
            commram.poke("node2.w_CPU_CONTROL", 1)
            commram.step("1ms")
            assert commram["node2.w_OPTION_STATUS"] == 3

        def test_passes(commram):
            commram.step("1ms")
        """
    )
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        ["*commram: journal up to 1000 us*", "*w_CPU_CONTROL (%MW3.200000) := 16#0001*", "*16#0001 -> 16#0002*"]
    )


def test_a_closed_plant_is_checked_too(suite):
    result = suite(
        """
        def test_finding(commram):
            commram.poke("node2.w_CPU_CONTROL", 2)
            commram.step("1ms")
            commram.close()

        def test_required(commram):
            with commram as plant:
                plant.fault("lose_frame id=16#7FF required")
                plant.step("1ms")

        def test_own_error(commram):
            with commram as plant:
                plant.poke("node2.w_CPU_CONTROL", 2)
                plant.step("1ms")
                raise KeyError("own")

        def test_right(commram):
            with commram as plant:
                plant.step("1ms")
            commram.close()
        """
    )
    result.assert_outcomes(passed=1, failed=3)
    result.stdout.fnmatch_lines(["*FAILED *test_finding*", "*FAILED *test_required*", "*FAILED *own_error - KeyError*"])


def test_findings_fail_the_test_unless_they_are_allowed(suite):
    result = suite(
        """
        import pytest

        def break_a_rule(plant):
            plant.poke("node2.w_OPTION_STATUS", 0x0080)
            plant.step("1ms")

        def test_fails(commram):
            break_a_rule(commram)

        @pytest.mark.commram(findings=["owner"])
        def test_allowed(commram):
            break_a_rule(commram)

        def test_required_fault(commram):
            commram.fault("lose_frame id=16#7FF required")

        @pytest.fixture
        def set_up(commram):
            break_a_rule(commram)

        def test_after_another_fixture(set_up):
            pass
        """
    )
    result.assert_outcomes(passed=1, failed=3)
    result.stdout.fnmatch_lines(["*the access checker has 1 finding*", "*has not taken effect*"])
    result.stdout.fnmatch_lines(["*findings of the access checker*", "error: owner: node2.w_OPTION_STATUS*"])


TWO = '[[plc]]\nname = "one"\n[[plc]]\nname = "two"\n'


def test_the_plant_is_a_mark_an_option_or_a_setting(suite, pytester):
    pytester.path.joinpath("two.toml").write_text(TWO)
    text = """
        import pytest
        from pathlib import Path

        def test_given(commram):
            assert commram.plcs == ["one", "two"]

        @pytest.mark.commram(plant="two.toml")
        def test_marked(commram):
            assert commram.plcs == ["one", "two"]

        @pytest.mark.commram(plant="[[plc]]\\nname = 'three'")
        def test_text(commram):
            assert commram.plcs == ["three"]
        """
    suite(text).assert_outcomes(passed=2, failed=1)
    suite(text, "--commram-plant", "two.toml").assert_outcomes(passed=3)
    pytester.makeini("[pytest]\ncommram_plant = two.toml\ncommram_journal = 3")
    suite(text).assert_outcomes(passed=3)
    wrong = suite("import pytest\n@pytest.mark.commram(plants='x')\ndef test_it(commram): pass")
    wrong.stdout.fnmatch_lines(["*the mark commram takes plant= and findings=*"])


def test_it_runs_in_parallel(suite):
    pytest.importorskip("xdist")
    result = suite(
        """
        import pytest

        @pytest.mark.parametrize("number", range(8))
        def test_it(commram, number):
            commram.poke("node2.b_BT_0", number)
            commram.step("10ms")
            assert commram["node2.b_BT_0"] == number and commram.now() == 10_000

        def test_fails(commram):
            commram.poke("node2.w_CPU_CONTROL", 1)
            commram.step("1ms")
            assert False
        """,
        "-n",
        "2",
    )
    result.assert_outcomes(passed=8, failed=1)
    result.stdout.fnmatch_lines(["*commram: journal up to 1000 us*"])


def test_an_exported_module_that_hides_the_package_is_reported(suite, pytester, program, monkeypatch):
    subprocess.run([program, "export", "python", "--output", str(pytester.path / "commram.py")], check=True)
    monkeypatch.setenv("PYTHONPATH", str(pytester.path))
    result = suite(
        """
        import commram as module

        def test_module():
            assert module.__file__.endswith("commram.py") and module.SEND.DATA_WRITTEN_TO_BE_SENT == 5

        def test_package(commram):
            pass
        """
    )
    result.assert_outcomes(passed=1, errors=1)
    result.stdout.fnmatch_lines(["*commram.py is a module of commram export; it hides the package*"])
    said = subprocess.run([sys.executable, "-c", "import commram; commram.Emulator"], capture_output=True, text=True)
    assert "docs/guide/python.md" in said.stderr and "commram.py" in said.stderr, said.stderr


def test_both_have_the_same_names(program, tmp_path):
    """A program that changes from the module to the package finds all names again."""
    subprocess.run([program, "export", "python", "--output", str(tmp_path / "commram.py")], check=True)
    code = "import commram; print(*[name for name in vars(commram) if name[0] != '_'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    own = {"decode", "AREAS"}
    foreign = {"enum", "fcntl", "itertools", "mmap", "operator", "os", "re", "stat", "struct", "sys", "time"}
    typing = {"Any", "Callable", "Iterator", "NamedTuple", "Optional", "Union"}
    missing = {name for name in done.stdout.split() if not hasattr(commram, name)} - foreign - typing
    assert missing == own
    for name in ("SEND", "STAT_SL", "CFG_WORD", "State", "ClockMode"):
        code = f"import commram; print([(it.name, it.value) for it in commram.{name}])"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
        assert done.stdout.strip() == str([(it.name, it.value) for it in getattr(commram, name)]), name
    assert pathlib.Path(commram.__file__).name == "__init__.py"
