"""Decodes every frame of a candump log with a CAN database and prints how often each message occurs.

Usage: check_dbc_trace.py DATABASE LOG
"""

import collections
import sys

import cantools


def main(database, log):
    database = cantools.database.load_file(database, strict=True)
    counts = collections.Counter()
    for line in open(log):
        identifier, _, data = line.split()[2].partition("#")
        # A frame with an unknown identifier ends the program.
        message = database.get_message_by_frame_id(int(identifier, 16))
        assert message.is_extended_frame == (len(identifier) == 8), line
        if not data.startswith("R"):
            # CANsync jobs end with their last used byte.
            message.decode(bytes.fromhex(data), allow_truncated=True)
        counts[message.name] += 1
    for name, count in sorted(counts.items()):
        print(name, count)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
