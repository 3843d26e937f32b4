// Reads logs with the official package @mcap/core, once from start to end with all checksums, and once by their indexes.
const fs = require("fs");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");

async function read(path) {
  const data = fs.readFileSync(path);
  const stream = new McapStreamReader({ validateCrcs: true });
  stream.append(data);
  const kinds = {};
  let newest = 0n;
  for (let record; (record = stream.nextRecord()); ) {
    kinds[record.type] = (kinds[record.type] ?? 0) + 1;
    if (record.type === "Message") {
      JSON.parse(new TextDecoder().decode(record.data));
      if (record.logTime < newest) throw new Error(`${path}: ${record.logTime} is less than ${newest}`);
      newest = record.logTime;
    }
  }
  if (!stream.done() || !kinds.Metadata) throw new Error(`${path}: it has no end or no metadata`);
  // The log of a killed program has no index.
  if (kinds.Statistics) {
    const readable = { size: async () => BigInt(data.length), read: async (at, size) => data.subarray(Number(at), Number(at + size)) };
    const reader = await McapIndexedReader.Initialize({ readable });
    let count = 0;
    for await (const _ of reader.readMessages()) count += 1;
    if (count !== kinds.Message) throw new Error(`${path}: ${count} messages by the index of ${kinds.Message}`);
  }
  console.log(`${path}: ${kinds.Message} messages, ${kinds.Attachment ?? 0} attachments`);
}

(async () => {
  for (const path of process.argv.slice(2)) await read(path);
})().catch((error) => {
  console.error(error.message);
  process.exit(1);
});
