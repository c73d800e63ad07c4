// SPDX-License-Identifier: Apache-2.0
// node otlp_check.mjs FOLDER
// Reads otlp_traces.jsonl, otlp_metrics.jsonl and otlp_logs.jsonl by OpenTelemetry's own protobuf definitions: every line must be a whole
// export request in which nothing is unknown to them, and must survive the way through the wire format.
import assert from 'node:assert/strict';
import { createRequire } from 'node:module';
import { readFileSync } from 'node:fs';

const root = createRequire(import.meta.url)('@opentelemetry/otlp-transformer/build/src/generated/root');
const { trace, metrics, logs } = root.opentelemetry.proto.collector;

// OTLP's JSON writes ids in hex where protobuf's own JSON has base64.
function withBinaryIds(value) {
  if (Array.isArray(value)) return value.map(withBinaryIds);
  if (value === null || typeof value !== 'object') return value;
  return Object.fromEntries(Object.entries(value).map(([key, inner]) =>
    [key, /^(traceId|spanId|parentSpanId)$/.test(key) ? Buffer.from(inner, 'hex').toString('base64') : withBinaryIds(inner)]));
}

// What is left of a request must be what was written: a field that the definitions lack would be dropped.
function assertSame(read, written, path) {
  for (const [key, value] of Object.entries(written)) {
    assert.ok(key in read, `${path}.${key} is unknown to OTLP`);
    if (value !== null && typeof value === 'object') assertSame(read[key], value, `${path}.${key}`);
    else assert.equal(String(read[key]), String(value), `${path}.${key}`);
  }
}

function check(file, type) {
  const lines = readFileSync(`${process.argv[2]}/${file}`, 'utf8').split('\n').filter(Boolean);
  for (const line of lines) {
    const written = withBinaryIds(JSON.parse(line));
    const message = type.fromObject(written);
    assert.equal(type.verify(message), null);
    const read = type.toObject(type.decode(type.encode(message).finish()),
      { longs: String, bytes: String, defaults: true });
    assertSame(read, written, file);
  }
  return lines.length;
}

const traces = check('otlp_traces.jsonl', trace.v1.ExportTraceServiceRequest);
const points = check('otlp_metrics.jsonl', metrics.v1.ExportMetricsServiceRequest);
assert.ok(traces > 0 && points > 0);
check('otlp_logs.jsonl', logs.v1.ExportLogsServiceRequest); // none where nothing stopped
console.log(`${traces} trace requests, ${points} metric requests`);
