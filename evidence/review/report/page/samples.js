// SPDX-License-Identifier: Apache-2.0
// Samples of a stretch of time out of the two levels of detail: every tick where the moments hold it, buckets elsewhere.
takt.Samples = (function () {
  const kPoints = 1200;       // a chart is not wider
  const kTooWideRows = 6000;  // of buckets: single ticks could not be seen

  // First row at or behind `time`.
  function lowerBound(times, time) {
    let low = 0, high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  // Stretches of the moments without a hole: [first row, row behind the last].
  function stretchesOf(times, longestGap) {
    const stretches = [];
    for (let row = 0, first = 0; row < times.length; ++row) {
      const ends = row + 1 === times.length || times[row + 1] - times[row] > longestGap;
      if (!ends) continue;
      stretches.push([first, row + 1]);
      first = row + 1;
    }
    return stretches;
  }

  // row -> whether it marks ticks that were not recorded: such a row holds nothing, where every other has this column.
  function gapsOf(block) {
    const masks = block.column('interventions');
    return (row) => Number.isNaN(masks[row]);
  }

  return class Samples {
    constructor(whole, moments, period) {
      this.whole = whole;
      this.moments = moments;
      this.stretches = stretchesOf(moments.times, 10 * period);
    }

    has(name) { return this.whole.has(name); }

    // Ranges of rows that together cover [from, to], in order: {block, first, end}.
    pieces(from, to) {
      const times = this.whole.times;
      const first = Math.max(lowerBound(times, from) - 1, 0);
      const end = Math.min(lowerBound(times, to) + 1, this.whole.rows);
      if (end - first > kTooWideRows) return [{ block: this.whole, first, end }];
      const pieces = [];
      let next = first;
      for (const [begin, behind] of this.stretches) {
        const starts = this.moments.times[begin], stops = this.moments.times[behind - 1];
        if (stops < from || starts > to) continue;
        const before = Math.min(lowerBound(times, starts), end);
        if (before > next) pieces.push({ block: this.whole, first: next, end: before });
        const inside = { first: Math.max(lowerBound(this.moments.times, from) - 1, begin),
                         end: Math.min(lowerBound(this.moments.times, to) + 1, behind) };
        pieces.push({ block: this.moments, ...inside });
        next = Math.max(next, lowerBound(times, stops));
      }
      if (end > next) pieces.push({ block: this.whole, first: next, end });
      return pieces;
    }

    // Rows of [from, to] in groups, at most about kPoints of them: calls group(block, first, end) for each. What was not
    // recorded is a group of its own, so that nothing is drawn across it.
    groups(from, to, group) {
      const pieces = this.pieces(from, to);
      const rows = pieces.reduce((sum, piece) => sum + piece.end - piece.first, 0);
      const size = Math.max(1, Math.ceil(rows / kPoints));
      for (const { block, first, end } of pieces) {
        const isGap = gapsOf(block);
        for (let row = first, behind; row < end; row = behind) {
          behind = row + 1;
          while (!isGap(row) && behind < Math.min(row + size, end) && !isGap(behind)) ++behind;
          group(block, row, behind);
        }
      }
    }

    // For charts with a band: [[time, [least, middle, most], ...]]; lines: [name of least, name of spread or null].
    bands(from, to, lines) {
      const out = [];
      this.groups(from, to, (block, first, end) => {
        const row = [block.times[first]];
        for (const [name, spread] of lines) row.push(bandOf(block, first, end, name, spread));
        out.push(row);
      });
      return out;
    }

    // For stacked charts: [[time, value, ...]] of each group's row where `least` + `spread` reaches highest.
    atLargest(from, to, names, [least, spread]) {
      const out = [];
      this.groups(from, to, (block, first, end) => {
        const [lowest, above] = [block.column(least), block.column(spread)];
        let best = first, most = -Infinity;
        for (let row = first; row < end; ++row) {
          const value = lowest[row] + above[row];
          if (!(value > most)) continue;  // nor is NaN
          best = row;
          most = value;
        }
        out.push([block.times[first]].concat(names.map((name) => finite(block.column(name)[best]))));
      });
      return out;
    }

    // The row in force at `time`: {block, row, isRecorded}; where nothing was recorded its values are NaN.
    at(time) {
      const isInMoments = this.stretches.some(([begin, behind]) => this.moments.times[begin] <= time && time <= this.moments.times[behind - 1]);
      const block = isInMoments ? this.moments : this.whole;
      const row = lastNotAfter(block.times, time);
      return { block, row, isRecorded: !gapsOf(block)(row) };
    }

    // Middle of the band, or the value.
    value(place, name, spread) {
      const value = place.block.column(name)[place.row];
      return spread ? value + place.block.column(spread)[place.row] / 2 : value;
    }
  };

  function finite(value) { return Number.isFinite(value) ? value : null; }

  function lastNotAfter(times, time) { return Math.max(lowerBound(times, time + 1e-9) - 1, 0); }

  function bandOf(block, first, end, name, spread) {
    const values = block.column(name);
    const above = spread ? block.column(spread) : null;
    let least = Infinity, most = -Infinity;
    for (let row = first; row < end; ++row) {
      const value = values[row];
      if (!(value === value)) continue;  // NaN
      least = Math.min(least, value);
      most = Math.max(most, above ? value + above[row] : value);
    }
    return least > most ? [null, null, null] : [least, (least + most) / 2, most];
  }
})();
