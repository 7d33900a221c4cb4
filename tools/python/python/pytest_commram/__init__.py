"""The pytest plugin of commram: the fixture `commram`, a plant of its own for each test.

It stands beside the package, not in it: pytest loads it at its start, also where an exported commram.py hides the package.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from commram import Emulator, Failed

_PLANT = pytest.StashKey["Emulator"]()
_CHECK = pytest.StashKey[Callable[[], None]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("commram")
    group.addoption("--commram-plant", metavar="FILE", help="plant file of the fixture commram (the built-in plant)")
    parser.addini("commram_plant", "plant file of the fixture commram, from the directory of this file")
    parser.addini("commram_journal", "lines of the journal in a failure report (40)", default="40")


def pytest_configure(config: pytest.Config) -> None:
    text = (
        "commram(plant=None, findings=()): the plant of the fixture commram, a plant file beside the test or its text; "
        "rules of the access checker that the test may break"
    )
    config.addinivalue_line("markers", text)


def _marked(item: pytest.Item, key: str) -> Any:
    """Returns the arguments of the nearest mark."""
    for mark in item.iter_markers("commram"):
        wrong = mark.args or set(mark.kwargs) - {"plant", "findings"}
        if wrong:
            raise pytest.UsageError(f"{item.nodeid}: the mark commram takes plant= and findings=, not {wrong}")
        if key in mark.kwargs:
            return mark.kwargs[key]
    return None


def _plant(item: pytest.Item) -> str | Path | None:
    marked = _marked(item, "plant")
    if marked is not None:
        is_text = isinstance(marked, str) and any(sign in marked for sign in "\n=[")
        return str(marked) if is_text else item.path.parent / marked
    option = item.config.getoption("--commram-plant")
    if option:
        return item.config.invocation_params.dir / str(option)
    ini, at = item.config.getini("commram_plant"), item.config.inipath
    return at.parent / str(ini) if ini and at else None


@pytest.fixture
def commram(request: pytest.FixtureRequest) -> Generator[Emulator, None, None]:
    """A plant of its own in this process, at power-on, with a stepped clock.

    When the test is over, the access checker must have found nothing, and faults that are `required` must have struck.
    """
    import commram as package

    if not hasattr(package, "Emulator"):
        raise ImportError(
            f"{package.__file__} is a module of commram export; it hides the package of the same name. Rename it or take its "
            f"directory out of PYTHONPATH: the package can do all that the module does"
        )
    item = request.node

    class FixturePlant(package.Emulator):
        """The plant of a test, which is also checked if the test closes it."""

        failure: Failed | None = None

        def check(self) -> None:
            if self.failure is not None:
                raise self.failure
            if not self.closed:
                self.expect_no_findings(list(_marked(item, "findings") or ()))
                self.expect_required_faults()

        def close(self) -> None:
            try:
                self.check()
            except package.Failed as failure:
                # Raised after the test, so that it hides no error of the test.
                self.failure = failure
            finally:
                super().close()

    with FixturePlant(_plant(item)) as plant:
        item.stash[_PLANT], item.stash[_CHECK] = plant, plant.check
        yield plant


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, Any]:
    result = yield
    # Checked in the call, not at the end of the fixture: so pytest reports a failed test, not an additional error.
    check = item.stash.get(_CHECK, None)
    if check is not None:
        check()
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    plant = item.stash.get(_PLANT, None)
    if report.failed and plant is not None and not plant.closed:
        try:
            lines = plant.journal_lines(int(item.config.getini("commram_journal")))
            findings = [str(finding) for finding in plant.findings()]
        except Exception as error:  # The report is worth more than what went wrong here.
            lines, findings = [f"{type(error).__name__}: {error}"], []
        report.sections.append((f"commram: journal up to {plant.now()} us", "\n".join(line.strip() for line in lines)))
        if findings:
            report.sections.append(("commram: findings of the access checker", "\n".join(findings)))
    return report
