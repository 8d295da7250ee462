// Reads an MCAP file twice with the reference reader, by its index and as a stream with every checksum, decodes each
// message by the definition that the file brings along, and prints what there was as JSON.
import { readFileSync } from "node:fs";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const bytes = readFileSync(process.argv[2]);

const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, size) => bytes.subarray(Number(offset), Number(offset + size)),
};
const indexed = await McapIndexedReader.Initialize({ readable });
const decoders = new Map();
const topics = {};
let previous = 0n;
for await (const message of indexed.readMessages()) {
  if (message.logTime < previous) throw new Error("messages are not in the order of their times");
  previous = message.logTime;
  const channel = indexed.channelsById.get(message.channelId);
  const schema = indexed.schemasById.get(channel.schemaId);
  if (!decoders.has(schema.id)) {
    decoders.set(schema.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  }
  const value = decoders.get(schema.id).readMessage(message.data);
  topics[channel.topic] ??= { schema: schema.name, count: 0, first: value };
  topics[channel.topic].count += 1;
}

const stream = new McapStreamReader({ validateCrcs: true });
stream.append(bytes);
let records = 0;
while (stream.nextRecord()) records += 1;
if (!stream.done()) throw new Error("the stream does not end");

const plain = (key, value) =>
  typeof value === "bigint" ? Number(value) : ArrayBuffer.isView(value) ? Array.from(value) : value;
console.log(
  JSON.stringify(
    { profile: indexed.header.profile, messages: indexed.statistics.messageCount, chunks: indexed.chunkIndexes.length, records, topics },
    plain,
  ),
);
