// SPDX-License-Identifier: Apache-2.0
// Goal: what our drivers say passes the guard whenever the tick kept its limits, and a driver with a fault does not get
// a push onto the wire that the tick did not decide.
// Method: each protocol's driver and simulated drive work together in virtual time on a joint that moves at random.
// Every tick, the pipeline's own stabiliser makes a setpoint from a random wish, so that it is inside every limit. The
// driver is given that setpoint and the guard must let its frames pass; or a mutant of it, as a driver with that fault
// would encode it: then whatever passes must either still be what was decided, within the wire's rounding, or ask for
// nothing. How often each mutant was refused is checked too: a mutant that no frame shows was not tested. Seeded.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "config/drive_loop.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/pipeline/envelope.hpp"
#include "executive/pipeline/stabiliser.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "simulation/device_table.hpp"
#include "tests/drivers/guard/guard_bench.hpp"

namespace takt::drivers {
namespace {

constexpr Duration kTick = milliseconds(1);
constexpr int kTicks = 4000;

// What the driver is told, when the tick decided `wanted`; `before`: eight ticks ago.
struct Told {
  bool enable = true;
  DriveSetpoint setpoint;
  Duration life = milliseconds(40);
};
enum class Field : std::uint8_t { position, velocity, gains, torque, all };
struct Mutant {
  const char* name;
  Field in;
  std::function<void(Told&, const DriveSetpoint& before)> plant;
};

// What an encoder, or the code between the tick and it, could get wrong.
const std::vector<Mutant>& mutants() {
  using S = DriveSetpoint;
  static const std::vector<Mutant> all{
      {"torque's sign flipped", Field::torque, [](Told& t, const S&) { t.setpoint.tau = -t.setpoint.tau; }},
      {"torque's scale wrong", Field::torque, [](Told& t, const S&) { t.setpoint.tau *= 1.5F; }},
      {"torque's clamp missing", Field::torque, [](Told& t, const S&) { t.setpoint.tau = 400; }},
      {"velocity twice", Field::velocity, [](Told& t, const S&) { t.setpoint.dq *= 2; }},
      {"velocity's sign flipped", Field::velocity, [](Told& t, const S&) { t.setpoint.dq = -t.setpoint.dq; }},
      {"kp and kd swapped", Field::gains, [](Told& t, const S&) { std::swap(t.setpoint.kp, t.setpoint.kd); }},
      {"stiffness over the gear once", Field::gains, [](Told& t, const S&) { t.setpoint.kp *= 4; }},
      {"damping left out", Field::gains, [](Told& t, const S&) { t.setpoint.kd = 0; }},
      {"direction forgotten", Field::position, [](Told& t, const S&) { t.setpoint.q = -t.setpoint.q; }},
      {"zero's offset forgotten", Field::position, [](Told& t, const S&) { t.setpoint.q += 0.3F; }},
      {"position's clamp missing", Field::position, [](Told& t, const S&) { t.setpoint.q = 12; }},
      {"stale setpoint", Field::all, [](Told& t, const S& before) { t.setpoint = before; }},
  };
  return all;
}

struct Case {
  const char* joint;
  config::Cia402Mode mode = config::Cia402Mode::cst;
};
constexpr std::array kCases{Case{"left_shoulder"},                             // mit, damiao
                            Case{"left_elbow"},                                // mit, tmotor, direction -1
                            Case{"left_wrist_roll"},                           // robstride
                            Case{"left_wrist_pitch"},                          // odrive
                            Case{"right_elbow"},                               // odrive, gear -8
                            Case{"right_wrist_roll"},                          // moteus
                            Case{"right_base_yaw"},                            // cia402 CST
                            Case{"right_base_yaw", config::Cia402Mode::csv},   //
                            Case{"right_base_yaw", config::Cia402Mode::csp}};  //

config::RobotConfig robot_of(const Case& one) {
  config::RobotConfig robot = test::every_protocol();
  config::Joint joint = robot.joints[test::joint_named(robot, one.joint)];
  joint.drive.mode = one.mode;
  robot.joints = {joint};
  return robot;
}

class Rehearsal {
 public:
  Rehearsal(const Case& one, std::uint64_t seed)
      : one_(one),
        robot_(robot_of(one)),
        limits_(setup::tick_config_of(robot_, 0).joints[0]),
        driver_(make_joint_driver(robot_, 0).value()),
        device_(simulation::make_device(robot_.joints[0].drive, milliseconds(100))),
        guard_(robot_),
        random_(seed) {}

  // Until the drive is enabled and has been driven without a push for a while.
  void enable() {
    for (int tick = 0; tick < 4000; ++tick) {
      decided_ = {};
      exchange({.enable = tick > 3000, .setpoint = {}}, tick > 3000);
    }
    ASSERT_EQ(driver_->feedback().drive_state, DriveState::enabled);
  }

  // One tick of random motion, a wish and its setpoint. Returns the verdict of the frame that drives.
  WireVerdict tick(const Mutant* mutant) {
    move();
    const float reference_before = reference_;
    decided_ = decide();
    Told told{.setpoint = decided_};
    history_[static_cast<std::size_t>(ticks_++) % history_.size()] = decided_;
    if (mutant != nullptr) mutant->plant(told, history_[static_cast<std::size_t>(ticks_) % history_.size()]);
    told_ = told.setpoint;
    measured_ = {driver_->feedback().q, driver_->feedback().dq};
    const WireVerdict verdict = exchange(told, true);
    // What never left is undone; without stiffness the drive stayed where it is.
    if (verdict != WireVerdict::allowed) reference_ = reference_before;
    if (verdict == WireVerdict::allowed && told_.kp == 0) reference_ = measured_.q;
    // The next tick starts from the torque that went out.
    if (mutant != nullptr && verdict == WireVerdict::allowed)
      tau_last_ = std::clamp(torque_of(told_), -limits_.limits.torque, limits_.limits.torque);
    return verdict;
  }

  // What the driver was told last comes, within the wire's rounding, to what was decided; or it asks for nothing.
  [[nodiscard]] bool is_harmless() const {
    const bool stays = told_.kp == 0 || std::abs(told_.q - measured_.q) < 2e-4F;
    if (one_.mode == config::Cia402Mode::csp && stays) return true;
    if (one_.mode == config::Cia402Mode::csv && std::abs(told_.dq) < 2e-4F) return true;
    if (!has_torque()) return is_as_decided();
    return brakes() || std::abs(torque_of(told_)) < 0.01F * limits_.limits.torque || is_as_decided();
  }

 private:
  [[nodiscard]] float torque_of(const DriveSetpoint& s) const {
    return s.kp * (s.q - measured_.q) + s.kd * (s.dq - measured_.dq) + s.tau;
  }

  [[nodiscard]] bool has_torque() const { return one_.mode == config::Cia402Mode::cst; }
  [[nodiscard]] bool is_as_decided() const {
    if (one_.mode == config::Cia402Mode::csp) return std::abs(told_.q - decided_.q) < 2e-4F;
    if (one_.mode == config::Cia402Mode::csv) return std::abs(told_.dq - decided_.dq) < 2e-4F;
    return std::abs(torque_of(told_) - torque_of(decided_)) < 0.02F * limits_.limits.torque;
  }
  [[nodiscard]] bool brakes() const { return told_.kp == 0 && torque_of(told_) * measured_.dq <= 0; }

  float uniform(float low, float high) { return std::uniform_real_distribution<float>(low, high)(random_); }

  void move() {
    const auto& range = limits_.limits;
    speed_ = std::clamp(speed_ + uniform(-0.05F, 0.05F), -range.velocity, range.velocity);
    q_ += speed_ * 0.001F;
    if (q_ > range.q_max - 0.1F || q_ < range.q_min + 0.1F)
      speed_ = -speed_, q_ = std::clamp(q_, range.q_min + 0.1F, range.q_max - 0.1F);
  }

  DriveSetpoint decide() {
    const pipeline::JointMotion measured{driver_->feedback().q, driver_->feedback().dq};
    if (ticks_ % 50 == 0) {
      wish_ = {uniform(limits_.limits.q_min, limits_.limits.q_max), uniform(-1, 1) * limits_.limits.velocity,
               uniform(0, limits_.limits.kp_max), uniform(0, limits_.limits.kd_max),
               uniform(-1, 1) * limits_.limits.torque};
      if (ticks_ % 200 == 0) wish_.kp = 0;
    }
    // A reference moves no faster than the limit: the drives' own position loops are told where to be. Without
    // stiffness it moves with the joint.
    const float step = limits_.limits.velocity * 0.001F;
    reference_ = wish_.kp > 0 ? std::clamp(wish_.q, reference_ - step, reference_ + step) : measured.q;
    auto out = pipeline::stabilise_joint(
        {{reference_, wish_.dq}, measured, wish_.kp, wish_.kd, wish_.tau, 0, tau_last_, false}, limits_, 0.001F);
    EXPECT_EQ(pipeline::clamp_to_envelope(out.setpoint, tau_last_, measured.q, measured.dq, limits_.limits),
              pipeline::EnvelopeVerdict::inside);
    return {out.setpoint.q, out.setpoint.dq, out.setpoint.kp, out.setpoint.kd, out.setpoint.tau};
  }

  WireVerdict exchange(const Told& told, bool enabled) {
    now_ = now_ + kTick;
    simulation::Frames said;
    std::array<CanFrame, kMaxFramesPerDrive> out;
    const std::size_t count = driver_->encode(told.enable, told.setpoint, now_, now_ + told.life, out);
    JointRecord record;
    record.feedback = driver_->feedback();
    record.q_estimate = record.feedback.q;
    record.dq_estimate = record.feedback.dq;
    record.q_command = decided_.q;
    record.dq_command = decided_.dq;
    record.kp_command = decided_.kp;
    record.kd_command = decided_.kd;
    record.tau_command = decided_.tau;
    WireVerdict worst = WireVerdict::allowed;
    for (CanFrame& frame : std::span(out).first(count)) {
      const WireVerdict verdict =
          guard_.pass(0, robot_.joints[0].bus, {now_, now_, now_ + milliseconds(40), enabled}, record, frame);
      if (verdict != WireVerdict::allowed) worst = verdict;
      device_->receive(frame, now_, said);
    }
    // After a refusal the tick starts from no torque, as the pipeline does.
    if (worst != WireVerdict::allowed) tau_last_ = 0;
    const double ratio = robot_.joints[0].drive.direction * robot_.joints[0].drive.gear_ratio;
    device_->update({q_ * ratio, speed_ * ratio}, now_, kTick, said);
    for (CanFrame& frame : said) {
      // The motion is imposed, so the drive pushes as hard as it may: that is no news (statusword bit 11).
      if (one_.mode != config::Cia402Mode::cst && frame.id == 0x180 + robot_.joints[0].drive.id) frame.data[1] &= 0xF7;
      driver_->decode({frame, now_});
    }
    return worst;
  }

  Case one_;
  config::RobotConfig robot_;
  pipeline::JointConfig limits_;
  std::unique_ptr<JointDriver> driver_;
  std::unique_ptr<simulation::Device> device_;
  WireGuard guard_;
  std::mt19937_64 random_;
  MonoTime now_{1'000'000'000};
  float q_ = 0, speed_ = 0, reference_ = 0, tau_last_ = 0;
  DriveSetpoint wish_, decided_, told_;
  pipeline::JointMotion measured_{};  // what was decided on
  std::array<DriveSetpoint, 8> history_{};
  int ticks_ = 0;
};

TEST(GuardedDrivers, EveryFrameOfAHealthyDriverPasses) {
  for (const Case& one : kCases) {
    Rehearsal rehearsal(one, 1);
    rehearsal.enable();
    for (int tick = 0; tick < kTicks; ++tick)
      ASSERT_EQ(rehearsal.tick(nullptr), WireVerdict::allowed)
          << one.joint << ' ' << static_cast<int>(one.mode) << ", tick " << tick;
  }
}

// A mutant of a field that the drive is not told does not show.
bool shows(const config::Drive& drive, const Mutant& mutant) {
  switch (config::loop_closed_by(drive)) {
    case config::LoopClosedBy::drive:
      return drive.protocol != config::DriveProtocol::cia402 || mutant.in == Field::position || mutant.in == Field::all;
    case config::LoopClosedBy::host_torque:
      return mutant.in == Field::torque || mutant.in == Field::all;
    case config::LoopClosedBy::host_velocity:
      return mutant.in == Field::velocity || mutant.in == Field::all;
  }
  return false;
}

TEST(GuardedDrivers, NoMutantPushesOtherwiseThanDecided) {
  for (const Case& one : kCases) {
    for (const Mutant& mutant : mutants()) {
      if (!shows(robot_of(one).joints[0].drive, mutant)) continue;
      Rehearsal rehearsal(one, 2);
      rehearsal.enable();
      int refused = 0;
      for (int tick = 0; tick < kTicks; ++tick) {
        const bool planted = tick % 10 == 9;
        const bool allowed = rehearsal.tick(planted ? &mutant : nullptr) == WireVerdict::allowed;
        ASSERT_TRUE(planted || allowed) << one.joint << ": " << mutant.name << ", a healthy tick " << tick;
        ASSERT_TRUE(!planted || !allowed || rehearsal.is_harmless())
            << one.joint << ": " << mutant.name << ", tick " << tick;
        refused += allowed ? 0 : 1;
      }
      EXPECT_GT(refused, kTicks / 10 / 20) << one.joint << ": " << mutant.name;
    }
  }
}

}  // namespace
}  // namespace takt::drivers
