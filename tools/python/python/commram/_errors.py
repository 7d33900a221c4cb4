"""Errors. Wrong types are TypeError; values that a register cannot hold, and invalid texts, are ValueError."""

from __future__ import annotations


class Error(Exception):
    """Anything that goes wrong with a plant, an instance or an image."""


class NotAttached(Error):
    """The instance or its image does not exist, or is invalid."""


class Gone(Error):
    """The emulator has ended, was killed, or has been replaced."""


class Refused(Error):
    """The plant refused a request; docs/reference/channel.md lists the values of `code`."""

    code: int = 0


class UnknownName(Error, KeyError):
    """There is no such register, area, PLC, bus or rule."""

    def __str__(self) -> str:
        # KeyError would show the text in quotes.
        return str(self.args[0]) if self.args else ""


class PlantError(Error, ValueError):
    """The plant file cannot be read, or the plant is refused."""


class Failed(Error, AssertionError):
    """An expectation is not met."""

    what: str = ""
    register: str | None = None
    address: str | None = None
    expected: str | None = None
    actual: str | None = None
    time: int = 0
    section: str | None = None
    journal: list[str] = []


class Timeout(Failed, TimeoutError):
    """The awaited condition did not become true in time."""
