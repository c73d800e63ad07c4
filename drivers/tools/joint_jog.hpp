// Moves one joint a little, softly, without a policy: for finding out which drive is which and which way it turns.
//
// The reference starts where the joint is and goes to the target at `speed`; the spring between joint and reference is
// never stretched so far that it pulls with more than `torque`, so a blocked joint is pushed no harder than that.
// Drives that take a finished torque or velocity get the spring's, from a reading no older than 20 ms. The target
// stays inside the joint's position limits. No gravity compensation: a loaded joint sags by torque / kp at most,
// or falls when `torque` cannot carry it.
//
// phase      entered                              drive meanwhile
// finding    start                                disabled, polled
// enabling   drive answers and is ready           being enabled, zero torque
// moving     drive enabled                        follows the reference
// settling   reference at the target              held there for kSettle
// releasing  settled, failed, or stop() called    disabled, for kRelease
// ended      after that
// Units: joint side, rad, rad/s, Nm. Thread rule: one thread. Pure but for the driver's memory.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "config/robot_config.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::drivers {

struct JogWish {
  double by = 0;      // rad
  double speed = 0;   // rad/s > 0
  double torque = 0;  // Nm > 0
};

class JointJog {
 public:
  enum class Phase : std::uint8_t { finding, enabling, moving, settling, releasing, ended };
  static constexpr Duration kFindWithin = seconds(3), kEnableWithin = seconds(3), kSettle = milliseconds(500),
                            kRelease = milliseconds(100);

  // `driver` must outlive this object.
  JointJog(const config::Joint& joint, const JogWish& wish, JointDriver& driver);

  // Frames for this tick; call once per control period until ended().
  std::size_t tick(MonoTime now, std::span<CanFrame> out);
  void stop();

  [[nodiscard]] Phase phase() const { return phase_; }
  [[nodiscard]] bool ended() const { return phase_ == Phase::ended; }
  // Why it was cut short; empty: it was not.
  [[nodiscard]] const std::string& failure() const { return failure_; }
  [[nodiscard]] double started_at() const { return start_; }  // rad
  [[nodiscard]] double target() const { return target_; }     // rad
  [[nodiscard]] double moved() const;                         // rad, so far

 private:
  void enter(Phase phase, MonoTime now);
  void fail(const std::string& why, MonoTime now);
  void advance(MonoTime now);
  void watch_drive(MonoTime now);
  [[nodiscard]] DriveSetpoint setpoint() const;
  [[nodiscard]] std::string reported() const;  // ": over-current", or nothing

  config::Joint joint_;
  JogWish wish_;
  JointDriver& driver_;
  Phase phase_ = Phase::finding;
  MonoTime entered_, ticked_;
  bool stopping_ = false;
  double start_ = 0, target_ = 0, reference_ = 0, last_seen_ = 0;
  std::string failure_;
};

}  // namespace takt::drivers
