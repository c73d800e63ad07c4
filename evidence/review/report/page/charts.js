// SPDX-License-Identifier: Apache-2.0
// Charts over time that share one view: zoomed, moved and pointed at together.
takt.chart = (function () {
  const yAxisWidth = () => (innerWidth < 600 ? 96 : 116);  // the same for all, so that times stand one above the other
  const timeText = (seconds) => +seconds.toFixed(5) + ' s';

  function addCursor(graph, div, view) {
    const line = document.createElement('div');
    line.className = 'cursor-line';
    div.append(line);
    const place = () => {
      const isInside = view.from <= view.cursor && view.cursor <= view.to;
      line.style.display = isInside ? '' : 'none';
      if (isInside) line.style.left = graph.toDomXCoord(view.cursor) + 'px';
    };
    view.on('cursor', place);
    view.on('window', place);
    addEventListener('resize', place);
    place();
  }

  // Upright and dotted, which nothing else on a chart is: a mark needs no colour to be told from a mode's edge.
  function paintMarks(context, area, graph, marks) {
    context.save();
    context.strokeStyle = takt.colour('ink');
    context.setLineDash([2, 3]);
    for (const time of marks) {
      const x = graph.toDomXCoord(time);
      if (x < area.x || x > area.x + area.w) continue;
      context.beginPath();
      context.moveTo(x, area.y);
      context.lineTo(x, area.y + area.h);
      context.stroke();
    }
    context.restore();
  }

  // What the chart holds at the time under the pointer, beside the pointer.
  function addPointer(graph, div, valuesAt) {
    const box = document.getElementById('pointer');
    const hide = () => { box.hidden = true; };
    div.addEventListener('pointerleave', hide);
    div.addEventListener('pointermove', (event) => {
      const area = graph.getArea(), frame = div.getBoundingClientRect();
      const x = event.clientX - frame.left;
      if (x < area.x || x > area.x + area.w) return hide();
      const time = graph.toDataXCoord(x);
      box.replaceChildren(takt.row([timeText(time), '']), ...valuesAt(time).map((row) => takt.row(row)));
      box.hidden = false;
      const isRight = event.clientX > innerWidth / 2;
      box.style.left = isRight ? 'auto' : event.clientX + 16 + 'px';
      box.style.right = isRight ? innerWidth - event.clientX + 16 + 'px' : 'auto';
      box.style.top = Math.min(event.clientY + 12, innerHeight - box.offsetHeight - 8) + 'px';
    });
  }

  // Gestures of the chart become changes of the view; a double click shows all of the run, not all that is loaded.
  function gestures(view) {
    const model = Object.assign({}, Dygraph.defaultInteractionModel);
    model.dblclick = () => view.whole();
    return model;
  }

  // rowsOf(from, to): what the chart shows of that time, with something on both sides to move into.
  // options.heightOf(row), options.alwaysHigh: a chart from 0 that holds the rows in view, and at least that value; where
  // they reach far beyond it, options.rescaled(row, to) is the row on the broken scale. options.valuesAt(time): [name, text]
  // of what stands there, for the pointer.
  // themed(): options that depend on the theme.
  return function (id, view, rowsOf, options, themed) {
    const div = document.getElementById(id);
    const empty = (from, to) => [from, to].map((time) => [time].concat(options.labels.slice(1).map(() => options.customBars ? [null, null, null] : null)));
    const rows = () => {
      const margin = (view.to - view.from) / 2;
      const found = rowsOf(Math.max(view.from - margin, 0), Math.min(view.to + margin, view.end));
      return found.length ? found : empty(view.from, view.to);
    };
    let scale = takt.straightScale;
    const content = () => {
      const file = rows();
      if (!options.heightOf) return { file };
      const highest = file.reduce((most, row) => (view.from <= row[0] && row[0] <= view.to ? Math.max(most, options.heightOf(row)) : most), options.alwaysHigh);
      scale = takt.scaleFor(options.alwaysHigh, 1.1 * highest);
      return { file: scale.isBroken ? file.map((row) => options.rescaled(row, scale.to)) : file, valueRange: [0, scale.to(1.1 * highest)] };
    };
    const yTicks = (low, high, pixels, ...rest) => (scale.isBroken ? scale.ticks(pixels) : Dygraph.numericTicks(low, high, pixels, ...rest));
    const look = () => Object.assign({ gridLineColor: takt.colour('grid'), axisLineColor: takt.colour('line') }, themed ? themed() : {});
    const underlay = (context, area, drawn) => {
      if (options.underlayCallback) options.underlayCallback(context, area, drawn, scale);
      paintMarks(context, area, drawn, view.marks);
    };
    let isUpdating = true;
    const { file, ...range } = content();
    const graph = new Dygraph(div, file, Object.assign({
      dateWindow: [view.from, view.to], strokeWidth: 1.2, animatedZooms: false, legend: 'never', xlabel: '',
      interactionModel: gestures(view), connectSeparatedPoints: false, fillAlpha: 0.3,
      clickCallback: (event) => view.setCursor(graph.toDataXCoord(graph.eventToDomCoords(event)[0])),
      drawCallback: (drawn) => {
        if (isUpdating) return;
        const [from, to] = drawn.xAxisRange();
        view.setWindow(from, to);
      },
    }, look(), options, range, {
      underlayCallback: underlay,
      axes: { x: { axisLabelFormatter: timeText, valueFormatter: timeText },
              y: Object.assign({ axisLabelWidth: yAxisWidth() }, options.heightOf ? { ticker: yTicks } : {}, options.yAxis || {}) } }));
    const update = (changes) => {
      isUpdating = true;
      graph.updateOptions(changes);
      isUpdating = false;
    };
    isUpdating = false;
    view.on('window', () => update(Object.assign(content(), { dateWindow: [view.from, view.to] })));
    takt.theme.onChange(() => update(look()));
    addCursor(graph, div, view);
    if (options.valuesAt) addPointer(graph, div, options.valuesAt);
    return { graph, reload: (changes) => update(Object.assign(content(), changes)) };
  };
})();

takt.straightScale = { isBroken: false, to: (value) => value };

// Up to twice the limit a straight scale; where values reach more than twice as far, the upper third is logarithmic, so
// that one long loss does not flatten the rest.
takt.scaleFor = function (limit, top) {
  const knee = 2 * limit, kStraight = 2 / 3;
  if (top <= 2 * knee) return takt.straightScale;
  const to = (value) => (value <= knee ? kStraight * value / knee : kStraight + (1 - kStraight) * Math.log(value / knee) / Math.log(top / knee));
  const decade = (value) => 10 ** Math.floor(Math.log10(value));
  function values() {
    const step = [1, 2, 5, 10].map((each) => each * decade(knee / 4)).find((each) => each >= knee / 4);
    const straight = Array.from({ length: Math.floor(knee / step) + 1 }, (_, index) => index * step);
    const bent = [];
    for (let power = decade(knee); power < top; power *= 10) bent.push(...[1, 1.5, 2, 3, 5, 7].map((each) => each * power));
    return straight.concat(bent.filter((value) => value > knee && value <= top));
  }
  // The highest first: it says how far the chart reaches.
  const ticks = (pixels) => values().reverse().reduce((kept, value) =>
    (kept.length && (kept.at(-1).v - to(value)) * pixels < 16 ? kept : kept.concat({ v: to(value), label: String(+value.toPrecision(3)) })), []);
  return { isBroken: true, knee, to, ticks };
};

// Modes as a tint behind a chart; limits as dashed lines, in no colour of alarm: a limit that holds is none.
takt.underlay = function (modes, limitsOf) {
  const line = (context, area, y, text) => {
    context.setLineDash([6, 4]);
    context.beginPath();
    context.moveTo(area.x, y);
    context.lineTo(area.x + area.w, y);
    context.stroke();
    context.fillText(text, area.x + 6, y - 5);
  };
  return function (context, area, graph, scale) {
    context.save();
    context.globalAlpha = 0.13;
    for (const [from, to, mode] of modes) {
      const left = Math.max(graph.toDomXCoord(from), area.x), right = Math.min(graph.toDomXCoord(to), area.x + area.w);
      if (right <= left) continue;
      context.fillStyle = takt.colour(mode);
      context.fillRect(left, area.y, right - left, area.h);
    }
    context.globalAlpha = 1;
    context.font = '12px sans-serif';
    context.strokeStyle = context.fillStyle = takt.colour('limit');
    for (const { value, text } of limitsOf ? limitsOf() : []) {
      const y = graph.toDomYCoord(scale.to(value));
      if (y > area.y && y < area.y + area.h) line(context, area, y, text);
    }
    if (scale.isBroken) {
      context.strokeStyle = context.fillStyle = takt.colour('quiet');
      const text = `logarithmic above ${scale.knee} ms`;
      line(context, area, graph.toDomYCoord(scale.to(scale.knee)), '');
      context.fillText(text, area.x + area.w - context.measureText(text).width - 6, graph.toDomYCoord(scale.to(scale.knee)) - 5);
    }
    context.restore();
  };
};
