"""Reads waveforms with pywellen and prints the changes of those signals that are named behind the file."""

import sys

import pywellen

waveform = pywellen.Waveform(sys.argv[1])
timescale = waveform.timescale
print("timescale", timescale.factor, timescale.unit)
variables = {variable.full_name: variable for variable in waveform.all_vars()}
for name in sys.argv[2:]:
    print(name, variables[name].var_type, *(f"{time}:{value}" for time, value in variables[name].tv))
