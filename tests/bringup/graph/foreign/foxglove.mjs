// Reads a bag with the libraries that Foxglove itself is made of, and prints what it has found.
//
//   npm install @mcap/core @mcap/nodejs @mcap/support @foxglove/rosmsg @foxglove/rosmsg2-serialization
//   node foxglove.mjs results/actuator_fault/bag/bag_0.mcap
//
// (Run it in the folder into which npm has installed them.) ours.py prints the same line from our own reader.
import { McapIndexedReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers } from "@mcap/support";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { open } from "fs/promises";

const readable = new FileHandleReadable(await open(process.argv[2], "r"));
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
const decoders = new Map();
let messages = 0, commands = 0, sum = 0;
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  if (!decoders.has(channel.id)) {
    const schema = reader.schemasById.get(channel.schemaId);
    decoders.set(channel.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  }
  const content = decoders.get(channel.id).readMessage(message.data);
  messages += 1;
  if (channel.topic === "/ac/controller/command") {
    commands += 1;
    sum += content.velocity[0];
  }
}
console.log(`${messages} messages, ${commands} commands, mean compressor speed ${(sum / commands).toFixed(9)} rad/s`);
