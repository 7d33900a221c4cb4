"""The iceoryx2 channel supports other languages: here through the iceoryx2 package for Python."""

import time

import pytest

iox2 = pytest.importorskip("iceoryx2")

from channel import ADVANCE, ADVANCE_TO_SYNC, COMPARE_EXCHANGE, ERROR, PEEK, POKE, WAIT, Channel, WireOp  # noqa: E402

CONTROL, STATUS = 200000, 200002


def test_registers_and_time(stepped):
    with Channel(stepped.name) as channel:
        heads = channel.request(
            WireOp(kind=POKE, offset=CONTROL, width=2, value=0x0001),
            WireOp(kind=ADVANCE, time_us=2000),
            WireOp(kind=PEEK, offset=STATUS, width=2),
            WireOp(kind=COMPARE_EXCHANGE, offset=CONTROL, width=2, second=0x0001, value=0x0000),
            WireOp(kind=WAIT, offset=STATUS, width=2, second=0xFFFF, value=0x0001, time_us=5000),
        )
        assert [head.kind == ERROR for head in heads] == [False] * 5
        assert heads[1].value == 2000
        assert heads[2].value == 0x0002
        assert heads[3].code == 1
    assert stepped.command("peek", "--raw", "node2.w_OPTION_STATUS") == "16#0001\n"


def test_events_wake_a_listener(stepped):
    with stepped.attach() as ram, Channel(stepped.name) as channel:
        listener = channel.listener("line")
        # Makes the same request as INTR_SET: CPU timer 1 with a period of 20 x 50 us, see docs/reference/attach.md.
        request = 20 << 16 | 1 << 1 | 1
        ram.write_header("interrupts[0].request", request)
        ram.write_header("board_requests", ram.header("board_requests") + 1)
        ram.write_header("doorbell.word", ram.header("doorbell.word") + 1)
        # The test waits for the answer before it advances the clock. Otherwise the first event would be at another
        # time. Any operation wakes the emulator, which then notices the doorbell.
        end = time.monotonic() + 20
        while ram.header("interrupts[0].answer") != request:
            assert time.monotonic() < end, "the board does not answer"
            channel.request(WireOp(kind=PEEK, offset=STATUS, width=2))
        channel.request(WireOp(kind=ADVANCE, time_us=10_000))
        seen = listener.timed_wait(iox2.Duration.from_secs(20))
        listener.delete()
        # Several events of one number may arrive as one notification; the header counts them.
        assert {event.id.as_value for event in seen} == {0}
        assert ram.header("events[0].bell.word") == 10


def test_impossible_operations_are_errors(stepped):
    with Channel(stepped.name) as channel:
        heads = channel.request(
            WireOp(kind=PEEK, offset=STATUS, width=2),
            WireOp(kind=ADVANCE_TO_SYNC, node=2),
            WireOp(kind=PEEK, offset=STATUS, width=2),
        )
        assert [head.kind == ERROR for head in heads] == [False, True]
        assert heads[1].code == 11
