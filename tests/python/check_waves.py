"""Reads waveforms with pywellen and prints the changes of the signals named after the file. With --same and
another file, compares all signals of both files."""

import sys

import pywellen


def read(file):
    waveform = pywellen.Waveform(file)
    return waveform, {variable.full_name: variable for variable in waveform.all_vars()}


def is_unknown(value):
    return value is None or (isinstance(value, str) and not value.strip("xX"))


def text(value):
    """Decodes a text, which FST stores as the bits of its characters."""
    if isinstance(value, str):
        return value
    return value.to_bytes((value.bit_length() + 7) // 8, "big").decode()


def changes(variable, kind):
    if kind == "Event":
        return [time for time, value in variable.tv if not is_unknown(value)]
    known = [(time, value) for time, value in variable.tv if not is_unknown(value)]
    return [(time, text(value)) for time, value in known] if kind == "String" else known


waveform, variables = read(sys.argv[1])
if sys.argv[2] == "--same":
    _, others = read(sys.argv[3])
    assert variables.keys() == others.keys(), variables.keys() ^ others.keys()
    for name, variable in variables.items():
        kind = variable.var_type
        one, other = changes(variable, kind), changes(others[name], kind)
        assert one == other, f"{name} ({kind}): {one[:5]} is not {other[:5]}"
    print(len(variables), "signals are the same")
else:
    timescale = waveform.timescale
    print("timescale", timescale.factor, timescale.unit)
    for name in sys.argv[2:]:
        print(name, variables[name].var_type, *(f"{time}:{value}" for time, value in variables[name].tv))
