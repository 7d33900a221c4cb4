"""Reads an electronic data sheet with three readers: canopen, lely's dcfchk and dcfgen (dcf-tools), and eds-utils.

Usage: check_eds.py FILE NODE
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import canopen
from eds_utils.core.file_io.read_eds import read_eds


def run(module, *arguments):
    done = subprocess.run([sys.executable, "-W", "error", "-m", module, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def of_canopen(path, node):
    dictionary = canopen.import_od(path, node_id=node)
    assert len(dictionary.names) == len(dictionary.indices), "names of objects are distinct"
    mapped = {}
    for index, object_ in dictionary.indices.items():
        subs = getattr(object_, "subindices", {})
        assert len(getattr(object_, "names", {})) == len(subs), (object_.name, "names of entries are distinct")
        assert not subs or subs[0].default == max(subs), object_.name
        if index & 0xFE00 in (0x1600, 0x1A00):
            mapped[index] = [dictionary[subs[sub].default >> 16][subs[sub].default >> 8 & 0xFF] for sub in subs if sub]
    for index, entries in mapped.items():
        assert all(entry.pdo_mappable for entry in entries), hex(index)
    print("canopen", len(dictionary.indices), sum(len(entries) for entries in mapped.values()))


def of_lely(path, node):
    # Checks the file, then the mappings that follow from the node's identifiers.
    run("dcf.cli", "-n", str(node), "-p", path)
    with tempfile.TemporaryDirectory() as directory:
        network = Path(directory, "network.yml")
        network.write_text(f"master:\n  node_id: 1\nnode:\n  dcf: {path}\n  node_id: {node}\n")
        run("dcfgen.cli", "-r", "-d", directory, str(network))
        master = Path(directory, "master.dcf").read_text()
    print("lely", master.count("COB-ID used by RPDO"), master.count("COB-ID used by TPDO"))


def of_eds_utils(path):
    sheet, errors = read_eds(path)
    assert not errors, errors
    print("eds-utils", len(sheet.indexes))


if __name__ == "__main__":
    of_canopen(sys.argv[1], int(sys.argv[2]))
    of_lely(sys.argv[1], int(sys.argv[2]))
    of_eds_utils(sys.argv[1])
