// SPDX-License-Identifier: Apache-2.0
// Any MJCF model in @mujoco/mujoco as a world of Takt's, with what simulation/mujoco_mechanics.hpp has in process: joints by name, the actuators
// unused, an IMU's site, a keyframe, a free base on its hoist, pushes at its body. Usage: mujoco_model_world.mjs MODEL SOCKET [SITE [KEYFRAME]]
import fs from 'node:fs';
import load from '@mujoco/mujoco';
import { serve } from '../../client/javascript/takt-world.mjs';

const [file, socket, site = '', keyframe = ''] = process.argv.slice(2);
const HOIST = 1e9, REST = 1e-4; // kg, kg m2; rad/s
const mujoco = await load();
const OBJECT = { body: 1, joint: 3, site: 6, key: 19 }; // mjtObj, for those that the binding does not name
const objectOf = (kind) => mujoco.mjtObj?.[`mjOBJ_${kind.toUpperCase()}`]?.value ?? OBJECT[kind];
const FREE = 0;

class Model {
  constructor(robot) {
    this.model = mujoco.MjModel.from_xml_string(fs.readFileSync(file, 'utf8'));
    this.data = new mujoco.MjData(this.model);
    this.subSteps = Math.ceil(robot.stepSeconds / this.model.opt.timestep - 1e-9);
    this.model.opt.timestep = robot.stepSeconds / this.subSteps;
    this.joints = robot.joints.map((name) => {
      const id = this.idOf('joint', name);
      return { q: this.model.jnt_qposadr[id], dof: this.model.jnt_dofadr[id], body: this.model.jnt_bodyid[id] };
    });
    this.root = this.model.body_rootid[this.joints[0].body];
    this.free = Array.from(this.model.jnt_type).findIndex((type, id) => type === FREE && this.model.jnt_bodyid[id] === this.root);
    this.damping = Float64Array.from(this.model.dof_damping);
    if (this.free >= 0) {
      this.base = { q: this.model.jnt_qposadr[this.free], dof: this.model.jnt_dofadr[this.free] };
      this.armature = Array.from(this.model.dof_armature).slice(this.base.dof, this.base.dof + 6);
    }
    this.site = site ? this.idOf('site', site) : -1;
  }

  idOf(kind, name) {
    const id = mujoco.mj_name2id(this.model, objectOf(kind), name);
    if (id < 0) throw new Error(`${file} has no ${kind} ${name}`);
    return id;
  }

  begin(q) {
    if (keyframe) mujoco.mj_resetDataKeyframe(this.model, this.data, this.idOf('key', keyframe));
    else mujoco.mj_resetData(this.model, this.data);
    this.joints.forEach((joint, i) => { this.data.qpos[joint.q] = q[i]; });
    this.hangs = false;
    if (this.free >= 0) this.began = Array.from(this.data.qpos).slice(this.base.q, this.base.q + 7);
    mujoco.mj_forward(this.model, this.data);
  }

  hang() {
    this.began.forEach((value, i) => { this.data.qpos[this.base.q + i] = value; });
    for (let i = 0; i < 6; ++i) this.data.qvel[this.base.dof + i] = 0;
  }

  hoist(hangs) {
    if (this.free < 0 || hangs === this.hangs) return;
    this.hangs = hangs;
    for (let i = 0; i < 6; ++i) this.model.dof_armature[this.base.dof + i] = hangs ? HOIST : this.armature[i];
    if (hangs) this.hang();
  }

  move({ torque, viscous, coulomb, hangs, push }) {
    this.hoist(hangs);
    push.forEach((force, i) => { this.data.xfrc_applied[6 * this.root + i] = force; });
    this.joints.forEach((joint, i) => { this.data.qfrc_applied[joint.dof] = torque[i]; });
    for (let turn = 0; turn < this.subSteps; ++turn) {
      this.joints.forEach(({ dof }, i) => {
        this.model.dof_damping[dof] = this.damping[dof] + viscous[i] + coulomb[i] / Math.max(Math.abs(this.data.qvel[dof]), REST);
      });
      mujoco.mj_step(this.model, this.data);
      if (this.hangs) this.hang();
    }
  }

  state() {
    const { model, data } = this;
    const at = this.free >= 0 ? Array.from(data.qpos.slice(this.base.q, this.base.q + 7))
      : [...data.xpos.slice(3 * this.root, 3 * this.root + 3), ...data.xquat.slice(4 * this.root, 4 * this.root + 4)];
    const base = { position: at.slice(0, 3), orientation: at.slice(3) };
    return { q: this.joints.map(({ q }) => data.qpos[q]), dq: this.joints.map(({ dof }) => data.qvel[dof]), point: base.position, base, imu: this.imu(model, data) };
  }

  imu(model, data) {
    if (this.site < 0) return undefined;
    mujoco.mj_kinematics(model, data);
    mujoco.mj_comPos(model, data);
    mujoco.mj_comVel(model, data);
    mujoco.mj_rnePostConstraint(model, data);
    const buffer = (size) => new mujoco.DoubleBuffer(size), motion = buffer(6), turned = buffer(4);
    mujoco.mju_mat2Quat(turned, Array.from(data.site_xmat.slice(9 * this.site, 9 * this.site + 9)));
    mujoco.mj_objectVelocity(model, data, objectOf('site'), this.site, motion, 1);
    const angularVelocity = Array.from(motion.GetView()).slice(0, 3);
    mujoco.mj_objectAcceleration(model, data, objectOf('site'), this.site, motion, 1);
    const acceleration = Array.from(motion.GetView()).slice(3), orientation = Array.from(turned.GetView());
    [motion, turned].forEach((one) => one.delete());
    return { orientation, angularVelocity, acceleration };
  }
}

let robotModel;
await serve(socket, {
  reset(robot, seed, q) {
    robotModel ??= new Model(robot);
    robotModel.begin(q);
    return robotModel.state();
  },
  step(drives) {
    robotModel.move(drives);
    return robotModel.state();
  },
}, { name: `MuJoCo ${mujoco.mj_versionString?.() ?? '3'} (WASM)`, point: true, base: true, push: true, imu: site !== '' });
