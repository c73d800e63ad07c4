// SPDX-License-Identifier: Apache-2.0
// What every part of the page shares: the stretch of time in view, the cursor, whether it plays, and the times that
// the operator marked. Times are seconds since the run's first tick. Listeners are called after every change.
takt.View = (function () {
  const kNarrowest = 0.004;  // s
  const clamp = (value, least, most) => Math.min(Math.max(value, least), most);

  return class View {
    constructor(end, period, marks) {
      this.end = end;
      this.period = period;
      this.marks = marks;
      this.from = 0;
      this.to = end;
      this.cursor = 0;
      this.isPlaying = false;
      this.speed = 1;
      this.listeners = { window: [], cursor: [], playing: [] };
    }

    on(what, listener) { this.listeners[what].push(listener); }
    tell(what) { for (const listener of this.listeners[what]) listener(); }

    setWindow(from, to) {
      const width = clamp(to - from, Math.min(kNarrowest, this.end), this.end);
      const start = clamp((from + to - width) / 2, 0, this.end - width);
      if (Math.abs(start - this.from) < 1e-9 && Math.abs(start + width - this.to) < 1e-9) return;
      this.from = start;
      this.to = start + width;
      this.tell('window');
    }
    whole() { this.setWindow(0, this.end); }
    // About the cursor where it is in view, else about the middle.
    zoom(factor) {
      const about = this.from <= this.cursor && this.cursor <= this.to ? this.cursor : (this.from + this.to) / 2;
      this.setWindow(about - (about - this.from) * factor, about + (this.to - about) * factor);
    }

    setCursor(time) {
      this.cursor = clamp(time, 0, this.end);
      this.tell('cursor');
    }
    // As setCursor; the window goes along when the cursor leaves it.
    moveCursor(time) {
      this.setCursor(time);
      const width = this.to - this.from;
      if (this.cursor > this.to) this.setWindow(this.cursor - 0.1 * width, this.cursor + 0.9 * width);
      if (this.cursor < this.from) this.setWindow(this.cursor - 0.9 * width, this.cursor + 0.1 * width);
    }
    // A hundredth of what is in view, at least one tick.
    step(direction) { this.moveCursor(this.cursor + direction * Math.max((this.to - this.from) / 100, this.period)); }
    jump(time, halfWidth) {
      this.setWindow(time - halfWidth, time + halfWidth);
      this.setCursor(time);
    }

    play(isPlaying) {
      if (this.isPlaying === isPlaying) return;
      if (isPlaying && this.cursor >= this.end) this.setCursor(0);
      this.isPlaying = isPlaying;
      this.tell('playing');
      let before = null;
      const frame = (now) => {
        if (!this.isPlaying) return;
        if (before !== null) this.moveCursor(this.cursor + this.speed * (now - before) / 1000);
        before = now;
        if (this.cursor >= this.end) this.play(false);
        else requestAnimationFrame(frame);
      };
      if (isPlaying) requestAnimationFrame(frame);
    }
  };
})();
