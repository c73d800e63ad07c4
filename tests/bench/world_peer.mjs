// SPDX-License-Identifier: Apache-2.0
// The JavaScript side of `./dev bench world`: a world whose work is nothing. Usage: world_peer.mjs SOCKET
import { serve } from '../../client/javascript/takt-world.mjs';

let state;
await serve(process.argv[2], {
  reset(robot, seed, q) { return state = { q, dq: q.map(() => 0) }; },
  step() { return state; },
});
