// SPDX-License-Identifier: Apache-2.0
// Goal: what a policy is told and what its commands say is true: newest observation only, what was dropped, when to
// forget, the oldest sample of everything read, its own stamps, packed fields; and the recorder is told what it was
// shown. Method: takt/client.h against an
// executive and a sensor on real sockets and mailboxes; the test publishes, then reads the commands.
#include "client/takt/client.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "monitor/record/policy_input_message.hpp"
#include "tests/executive/pipeline/rig.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/support/files.hpp"
#include "tests/support/replaced.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::client {
namespace {

using policy_host::FakeExecutive;
using policy_host::FakeSensor;

constexpr std::int64_t kLongNs = 10'000'000'000;
constexpr std::int64_t kShortNs = 30'000'000;
constexpr std::uint32_t kJoints = 6, kSteps = 16, kRoom = 1024;
const std::array<takt_term, 3> kTerms{{{TAKT_TERM_Q, 0, nullptr, nullptr, nullptr},
                                       {TAKT_TERM_DQ, 0, nullptr, nullptr, nullptr},
                                       {TAKT_TERM_STREAM, 3, "target", nullptr, nullptr}}};

takt_policy_spec spec_of(const char* robot_file, const std::string& directory) {
  takt_policy_spec spec{};
  spec.size = sizeof spec;
  spec.term_count = kTerms.size();
  spec.terms = kTerms.data();
  spec.robot_file = robot_file;
  spec.runtime_directory = directory.c_str();
  spec.program = "client_test";
  spec.step = "10 ms";
  spec.steps = kSteps;
  return spec;
}

class ClientTest : public testing::Test {
 protected:
  // No stall of the machine makes a sample too old, unless a test asks for arm6's own 200 ms.
  ClientTest() : spec_(spec_of("config/arm6.yaml", directory_.path())) {
    robot_file_with("values: 3, timeout: 200 ms", "values: 3, timeout: 20 s");
  }
  void samples_last_200_ms() { spec_.robot_file = "config/arm6.yaml"; }
  ~ClientTest() override { takt_policy_close(policy_); }

  // From here on the robot file is arm6's with something replaced.
  void robot_file_with(const std::string& what, const std::string& by) {
    robot_file_ = directory_.path() + "/robot.yaml";
    const std::string policy = std::filesystem::absolute("config/arm6_reach.onnx");
    const std::string arm =
        test::replaced(test::text_of("config/arm6.yaml"), "file: arm6_reach.onnx", "file: " + policy);
    std::ofstream(robot_file_) << test::replaced(arm, what, by);
    spec_.robot_file = robot_file_.c_str();
  }
  // From here on the robot file is arm6's with another policy.action.interpolation.
  void steps_joined_by(const std::string& interpolation) {
    robot_file_with("action: { kind: joint_position,",
                    "action: { kind: joint_position, interpolation: " + interpolation + ",");
  }
  // From here on the robot file is arm6's with its sensor as a queue, and the policy reads q and that.
  void queue_of(const std::string& samples) {
    robot_file_with("values: 3, timeout: 200 ms", "values: 3, timeout: 20 s, queue: " + samples);
    static const std::array<takt_term, 2> terms{
        {{TAKT_TERM_Q, 0, nullptr, nullptr, nullptr}, {TAKT_TERM_QUEUE, 3, "target", nullptr, nullptr}}};
    spec_.terms = terms.data();
    spec_.term_count = terms.size();
  }
  void takes_speculation() {
    robot_file_with("  steps: 16\n", "  steps: 16\n  speculation: { position: 0.05 rad, velocity: 0.5 rad/s }\n");
  }
  // A speculative answer: every joint at q, moving with dq.
  int publish_assuming(std::int64_t at_ns, float q, float dq, float target) {
    std::vector<float> values(kSteps * kJoints, target), positions(kJoints, q), velocities(kJoints, dq);
    const takt_assumption assumption{sizeof assumption, 0, at_ns, positions.data(), velocities.data()};
    takt_chunk given = chunk(values);
    given.assumes = &assumption;
    return takt_policy_publish(policy_, &given);
  }
  void serve_executive() {
    const auto robot = config::load(spec_.robot_file);
    ASSERT_TRUE(robot) << robot.error();
    largest_input_ = config::largest_policy_input(*robot);
    executive_ = std::make_unique<FakeExecutive>(config::executive_socket(directory_.path()), largest_input_);
  }
  // What the library said that it handed out for the newest answer; once the policy is attached.
  monitor::PolicyInput shown() {
    if (!inputs_) {
      inputs_.emplace(executive_->inputs(largest_input_));
      input_reader_.emplace(
          ipc::SlotReader::attach(inputs_->readable(), ipc::policy_input_ring(largest_input_)).value());
    }
    std::vector<std::byte> payload(largest_input_);
    const ipc::ReadResult read = input_reader_->read_latest(payload);
    EXPECT_EQ(read.status, ipc::ReadStatus::fresh);
    auto input = monitor::read_policy_input(std::span(payload).first(read.size));
    EXPECT_TRUE(input) << "it is no policy_input.hpp";
    return input.value_or(monitor::PolicyInput{});
  }
  void start_servers() {
    serve_executive();
    if (!sensor_) sensor_ = std::make_unique<FakeSensor>(config::sensor_socket(directory_.path(), "target"));
  }
  void open_and_attach() {
    start_servers();
    ASSERT_EQ(takt_policy_open(&spec_, &policy_, why_.data(), kRoom), TAKT_OK) << why_.data();
    ASSERT_EQ(takt_policy_attach(policy_, kLongNs), TAKT_OK) << takt_policy_sentence(policy_);
    wait_for_acknowledgement();
    sense(now());
  }
  void wait_for_acknowledgement() {
    const MonoTime give_up = monotonic_now() + seconds(20);
    while (!executive_->acknowledged() && monotonic_now() < give_up) sleep_until(monotonic_now() + milliseconds(1));
  }
  static MonoTime now() { return monotonic_now(); }
  void sense(MonoTime at, float first = 0.5F) {
    SensorSample sample;
    sample.sequence = ++sample_sequence_;
    sample.sensed_at = at;
    sample.value_count = 3;
    for (std::size_t i = 0; i < 3; ++i) sample.values[i] = static_cast<float>(i) + first;
    sensor_->publish(sample);
  }
  void observe(std::uint64_t id, Mode mode = Mode::tracking) {
    Observation observation;
    observation.id = id;
    observation.published_at = now();
    observation.oldest_sensed_at = observation.published_at - milliseconds(1);
    observation.period = milliseconds(20);
    observation.joint_count = kJoints;
    observation.mode = static_cast<std::uint8_t>(mode);
    for (std::size_t j = 0; j < kJoints; ++j) {
      observation.q[j] = static_cast<float>(j);
      observation.dq[j] = 10.0F * static_cast<float>(j);
    }
    executive_->publish(observation);
  }
  const takt_observation& next(std::uint64_t id, Mode mode = Mode::tracking) {
    observe(id, mode);
    EXPECT_EQ(takt_policy_next(policy_, kLongNs), TAKT_OK) << takt_policy_sentence(policy_);
    return *takt_policy_observation(policy_);
  }
  takt_chunk chunk(std::vector<float>& values) const {
    takt_chunk chunk{};
    chunk.size = sizeof chunk;
    chunk.q = values.data();
    return chunk;
  }
  int publish(float first = 0.0F) {
    std::vector<float> values(kSteps * kJoints, 0.0F);
    values[0] = first;
    const takt_chunk given = chunk(values);
    return takt_policy_publish(policy_, &given);
  }
  std::string refusal() {
    takt_policy* policy = nullptr;
    EXPECT_EQ(takt_policy_open(&spec_, &policy, why_.data(), kRoom), TAKT_BAD_CONFIG);
    EXPECT_EQ(policy, nullptr);
    return why_.data();
  }

  test::TemporaryDirectory directory_;
  takt_policy_spec spec_;
  std::string robot_file_;
  std::unique_ptr<FakeExecutive> executive_;
  std::unique_ptr<FakeSensor> sensor_;
  takt_policy* policy_ = nullptr;
  std::array<char, kRoom> why_{};
  std::uint64_t sample_sequence_ = 0;
  std::size_t largest_input_ = 0;
  std::optional<ipc::Segment> inputs_;
  std::optional<ipc::SlotReader> input_reader_;
};

// Goal: for every published answer the recorder is told what the policy was shown, as it was handed out: the quantities
// of the joints that its terms name, the sample behind its stream, the promise, and when it was to forget.
TEST_F(ClientTest, EveryAnswerLeavesWhatThePolicyWasShown) {
  open_and_attach();
  const takt_observation& seen = next(1);
  ASSERT_EQ(publish(), TAKT_OK);
  const monitor::PolicyInput first = shown();
  EXPECT_EQ(first.header.observation_id, 1U);
  EXPECT_EQ(first.header.sequence, 1U);
  EXPECT_EQ(first.header.inference, 1U);
  EXPECT_EQ(first.header.policy_hash, takt_policy_robot(policy_)->policy_hash);
  EXPECT_EQ(first.header.by_client, 1);
  EXPECT_EQ(first.header.built_in, 0);
  EXPECT_EQ(first.header.after_reset, 1);
  EXPECT_EQ(first.joints[0], std::vector<float>({0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(first.joints[1], std::vector<float>({0, 10, 20, 30, 40, 50}));
  EXPECT_TRUE(first.joints[2].empty() && first.joints[3].empty() && first.joints[4].empty()) << "no term names them";
  ASSERT_EQ(first.samples.size(), 1U);
  EXPECT_EQ(first.samples[0].sequence, 1U);
  EXPECT_EQ(first.samples[0].sensed_at.ns, seen.outside_sensed_ns);
  EXPECT_EQ(first.sample_values, std::vector<float>({0.5F, 1.5F, 2.5F}));
  EXPECT_TRUE(first.input.empty() && first.output.empty()) << "the policy's own affair";
  EXPECT_EQ(first.header.following, 0U);

  Observation promised;
  promised.id = 2;
  promised.published_at = promised.oldest_sensed_at = now();
  promised.period = milliseconds(20);
  promised.joint_count = kJoints;
  promised.mode = static_cast<std::uint8_t>(Mode::tracking);
  promised.command_sequence = 1;
  promised.committed_from = 2;
  promised.committed_count = 4;
  executive_->publish(promised);
  sense(now(), 8);
  ASSERT_EQ(takt_policy_next(policy_, kLongNs), TAKT_OK) << takt_policy_sentence(policy_);
  ASSERT_EQ(publish(), TAKT_OK);
  ASSERT_EQ(publish(), TAKT_OK);
  const monitor::PolicyInput third = shown();
  EXPECT_EQ(third.header.observation_id, 2U);
  EXPECT_EQ(third.header.sequence, 3U);
  EXPECT_EQ(third.header.inference, 3U) << "every answer, also two to one observation";
  EXPECT_EQ(third.header.after_reset, 0);
  EXPECT_EQ(third.header.following, 1U);
  EXPECT_EQ(third.header.committed_from, 2U);
  EXPECT_EQ(third.header.committed_count, 4U);
  EXPECT_EQ(third.joints[0], std::vector<float>(kJoints, 0));
  EXPECT_EQ(third.sample_values[0], 8.0F);
}

// What came in since and was not handed out is no part of an answer to what was.
TEST_F(ClientTest, AnAnswerLeavesWhatWasHandedOutAndNotWhatCameSince) {
  samples_last_200_ms();
  open_and_attach();
  next(1);
  sense(now() - seconds(1), 8);  // too old: the next observation is not passed on
  observe(2);
  ASSERT_EQ(takt_policy_next(policy_, kShortNs), TAKT_NOTHING);
  ASSERT_EQ(publish(), TAKT_OK);
  const monitor::PolicyInput input = shown();
  EXPECT_EQ(input.header.observation_id, 1U);
  ASSERT_EQ(input.samples.size(), 1U);
  EXPECT_EQ(input.samples[0].sequence, 1U);
  EXPECT_EQ(input.sample_values[0], 0.5F);
}

TEST_F(ClientTest, WhatAQueueHandedOutIsShownSampleBySample) {
  queue_of("4");
  open_and_attach();
  const MonoTime at = now();
  for (int i = 1; i <= 6; ++i) sense(at + nanoseconds(i), static_cast<float>(i));
  const takt_observation& seen = next(1);
  ASSERT_EQ(seen.queues[0].count, 4U);
  ASSERT_EQ(publish(), TAKT_OK);
  const monitor::PolicyInput input = shown();
  ASSERT_EQ(input.samples.size(), 4U);
  ASSERT_EQ(input.sample_values.size(), 12U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(input.samples[i].sequence, 4U + i) << "open_and_attach() published one";
    EXPECT_EQ(input.samples[i].sensed_at.ns, seen.queues[0].sensed_ns[i]);
    EXPECT_EQ(input.sample_values[3 * i], seen.queues[0].values[3 * i]);
  }
  EXPECT_EQ(input.joints[0].size(), kJoints);
  next(2);
  ASSERT_EQ(publish(), TAKT_OK);
  EXPECT_TRUE(shown().samples.empty()) << "nothing new";
}

TEST_F(ClientTest, WhatIsNotRecordedNeedsNoRing) {
  robot_file_with("keyframe_period: 1 s", "keyframe_period: 1 s\n  policy_inputs: false");
  open_and_attach();
  EXPECT_EQ(largest_input_, 0U);
  next(1);
  EXPECT_EQ(publish(), TAKT_OK);
}

std::vector<float> firsts_of(const takt_queue& queue) {
  std::vector<float> firsts;
  for (std::uint32_t i = 0; i < queue.count; ++i) firsts.push_back(queue.values[std::size_t{i} * queue.value_count]);
  return firsts;
}

TEST_F(ClientTest, AQueueGivesWhatCameSinceTheLastObservationAndSaysWhatIsMissing) {
  queue_of("4");
  open_and_attach();
  const takt_queue& queue = next(1).queues[0];
  ASSERT_EQ(takt_policy_observation(policy_)->queue_count, 1U);
  EXPECT_EQ(queue.capacity, 4U);
  EXPECT_EQ(queue.value_count, 3U);
  EXPECT_EQ(firsts_of(queue), (std::vector<float>{0.5F}));
  EXPECT_EQ(queue.dropped, 0U);

  const MonoTime first = now();
  for (const float value : {1.0F, 2.0F, 3.0F}) sense(first + Duration{static_cast<std::int64_t>(value)}, value);
  EXPECT_EQ(next(2).outside_sensed_ns, first.ns + 3) << "the newest counts";
  EXPECT_EQ(firsts_of(queue), (std::vector<float>{1, 2, 3})) << "oldest first";
  EXPECT_EQ(queue.sensed_ns[0], first.ns + 1);
  EXPECT_EQ(queue.sensed_ns[2], first.ns + 3);
  EXPECT_EQ(queue.dropped, 0U);

  for (const float value : {1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F}) sense(first, value);
  next(3);
  EXPECT_EQ(firsts_of(queue), (std::vector<float>{3, 4, 5, 6})) << "the newest stay";
  EXPECT_EQ(queue.dropped, 2U);

  sense(first, 7);
  sense(first, std::numeric_limits<float>::quiet_NaN());
  sense(first, 8);
  next(4);
  EXPECT_EQ(firsts_of(queue), (std::vector<float>{7, 8}));
  EXPECT_EQ(queue.dropped, 1U) << "what is NaN is not shown";

  EXPECT_EQ(next(5).outside_sensed_ns, first.ns) << "nothing new: the one before still is the newest";
  EXPECT_EQ(queue.count, 0U);
  EXPECT_EQ(queue.dropped, 0U);

  constexpr int kMany = 300;  // more than the mailbox holds
  for (int i = 1; i <= kMany; ++i) sense(first, static_cast<float>(i));
  next(6);
  EXPECT_EQ(firsts_of(queue), (std::vector<float>{297, 298, 299, 300}));
  EXPECT_EQ(queue.dropped, 296U) << "overwritten ones are counted too";
}

TEST_F(ClientTest, AQueueWhoseNewestSampleIsUnusableStopsObservations) {
  queue_of("4");
  open_and_attach();
  next(1);
  sense(now(), std::numeric_limits<float>::quiet_NaN());
  observe(2);
  EXPECT_EQ(takt_policy_next(policy_, kShortNs), TAKT_NOTHING);
  sense(now(), 9);
  EXPECT_EQ(firsts_of(next(3).queues[0]), (std::vector<float>{9}));
  EXPECT_EQ(takt_policy_observation(policy_)->queues[0].dropped, 1U);
}

TEST_F(ClientTest, AQueueIsOneInTheRobotFile) {
  queue_of("4");
  spec_.robot_file = "config/arm6.yaml";
  EXPECT_NE(refusal().find("sensor target gives its newest sample only"), std::string::npos) << why_.data();
  const std::array<takt_term, 2> twice{
      {{TAKT_TERM_QUEUE, 3, "target", nullptr, nullptr}, {TAKT_TERM_QUEUE, 3, "target", nullptr, nullptr}}};
  spec_.robot_file = robot_file_.c_str();
  spec_.terms = twice.data();
  EXPECT_NE(refusal().find("the policy reads queue target twice"), std::string::npos) << why_.data();
}

TEST_F(ClientTest, ShowsTheTermsInTheirOrder) {
  open_and_attach();
  const takt_observation& seen = next(1);
  EXPECT_EQ(seen.id, 1U);
  EXPECT_STREQ(seen.mode, "tracking");
  ASSERT_EQ(seen.value_count, 15U);
  EXPECT_FLOAT_EQ(seen.values[5], 5.0F);
  EXPECT_FLOAT_EQ(seen.values[6 + 5], 50.0F);
  EXPECT_FLOAT_EQ(seen.values[12 + 2], 2.5F);
  const takt_robot& robot = *takt_policy_robot(policy_);
  EXPECT_EQ(robot.joint_count, kJoints);
  EXPECT_STREQ(robot.joints[5], "wrist_yaw");
  EXPECT_FLOAT_EQ(robot.home[2], -1.2F);
}

TEST_F(ClientTest, ReturnsTheNewestOnceAndCountsWhatItDropped) {
  open_and_attach();
  next(1);
  observe(2);
  observe(3);
  EXPECT_EQ(next(4).id, 4U);
  EXPECT_EQ(takt_policy_observation(policy_)->dropped, 2U);
  EXPECT_EQ(takt_policy_next(policy_, kShortNs), TAKT_NOTHING) << "returned before";
  ASSERT_EQ(publish(), TAKT_OK);
  CommandChunk command;
  ASSERT_TRUE(executive_->read(command));
  EXPECT_EQ(command.header.dropped_observations, 2U);
  EXPECT_EQ(command.header.observation_id, 4U);
}

TEST_F(ClientTest, SaysWhenToForget) {
  open_and_attach();
  EXPECT_EQ(next(1).reset, 1U) << "a new session";
  EXPECT_EQ(next(2).reset, 0U);
  ASSERT_EQ(publish(std::numeric_limits<float>::quiet_NaN()), TAKT_OK) << "the executive judges values";
  EXPECT_EQ(next(3).reset, 1U) << "its own answer was not finite";
  EXPECT_EQ(next(4).reset, 0U);
  EXPECT_EQ(next(5, Mode::arming).reset, 1U);
  EXPECT_EQ(next(5 + 7).reset, 1U) << "a long gap";
  executive_.reset();
  EXPECT_EQ(takt_policy_next(policy_, kShortNs), TAKT_NOTHING);
  start_servers();
  ASSERT_EQ(takt_policy_attach(policy_, kLongNs), TAKT_OK);
  wait_for_acknowledgement();
  sense(now());
  EXPECT_EQ(next(1).reset, 1U) << "attached again";
  ASSERT_EQ(publish(), TAKT_OK);
  CommandChunk command;
  ASSERT_TRUE(executive_->read(command));
  EXPECT_EQ(command.header.sequence, 1U) << "of the new session";
}

TEST_F(ClientTest, TheOldestSampleReadIsInEveryCommand) {
  open_and_attach();
  const MonoTime sensed = now() - milliseconds(90);
  sense(sensed);
  const takt_observation& seen = next(1);
  EXPECT_EQ(seen.outside_sensed_ns, sensed.ns);
  ASSERT_EQ(publish(), TAKT_OK);
  CommandChunk command;
  ASSERT_TRUE(executive_->read(command));
  EXPECT_EQ(command.header.outside_sensed_at, sensed);
}

TEST_F(ClientTest, AnObservationWithoutAUsableSampleIsNotPassedOn) {
  samples_last_200_ms();
  open_and_attach();
  sense(now() - seconds(1));
  observe(1);
  EXPECT_EQ(takt_policy_next(policy_, kShortNs), TAKT_NOTHING);
  EXPECT_NE(std::string(takt_policy_sentence(policy_)).find("sensor target: its newest sample is older than 200 ms"),
            std::string::npos)
      << takt_policy_sentence(policy_);
  sense(now());
  EXPECT_EQ(next(2).id, 2U);
}

TEST_F(ClientTest, StampsTelescope) {
  open_and_attach();
  CommandChunk command;
  next(1);
  ASSERT_EQ(publish(), TAKT_OK);
  ASSERT_TRUE(executive_->read(command));
  EXPECT_EQ(command.header.infer_started_at, command.header.dequeued_at) << "unstamped: all of it is inference";
  EXPECT_EQ(command.header.infer_ended_at, command.header.published_at);
  next(2);
  EXPECT_EQ(takt_policy_infer_end(policy_), TAKT_USAGE);
  ASSERT_EQ(takt_policy_infer_begin(policy_), TAKT_OK);
  ASSERT_EQ(takt_policy_infer_end(policy_), TAKT_OK);
  ASSERT_EQ(publish(), TAKT_OK);
  ASSERT_TRUE(executive_->read(command));
  EXPECT_LT(command.header.dequeued_at, command.header.infer_started_at);
  EXPECT_LE(command.header.infer_started_at, command.header.infer_ended_at);
  EXPECT_LE(command.header.infer_ended_at, command.header.published_at);
  EXPECT_LE(command.header.published_at, now());
}

TEST_F(ClientTest, AnAssumptionIsRefusedWhereTheExecutiveWouldRefuseIt) {
  open_and_attach();
  const std::int64_t seen = next(1).published_ns;
  EXPECT_EQ(publish_assuming(seen + 1, 0, 0, 0), TAKT_USAGE);
  EXPECT_NE(std::string(takt_policy_sentence(policy_)).find("add policy.speculation"), std::string::npos);
  takt_policy_close(policy_);
  executive_.reset();
  takes_speculation();
  open_and_attach();
  EXPECT_EQ(publish_assuming(next(1).published_ns, 0, 0, 0), TAKT_USAGE) << "the observation's own instant";
  std::vector<float> values(kSteps * kJoints, 0.0F);
  takt_assumption nothing{sizeof nothing, 0, INT64_MAX, nullptr, nullptr};
  takt_chunk given = chunk(values);
  given.assumes = &nothing;
  EXPECT_EQ(takt_policy_publish(policy_, &given), TAKT_USAGE);
  given.assumes = nullptr;
  given.size = offsetof(takt_chunk, assumes);  // a program from before there were any
  ASSERT_EQ(takt_policy_publish(policy_, &given), TAKT_OK);
  CommandChunk command;
  ASSERT_TRUE(executive_->read(command));
  EXPECT_EQ(command.header.sequence, 1U);
}

// Goal: from takt/client.h to the tick: of two alternatives the one whose assumption comes true is what the robot
// follows, and nothing makes it younger than what it rests on. Method: observations of a tick in virtual time go
// through real mailboxes to the library, its commands back into the tick.
TEST_F(ClientTest, OfTwoAlternativesTheOneThatCameTrueIsPlayed) {
  takes_speculation();
  open_and_attach();
  const auto robot = config::load(robot_file_);
  ASSERT_TRUE(robot) << robot.error();
  pipeline::TickConfig config = setup::tick_config_of(*robot, takt_policy_robot(policy_)->policy_hash);
  config.freshness.max_age = seconds(20);  // the machine may stall between here and the tick
  pipeline::testing::Rig rig(config, now());
  const auto show_next = [&] {
    do rig.tick();
    while (!rig.out->observation_due);
    sense(now());
    executive_->publish(rig.out->observation);
    ASSERT_EQ(takt_policy_next(policy_, kLongNs), TAKT_OK) << takt_policy_sentence(policy_);
  };
  rig.now = now() - config.period;
  ASSERT_NO_FATAL_FAILURE(show_next());
  const MonoTime first{takt_policy_observation(policy_)->published_ns};
  const auto command = std::make_unique<CommandChunk>();
  for (const float assumed : {0.6F, 0.02F})
    ASSERT_EQ(publish_assuming(first.ns + milliseconds(15).ns, assumed, 0.1F, 2 * assumed), TAKT_OK);
  EXPECT_FALSE(executive_->read(*command)) << "both wait for their instant, in this process";
  ASSERT_NO_FATAL_FAILURE(show_next());
  ASSERT_TRUE(executive_->read(*command));
  const takt_alternatives& counts = *takt_policy_alternatives(policy_);
  EXPECT_EQ(counts.kept, 2U);
  EXPECT_EQ(counts.taken, 1U) << "0.02 of 0.05 rad; 0.1 of 0.5 rad/s";
  EXPECT_EQ(counts.unmatched, 1U);
  rig.now = std::max(now(), rig.now);
  rig.tick(command.get());
  ASSERT_EQ(name(rig.header().seats[Seat::policy].arrival), "accepted");
  EXPECT_EQ(rig.header().seats[Seat::policy].command_sequence, 1U);
  EXPECT_EQ(command->values[0], 0.04F);
  EXPECT_GE(rig.header().age.total(), rig.now - first) << "no younger than the samples that it rests on";
}

TEST_F(ClientTest, PacksEveryFieldWhereTheExecutiveReadsIt) {
  steps_joined_by("hold");
  open_and_attach();
  next(1);
  std::array<std::vector<float>, 5> given;
  for (std::size_t field = 0; field < 5; ++field) {
    for (std::size_t i = 0; i < kSteps * kJoints; ++i) given.at(field).push_back(static_cast<float>(1000 * field + i));
  }
  takt_chunk all = chunk(given[0]);
  all.dq = given[1].data();
  all.kp = given[2].data();
  all.kd = given[3].data();
  all.tau_ff = given[4].data();
  ASSERT_EQ(takt_policy_publish(policy_, &all), TAKT_OK);
  CommandChunk command;
  ASSERT_TRUE(executive_->read(command));
  EXPECT_EQ(command.header.fields, kAllCommandFields);
  EXPECT_EQ(command.header.step_period, milliseconds(10));
  const std::array<CommandField, 5> fields{CommandField::q, CommandField::dq, CommandField::kp, CommandField::kd,
                                           CommandField::tau_ff};
  for (std::size_t field = 0; field < 5; ++field)
    EXPECT_FLOAT_EQ(command.values[value_index(command.header, fields.at(field), 7, 3)],
                    static_cast<float>(1000 * field + 7 * kJoints + 3));
}

// Goal: what the executive would refuse for its shape, and soon stop the robot for, is told to the author at once.
TEST_F(ClientTest, VelocitiesBelongWhereTheRobotFileJoinsStepsByThem) {
  std::vector<float> values(kSteps * kJoints, 0.0F);
  takt_chunk with = chunk(values), without = with;
  with.dq = values.data();
  open_and_attach();  // linear
  next(1);
  EXPECT_EQ(takt_policy_publish(policy_, &with), TAKT_USAGE);
  EXPECT_NE(std::string(takt_policy_sentence(policy_)).find("leave dq out"), std::string::npos);
  EXPECT_EQ(takt_policy_publish(policy_, &without), TAKT_OK);
  takt_policy_close(policy_);
  executive_.reset();
  steps_joined_by("cubic");
  open_and_attach();
  next(1);
  EXPECT_EQ(takt_policy_publish(policy_, &without), TAKT_USAGE);
  EXPECT_NE(std::string(takt_policy_sentence(policy_)).find("give dq"), std::string::npos);
  EXPECT_EQ(takt_policy_publish(policy_, &with), TAKT_OK);
}

TEST_F(ClientTest, RefusesWhatDoesNotFitTheRobotFileInOneSentence) {
  spec_.steps = 12;
  EXPECT_NE(refusal().find("policy.steps is 16, the policy's chunks have 12: make them equal"), std::string::npos)
      << why_.data();
  spec_.steps = kSteps;
  spec_.step = "33.3 ms";
  EXPECT_NE(refusal().find("policy.step_period is 10 ms, the policy's is 33.3 ms"), std::string::npos) << why_.data();
  spec_.step = "10";
  EXPECT_NE(refusal().find("step \"10\""), std::string::npos) << why_.data();
  spec_.step = "10 ms";
  auto terms = kTerms;
  terms[2].stream = "cam0";
  spec_.terms = terms.data();
  EXPECT_NE(refusal().find("stream 'cam0', which `sensors` does not list (there is target)"), std::string::npos)
      << why_.data();
  terms[2] = {TAKT_TERM_STREAM, 4, "target", nullptr, nullptr};
  EXPECT_NE(refusal().find("sensor target has 3 values, the policy's stream of that name 4"), std::string::npos)
      << why_.data();
  spec_.term_count = 2;
  EXPECT_NE(refusal().find("policy.observation lists sensor target, which the policy does not read"), std::string::npos)
      << why_.data();
  spec_.robot_file = "/nowhere/robot.yaml";
  EXPECT_NE(refusal().find("/nowhere/robot.yaml"), std::string::npos) << why_.data();
}

TEST_F(ClientTest, JoinUnitAndAgeAreComparedWhereThePolicySaysThem) {
  samples_last_200_ms();
  spec_.join = "cross_fade";
  auto terms = kTerms;
  terms[2] = {TAKT_TERM_STREAM, 3, "target", "unstated", "0.2 s"};
  spec_.terms = terms.data();
  takt_policy* policy = nullptr;
  EXPECT_EQ(takt_policy_open(&spec_, &policy, why_.data(), kRoom), TAKT_OK) << why_.data();
  takt_policy_close(policy);
  terms[2].unit = "m";
  EXPECT_NE(refusal().find("sensor target gives unstated, the policy reads m: make them equal (`unit` there)"),
            std::string::npos)
      << why_.data();
  terms[2].unit = nullptr;
  terms[2].max_age = "80 ms";
  EXPECT_NE(refusal().find("sensor target has the timeout 200 ms, the policy's max_age is 80 ms: make them equal"),
            std::string::npos)
      << why_.data();
  terms[2].max_age = "80";
  EXPECT_NE(refusal().find("max_age \"80\" of the policy's target"), std::string::npos) << why_.data();
  terms[2].max_age = nullptr;
  spec_.join = "rtc";
  EXPECT_NE(refusal().find("policy.action.join is cross_fade, the policy's chunks are made for rtc: write `join: { "
                           "kind: prefix }` in policy.action there, or have the policy say cross_fade"),
            std::string::npos)
      << why_.data();
  spec_.join = "smooth";
  EXPECT_NE(refusal().find("there is no such join; there are replace, cross_fade, blend, ensemble, align, quintic, "
                           "prefix, and rtc, which is prefix"),
            std::string::npos)
      << why_.data();
}

TEST_F(ClientTest, RtcIsPrefix) {
  robot_file_with("join: { kind: cross_fade }", "join: { kind: prefix }");
  for (const char* join : {"rtc", "prefix"}) {
    spec_.join = join;
    takt_policy* policy = nullptr;
    EXPECT_EQ(takt_policy_open(&spec_, &policy, why_.data(), kRoom), TAKT_OK) << why_.data();
    takt_policy_close(policy);
  }
}

// A program compiled with an older header has a shorter spec, and shorter terms one after the other.
TEST_F(ClientTest, AProgramOfBeforeJoinsAndUnitsStillRuns) {
  struct OldTerm {
    std::uint32_t kind, values;
    const char* stream;
  };
  const std::array<OldTerm, 3> terms{
      {{TAKT_TERM_Q, 0, nullptr}, {TAKT_TERM_DQ, 0, nullptr}, {TAKT_TERM_STREAM, 3, "target"}}};
  spec_.terms = reinterpret_cast<const takt_term*>(terms.data());
  spec_.join = reinterpret_cast<const char*>(&spec_);  // what lies behind an older spec is not read
  for (const std::size_t size : {offsetof(takt_policy_spec, join), offsetof(takt_policy_spec, candidate_file)}) {
    spec_.size = static_cast<std::uint32_t>(size);
    takt_policy* policy = nullptr;
    EXPECT_EQ(takt_policy_open(&spec_, &policy, why_.data(), kRoom), TAKT_OK) << why_.data();
    takt_policy_close(policy);
  }
}

// Goal: an observation shows what it promises of this policy's own chunk, as a network is given it, and of no other.
TEST_F(ClientTest, WhatIsPromisedIsShownAsRowsOfTheAnswer) {
  robot_file_with("join: { kind: cross_fade }", "join: { kind: prefix }");
  spec_.join = "rtc";
  open_and_attach();
  const std::int64_t begins = next(1).published_ns;
  EXPECT_EQ(takt_policy_observation(policy_)->committed, nullptr);
  std::vector<float> values(kSteps * kJoints);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i);
  const takt_chunk given = chunk(values);
  ASSERT_EQ(takt_policy_publish(policy_, &given), TAKT_OK);
  ASSERT_EQ(publish(std::numeric_limits<float>::quiet_NaN()), TAKT_OK) << "refused, and never played";

  Observation promised;
  promised.joint_count = kJoints;
  promised.mode = static_cast<std::uint8_t>(Mode::tracking);
  promised.period = milliseconds(20);
  promised.committed_count = 2;
  const auto show = [&](std::uint64_t id, std::uint64_t sequence,
                        std::uint8_t of_candidate) -> const takt_observation& {
    promised.id = id;
    promised.published_at = promised.oldest_sensed_at = MonoTime{begins};  // before either answer came
    promised.command_sequence = sequence;
    promised.of_candidate = of_candidate;
    executive_->publish(promised);
    sense(now());
    EXPECT_EQ(takt_policy_next(policy_, kLongNs), TAKT_OK) << takt_policy_sentence(policy_);
    return *takt_policy_observation(policy_);
  };
  const takt_observation& seen = show(2, 1, 0);
  ASSERT_NE(seen.committed, nullptr);
  EXPECT_EQ(std::vector<float>(seen.committed, seen.committed + 2 * kJoints),
            std::vector<float>(values.begin(), values.begin() + 2 * kJoints));
  EXPECT_EQ(seen.committed_count, 2U);
  for (const auto& [id, sequence, of_candidate, why] :
       {std::tuple{3, 1, 1, "the candidate's"}, std::tuple{4, 9, 0, "of an earlier session, left in the mailbox"}}) {
    const takt_observation& other = show(static_cast<std::uint64_t>(id), static_cast<std::uint64_t>(sequence),
                                         static_cast<std::uint8_t>(of_candidate));
    EXPECT_EQ(other.committed, nullptr) << why;
    EXPECT_EQ(other.following + other.committed_from + other.committed_count, 0U) << why;
  }
}

TEST_F(ClientTest, WhatCannotBeMeantIsUsage) {
  auto terms = kTerms;
  terms[0].unit = "rad";
  spec_.terms = terms.data();
  takt_policy* no_policy = nullptr;
  EXPECT_EQ(takt_policy_open(&spec_, &no_policy, why_.data(), kRoom), TAKT_USAGE) << "of a term that is no sensor's";
  spec_.terms = kTerms.data();
  spec_.size = 8;
  takt_policy* none = nullptr;
  EXPECT_EQ(takt_policy_open(&spec_, &none, why_.data(), kRoom), TAKT_USAGE);
  spec_.size = sizeof spec_;
  open_and_attach();
  EXPECT_EQ(publish(), TAKT_USAGE) << "nothing to answer yet";
  next(1);
  takt_policy_detach(policy_);
  EXPECT_EQ(publish(), TAKT_USAGE);
  EXPECT_FLOAT_EQ(takt_policy_observation(policy_)->values[5], 5.0F) << "may still be read";
}

TEST_F(ClientTest, WaitsForNobodyLongerThanItIsTold) {
  ASSERT_EQ(takt_policy_open(&spec_, &policy_, why_.data(), kRoom), TAKT_OK) << why_.data();
  EXPECT_EQ(takt_policy_attach(policy_, kShortNs), TAKT_NOTHING);
  EXPECT_NE(std::string(takt_policy_sentence(policy_)).find("no process listens"), std::string::npos);
}

TEST_F(ClientTest, AnExecutiveThatRefusesIsNoneToWaitFor) {
  const policy_host::Serving refusing(config::executive_socket(directory_.path()),
                                      {.admit =
                                           [](const ipc::Peer&) {
                                             return ipc::Admission{"another robot: go away", {}};
                                           },
                                       .acknowledged = {},
                                       .recorded = {},
                                       .left = {},
                                       .request = {}});
  ASSERT_EQ(takt_policy_open(&spec_, &policy_, why_.data(), kRoom), TAKT_OK) << why_.data();
  EXPECT_EQ(takt_policy_attach(policy_, kLongNs), TAKT_REFUSED);
  EXPECT_STREQ(takt_policy_sentence(policy_), "another robot: go away");
}

// A robot file with a camera and a force sensor beside arm6's own; the policy reads what the test says.
class SensorTest : public ClientTest {
 protected:
  SensorTest() {
    std::string robot = test::text_of("config/arm6.yaml");
    const auto insert_after = [&robot](const std::string& where, const std::string& what) {
      robot.insert(robot.find(where) + where.size(), what);
    };
    const std::string network = "file: arm6_reach.onnx";
    robot.replace(robot.find(network), network.size(), "file: " + policy_file_);
    robot.replace(robot.find("timeout: 200 ms }                # target"), 15, "timeout: 60 s  ");
    insert_after("\nsensors:\n",
                 "  - { name: cam0, image: { height: 3, width: 4, channels: 2 }, timeout: 60 s }\n"
                 "  - { name: force, values: 6, timeout: 50 ms, unit: N }\n");
    insert_after("  observation:                # in input order\n", "    - { term: sensor, sensor: cam0 }\n");
    robot_file_ = directory_.path() + "/robot.yaml";
    std::ofstream(robot_file_) << robot;
    spec_.robot_file = robot_file_.c_str();
    spec_.terms = terms_.data();
    spec_.term_count = static_cast<std::uint32_t>(terms_.size());
  }
  takt_sensor_spec camera(std::uint32_t height = 3, std::uint32_t width = 4) const {
    takt_sensor_spec spec = any_sensor("cam0");
    spec.type = TAKT_UINT8;
    spec.height = height, spec.width = width, spec.channels = 2;
    return spec;
  }
  takt_sensor_spec floats(const char* name, std::uint32_t values) const {
    takt_sensor_spec spec = any_sensor(name);
    spec.values = values;
    return spec;
  }
  takt_sensor* opened(const takt_sensor_spec& spec) {
    takt_sensor* sensor = nullptr;
    EXPECT_EQ(takt_sensor_open(&spec, &sensor, why_.data(), kRoom), TAKT_OK) << why_.data();
    return sensor;
  }
  std::string refusal_of(const takt_sensor_spec& spec, int code = TAKT_BAD_CONFIG) {
    takt_sensor* sensor = nullptr;
    EXPECT_EQ(takt_sensor_open(&spec, &sensor, why_.data(), kRoom), code);
    EXPECT_EQ(sensor, nullptr);
    return why_.data();
  }
  static void fill(takt_sensor* sensor, std::uint8_t value) {
    std::fill_n(static_cast<std::uint8_t*>(takt_sensor_values(sensor)), 24, value);
  }

  std::array<takt_term, 3> terms_{{{TAKT_TERM_Q, 0, nullptr, nullptr, nullptr},
                                   {TAKT_TERM_IMAGE, 24, "cam0", nullptr, nullptr},
                                   {TAKT_TERM_STREAM, 3, "target", nullptr, nullptr}}};

 private:
  [[nodiscard]] takt_sensor_spec any_sensor(const char* name) const {
    takt_sensor_spec spec{};
    spec.size = sizeof spec;
    spec.robot_file = robot_file_.c_str();
    spec.runtime_directory = directory_.path().c_str();
    spec.name = name;
    return spec;
  }
  std::string policy_file_ = std::filesystem::absolute("config/arm6_reach.onnx");
};

TEST_F(SensorTest, AnImageReachesThePolicyWithItsStampInTheAge) {
  takt_sensor* const camera = opened(this->camera());
  takt_sensor* const target = opened(floats("target", 3));
  sensor_.reset();
  serve_executive();
  ASSERT_EQ(takt_policy_open(&spec_, &policy_, why_.data(), kRoom), TAKT_OK) << why_.data();
  ASSERT_EQ(takt_policy_attach(policy_, kLongNs), TAKT_OK) << takt_policy_sentence(policy_);
  wait_for_acknowledgement();
  static_cast<float*>(takt_sensor_values(target))[2] = 2.5F;
  ASSERT_EQ(takt_sensor_publish(target, now().ns), TAKT_OK);
  const std::int64_t shutter = (now() - milliseconds(30)).ns;
  fill(camera, 7);
  ASSERT_EQ(takt_sensor_publish(camera, shutter), TAKT_OK);
  const takt_observation& seen = next(1);
  ASSERT_EQ(seen.image_count, 1U);
  EXPECT_EQ(seen.images[0][23], 7);
  ASSERT_EQ(seen.value_count, 6U + 3U) << "an image is in no vector of floats";
  EXPECT_FLOAT_EQ(seen.values[8], 2.5F);
  EXPECT_EQ(seen.outside_sensed_ns, shutter);
  ASSERT_EQ(publish(), TAKT_OK);
  const monitor::PolicyInput input = shown();
  ASSERT_EQ(input.samples.size(), 2U) << "in the order of the robot file's sensors";
  EXPECT_EQ(input.samples[0].sensor, 0U) << "the image, named";
  EXPECT_EQ(input.samples[0].sequence, 1U);
  EXPECT_EQ(input.samples[0].sensed_at.ns, shutter);
  EXPECT_EQ(input.samples[0].value_count, 0U);
  EXPECT_EQ(input.samples[1].sensor, 2U);
  EXPECT_EQ(input.sample_values, std::vector<float>({0, 0, 2.5F}));
  const std::uint8_t* const where = seen.images[0];
  fill(camera, 9);
  ASSERT_EQ(takt_sensor_publish(camera, now().ns), TAKT_OK);
  EXPECT_EQ(next(2).images[0], where) << "addresses never change";
  EXPECT_EQ(where[0], 9);

  // An image that is too old is not passed on, though it is whole and the newest.
  fill(camera, 11);
  ASSERT_EQ(takt_sensor_publish(camera, (now() - seconds(61)).ns), TAKT_OK);
  observe(3);
  EXPECT_EQ(takt_policy_next(policy_, kShortNs), TAKT_NOTHING);
  EXPECT_EQ(std::string(takt_policy_sentence(policy_))
                .find("no observation is passed on: sensor cam0: its newest sample is older than 60000 ms"),
            0U)
      << takt_policy_sentence(policy_);

  // Killed while it fills an image: the last whole one stays.
  fill(camera, 9);
  ASSERT_EQ(takt_sensor_publish(camera, now().ns), TAKT_OK);
  EXPECT_EQ(next(4).images[0][5], 9);
  fill(camera, 200);
  takt_sensor_close(camera);
  EXPECT_EQ(next(5).images[0][5], 9);
  takt_sensor_close(target);
}

TEST_F(SensorTest, WhoeverWritesToAPublishedImageSpoilsItAndIsNotBelieved) {
  takt_sensor* const camera = opened(this->camera());
  serve_executive();
  sensor_ = std::make_unique<FakeSensor>(config::sensor_socket(directory_.path(), "target"));
  ASSERT_EQ(takt_policy_open(&spec_, &policy_, why_.data(), kRoom), TAKT_OK) << why_.data();
  ASSERT_EQ(takt_policy_attach(policy_, kLongNs), TAKT_OK) << takt_policy_sentence(policy_);
  wait_for_acknowledgement();
  sense(now());
  auto* const memory = static_cast<std::uint8_t*>(takt_sensor_values(camera));
  ASSERT_EQ(takt_sensor_publish(camera, now().ns), TAKT_OK);
  memory[3] = 1;
  observe(1);
  EXPECT_EQ(takt_policy_next(policy_, kShortNs), TAKT_NOTHING);
  EXPECT_NE(std::string(takt_policy_sentence(policy_)).find("sensor cam0: no sample"), std::string::npos);
  takt_sensor_close(camera);
}

TEST_F(SensorTest, SaysWhatTheRobotFileHas) {
  takt_sensor* const sensor = opened(floats("force", 6));
  const takt_stream& stream = *takt_sensor_stream(sensor);
  EXPECT_STREQ(stream.name, "force");
  EXPECT_STREQ(stream.unit, "N");
  EXPECT_EQ(stream.timeout_ns, 50'000'000);
  EXPECT_EQ(stream.values, 6U);
  takt_sensor_close(sensor);
  ASSERT_EQ(takt_policy_open(&spec_, &policy_, why_.data(), kRoom), TAKT_OK) << why_.data();
  EXPECT_EQ(takt_policy_stream(policy_, "cam0")->width, 4U);
  EXPECT_EQ(takt_policy_stream(policy_, "cam1"), nullptr);
}

TEST_F(SensorTest, IsRefusedInOneSentenceWhereItIsNotWhatTheRobotFileSays) {
  const auto says = [this](const takt_sensor_spec& spec, const char* sentence, int code = TAKT_BAD_CONFIG) {
    EXPECT_NE(refusal_of(spec, code).find(sentence), std::string::npos) << why_.data();
  };
  says(floats("lidar", 3), "`sensors` does not list 'lidar' (there is cam0, force, target)");
  says(floats("force", 3), "sensor force gives 6 values, this one 3: make them equal");
  says(camera(4, 3), "sensor cam0 gives images of 3 x 4 x 2, this one 4 x 3 x 2: make them equal");
  says(floats("cam0", 24), "sensor cam0 gives images of uint8, 3 x 4 x 2");
  takt_sensor_spec pounds = floats("force", 6);
  pounds.unit = "lbf";
  says(pounds, "sensor force gives N, this one lbf");
  takt_sensor* const first = opened(floats("force", 6));
  says(floats("force", 6), "", TAKT_REFUSED);
  EXPECT_NE(std::string(why_.data()), "");
  takt_sensor_close(first);
  takt_sensor_spec old = floats("force", 6);
  old.size = 8;
  says(old, "takt_sensor_spec has another size", TAKT_USAGE);
}

TEST_F(SensorTest, AStampThatIsAfterNowIsUsage) {
  takt_sensor* const sensor = opened(floats("force", 6));
  EXPECT_EQ(takt_sensor_publish(sensor, (now() + seconds(1)).ns), TAKT_USAGE);
  EXPECT_NE(std::string(takt_sensor_sentence(sensor)).find("CLOCK_MONOTONIC"), std::string::npos);
  EXPECT_EQ(takt_sensor_publish(sensor, 0), TAKT_USAGE);
  EXPECT_EQ(takt_sensor_publish(sensor, now().ns), TAKT_OK);
  takt_sensor_close(sensor);
  takt_sensor_close(nullptr);
}

}  // namespace
}  // namespace takt::client
