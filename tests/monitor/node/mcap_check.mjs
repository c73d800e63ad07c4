// node mcap_check.mjs RUN_DIR
// Reads ticks.mcap with MCAP's reference library, through the index and as a stream, and decodes every message with an
// independent ros2msg parser and CDR reader. Then cuts the file and reads what is left.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { McapIndexedReader, McapStreamReader } from '@mcap/core';
import { loadDecompressHandlers } from '@mcap/support';
import { parse } from '@foxglove/rosmsg';
import { MessageReader } from '@foxglove/rosmsg2-serialization';

const file = readFileSync(process.argv[2] + '/ticks.mcap');
const metrics = JSON.parse(readFileSync(process.argv[2] + '/metrics.json', 'utf8'));
const decompressHandlers = await loadDecompressHandlers();

function bytesReadable(bytes) {
  return {
    size: async () => BigInt(bytes.length),
    read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
  };
}

function decoderOf(schema) {
  assert.equal(schema.encoding, 'ros2msg');
  return new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true }));
}

const reader = await McapIndexedReader.Initialize({ readable: bytesReadable(file), decompressHandlers });
assert.equal(reader.header.profile, 'ros2');
const decoders = new Map();
for (const channel of reader.channelsById.values()) {
  assert.equal(channel.messageEncoding, 'cdr');
  decoders.set(channel.id, { topic: channel.topic, reader: decoderOf(reader.schemasById.get(channel.schemaId)) });
}
// ROS 2's own definition (common_interfaces, sensor_msgs/msg/JointState.msg), so that viewers take it for what it is.
const jointStates = [...reader.schemasById.values()].find((schema) => schema.name === 'sensor_msgs/msg/JointState');
const [jointState, header] = parse(new TextDecoder().decode(jointStates.data), { ros2: true }).map(({ definitions }) =>
  definitions.map(({ type, name, isArray }) => `${type}${isArray ? '[]' : ''} ${name}`));
assert.deepEqual(jointState, ['std_msgs/Header header', 'string[] name', 'float64[] position', 'float64[] velocity', 'float64[] effort']);
assert.equal(header[1], 'string frame_id');

const counts = {};
let lastTick = 0n;
let transitions = 0;
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const { topic, reader: decoder } = decoders.get(message.channelId);
  const value = decoder.readMessage(message.data);
  counts[topic] = (counts[topic] ?? 0) + 1;
  if (topic === '/takt/tick') {
    assert.equal(value.tick, lastTick + 1n);
    lastTick = value.tick;
    assert.equal(value.q_estimate.length, value.joint_count);
    assert.equal(value.bus_state.length, value.bus_count);
    if (value.mode !== value.previous_mode) transitions += 1;
  } else if (topic === '/joint_states') {
    assert.equal(value.name.length, value.position.length);
    assert.ok(value.position.every(Number.isFinite));
  } else if (topic === '/takt/command') {
    assert.equal(value.byte_count, 88 + 4 * value.values.length + value.rest.length);
  }
}
assert.equal(counts['/takt/tick'], metrics.ticks.recorded);
assert.equal(Number(reader.statistics.messageCount), Object.values(counts).reduce((a, b) => a + b, 0));
assert.equal(transitions, metrics.transition_count);
assert.equal(counts['/takt/transition'], metrics.transition_count);
for (const topic of ['/takt/command', '/takt/keyframe', '/joint_states']) assert.ok(counts[topic] > 0, topic);

// What a stream reader gets out of the first `length` bytes.
function ticksWithin(length) {
  const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  stream.append(new Uint8Array(file.subarray(0, length)));
  const topics = new Map();
  let ticks = 0;
  for (let record = stream.nextRecord(); record; record = stream.nextRecord()) {
    if (record.type === 'Channel') topics.set(record.id, record.topic);
    if (record.type === 'Message' && topics.get(record.channelId) === '/takt/tick') ticks += 1;
  }
  return ticks;
}
assert.equal(ticksWithin(file.length), metrics.ticks.recorded);
for (const chunk of reader.chunkIndexes) {
  const end = Number(chunk.chunkStartOffset + chunk.chunkLength);
  const before = reader.chunkIndexes.filter((c) => c.chunkStartOffset < chunk.chunkStartOffset).length;
  const whole = ticksWithin(end);
  assert.ok(whole > 0 && ticksWithin(end - 1) < whole, `chunk ${before}: there when whole, gone when cut`);
}
const half = ticksWithin(Math.floor(file.length / 2));
assert.ok(half > 0 && half < metrics.ticks.recorded);
console.log(`${JSON.stringify(counts)}; the first half of the file gives back ${half} ticks`);
