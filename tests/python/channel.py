"""The iceoryx2 channel of an emulator through the iceoryx2 package for Python (docs/reference/export.md)."""

import ctypes
import os
import time

import iceoryx2 as iox2

PEEK, POKE, COMPARE_EXCHANGE, WAIT, ADVANCE, ADVANCE_TO_SYNC = 1, 2, 3, 5, 6, 7
ERROR = 9


class WireOp(ctypes.Structure):
    """One operation of a request."""

    _fields_ = [
        ("kind", ctypes.c_uint16),
        ("plc", ctypes.c_uint16),
        ("width", ctypes.c_uint16),
        ("node", ctypes.c_uint16),
        ("offset", ctypes.c_uint32),
        ("value", ctypes.c_uint32),
        ("second", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("time_us", ctypes.c_uint64),
    ]

    @staticmethod
    def type_name():
        return "commram.channel.WireOp.v5"


class Block(ctypes.Structure):
    """The head of the answer to an operation, or 16 bytes of its data."""

    _fields_ = [
        ("kind", ctypes.c_uint16),
        ("code", ctypes.c_uint16),
        ("data_len", ctypes.c_uint32),
        ("value", ctypes.c_uint64),
    ]

    @staticmethod
    def type_name():
        return "commram.channel.Block.v5"


class Channel:
    """A connection to an instance."""

    def __init__(self, instance):
        root = os.path.realpath(f"/dev/shm/commram.{instance}.iox.d")
        config = iox2.config.default()
        config.global_cfg.root_path = iox2.Path.new(root)
        with open(f"{root}/prefix", encoding="ascii") as prefix:
            config.global_cfg.prefix = iox2.FileName.new(prefix.read().strip())
        config.global_cfg.node.cleanup_dead_nodes_on_creation = False
        config.global_cfg.node.cleanup_dead_nodes_on_destruction = False
        config.global_cfg.service.cleanup_dead_nodes_on_open = False
        builder = iox2.NodeBuilder.new().config(config)
        builder = builder.signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        self._node = builder.create(iox2.ServiceType.Ipc)
        name = iox2.ServiceName.new("commram.channel")
        service = self._node.service_builder(name)
        self._service = service.request_response(iox2.Slice[WireOp], iox2.Slice[Block]).open()
        self._client = self._service.client_builder().initial_max_slice_len(256).create()

    def close(self):
        self._client.delete()
        del self._client, self._service, self._node

    def __enter__(self):
        return self

    def __exit__(self, *_exception):
        self.close()

    def request(self, *operations, timeout=30):
        """The head of the answer to each operation, up to the first error."""
        loan = self._client.loan_slice_uninit(len(operations))
        payload = loan.payload()
        for index, operation in enumerate(operations):
            payload[index] = operation
        pending = loan.assume_init().send()
        end = time.monotonic() + timeout
        while (response := pending.receive()) is None:
            if time.monotonic() > end:
                raise TimeoutError("the emulator does not answer")
            time.sleep(0.0005)
        blocks, heads, index = response.payload(), [], 0
        while len(heads) < len(operations) and not (heads and heads[-1].kind == ERROR):
            head = Block.from_buffer_copy(blocks[index])
            heads.append(head)
            index += 1 + (head.data_len + 15) // 16
        response.delete()
        pending.delete()
        return heads

    def listener(self, plc):
        """Listens to the events of a PLC; ids are event numbers."""
        name = iox2.ServiceName.new(f"commram.events.{plc}")
        return self._node.service_builder(name).event().open().listener_builder().create()
