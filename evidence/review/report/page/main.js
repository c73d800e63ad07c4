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

  function charts() {
    takt.chart('age', view, (from, to) => samples.bands(from, to, [['age', 'age.spread']]), {
      labels: ['s', 'age'], customBars: true, ylabel: 'ms', heightOf: ([, band]) => band[2] ?? 0, alwaysHigh: limitMs,
      underlayCallback: takt.underlay(facts.modes, { value: limitMs, text: `max age ${limitMs} ms` }) },
    () => ({ colors: [takt.colour('data')] }));
    const parts = ['sense', 'queue', 'infer', 'publish', 'hold'];
    takt.chart('stages', view, (from, to) => samples.atLargest(from, to, parts, ['age', 'age.spread']), {
      labels: ['s'].concat(parts), stackedGraph: true, ylabel: 'ms', fillAlpha: 0.65, strokeWidth: 0.6, legend: 'always',
      labelsDiv: 'stages-legend', colors: takt.partColours, heightOf: ([, ...values]) => values.reduce((sum, value) => sum + value, 0), alwaysHigh: limitMs });
    takt.modeLane(view, facts.modes);
    takt.interventionLanes(view, samples, facts.intervention_kinds);
    takt.busLanes(view, samples, facts.buses);
    takt.chart('timing', view, (from, to) => samples.bands(from, to, [['lateness', null], ['work', null]]), {
      labels: ['s', 'late wake-up', 'work'], customBars: true, ylabel: 'us', legend: 'always', labelsDiv: 'timing-legend',
      underlayCallback: takt.underlay(facts.modes) }, () => ({ colors: [takt.colour('second'), takt.colour('data')] }));
  }

  function jointChart() {
    const select = element('joint');
    facts.joints.forEach((joint, index) => select.add(new Option(joint.name, index)));
    const lines = () => [['q', 'q@.spread'], ['reference', 'reference@.spread'], ['target', null]].map(([name, spread]) =>
      [name + select.value, spread && spread.replace('@', select.value)]);
    const chart = takt.chart('tracking', view, (from, to) => samples.bands(from, to, lines()), {
      labels: ['s', 'measured', 'setpoint', 'policy target'], customBars: true, ylabel: 'rad', legend: 'always',
      labelsDiv: 'tracking-legend', underlayCallback: takt.underlay(facts.modes) },
    () => ({ colors: [takt.colour('data'), takt.colour('second'), takt.colour('third')] }));
    select.addEventListener('change', () => chart.reload());
  }

  function legends() {
    const modes = [...new Set(facts.modes.map((band) => band[2]))];
    takt.swatches('mode-legend', modes.map((mode) => [takt.colour(mode), mode.replaceAll('_', ' ')]));
    if (facts.marks.length) element('mode-legend').append('; flags and dotted lines: marks');
    if (facts.modes.length && facts.metrics.transition_count >= facts.modes.length) {
      element('mode-legend').append(`; not drawn after ${facts.modes.at(-1)[1].toFixed(1)} s: the page holds ${facts.modes.length} of ${facts.metrics.transition_count + 1} stretches`);
    }
    takt.swatches('bus-legend', takt.busStates.map((state) => [takt.colour(state.colour), state.name])
      .concat([[takt.colour('violated'), 'frames dropped or foreign']]));
    element('bus-legend').append('; the higher the worse');
    takt.swatches('figure-legend', [[takt.colour('tracking'), 'measured, in the colour of the mode'], [takt.colour('second'), 'setpoint'], [takt.colour('third'), 'policy target'],
      [takt.colour('data'), 'way of the last second']].concat(samples.has('task.x') ? [[takt.colour('limit'), 'task target']] : []));
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
  jointChart();
  transport();
  takt.theme.onChange(legends);
  legends();
  const figure = new takt.figure(facts, samples, view);
  const violations = new takt.Moments('violations', facts.violations, facts.violation_count, view,
    (violation) => [violation.fault.replaceAll('_', ' '), violation.sentence.replace(/^[a-z_]+: /, '')]);
  const marks = new takt.Moments('marks', facts.marks, facts.metrics.mark_count, view, (mark, number) => [String(number), String(mark.tick)]);
  takt.keyboard(view, violations, marks);
  figure.draw();
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
