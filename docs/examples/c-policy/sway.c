// SPDX-License-Identifier: Apache-2.0
/* A policy in C: every joint at home, the last one sways by 0.2 rad.
 *   cc -std=c11 sway.c $(pkg-config --cflags --libs takt) -lm -o sway
 *   takt run robot.yaml --policy-host ./sway --arm
 */
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <takt/client.h>

static volatile sig_atomic_t stopped;

static void stop(int number) {
  (void)number;
  stopped = 1;
}

static void fill(const takt_robot* robot, int64_t published_ns, float* q) {
  for (uint32_t step = 0; step < robot->steps; ++step) {
    const double at_s = 1e-9 * (double)(published_ns + (int64_t)step * robot->step_ns);
    float* const row = q + step * robot->joint_count;
    memcpy(row, robot->home, robot->joint_count * sizeof *row);
    row[robot->joint_count - 1] += 0.2F * (float)sin(at_s);
  }
}

static int sway(takt_policy* policy) {
  const takt_robot* robot = takt_policy_robot(policy);
  float* q = calloc((size_t)robot->steps * robot->joint_count, sizeof *q);
  if (q == NULL) return TAKT_BUG;
  const takt_chunk chunk = {.size = sizeof chunk, .q = q};
  int result = TAKT_OK;
  while (!stopped && (result == TAKT_OK || result == TAKT_NOTHING)) {
    result = takt_policy_next(policy, 100000000);
    if (result != TAKT_OK) continue;
    fill(robot, takt_policy_observation(policy)->published_ns, q);
    result = takt_policy_publish(policy, &chunk);
  }
  free(q);
  if (stopped) return TAKT_OK;
  fprintf(stderr, "%s\n", takt_policy_sentence(policy));
  return result;
}

int main(int argc, char** argv) {
  const takt_term terms[] = {{.kind = TAKT_TERM_Q}};
  takt_policy_spec spec = {.size = sizeof spec, .term_count = 1, .terms = terms, .program = "sway", .step = "10 ms", .steps = 16};
  for (int i = 1; i + 1 < argc; i += 2) { /* what `takt run` gives */
    if (strcmp(argv[i], "--robot") == 0) spec.robot_file = argv[i + 1];
    if (strcmp(argv[i], "--runtime-dir") == 0) spec.runtime_directory = argv[i + 1];
  }
  signal(SIGTERM, stop);
  signal(SIGINT, stop);
  char why[1024];
  takt_policy* policy = NULL;
  int result = takt_policy_open(&spec, &policy, why, sizeof why);
  if (result == TAKT_OK) {
    result = sway(policy);
  } else {
    fprintf(stderr, "%s\n", why);
  }
  takt_policy_close(policy);
  return result;
}
