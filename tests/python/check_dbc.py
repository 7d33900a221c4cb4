"""Reads a CAN database with cantools and prints the parsed content."""

import sys

import cantools

database = cantools.database.load_file(sys.argv[1], strict=True)
print("nodes", *sorted(node.name for node in database.nodes))
for message in sorted(database.messages, key=lambda message: message.frame_id):
    signals = " ".join(f"{signal.name}@{signal.start}:{signal.length}" for signal in message.signals)
    receivers = ",".join(sorted(set(message.receivers)))
    print(f"{message.frame_id:03X} {message.name} {message.length} {','.join(message.senders)}>{receivers} {signals}")
word = database.get_message_by_name("panel_TX_PDO1").get_signal_by_name("word_2")
print("comment", word.comment)
data = bytes.fromhex("0100341200000080")
print("decoded", *database.decode_message(0x1A0, data).values())
