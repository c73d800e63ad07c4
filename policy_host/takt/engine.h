// SPDX-License-Identifier: Apache-2.0
/* An inference engine for Takt's policy host, in C: the interface between the host and a plugin, which it opens with
 * dlopen. The plugin runs a network; the host does everything else: observations, pacing, hidden state that goes round,
 * stamps, rendezvous, faults. ONNX Runtime and TorchScript are such plugins (docs/own-engine.md).
 *
 *   takt_engine -> open -> { fill inputs -> infer -> read outputs | reset }* -> close
 *
 * A plugin is a shared library with one symbol, takt_engine; hide all others (-fvisibility=hidden): it is opened with
 * RTLD_NOW | RTLD_LOCAL. It is native code in the host's process, and trusted as much as the host is: by the executive
 * not at all.
 *
 * Tensors: float32, row-major, with fixed shapes, in memory of the plugin's that stays where it is from open to close.
 * Names tell what a tensor is (docs/policies.md): observation, actions, hidden state (<x>_in fed by <x>_out), time
 * step. What the actions mean, rad, rad/s or Nm, is the robot file's affair.
 *
 * Errors: one line, into `error`: what is wrong, how to correct it. No exception may leave a function. A plugin that
 * crashes, ends the process or takes longer than policy.engine.load_within while it is opened is refused by the host.
 *
 * Thread rule: takt_engine and open on the host's main thread; a network then belongs to one thread at a time, and
 * several networks (policy.requests_in_flight) infer at the same time in threads of their own. The host keeps every
 * thread of the process off the executive's processor: a plugin's own calls of sched_setaffinity fail with EPERM.
 * Use no more than takt_engine_setup.threads threads for one inference.
 *
 * Versions: TAKT_ENGINE_ABI changes when something that exists changes; the host refuses another. What is added comes
 * at the end of a structure, whose `size` says where it ends.
 */
#ifndef TAKT_ENGINE_H
#define TAKT_ENGINE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TAKT_ENGINE_ABI 1u
#define TAKT_ENGINE_MOST_DIMENSIONS 8

/* In front of a plugin's takt_engine. */
#define TAKT_ENGINE_EXPORT __attribute__((visibility("default")))

struct takt_engine_tensor {
  const char* name; /* "": the network has none for it, as TorchScript's outputs: the host goes by the order */
  uint32_t rank;    /* 0 (one number) to TAKT_ENGINE_MOST_DIMENSIONS */
  int64_t shape[TAKT_ENGINE_MOST_DIMENSIONS]; /* each at least 1 */
  float* values;                              /* as many as the shape's product */
};

/* What the host wants. Valid during open. */
struct takt_engine_setup {
  uint32_t size;               /* of this structure, bytes */
  uint32_t threads;            /* of one inference, the caller's included; at least 1 */
  const char* file;            /* policy.file, absolute */
  const char* provider;        /* "cpu", "cuda", "tensorrt": refuse what you have not */
  const char* library;         /* policy.engine.library; "": the plugin's own choice */
  uint64_t observation_values; /* of one observation: the size of the input that carries it, if there is but one; 0:
                                  unknown (`takt policy try`) */
  uint64_t action_values;      /* of one chunk: policy.steps times the outputs per step */
  const struct takt_engine_tensor* shapes; /* policy.engine.shapes: by name, without values */
  size_t shape_count;
};

/* What a plugin made. Constant until close, but for the tensors' values. */
struct takt_engine_network {
  uint32_t size;           /* of this structure, bytes */
  uint32_t keeps_state;    /* 1: infer() follows from earlier ones too, in ways that the tensors do not show */
  const char* description; /* "ONNX Runtime 1.30.0, cpu, 1 thread": one line for the log */
  const struct takt_engine_tensor* inputs;
  size_t input_count;
  const struct takt_engine_tensor* outputs;
  size_t output_count;
};

struct takt_engine_table {
  uint32_t abi;  /* TAKT_ENGINE_ABI */
  uint32_t size; /* of this structure, bytes */
  /* NULL: refused, `error` says why. Warm up here: the first inference is no slower than others. */
  struct takt_engine_network* (*open)(const struct takt_engine_setup* setup, char* error, size_t error_size);
  /* Reads all inputs, writes all outputs; takes as long as it needs. 0: done; else `error` says why, and the host ends.
   */
  int (*infer)(struct takt_engine_network* network, char* error, size_t error_size);
  /* Forgets what keeps_state speaks of. Never called where it is 0. */
  void (*reset)(struct takt_engine_network* network);
  void (*close)(struct takt_engine_network* network);
};

/* The plugin's one symbol: a table that stays for the life of the process. */
TAKT_ENGINE_EXPORT const struct takt_engine_table* takt_engine(void);

#ifdef __cplusplus
}
#endif
#endif
