// SPDX-License-Identifier: Apache-2.0
/* An engine that does what TAKT_ODD_ENGINE says, wrong in one way each; unset: sums its inputs, as a good one would. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "policy_host/takt/engine.h"

static int told(const char* what) {
  const char* const said = getenv("TAKT_ODD_ENGINE");
  return said != NULL && strcmp(said, what) == 0;
}

static float in[4096], out[4096];
static struct takt_engine_tensor input = {"obs", 2, {1, 0}, in}, output = {"actions", 2, {1, 0}, out};
static struct takt_engine_network network = {sizeof network, 0, "odd", &input, 1, &output, 1};

/* Wants every processor, as a library does that spreads its pool by itself. */
static void* spread(void* unused) {
  cpu_set_t all;
  memset(&all, 0xff, sizeof all);
  const int refused = sched_setaffinity(0, sizeof all, &all);
  fprintf(stderr, "odd engine's thread: sched_setaffinity %s\n", refused ? "refused" : "done");
  for (;;) pause();
  return unused;
}

/* As above, and at once. */
static void ask_for_all(void) {
  cpu_set_t all;
  memset(&all, 0xff, sizeof all);
  const int refused = sched_setaffinity(0, sizeof all, &all);
  fprintf(stderr, "odd engine: sched_setaffinity %s\n", refused ? "refused" : "done");
}

/* What another process of this user's, TAKT_ODD_VICTIM, is not to suffer. */
static void attack(void) {
  const char* const victim = getenv("TAKT_ODD_VICTIM");
  char path[64];
  snprintf(path, sizeof path, "/proc/%s/mem", victim);
  fprintf(stderr, "odd engine: signal %s, ", kill(atoi(victim), SIGWINCH) ? "refused" : "sent");
  fprintf(stderr, "memory %s, ", open(path, O_RDWR | O_CLOEXEC) < 0 ? "refused" : "open");
  fprintf(stderr, "file %s\n", open("takt-odd-file", O_WRONLY | O_CREAT | O_CLOEXEC, 0600) < 0 ? "refused" : "made");
}

static void* wait_for_work(void* unused) {
  for (;;) pause();
  return unused;
}

static struct takt_engine_network* open_network(const struct takt_engine_setup* setup, char* error, size_t error_size) {
  input.shape[1] = (int64_t)setup->observation_values;
  output.shape[1] = (int64_t)setup->action_values;
  if (told("refuses")) snprintf(error, error_size, "no room for\nthis network");
  if (told("refuses") || told("says nothing")) return NULL;
  if (told("crashes")) raise(SIGSEGV);
  if (told("aborts")) abort();
  if (told("ends")) exit(0);
  if (told("hangs"))
    for (;;) pause();
  if (told("other shapes")) ++input.shape[1];
  if (told("open dimension")) input.shape[1] = -1;
  if (told("no memory")) output.values = NULL;
  if (told("spreads")) {
    pthread_t thread;
    for (int i = 0; i < 2; ++i) pthread_create(&thread, NULL, spread, NULL);
  }
  if (told("asks")) ask_for_all();
  if (told("attacks")) attack();
  const int crowd = told("crowds") ? 12 : told("has a driver") ? 9 : 0;
  for (int i = 0; i < crowd; ++i) {
    pthread_t thread;
    pthread_create(&thread, NULL, wait_for_work, NULL);
  }
  return &network;
}

static int infer(struct takt_engine_network* self, char* error, size_t error_size) {
  (void)self, (void)error, (void)error_size;
  static int inferences = 0;
  if (told("ends soon") && ++inferences > 50) _exit(64);
  memset(out, 0, sizeof out);
  for (int64_t i = 0; i < input.shape[1]; ++i) out[0] += in[i];
  return 0;
}

static void reset(struct takt_engine_network* self) {
  (void)self;
}

const struct takt_engine_table* takt_engine(void) {
  static struct takt_engine_table engine = {TAKT_ENGINE_ABI, sizeof engine, open_network, infer, reset, reset};
  if (told("other version")) engine.abi = TAKT_ENGINE_ABI + 1;
  if (told("no infer")) engine.infer = NULL;
  return told("no table") ? NULL : &engine;
}
