// SPDX-License-Identifier: Apache-2.0
// Moves one joint a little, softly, without a policy: for finding out which drive is which and which way it turns.
//
// The reference starts where the joint is and goes to the target at `speed`; the spring between joint and reference is
// never stretched so far that it pulls with more than `torque`, so a blocked joint is pushed no harder than that.
// Drives that take a finished torque or velocity get the spring's, from a reading no older than 20 ms. The target
// must lie inside the joint's position limits, or on the way to them: otherwise nothing is enabled. Gravity, where it
// is known, is carried besides, by feed-forward torque: drives that close their own loop get it where their protocol
// has room for it. A joint that strays further than kOffRamp from the reference is released at once: it is blocked,
// falls, or turns the other way.
//
// phase      entered                              drive meanwhile
// finding    start                                disabled, polled, until gravity is known too
// asking     drive answers and is ready           disabled; a CiA 402 drive is asked for its own scale
// enabling   it was asked                         being enabled, zero torque
// moving     drive enabled                        follows the reference
// settling   reference at the target              held there for kSettle
// releasing  settled, failed, or stop() called    disabled, for kRelease
// ended      after that
// Units: joint side, rad, rad/s, Nm; of a slide m, m/s, N. Thread rule: one thread. Pure but for the driver's memory.
#pragma once

#include <cstdint>
#include <functional>
#include <numbers>
#include <optional>
#include <span>
#include <string>

#include "commissioning/cia402_scale.hpp"
#include "commissioning/velocity_fit.hpp"
#include "config/robot_config.hpp"
#include "drivers/protocol/joint_driver.hpp"
#include "drivers/protocol/shown_unit.hpp"

namespace takt::commissioning {

struct JogWish {
  double by = 0;
  double speed = 0;   // > 0
  double torque = 0;  // > 0
};

// What holds the joint still against gravity where the robot is now, joint side. Nothing: not known (yet).
using GravityTerm = std::function<std::optional<double>()>;

class JointJog {
 public:
  enum class Phase : std::uint8_t { finding, asking, enabling, moving, settling, releasing, ended };
  static constexpr Duration kFindWithin = seconds(3), kEnableWithin = seconds(3), kSettle = milliseconds(500),
                            kRelease = milliseconds(100);
  static constexpr double kOffRamp = 2;  // degrees; of a slide mm

  // `driver` must outlive this object. `gravity` empty: nothing is carried.
  JointJog(const config::Joint& joint, const JogWish& wish, drivers::JointDriver& driver, GravityTerm gravity = {});

  // Frames for this tick; call once per control period until ended().
  std::size_t tick(MonoTime now, std::span<drivers::CanFrame> out);
  // What arrives on the joint's bus, besides the driver.
  void take(const drivers::CanFrame& frame);
  void stop();

  [[nodiscard]] Phase phase() const { return phase_; }
  [[nodiscard]] bool ended() const { return phase_ == Phase::ended; }
  // Why it was cut short; empty: it was not.
  [[nodiscard]] const std::string& failure() const { return failure_; }
  [[nodiscard]] double started_at() const { return start_; }
  [[nodiscard]] double target() const { return target_; }
  [[nodiscard]] double moved() const;  // so far
  // What the readings so far say of the reported velocity; of a CiA 402 drive of 606C, since its driver makes one of
  // the very positions.
  [[nodiscard]] VelocityScale velocity_scale() const;
  // What a CiA 402 drive tells of its own scale; nothing: no other protocol does.
  [[nodiscard]] std::optional<OwnScale> own_scale() const;
  // Keys of the robot file that only an eye on the joint can judge: nothing that its drive tells gives them away.
  // "gear_ratio and counts_per_turn"; empty: none.
  [[nodiscard]] std::string believed() const;

 private:
  void enter(Phase phase, MonoTime now);
  void fail(const std::string& why, MonoTime now);
  void advance(MonoTime now);
  void find(MonoTime now);
  void aim(MonoTime now);
  void settle(MonoTime now);
  void take_velocity();
  void watch_drive(MonoTime now);
  void watch_ramp(MonoTime now);
  [[nodiscard]] float carried() const;
  [[nodiscard]] float within_limit(double torque) const;
  [[nodiscard]] double off_ramp() const { return kOffRamp * drivers::shown_unit(joint_.kind).size; }
  [[nodiscard]] std::string text_of(double q) const { return drivers::shown(joint_.kind, q); }
  [[nodiscard]] drivers::DriveSetpoint setpoint() const;
  [[nodiscard]] std::string reported() const;  // ": over-current", or nothing

  config::Joint joint_;
  JogWish wish_;
  drivers::JointDriver& driver_;
  GravityTerm gravity_;
  Phase phase_ = Phase::finding;
  MonoTime entered_, ticked_;
  bool stopping_ = false;
  double start_ = 0, target_ = 0, reference_ = 0, last_seen_ = 0;
  std::string failure_;
  VelocityFit fit_;
  std::optional<Cia402Scale> scale_;  // of cia402
};

}  // namespace takt::commissioning
