// SPDX-License-Identifier: Apache-2.0
// The ids a node wants to see. No list: everything wanted. No allocation after construction.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "config/drive_ids.hpp"
#include "drivers/bus/can_bus.hpp"

namespace takt::drivers {

class IdFilter {
 public:
  explicit IdFilter(std::optional<std::vector<config::IdPattern>> wanted) : wanted_(std::move(wanted)) {}
  [[nodiscard]] bool wants(const CanFrame& frame) const {
    return !wanted_ ||
           std::ranges::any_of(*wanted_, [&frame](const auto& one) { return one.matches(frame.id, frame.extended); });
  }

 private:
  std::optional<std::vector<config::IdPattern>> wanted_;
};

}  // namespace takt::drivers
