// SPDX-License-Identifier: Apache-2.0
// node mcap_check.mjs RUN_DIR
// Reads ticks.mcap with MCAP's reference library, through the index and as a stream, and decodes every message with an
// independent ros2msg parser and CDR reader. Then cuts the file and reads what is left.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { inflateSync } from 'node:zlib';
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
// ROS 2's own definitions (common_interfaces, rcl_interfaces), so that viewers take the messages for what they are.
const stamp = ['builtin_interfaces/Time', ['int32 sec', 'uint32 nanosec']];
const header = ['std_msgs/Header', ['time stamp', 'string frame_id']];
const standard = {
  'sensor_msgs/msg/JointState': [[undefined, ['std_msgs/Header header', 'string[] name', 'float64[] position', 'float64[] velocity', 'float64[] effort']],
    header, stamp],
  'diagnostic_msgs/msg/DiagnosticArray': [[undefined, ['std_msgs/Header header', 'diagnostic_msgs/DiagnosticStatus[] status']], header, stamp,
    ['diagnostic_msgs/DiagnosticStatus', ['uint8 OK=0', 'uint8 WARN=1', 'uint8 ERROR=2', 'uint8 STALE=3', 'uint8 level', 'string name', 'string message',
      'string hardware_id', 'diagnostic_msgs/KeyValue[] values']],
    ['diagnostic_msgs/KeyValue', ['string key', 'string value']]],
  'rcl_interfaces/msg/Log': [[undefined, ['uint8 DEBUG=10', 'uint8 INFO=20', 'uint8 WARN=30', 'uint8 ERROR=40', 'uint8 FATAL=50',
    'time stamp', 'uint8 level', 'string name', 'string msg', 'string file', 'string function', 'uint32 line']], stamp],
  'std_msgs/msg/String': [[undefined, ['string data']]],
  'tf2_msgs/msg/TFMessage': [[undefined, ['geometry_msgs/TransformStamped[] transforms']],
    ['geometry_msgs/TransformStamped', ['std_msgs/Header header', 'string child_frame_id', 'geometry_msgs/Transform transform']], header, stamp,
    ['geometry_msgs/Transform', ['geometry_msgs/Vector3 translation', 'geometry_msgs/Quaternion rotation']],
    ['geometry_msgs/Vector3', ['float64 x', 'float64 y', 'float64 z']], ['geometry_msgs/Quaternion', ['float64 x', 'float64 y', 'float64 z', 'float64 w']]],
};
for (const [wanted, definition] of Object.entries(standard)) {
  const schema = [...reader.schemasById.values()].find(({ name }) => name === wanted);
  const found = parse(new TextDecoder().decode(schema.data), { ros2: true }).map(({ name, definitions }) => [name,
    definitions.map(({ type, name, isArray, isConstant, value }) => `${type}${isArray ? '[]' : ''} ${name}${isConstant ? `=${value}` : ''}`)]);
  assert.deepEqual(found, definition, wanted);
}
// Where the rigid-body library saw the tool at the recorded angles, by the tick's stamp.
const offset = BigInt(JSON.parse(readFileSync(process.argv[2] + '/manifest.json', 'utf8')).clock.monotonic_to_unix_ns);
const toolAt = new Map(readFileSync(process.argv[2] + '/truth.jsonl', 'utf8').trimEnd().split('\n').map((line) => JSON.parse(line))
  .map(({ monotonic_ns, tool }) => [BigInt(monotonic_ns) + offset, tool]));

const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];
function turned({ x, y, z, w }, vector) {
  const twice = cross([x, y, z], vector).map((each) => 2 * each);
  const again = cross([x, y, z], twice);
  return vector.map((each, axis) => each + w * twice[axis] + again[axis]);
}

// A point of the base frame in the frame of the last link, as a viewer goes down the chain of transforms.
function inLastFrame(transforms, point) {
  transforms.forEach(({ header, child_frame_id, transform: { translation: t, rotation: r } }, index) => {
    assert.equal(header.frame_id, index ? transforms[index - 1].child_frame_id : 'base');
    assert.ok(Math.abs(Math.hypot(r.x, r.y, r.z, r.w) - 1) < 1e-9, `${child_frame_id}: a unit quaternion`);
    point = turned({ x: -r.x, y: -r.y, z: -r.z, w: r.w }, [point[0] - t.x, point[1] - t.y, point[2] - t.z]);
  });
  return point;
}
const toolsInLastFrame = [];
let urdf;

const nanoseconds = ({ sec, nanosec }) => BigInt(sec) * 1_000_000_000n + BigInt(nanosec);

const counts = {};
let lastTick = 0n;
let transitions = 0;
let newest;  // tick
let toldAt = 0n;  // ns, of the last diagnostics that were due
const log = [];
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
    newest = { ...value, log_time: message.logTime };
  } else if (topic === '/joint_states') {
    assert.equal(value.name.length, value.position.length);
    assert.ok(value.position.every(Number.isFinite));
  } else if (topic === '/robot_description') {
    assert.equal(newest, undefined, 'before every tick');
    urdf = value.data;
  } else if (topic === '/tf') {
    const { joint_count: joints, log_time } = newest;
    assert.equal(value.transforms.length, joints);
    for (const { header } of value.transforms) assert.equal(nanoseconds(header.stamp), message.logTime);
    assert.equal(message.logTime, log_time, 'stamped as its tick');
    toolsInLastFrame.push(inLastFrame(value.transforms, toolAt.get(message.logTime)));
    if (counts[topic] > 1) continue;
    const links = [...urdf.matchAll(/<link name="(.*?)">/g)].map(([, name]) => name);
    assert.deepEqual(links, ['base', ...value.transforms.map(({ child_frame_id }) => child_frame_id)]);
  } else if (topic === '/diagnostics') {
    const [executive, ...others] = value.status;
    const values = Object.fromEntries(executive.values.map((each) => [each.key, each.value]));
    assert.equal(nanoseconds(value.header.stamp), message.logTime);
    assert.equal(message.logTime, newest.log_time, 'stamped as its tick');
    assert.equal(values.mode, ['standby', 'arming', 'tracking', 'degraded', 'damped_stop', 'fault_latched'][newest.mode]);
    assert.deepEqual([values['window misses'], values['window ticks']], [`${newest.window_misses}`, `${newest.window_ticks}`]);
    assert.equal(executive.level, newest.mode < 3 ? 0 : newest.mode < 5 ? 1 : 2);
    assert.equal(others.length, newest.joint_count + newest.bus_count, 'a part for every drive and bus');
    for (const part of value.status) assert.equal(part.hardware_id, metrics.robot);
    const isDue = message.logTime >= toldAt + 1_000_000_000n;
    assert.ok(isDue || newest.mode !== newest.previous_mode, 'once a second, and when the mode changes');
    if (isDue) toldAt = message.logTime;
  } else if (topic === '/rosout') {
    assert.equal(nanoseconds(value.stamp), message.logTime);
    log.push([Number(newest.tick), value.level, value.name, value.msg]);
  } else if (topic === '/takt/command') {
    assert.equal(value.byte_count, 88 + 4 * value.values.length + value.rest.length);
  }
}
assert.equal(counts['/takt/tick'], metrics.ticks.recorded);
assert.equal(Number(reader.statistics.messageCount), Object.values(counts).reduce((a, b) => a + b, 0));
assert.equal(transitions, metrics.transition_count);
assert.equal(counts['/takt/transition'], metrics.transition_count);
assert.ok(counts['/diagnostics'] >= metrics.transition_count + 3 && counts['/diagnostics'] <= metrics.transition_count + 5);
const level = { degraded: 30, damped_stop: 30, fault_latched: 40 };
const told = metrics.transitions.map(({ tick, from, to, cause }) => [tick, level[to] ?? 20, metrics.robot, `${from} -> ${to}: ${cause}`])
  .concat(metrics.marks.map(({ tick }) => [tick, 20, metrics.robot, 'marked']));
told.sort(([a], [b]) => a - b);
assert.deepEqual(log.map((line) => line.slice(0, 3)), told.map((line) => line.slice(0, 3)), 'a log line for every transition and every mark');
// Stops and faults say why after the arrow: the incident's sentence.
log.forEach((line, i) => assert.ok(line[3].startsWith(told[i][3].replace(/: .*/, '')) && line[3].includes(told[i][3].replace(/.*: /, '')), line[3]));
assert.equal(counts['/robot_description'], 1);
assert.equal(counts['/tf'], metrics.ticks.recorded / 40, '25 Hz');
// The tool is a part of the last link: in its frame it stays where it is. truth.jsonl has micrometres.
for (const axis of [0, 1, 2]) {
  const along = toolsInLastFrame.map((tool) => tool[axis]);
  assert.ok(Math.max(...along) - Math.min(...along) < 3e-6, `the tool moves in the last link's frame: ${along}`);
}
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

// What cameras showed the policy, as viewers take it: the standard message, a whole PNG in it.
const seen = process.argv[2] + '/viewed';
const withPictures = await McapIndexedReader.Initialize({ readable: bytesReadable(readFileSync(seen + '/ticks.mcap')), decompressHandlers });
const began = BigInt(JSON.parse(readFileSync(seen + '/manifest.json', 'utf8')).started.monotonic_ns) + offset;
assert.deepEqual([...withPictures.channelsById.values()].map(({ topic }) => topic).filter((topic) => topic.endsWith('/compressed')),
  ['/right/compressed', '/left/compressed']);

// The pixels of a PNG of 8 bits a channel, RGB, whose rows are differences of neighbours.
function pixelsOf(png) {
  assert.deepEqual([...png.subarray(0, 8)], [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);
  const view = new DataView(png.buffer, png.byteOffset, png.length);
  const packed = [];
  let width, height;
  for (let at = 8; at < png.length; at += 12 + view.getUint32(at)) {
    const kind = new TextDecoder().decode(png.subarray(at + 4, at + 8));
    if (kind === 'IHDR') [width, height] = [view.getUint32(at + 8), view.getUint32(at + 12)];
    if (kind === 'IHDR') assert.deepEqual([...png.subarray(at + 16, at + 21)], [8, 2, 0, 0, 0]);
    if (kind === 'IDAT') packed.push(png.subarray(at + 8, at + 8 + view.getUint32(at)));
  }
  const rows = inflateSync(Buffer.concat(packed));
  assert.equal(rows.length, height * (1 + 3 * width));
  return Array.from({ length: height }, (_, row) => {
    const line = rows.subarray(row * (1 + 3 * width), (row + 1) * (1 + 3 * width));
    assert.equal(line[0], 1);
    const values = [];
    line.subarray(1).forEach((each, at) => values.push((each + (at < 3 ? 0 : values[at - 3])) & 255));
    return values;
  });
}
let pictures = 0;
for await (const message of withPictures.readMessages({ topics: ['/left/compressed'], validateCrcs: true })) {
  const schema = withPictures.schemasById.get(withPictures.channelsById.get(message.channelId).schemaId);
  assert.equal(schema.name, 'sensor_msgs/msg/CompressedImage');
  const [definition] = parse(new TextDecoder().decode(schema.data), { ros2: true });
  assert.deepEqual(definition.definitions.map(({ type, name, isArray }) => `${type}${isArray ? '[]' : ''} ${name}`),
    ['std_msgs/Header header', 'string format', 'uint8[] data']);
  const value = decoderOf(schema).readMessage(message.data);
  assert.equal(value.header.frame_id, 'left');
  assert.equal(nanoseconds(value.header.stamp), began + BigInt(pictures) * 1_000_000_000n);
  assert.equal(value.format, 'png');
  pixelsOf(value.data).forEach((values, row) => assert.deepEqual(values,
    Array.from({ length: 3 * 32 }, (_, at) => [Math.floor(at / 3), row, pictures][at % 3])));
  pictures += 1;
}
assert.equal(pictures, 3);
console.log(`${JSON.stringify(counts)}; the first half of the file gives back ${half} ticks`);
