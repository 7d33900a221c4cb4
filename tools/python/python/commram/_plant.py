"""Plants in this process, and running instances through their channel."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from typing import TYPE_CHECKING, Any

from . import _native
from ._errors import Error
from ._registers import Registers

if TYPE_CHECKING:
    from typing import Self


class Plant(Registers, _native.Bench):
    """The verbs of scenarios (docs/reference/scenarios.md) on a plant or a running instance."""

    def wait_until(self, condition: Callable[[], Any], within: str | int) -> int:
        """Lets the time pass until the condition is true; returns how long that took, in microseconds.

        It is called whenever something may have happened.
        """
        within_us = _native.microseconds(within)
        start = self.now()
        while not condition():
            self.pass_or_fail(start, within_us)
        return self.now() - start


class Emulator(Plant):
    """A plant of its own in this process, with a stepped clock: time passes only in the verbs.

    `plant` is the path of a plant file or its text; left out, the built-in plant.
    """

    def __new__(cls, plant: str | PathLike[str] | None = None) -> Self:
        return super().__new__(cls, plant)

    def __repr__(self) -> str:
        if self.closed:
            return "<Emulator, closed>"
        try:
            return f"<Emulator of {', '.join(self.plcs)} at {self.now()} us>"
        except Error:
            # This thread is in a verb, and a signal handler asks.
            return "<Emulator, busy>"


class Connection(Plant):
    """A running instance, through its channel: `connect`."""

    instance: str

    def __new__(cls, instance: str = "default", timeout: float = 0.0) -> Self:
        if not isinstance(instance, str):
            raise TypeError(f"the name of an instance is a str, not {instance!r}")
        self = super().__new__(cls, None, instance, timeout)
        self.instance = instance
        return self

    def __repr__(self) -> str:
        return f"<Connection to {self.instance}{', closed' if self.closed else ''}>"


def connect(instance: str = "default", timeout: float = 0.0) -> Connection:
    """Connects to a running instance; `timeout` is how long to wait for one that is not there yet, in seconds.

    With `commram run --clock stepped` all verbs do what they do on a plant of one's own; on a clock that runs by itself those
    that wait make sense, `step` is refused.
    """
    return Connection(instance, timeout)
