// A list of moments of the run: the classifier's verdicts, or what somebody marked. A row takes the page to its moment.
takt.Moments = (function () {
  const kHalfWidth = 0.75;  // s in view on both sides of a moment
  const kSame = 1e-6;       // s

  return class Moments {
    // list: [{at_s, ...}] in order, of `count` there are; cellsOf(moment, its number from 1): what stands behind its time.
    constructor(id, list, count, view, cellsOf) {
      this.list = list;
      this.view = view;
      this.rows = list.map((moment, index) => this.row(moment, cellsOf(moment, index + 1)));
      document.querySelector(`#${id} tbody`).append(...this.rows);
      document.getElementById(id).hidden = count === 0;
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

    jumpTo(moment) {
      if (!moment) return;
      this.view.play(false);
      this.view.jump(moment.at_s, kHalfWidth);
      this.rows[this.list.indexOf(moment)].scrollIntoView({ block: 'nearest' });
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
