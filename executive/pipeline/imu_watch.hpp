// SPDX-License-Identifier: Apache-2.0
// The base's IMU: which of its samples the tick believes, and when it is lost or says that the base leans or turns too
// far. Pure. Before the first usable sample it is lost.
#pragma once

#include <array>
#include <cstdint>

#include "executive/contract/imu.hpp"
#include "executive/contract/mode.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

struct ImuWatch {
  ImuSample in_force;   // newest usable one; sequence 0: none yet
  MonoTime changed_at;  // sensing stamp of the first sample that said what in_force says
  ImuSample compared;   // newest well-formed one, believed or not: what the next one's rotation is compared with
  // rad, base frame: how much further its rotation has turned than its angular velocity says, over about
  // kContradictionMemory_s. A gyroscope's bias of 1 deg/s makes 0.01 rad of it.
  std::array<float, 3> ahead{};
  std::uint32_t contradicts = 0;  // 1: the newest sample does
};
inline constexpr float kContradictionMemory_s = 0.5F;

// Judges what was read this tick, and takes it where it is usable.
ImuVerdict take_imu(ImuWatch& watch, const ImuSample& read, MonoTime now, const TickConfig& config);

// tilt, imu_lost. None where the robot has no IMU.
CauseMask imu_conditions(const ImuWatch& watch, MonoTime now, const ImuConfig& config);

}  // namespace takt::pipeline
