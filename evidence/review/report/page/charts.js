// Charts over time that share one view: zoomed, moved and pointed at together.
takt.chart = (function () {
  const kYAxisWidth = 116;  // the same for all, so that times stand one above the other
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

  // Gestures of the chart become changes of the view; a double click shows all of the run, not all that is loaded.
  function gestures(view) {
    const model = Object.assign({}, Dygraph.defaultInteractionModel);
    model.dblclick = () => view.whole();
    return model;
  }

  // rowsOf(from, to): what the chart shows of that time, with something on both sides to move into.
  // options.heightOf(row), options.alwaysHigh: a chart from 0 that holds the rows in view, and at least that value.
  // themed(): options that depend on the theme.
  return function (id, view, rowsOf, options, themed) {
    const div = document.getElementById(id);
    const empty = (from, to) => [from, to].map((time) => [time].concat(options.labels.slice(1).map(() => options.customBars ? [null, null, null] : null)));
    const rows = () => {
      const margin = (view.to - view.from) / 2;
      const found = rowsOf(Math.max(view.from - margin, 0), Math.min(view.to + margin, view.end));
      return found.length ? found : empty(view.from, view.to);
    };
    const content = () => {
      const file = rows();
      if (!options.heightOf) return { file };
      const highest = file.reduce((most, row) => (view.from <= row[0] && row[0] <= view.to ? Math.max(most, options.heightOf(row)) : most), options.alwaysHigh);
      return { file, valueRange: [0, 1.1 * highest] };
    };
    const look = () => Object.assign({ gridLineColor: takt.colour('grid'), axisLineColor: takt.colour('line') }, themed ? themed() : {});
    const underlay = (context, area, drawn) => {
      if (options.underlayCallback) options.underlayCallback(context, area, drawn);
      paintMarks(context, area, drawn, view.marks);
    };
    let isUpdating = true;
    const { file, ...scale } = content();
    const graph = new Dygraph(div, file, Object.assign({
      dateWindow: [view.from, view.to], strokeWidth: 1.2, animatedZooms: false, legend: 'never', xlabel: '',
      interactionModel: gestures(view), connectSeparatedPoints: false, fillAlpha: 0.3,
      clickCallback: (event) => view.setCursor(graph.toDataXCoord(graph.eventToDomCoords(event)[0])),
      drawCallback: (drawn) => {
        if (isUpdating) return;
        const [from, to] = drawn.xAxisRange();
        view.setWindow(from, to);
      },
    }, look(), options, scale, {
      underlayCallback: underlay,
      axes: { x: { axisLabelFormatter: timeText, valueFormatter: timeText },
              y: Object.assign({ axisLabelWidth: kYAxisWidth }, options.yAxis || {}) } }));
    const update = (changes) => {
      isUpdating = true;
      graph.updateOptions(changes);
      isUpdating = false;
    };
    isUpdating = false;
    view.on('window', () => update(Object.assign(content(), { dateWindow: [view.from, view.to] })));
    takt.theme.onChange(() => update(look()));
    addCursor(graph, div, view);
    return { graph, reload: (changes) => update(Object.assign(content(), changes)) };
  };
})();

// Modes as a tint behind a chart, and a limit as a dashed line.
takt.underlay = function (modes, limit) {
  return function (context, area, graph) {
    context.save();
    context.globalAlpha = 0.13;
    for (const [from, to, mode] of modes) {
      const left = Math.max(graph.toDomXCoord(from), area.x), right = Math.min(graph.toDomXCoord(to), area.x + area.w);
      if (right <= left) continue;
      context.fillStyle = takt.colour(mode);
      context.fillRect(left, area.y, right - left, area.h);
    }
    context.globalAlpha = 1;
    if (limit) {
      const y = graph.toDomYCoord(limit.value);
      context.strokeStyle = context.fillStyle = takt.colour('limit');
      context.setLineDash([6, 4]);
      context.beginPath();
      context.moveTo(area.x, y);
      context.lineTo(area.x + area.w, y);
      context.stroke();
      context.font = '12px sans-serif';
      context.fillText(limit.text, area.x + 6, y - 5);
    }
    context.restore();
  };
};
