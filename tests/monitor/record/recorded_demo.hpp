// SPDX-License-Identifier: Apache-2.0
// A short recorded run of the virtual robot: arming, tracking, a policy that stalls and comes back, and is lost.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "monitor/record/recorded_run.hpp"
#include "monitor/record/recorder.hpp"
#include "tests/monitor/record/virtual_robot.hpp"

namespace takt::monitor {

inline constexpr std::uint64_t kDemoTicks = 4'000;
inline constexpr std::uint64_t kDemoMark = 700;  // tick that the operator marked

// Records `ticks` ticks of `robot` into `directory`, through rings and recorder as takt-monitor does, and returns the
// run, opened. `before(tick)` is called every 20 ticks.
RecordedRun record(VirtualRobot& robot, const std::string& directory, std::uint64_t ticks,
                   const std::function<void(std::uint64_t tick)>& before);

// Records kDemoTicks ticks into `directory` and returns the run, opened.
RecordedRun record_demo(const std::string& directory);

// Whether an altered record keeps the checksum it was recorded with, or has one of its own: damaged, or forged.
enum class Checksums : std::uint8_t { as_recorded, made_anew };

// Copies `run` into `directory`, with `alter` applied to every tick and command on the way; `images` behind them.
RecordedRun altered_copy(const RecordedRun& run, const std::string& directory,
                         const std::function<void(TickRecord&)>& alter_tick,
                         const std::function<void(RecordedCommand&)>& alter_command,
                         const std::function<bool(std::uint64_t tick)>& keep_tick,
                         Checksums checksums = Checksums::as_recorded, const std::vector<ShownImage>& images = {});

}  // namespace takt::monitor
