// SPDX-License-Identifier: Apache-2.0
// A pendulum as a world of Takt's: 2 kg at 0.5 m below a hinge about y. Usage: pendulum.mjs SOCKET
import { serve } from '../../../client/javascript/takt-world.mjs';

const MASS = 2, LENGTH = 0.5, GRAVITY = 9.81, SUB_STEPS = 2;
let q = 0, dq = 0;
const state = () => ({ q: [q], dq: [dq], point: [-LENGTH * Math.sin(q), 0, -LENGTH * Math.cos(q)] });

await serve(process.argv[2], {
  reset(robot, seed, home) {
    if (robot.joints.length !== 1) throw new Error(`${robot.name} has ${robot.joints.length} joints, a pendulum one`);
    [q, dq] = [home[0], 0];
    return state();
  },
  step({ torque, viscous, coulomb }, seconds) {
    const dt = seconds / SUB_STEPS, inertia = MASS * LENGTH ** 2;
    for (let turn = 0; turn < SUB_STEPS; ++turn) {
      const damping = viscous[0] + coulomb[0] / Math.max(Math.abs(dq), 1e-4);
      dq = (inertia * dq + dt * (torque[0] - MASS * GRAVITY * LENGTH * Math.sin(q))) / (inertia + dt * damping);
      q += dt * dq;
    }
    return Math.abs(q) > 3 ? { ...state(), outcome: 'failed', reason: 'over the top' } : state();
  },
}, { name: 'pendulum.mjs', point: true });
