"""Reads a bag with our own reader, and prints what the foreign ones print.

python tests/bringup/graph/foreign/ours.py results/actuator_fault/bag
"""

import sys

from ac_common.topics import BY_NAME
from ac_common.wire import columns
from ac_experiments.bags.reader import loop_messages, read_raw

raw = read_raw(sys.argv[1])
command = BY_NAME["controller/command"]
speeds = columns(command, loop_messages(raw, command))[0]
messages = sum(map(len, raw.messages.values()))
print(f"{messages} messages, {len(speeds)} commands, mean compressor speed {speeds.mean():.9f} rad/s")
