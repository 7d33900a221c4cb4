"""Parses exported Structured Text."""

import sys

from blark.parse import parse_source_code

with open(sys.argv[1], encoding="utf-8") as file:
    result = parse_source_code(file.read())
if result.exception:
    sys.exit(str(result.exception))
print("parsed", len(result.transform().items), "declarations")
