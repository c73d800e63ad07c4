// SPDX-License-Identifier: Apache-2.0
// What the operator told of a drive that does not know it: where its joint is since power-on. Kept by the drive's
// driver, and forgotten as soon as the drive may have forgotten. rad, joint side. Thread rule: as JointDriver.
#pragma once

#include <cmath>
#include <optional>

namespace takt::drivers {

class AssumedHome {
 public:
  void assume(float q, float tolerance) noexcept { expected_ = Expected{q, tolerance}; }
  void take(float q) noexcept {
    if (expected_) known_ = std::abs(q - expected_->q) <= expected_->tolerance;
    expected_.reset();
  }
  void forget() noexcept { known_ = false; }
  [[nodiscard]] bool known() const noexcept { return known_; }

 private:
  struct Expected {
    float q = 0, tolerance = 0;
  };
  std::optional<Expected> expected_;  // to be compared with the next reading
  bool known_ = false;
};

}  // namespace takt::drivers
