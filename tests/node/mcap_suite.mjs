// SPDX-License-Identifier: Apache-2.0
// node mcap_suite.mjs SUITE_DIR OUT_DIR
// Writes the files of MCAP's conformance suite from their descriptions, by MCAP's reference library; each is the file whose SHA-256 the suite gives.
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import { readFileSync, readdirSync, writeFileSync } from 'node:fs';
import { McapRecordBuilder } from '@mcap/core';
import { crc32 } from '@foxglove/crc';

const [suite, out] = process.argv.slice(2);
const WIDE = new Set(['log_time', 'publish_time', 'create_time', 'message_start_time', 'message_end_time', 'chunk_start_offset', 'chunk_length', 'message_index_length',
  'compressed_size', 'uncompressed_size', 'offset', 'length', 'data_size', 'group_start', 'group_length', 'message_count', 'summary_start',
  'summary_offset_start']);  // 64 bits
const TEXT = new Set(['library', 'profile', 'encoding', 'name', 'topic', 'message_encoding', 'media_type', 'compression']);
const MAPS = { metadata: (map) => new Map(Object.entries(map)), message_index_offsets: wideByNumber, channel_message_counts: wideByNumber };

function wideByNumber(map) {
  return new Map(Object.entries(map).map(([key, value]) => [Number(key), BigInt(value)]));
}

function valueOf(key, value) {
  if (key in MAPS) return MAPS[key](value);
  if (key === 'data') return Uint8Array.from(value, Number);
  if (TEXT.has(key)) return value;
  return WIDE.has(key) ? BigInt(value) : Number(value);
}

// As the library names its fields.
function fieldsOf({ fields }) {
  return Object.fromEntries(fields.map(([key, value]) => [key.replace(/_(.)/g, (_, letter) => letter.toUpperCase()),
    valueOf(key, value)]));
}

function build({ records, meta }) {
  const has = (feature) => meta.variant.features.includes(feature);
  const builder = new McapRecordBuilder({ padRecords: has('pad') });
  const chunk = has('ch') ? new McapRecordBuilder() : undefined;
  const indices = new Map();  // by channel: when and where each message of the chunk is
  const endChunk = () => {
    const times = [...indices.values()].flat().map(([time]) => Number(time));
    if (!times.length) return;
    builder.writeChunk({ messageStartTime: BigInt(Math.min(...times)), messageEndTime: BigInt(Math.max(...times)), uncompressedSize: BigInt(chunk.length),
      uncompressedCrc: crc32(chunk.buffer), compression: '', records: chunk.buffer });
    if (has('mx')) for (const [channelId, entries] of indices) builder.writeMessageIndex({ channelId, records: entries });
  };
  const write = (into, { type }, fields) => into[`write${type}`](fields);
  builder.writeMagic();
  let inData = true;
  for (const record of records) {
    const fields = fieldsOf(record);
    if (record.type === 'DataEnd') {
      if (chunk) endChunk();
      inData = false;
    }
    const inChunk = inData && chunk && ['Schema', 'Channel', 'Message'].includes(record.type);
    if (inChunk && record.type === 'Message')
      indices.set(fields.channelId, [...(indices.get(fields.channelId) ?? []), [fields.logTime, BigInt(chunk.length)]]);
    write(inChunk ? chunk : builder, record, fields);
  }
  builder.writeMagic();
  return builder.buffer;
}

let written = 0;
for (const name of readdirSync(suite).filter((file) => file.endsWith('.json')).map((file) => file.slice(0, -5))) {
  const file = build(JSON.parse(readFileSync(`${suite}/${name}.json`, 'utf8')));
  assert.equal(createHash('sha256').update(file).digest('hex'), readFileSync(`${suite}/${name}.sha256`, 'utf8').trim(), name);
  writeFileSync(`${out}/${name}.mcap`, file);
  ++written;
}
console.log(written);
