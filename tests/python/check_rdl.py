"""Compiles an exported SystemRDL file and prints one register that every map has."""

import sys

from systemrdl import RDLCompiler
from systemrdl.node import RegNode

compiler = RDLCompiler()
compiler.compile_file(sys.argv[1])
for phase in ("init", "cyclic"):
    root = compiler.elaborate(top_def_name=f"omega_drive_line_2_{phase}")
    registers = [node for node in root.top.descendants(unroll=True) if isinstance(node, RegNode)]
    print(phase, len(registers))
found = root.top.find_by_path("_CANsync_CTRL_MA.a_RD_BMARRAY[1][0]")
print("CTRL_MA.a_RD_BMARRAY[1][0]", found.absolute_address)
