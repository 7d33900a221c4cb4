"""Brings the master of the built-in plant into active operation with a client that openapi-python-client has generated.

Arguments: directory of the generated package, address of the server, token, instance.
"""

import sys

sys.path.insert(0, sys.argv[1])
from commram_client import AuthenticatedClient
from commram_client.api.advances import advance, wait
from commram_client.api.looks import peek
from commram_client.api.show import show_operations
from commram_client.api.stores import poke
from commram_client.models import AdvanceBody, PeekWidth, PokeBody, PokeBodyWidth, WaitBody, WaitBodyWidth

_, _, address, token, instance = sys.argv
client = AuthenticatedClient(base_url=address, token=token, raise_on_unexpected_status=True)


def write(text: str) -> None:
    """Writes a register by name: REG=VALUE."""
    words = show_operations.sync(instance, client=client, poke=[text])
    (operation,) = words.additional_properties["operations"]
    fields = operation["poke"]
    body = PokeBody(fields["offset"], fields["plc"], fields["value"], PokeBodyWidth(fields["width"]))
    assert poke.sync(instance, client=client, body=body) == "written", text


def reaches(status: int) -> None:
    """Waits for a value of w_OPTION_STATUS."""
    body = WaitBody(0xFFFF, 200_002, 0, status, WaitBodyWidth("Word"), 2_000_000)
    reply = wait.sync(instance, client=client, body=body)
    assert getattr(reply, "waited", None) is not None and reply.waited.value == status, reply


INIT = """b_MA_SL_MODE=16#00 b_AC=16#FF b_AM=16#FF b_BT_0=16#00 b_BT_1=16#1C b_OUTPUT_CONTROL=16#FA
b_CLOCK_DIVIDER=16#07 b_TIME_PATTERN=2 a_SL_TYP[1]=16#01 a_SL_TYP[2]=16#01 a_SL_TYP[3]=16#01"""

for command, status, init in [(0, 1, ""), (1, 2, ""), (2, 3, INIT), (0x20, 0x43, "")]:
    for text in init.split():
        write(f"node2.{text}")
    write(f"node2.w_CPU_CONTROL={command}")
    reaches(status)
assert advance.sync(instance, client=client, body=AdvanceBody(1_000_000)).time > 1_000_000
write("node2.w_CPU_CONTROL=16#0040")
reaches(0x80)
status = peek.sync(instance, client=client, plc=0, offset=200_002, width=PeekWidth("Word"))
assert status.value == 0x80, status
refused = peek.sync(instance, client=client, plc=9, offset=0, width=PeekWidth("Word"))
assert (refused.exit_code, refused.code) == (2, 8), refused
print("active")
