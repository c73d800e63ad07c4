'use strict';
// Draws the report from the two JSON blocks of the page. Times are seconds since the first recorded tick.
(function () {
  const facts = JSON.parse(document.getElementById('facts').textContent);
  const series = JSON.parse(document.getElementById('series').textContent);
  const metrics = facts.metrics;
  const limitMs = metrics.contract.max_age_ns * 1e-6;
  const endS = Math.max(metrics.ticks.span_ns * 1e-9, 1e-3);
  const modeColours = {
    standby: '#aab4bf', arming: '#7fb3d5', tracking: '#6abf87', degraded: '#f0b429',
    damped_stop: '#e67e22', fault_latched: '#c0392b',
  };

  function text(id, value) { document.getElementById(id).textContent = value; }

  function verdict(title, misses) {
    const box = document.createElement('div');
    box.className = 'verdict ' + misses.verdict;
    const name = document.createElement('span');
    name.textContent = title;
    const word = document.createElement('b');
    word.textContent = misses.count === 0 ? 'nothing to judge' : misses.verdict;
    const numbers = document.createElement('span');
    numbers.textContent = misses.misses + ' of ' + misses.count + ' missed, at most ' +
        (100 * misses.upper_bound).toFixed(3) + ' % with ' + 100 * metrics.contract.confidence + ' % confidence';
    box.append(name, word, numbers);
    document.getElementById('verdicts').append(box);
  }

  function bandBetween(context, area, graph, from, to) {
    const left = Math.max(graph.toDomXCoord(from), area.x);
    const right = Math.min(graph.toDomXCoord(to), area.x + area.w);
    return right > left ? { left: left, width: right - left } : null;
  }

  // Modes as a tint behind every chart.
  function tint(context, area, graph) {
    for (const [from, to, mode] of facts.modes) {
      const band = bandBetween(context, area, graph, from, to);
      if (!band) continue;
      context.fillStyle = modeColours[mode] + '22';
      context.fillRect(band.left, area.y, band.width, area.h);
    }
  }

  function limitLine(context, area, graph) {
    tint(context, area, graph);
    const y = graph.toDomYCoord(limitMs);
    context.strokeStyle = '#c0392b';
    context.setLineDash([6, 4]);
    context.beginPath();
    context.moveTo(area.x, y);
    context.lineTo(area.x + area.w, y);
    context.stroke();
    context.setLineDash([]);
    context.fillStyle = '#c0392b';
    context.font = '12px sans-serif';
    context.fillText('max age ' + limitMs + ' ms', area.x + 6, y - 5);
  }

  function modeBand(context, area, graph) {
    context.font = '12px sans-serif';
    for (const [from, to, mode] of facts.modes) {
      const band = bandBetween(context, area, graph, from, to);
      if (!band) continue;
      context.fillStyle = modeColours[mode];
      context.fillRect(band.left, area.y, Math.max(band.width, 1), area.h);
      if (band.width > 8 * mode.length) {
        context.fillStyle = '#1d2733';
        context.fillText(mode, band.left + 6, area.y + area.h / 2 + 4);
      }
    }
  }

  function chart(id, rows, labels, options) {
    return new Dygraph(document.getElementById(id), rows, Object.assign({
      labels: labels, dateWindow: [0, endS], legend: 'follow', strokeWidth: 1.3, xlabel: '', animatedZooms: false,
      axes: { x: { axisLabelFormatter: function (s) { return +s.toFixed(4) + ' s'; },
                   valueFormatter: function (s) { return s.toFixed(4) + ' s'; } } },
    }, options));
  }

  const nothing = function (columns) { return [[0].concat(Array(columns).fill(null)), [endS].concat(Array(columns).fill(null))]; };
  const filled = function (rows, columns) { return rows.length ? rows : nothing(columns); };

  text('title', 'Run ' + metrics.run_id);
  text('subtitle', metrics.robot + ', ' + metrics.ticks.recorded + ' ticks from ' + facts.started + ', ' +
      (metrics.realtime === true ? 'real-time' : metrics.realtime === false ? 'NOT real-time' : 'real-time unknown') +
      (facts.host ? ', ' + facts.host.cpu + ', ' + facts.host.kernel : '') + (facts.complete ? '' : ', INCOMPLETE'));
  text('text', facts.text);
  verdict('per tick: Pr(age > ' + limitMs + ' ms) <= ' + 100 * metrics.contract.epsilon + ' %', metrics.deadline_misses.per_tick);
  verdict('per command', metrics.deadline_misses.per_command);

  const oldest = series.age.reduce(function (most, row) { return Math.max(most, row[1]); }, limitMs);
  const age = chart('age', filled(series.age, 1), ['s', 'age'], {
    colors: ['#1f4e79'], ylabel: 'ms', valueRange: [0, 1.1 * oldest], underlayCallback: limitLine });
  const stages = chart('stages', filled(series.stages, 5), ['s', 'sense', 'queue', 'infer', 'publish', 'hold'], {
    stackedGraph: true, ylabel: 'ms', fillAlpha: 0.65, strokeWidth: 0.6, legend: 'always',
    labelsDiv: 'stages-legend',
    colors: ['#4e79a7', '#f28e2b', '#e15759', '#76b7b2', '#b07aa1'] });
  const modes = chart('modes', [[0, 0], [endS, 0]], ['s', 'mode'], {
    underlayCallback: modeBand, strokeWidth: 0, valueRange: [-1, 1], legend: 'never', ylabel: ' ',
    axes: { y: { drawGrid: false, axisLabelFormatter: function () { return ''; } },
            x: { axisLabelFormatter: function (s) { return +s.toFixed(4) + ' s'; } } } });

  const select = document.getElementById('joint');
  facts.joints.forEach(function (name, index) { select.add(new Option(name, index)); });
  const tracked = function () { return filled(series.joints[+select.value] || [], 2); };
  const tracking = chart('tracking', tracked(), ['s', 'measured', 'reference'], {
    colors: ['#1f4e79', '#e15759'], ylabel: 'rad', legend: 'always', labelsDiv: 'tracking-legend', underlayCallback: tint });
  select.addEventListener('change', function () { tracking.updateOptions({ file: tracked() }); });

  Dygraph.synchronize([age, stages, modes, tracking], { selection: false, zoom: true, range: false });

  const legend = document.getElementById('mode-legend');
  for (const mode of new Set(facts.modes.map(function (band) { return band[2]; }))) {
    const swatch = document.createElement('span');
    swatch.className = 'swatch';
    swatch.style.background = modeColours[mode];
    legend.append(swatch, mode);
  }
})();
