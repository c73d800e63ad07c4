// SPDX-License-Identifier: Apache-2.0
// An engine that breaks the rule that no exception may leave it.
#include <stdexcept>

#include "policy_host/takt/engine.h"

namespace {
takt_engine_network* open_network(const takt_engine_setup* /*setup*/, char* /*error*/, size_t /*error_size*/) {
  throw std::runtime_error("thrown across");
}
int infer(takt_engine_network* /*network*/, char* /*error*/, size_t /*error_size*/) {
  return 0;
}
void leave(takt_engine_network* /*network*/) {}
constexpr takt_engine_table kEngine{TAKT_ENGINE_ABI, sizeof(takt_engine_table), open_network, infer, leave, leave};
}  // namespace

const takt_engine_table* takt_engine() {
  return &kEngine;
}
