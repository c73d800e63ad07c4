// SPDX-License-Identifier: Apache-2.0
// Everything on the page that is text.
takt.row = function (cells, isHead) {
  const row = document.createElement('tr');
  cells.forEach((text, index) => {
    const cell = document.createElement(isHead ? 'th' : 'td');
    cell.textContent = text;
    if (index > 0 && (isHead || /^[-+]?[\d.]+( ms)?$/.test(text) || text === '-')) cell.className = 'number';
    row.append(cell);
  });
  return row;
};

takt.swatches = function (id, entries) {
  const legend = document.getElementById(id);
  legend.replaceChildren();
  for (const [colour, text] of entries) {
    const swatch = document.createElement('span');
    swatch.className = 'swatch';
    swatch.style.background = colour;
    legend.append(swatch, text);
  }
};

takt.tables = (function () {
  function text(id, value) { document.getElementById(id).textContent = value; }

  function head(facts) {
    const metrics = facts.metrics;
    text('title', 'Run ' + metrics.run_id);
    document.title = 'Takt: ' + metrics.run_id;
    text('subtitle', `${metrics.robot}, ${metrics.ticks.recorded} ticks from ${facts.started}, ` +
      (metrics.realtime === true ? 'real-time' : metrics.realtime === false ? 'NOT real-time' : 'real-time unknown') +
      (facts.host ? `, ${facts.host.cpu}, ${facts.host.kernel}` : '') + (facts.complete ? '' : ', INCOMPLETE'));
    text('text', facts.text);
  }

  // What stopped it, as far as the run's own files say.
  function stopped(incident) {
    const dead = incident.ended_process ? `: ${incident.ended_process}` : '';
    if (incident.scripted) return `Stopped as scripted by ${incident.scripted.replace(/, [^,]*$/, '')}${dead}`;
    if (incident.asked) return 'Stopped as asked';
    return `Stopped by itself: ${incident.cause.replaceAll('_', ' ')}` + (incident.where ? `, ${incident.where}` : '') + dead;
  }

  // Red: nothing below may be read as if there had been nothing more.
  function gap(metrics) {
    if (!metrics.record_gap) return;
    const box = document.createElement('div');
    box.className = 'incident fault';
    const name = document.createElement('b');
    name.textContent = metrics.incident_count ? 'Further stops and losses: unknown' : 'Stops and losses: unknown';
    const line = document.createElement('p');
    line.textContent = metrics.record_gap;
    box.append(name, line);
    document.getElementById('incidents').append(box);
  }

  // What stopped the robot, before what held: red when it was not requested.
  function incidents(metrics) {
    const shown = metrics.incidents.slice(0, 5);
    for (const incident of shown) {
      const box = document.createElement('div');
      box.className = 'incident' + (incident.asked ? '' : ' fault');
      const name = document.createElement('b');
      name.textContent = stopped(incident) + (incident.told_by === 'ticks.mcap' ? '' : ` (told by ${incident.told_by}, beyond the ticks that can be read)`);
      box.append(name);
      const clauses = incident.sentence.split(/(?<=; )(?=first sign |done: |clears with: )/);
      for (const clause of clauses.concat(incident.counterfactual ?? [])) {
        const line = document.createElement('p');
        const [, label, rest] = clause.match(/^(first sign|done:|clears with:|by replay:)?(.*?)(?:; )?$/s);
        const name = document.createElement('i');
        name.textContent = label ?? '';
        line.append(name, rest);
        box.append(line);
      }
      document.getElementById('incidents').append(box);
    }
    if (metrics.incident_count > shown.length) document.getElementById('incidents').append(`and ${metrics.incident_count - shown.length} more: see the report below`);
  }

  function verdict(title, misses, confidence) {
    const box = document.createElement('div');
    const isJudged = misses.count > 0;
    box.className = 'verdict' + (isJudged ? ' ' + misses.verdict : '');
    const [name, word, numbers] = ['span', 'b', 'span'].map((tag) => document.createElement(tag));
    name.textContent = title;
    word.textContent = isJudged ? 'freshness ' + misses.verdict : 'nothing to judge';
    numbers.textContent = !isJudged ? 'the robot never relied on the policy' :
      `${misses.misses} of ${misses.count} missed, at most ${(100 * misses.upper_bound).toFixed(3)} % with ${100 * confidence} % confidence`;
    box.append(name, word, numbers);
    document.getElementById('verdicts').append(box);
  }

  function comparison(found) {
    if (!found) {
      document.getElementById('comparison-section').remove();
      return;
    }
    text('comparison-note', `${found.other_id}, started ${found.other_started}` +
      (found.same_contract ? '' : '; another contract: a miss is not the same thing in both'));
    const isNone = (value) => value === null;
    const number = (value) => (isNone(value) ? '-' : Number.isInteger(value) ? String(value) : value.toFixed(3));
    const table = document.getElementById('comparison');
    table.append(takt.row(['', 'other', 'this', 'difference', ''], true));
    for (const [label, unit, other, here] of found.rows) {
      if (other === here && !here) continue;  // both nothing, or both 0
      const difference = isNone(other) || isNone(here) ? null : here - other;
      table.append(takt.row([label, number(other), number(here), (difference > 0 ? '+' : '') + number(difference), unit]));
    }
  }

  return function (facts) {
    const { contract, deadline_misses: misses } = facts.metrics;
    head(facts);
    incidents(facts.metrics);
    gap(facts.metrics);
    verdict(`per tick: Pr(age > ${contract.max_age_ns * 1e-6} ms) <= ${100 * contract.epsilon} %`, misses.per_tick, contract.confidence);
    verdict('per command', misses.per_command, contract.confidence);
    text('together', facts.together);
    comparison(facts.comparison);
  };
})();
