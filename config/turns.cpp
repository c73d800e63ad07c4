// SPDX-License-Identifier: Apache-2.0
#include "config/turns.hpp"

#include <algorithm>
#include <array>

namespace takt::config {
namespace {

static_assert([] {
  for (std::uint32_t every = 1; every <= kMostTicksPerTurn; ++every)
    if (kTurnPattern % every != 0) return false;
  return true;
}());

using DrivesPerTick = std::array<std::uint32_t, kTurnPattern>;

std::uint32_t fullest(const DrivesPerTick& ticks, std::uint32_t phase, std::uint32_t every) {
  std::uint32_t most = 0;
  for (std::size_t tick = phase; tick < kTurnPattern; tick += every) most = std::max(most, ticks[tick]);
  return most;
}

// The phase whose fullest tick is emptiest; of several, the first.
std::uint32_t emptiest_phase(const DrivesPerTick& ticks, std::uint32_t every) {
  std::uint32_t best = 0;
  for (std::uint32_t phase = 1; phase < every; ++phase)
    if (fullest(ticks, phase, every) < fullest(ticks, best, every)) best = phase;
  return best;
}

}  // namespace

std::vector<Turns> turns_of(const RobotConfig& robot) {
  std::vector<Turns> turns(robot.joints.size());
  std::vector<DrivesPerTick> buses(robot.buses.size(), DrivesPerTick{});
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    const std::uint32_t every = std::clamp<std::uint32_t>(robot.joints[joint].drive.every, 1, kMostTicksPerTurn);
    DrivesPerTick& ticks = buses[robot.joints[joint].bus];
    const std::uint32_t phase = emptiest_phase(ticks, every);
    for (std::size_t tick = phase; tick < kTurnPattern; tick += every) ++ticks[tick];
    turns[joint] = {static_cast<std::uint8_t>(every), static_cast<std::uint8_t>(phase)};
  }
  return turns;
}

}  // namespace takt::config
