"""Parses exported Structured Text."""

import re
import sys

from blark.parse import parse_source_code

with open(sys.argv[1], encoding="utf-8") as file:
    text = file.read()
# blark supports the language of one vendor. It does not support the following parts of the standard or of a compiler:
# a configuration after the program, pragmas, references of the third edition, presets of named arrays.
text = text.split("\nCONFIGURATION ")[0]
text = re.sub(r"\{\{.*?\}\}|\{#include[^}]*\}", lambda pragma: ";" if ";" in pragma[0] else "", text, flags=re.DOTALL)
text = text.replace(": REF_TO ", ": POINTER TO ")
text = re.sub(r" := \[.*?\];", ";", text)
result = parse_source_code(text)
if result.exception:
    sys.exit(str(result.exception))
print("parsed", len(result.transform().items), "declarations")
