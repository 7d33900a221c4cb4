"""Compiles an exported SystemRDL file, elaborates the given maps, and prints the address of a register in the last one: MAP... REGISTER."""

import sys

from systemrdl import RDLCompiler
from systemrdl.node import RegNode

compiler = RDLCompiler()
compiler.compile_file(sys.argv[1])
*maps, register = sys.argv[2:]
for name in maps:
    root = compiler.elaborate(top_def_name=name)
    registers = [node for node in root.top.descendants(unroll=True) if isinstance(node, RegNode)]
    print(name, len(registers))
print(register, root.top.find_by_path(register).absolute_address)
