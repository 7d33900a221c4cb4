"""Reads a device description file with pyprofibus and prints the values that a master reads from it.

Usage: check_gsd.py GSD
"""

import sys

from pyprofibus.gsd.interp import GsdInterp


def main(path):
    gsd = GsdInterp.fromFile(path)
    for name in ("Vendor_Name", "Model_Name", "Max_Module", "Max_Data_Len", "MaxTsdr_12M", "12M_supp"):
        print(f"{name}={gsd.getField(name)}")
    print(f"ident {gsd.getIdentNumber():04X}, modular {gsd.isModular()}")
    print("parameters", gsd.getUserPrmData().hex(" ").upper())
    for name in ("Communication Window, read", "Output, 6 bytes, 16#203"):
        gsd.setConfiguredModule(name)
    for element in gsd.getCfgDataElements():
        print("module", element.getDU().hex(" ").upper())


main(sys.argv[1])
