// The classifier's verdicts as a list; a row takes the page to its moment.
takt.Violations = (function () {
  const kHalfWidth = 0.75;  // s in view on both sides of a violation

  return class Violations {
    constructor(facts, view) {
      this.list = facts.violations;
      this.view = view;
      this.rows = this.list.map((violation) => {
        const row = takt.row([violation.at_s.toFixed(3) + ' s', violation.fault.replaceAll('_', ' '),
          violation.sentence.replace(/^[a-z_]+: /, '')]);
        row.addEventListener('click', () => this.show(violation));
        return row;
      });
      const table = document.getElementById('violations');
      table.append(...this.rows);
      if (this.list.length === 0) table.append(takt.row(['none']));
      document.getElementById('violation-count').textContent = `(${this.list.length})`;
      view.on('cursor', () => this.mark());
    }

    show(violation) {
      this.view.play(false);
      this.view.jump(violation.at_s, kHalfWidth);
      this.rows[this.list.indexOf(violation)].scrollIntoView({ block: 'nearest' });
    }
    next() { this.showIf(this.list.find((violation) => violation.at_s > this.view.cursor + 1e-6)); }
    previous() { this.showIf(this.list.findLast((violation) => violation.at_s < this.view.cursor - 1e-6)); }
    showIf(violation) { if (violation) this.show(violation); }

    mark() {
      this.list.forEach((violation, index) => {
        this.rows[index].className = Math.abs(violation.at_s - this.view.cursor) < 1e-6 ? 'current' : '';
      });
    }
  };
})();
