// SPDX-License-Identifier: Apache-2.0
// Goal: whatever a bundle's network is fed from, its loss has a reaction with a name, and from max_age after the last
// sample on no answer made of it moves the robot. Method: the walker in virtual time: the tick itself, the host's own
// judgement of samples, its network; one source is cut at a time while all others go on.
#include <gtest/gtest.h>

#include <functional>

#include "config/load.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "policy_host/onnx_policy.hpp"
#include "policy_host/responder.hpp"
#include "policy_host/sensor_link.hpp"
#include "tests/executive/pipeline/rig.hpp"
#include "tests/policy_host/leapp/walker.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

using pipeline::testing::Rig;

MonoTime g_now;
MonoTime clock_now() {
  return g_now;
}

class Walker {
 public:
  Walker() {
    const auto hash = config::policy_hash(robot_.policy->file).value();
    auto policy = load_robot_policy(robot_);
    if (!policy) throw std::runtime_error(policy.error());
    policy_ = *std::move(policy);
    responder_.emplace(robot_, hash, *policy_);
    responder_->start_session();
    pipeline::TickConfig config = setup::tick_config_of(robot_, hash);
    // Joints as light as a wrist ring at the rig's step of 1 ms: their velocities there are no motion's.
    config.feedback.contradiction = 0.0F;
    rig.emplace(config);
    command_ = sensor("base_velocity"), odometry_ = sensor("odometry");
    seen_[command_].value_count = 4;
    seen_[odometry_].value_count = 3;
    for (std::size_t j = 0; j < 29; ++j) rig->drives[j].q = 0.1F;
  }

  void arm() {
    for (int i = 0; i < 100; ++i) tick();
    tick(OperatorRequest::arm);
    for (int i = 0; i < 200 && rig->mode() != Mode::tracking; ++i) tick();
    for (int i = 0; i < 200; ++i) tick();
    if (rig->mode() == Mode::tracking) return;
    std::array<pipeline::ArmingBlocker, 4> blockers;
    const std::size_t count = arming_blockers(rig->out->record, rig->config, blockers);
    throw std::runtime_error(count == 0 ? "does not track" : std::string(blockers.front().what));
  }

  void tick(OperatorRequest request = OperatorRequest::none) {
    const MonoTime now = rig->now + rig->config.period;
    if (imu) {
      rig->input.imu.sequence += 1;
      rig->input.imu.sensed_at = now;
      rig->input.imu.acceleration[2] = 9.81F + 0.001F * static_cast<float>(rig->input.imu.sequence % 7);
    }
    if (command) sense(seen_[command_], now, 0.25F);
    if (odometry) sense(seen_[odometry_], now, 0.1F);
    rig->input.recorded_through = rig->input.tick;
    const bool answered = pending_ && answer(now);
    pending_ = false;
    rig->tick(answered ? chunk_ : nullptr, request);
    pending_ = rig->out->observation_due;
  }

  // The first of its inputs, as it was last shown.
  [[nodiscard]] float shown(std::size_t i) const { return responder_->inference().input[i]; }
  [[nodiscard]] const std::string& withheld() const { return withheld_; }
  [[nodiscard]] Duration max_age() const { return robot_.freshness.max_age; }

  std::optional<Rig> rig;
  bool imu = true, command = true, odometry = true;

 private:
  std::size_t sensor(const char* name) const {
    return static_cast<std::size_t>(std::ranges::find(robot_.sensors, name, &config::Sensor::name) -
                                    robot_.sensors.begin());
  }
  static void sense(SensorSample& sample, MonoTime now, float value) {
    sample.sequence += 1;
    sample.sensed_at = sample.published_at = now;
    std::fill_n(sample.values, sample.value_count, value);
  }
  // As the host does it, a tick after the observation was published.
  bool answer(MonoTime now) {
    g_now = now;
    withheld_ = take_usable(robot_, in_use_, seen_, now, used_);
    if (!withheld_.empty()) return false;
    chunk_ = &responder_->answer(rig->out->observation, used_, now, clock_now);
    return true;
  }

  test::TemporaryDirectory directory_;
  config::RobotConfig robot_ = loaded(directory_.path(), filled_in(imported_bundle(make_bundle(directory_.path()))));
  std::unique_ptr<Policy> policy_;
  std::optional<Responder> responder_;
  std::vector<std::size_t> in_use_ = sensors_in_use(robot_);
  std::vector<SensorSample> seen_{robot_.sensors.size()}, used_{robot_.sensors.size()};
  std::size_t command_ = 0, odometry_ = 0;
  const CommandChunk* chunk_ = nullptr;
  std::string withheld_;
  bool pending_ = false;
};

// Ticks from now until `done`, at most a second.
Duration ticks_until(Walker& walker, const std::function<bool()>& done) {
  const MonoTime from = walker.rig->now;
  while (!done() && walker.rig->now - from < seconds(1)) walker.tick();
  return walker.rig->now - from;
}

TEST(CutInputs, WithAllOfThemItTracksAndGainsStayInsideTheirLimits) {
  Walker walker;
  walker.arm();
  ASSERT_EQ(walker.rig->mode(), Mode::tracking);
  float largest_kp = 0, largest_kd = 0, asked_kd = 0;
  for (int i = 0; i < 500; ++i) {
    walker.tick();
    ASSERT_EQ(walker.rig->mode(), Mode::tracking) << i;
    EXPECT_EQ(walker.rig->header().player, Player::policy);
    if (walker.rig->out->observation_due) {
      EXPECT_EQ(walker.rig->out->observation.dq_of_drive[7], walker.rig->input.joints[7].dq) << "the drive's own word";
    }
    for (std::size_t j = 0; j < 29; ++j) {
      const auto& setpoint = walker.rig->out->setpoints[j];
      largest_kp = std::max(largest_kp, setpoint.kp);
      largest_kd = std::max(largest_kd, setpoint.kd);
      if ((walker.rig->out->record.joints[j].interventions & bit(Intervention::gain_limit)) != 0) asked_kd = 1;
    }
  }
  EXPECT_LE(largest_kp, 45.0F);
  EXPECT_GT(largest_kp, 40.0F) << "the network's own: the joints have 40";
  EXPECT_LE(largest_kd, 42.0F);
  EXPECT_GT(largest_kd, 4.0F);
  EXPECT_EQ(asked_kd, 1) << "the network asks for more than the limits, and that is marked";
}

TEST(CutInputs, WithoutTheJointsItStopsByFeedbackLost) {
  Walker walker;
  walker.arm();
  walker.rig->drives[5].silent = true;
  Cause cause = Cause::none;
  const Duration took = ticks_until(walker, [&] { return (cause = walker.rig->header().cause) != Cause::none; });
  EXPECT_EQ(cause, Cause::feedback_lost);
  EXPECT_LE(took, walker.max_age());
}

TEST(CutInputs, WithoutTheImuItStopsByImuLost) {
  Walker walker;
  walker.arm();
  walker.imu = false;
  Cause cause = Cause::none;
  const Duration took = ticks_until(walker, [&] { return (cause = walker.rig->header().cause) != Cause::none; });
  EXPECT_EQ(cause, Cause::imu_lost);
  EXPECT_LE(took, walker.max_age());
}

TEST(CutInputs, WithoutTheBasesVelocityNothingOldIsPlayed) {
  Walker walker;
  walker.arm();
  walker.odometry = false;
  const Duration unplayed = ticks_until(walker, [&] { return walker.rig->header().player == Player::none; });
  EXPECT_LE(unplayed, walker.max_age() + walker.rig->config.period);
  EXPECT_NE(walker.withheld().find("sensor odometry: its newest sample is older than 40 ms"), std::string::npos)
      << walker.withheld();
  Cause cause = walker.rig->header().cause;
  ticks_until(walker, [&] { return (cause = walker.rig->header().cause) != Cause::none; });
  EXPECT_EQ(cause, Cause::command_late);
  ticks_until(walker, [&] { return walker.rig->mode() == Mode::damped_stop; });
  EXPECT_EQ(walker.rig->header().cause, Cause::command_lost);
}

TEST(CutInputs, WithoutTheCommandWhatWasAgreedOnStandsIn) {
  Walker walker;
  walker.arm();
  EXPECT_EQ(walker.shown(3), 0.25F);
  walker.command = false;
  const Duration took = ticks_until(walker, [&] { return walker.shown(3) == 0.5F; });
  EXPECT_LE(took, walker.max_age() + milliseconds(20)) << "in the first observation after its time-out of 50 ms";
  EXPECT_EQ(walker.shown(0), 0.0F);
  for (int i = 0; i < 300; ++i) {
    walker.tick();
    ASSERT_EQ(walker.rig->mode(), Mode::tracking) << i;
  }
}

}  // namespace
}  // namespace takt::policy_host
