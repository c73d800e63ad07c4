// SPDX-License-Identifier: Apache-2.0
// Leads one joint slowly against its mechanical stop, with a torque that it is never pushed harder than, and says where
// it came to stand. For a joint whose position is not known yet: limits.position cannot hold, gravity cannot be
// computed and is not carried. Anything odd ends it with the drive disabled.
//
// phase      entered                              drive meanwhile
// finding    start                                disabled, polled
// enabling   drive answers and is ready           being enabled, zero torque
// searching  drive enabled                        pulled along by a spring that never pulls harder than `torque`
// releasing  stop found, failed, or give_up()     disabled, for kRelease
// ended      after that
// A stop is where the joint, pulled with all of `torque`, does not move by kStill for kStandsFor, having moved by
// kLeastWay before: one that did not move is blocked, or too heavy, or was at the stop already, and which, the
// search cannot tell. Units: joint side, rad, rad/s, Nm; of a slide m, m/s, N. Thread rule: one thread. Pure but for
// the driver's memory.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "config/robot_config.hpp"
#include "drivers/protocol/joint_driver.hpp"
#include "drivers/protocol/shown_unit.hpp"

namespace takt::commissioning {

struct StopWish {
  int direction = 1;  // +1 or -1, as the joint counts
  double speed = 0;   // > 0
  double torque = 0;  // > 0
  double within = 0;  // > 0: further than that there is no stop
};

class StopSearch {
 public:
  enum class Phase : std::uint8_t { finding, enabling, searching, releasing, ended };
  static constexpr Duration kFindWithin = seconds(3), kEnableWithin = seconds(3), kStandsFor = milliseconds(500),
                            kRelease = milliseconds(100), kSpare = seconds(5);
  static constexpr double kStill = 0.3, kLeastWay = 1, kAstray = 2;  // degrees; of a slide mm

  // `driver` must outlive this object; it is told to do without its home.
  StopSearch(const config::Joint& joint, const StopWish& wish, drivers::JointDriver& driver);

  // Frames for this tick; call once per control period until ended().
  std::size_t tick(MonoTime now, std::span<drivers::CanFrame> out);
  void give_up();

  [[nodiscard]] bool ended() const { return phase_ == Phase::ended; }
  // Why no stop was found; empty: it was.
  [[nodiscard]] const std::string& failure() const { return failure_; }
  // What the drive read there.
  [[nodiscard]] double stop_at() const { return stood_at_; }

 private:
  void enter(Phase phase, MonoTime now);
  void fail(const std::string& why, MonoTime now);
  void advance(MonoTime now);
  void find(MonoTime now);
  void begin(MonoTime now);
  void search(MonoTime now);
  void watch_drive(MonoTime now);
  [[nodiscard]] double stretch() const;  // of the spring, at most
  [[nodiscard]] std::string text_of(double q) const { return drivers::shown(joint_.kind, q); }
  [[nodiscard]] drivers::DriveSetpoint setpoint(MonoTime now) const;

  config::Joint joint_;
  StopWish wish_;
  drivers::JointDriver& driver_;
  Phase phase_ = Phase::finding;
  MonoTime entered_, ticked_, stands_since_;
  double unit_;  // a degree; of a slide a millimetre
  double start_ = 0, reference_ = 0, stood_at_ = 0;
  std::string failure_;
};

}  // namespace takt::commissioning
