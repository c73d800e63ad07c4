// SPDX-License-Identifier: Apache-2.0
// A list of moments of the run: the classifier's verdicts, or the operator's marks. A row takes the page to its moment.
// Rows may stand in another order than that of time, and what is alike may share one row that opens; keys follow the time.
takt.Moments = (function () {
  const kHalfWidth = 0.75;  // s in view on both sides of a moment
  const kSame = 1e-6;       // s

  return class Moments {
    // list: [{at_s, ...}] in order, of `count` there are; cellsOf(moment, its number from 1): what stands behind its time.
    // arranged(list): [{moments, cells}] in the order of rows; several moments are one row with these cells.
    constructor(id, list, count, view, cellsOf, arranged = (all) => all.map((moment) => ({ moments: [moment] }))) {
      this.list = list;
      this.view = view;
      this.openers = new Map();  // row that may be hidden -> opens the row it is under
      this.rows = list.map((moment, index) => this.row(moment, cellsOf(moment, index + 1)));
      const shown = arranged(list).flatMap(({ moments, cells }) => {
        const rows = moments.map((moment) => this.rows[list.indexOf(moment)]);
        return rows.length > 1 ? this.group(rows, cells) : rows;
      });
      document.querySelector(`#${id} tbody`).append(...shown);
      document.getElementById(id).closest('section').hidden = count === 0;
      document.getElementById(id + '-count').textContent = list.length < count ? `(the first ${list.length} of ${count})` : `(${count})`;
      view.on('cursor', () => this.showCurrent());
    }

    row(moment, cells) {
      const row = takt.row([''].concat(cells));
      const time = document.createElement('button');  // reached by the tab key
      time.textContent = moment.at_s.toFixed(3) + ' s';
      row.firstChild.append(time);
      row.addEventListener('click', () => this.jumpTo(moment));
      return row;
    }

    group(rows, cells) {
      const head = takt.row([''].concat(cells));
      const button = document.createElement('button');
      const open = (isOpen) => {
        rows.forEach((row) => { row.hidden = !isOpen; });
        button.textContent = `${rows.length} times ${isOpen ? '▾' : '▸'}`;
        button.setAttribute('aria-expanded', String(isOpen));
      };
      head.firstChild.append(button);
      head.addEventListener('click', () => open(rows[0].hidden));
      open(false);
      for (const row of rows) this.openers.set(row, () => open(true));
      return [head, ...rows];
    }

    // What it goes to is in sight afterwards: its row within the list, and the chart.
    jumpTo(moment) {
      if (!moment) return;
      this.view.play(false);
      this.view.jump(moment.at_s, kHalfWidth);
      const row = this.rows[this.list.indexOf(moment)], list = row.closest('.scroll');
      this.openers.get(row)?.();
      const above = row.offsetTop - list.scrollTop, below = above + row.offsetHeight - list.clientHeight;
      list.scrollTop += above < 0 ? above : Math.max(below, 0);
      document.getElementById('age').closest('section').scrollIntoView({ block: 'nearest' });
    }
    next() { this.jumpTo(this.list.find((moment) => moment.at_s > this.view.cursor + kSame)); }
    previous() { this.jumpTo(this.list.findLast((moment) => moment.at_s < this.view.cursor - kSame)); }

    showCurrent() {
      const row = this.rows[this.list.findIndex((moment) => Math.abs(moment.at_s - this.view.cursor) < kSame)];
      if (row === this.current) return;
      if (this.current) this.current.removeAttribute('aria-current');
      if (row) row.setAttribute('aria-current', 'true');
      this.current = row;
    }
  };
})();

// What a violation came to.
takt.cameTo = { stopped: 'the robot stopped', missed: 'commands missed', late: 'no command missed' };

// Violations as rows: the gravest first; late wake-ups that cost no command are one row for each fault.
takt.byGravity = function (list) {
  const rows = ['stopped', 'missed'].flatMap((gravity) => list.filter((each) => each.gravity === gravity).map((each) => ({ moments: [each] })));
  const late = new Map();
  for (const each of list.filter(({ gravity }) => gravity === 'late')) late.set(each.fault, (late.get(each.fault) ?? []).concat(each));
  return rows.concat([...late].map(([fault, moments]) => ({ moments,
    cells: [takt.cameTo.late, fault.replaceAll('_', ' '), `the control loop woke up late, by ${Math.max(...moments.map((each) => each.lateness_ms)).toFixed(1)} ms at most`] })));
};
