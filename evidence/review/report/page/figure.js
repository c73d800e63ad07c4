// SPDX-License-Identifier: Apache-2.0
// The robot at the cursor: measured pose in the mode's colour, setpoint and policy target as ghosts, the task's target.
takt.figure = (function () {
  const kSide = { title: 'side', across: 0, up: 2, acrossName: 'x', upName: 'z' };
  const kTop = { title: 'top', across: 0, up: 1, acrossName: 'x', upName: 'y' };
  const kTrail = 1.0;  // s of the tool's way that led here
  const kTrailPoints = 60;
  const kMargin = 28;         // pixels
  const kExtentPoses = 200;   // looked at over the run

  // null: not known, behind the last listed stretch of a run with more of them than the page holds.
  function modeAt({ modes, metrics }, time) {
    if (modes.length && metrics.transition_count >= modes.length && time >= modes.at(-1)[1]) return null;
    let low = 0, high = modes.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (modes[middle][0] <= time) low = middle;
      else high = middle - 1;
    }
    return modes.length ? modes[low][2] : 'standby';
  }

  class Pane {
    // extent: {least, most}, the corners of what has to fit.
    constructor(context, box, projection, extent) {
      Object.assign(this, { context, box, projection });
      const spans = [projection.across, projection.up].map((axis) => extent.most[axis] - extent.least[axis]);
      this.scale = Math.min((box.width - 2 * kMargin) / spans[0], (box.height - 2 * kMargin) / spans[1]);
      this.centre = extent.least.map((least, axis) => (least + extent.most[axis]) / 2);
    }
    at(point) {
      const { across, up } = this.projection;
      return [this.box.x + this.box.width / 2 + this.scale * (point[across] - this.centre[across]),
              this.box.y + this.box.height / 2 - this.scale * (point[up] - this.centre[up])];
    }
    lines(lines, colour, width, dash) {
      const context = this.context;
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.lineCap = context.lineJoin = 'round';
      context.setLineDash(dash || []);
      context.beginPath();
      for (const [from, to] of lines) {
        context.moveTo(...this.at(from));
        context.lineTo(...this.at(to));
      }
      context.stroke();
      context.setLineDash([]);
    }
    dot(point, colour, radius) {
      this.context.fillStyle = colour;
      this.context.beginPath();
      this.context.arc(...this.at(point), radius, 0, 2 * Math.PI);
      this.context.fill();
    }
    cross(point, colour) {
      const [x, y] = this.at(point);
      const context = this.context;
      context.strokeStyle = colour;
      context.lineWidth = 2;
      context.beginPath();
      context.moveTo(x - 7, y);
      context.lineTo(x + 7, y);
      context.moveTo(x, y - 7);
      context.lineTo(x, y + 7);
      context.stroke();
    }
    frame() {
      const { context, box, projection } = this;
      context.strokeStyle = takt.colour('line');
      context.lineWidth = 1;
      context.strokeRect(box.x + 0.5, box.y + 0.5, box.width - 1, box.height - 1);
      context.fillStyle = takt.colour('quiet');
      context.font = '12px sans-serif';
      context.fillText(`${projection.title}: ${projection.acrossName} right, ${projection.upName} up`, box.x + 8, box.y + 16);
    }
  }

  return class Figure {
    constructor(facts, samples, view) {
      Object.assign(this, { facts, samples, view });
      this.canvas = document.getElementById('figure');
      this.joints = facts.joints.map((joint, index) => index);
      view.on('cursor', () => this.draw());
      takt.theme.onChange(() => this.draw());
    }

    angles(place, name, hasSpread) {
      return this.joints.map((joint) => this.samples.value(place, name + joint, hasSpread ? `${name}${joint}.spread` : null));
    }
    pose(place, name, hasSpread) { return takt.robot.pose(this.facts.figure, this.angles(place, name, hasSpread)); }

    // Everything there is to draw at the cursor; what is not known is null.
    scene() {
      const place = this.samples.at(this.view.cursor);
      const taskAxes = ['task.x', 'task.y', 'task.z'];
      const task = this.samples.has('task.x') ? taskAxes.map((axis) => place.block.column(axis)[place.row]) : [NaN];
      return {
        place,
        mode: place.isRecorded ? modeAt(this.facts, this.view.cursor) : null,
        measured: this.pose(place, 'q', true),
        setpoint: this.pose(place, 'reference', true),
        policy: this.pose(place, 'target', false),
        task: task.every(Number.isFinite) ? task : null,
      };
    }

    // Corners of all that the figure shows over the run, at least a tenth of the reach wide.
    extent() {
      const least = [0, 0, 0], most = [0, 0, 0];
      const include = (point) => point.forEach((value, axis) => {
        least[axis] = Math.min(least[axis], value);
        most[axis] = Math.max(most[axis], value);
      });
      for (let index = 0; index <= kExtentPoses; ++index) {
        const place = this.samples.at(this.view.end * index / kExtentPoses);
        const pose = this.pose(place, 'q', true);
        if (pose) pose.lines.flat().forEach(include);
        if (this.samples.has('task.x')) include(['task.x', 'task.y', 'task.z'].map((axis) => place.block.column(axis)[place.row] || 0));
      }
      const margin = 0.1 * this.facts.figure.reach;
      return { least: least.map((value) => value - margin), most: most.map((value) => value + margin) };
    }

    trail() {
      const points = [];  // null where the tool is not known: no way leads across
      for (let index = kTrailPoints; index >= 0; --index) {
        const time = this.view.cursor - index * kTrail / kTrailPoints;
        const pose = time < 0 ? null : this.pose(this.samples.at(time), 'q', true);
        points.push(pose && pose.tool);
      }
      return points.slice(1).map((point, index) => [points[index], point]).filter(([from, to]) => from && to);
    }

    panes(context, width, height) {
      this.extent_ ??= this.extent();
      if (this.facts.figure.kind === 'cart_pole') return [new Pane(context, { x: 0, y: 0, width, height }, kSide, this.extent_)];
      return [new Pane(context, { x: 0, y: 0, width, height: height / 2 }, kSide, this.extent_),
              new Pane(context, { x: 0, y: height / 2, width, height: height / 2 }, kTop, this.extent_)];
    }

    draw() {
      const scene = this.scene();
      this.readings(scene);
      const context = this.canvas.getContext('2d');
      const { width, height } = this.canvas;
      context.fillStyle = takt.colour('paper');
      context.fillRect(0, 0, width, height);
      if (!this.facts.figure) {
        context.fillStyle = takt.colour('quiet');
        context.font = '14px sans-serif';
        context.fillText('The robot file has no model: no figure.', 20, 40);
        return;
      }
      const trail = this.trail();
      for (const pane of this.panes(context, width, height)) this.drawPane(pane, scene, trail);
    }

    drawPane(pane, scene, trail) {
      pane.frame();
      pane.lines([[[-0.1, 0, 0], [0.1, 0, 0]], [[0, -0.1, 0], [0, 0.1, 0]]], takt.colour('line'), 5);
      pane.lines(trail, takt.colour('data'), 1);
      if (scene.policy) pane.lines(scene.policy.lines, takt.colour('third'), 2, [3, 4]);
      if (scene.setpoint) pane.lines(scene.setpoint.lines, takt.colour('second'), 2, [7, 4]);
      if (scene.measured) {
        pane.lines(scene.measured.lines, takt.colour(scene.mode ?? 'quiet'), 5);
        for (const [joint] of scene.measured.lines) pane.dot(joint, takt.colour('ink'), 3);
        if (scene.measured.tool) pane.dot(scene.measured.tool, takt.colour('data'), 4);
      }
      if (scene.task) pane.cross(scene.task, takt.colour('ink'));
    }

    // Numbers beside the figure.
    readings(scene) {
      const { place } = scene;
      const number = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits).replace(/^-(?=0\.0*$)/, '') : '-');
      const age = this.samples.value(place, 'age', 'age.spread');
      const mask = place.block.column('interventions')[place.row];
      const acting = this.facts.intervention_kinds.filter((kind, bit) => mask >> bit & 1);
      const rows = !place.isRecorded ? ['mode', 'age', 'interventions'].map((name) => [name, 'not recorded']) :
        [['mode', scene.mode?.replaceAll('_', ' ') ?? 'unknown'],
          ['age', Number.isFinite(age) ? number(age, 2) + ' ms' : 'none'],
          ['interventions', acting.join(', ').replaceAll('_', ' ') || 'none']];
      document.getElementById('now').replaceChildren(...rows.map((row) => takt.row(row)));
    }
  };
})();
