// The standard ids a node wants to see, as a bit per id: constant time, no allocation. Nothing named: everything
// wanted.
#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/can_bus.hpp"

namespace takt::drivers {

class IdFilter {
 public:
  explicit IdFilter(std::span<const std::uint32_t> standard_ids) : everything_(standard_ids.empty()) {
    for (const std::uint32_t id : standard_ids)
      if (id < wanted_.size()) wanted_.set(id);
  }
  [[nodiscard]] bool wants(const CanFrame& frame) const {
    return everything_ || (!frame.extended && frame.id < wanted_.size() && wanted_.test(frame.id));
  }

 private:
  bool everything_;
  std::bitset<0x800> wanted_;
};

}  // namespace takt::drivers
