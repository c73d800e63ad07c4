// SPDX-License-Identifier: Apache-2.0
// The scale of a CiA 402 drive as the drive itself has it, asked over SDO by a person's tool, against the robot file.
//
// 608F  encoder increments per motor turn          6091  motor turns per turn of the drive's shaft, its own gear
// 6092  units of 6064 per turn of that shaft       60A8  the unit of 6064
// 606C  velocity in the unit of 60A9, while the joint moves: of a drive that tells turns per minute it measures counts
// Units of 6064 per motor turn are 6092 / 6091 (CiA 402: position factor); where 60A8 says turns, those;
// without either, the increments of 608F. What a drive has none of, or an unknown unit, is not judged.
// Nothing is written. Pure but for what it heard. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "drivers/bus/can_frame.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::commissioning {

struct OwnScale {
  enum class Verdict : std::uint8_t { not_judged, right, wrong };
  Verdict verdict = Verdict::not_judged;
  bool with_gear = false;  // gear_ratio is the drive's own, and judged with it
  std::string sentence;
};

class Cia402Scale {
 public:
  static constexpr Duration kAnswerWithin = milliseconds(50);
  static constexpr int kTries = 3;

  explicit Cia402Scale(const config::Drive& drive) : drive_(drive) {}

  // The question that is due, if any; `moves`: the velocity, again and again.
  std::optional<drivers::CanFrame> ask(bool moves, MonoTime now);
  void take(const drivers::CanFrame& frame);
  // Every object but the velocity was answered, or asked for often enough.
  [[nodiscard]] bool asked() const { return next_ >= kVelocity; }
  // What 606C said since it was last taken: rad/s of the motor, before the robot file's gear and direction.
  std::optional<double> take_velocity();
  // 60A9 says what the velocity counts.
  [[nodiscard]] bool knows_velocity_unit() const;
  [[nodiscard]] OwnScale judge() const;

 private:
  enum Which : std::uint8_t {
    kIncrements,
    kTurns,
    kGearMotor,
    kGearShaft,
    kFeed,
    kFeedShaft,
    kPositionUnit,
    kVelocityUnit,
    kVelocity
  };
  [[nodiscard]] std::optional<double> ratio(Which numerator, Which denominator) const;
  [[nodiscard]] double velocity_of(std::int32_t counts) const;

  config::Drive drive_;
  std::array<std::optional<std::uint32_t>, kVelocity> told_;
  std::size_t next_ = 0;
  int tries_ = 0;
  MonoTime asked_at_;  // unset: nothing waits for its answer
  std::optional<double> velocity_;
};

}  // namespace takt::commissioning
