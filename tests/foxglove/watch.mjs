// A viewer made of Foxglove's own client: connects, subscribes to what is wanted, decodes every message by the definition
// that the channel brings, and prints what it saw as JSON. Bytes (images, models, points) are printed as their hash.
//
//     node watch.mjs URL PROTOCOL WISH
//
// WISH: {topics: [..] (none: all), set: [parameters to set once all is subscribed], counts: {topic: messages to wait for}
// (none: until the server says goodbye), save: folder for the bytes of each topic's last image}
import { createHash } from "node:crypto";
import { writeFileSync } from "node:fs";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import protocols from "@foxglove/ws-protocol"; // a CommonJS module
import WebSocket from "ws";

const [url, protocol, wishText] = process.argv.slice(2);
const wish = JSON.parse(wishText);
const seen = { protocol: "", info: null, channels: {}, messages: {}, times: [], statuses: [], parameters: null, clocks: 0 };
const channels = new Map(); // by id
const topics = new Map(); // by subscription id
const decoders = new Map();
const socket = new WebSocket(url, [protocol]);
const client = new protocols.FoxgloveClient({ ws: socket });

const plain = (key, value) => {
  if (typeof value === "bigint") return Number(value);
  if (value instanceof Uint8Array)
    return { sha256: createHash("sha256").update(value).digest("hex"), bytes: value.length };
  return ArrayBuffer.isView(value) ? Array.from(value) : value;
};

function print() {
  process.stdout.write(JSON.stringify(seen, plain), () => process.exit(0));
}

function decoder(channel) {
  if (channel.encoding === "json") return (data) => JSON.parse(new TextDecoder().decode(data));
  if (channel.encoding !== "cdr" || channel.schemaEncoding !== "ros2msg") throw new Error(`unknown encoding of ${channel.topic}`);
  const reader = new MessageReader(parse(channel.schema, { ros2: true }));
  return (data) => reader.readMessage(data);
}

function isEnough() {
  return wish.counts && Object.entries(wish.counts).every(([topic, count]) => (seen.messages[topic] ?? []).length >= count);
}

client.on("serverInfo", (info) => (seen.info = info));
client.on("status", (status) => seen.statuses.push(status));
client.on("time", () => (seen.clocks += 1));
client.on("parameterValues", ({ parameters }) => (seen.parameters = parameters));
client.on("error", (error) => {
  console.error(String(error.message ?? error));
  process.exit(1);
});
client.on("open", () => (seen.protocol = socket.protocol));
client.on("close", print);
client.on("advertise", (added) => {
  for (const channel of added) {
    seen.channels[channel.topic] = { encoding: channel.encoding, schema: channel.schemaName };
    channels.set(channel.id, channel);
    decoders.set(channel.topic, decoder(channel));
    if (wish.topics && !wish.topics.includes(channel.topic)) continue;
    topics.set(client.subscribe(channel.id), channel.topic);
  }
  if (wish.set && topics.size > 0) client.setParameters(wish.set, "set");
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const topic = topics.get(subscriptionId);
  const value = decoders.get(topic)(data);
  (seen.messages[topic] ??= []).push({ time: Number(timestamp), value: JSON.parse(JSON.stringify(value, plain)) });
  if (wish.save && value.data instanceof Uint8Array && value.format) {
    writeFileSync(`${wish.save}/${topic.replaceAll("/", "_")}.${value.format}`, value.data);
  }
  if (isEnough()) client.close();
});
setTimeout(() => {
  console.error(`gave up; seen ${Object.entries(seen.messages).map(([topic, all]) => `${topic}: ${all.length}`)}`);
  process.exit(1);
}, 60000).unref();
