// The ids a node wants to see. Nothing named: everything wanted. No allocation after construction.
#pragma once

#include <algorithm>
#include <vector>

#include "config/drive_ids.hpp"
#include "drivers/bus/can_bus.hpp"

namespace takt::drivers {

class IdFilter {
 public:
  explicit IdFilter(std::vector<config::IdPattern> wanted) : wanted_(std::move(wanted)) {}
  [[nodiscard]] bool wants(const CanFrame& frame) const {
    return wanted_.empty() ||
           std::ranges::any_of(wanted_, [&frame](const auto& one) { return one.matches(frame.id, frame.extended); });
  }

 private:
  std::vector<config::IdPattern> wanted_;
};

}  // namespace takt::drivers
