// SPDX-License-Identifier: Apache-2.0
// Forward kinematics of the robot's file: joint angles in, lines of a stick figure out. Metres, base frame.
takt.robot = (function () {
  // Fixed-axis roll, pitch, yaw: Rz(yaw) Ry(pitch) Rx(roll), row-major.
  function rotationOfRpy([roll, pitch, yaw]) {
    const [cr, sr, cp, sp, cy, sy] = [Math.cos(roll), Math.sin(roll), Math.cos(pitch), Math.sin(pitch), Math.cos(yaw), Math.sin(yaw)];
    return [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,
            sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, -sp, cp * sr, cp * cr];
  }
  // Rodrigues' formula.
  function rotationAbout(axis, angle) {
    const length = Math.hypot(...axis);
    const [x, y, z] = axis.map((each) => each / length);
    const [c, s] = [Math.cos(angle), Math.sin(angle)], t = 1 - c;
    return [t * x * x + c, t * x * y - s * z, t * x * z + s * y,
            t * x * y + s * z, t * y * y + c, t * y * z - s * x,
            t * x * z - s * y, t * y * z + s * x, t * z * z + c];
  }
  function product(a, b) {
    const out = [];
    for (let row = 0; row < 3; ++row) {
      for (let column = 0; column < 3; ++column) {
        out.push(a[3 * row] * b[column] + a[3 * row + 1] * b[3 + column] + a[3 * row + 2] * b[6 + column]);
      }
    }
    return out;
  }
  const turned = (a, v) => [0, 3, 6].map((row) => a[row] * v[0] + a[row + 1] * v[1] + a[row + 2] * v[2]);
  const plus = (a, b) => a.map((each, index) => each + b[index]);

  function linksPose(figure, q) {
    const frames = [];
    const lines = [];
    figure.links.forEach((link, index) => {
      const parent = link.parent < 0 ? { origin: [0, 0, 0], rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1] } : frames[link.parent];
      const frame = product(parent.rotation, rotationOfRpy(link.rpy));
      const length = Math.hypot(...link.axis);
      const moved = link.slides ? turned(frame, link.axis.map((each) => (each / length) * q[index])) : [0, 0, 0];
      const origin = plus(plus(parent.origin, turned(parent.rotation, link.xyz)), moved);
      const rotation = link.slides ? frame : product(frame, rotationAbout(link.axis, q[index]));
      frames.push({ origin, rotation });
      lines.push([parent.origin, origin]);
    });
    let tool = null;
    if (figure.tool) {
      const frame = frames[figure.tool.link];
      tool = plus(frame.origin, turned(frame.rotation, figure.tool.xyz));
      lines.push([frame.origin, tool]);
    }
    return { lines, tool };
  }

  // The first joint moves the cart, the second is the pole's pivot: 0 upright, positive towards positive cart positions.
  function cartPolePose(figure, q) {
    const cart = [figure.pulley_radius * q[0], 0, 0];
    const tip = [cart[0] + figure.pole_length * Math.sin(q[1]), 0, figure.pole_length * Math.cos(q[1])];
    const half = 0.06;
    return { lines: [[[cart[0] - half, 0, 0], [cart[0] + half, 0, 0]], [cart, tip]], tool: cart };
  }

  return {
    // {lines: [[from, to], ...], tool: the point the task is about, or null}; null where q is not known.
    pose(figure, q) {
      if (!figure || q.some((each) => !Number.isFinite(each))) return null;
      return figure.kind === 'links' ? linksPose(figure, q) : cartPolePose(figure, q);
    },
  };
})();
