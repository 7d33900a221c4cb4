

def __getattr__(name: str):
    if name in ("Emulator", "connect"):
        raise AttributeError(
            f"{__file__} is the module that `commram export python` writes; '{name}' is in the package of the same name, "
            "which this file hides: rename this file, the package has all of its contents (docs/guide/python.md)"
        )
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


class Error(Exception):
    """Anything that goes wrong with an image."""


class NotAttached(Error):
    """The image does not exist, or it is not a valid image."""


class Gone(Error):
    """The emulator has ended, was killed, or has been replaced."""


class Timeout(Error, TimeoutError):
    """A register did not get the expected value in time."""


class Register(NamedTuple):
    """One register, or one element of an array."""

    name: str
    address: int  # byte of the image
    code: str  # as in the modules struct and array
    owner: str  # "PLC", "firmware" or "both"
    reset: int
    reserved: bool
    meaning: Optional[str]
    doc: str
    page: str  # of the manual
    provenance: str  # "manual", or which facts are inferred and from which decision

    @property
    def width(self) -> int:
        """Width in bytes: 1, 2 or 4."""
        return _WIDTHS[self.code]

    @property
    def iec_address(self) -> str:
        """The address as the PLC programmer writes it, for example %MW3.200000."""
        for letter, segment, words, first, offset, size in _SPACES:
            if offset <= self.address < offset + size:
                number = (2 if words else 1) * first + self.address - offset
                return f"%{letter}{' BW D'[self.width]}{segment}{number // self.width if words else number}"
        return f"byte {self.address} of the image"

    def decode(self, value: int) -> str:
        """What a value means."""
        if self.reserved:
            return "reserved"
        return decode(self.meaning, value, self.width) if self.meaning else str(value)


_WIDTHS = {"b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4, "Q": 8}
_UNSIGNED = {1: "B", 2: "H", 4: "I", 8: "Q"}
_INDEX = re.compile(r"\[(\d+)\]")
_ADDRESS = re.compile(r"%([IQM])([BWD])((?:\d+\.)?)(\d+)", re.IGNORECASE)


def _mask(width: int) -> int:
    return (1 << (8 * width)) - 1


def _integer(name: str, value: int) -> int:
    if isinstance(value, bool):
        raise TypeError(f"{name}: {value} is a bool; a register takes an integer")
    try:
        return operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: {value!r} is a {type(value).__name__}; a register takes an integer") from None


def _known_value(values, value: int):
    """The text for the value and the decision that it follows from."""
    for first, last, text, decision in values:
        if first <= value <= last:
            return text.replace("{}", str(value)), decision
    return None


def _told(text: str, decision: Optional[str]) -> str:
    return f"{text} ({decision})" if decision else text


def _hex(value: int, width: int) -> str:
    return f"16#{value & _mask(width):0{2 * width}X}"


def decode(meaning: str, value: int, width: int) -> str:
    """Meaning of `value` in a register of `width` bytes; an inferred meaning is followed by its decision."""
    values, bits = _MEANINGS[meaning]
    value &= _mask(width)
    known = _known_value(values, value)
    if known is not None:
        return _told(*known)
    if not bits:
        return "no meaning"
    text, described, decision = "", 0, None
    for first, last, zero, one, field_text, field_values, joined, reserved, source in bits:
        mask = (1 << (last - first + 1)) - 1
        part = (value >> first) & mask
        described |= mask << first
        if reserved:
            plural = "" if part & (part - 1) == 0 else "s"
            found = f"reserved bit{plural} {_hex(part << first, last // 8 + 1)} set" if part else ""
        else:
            found = (one if part else zero) if first == last else field_text.replace("{}", str(part))
            found, source = _known_value(field_values, part) or (found, source)
        if not found:
            continue
        # Consecutive parts may be inferred from the same decision. Only the last of these parts names the decision.
        if source != decision:
            text, decision = _told(text, decision), source
        if text:
            text += " " if joined else ", "
        text += found
    text = _told(text, decision)
    if value & ~described:
        text += f"{', ' if text else ''}bits {_hex(value & ~described, width)} have no meaning"
    return text


def _table():
    """All registers by their names without indices; the first structure that has a name counts."""
    table = {}
    for area, (first, _bytes, _doc, structures) in AREAS.items():
        for structure, _live, _variable in structures:
            for row in _STRUCTURES[structure]:
                group, name = row[0], row[1]
                key = f"{area}.{group}.{name}" if group else f"{area}.{name}"
                table.setdefault(key, (first, row))
    return table


_TABLE = _table()


def _offset(space: str, within: str, number: int, width: int) -> Optional[int]:
    """The byte of the image that an address names; None if the device has no such place."""
    for letter, segment, words, first, begin, size in _SPACES:
        offset = begin + number * (width if words else 1) - first * (2 if words else 1)
        fits = begin <= offset <= begin + size - width and offset % width == 0
        if (letter, segment) == (space, within) and fits:
            return offset
    return None


def register(name: str) -> Register:
    """The register called `name`, for example "node2.a_RD_BMARRAY[1][0]" or "%MW3.200002"."""
    address = _ADDRESS.fullmatch(name)
    if address:
        width = {"B": 1, "W": 2, "D": 4}[address[2].upper()]
        offset = _offset(address[1].upper(), address[3], int(address[4]), width)
        if offset is None:
            raise KeyError(f"{name}: not an address of a register {width} bytes wide")
        return Register(name, offset, _UNSIGNED[width], "both", 0, False, None, "", "", "")
    known = _TABLE.get(_INDEX.sub("", name))
    if known is None:
        raise KeyError(f"{name}: no such register")
    first, (_, _, code, offset, dims, _, owner, reset, reserved, meaning, doc, page, provenance) = known
    indices = [int(index) for index in _INDEX.findall(name)]
    if len(indices) != len(dims):
        raise KeyError(f"{name}: {len(dims)} indices are needed, not {len(indices)}")
    for index, (count, used, stride) in zip(indices, dims):
        if index >= count:
            raise KeyError(f"{name}: index {index} is not below {count}")
        offset += index * stride
        reserved = reserved or index >= used
    return Register(name, first + offset, code, owner, reset, reserved, meaning, doc, page, provenance)


def names(area: Optional[str] = None) -> Iterator[str]:
    """The names of all registers, or of those of one area, arrays element by element."""
    for key, (_first, row) in _TABLE.items():
        place, group, own = key.split(".", 1)[0], row[0], row[1]
        if area not in (None, place):
            continue
        for index in itertools.product(*(range(count) for count, _used, _stride in row[4])):
            text = [f"[{i}]" for i in index]
            outer = f"{group}{''.join(text[:row[5]])}." if group else ""
            yield f"{place}.{outer}{own}{''.join(text[row[5]:])}"


def _header_field(path: str):
    """Offset and code of a field of the header page, for example "events[12].bell.word"."""
    offset, kind = 0, "Header"
    for part in path.split("."):
        name, indices = _INDEX.sub("", part), _INDEX.findall(part)
        fields = _HEADER[kind] if kind in _HEADER else {}
        if name not in fields:
            raise KeyError(f"{path}: the header page has no such field")
        start, kind, count, width = fields[name]
        if (count is not None) != bool(indices) or (indices and int(indices[0]) >= count):
            raise KeyError(f"{path}: {name} has {count or 'no'} elements")
        offset += start + (int(indices[0]) * width if indices else 0)
    if kind not in _WIDTHS:
        raise KeyError(f"{path}: not a number but a structure")
    return offset, kind


_GENERATION, _STATE = _header_field("generation"), _header_field("state")
# Time in seconds between two checks that the process of the emulator exists.
_LIVENESS = 0.1


class Ram:
    """An attached image. Use it as a dictionary from register names to numbers."""

    def __init__(self, path: str, writable: bool = True):
        if sys.byteorder != "little":
            raise NotAttached("the registers are little endian, this computer is not")
        flags = (os.O_RDWR if writable else os.O_RDONLY) | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK
        self.path = path
        try:
            self._file = os.open(path, flags)
        except OSError as error:
            raise NotAttached(f"{path}: {error.strerror}") from error
        try:
            self._check_file()
            access = mmap.ACCESS_WRITE if writable else mmap.ACCESS_READ
            self._map = mmap.mmap(self._file, SEGMENT_SIZE, access=access)
        except BaseException:
            os.close(self._file)
            raise
        # One element of such a view is loaded and stored as a whole, in one access of its width.
        whole = memoryview(self._map)
        self._views = {code: whole.cast(code) for code in _WIDTHS}
        whole.release()
        self.generation = self.header("generation")
        self._next_check = time.monotonic() + _LIVENESS
        try:
            self.check()
        except BaseException:
            self.close()
            raise

    def _check_file(self):
        """The checks of docs/reference/attach.md, in its order."""
        info = os.fstat(self._file)
        if not stat.S_ISREG(info.st_mode):
            raise NotAttached(f"{self.path}: no image")
        if info.st_uid != os.geteuid():
            raise NotAttached(f"{self.path}: the image belongs to another user")
        head = os.pread(self._file, 28, 0)
        if len(head) < 28:
            raise NotAttached(f"{self.path}: the image is too short")
        magic, abi, _size, layout, segment = struct.unpack("<QIIQI", head)
        if magic != MAGIC:
            raise NotAttached(f"{self.path}: the file is no image of a communication RAM")
        if abi != ABI_VERSION:
            raise NotAttached(
                f"{self.path}: the image has ABI version {abi}, this module knows {ABI_VERSION}; "
                "write it with `commram export python` of that emulator's version"
            )
        # A controller with option cards also has all registers of the map without them.
        offset, _ = _header_field("base_layout_hash")
        base = os.pread(self._file, 8, offset)
        if layout != LAYOUT_HASH and base != struct.pack("<Q", LAYOUT_HASH):
            raise NotAttached(
                f"{self.path}: the image has another register map, 16#{layout:016X}, this module knows "
                f"16#{LAYOUT_HASH:016X}; write it with `commram export python` for that device"
            )
        if segment != SEGMENT_SIZE or info.st_size < SEGMENT_SIZE:
            raise NotAttached(f"{self.path}: the image is too short")

    def close(self):
        """Unmaps the image. The emulator is not touched."""
        if self._views:
            for view in self._views.values():
                view.release()
            self._views = {}
            self._map.close()
            os.close(self._file)

    def __enter__(self):
        return self

    def __exit__(self, *_exception):
        self.close()

    def _load(self, offset: int, code: str) -> int:
        return self._views[code][offset // _WIDTHS[code]]

    def _store(self, name: str, offset: int, code: str, value: int):
        value, width = _integer(name, value), _WIDTHS[code]
        smallest = -(1 << (8 * width - 1)) if code.islower() else 0
        if not smallest <= value <= _mask(width):
            raise ValueError(f"{name}: {value} is out of range, the register holds {smallest} to {_mask(width)}")
        # A signed register also accepts bit patterns.
        self._views[_UNSIGNED[width]][offset // width] = value & _mask(width)

    def read(self, name: str) -> int:
        """The register's value; negative numbers in signed registers."""
        found = register(name)
        self._check_often()
        return self._load(found.address, found.code)

    def write(self, name: str, value: int):
        """Stores to a register. The firmware sees it at its next look, at the latest after a processor cycle."""
        found = register(name)
        self._check_often()
        self._store(name, found.address, found.code, value)

    __getitem__ = read
    __setitem__ = write

    def text(self, name: str) -> str:
        """What the register's present value means."""
        return register(name).decode(self.read(name))

    def header(self, path: str) -> int:
        """A number of the header page, for example "virtual_time_us" or "board.display"."""
        return self._load(*_header_field(path))

    def write_header(self, path: str, value: int):
        """Stores to a field of the header page that the attach contract gives to clients."""
        offset, code = _header_field(path)
        self._check_often()
        self._store(path, offset, code, value)

    def check(self):
        """Raises Gone or NotAttached unless the emulator that was attached to runs and is ready."""
        if self.header("generation") != self.generation:
            raise Gone(f"{self.path}: another emulator has taken the image over")
        state = self.header("state")
        if state == State.STARTING:
            raise NotAttached(f"{self.path}: the emulator is not ready yet")
        if state != State.READY:
            raise Gone(f"{self.path}: the emulator has ended")
        if not self._process_runs() and not self._file_is_locked():
            raise Gone(f"{self.path}: the emulator was killed")

    def _check_often(self):
        """As `check`, but looks for the process of the emulator every 100 ms only."""
        now = time.monotonic()
        if (
            now >= self._next_check
            or self._load(*_GENERATION) != self.generation
            or self._load(*_STATE) != State.READY
        ):
            self.check()
            self._next_check = now + _LIVENESS

    def _process_runs(self) -> bool:
        try:
            with open(f"/proc/{self.header('firmware_pid')}/stat", "rb") as file:
                fields = file.read().rpartition(b")")[2].split()
        except OSError:
            return False
        return len(fields) > 19 and fields[0] not in b"ZX" and int(fields[19]) == self.header("firmware_start")

    def _file_is_locked(self) -> bool:
        """Whether an emulator holds the file. Its process may be invisible from here."""
        try:
            fcntl.flock(self._file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        fcntl.flock(self._file, fcntl.LOCK_UN)
        return False

    def wait(self, name: str, wanted: Union[int, Callable[[int], bool]], timeout: float = 5.0) -> int:
        """Waits until the register has the wanted value, or until `wanted(value)` is true; returns the value.

        `timeout` is in seconds of real time. In stepped mode another program must advance the clock.
        """
        found = register(name)
        expected = None if callable(wanted) else _integer(name, wanted) & _mask(found.width)
        end = time.monotonic() + timeout
        while True:
            value = self._load(found.address, found.code)
            if wanted(value) if callable(wanted) else value & _mask(found.width) == expected:
                return value
            self._check_often()
            if time.monotonic() >= end:
                aim = "what was awaited" if expected is None else _hex(expected, found.width)
                raise Timeout(
                    f"{found.name} ({found.iec_address}) did not become {aim} within {timeout} s, "
                    f"it is {_hex(value, found.width)}: {found.decode(value)}"
                )
            time.sleep(0.0005)


def attach(instance: str = "default", plc: str = "line", writable: bool = True) -> Ram:
    """Attaches to the RAM of a PLC of an emulator instance."""
    return Ram(f"/dev/shm/commram.{instance}.{plc}", writable)
