// SPDX-License-Identifier: Apache-2.0
// Puts the page together from its data. takt.page is there for tests; data-ready says in ms when everything was drawn.
takt.main = async function (say) {
  const element = (id) => document.getElementById(id);
  const facts = JSON.parse(element('facts').textContent);
  takt.tables(facts);
  if (facts.metrics.ticks.recorded === 0) say('Not one tick was recorded: there is nothing to draw.');
  const blocks = await Promise.all(['whole', 'moments'].map((name) => takt.openBlock(facts[name], element(name + '-block').textContent)));
  const samples = new takt.Samples(...blocks, facts.period_s);
  const end = Math.max(facts.metrics.ticks.span_ns * 1e-9, facts.period_s);
  const view = new takt.View(end, facts.period_s, facts.marks.map((mark) => mark.at_s));
  const limitMs = facts.metrics.contract.max_age_ns * 1e-6;

  const ms = (value) => (Number.isFinite(value) ? value.toFixed(2) + ' ms' : 'none');
  const parts = ['sense', 'queue', 'infer', 'publish', 'hold'];
  const agesAt = (time) => {
    const place = samples.at(time);
    return [['age', ms(samples.value(place, 'age', 'age.spread'))]].concat(parts.map((part) => [part, ms(samples.value(place, part))]));
  };
  const modeAt = (time) => [['mode', facts.modes.find(([from, to]) => from <= time && time < to)?.[2].replaceAll('_', ' ') ?? 'unknown']];
  const interventionsAt = (time) => {
    const mask = samples.value(samples.at(time), 'interventions');
    const acting = facts.intervention_kinds.filter((kind, bit) => mask >> bit & 1);
    return (acting.length ? acting : ['none']).map((kind) => [kind.replaceAll('_', ' '), '']);
  };
  const busesAt = (time) => facts.buses.map((bus, index) => {
    const place = samples.at(time), errors = samples.value(place, `bus${index}.errors`);
    return [bus, (takt.busStates[samples.value(place, `bus${index}.state`)]?.name ?? 'not recorded') + (errors > 0 ? `, ${errors} frames dropped or foreign` : '')];
  });
  const timingAt = (time) => [['late wake-up', 'lateness'], ['work', 'work']].map(([label, name]) => [label, `${samples.value(samples.at(time), name).toFixed(1)} µs`]);

  function charts() {
    const scale = (to) => (value) => (value === null ? null : to(value));
    takt.chart('age', view, (from, to) => samples.bands(from, to, [['age', 'age.spread']]), {
      labels: ['s', 'age'], customBars: true, ylabel: 'ms', heightOf: ([, band]) => band[2] ?? 0, alwaysHigh: limitMs,
      rescaled: ([time, band], to) => [time, band.map(scale(to))], valuesAt: agesAt,
      underlayCallback: takt.underlay(facts.modes, () => [{ value: limitMs, text: `max age ${limitMs} ms` }]) },
    () => ({ colors: [takt.colour('data')] }));
    // The last part lies at the bottom: each is as high as the scale makes it there.
    const stacked = ([time, ...values], to) => [time].concat(values.map((value, index) => {
      const below = values.slice(index + 1).reduce((sum, each) => sum + each, 0);
      return value === null ? null : to(below + value) - to(below);
    }));
    takt.chart('stages', view, (from, to) => samples.atLargest(from, to, parts, ['age', 'age.spread']), {
      labels: ['s'].concat(parts), stackedGraph: true, ylabel: 'ms', fillAlpha: 0.65, strokeWidth: 0.6, colors: takt.partColours, rescaled: stacked, valuesAt: agesAt,
      heightOf: ([, ...values]) => values.reduce((sum, value) => sum + value, 0), alwaysHigh: limitMs, underlayCallback: takt.underlay([]) });
    takt.modeLane(view, facts.modes, modeAt);
    takt.interventionLanes(view, samples, facts.intervention_kinds, interventionsAt);
    takt.busLanes(view, samples, facts.buses, busesAt);
    takt.chart('timing', view, (from, to) => samples.bands(from, to, [['lateness', null], ['work', null]]), {
      labels: ['s', 'late wake-up', 'work'], customBars: true, ylabel: 'µs', valuesAt: timingAt,
      underlayCallback: takt.underlay(facts.modes) }, () => ({ colors: [takt.colour('second'), takt.colour('data')] }));
  }

  function legends() {
    const modes = [...new Set(facts.modes.map((band) => band[2]))];
    takt.swatches('mode-legend', modes.map((mode) => [takt.colour(mode), mode.replaceAll('_', ' ')]));
    if (facts.marks.length) element('mode-legend').append('; flags and dotted lines: marks');
    if (facts.modes.length && facts.metrics.transition_count >= facts.modes.length) {
      element('mode-legend').append(`; not drawn after ${facts.modes.at(-1)[1].toFixed(1)} s: the page holds ${facts.modes.length} of ${facts.metrics.transition_count + 1} stretches`);
    }
    takt.swatches('stages-legend', parts.map((part, index) => [takt.partColours[index], part]));
    takt.swatches('timing-legend', [[takt.colour('second'), 'late wake-up'], [takt.colour('data'), 'work']]);
    takt.swatches('bus-legend', takt.busStates.map((state) => [takt.colour(state.colour), state.name])
      .concat([[takt.colour('violated'), 'frames dropped or foreign']]));
    element('bus-legend').append('; the higher the worse');
    takt.swatches('figure-legend', [[takt.colour('tracking'), 'measured, in the colour of the mode'], [takt.colour('second'), 'setpoint'], [takt.colour('third'), 'policy target'],
      [takt.colour('data'), 'way of the last second']].concat(samples.has('task.x') ? [[takt.colour('ink'), 'cross: task target']] : []));
  }

  function transport() {
    const speeds = [0.05, 0.1, 0.25, 0.5, 1, 2, 5, 20, 60];
    element('speed').append(...speeds.map((speed) => new Option(speed + ' x', speed, speed === 1, speed === 1)));
    element('speed').addEventListener('change', (event) => { view.speed = +event.target.value; });
    element('play').addEventListener('click', () => view.play(!view.isPlaying));
    element('whole').addEventListener('click', () => view.whole());
    element('theme').addEventListener('click', () => takt.theme.toggle());
    const label = () => { element('theme').textContent = takt.theme.isDark() ? 'Light' : 'Dark'; };
    takt.theme.onChange(label);
    label();
    view.on('playing', () => { element('play').textContent = view.isPlaying ? 'Pause' : 'Play'; });
    const where = () => {
      const mark = view.marks.findIndex((time) => Math.abs(time - view.cursor) < facts.period_s / 2);
      element('cursor').textContent = view.cursor.toFixed(4) + ' s' + (mark < 0 ? '' : `, mark ${mark + 1}`);
    };
    const window = () => { element('window').textContent = `in view ${view.from.toFixed(3)} to ${view.to.toFixed(3)} s`; };
    view.on('cursor', where);
    view.on('window', window);
    where();
    window();
  }

  charts();
  takt.joints(facts, samples, view);
  transport();
  takt.theme.onChange(legends);
  legends();
  const figure = new takt.figure(facts, samples, view);
  const violations = new takt.Moments('violations', facts.violations, facts.violation_count, view,
    (violation) => [takt.cameTo[violation.gravity], violation.fault.replaceAll('_', ' '), violation.sentence.replace(/^[a-z_]+: /, '')], takt.byGravity);
  const marks = new takt.Moments('marks', facts.marks, facts.metrics.mark_count, view, (mark, number) => [String(number), String(mark.tick), mark.text]);
  takt.keyboard(view, violations, marks);
  takt.images(facts.seen, view);
  figure.draw();
  const stop = facts.violations.find(({ gravity }) => gravity === 'stopped');
  if (stop) view.setCursor(stop.at_s);
  takt.page = { facts, samples, view, figure, violations, marks };
  document.documentElement.dataset.ready = performance.now().toFixed(0);
};

(function () {
  const trouble = document.getElementById('trouble');
  const say = (sentence) => {
    trouble.textContent = sentence;
    trouble.hidden = false;
  };
  takt.main(say).catch((error) => {
    say(`This browser could not draw all of the page (${error}); current Chromium and Firefox can. takt report prints the numbers in a terminal.`);
    throw error;
  });
})();
