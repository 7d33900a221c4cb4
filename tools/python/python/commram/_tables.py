"""Enumerations of the meanings of register values, and of the header page's codes."""

from __future__ import annotations

import enum
from typing import Any

from . import _native


def _all() -> dict[str, Any]:
    known: dict[str, Any] = {}
    for name, is_flags, members, shifts in _native.enumerations():
        if members:
            kind: Any = enum.IntFlag if is_flags else enum.IntEnum
            known[name] = kind(name, members, module="commram")
        known.update(shifts)
    for name, codes in _native.codes():
        members = [(_snake(code).upper(), value) for code, value in codes]
        kind = enum.IntEnum
        known[name] = kind(name, members, module="commram")
    return known


def _snake(name: str) -> str:
    return "".join(f"_{letter}" if letter.isupper() and at else letter for at, letter in enumerate(name))


ALL = _all()
