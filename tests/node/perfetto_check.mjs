// SPDX-License-Identifier: Apache-2.0
// node perfetto_check.mjs FILE [ARROWS]
// Reads Trace Event JSON by the format's own rules: instants never run backwards, begins and ends match and nest on their
// track, every track has a name, every arrow starts once, ends once, and each of its steps lies inside a span. FILE of the
// constructed trace has two arrows: of four commands one began before the trace, one has no publication.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';

const { traceEvents: events, displayTimeUnit } = JSON.parse(readFileSync(process.argv[2], 'utf8'));
const expectedArrows = Number(process.argv[3] ?? 2);
assert.equal(displayTimeUnit, 'ns');
const open = new Map(); // track -> names of spans that began
const names = { process_name: new Map(), thread_name: new Map() };
const arrows = new Map(); // id -> steps
const tracks = new Set();
const spans = {};
let last = -Infinity;
for (const event of events) {
  assert.ok(Number.isInteger(event.pid) && Number.isInteger(event.tid), JSON.stringify(event));
  const track = `${event.pid}/${event.tid}`;
  if (event.ph === 'M') {
    names[event.name].set(event.name === 'process_name' ? event.pid : track, event.args.name);
    continue;
  }
  assert.ok(event.ts >= last, `${event.ts} after ${last}`);
  last = event.ts;
  tracks.add(track);
  const stack = open.get(track) ?? [];
  open.set(track, stack);
  if (event.ph === 'B') {
    stack.push(event.name);
    spans[event.name] = (spans[event.name] ?? 0) + 1;
  } else if (event.ph === 'E') {
    assert.equal(stack.pop(), event.name);
  } else if ('stf'.includes(event.ph)) {
    assert.ok(stack.length > 0, `step ${event.ph} of arrow ${event.id} outside of a span`);
    const steps = arrows.get(event.id) ?? [];
    arrows.set(event.id, [...steps, { phase: event.ph, pid: event.pid, inside: stack.at(-1) }]);
  } else {
    assert.ok(event.ph === 'C' || event.ph === 'i', event.ph);
  }
}
for (const [track, stack] of open) assert.equal(stack.length, 0, `open spans on ${track}`);
for (const track of tracks) {
  assert.ok(names.thread_name.get(track), `track ${track} has no name`);
  assert.ok(names.process_name.get(Number(track.split('/')[0])), `process of ${track} has no name`);
}
for (const [id, steps] of arrows) {
  assert.equal(steps.map((step) => step.phase).join(''), 'sttf', `arrow ${id}`);
  assert.equal(steps.map((step) => step.inside).join(' '), 'tick infer publish tick', `arrow ${id}`);
  assert.notEqual(steps[0].pid, steps[1].pid, 'an arrow crosses processes');
}
assert.equal(arrows.size, expectedArrows);
assert.ok(spans.tick > 0 && spans.infer > 0 && spans.publish > 0, JSON.stringify(spans));
assert.ok(events.some((event) => event.ph === 'i' && event.name === 'tracking -> degraded'));
assert.ok(events.some((event) => event.ph === 'C'));
console.log(`${events.length} events, ${arrows.size} arrows, spans ${JSON.stringify(spans)}`);
