"""The image of a PLC of a running instance, mapped."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, cast
from . import _native
from ._errors import NotAttached
from ._registers import Registers, _bytes

if TYPE_CHECKING:
    from typing import Literal, Self

    Code = Literal["B", "I", "Q"]

_INDEX = re.compile(r"\[(\d+)\]")
_HEADER: dict[str, dict[str, tuple[int, str, int | None, int]]] = _native.header()
_WIDTHS = {"B": 1, "I": 4, "Q": 8}


def _header_field(path: str) -> tuple[int, Code]:
    """Offset and code of a field of the header page, for example "events[12].bell.word"."""
    offset, kind = 0, "Header"
    for part in path.split("."):
        name, indices = _INDEX.sub("", part), _INDEX.findall(part)
        fields = _HEADER.get(kind, {})
        if name not in fields:
            raise KeyError(f"{path}: the header page has no such field")
        start, kind, count, width = fields[name]
        if (count is not None) != bool(indices) or (count is not None and int(indices[0]) >= count):
            raise KeyError(f"{path}: {name} has {count or 'no'} elements")
        offset += start + (int(indices[0]) * width if indices else 0)
    if kind not in _WIDTHS:
        raise KeyError(f"{path}: not a number but a structure")
    return offset, cast("Code", kind)


_PATH = re.compile(r"/dev/shm/commram\.([^./]+)\.([^./]+)")


class Ram(Registers, _native.Image):
    """The registers of a PLC of a running instance, as a program on it has them. `path` is that of the image."""

    def __new__(cls, path: str, writable: bool = True) -> Self:
        image = _PATH.fullmatch(path)
        if image is None:
            raise NotAttached(f"{path}: images are /dev/shm/commram.INSTANCE.PLC; attach(INSTANCE, PLC) finds them")
        return cls._of(image[1], image[2], writable)

    @classmethod
    def _of(cls, instance: str, plc: str | None, writable: bool) -> Self:
        return super().__new__(cls, instance, plc, writable)

    def _page(self, code: Code) -> memoryview:
        return _bytes(self.memory()).cast(code)

    def header(self, path: str) -> int:
        """A number of the header page, for example "virtual_time_us" or "board.display"."""
        offset, code = _header_field(path)
        return int(self._page(code)[offset // _WIDTHS[code]])

    def write_header(self, path: str, value: int) -> None:
        """Stores to a field of the header page that the attach contract gives to clients."""
        offset, code = _header_field(path)
        if isinstance(value, bool) or not hasattr(value, "__index__"):
            raise TypeError(f"{path}: {value!r} is a {type(value).__name__}; a field takes an integer")
        if not 0 <= value < 1 << 8 * _WIDTHS[code]:
            raise ValueError(f"{path}: {value} does not fit into {_WIDTHS[code]} bytes")
        self.check()
        self._page(code)[offset // _WIDTHS[code]] = value

    def changes(self, since: _native.Snapshot) -> list[_native.Change]:
        """Changes since a snapshot."""
        if len(since.areas) == 1:
            return since.diff(self.snapshot(since.areas[0]))
        return since.diff(self.snapshot())

    def __repr__(self) -> str:
        return f"<RAM of {self.plc} of instance {self.instance}{', closed' if self.closed else ''}>"


def attach(instance: str = "default", plc: str | None = None, writable: bool = True) -> Ram:
    """Attaches to the RAM of a PLC of a running instance; without a name to the only one, or to `line`."""
    return Ram._of(instance, plc, writable)

