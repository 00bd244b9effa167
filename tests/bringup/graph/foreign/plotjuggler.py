"""Reads a bag with PlotJuggler's own parser (rosx_introspection), and prints what it has found.

uv run --no-project --with mcap-bag-parser --with mcap --with msgpack plotjuggler.py BAG.mcap
"""

import sys

import msgpack
from mcap.reader import make_reader
from rosx_introspection import Parser

parsers = {}
messages, speeds = 0, []
with open(sys.argv[1], "rb") as stream:  # noqa: PTH123
    for schema, channel, message in make_reader(stream).iter_messages():
        if channel.topic not in parsers:
            parsers[channel.topic] = Parser(channel.topic, schema.name, schema.data.decode())
        content = msgpack.unpackb(parsers[channel.topic].parse_to_msgpack(message.data))
        messages += 1
        if channel.topic == "/ac/controller/command":
            speeds.append(next(value for key, value in content.items() if key.endswith("velocity[0]")))
print(f"{messages} messages, {len(speeds)} commands, mean compressor speed {sum(speeds) / len(speeds):.9f} rad/s")
