// SPDX-License-Identifier: Apache-2.0
// The pendulum of tests/simulation/worlds in MuJoCo's physics, as a world of Takt's. Usage: mujoco_world.mjs SOCKET
import load from '@mujoco/mujoco';
import { serve } from '../../client/javascript/takt-world.mjs';

// MuJoCo wants some inertia about a point mass's own centre.
const MODEL = `
<mujoco>
  <option timestep="0.0005"/>
  <worldbody>
    <body>
      <joint name="pivot" type="hinge" axis="0 1 0"/>
      <inertial pos="0 0 -0.5" mass="2" diaginertia="1e-6 1e-6 1e-6"/>
      <site name="tip" pos="0 0 -0.5"/>
    </body>
  </worldbody>
</mujoco>`;
const SUB_STEPS = 2;

const mujoco = await load();
const model = mujoco.MjModel.from_xml_string(MODEL);
const data = new mujoco.MjData(model);
const state = () => ({ q: [data.qpos[0]], dq: [data.qvel[0]], point: Array.from(data.site_xpos) });

await serve(process.argv[2], {
  reset(robot, seed, home) {
    mujoco.mj_resetData(model, data);
    data.qpos[0] = home[0];
    mujoco.mj_forward(model, data);
    return state();
  },
  step({ torque, viscous }) {
    for (let turn = 0; turn < SUB_STEPS; ++turn) {
      data.qfrc_applied[0] = torque[0] - viscous[0] * data.qvel[0];
      mujoco.mj_step(model, data);
    }
    return state();
  },
}, { name: 'MuJoCo (WASM)', point: true });
