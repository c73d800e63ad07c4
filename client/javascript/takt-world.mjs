// SPDX-License-Identifier: Apache-2.0
// A world for Takt in JavaScript: a process that plays a robot's mechanics over its Unix socket (docs/world-protocol.md).
// Needs Node.js and nothing else.
//
//   import { serve } from './takt-world.mjs';
//   await serve('/tmp/world.sock', {
//     reset(robot, seed, q) { return { q, dq: q.map(() => 0) }; },
//     step({ torque, viscous, coulomb }, seconds) { return { q, dq }; },
//   });
//
// Joints are those of the robot file, in its order. Units: rad, rad/s, Nm, s. A step also has hangs (a base that would fall hangs
// where it began: until all drives were enabled, and 3 s after all were disabled) and push (N, world frame). A state may also have point (m), imu ({ orientation: w x y z, angularVelocity: rad/s,
// acceleration: m/s2 }), base ({ position: m, orientation: w x y z }), error (how far from what the task wants), sensor (values of a new sample),
// outcome ('succeeded', 'failed', 'unable'), reason, and images ({ cam0: { pixels: Uint8Array, row after row, age: s since the shutter } }).
// An exception of reset or step ends that simulation, and Takt is told its text.
import fs from 'node:fs';
import net from 'node:net';

const PROTOCOL = 3, MAX_JOINTS = 64, MAX_CAMERAS = 8, JOINT_BYTES = 8 * MAX_JOINTS;
const HELLO = 1, WELCOME = 2, RESET = 3, STEP = 4, STATE = 5;
const GIVES = { imu: 2, point: 4, base: 8, error: 16, done: 32, push: 64 };
const OUTCOMES = ['running', 'succeeded', 'failed', 'unable'];
const WELCOME_BYTES = 928, STATE_BYTES = 1872, IMAGE_BYTES = 24, CAMERA_BYTES = 80, HELLO_BYTES = 4840;
const HELLO_CAMERAS = HELLO_BYTES - MAX_CAMERAS * CAMERA_BYTES, WELCOME_CAMERAS = WELCOME_BYTES - MAX_CAMERAS * CAMERA_BYTES;

const textAt = (bytes, at) => bytes.toString('utf8', at, Math.max(at, bytes.indexOf(0, at)));
const numbersAt = (bytes, at, count) => Array.from({ length: count }, (_, i) => bytes.readDoubleLE(at + 8 * i));

function header(bytes, kind, sequence) {
  bytes.writeUInt32LE(bytes.length, 0);
  bytes.writeUInt16LE(kind, 4);
  bytes.writeUInt16LE(PROTOCOL, 6);
  bytes.writeBigUInt64LE(sequence, 8);
}

function welcome(sequence, { name, gives, sensor, cameras }) {
  const bytes = Buffer.alloc(WELCOME_BYTES);
  header(bytes, WELCOME, sequence);
  bytes.writeUInt32LE(gives, 16);
  bytes.writeUInt32LE(sensor?.values ?? 0, 20);
  bytes.write(name.slice(0, 63), 24);
  bytes.write((sensor?.name ?? '').slice(0, 63), 88);
  const names = Object.keys(cameras);
  bytes.writeUInt32LE(names.length, WELCOME_CAMERAS - 8);
  names.forEach((camera, i) => {
    const at = WELCOME_CAMERAS + i * CAMERA_BYTES, { height, width, channels } = cameras[camera];
    bytes.write(camera.slice(0, 63), at);
    [height, width, channels].forEach((size, k) => bytes.writeUInt32LE(size, at + 64 + 4 * k));
  });
  return bytes;
}

function imageHead(camera, bytes, sequence, time) {
  const head = Buffer.alloc(IMAGE_BYTES);
  head.writeUInt32LE(camera, 0);
  head.writeUInt32LE(bytes, 4);
  head.writeBigUInt64LE(BigInt(sequence), 8);
  head.writeBigUInt64LE(time, 16);
  return head;
}

function stateMessage(state, sequence, time, sample = 0n, images = 0) {
  const bytes = Buffer.alloc(STATE_BYTES);
  header(bytes, STATE, sequence);
  bytes.writeBigUInt64LE(time, 16);
  bytes.writeUInt32LE(OUTCOMES.indexOf(state.outcome ?? 'running'), 24);
  bytes.writeUInt32LE(images, 28);
  const put = (values, at) => values?.forEach((value, i) => bytes.writeDoubleLE(value, at + 8 * i));
  put(state.q, 32);
  put(state.dq, 32 + JOINT_BYTES);
  const after = 32 + 2 * JOINT_BYTES;
  put(state.point, after);
  put(state.imu?.orientation, after + 24);
  put(state.imu?.angularVelocity, after + 56);
  put(state.imu?.acceleration, after + 80);
  put(state.base?.position, after + 104);
  put(state.base?.orientation, after + 128);
  bytes.writeDoubleLE(state.error ?? 0, after + 160);
  bytes.writeBigUInt64LE(sample, after + 168);
  put(state.sensor, after + 176);
  bytes.write((state.reason ?? '').slice(0, 127), after + 688);
  return bytes;
}

class Simulation {
  constructor(peer, world, facts) {
    Object.assign(this, { peer, world, facts, heard: Buffer.alloc(0), sample: 0n, sensed: undefined, places: {}, shown: {} });
  }

  // What is sent behind a state: a head and its bytes for each image.
  imagesOf(state, time) {
    return Object.entries(state.images ?? {}).map(([camera, { pixels, age = 0 }]) => {
      const place = this.places[camera], sensed = time - BigInt(Math.round(age * 1e9));
      if (place === undefined) throw new Error(`an image of ${camera}, which is none of the cameras of serve()`);
      if (pixels.length !== place.bytes) throw new Error(`an image of ${camera} has ${pixels.length} bytes, expected ${place.bytes}`);
      if (sensed < 0n || sensed > time) throw new Error(`an image of ${camera} sensed ${age} s before ${Number(time) * 1e-9} s of simulation`);
      this.shown[camera] = (this.shown[camera] ?? 0) + 1;
      return [imageHead(place.index, place.bytes, this.shown[camera], sensed), Buffer.from(pixels)];
    });
  }

  // A state without a new sample repeats the newest one.
  remember(state) {
    if (state.sensor) {
      this.sensed = state.sensor;
      ++this.sample;
    }
    return { ...state, sensor: this.sensed };
  }

  // One piece of what Takt says, whole messages or not.
  hear(piece) {
    this.heard = Buffer.concat([this.heard, piece]);
    while (this.heard.length >= 4) {
      const size = this.heard.readUInt32LE(0);
      if (size < 16 || size > HELLO_BYTES) throw new Error(`Takt sent a message of ${size} bytes`);
      if (this.heard.length < size) return;
      const message = this.heard.subarray(0, size);
      this.heard = this.heard.subarray(size);
      this.answer(message);
    }
  }

  answer(message) {
    const kind = message.readUInt16LE(4), sequence = message.readBigUInt64LE(8);
    if (message.readUInt16LE(6) !== PROTOCOL) throw new Error(`Takt speaks protocol ${message.readUInt16LE(6)}`);
    if (kind === HELLO) {
      this.meet(message);
      this.peer.write(welcome(sequence, this.facts));
      return;
    }
    const time = kind === STEP ? message.readBigUInt64LE(16) + message.readBigUInt64LE(24) : 0n;
    try {
      const state = this.remember(kind === RESET ? this.reset(message) : this.step(message));
      const images = this.imagesOf(state, time);
      this.peer.write(stateMessage(state, sequence, time, this.sample, images.length));
      for (const piece of images.flat()) this.peer.write(piece);
    } catch (error) {
      this.peer.write(stateMessage({ outcome: 'unable', reason: String(error) }, sequence, time));
      throw error;
    }
  }

  meet(message) {
    const count = message.readUInt32LE(24);
    this.robot = {
      name: textAt(message, 40),
      joints: Array.from({ length: count }, (_, i) => textAt(message, 104 + 64 * i)),
      stepSeconds: Number(message.readBigUInt64LE(16)) * 1e-9,
    };
    // Takt refuses, by the welcome, a camera that the robot does not have.
    this.places = {};
    for (let index = 0; index < message.readUInt32LE(28); ++index) {
      const at = HELLO_CAMERAS + index * CAMERA_BYTES, [height, width, channels] = [64, 68, 72].map((k) => message.readUInt32LE(at + k));
      const camera = textAt(message, at);
      if (this.facts.cameras[camera]) this.places[camera] = { index, bytes: height * width * channels };
    }
  }

  reset(message) {
    this.sample = 0n;
    this.sensed = undefined;
    this.shown = {};
    return this.world.reset(this.robot, message.readBigUInt64LE(16), numbersAt(message, 24, this.robot.joints.length));
  }

  step(message) {
    const joints = (field) => numbersAt(message, 32 + field * JOINT_BYTES, this.robot.joints.length);
    const after = 32 + 3 * JOINT_BYTES;
    return this.world.step({ torque: joints(0), viscous: joints(1), coulomb: joints(2), hangs: message.readUInt32LE(after) !== 0,
      push: numbersAt(message, after + 8, 3) }, Number(message.readBigUInt64LE(24)) * 1e-9);
  }
}

// Plays `world` at the socket `path`, one simulation of Takt's after the other; options: name; imu, point, base, error (true: states have them);
// done (it says when the task is done), push (it obeys pushes); sensor ({ name, values }: the robot file's outside sensor that it plays);
// cameras ({ cam0: { height, width, channels } }: the robot file's sensors of images whose images it gives); simulations (that many, else for ever).
export function serve(path, world, { name = 'javascript', sensor, cameras = {}, simulations = Infinity, ...flags } = {}) {
  if (Object.keys(cameras).length > MAX_CAMERAS) throw new Error(`${Object.keys(cameras).length} cameras; a world has at most ${MAX_CAMERAS}`);
  const gives = Object.entries(GIVES).reduce((bits, [flag, bit]) => bits | (flags[flag] ? bit : 0), 0);
  if (fs.existsSync(path)) fs.unlinkSync(path);
  return new Promise((resolve, reject) => {
    let played = 0;
    const server = net.createServer((peer) => {
      const simulation = new Simulation(peer, world, { name, gives, sensor, cameras });
      peer.on('data', (piece) => {
        try {
          simulation.hear(piece);
        } catch (error) {
          console.error(error);
          peer.end();
        }
      });
      peer.on('error', () => peer.destroy()); // Takt has gone
      peer.on('close', () => ++played >= simulations && server.close(() => resolve()));
    });
    server.on('error', reject);
    server.listen(path);
  });
}
