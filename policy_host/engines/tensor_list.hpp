// SPDX-License-Identifier: Apache-2.0
// For plugins: tensors that own names and values, listed as takt/engine.h wants them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "policy_host/takt/engine.h"

namespace takt::engines {

// Precondition: at most TAKT_ENGINE_MOST_DIMENSIONS. Name and values outlive the result.
inline takt_engine_tensor listed(const std::string& name, std::span<const std::int64_t> shape, float* values) {
  takt_engine_tensor tensor{};
  tensor.name = name.c_str();
  tensor.rank = static_cast<std::uint32_t>(shape.size());
  std::ranges::copy(shape, std::ranges::begin(tensor.shape));
  tensor.values = values;
  return tensor;
}

// One line, cut where the host's room ends.
inline void say(const std::string& what, char* error, std::size_t error_size) {
  const std::size_t length = std::min(what.size(), error_size - 1);
  std::copy_n(what.begin(), length, error);
  error[length] = '\0';
}

}  // namespace takt::engines
