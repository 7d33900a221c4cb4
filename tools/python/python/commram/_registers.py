"""Common interface of all objects with registers: plants, running instances, images."""

from __future__ import annotations

import ctypes
from types import TracebackType
from typing import TYPE_CHECKING, Any

from . import _names
from ._native import Memory

if TYPE_CHECKING:
    from typing import Literal, Self

    Code = Literal["b", "B", "h", "H", "i", "I"]


def _bytes(memory: Memory) -> memoryview:
    """The whole memory, which stays mapped as long as a view of it exists."""

    class Bytes(ctypes.Array[ctypes.c_uint8]):
        _type_ = ctypes.c_uint8
        _length_ = memory.size
        keep: Memory

    found = Bytes.from_address(memory.base)
    found.keep = memory
    view = memoryview(found).cast("B")
    return view if memory.writable else view.toreadonly()


class Registers:
    """Names, attributes, views and the life of something that has registers."""

    if TYPE_CHECKING:

        def peek(self, register: str) -> int: ...

        def poke(self, register: str, value: int | str) -> None: ...

        def names(self, area: str | None = None) -> list[str]: ...

        def memory(self, plc: str = "") -> Memory: ...

        def array_of(self, name: str) -> tuple[str, tuple[int, Code, list[tuple[int, int]]]]: ...

        def close(self) -> None: ...

    _known_names: _names.Tree | None = None
    # In a plant with several PLCs, the names of the PLCs are prefixes of the names of registers.
    _behind_first: str = ""

    def _tree(self) -> _names.Tree:
        if self._known_names is None:
            names = self.names()
            self._behind_first = ":" if any(":" in name for name in names[:1]) else ""
            self._known_names = _names.tree(names)
        return self._known_names

    def read(self, name: str) -> int:
        """As `peek`."""
        return self.peek(name)

    def write(self, name: str, value: int | str) -> None:
        """As `poke`."""
        self.poke(name, value)

    def _lying(self, name: str) -> tuple[memoryview, int, Code, list[tuple[int, int]]]:
        plc, (first, code, dims) = self.array_of(name)
        return _bytes(self.memory(plc)), first, code, dims

    def view(self, name: str) -> memoryview:
        """The registers of an array where they are, as a memoryview of numbers: nothing is copied."""
        view, first, code, dims = self._lying(name)
        width = ctypes.sizeof(_TYPES[code])
        counts = [count for count, _ in dims]
        strides = [stride for _, stride in dims]
        dense = [width * _product(counts[at + 1 :]) for at in range(len(counts))]
        if strides == dense:
            part = view[first : first + width * _product(counts)]
            return part.cast(code, counts) if len(counts) > 1 else part.cast(code)
        if len(dims) == 1 and strides[0] % width == 0:
            size = (counts[0] - 1) * strides[0] + width
            return view[first : first + size].cast(code)[:: strides[0] // width]
        raise ValueError(f"{name} has other registers in between; array() shows it with numpy, or take one row of it")

    def array(self, name: str) -> Any:
        """The registers of an array where they are, as a numpy array: nothing is copied. Needs numpy."""
        try:
            import numpy
        except ImportError as error:
            raise ImportError("array() needs numpy (pip install numpy); view() does not") from error
        view, first, code, dims = self._lying(name)
        shape, strides = tuple(count for count, _ in dims), tuple(stride for _, stride in dims)
        return numpy.ndarray(shape, numpy.dtype(f"<{_NUMPY[code]}"), view, first, strides)

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("__"):
            below = self._tree().get(name)
            if below:
                return _names.Names(self, name + self._behind_first, below)
        raise AttributeError(f"{type(self).__name__} has no attribute or area '{name}'")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(key for key in self._tree() if isinstance(key, str))]

    def _ipython_key_completions_(self) -> list[str]:
        return self.names()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _product(numbers: list[int]) -> int:
    result = 1
    for number in numbers:
        result *= number
    return result


_TYPES: dict[str, Any] = {
    "b": ctypes.c_int8,
    "B": ctypes.c_uint8,
    "h": ctypes.c_int16,
    "H": ctypes.c_uint16,
    "i": ctypes.c_int32,
    "I": ctypes.c_uint32,
}
_NUMPY = {"b": "i1", "B": "u1", "h": "i2", "H": "u2", "i": "i4", "I": "u4"}
