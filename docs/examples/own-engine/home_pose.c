// SPDX-License-Identifier: Apache-2.0
/* An engine of your own, which answers zeros: with `offset: home` in the robot file that is the home pose. Put your own
 * inference in the place of infer().
 *
 *   gcc -O2 -shared -fPIC -fvisibility=hidden home_pose.c -o home-pose.so
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <takt/engine.h>

struct home_pose {
  struct takt_engine_network network; /* first: what the host sees */
  struct takt_engine_tensor input, output;
};

static int give_memory(struct takt_engine_tensor* tensor, const char* name, uint64_t values) {
  tensor->name = name;
  tensor->rank = 2;
  tensor->shape[0] = 1;
  tensor->shape[1] = (int64_t)values;
  tensor->values = calloc(values, sizeof *tensor->values);
  return tensor->values != NULL;
}

static void close_network(struct takt_engine_network* network) {
  struct home_pose* pose = (struct home_pose*)network;
  free(pose->input.values);
  free(pose->output.values);
  free(pose);
}

static struct takt_engine_network* open_network(const struct takt_engine_setup* setup, char* error, size_t error_size) {
  if (strcmp(setup->provider, "cpu") != 0) {
    snprintf(error, error_size, "home-pose has no provider %s; write provider: cpu", setup->provider);
    return NULL;
  }
  struct home_pose* pose = calloc(1, sizeof *pose);
  if (pose == NULL) return NULL;
  if (!give_memory(&pose->input, "obs", setup->observation_values) ||
      !give_memory(&pose->output, "actions", setup->action_values)) {
    close_network(&pose->network);
    return NULL;
  }
  pose->network.size = sizeof pose->network;
  pose->network.description = "home pose";
  pose->network.inputs = &pose->input;
  pose->network.input_count = 1;
  pose->network.outputs = &pose->output;
  pose->network.output_count = 1;
  return &pose->network;
}

static int infer(struct takt_engine_network* network, char* error, size_t error_size) {
  struct home_pose* pose = (struct home_pose*)network;
  (void)error, (void)error_size;
  memset(pose->output.values, 0, (size_t)pose->output.shape[1] * sizeof *pose->output.values);
  return 0;
}

static void reset(struct takt_engine_network* network) {
  (void)network; /* nothing is remembered */
}

const struct takt_engine_table* takt_engine(void) {
  static const struct takt_engine_table engine = {
      .abi = TAKT_ENGINE_ABI,
      .size = sizeof engine,
      .open = open_network,
      .infer = infer,
      .reset = reset,
      .close = close_network,
  };
  return &engine;
}
