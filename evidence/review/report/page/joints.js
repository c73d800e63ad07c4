// SPDX-License-Identifier: Apache-2.0
// Every joint at the cursor in numbers, beside its limits; one joint, or all of them, over time.
takt.joints = (function () {
  const number = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits).replace(/^-(?=0\.?0*$)/, '') : '-');
  // lines(joint): [column, spread or null, name]; limits(joint): values.
  const quantities = {
    position: { unit: 'rad', slide: 'm', digits: 4, limits: (joint) => [joint.q_min, joint.q_max],
      lines: (index) => [['q' + index, `q${index}.spread`, 'measured'], ['reference' + index, `reference${index}.spread`, 'setpoint'], ['target' + index, null, 'policy target']] },
    velocity: { unit: 'rad/s', slide: 'm/s', digits: 3, limits: (joint) => [-joint.velocity, joint.velocity], lines: (index) => [['dq' + index, null, 'estimated']] },
    torque: { unit: 'Nm', slide: 'N', digits: 2, limits: (joint) => [-joint.torque, joint.torque], lines: (index) => [['tau' + index, null, 'as the drive reports it']] },
    temperature: { unit: '°C', digits: 0, limits: () => [], lines: (index) => [['temperature' + index, null, 'hottest part']] },
    stiffness: { unit: 'Nm/rad', slide: 'N/m', digits: 1, limits: () => [], lines: (index) => [['kp' + index, null, 'told to the drive']] },
    damping: { unit: 'Nm s/rad', slide: 'N s/m', digits: 2, limits: () => [], lines: (index) => [['kd' + index, null, 'told to the drive']] },
  };

  // Of some joints; a slide's differ.
  function unitOf(quantity, joints) {
    const slides = joints.filter((joint) => joint.slides).length;
    if (!slides || !quantity.slide) return quantity.unit;
    return slides === joints.length ? quantity.slide : `${quantity.unit}, ${quantity.slide}`;
  }

  // A value, its limits in small, and whether it is beyond them.
  function cell(value, digits, low, high) {
    const cell = document.createElement('td');
    cell.className = 'number';
    cell.textContent = number(value, digits);
    if (low === undefined) return cell;
    const limits = document.createElement('small');
    limits.textContent = low === -high ? ` of ±${+high.toPrecision(4)}` : ` of ${+low.toPrecision(4)} to ${+high.toPrecision(4)}`;
    cell.append(limits);
    cell.classList.toggle('beyond', value < low || value > high);
    return cell;
  }

  function table(facts, samples, view) {
    const unit = (name) => unitOf(quantities[name], facts.joints);
    const head = ['joint', `position, ${unit('position')}`, 'setpoint', 'policy', `velocity, ${unit('velocity')}`, `torque, ${unit('torque')}`, '°C',
      `kp, ${unit('stiffness')}`, `kd, ${unit('damping')}`];
    const draw = () => {
      const place = samples.at(view.cursor);
      const value = (name, spread) => samples.value(place, name, spread);
      const rows = facts.joints.map((joint, index) => {
        const row = takt.row([joint.name]);
        const told = (name, configured) => {
          const made = cell(value(name + index), 1 + (configured < 10));
          const small = document.createElement('small');
          small.textContent = ` (${+configured.toPrecision(4)})`;
          made.append(small);
          return made;
        };
        const temperature = value('temperature' + index);
        row.append(cell(value('q' + index, `q${index}.spread`), 4, joint.q_min, joint.q_max), cell(value('reference' + index, `reference${index}.spread`), 4),
          cell(value('target' + index), 4), cell(value('dq' + index), 3, -joint.velocity, joint.velocity), cell(value('tau' + index), 2, -joint.torque, joint.torque),
          cell(temperature === 0 ? NaN : temperature, 0), told('kp', joint.kp), told('kd', joint.kd));
        return row;
      });
      document.getElementById('joints').replaceChildren(takt.row(head, true), ...rows);
    };
    view.on('cursor', draw);
    draw();
  }

  function chart(facts, samples, view) {
    const [select, quantity] = ['joint', 'quantity'].map((id) => document.getElementById(id));
    facts.joints.forEach((joint, index) => select.add(new Option(joint.name, index)));
    if (facts.joints.length > 1) select.add(new Option('all joints', 'all'));
    quantity.append(...Object.keys(quantities).map((name) => new Option(name, name)));
    const chosen = () => quantities[quantity.value];
    const isAll = () => select.value === 'all';
    const lines = () => (isAll() ? facts.joints.map((joint, index) => chosen().lines(index)[0].with(2, joint.name)) : chosen().lines(select.value));
    const colours = () => (isAll() ? facts.joints.map((_, index) => takt.jointColour(index)) : ['data', 'second', 'third'].map(takt.colour));
    const limits = () => (isAll() || !facts.joints.length ? [] : chosen().limits(facts.joints[select.value]));
    const unit = () => unitOf(chosen(), isAll() ? facts.joints : [facts.joints[select.value]]);
    const limitText = (value) => `limit ${+value.toPrecision(4)} ${unit()}`;
    const valuesAt = (time) => {
      const place = samples.at(time);
      return lines().map(([name, spread, label]) => [label, `${number(samples.value(place, name, spread), chosen().digits)} ${unit()}`]);
    };
    const look = () => ({ labels: ['s'].concat(lines().map(([, , name]) => name)), colors: colours(), ylabel: unit() });
    const legend = () => {
      takt.swatches('tracking-legend', lines().map(([, , name], index) => [colours()[index], name]));
      if (limits().length) document.getElementById('tracking-legend').append(`; limits ${limits().map((value) => +value.toPrecision(4)).join(' and ')} ${unit()}, dashed where in view`);
    };
    const options = Object.assign({ customBars: true, valuesAt, underlayCallback: takt.underlay(facts.modes, () => limits().map((value) => ({ value, text: limitText(value) }))) }, look());
    const made = takt.chart('tracking', view, (from, to) => samples.bands(from, to, lines()), options, () => ({ colors: colours() }));
    const change = () => {
      Object.assign(options, look());
      made.reload(look());
      legend();
    };
    select.addEventListener('change', change);
    quantity.addEventListener('change', change);
    takt.theme.onChange(legend);
    legend();
  }

  return function (facts, samples, view) {
    chart(facts, samples, view);
    table(facts, samples, view);
  };
})();
