// SPDX-License-Identifier: Apache-2.0
// A world that stands still and films: of every fourth step an image of 4 x 6 x 3 bytes, 7 i + 31 sequence, sensed 2 ms before.
// Usage: filming.mjs SOCKET
import { serve } from '../../../client/javascript/takt-world.mjs';

const [height, width, channels] = [4, 6, 3];
let q = [], steps = 0;
const state = () => ({ q, dq: [0] });

await serve(process.argv[2], {
  reset(robot, seed, home) {
    [q, steps] = [home, 0];
    return state();
  },
  step() {
    if (++steps % 4) return state();
    const pixels = Uint8Array.from({ length: height * width * channels }, (_, i) => 7 * i + 31 * (steps / 4));
    return { ...state(), images: { cam0: { pixels, age: 0.002 } } };
  },
}, { name: 'filming.mjs', cameras: { cam0: { height, width, channels } } });
