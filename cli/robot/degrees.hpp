// Angles as people type and read them.
#pragma once

#include <numbers>

namespace takt::cli {

inline constexpr double kDegree = std::numbers::pi / 180;  // rad

}  // namespace takt::cli
