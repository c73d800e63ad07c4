// SPDX-License-Identifier: Apache-2.0
// Goal: no bytes in the command mailbox, whatever their length, and no feedback, IMU or request can make the tick
// misbehave. Method: the input drives a simulated robot tick by tick; messages are taken from it raw, or laid over a
// sound header so that the fuzzer gets past the first checks. Every output must stay inside the envelope; sanitizers
// judge the rest.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "executive/pipeline/control_tick.hpp"
#include "tests/fuzz/source.hpp"

namespace {

using namespace takt;
using namespace takt::pipeline;
using fuzz::require;
using fuzz::Source;

constexpr std::uint32_t kJoints = 3;

TickConfig fuzzed_robot() {
  TickConfig config;
  config.period = milliseconds(1);
  config.joint_count = kJoints;
  config.bus_count = 1;
  config.observation_every_ticks = 4;
  config.freshness = {.max_age = milliseconds(50),
                      .aging_fraction = 0.8F,
                      .epsilon = 0.05,
                      .window_ticks = 100,
                      .recover_after = milliseconds(5),
                      .flap_memory = seconds(1),
                      .stop_after = milliseconds(20),
                      .degrade_after = milliseconds(15),
                      .bad_command_limit = 20};
  config.feedback_timeout = milliseconds(20);
  config.enable_timeout = milliseconds(50);
  config.late_share = 0.05;
  config.gravity_compensation = true;
  for (std::size_t j = 0; j < kJoints; ++j) {
    JointConfig& joint = config.joints[j];
    joint.limits = {-1.5F, 1.5F, 3.0F, 15.0F, 30.0F, 3000.0F, 200.0F, 6.0F, 0.15F, 8.0F, 0.15F};
    joint.kp = 100.0F;
    joint.kd = joint.damping = 4.0F;
    joint.inertia = 0.1F;
    joint.observer_bandwidth = 200.0F;
    config.links[j].parent = static_cast<std::int32_t>(j) - 1;
    config.links[j].axis = {0, 1, 0};
    config.links[j].origin_xyz = config.links[j].com = {0, 0, 0.2F};
    config.links[j].mass = 1.0F;
  }
  return config;
}

void check(const JointSetpoint& s, const JointLimits& limits) {
  require(std::isfinite(s.q + s.dq + s.kp + s.kd + s.tau));
  require(s.q >= limits.q_min - limits.q_hard_margin && s.q <= limits.q_max + limits.q_hard_margin);
  require(std::abs(s.dq) <= limits.velocity);
  require(s.kp >= 0 && s.kp <= limits.kp_max && s.kd >= 0 && s.kd <= limits.kd_max);
  require(std::abs(s.tau) <= limits.torque);
}

void check(const TickOutput& output, const TickConfig& config) {
  for (std::size_t j = 0; j < kJoints; ++j) {
    check(output.setpoints[j], config.joints[j].limits);
    check(output.damping[j], config.joints[j].limits);
    require(output.damping[j].kp == 0);
  }
  require(output.record.header.seats[Seat::policy].freshness == Freshness::missing ||
          output.record.header.age.total() >= Duration{0});
  require(!output.valid_until.is_set() || (output.valid_until >= output.record.header.now &&
                                           output.valid_until <= output.record.header.now + config.freshness.max_age));
}

class Session {
 public:
  explicit Session(std::uint8_t kind) {
    config_.interpolation = static_cast<Interpolation>(kind % 3);
    config_.imu = {(kind & 4U) != 0, milliseconds(50), seconds(1), 1.0F, 1.0F, 6.0F};
  }

  void tick(Source& source) {
    const std::uint8_t what = source.byte();
    ++input_.tick;
    input_.now = input_.now + milliseconds(1);
    input_.operator_request = static_cast<OperatorRequest>(what % kOperatorRequestCount);
    input_.last_damped = (what & 32U) != 0 ? source.byte() : 0;
    feed_back(source, (what & 4U) != 0);
    if (config_.imu.present) sense_base(source, (what & 64U) != 0);
    input_.messages[Seat::policy].mailbox = Arrival::none;
    input_.messages[Seat::policy].command = nullptr;
    if ((what & 8U) != 0) give_message(source, (what & 16U) != 0);
    control_tick(*state_, input_, config_, *output_);
    if (output_->observation_due) observation_ = output_->observation;
    check(*output_, config_);
  }

 private:
  void feed_back(Source& source, bool wild) {
    for (std::size_t j = 0; j < kJoints; ++j) {
      JointFeedback& feedback = input_.joints[j];
      feedback.received_at = input_.now - microseconds(source.byte());
      ++feedback.replies;
      feedback.drive_state = DriveState::enabled;
      feedback.q = output_->setpoints[j].q;
      if (wild) source.copy_to(&feedback.q, sizeof(feedback.q));
      if (wild) feedback.replies = source.byte();
    }
    if (wild) source.copy_to(&input_.buses[0], sizeof(BusHealth));
  }
  void sense_base(Source& source, bool wild) {
    input_.imu = {.sequence = input_.tick, .sensed_at = input_.now, .rotation = {1}, .acceleration = {0, 0, 9.81F}};
    if (wild) source.copy_to(&input_.imu, sizeof input_.imu);
  }
  void give_message(Source& source, bool behind_a_sound_header) {
    CommandHeader& header = chunk_->header;
    header = {};
    header.observation_id = observation_.id;
    header.sequence = ++sequence_;
    header.infer_started_at = header.infer_ended_at = header.published_at = header.dequeued_at =
        observation_.published_at;
    header.step_period = milliseconds(1 + source.byte() % 20);
    header.step_count = static_cast<std::uint16_t>(1 + source.byte() % kMaxChunkSteps);
    header.joint_count = kJoints;
    header.fields = static_cast<std::uint8_t>(1U | (source.byte() & 31U));
    if (behind_a_sound_header) {
      source.copy_to(chunk_->values, 4 * chunk_->value_count());
      input_.messages[Seat::policy].bytes = chunk_->used_bytes();
    } else {
      input_.messages[Seat::policy].bytes = std::size_t{source.byte()} * 4;
      source.copy_to(chunk_.get(), input_.messages[Seat::policy].bytes);
    }
    input_.messages[Seat::policy].mailbox = Arrival::accepted;
    input_.messages[Seat::policy].command = chunk_.get();
  }

  TickConfig config_ = fuzzed_robot();
  TickStatePtr state_ = make_tick_state(config_);
  std::unique_ptr<TickOutput> output_ = std::make_unique<TickOutput>();
  std::unique_ptr<CommandChunk> chunk_ = std::make_unique<CommandChunk>();
  Observation observation_;
  std::uint64_t sequence_ = 0;
  TickInput input_ = [] {
    TickInput input;
    input.now = {1'000'000'000};
    return input;
  }();
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source({data, size});
  Session session(source.byte());
  for (int i = 0; i < 400 && !source.is_empty(); ++i) session.tick(source);
  return 0;
}
