"""Registers as attributes: `plant.node2.a_RD_BMARRAY[1][0]`."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from typing import Any, Protocol

_PARTS = re.compile(r"([^.:\[\]]+:)|([^.:\[\]]+)|\[(\d+)\]")

Tree = dict[Any, Any]


class Owner(Protocol):
    """An object with registers: a plant, or a PLC of it."""

    def peek(self, register: str) -> int: ...

    def poke(self, register: str, value: int | str) -> None: ...

    def view(self, name: str) -> memoryview: ...

    def array(self, name: str) -> Any: ...


def tree(names: Iterable[str]) -> Tree:
    """The parts of names, within each other; registers are empty."""
    root: Tree = {}
    for name in names:
        node = root
        for plc, part, index in _PARTS.findall(name):
            node = node.setdefault(plc[:-1] or part or int(index), {})
    return root


class Names:
    """An area, a structure or an array of registers. Attributes and elements that are registers are their values."""

    __slots__ = ("_owner", "_path", "_tree")

    def __init__(self, owner: Owner, path: str, tree: Tree):
        object.__setattr__(self, "_owner", owner)
        object.__setattr__(self, "_path", path)
        object.__setattr__(self, "_tree", tree)

    def _join(self, key: str | int) -> str:
        if isinstance(key, int):
            return f"{self._path}[{key}]"
        # A colon follows a PLC's name.
        return f"{self._path}{key}" if self._path.endswith(":") else f"{self._path}.{key}"

    def _missing(self, key: str | int) -> str:
        if isinstance(key, int):
            return f"{self._path} has {len(self._tree)} elements, there is no [{key}]"
        near = difflib.get_close_matches(key, [it for it in self._tree if isinstance(it, str)], 1)
        return f"{self._path} has no '{key}'" + (f"; did you mean '{near[0]}'?" if near else "")

    def _get(self, key: str | int) -> Any:
        below = self._tree[key]
        return Names(self._owner, self._join(key), below) if below else self._owner.peek(self._join(key))

    def _set(self, key: str | int, value: int | str) -> None:
        if self._tree[key]:
            raise TypeError(f"{self._join(key)} is not one register; write its elements, or into its array()")
        self._owner.poke(self._join(key), value)

    def __getattr__(self, name: str) -> Any:
        if name not in self._tree:
            raise AttributeError(self._missing(name))
        return self._get(name)

    def __setattr__(self, name: str, value: int | str) -> None:
        if name not in self._tree:
            raise AttributeError(self._missing(name))
        self._set(name, value)

    def _index(self, index: int) -> int:
        if isinstance(index, bool) or not isinstance(index, int):
            raise TypeError(f"{self._path}: an index is an integer, not {index!r}")
        if index not in self._tree:
            raise IndexError(self._missing(index))
        return index

    def __getitem__(self, index: int) -> Any:
        return self._get(self._index(index))

    def __setitem__(self, index: int, value: int | str) -> None:
        self._set(self._index(index), value)

    def __len__(self) -> int:
        return len(self._tree)

    def __iter__(self) -> Iterator[Any]:
        return (self._get(key) if isinstance(key, int) else key for key in self._tree)

    def __dir__(self) -> list[str]:
        return [key for key in self._tree if isinstance(key, str)]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        array = self._owner.array(self._path)
        if dtype is not None and array.dtype != dtype:
            return array.astype(dtype)
        return array.copy() if copy else array

    def __repr__(self) -> str:
        keys = list(self._tree)
        shown = f"[0] to [{len(keys) - 1}]" if isinstance(keys[0], int) else ", ".join(keys)
        return f"<{self._path}: {shown}>"
