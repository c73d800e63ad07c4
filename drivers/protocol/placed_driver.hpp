// SPDX-License-Identifier: Apache-2.0
// A drive that does not know by itself where its joint is since power-on, whatever its protocol: the driver of that
// protocol, and before it what its readings are worth (config::PositionAfterPowerUp).
//
// within_a_turn   A reading is right but for whole turns of the drive's output. Of the places that it may mean, the one
//                 inside limits.position and its margin is taken, if no other one lies within kPlaceDoubt of them:
//                 shift() is what makes it of the reading. Else it is in doubt until the joint comes to where it is
//                 not, or the operator says it
// one_of_several  The same with smaller steps, which limits do not tell apart: the operator says it
// unknown         A reading says nothing: the operator says it
// The operator says it: assume_home(), beforehand.
//
// In doubt the drive has a fault, SetupFault::home_unknown, and is not enabled. It is in doubt at first, and again
// after kTicksToDoubt ticks without a reading, for what it knew may be gone with its supply, and after readings that no
// joint can go between. The fault waits for the next reading, which may settle it. Of a drive within a turn that is
// enabled such a jump is left for the tick to find. Thread rule: as JointDriver.
#pragma once

#include <memory>
#include <optional>

#include "config/robot_config.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::drivers {

// rad, joint side: how near to its limits a joint may be thought to stand that was pushed beyond them.
inline constexpr float kPlaceDoubt = 0.5F;

// All of it joint side, rad; of a slide m.
struct PlaceRule {
  float step = 0;                       // between places that the drive cannot tell apart; 0: a reading says nothing
  bool by_limits = false;               // they tell such places apart
  float low = 0, high = 0;              // where the joint may be: limits.position and its margin
  float reads_low = 0, reads_high = 0;  // what the drive can say and be told, by the robot file's offset
  float fastest = 0;                    // per tick
  float per_rad = 1;                    // JointLimits::per_rad, of kPlaceDoubt
};

// Between places that the drive cannot tell apart; 0: it knows its place, or no place at all. rad, joint side.
double place_step(const config::Drive& drive);

// Nothing: the drive knows its place, or is told it by its protocol's own means.
std::optional<PlaceRule> place_rule(const config::RobotConfig& robot, std::size_t joint);

class PlacedDriver final : public JointDriver {
 public:
  PlacedDriver(const PlaceRule& rule, std::unique_ptr<JointDriver> driver) noexcept
      : rule_(rule), driver_(std::move(driver)) {}

  std::size_t encode(bool enable, const DriveSetpoint& setpoint, MonoTime now, MonoTime valid_until,
                     std::span<CanFrame> out) noexcept override;
  [[nodiscard]] bool is_set_up() const noexcept override { return driver_->is_set_up(); }
  void assume_set_up() noexcept override { driver_->assume_set_up(); }
  void assume_home(float q, float tolerance) noexcept override { expected_ = Expected{q, tolerance}; }
  bool decode(const ReceivedFrame& received) noexcept override;
  [[nodiscard]] const JointFeedback& feedback() const noexcept override { return feedback_; }
  [[nodiscard]] float shift() const noexcept override { return shift_; }
  [[nodiscard]] std::uint32_t remark() const noexcept override { return driver_->remark(); }

 private:
  struct Expected {
    float q = 0, tolerance = 0;
  };
  void forget() noexcept;
  void take(float read) noexcept;
  [[nodiscard]] bool is_jump(float read) const noexcept;
  void place(float read) noexcept;
  void judge() noexcept;

  PlaceRule rule_;
  std::unique_ptr<JointDriver> driver_;
  JointFeedback feedback_;
  std::optional<Expected> expected_;  // to be compared with the next reading
  float shift_ = 0;
  float last_read_ = 0;
  bool known_ = false;
  bool enabled_ = false;      // as asked for last
  std::uint8_t replies_ = 0;  // of the newest reading
  std::uint32_t silent_ticks_ = 0;
};

}  // namespace takt::drivers
