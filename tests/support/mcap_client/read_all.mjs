// read_all.mjs FILE: reads all of a recording with the public library, as a stream and by its index, decodes each
// message by its schema, and checks all checksums. Prints what it holds as JSON.
import { crc32 } from "@foxglove/crc";
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { open, readFile } from "node:fs/promises";

const file = process.argv[2];
const fail = (why) => {
  console.error(why);
  process.exit(1);
};

const bytes = await readFile(file);
const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
const stream = new McapStreamReader({ validateCrcs: true });
stream.append(bytes);
let streamed = 0;
let dataEnd, footer;
const attachments = {};
for (let record; (record = stream.nextRecord()); ) {
  if (record.type === "Message") ++streamed;
  if (record.type === "Attachment") attachments[record.name] = new TextDecoder().decode(record.data);
  if (record.type === "DataEnd") dataEnd = record;
  if (record.type === "Footer") footer = record;
}
if (!stream.done()) fail("the stream has no end");
const summary = Number(footer.summaryStart);
const dataEndBytes = 9 + 4;
if (crc32(bytes.subarray(0, summary - dataEndBytes)) !== dataEnd.dataSectionCrc) fail("wrong checksum of the data");
const footerCrcAt = bytes.byteLength - 8 - 4;
if (view.getUint32(footerCrcAt, true) === 0) fail("no checksum of the summary");
if (crc32(bytes.subarray(summary, footerCrcAt)) !== footer.summaryCrc) fail("wrong checksum of the summary");

const handle = await open(file);
const readable = {
  size: async () => BigInt((await handle.stat()).size),
  read: async (offset, length) => {
    const part = new Uint8Array(Number(length));
    await handle.read(part, 0, part.byteLength, Number(offset));
    return part;
  },
};
const reader = await McapIndexedReader.Initialize({ readable });
const decoders = new Map();
for (const channel of reader.channelsById.values()) {
  const schema = reader.schemasById.get(channel.schemaId);
  const text = new TextDecoder().decode(schema.data);
  decoders.set(channel.id, new MessageReader(schema.name, parseIDL(text)));
}
const topics = {};
let indexed = 0;
let newest = 0n;
for await (const message of reader.readMessages({ validateCrcs: true })) {
  if (message.logTime < newest) fail("the index is not in the order of time");
  newest = message.logTime;
  const channel = reader.channelsById.get(message.channelId);
  const topic = (topics[channel.topic] ??= { count: 0, gaps: 0, next: {} });
  const decoded = decoders.get(message.channelId).readMessage(message.data);
  const writer = `${decoded.program ?? 0} ${decoded.instance ?? 0}`;
  if (message.sequence !== (topic.next[writer] ?? 0)) ++topic.gaps;
  topic.next[writer] = message.sequence + 1;
  ++topic.count;
  ++indexed;
}
if (indexed !== streamed || BigInt(indexed) !== reader.statistics.messageCount)
  fail(`${streamed} messages in the stream, ${indexed} in the index, ${reader.statistics.messageCount} in the summary`);

// Each second of the recording, from its start.
const { messageStartTime: from, messageEndTime: to } = reader.statistics;
let slowest_s = 0;
for (let at = from; at < to; at += 1_000_000_000n) {
  const begin = process.hrtime.bigint();
  for await (const message of reader.readMessages({ startTime: at })) {
    if (message.logTime < at) fail("a message before the moment that was asked for");
    break;
  }
  slowest_s = Math.max(slowest_s, Number(process.hrtime.bigint() - begin) * 1e-9);
}
for (const topic of Object.values(topics)) delete topic.next;
console.log(JSON.stringify({ messages: indexed, seconds: Number(to - from) * 1e-9, slowest_s, topics, attachments }));
await handle.close();
