// SPDX-License-Identifier: Apache-2.0
// Lanes over time: one row per mode band, kind of intervention or bus, painted where something is.
takt.lanes = (function () {
  // What a lane shows in one pixel column, gathered from the rows of samples that fall there.
  // levelsOf(block) -> row -> per lane a number, 0: nothing, or null for none at all; of several rows the largest counts.
  function columnsOf(samples, graph, area, from, to, laneCount, levelsOf) {
    const columns = Array.from({ length: laneCount }, () => new Float32Array(Math.ceil(area.w) + 1));
    const left = graph.toDomXCoord(from);
    const scale = (graph.toDomXCoord(to) - left) / (to - from);
    for (const { block, first, end } of samples.pieces(from, to)) {
      const levelsAt = levelsOf(block);
      for (let row = first; row < end; ++row) {
        const levels = levelsAt(row);
        if (!levels) continue;
        const starts = Math.floor(left + (block.times[row] - from) * scale - area.x);
        const behind = row + 1 < end ? Math.ceil(left + (block.times[row + 1] - from) * scale - area.x) : starts + 1;
        for (let x = Math.max(starts, 0); x < Math.min(Math.max(behind, starts + 1), area.w); ++x) {
          for (let lane = 0; lane < laneCount; ++lane) columns[lane][x] = Math.max(columns[lane][x], levels[lane]);
        }
      }
    }
    return columns;
  }

  // names: of the lanes, top first. styleOf(level): [colour, share of the lane's height] of a painted column.
  return function (id, view, samples, names, levelsOf, styleOf, valuesAt) {
    const count = names.length;
    const paint = (context, area, graph) => {
      if (area.w <= 0) return;  // less room than the margins take: drawn anew once there is more
      const [from, to] = graph.xAxisRange();
      const columns = columnsOf(samples, graph, area, from, to, count, levelsOf);
      const height = area.h / Math.max(count, 1);
      for (let lane = 0; lane < count; ++lane) {
        for (let x = 0; x < area.w; ++x) {
          if (columns[lane][x] === 0) continue;
          const [colour, share] = styleOf(columns[lane][x]);
          const filled = share * (height - 4);
          context.fillStyle = colour;
          context.fillRect(area.x + x, area.y + (lane + 1) * height - 2 - filled, 1, filled);
        }
      }
    };
    return takt.chart(id, view, (from, to) => [[from, null], [to, null]], {
      labels: ['s', 'lanes'], valueRange: [0, Math.max(count, 1)], underlayCallback: paint, valuesAt,
      yAxis: { drawGrid: false, ticker: () => names.map((label, lane) => ({ v: count - lane - 0.5, label })) },
    });
  };
})();

takt.modeLane = function (view, modes, valuesAt) {
  // The number of each mark on a flag at its line.
  const paintFlags = (context, area, graph) => {
    view.marks.forEach((time, index) => {
      const x = graph.toDomXCoord(time), text = String(index + 1), width = context.measureText(text).width + 8;
      if (x < area.x || x > area.x + area.w) return;
      context.fillStyle = takt.colour('ink');
      context.fillRect(x, area.y, width, 15);
      context.fillStyle = takt.colour('paper');
      context.fillText(text, x + 4, area.y + 12);
    });
  };
  const paint = (context, area, graph) => {
    context.font = '12px sans-serif';
    for (const [from, to, mode] of modes) {
      const left = Math.max(graph.toDomXCoord(from), area.x), right = Math.min(graph.toDomXCoord(to), area.x + area.w);
      if (right < area.x || left > area.x + area.w) continue;
      context.fillStyle = takt.colour(mode);
      context.fillRect(left, area.y, Math.max(right - left, 1), area.h);
      if (right - left > 8 * mode.length) {
        context.fillStyle = takt.colour('ink');
        context.fillText(mode.replaceAll('_', ' '), left + 6, area.y + area.h / 2 + 4);
      }
    }
    paintFlags(context, area, graph);
  };
  return takt.chart('modes', view, (from, to) => [[from, null], [to, null]], {
    labels: ['s', 'mode'], valueRange: [0, 1], underlayCallback: paint, valuesAt, yAxis: { drawGrid: false, ticker: () => [] } });
};

takt.interventionLanes = function (view, samples, kinds, valuesAt) {
  const levels = new Float32Array(kinds.length);
  const levelsOf = (block) => {
    const masks = block.column('interventions');
    return (row) => {
      if (!(masks[row] > 0)) return null;
      for (let kind = 0; kind < kinds.length; ++kind) levels[kind] = masks[row] >> kind & 1;
      return levels;
    };
  };
  return takt.lanes('interventions', view, samples, kinds.map((kind) => kind.replaceAll('_', ' ')), levelsOf,
    () => [takt.colour('data'), 1], valuesAt);
};

// Two lanes per bus: its state, and frames that were dropped or foreign.
takt.busLanes = function (view, samples, buses, valuesAt) {
  const names = buses.flatMap((bus) => [bus + ' state', bus + ' errors']);
  const levels = new Float32Array(names.length);
  const kErrors = takt.busStates.length;  // level of a lane with errors, above those of states
  const styleOf = (level) => {
    if (level >= kErrors) return [takt.colour('violated'), 1];
    const state = Math.floor(level);
    return [takt.colour(takt.busStates[state].colour), (state + 1) / takt.busStates.length];
  };
  const levelsOf = (block) => {
    const states = buses.map((bus, index) => block.column(`bus${index}.state`));
    const errors = buses.map((bus, index) => block.column(`bus${index}.errors`));
    return (row) => {
      for (let bus = 0; bus < buses.length; ++bus) {
        levels[2 * bus] = states[bus][row] >= 0 ? states[bus][row] + 0.5 : 0;
        levels[2 * bus + 1] = errors[bus][row] > 0 ? kErrors : 0;
      }
      return levels;
    };
  };
  return takt.lanes('buses', view, samples, names, levelsOf, styleOf, valuesAt);
};
