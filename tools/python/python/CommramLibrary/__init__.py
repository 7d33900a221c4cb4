"""The Robot Framework library of commram: the verbs of scenarios as keywords."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from commram import Connection, Emulator

# The verbs in the order of docs/reference/scenarios.md. `wait_until` takes a function, which a suite cannot pass.
_VERBS = (
    "section",
    "peek",
    "poke",
    "compare_exchange",
    "force",
    "unforce",
    "describe",
    "text",
    "snapshot",
    "changes",
    "now",
    "step",
    "save",
    "back_to",
    "forget",
    "step_to_sync",
    "wait",
    "wait_bits",
    "expect",
    "expect_near",
    "expect_bits",
    "expect_that",
    "expect_changes",
    "drive",
    "board",
    "set_board",
    "reset",
    "power_cycle",
    "initial_flag",
    "event_count",
    "trigger_count",
    "fault",
    "faults",
    "clear_fault",
    "clear_faults",
    "expect_required_faults",
    "findings",
    "clear_findings",
    "expect_no_findings",
    "send_frame",
    "rtr",
    "expect_frame",
    "expect_no_frame",
    "frames",
    "journal",
    "journal_lines",
)
# Arguments that are numbers or booleans; values and times are texts as engineers write them.
_TYPES = {
    "identifier": int,
    "mask": int,
    "extended": bool,
    "condition": bool,
    "count": int,
    "since": int,
    "tolerance": int,
    "number": int,
    "saved": int,
    "event": int,
    "trigger": int,
}
_LISTS = ("registers", "rules")


class CommramLibrary:
    """A plant of its own for each test, or a running instance.

    | Library | CommramLibrary |
    | Library | CommramLibrary | plant=winder.toml | findings=deadline |
    | Library | CommramLibrary | instance=default |

    Each verb is a keyword: `Poke | node2.w_CPU_CONTROL | 16#0001`, `Wait | node2.w_OPTION_STATUS | 16#0002 | 1ms`. At the end of
    a test, faults that are `required` must have struck. On a plant of its own, the access checker must also have found nothing but
    of the rules in `findings`. The message of a test that failed has the last lines of the journal.
    """

    ROBOT_LIBRARY_SCOPE = "TEST"
    ROBOT_LISTENER_API_VERSION = 3
    ROBOT_LIBRARY_DOC_FORMAT = "ROBOT"

    def __init__(
        self, plant: str | None = None, instance: str | None = None, findings: str = "", journal: int = 20
    ) -> None:
        self.ROBOT_LIBRARY_LISTENER = self
        if instance is not None and findings:
            raise ValueError("findings= is for a plant of the test; on an instance, write Expect No Findings")
        self._given = (plant, instance)
        self._allowed = findings.replace(",", " ").split()
        self._journal = int(journal)
        self._plant: Emulator | Connection | None = None

    def _open(self) -> Emulator | Connection:
        if self._plant is None:
            plant, instance = self._given
            if plant is not None and instance is not None:
                raise ValueError("give a plant or an instance, not both")
            self._plant = Connection(instance) if instance is not None else Emulator(plant and _found(plant))
        return self._plant

    def get_keyword_names(self) -> list[str]:
        return list(_VERBS)

    def _parameters(self, name: str) -> list[inspect.Parameter]:
        return list(inspect.signature(getattr(Emulator, name)).parameters.values())[1:]

    def get_keyword_arguments(self, name: str) -> list[Any]:
        def shown(parameter: inspect.Parameter) -> Any:
            if parameter.name in _LISTS:
                return f"*{parameter.name}"
            has_default = parameter.default is not parameter.empty
            return (parameter.name, parameter.default) if has_default else parameter.name

        return [shown(parameter) for parameter in self._parameters(name)]

    def get_keyword_types(self, name: str) -> dict[str, Any]:
        known = {it.name: _TYPES[it.name] for it in self._parameters(name) if it.name in _TYPES}
        # In other verbs, `since` is a snapshot and not a time.
        return known if name in ("frames", "journal") else {it: known[it] for it in known if it != "since"}

    def get_keyword_documentation(self, name: str) -> str:
        if name == "__intro__":
            return inspect.getdoc(type(self)) or ""
        if name == "__init__":
            return ""
        return f"The verb `{name}` of docs/reference/scenarios.md and docs/guide/python.md."

    def run_keyword(self, name: str, arguments: list[Any], named: dict[str, Any]) -> Any:
        plant = self._open()
        lists = [at for at, it in enumerate(self._parameters(name)) if it.name in _LISTS]
        if lists:
            arguments = [*arguments[: lists[0]], list(arguments[lists[0] :])]
        return getattr(plant, name)(*arguments, **named)

    def end_test(self, data: Any, result: Any) -> None:
        """Robot Framework calls it."""
        plant, self._plant = self._plant, None
        if plant is None:
            return
        try:
            if result.passed:
                try:
                    # A running instance may have findings from before the test.
                    if isinstance(plant, Emulator):
                        plant.expect_no_findings(self._allowed)
                    plant.expect_required_faults()
                except Exception as error:
                    result.status, result.message = "FAIL", str(error)
            if result.failed and self._journal and "journal, last entries" not in result.message:
                lines = [line.strip() for line in plant.journal_lines(self._journal)]
                result.message += "\n\njournal, last entries:\n" + "\n".join(lines)
        finally:
            plant.close()


def _found(plant: str) -> str | Path:
    """A plant file from the suite's directory, or the text of one."""
    if any(sign in plant for sign in "\n=["):
        return plant
    from robot.libraries.BuiltIn import BuiltIn

    return Path(str(BuiltIn().get_variable_value("${SUITE SOURCE}"))).parent / plant
