"""Reads a bag with our own reader, and prints what the foreign ones print.

python tests/graph/foreign/ours.py results/actuator_fault/bag
"""

import sys

from bringup.bags.reader import loop_messages, read_raw
from bringup.ros.cdr import columns
from bringup.topics import BY_NAME

raw = read_raw(sys.argv[1])
command = BY_NAME["controller/command"]
speeds = columns(command, loop_messages(raw, command))[0]
messages = sum(map(len, raw.messages.values()))
print(f"{messages} messages, {len(speeds)} commands, mean compressor speed {speeds.mean():.9f} rad/s")
