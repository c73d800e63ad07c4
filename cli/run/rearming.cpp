// SPDX-License-Identifier: Apache-2.0
#include "cli/run/rearming.hpp"

#include <utility>

namespace takt::cli {

OperatorStep Rearming::next(Mode mode, bool stopped_by_another, Duration now) {
  if (!after_) return OperatorStep::none;
  const bool is_armed = mode == Mode::arming || mode == Mode::tracking || mode == Mode::degraded;
  is_anothers_ = !is_armed && (is_anothers_ || (stopped_by_another && (stopped_at_ || mode != Mode::standby)));
  if (is_anothers_) return OperatorStep::none;
  switch (mode) {
    case Mode::arming:
    case Mode::tracking:
    case Mode::degraded:
      stopped_at_.reset();
      looked_ = false;
      return OperatorStep::none;
    case Mode::standby:
      if (!stopped_at_) return OperatorStep::none;
      return std::exchange(looked_, true) ? OperatorStep::arm : OperatorStep::reset;
    case Mode::damped_stop:
    case Mode::fault_latched:
      if (!stopped_at_) stopped_at_ = now;
      if (now < *stopped_at_ + *after_) return OperatorStep::none;
      return mode == Mode::fault_latched ? OperatorStep::reset : OperatorStep::reset_if_only_the_stop_blocks;
  }
  return OperatorStep::none;
}

}  // namespace takt::cli
