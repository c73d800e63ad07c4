// SPDX-License-Identifier: Apache-2.0
/* A world in C: every drive turns a flywheel. docs/world-protocol.md.
 *   gcc -std=c11 flywheels.c -o flywheels && ./flywheels /tmp/world.sock
 */
#include <math.h>
#include <stdio.h>
#include <takt/world.h>

static const double kInertia = 0.1; /* kg m2, of each */

static void begin(const takt_world* world, takt_world_state* state) {
  memset(state, 0, sizeof *state);
  memcpy(state->q, world->reset.q, sizeof state->q);
}

/* Friction is implicit, so that any step is stable against it and a held wheel stays where it is. */
static void move(const takt_world* world, takt_world_state* state) {
  const double dt = (double)world->step.step_ns * 1e-9;
  uint32_t i;
  for (i = 0; i < world->hello.joint_count; ++i) {
    const double speed = fmax(fabs(state->dq[i]), 1e-4);
    const double damping = world->step.viscous[i] + world->step.coulomb[i] / speed;
    state->dq[i] = (kInertia * state->dq[i] + dt * world->step.torque[i]) / (kInertia + dt * damping);
    state->q[i] += dt * state->dq[i];
  }
  state->time_ns = world->step.time_ns + world->step.step_ns;
}

int main(int argc, char** argv) {
  takt_world world;
  if (argc != 2 || takt_world_listen(&world, argv[1]) != 0) {
    fprintf(stderr, "usage: flywheels SOCKET, of a path that is free\n");
    return 64;
  }
  while (takt_world_accept(&world, "flywheels", 0) == 0) {
    takt_world_state state = {0};
    while (takt_world_next(&world) == 0) {
      if (world.kind == TAKT_WORLD_RESET)
        begin(&world, &state);
      else
        move(&world, &state);
      if (takt_world_answer(&world, &state) != 0) break;
    }
  }
  perror("flywheels");
  return 1;
}
