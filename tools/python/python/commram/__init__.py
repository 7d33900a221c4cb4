"""commram: the communication RAM of drive and fieldbus controllers, emulated register by register.

`Emulator` is a plant in this process, `attach` maps the RAM of a running instance, `connect` talks to one through its
channel. docs/guide/python.md of the project is the reference.
"""

from __future__ import annotations

from typing import Any

from . import _tables
from ._errors import Error, Failed, Gone, NotAttached, PlantError, Refused, Timeout, UnknownName
from ._native import Change, Fault, Finding, Frame, Handle, Record, Register, Snapshot, default_device, names, register
from ._plant import Connection, Emulator, Plant, connect
from ._ram import Ram, attach

MAGIC, ABI_VERSION, LAYOUT_HASH, HEADER_SIZE, SEGMENT_SIZE = default_device()

__all__ = [
    "ABI_VERSION",
    "Change",
    "Connection",
    "Emulator",
    "Error",
    "Failed",
    "Fault",
    "Finding",
    "Frame",
    "Gone",
    "HEADER_SIZE",
    "Handle",
    "LAYOUT_HASH",
    "MAGIC",
    "NotAttached",
    "Plant",
    "PlantError",
    "Ram",
    "Record",
    "Refused",
    "Register",
    "SEGMENT_SIZE",
    "Snapshot",
    "Timeout",
    "UnknownName",
    "attach",
    "connect",
    "names",
    "register",
]


def __getattr__(name: str) -> Any:
    """The enumerations of register values: `commram.SEND.DATA_WRITTEN_TO_BE_SENT`."""
    try:
        return _tables.ALL[name]
    except KeyError:
        raise AttributeError(f"module 'commram' has no attribute '{name}'") from None


def __dir__() -> list[str]:
    return sorted([*__all__, *_tables.ALL])
