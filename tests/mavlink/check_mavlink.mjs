// Our MAVLink against node-mavlink, both ways: its parser reads each message that ours writes, with checksum and every
// field; ours reads what its serializer writes, signed messages, too. Usage: check_mavlink.mjs MAVLINK_EXCHANGE
import assert from "node:assert";
import { execFileSync } from "node:child_process";
import { createRequire } from "node:module";
import { PassThrough } from "node:stream";

const require = createRequire(import.meta.url);
const mavlink = require("node-mavlink");
const { common, minimal, createMavLinkStream, MavLinkProtocolV2, MavLinkPacketSignature } = mavlink;

const exchange = process.argv[2];
const registry = { ...minimal.REGISTRY, ...common.REGISTRY };

/** Lines of our program, as objects. */
function ours(word, input) {
  const text = execFileSync(exchange, [word], { input, encoding: "utf8", maxBuffer: 1 << 28 });
  return text.trim().split("\n").map((line) => JSON.parse(line));
}

/** All fields in the order of the wire, 64-bit numbers as text. */
function fieldsOf(Message, message) {
  return Message.FIELDS.flatMap((field) => {
    const value = message[field.name];
    return Array.isArray(value) ? value : [typeof value === "bigint" ? value.toString() : value];
  });
}

/** What node-mavlink finds in the bytes; it throws packets with a wrong checksum away. */
async function parse(bytes) {
  const stream = new PassThrough();
  const packets = [];
  const reader = createMavLinkStream(stream);
  reader.on("data", (packet) => packets.push(packet));
  stream.end(bytes);
  await new Promise((done) => reader.on("end", done));
  return packets;
}

const written = ours("write", "");
assert.equal(new Set(written.map((line) => line.number)).size, 8);
const packets = await parse(Buffer.concat(written.map((line) => Buffer.from(line.bytes, "hex"))));
assert.equal(packets.length, written.length, "packets with a right checksum");
packets.forEach((packet, i) => {
  const line = written[i];
  const { msgid, seq, sysid, compid } = packet.header;
  assert.deepEqual([msgid, seq, sysid, compid], [line.number, line.sequence, line.system, line.component]);
  const Message = registry[msgid];
  assert.deepEqual(fieldsOf(Message, packet.protocol.data(packet.payload, Message)), line.fields, `message ${i}`);
});

// Back: the same messages, written by node-mavlink, every other one signed.
const key = MavLinkPacketSignature.key("secret");
const frames = packets.map((packet, i) => {
  const Message = registry[packet.header.msgid];
  const message = packet.protocol.data(packet.payload, Message);
  const protocol = new MavLinkProtocolV2(
    packet.header.sysid, packet.header.compid, i % 2 ? MavLinkProtocolV2.IFLAG_SIGNED : 0);
  const bytes = protocol.serialize(message, packet.header.seq);
  return i % 2 ? protocol.sign(bytes, 1, key) : bytes;
});
const read = ours("read", frames.map((bytes) => bytes.toString("hex")).join("\n") + "\n");
assert.equal(read.length, written.length, "frames that we read");
// Of a message of zeros node-mavlink sends no byte at all.
read.forEach((line, i) => assert.deepEqual({ ...line, bytes: "" }, { ...written[i], bytes: "" }, `frame ${i}`));
console.log(`${written.length} messages there and back`);
