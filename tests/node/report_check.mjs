// SPDX-License-Identifier: Apache-2.0
// node report_check.mjs RUN_DIR [SCREENSHOT.png]
// Goal: the reviewer's page does in a real browser what docs/report.md promises. Method: opens report.html in Chromium
// without a network; holds what it drew against truth.jsonl (the tool by rigid-body dynamics) and metrics.json; drives it
// by mouse and keys. No request but the file itself and no error on the console, from first to last.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { inBrowser, ready } from './browser.mjs';

const folder = process.argv[2];
const url = pathToFileURL(resolve(folder, 'report.html')).href;
const truth = readFileSync(`${folder}/truth.jsonl`, 'utf8').trimEnd().split('\n').map((line) => JSON.parse(line));
const metrics = JSON.parse(readFileSync(`${folder}/metrics.json`, 'utf8'));
const charts = ['age', 'stages', 'modes', 'interventions', 'tracking', 'buses', 'timing'];

// Number of colours painted on the canvases inside each element.
const coloursOf = (page, ids) => page.evaluate((wanted) => wanted.map((id) => {
  const colours = new Set();
  const element = document.getElementById(id);
  for (const canvas of element.tagName === 'CANVAS' ? [element] : element.querySelectorAll('canvas')) {
    const pixels = new Uint32Array(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.buffer);
    for (const pixel of pixels) if (pixel !== 0) colours.add(pixel);
  }
  return colours.size;
}), ids);
const view = (page) => page.evaluate(() => {
  const { from, to, cursor, end, isPlaying } = takt.page.view;
  return { from, to, cursor, end, isPlaying };
});
// Times at the edges of every chart.
const axes = (page) => page.evaluate((ids) => ids.map((id) =>
  [...document.querySelectorAll(`#${id} .dygraph-axis-label-x`)].map((each) => each.textContent).join()), charts);

async function drawsEverything(page) {
  const drawn = await coloursOf(page, [...charts, 'figure']);
  drawn.forEach((colours, index) => assert.ok(colours >= 3, `${[...charts, 'figure'][index]}: ${colours} colours`));
  assert.ok((await page.textContent('#text')).includes('deadline misses'));
  assert.equal(await page.locator('.verdict').count(), 2);
  assert.match(await page.textContent('#together'), /^\d+ of \d+ commands missed, and [\d.]+ % of the time there was no usable one: /);
  assert.ok(await page.locator('#comparison tr').count() > 10, 'compared with the other run');
  return drawn;
}

// The figure's tool is where KDL sees it; the task's target is the truth file's; samples are the metrics'.
async function showsWhatWasRecorded(page) {
  const start = metrics.transitions[0].monotonic_ns - (metrics.transitions[0].tick - metrics.ticks.first) * 1e6;
  for (const entry of truth.filter((_, index) => index % 40 === 7)) {
    const scene = await page.evaluate((time) => {
      takt.page.view.setCursor(time);
      const { measured, task } = takt.page.figure.scene();
      return { tool: measured.tool, task };
    }, (entry.monotonic_ns - start) * 1e-9);
    scene.tool.forEach((value, axis) => assert.ok(Math.abs(value - entry.tool[axis]) < 1e-3, `tool at ${entry.monotonic_ns}: ${scene.tool}, not ${entry.tool}`));
    scene.task.forEach((value, axis) => assert.ok(Math.abs(value - entry.target[axis]) < 1e-3, 'task target'));
  }
  const oldest = await page.evaluate(() => {
    const { samples, facts } = takt.page;
    const stop = facts.modes.find(([, , mode]) => mode === 'damped_stop')[0];
    return Math.max(...samples.bands(0, stop - facts.period_s / 2, [['age', 'age.spread']]).map(([, band]) => band[2] ?? 0));
  });
  assert.ok(Math.abs(oldest - metrics.age_ns.per_tick.total.max * 1e-6) < 0.05, `oldest age while the policy was relied on: ${oldest} ms`);
}

// What the demo's arm does not have: tilted frames, two arms on one base, a cart with a pole. Known by hand.
async function knowsOtherRobots(page) {
  const [tilted, cart] = await page.evaluate(() => {
    const half = Math.PI / 2;
    const link = (parent, xyz, rpy, axis) => ({ parent, xyz, rpy, axis });
    const arms = { kind: 'links', tool: { link: 1, xyz: [0.5, 0, 0] }, reach: 3,
      links: [link(-1, [0, 0, 1], [0, 0, half], [0, 0, 1]), link(0, [1, 0, 0], [half, 0, 0], [0, 0, 2]), link(-1, [0, -1, 0], [0, half, 0], [0, 0, 1])] };
    return [takt.robot.pose(arms, [0, half, 0]),
      takt.robot.pose({ kind: 'cart_pole', pulley_radius: 0.05, pole_length: 0.6, reach: 1 }, [4, half])];
  });
  const near = (point, wanted) => point.forEach((value, axis) => assert.ok(Math.abs(value - wanted[axis]) < 1e-9, `${point}, not ${wanted}`));
  near(tilted.lines[1][1], [0, 1, 1]);   // one metre along the first frame's x, which points along y
  near(tilted.tool, [0, 1, 1.5]);        // the second frame's axis is level; a quarter turn points its x upwards
  near(tilted.lines[2][0], [0, 0, 0]);
  near(tilted.lines[2][1], [0, -1, 0]);
  near(cart.tool, [0.2, 0, 0]);
  near(cart.lines[1][1], [0.8, 0, 0]);   // a pole fallen towards positive positions
}

// Of the buckets that share a point of the chart, the parts shown are those of the one with the oldest command. Buckets
// made by hand, 2400 for 1200 points: of each two one reaches higher from below, or has no command at all.
async function showsPartsOfTheOldest(page) {
  const parts = await page.evaluate(() => {
    const fill = (pair) => Float32Array.from({ length: 2400 }, (_, row) => (row < 1200 ? pair : pair.toReversed())[row % 2]);
    const samplesOf = (ages, spreads, infers) => {
      const columns = { age: fill(ages), 'age.spread': fill(spreads), infer: fill(infers), interventions: fill([0, 0]) };
      const none = { rows: 0, times: [], column: () => [] };
      return new takt.Samples({ rows: 2400, times: Float64Array.from({ length: 2400 }, (_, row) => row), column: (name) => columns[name] }, none, 1);
    };
    return [samplesOf([20, 22], [380, 18], [390, 30]), samplesOf([NaN, 20], [NaN, 2], [NaN, 10]), samplesOf([NaN, NaN], [NaN, NaN], [NaN, NaN])]
      .map((samples) => [...new Set(samples.atLargest(0, 2399, ['infer'], ['age', 'age.spread']).map(([, infer]) => infer))]);
  });
  assert.deepEqual(parts, [[390], [10], [null]]);
}

// A page lists only so many changes of the mode. Behind them the figure states none.
async function knowsWhereModesEnd(page) {
  const [listed, cut] = await page.evaluate(() => {
    const { facts, figure, view } = takt.page;
    const all = facts.modes;
    const states = () => [all[1][1] - facts.period_s / 2, all[1][1], view.end].map((time) => {
      view.setCursor(time);
      return [figure.scene().mode, document.querySelector('#now td:last-child').textContent, Boolean(figure.scene().measured)];
    });
    const listed = states();
    facts.modes = all.slice(0, 2);
    const cut = states();
    facts.modes = all;
    return [listed, cut];
  });
  assert.deepEqual(listed.map(([mode]) => mode), ['arming', 'tracking', 'damped_stop']);
  assert.deepEqual(cut, [['arming', 'arming', true], [null, 'unknown', true], [null, 'unknown', true]]);
}

// A long loss of the policy does not flatten the rest: the charts of age reach as high as what is in view, and as the limit.
async function scalesToWhatIsInView(page) {
  const limit = metrics.contract.max_age_ns * 1e-6;
  const highestLabels = (from, to) => page.evaluate(([begin, end]) => {
    takt.page.view.setWindow(begin, end);
    return ['age', 'stages'].map((id) => Math.max(...[...document.querySelectorAll(`#${id} .dygraph-axis-label-y`)].map((label) => +label.textContent)));
  }, [from, to]);
  const [age, stages] = await highestLabels(...calm);
  const most = 1.1 * Math.max(limit, await oldestIn(page, ...calm));
  assert.ok(age > most / 2 && age <= most, `labelled up to ${age} of ${most} ms`);
  assert.equal(stages, age, 'both alike');
  const whole = await highestLabels(0, 1e9);
  const oldest = await oldestIn(page, 0, 1e9);
  assert.ok(oldest > 4 * most, `the demo ends with a loss: ${oldest} ms`);
  whole.forEach((label) => assert.ok(label > oldest / 2 && label <= 1.1 * oldest, `labelled up to ${label} of ${oldest} ms`));
}

async function zoomsTogether(page) {
  const before = await axes(page);
  const box = await page.locator('#age').boundingBox();
  await page.mouse.move(box.x + 400, box.y + 100);
  await page.mouse.down();
  await page.mouse.move(box.x + 600, box.y + 105, { steps: 5 });
  await page.mouse.up();
  (await axes(page)).forEach((labels, index) => assert.notEqual(labels, before[index], `${charts[index]} goes along`));
  await page.mouse.dblclick(box.x + 400, box.y + 100);
  assert.deepEqual(await axes(page), before, 'a double click shows the whole run again');
  await page.mouse.click(box.x + 700, box.y + 60);
  assert.ok((await view(page)).cursor > 0.5, 'a click sets the cursor');
}

async function jumpsToViolations(page) {
  const rows = page.locator('#violations tbody tr');
  assert.equal(await rows.count(), 2);
  assert.match(await rows.nth(0).textContent(), /the robot stopped.*inference stall.*no command came/, 'the gravest first');
  assert.match(await rows.nth(1).textContent(), /commands missed/);
  await rows.nth(0).click();
  const there = await view(page);
  assert.ok(there.from < there.cursor && there.cursor < there.to && there.to - there.from < 2, 'zoomed in on it');
  assert.equal(await page.locator('#violations tr[aria-current]').count(), 1);
  await page.keyboard.press('p');
  const back = await view(page);
  assert.ok(back.cursor < there.cursor, 'p: the one before');
  await page.keyboard.press('n');
  assert.equal((await view(page)).cursor, there.cursor, 'n: the next');
}

// Late wake-ups that cost nothing share a row; whatever a key jumps to is in sight afterwards, be it in that row, far down
// the list, or on a small screen.
async function hidesNothingItJumpsTo(page) {
  const kCount = 60;
  const found = await page.evaluate((count) => {
    const { view, violations } = takt.page;
    const list = Array.from({ length: count }, (_, index) => ({ at_s: 0.5 + 0.04 * index, fault: index === 7 ? 'unknown' : 'platform_stall',
      gravity: index === 7 ? 'missed' : index === 50 ? 'stopped' : 'late', lateness_ms: index }));
    document.querySelector('#violations tbody').replaceChildren();
    const many = new takt.Moments('violations', list, count, view, (each, number) => [each.gravity, each.fault, `number ${number}`], takt.byGravity);
    const rows = () => [...document.querySelectorAll('#violations tbody tr')].filter((row) => !row.hidden).map((row) => [...row.cells].slice(1).map((cell) => cell.textContent).join(', '));
    const closed = rows();
    view.setCursor(0);
    const seen = [];
    for (let step = 0; step < count; ++step) {
      many.next();
      const row = document.querySelector('#violations tr[aria-current]'), box = row.getBoundingClientRect(), list = row.closest('.scroll').getBoundingClientRect();
      const age = document.getElementById('age').getBoundingClientRect(), bar = document.getElementById('transport').getBoundingClientRect();
      const isInSight = !row.hidden && box.top >= list.top - 1 && box.bottom <= list.bottom + 1 && age.top >= bar.top && age.bottom <= innerHeight + 1;
      seen.push([row.cells[3].textContent, isInSight]);
    }
    document.querySelector('#violations tbody').replaceChildren(...violations.rows);
    return { closed, seen };
  }, kCount);
  assert.deepEqual(found.closed, ['stopped, platform_stall, number 51', 'missed, unknown, number 8',
    'no command missed, platform stall, the control loop woke up late, by 59.0 ms at most']);
  assert.deepEqual(found.seen, Array.from({ length: kCount }, (_, index) => [`number ${index + 1}`, true]));
}

// A limit that holds is no alarm: nothing red on the charts of a calm stretch.
async function alarmsOnlyAtAlarms(page) {
  const red = await page.evaluate(([from, to]) => {
    takt.page.view.setWindow(from, to);
    const isRed = (r, g, b, a) => a > 200 && r > 150 && r > 1.8 * g && r > 1.8 * b;
    return ['age', 'tracking', 'interventions', 'timing'].map((id) => [...document.querySelectorAll(`#${id} canvas`)].reduce((sum, canvas) => {
      const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
      for (let at = 0; at < data.length; at += 4) sum += isRed(...data.slice(at, at + 4));
      return sum;
    }, 0));
  }, calm);
  assert.deepEqual(red, [0, 0, 0, 0]);
}

// With one long loss in view two thirds of the chart are still those of ages up to twice the limit.
async function breaksTheScaleOfALongLoss(page) {
  const { ends, parts } = await page.evaluate(() => {
    const scale = takt.scaleFor(150, 15000);
    const values = [0, 75, 150, 300, 1000, 15000];
    return { ends: values.map(scale.to), parts: [takt.scaleFor(150, 600).isBroken, scale.isBroken, scale.ticks(200).map(({ label }) => +label)] };
  });
  ends.forEach((each, index) => assert.ok(index === 0 ? each === 0 : each > ends[index - 1], 'rises'));
  assert.ok(Math.abs(ends[2] - 1 / 3) < 1e-9 && Math.abs(ends[3] - 2 / 3) < 1e-9 && Math.abs(ends[5] - 1) < 1e-9, ends);
  assert.deepEqual(parts.slice(0, 2), [false, true]);
  assert.ok(parts[2].includes(15000) && parts[2].includes(0) && parts[2].some((each) => each > 0 && each <= 150), parts[2].join());
}

// Every joint's numbers at the cursor are the samples', beside the robot file's limits; the chart follows what is chosen.
async function showsEveryJoint(page) {
  const found = await page.evaluate(() => {
    const { facts, samples, view } = takt.page;
    view.whole();
    view.setCursor(1);
    const place = samples.at(1);
    const rows = [...document.querySelectorAll('#joints tr')].slice(1).map((row) => [...row.cells].map((cell) => cell.firstChild.textContent));
    const [joint, quantity] = ['joint', 'quantity'].map((id) => document.getElementById(id));
    const choose = (select, value) => { select.value = value; select.dispatchEvent(new Event('change')); };
    const legends = [...quantity.options].map((option) => {
      choose(quantity, option.value);
      return document.getElementById('tracking-legend').textContent;
    });
    choose(quantity, 'position');
    choose(joint, 'all');
    const all = document.getElementById('tracking-legend').textContent;
    choose(joint, '0');
    return { rows, legends, all, names: facts.joints.map(({ name }) => name), limits: document.querySelector('#joints small').textContent,
      wanted: facts.joints.map((_, index) => [['q' + index, `q${index}.spread`, 4], ['dq' + index, null, 3], ['kp' + index, null, 1]].map(([name, spread, digits]) => samples.value(place, name, spread).toFixed(digits))) };
  });
  assert.deepEqual(found.rows.map(([name]) => name), found.names);
  found.rows.forEach((cells, index) => assert.deepEqual([cells[1], cells[4], cells[7]].map(Number), found.wanted[index].map(Number), cells.join()));
  assert.match(found.limits, /^ of (±|-?[\d.]+ to )/);
  assert.equal(found.legends.length, 6);
  assert.match(found.legends[1], /estimated.*limits -.* rad\/s/);
  for (const name of found.names) assert.ok(found.all.includes(name));
}

// The pointer says what the chart holds where it points.
async function saysTheValueAtThePointer(page) {
  await page.keyboard.press('0');
  await page.evaluate(() => scrollTo(0, 0));
  for (const id of charts) {
    await page.locator(`#${id}`).scrollIntoViewIfNeeded();
    const box = await page.locator(`#${id}`).boundingBox();
    await page.mouse.move(box.x + 0.6 * box.width, box.y + 0.4 * box.height);
    const text = await page.evaluate(() => (document.getElementById('pointer').hidden ? '' : [...document.getElementById('pointer').rows].map((row) => [...row.cells].map((cell) => cell.textContent).join(' ')).join('\n')));
    assert.match(text, /^[\d.]+ s/, id);
    if (id !== 'age') continue;
    const [time, age] = [parseFloat(text), parseFloat(text.match(/age ([\d.]+) ms/)[1])];
    const [wanted, inside] = await page.evaluate((at) => {
      const { samples } = takt.page, box = document.getElementById('pointer').getBoundingClientRect();
      return [samples.value(samples.at(at), 'age', 'age.spread'), box.left >= 0 && box.right <= innerWidth && box.bottom <= innerHeight];
    }, time);
    assert.ok(Math.abs(age - wanted) < 1.1, `${age}, not ${wanted} ms`);
    assert.ok(inside, 'all of it is on the screen');
  }
  await page.mouse.move(5, 5);
  assert.ok(await page.evaluate(() => document.getElementById('pointer').hidden));
}

// Which pixel columns of each chart would look different without the marks, counted from the cursor's line.
const columnsOfMarks = (page) => page.evaluate((ids) => {
  const { view } = takt.page;
  const pixels = (id) => [...document.querySelectorAll(`#${id} canvas`)].map((canvas) =>
    ({ width: canvas.width, data: new Uint32Array(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.buffer) }));
  const marked = ids.map(pixels);
  const marks = view.marks;
  view.marks = [];
  view.tell('window');
  const columns = ids.map((id, chart) => {
    const cursor = parseFloat(document.querySelector(`#${id} .cursor-line`).style.left);
    const found = new Set();
    pixels(id).forEach(({ width, data }, canvas) => data.forEach((pixel, at) => {
      if (pixel !== marked[chart][canvas].data[at]) found.add(Math.floor(at % width - cursor));
    }));
    return [...found].sort((a, b) => a - b);
  });
  view.marks = marks;
  view.tell('window');
  return columns;
}, charts);

// The demo was marked once. The list, the key, the text and every chart say so, and say the same instant.
async function showsMarks(page) {
  const at = (metrics.marks[0].tick - metrics.ticks.first) * 1e-3;
  await page.keyboard.press('0');
  await page.locator('#marks tbody button').click();
  const there = await view(page);
  assert.ok(Math.abs(there.cursor - at) < 1e-6 && there.to - there.from < 2, 'a click zooms in on the mark');
  assert.match(await page.textContent('#cursor'), /mark 1$/);
  assert.equal(await page.locator('#marks tr[aria-current]').count(), 1);
  assert.match(await page.textContent('#text'), /marks +1\n +tick +700/);
  (await columnsOfMarks(page)).forEach((columns, index) => {
    const isBand = charts[index] === 'modes';
    assert.ok(columns.includes(0) || columns.includes(-1), `${charts[index]}: the mark stands at the cursor: ${columns}`);
    assert.equal(columns.length > 5, isBand, `${charts[index]}: a line, on the band a flag beside it: ${columns}`);
  });
  await page.evaluate(() => takt.page.view.setCursor(0));
  await page.keyboard.press('m');
  assert.equal((await view(page)).cursor, there.cursor, 'm: the next mark');
  await page.keyboard.press('M');
  assert.equal((await view(page)).cursor, there.cursor, 'M: there is none before it');
}

async function obeysTheKeyboard(page) {
  await page.keyboard.press('0');
  const whole = await view(page);
  assert.deepEqual([whole.from, whole.to], [0, whole.end]);
  await page.keyboard.press('+');
  const closer = await view(page);
  assert.ok(closer.to - closer.from < 0.6 * whole.end);
  await page.keyboard.press('-');
  await page.keyboard.press('ArrowLeft');
  assert.ok((await view(page)).cursor < closer.cursor);
  await page.keyboard.press('?');
  assert.ok(await page.locator('#help').isVisible());
  const behind = await view(page);
  await page.keyboard.press('+');
  assert.deepEqual(await view(page), behind, 'nothing moves behind the help');
  await page.keyboard.press('?');
  assert.ok(!await page.locator('#help').isVisible());
}

async function plays(page) {
  await page.evaluate(() => takt.page.view.setCursor(0.2));
  await page.keyboard.press(' ');
  await page.waitForFunction(() => takt.page.view.cursor > 0.3);
  await page.keyboard.press(' ');
  const stopped = await view(page);
  assert.ok(!stopped.isPlaying);
  await page.locator('#theme').focus();
  await page.keyboard.press(' ');
  assert.ok(!(await view(page)).isPlaying, 'on a button, space presses the button');
  await page.keyboard.press(' ');
  await page.evaluate(() => document.activeElement.blur());
}

async function turnsDark(page) {
  const paper = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const light = await paper();
  await page.keyboard.press('d');
  assert.notEqual(await paper(), light);
  await page.emulateMedia({ media: 'print' });
  assert.ok(!await page.locator('#play').isVisible(), 'print leaves the controls out');
  await page.emulateMedia({ media: 'screen' });
}

// What a run has not measured is neither 0 nor better.
async function comparesWhatThereIs(page) {
  const rows = await page.evaluate(() => {
    const table = document.getElementById('comparison');
    table.replaceChildren();
    const rows = [['age', 'ms', null, 48.25], ['infer', 'ms', 48.25, null], ['hold', 'ms', null, null], ['misses', '%', 0, null], ['overruns', '', 0, 0], ['work', 'us', 8, 8.5]];
    takt.tables({ ...takt.page.facts, comparison: { ...takt.page.facts.comparison, rows } });
    return [...table.rows].slice(1).map((row) => [...row.cells].map((cell) => cell.textContent).join(' '));
  });
  assert.deepEqual(rows, ['age - 48.250 - ms', 'infer 48.250 - - ms', 'misses 0 - - %', 'work 8 8.500 +0.500 us']);
}

// The screenshot is no empty sheet: many colours, and no colour everywhere.
async function screenshotIsNotEmpty(page, path) {
  const png = await page.screenshot({ fullPage: true });
  if (path) writeFileSync(path, png);
  const [colours, most] = await page.evaluate(async (base64) => {
    const image = new Image();
    image.src = 'data:image/png;base64,' + base64;
    await image.decode();
    const canvas = Object.assign(document.createElement('canvas'), { width: image.width, height: image.height });
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0);
    const counts = new Map();
    const pixels = new Uint32Array(context.getImageData(0, 0, canvas.width, canvas.height).data.buffer);
    for (const pixel of pixels) counts.set(pixel, (counts.get(pixel) ?? 0) + 1);
    return [counts.size, Math.max(...counts.values()) / pixels.length];
  }, png.toString('base64'));
  assert.ok(colours > 200, `${colours} colours`);
  assert.ok(most < 0.97, `${(100 * most).toFixed(1)} % of the page is one colour`);
  return colours;
}

// The oldest age drawn of a stretch without violations, s.
const calm = [0.3, 0.6];
const oldestIn = (page, from, to) => page.evaluate(([begin, end]) =>
  Math.max(...takt.page.samples.bands(begin, end, [['age', 'age.spread']]).map(([, band]) => band[2] ?? 0)), [from, to]);

// A run too long to hold every tick: buckets keep their extremes, and around violations every tick is there.
async function thinsOut(page, calmAge) {
  assert.ok(Math.abs(await oldestIn(page, ...calm) - calmAge) < 0.05, 'buckets lose no spike');
  const found = await page.evaluate(() => {
    const { samples, view, violations, facts } = takt.page;
    const rows = (from, to) => samples.bands(from, to, [['age', 'age.spread']]);
    const stop = facts.modes.find(([, , mode]) => mode === 'damped_stop')[0];
    const at = violations.list[0].at_s;
    return {
      bucket: samples.whole.bucketTicks,
      oldest: Math.max(...rows(0, stop - facts.period_s / 2).map(([, band]) => band[2] ?? 0)),
      calm: rows(0.7, 0.8).length,
      violation: rows(at - 0.05, at + 0.05).map(([time]) => time),
    };
  });
  assert.ok(found.bucket > 4, `buckets of ${found.bucket} ticks`);
  const most = metrics.age_ns.per_tick.total.max * 1e-6;
  assert.ok(found.oldest > most - 0.05 && found.oldest < most + found.bucket, `oldest age ${found.oldest}, not ${most} ms`);
  assert.ok(found.calm < 100 / found.bucket + 3, `${found.calm} rows of 100 calm ticks`);
  assert.ok(Math.abs(found.violation.length - 100) < 4, `${found.violation.length} rows of 100 ticks about a violation`);
  found.violation.slice(1).forEach((time, index) => assert.ok(time > found.violation[index], 'in order'));
}

// 500 of the demo's ticks were not recorded: nothing is drawn, painted or said of that time.
async function leavesGapsEmpty(page) {
  const found = await page.evaluate((times) => {
    const { samples, figure, view } = takt.page;
    // Painted pixels of a chart where each time is.
    const painted = (id) => {
      const canvas = document.querySelector(`#${id} canvas`);
      const area = canvas.getBoundingClientRect();
      const axis = document.getElementById(id).querySelectorAll('.dygraph-axis-label-x');
      const [first, second] = [axis[0], axis[1]].map((label) => ({ time: parseFloat(label.textContent),
        x: label.getBoundingClientRect().left + label.getBoundingClientRect().width / 2 - area.left }));
      return times.map((time) => {
        const x = first.x + (time - first.time) * (second.x - first.x) / (second.time - first.time);
        const pixels = new Uint32Array(canvas.getContext('2d').getImageData(Math.round(x * canvas.width / area.width), 0, 1, canvas.height).data.buffer);
        return pixels.filter((pixel) => pixel !== 0).length;
      });
    };
    const scenes = times.map((time) => {
      view.setCursor(time);
      const { measured, setpoint, policy } = figure.scene();
      return { known: [measured, setpoint, policy].map(Boolean), text: document.getElementById('now').textContent, trail: figure.trail().length };
    });
    const rows = { age: samples.bands(0, view.end, [['age', 'age.spread'], ['q0', 'q0.spread']]), stages: samples.atLargest(0, view.end, ['infer', 'hold'], ['age', 'age.spread']) };
    return { scenes, rows, buses: painted('buses'), stages: painted('stages') };
  }, [2.1, 2.43, 2.8]);
  for (const [name, rows] of Object.entries(found.rows)) {
    const inGap = rows.filter(([time]) => time > 2.1985 && time < 2.6985);
    assert.equal(inGap.length, 1, `${name}: one row says that there is nothing`);
    assert.ok(Math.abs(inGap[0][0] - 2.199) < 1e-4, `${name}: at ${inGap[0][0]} s, right behind the last tick`);
    assert.ok(inGap[0].slice(1).flat().every((value) => value === null), `${name}: ${inGap[0]}`);
  }
  for (const id of ['buses', 'stages']) {
    const [before, within, behind] = found[id];
    assert.ok(within <= Math.min(before, behind) / 2, `${id}: nothing but grid lines within: ${found[id]}`);
  }
  assert.deepEqual(found.scenes.map(({ known }) => known), [[true, true, true], [false, false, false], [true, true, true]]);
  assert.deepEqual(found.scenes.map(({ text }) => text.split('not recorded').length - 1), [0, 3, 0]);
  assert.ok(found.scenes[2].trail < 40 && found.scenes[2].trail > 5, `no way across: ${found.scenes[2].trail} of 60 pieces`);
}

// The image at the cursor as the browser decodes it: what the fixture made of its number; and what is said of it.
const seenAt = (page, time) => page.evaluate(async (at) => {
  takt.page.view.setCursor(at);
  const image = document.querySelector('#seen img');
  const [caption, note] = [...document.querySelectorAll('#seen figcaption')].map((each) => each.textContent);
  if (image.hidden) return { caption, note };
  await image.decode();
  const canvas = Object.assign(document.createElement('canvas'), { width: image.naturalWidth, height: image.naturalHeight });
  canvas.getContext('2d').drawImage(image, 0, 0);
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  const different = new Set();
  for (let at = 4; at < pixels.length; at += 4) different.add(pixels.subarray(at, at + 4).join());
  return { caption, note, size: [canvas.width, canvas.height], first: [...pixels.subarray(0, 4)], others: [...different], outdated: image.matches('.outdated') };
}, time);

// A camera that froze before the stop: the page opens there and shows the image that was the newest, pixel by pixel.
async function showsWhatThePolicySaw(page) {
  const { cursor } = await view(page);
  const stop = await page.evaluate(() => takt.page.facts.violations.find(({ gravity }) => gravity === 'stopped').at_s);
  assert.equal(cursor, stop, 'the page opens at the stop');
  const isImage = (seen, number, at) => {
    assert.deepEqual(seen.size, [32, 24]);
    assert.deepEqual(seen.first, [number, 255 - number, 255, 255]);
    assert.deepEqual(seen.others, [`${number},${255 - number},0,255`]);
    assert.ok(seen.caption.startsWith(`target: sensed ${(1000 * at - 33 * number).toFixed(1)} ms before the cursor`), seen.caption);
  };
  const last = await seenAt(page, stop);
  isImage(last, 79, stop);
  assert.ok(!last.outdated && !last.caption.includes('newer'), 'after it the camera published none');
  assert.equal(last.note.replace(/has \d+/, 'has N'), 'This page has N of 80 images; 1 recorded without a file; 1 file lost or altered');
  const mark = await page.evaluate(() => takt.page.facts.marks[0].at_s);
  isImage(await seenAt(page, mark), Math.floor((1000 * mark - 15) / 33), mark);
  // From the first image on: what is shown is the newest that the page has, and it is said when there was a newer one.
  assert.match((await seenAt(page, 0)).caption, /no image before the cursor/);
  const kept = await page.evaluate(() => takt.page.facts.seen[0].pictures.map(({ sensed_s }) => Math.round(sensed_s * 1000 / 33)));
  assert.ok(kept.length >= 15 && kept.length < 50 && !kept.includes(39) && !kept.includes(21), `${kept}`);
  for (let time = 0.1; time < 2.6; time += 0.11) {
    const newest = Math.floor((1000 * time - 15) / 33), shown = kept.findLast((number) => number <= newest);
    if (shown === undefined) continue;
    const seen = await seenAt(page, time);
    isImage(seen, shown, time);
    assert.equal(seen.outdated, shown !== newest, `${time} s`);
    assert.equal(seen.caption.endsWith('; newer images are not on this page'), shown !== newest);
  }
}

const calmAge = await inBrowser({ colorScheme: 'light' }, async (page, { errors, requests }) => {
  await page.goto(url);
  await ready(page);
  const drawn = await drawsEverything(page);
  const age = await oldestIn(page, ...calm);
  await showsWhatWasRecorded(page);
  await knowsOtherRobots(page);
  await showsPartsOfTheOldest(page);
  await knowsWhereModesEnd(page);
  await scalesToWhatIsInView(page);
  await zoomsTogether(page);
  await jumpsToViolations(page);
  await hidesNothingItJumpsTo(page);
  await page.setViewportSize({ width: 400, height: 900 });
  await hidesNothingItJumpsTo(page);
  // Less room than a chart's margins take: nothing is drawn, and nothing fails.
  await page.setViewportSize({ width: 60, height: 900 });
  await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
  await page.setViewportSize({ width: 1500, height: 1900 });
  await alarmsOnlyAtAlarms(page);
  await breaksTheScaleOfALongLoss(page);
  await showsEveryJoint(page);
  await saysTheValueAtThePointer(page);
  await page.keyboard.press('0');
  await showsMarks(page);
  await obeysTheKeyboard(page);
  await plays(page);
  const colours = await screenshotIsNotEmpty(page, process.argv[3]);
  await turnsDark(page);
  await screenshotIsNotEmpty(page, process.argv[3] && process.argv[3].replace(/\.png$/, '-dark.png'));
  await comparesWhatThereIs(page);
  assert.deepEqual(errors, []);
  assert.deepEqual(requests.filter((request) => !request.startsWith('data:image/png')), [url], 'nothing is fetched');
  console.log(`parts drawn with ${drawn.join(', ')} colours; screenshot ${colours}; one request, no error`);
  return age;
});
await inBrowser({}, async (page, { errors }) => {
  await page.goto(url.replace('report.html', 'thin.html'));
  await ready(page);
  await thinsOut(page, calmAge);
  assert.deepEqual(errors, []);
});
await inBrowser({}, async (page, { errors }) => {
  await page.goto(url.replace('report.html', 'gap.html'));
  await ready(page);
  await leavesGapsEmpty(page);
  assert.deepEqual(errors, []);
});
await inBrowser({}, async (page, { errors, requests }) => {
  await page.goto(url.replace('report.html', 'seen.html'));
  await ready(page);
  await showsWhatThePolicySaw(page);
  assert.deepEqual(errors, []);
  assert.deepEqual(requests.filter((request) => !request.startsWith('data:image/png')), [url.replace('report.html', 'seen.html')]);
});
